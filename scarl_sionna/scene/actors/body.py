"""Skinned glTF and BVH files of a user's own as actor models that bend."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from scarl_sionna.core.errors import MeshError
from scarl_sionna.core.untrusted.files import read_bytes
from scarl_sionna.core.untrusted.gltf_file import read_gltf
from scarl_sionna.scene.bodies.bending import read_body, vertex_normals
from scarl_sionna.scene.bodies.bvh import MOST_BYTES
from scarl_sionna.scene.bodies.skeleton import Skin
from scarl_sionna.scene.document.mesh_files import check_triangles, ply_of

from .body_spec import BodySpec
from .mesh_checks import check_measures, warn_if_open
from .model import ActorModel, read_actor_model
from .textures import png_of, read_image
from .written import Material, Part, WrittenModel, checked_kind, ids_of, material_tables, rotation, textures_of

_GREY = (0.5, 0.5, 0.5)


def actor_from_body(
    file: str | Path,
    name: str | None = None,
    materials: Material | Mapping[str, Material] = "clothed_skin",
    folder: str | Path | None = None,
    **fields: object,
) -> ActorModel:
    """Return an actor model that bends as its file says, beside what its trajectory moves.

    Parameters
    ----------
    file : str or Path
        A glTF (``.glb``, ``.gltf``) with skins, morph targets or nodes that move; or a BVH, its bones as capsules.
    name : str, optional
        Of the model: letters, digits, ``_`` and ``-``; None: that of the file.
    materials : str or mapping
        As of :func:`actor_from_mesh`.
    folder : str or Path, optional
        Where the model is written; None: into the cache folder, by a checksum.
    **fields
        Of :class:`scarl_sionna.scene.actors.body_spec.BodySpec`: the class (``semantic``), axes and unit of the
        file, and how its motion plays.

    Returns
    -------
    ActorModel
        Its motion begins at the world's time 0. The origin is on the ground below the middle of its first posture;
        what a root moves in the file it moves beside the actor's trajectory.

    Raises
    ------
    MeshError
        If a file is missing, damaged, contradicts itself or has what is not read.
    SpecError, ParameterRangeError
        If a value is not allowed, or the measures do not fit the class.
    UnknownFieldError, UnknownNameError, MaterialError
        If a field, class, part or key is unknown, or a part has no material.

    Warns
    -----
    ScarlWarning
        If the surface is open.
    """
    spec = BodySpec(**fields)
    path, motion_path = Path(file), None if spec.moved_by is None else Path(spec.moved_by)
    model = str(name or re.sub(r"[^A-Za-z0-9_\-]+", "_", path.stem))
    kind = checked_kind(model, spec.semantic, spec.motion, True, spec.scale)
    body = read_body(path, motion_path, spec.clip, spec.smooth, spec.unit)
    turn = spec.scale * rotation(spec.up, spec.forward)
    first = {part: vertices @ turn.T for part, (vertices, _) in body.at(body.start).items()}
    for part, vertices in first.items():
        try:
            check_triangles(vertices, body.skins[part].faces)
        except MeshError as error:
            raise MeshError(f"part '{part}' {error}", path) from None
    low = np.min([vertices.min(axis=0) for vertices in first.values()], axis=0)
    high = np.max([vertices.max(axis=0) for vertices in first.values()], axis=0)
    check_measures(model, spec.semantic, high - low, spec.scale, spec.up, spec.forward)
    origin = np.array([*(low + high)[:2] / 2.0, low[2]])
    parts = {
        part: Part(
            trimesh.Trimesh(vertices - origin, skin.faces, process=False), skin.material, skin.color or _GREY, texture
        )
        for part, vertices in first.items()
        for skin in [body.skins[part]]
        for texture in [_texture(path, part, skin)]
    }
    warn_if_open(model, {part: one.body for part, one in parts.items()})
    ids = ids_of(parts)
    meshes = {}
    for part, one in parts.items():
        vertices, faces = np.asarray(one.body.vertices), body.skins[part].faces
        uv = None if one.texture is None else one.texture[0]
        meshes[ids[part]] = ply_of(vertices, vertex_normals(vertices, faces), faces, uv), part
    head = {
        "name": model,
        "title": f"{model}, a body of your own",
        "class": spec.semantic,
        "motion": kind,
        **dict(zip(("length", "width", "height"), np.maximum(high - low, 1e-3).round(4).tolist(), strict=True)),
    }
    is_bvh = path.suffix.lower() == ".bvh"
    files = {"body.bvh" if is_bvh else "body.glb": read_bytes(path, MOST_BYTES) if is_bvh else read_gltf(path).packed()}
    bending: dict[str, Any] = {
        "file": next(iter(files)),
        "loop": spec.loop,
        "speed": spec.speed,
        "unit": spec.unit,
        "placement": np.concatenate([turn, -origin[:, None]], axis=1).ravel().tolist(),
        "parts": {shape: part for part, shape in ids.items()},
        **({} if spec.clip is None else {"clip": spec.clip}),
        **({} if spec.smooth is None else {"smooth": spec.smooth}),
    }
    if motion_path is not None:
        bending["motion"] = "motion.bvh"
        files["motion.bvh"] = read_bytes(motion_path, MOST_BYTES)
    tables = material_tables(materials, parts, model)
    written = WrittenModel(head, meshes, tables, [], bending, files | textures_of(parts))
    return read_actor_model(written.into(Path(folder)) if folder is not None else written.cached())


def _texture(path: Path, part: str, skin: Skin) -> tuple[npt.NDArray[np.float64], bytes] | None:
    """Return the texture coordinates of a part and the image of its base colour as PNG; None where it has none."""
    if skin.texture is None or skin.uv is None:
        return None
    try:
        data = read_gltf(path).image(skin.texture)
        return None if data is None else (skin.uv, png_of(read_image(data), skin.color or (1.0, 1.0, 1.0)))
    except MeshError as error:
        raise MeshError(f"part '{part}' {error}", path) from None
    except (OSError, ValueError) as error:
        raise MeshError(
            f"part '{part}' has a texture that is not there ({error})", path, "export it with its images"
        ) from error
