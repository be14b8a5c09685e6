"""Meshes of a user's own (glTF, OBJ, PLY, STL) as actor models.

Checked, turned upright, put on the ground and written to a folder.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from scarl_sionna.core.errors import MeshError, UnknownNameError
from scarl_sionna.scene.document.mesh_files import ply_bytes, ply_of
from scenes_xml.generators.geometry.mesh import Mesh, finish

from .mesh_checks import check_measures, checked_part, warn_if_open
from .model import ActorModel, read_actor_model
from .textures import texture_of
from .written import Material, Part, WrittenModel, checked_kind, ids_of, material_tables, rotation, textures_of

Array = npt.NDArray[np.float64]

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl")
"""Files that are read."""
_GREY = (0.5, 0.5, 0.5)


def actor_from_mesh(
    mesh: str | Path | trimesh.Trimesh | trimesh.Scene,
    name: str | None = None,
    semantic: str = "Car",
    materials: Material | Mapping[str, Material] = "car_paint",
    *,
    scale: float = 1.0,
    up: str | None = None,
    forward: str | None = None,
    motion: str | None = None,
    wheelbase: float | None = None,
    rear_axle: float | None = None,
    joints: Sequence[Mapping[str, Any]] = (),
    folder: str | Path | None = None,
) -> ActorModel:
    """Return an actor model made of a mesh.

    Parameters
    ----------
    mesh : str, Path, trimesh.Trimesh or trimesh.Scene
        A glTF (``.glb``, ``.gltf``), OBJ, PLY or STL file, or what trimesh has loaded. Its nodes are the parts.
    name : str, optional
        Of the model: letters, digits, ``_`` and ``-``; None: that of the file.
    semantic : str
        Class, one of `scarl_sionna.core.semantics.SEMANTIC_CLASSES`.
    materials : str or mapping
        A radio material for all; or a table with ``radio`` and, optional, ``lidar_reflectance``,
        ``lidar_transmittance`` (0 to 1), ``retroreflection``, ``retroreflected_luminance`` [cd/(lx m2)], ``color``
        (linear RGB, 0 to 1; left out: texture or colour of the file, else grey), ``roughness``, ``lamp``, ``source``;
        or such names or tables by the name of a part or of a material of the file, with ``"*"`` for the rest.
    scale : float
        Metres in a unit of the file: 0.001 for millimetres.
    up, forward : str, optional
        Axes of the file that point up and forward: ``"x"``, ``"-x"``, ``"y"``, ... None: ``"y"`` and ``"z"`` for glTF,
        which defines them so, else ``"z"`` and ``"x"``.
    motion : str, optional
        ``"vehicle"``, ``"cycle"``, ``"walk"`` or ``"stand"``; None: by the class.
    wheelbase, rear_axle : float, optional
        Distance of the axles, and x of the rear one from the middle [m].
    joints : sequence of mapping
        As ``[[joints]]`` of an ``actor.toml``, with names of parts as ``shapes`` and places in the actor's frame [m].
    folder : str or Path, optional
        Where the model is written, to be named in a scene.toml; None: into the cache folder, by a checksum.

    Returns
    -------
    ActorModel
        With its origin on the ground below the middle, x forward, z up. It refers to files and can be sent to other
        processes of the machine.

    Raises
    ------
    MeshError
        If the file is missing, not readable or holds no triangles, or vertices are not finite.
    ParameterRangeError
        If a value is not allowed, or the measures do not fit the class: it names the unit or the axes that would.
    UnknownNameError, MaterialError
        If a class, part, axis or key is unknown, or a part has no material.

    Warns
    -----
    ScarlWarning
        If the surface is open, or triangles without area are left out.
    """
    path = Path(mesh) if isinstance(mesh, str | Path) else None
    model = str(name or (re.sub(r"[^A-Za-z0-9_\-]+", "_", path.stem) if path else "mesh"))
    kind = checked_kind(model, semantic, motion, bool(joints), scale)
    is_gltf = path is not None and path.suffix.lower() in (".glb", ".gltf")
    own_up, own_forward = up or ("y" if is_gltf else "z"), forward or ("z" if is_gltf else "x")
    turn = rotation(own_up, own_forward)
    parts = _parts(mesh, model)
    for part in parts.values():
        _move(part.body, scale * turn)
    low = np.min([part.body.bounds[0] for part in parts.values()], axis=0)
    high = np.max([part.body.bounds[1] for part in parts.values()], axis=0)
    check_measures(model, semantic, high - low, scale, own_up, own_forward)
    origin = np.array([*(low + high)[:2] / 2.0, low[2]])
    for part in parts.values():
        part.body.apply_translation(-origin)
    warn_if_open(model, {name: part.body for name, part in parts.items()})
    ids = ids_of(parts)
    tables = material_tables(materials, parts, model)
    head = {
        "name": model,
        "title": f"{model}, a mesh of your own",
        "class": semantic,
        "motion": kind,
        **dict(zip(("length", "width", "height"), np.maximum(high - low, 1e-3).round(4).tolist(), strict=True)),
        **({} if wheelbase is None else {"wheelbase": float(wheelbase)}),
        **({} if rear_axle is None else {"rear_axle": float(rear_axle)}),
    }
    rows = [_joint(row, ids, model) for row in joints]
    written = WrittenModel(
        head,
        {ids[name]: (_ply(part), name) for name, part in parts.items()},
        tables,
        rows,
        files=textures_of(parts),
    )
    return read_actor_model(written.into(Path(folder)) if folder is not None else written.cached())


def _parts(mesh: str | Path | trimesh.Trimesh | trimesh.Scene, model: str) -> dict[str, Part]:
    """Return copies of the meshes of a file in its axes, and the names of their materials, by the name of the part."""
    scene: Any = _loaded(Path(mesh)) if isinstance(mesh, str | Path) else mesh
    if isinstance(scene, trimesh.Trimesh):
        scene = _scene_of(model, scene)
    found = {}
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        body = scene.geometry[geometry]
        if not isinstance(body, trimesh.Trimesh):
            continue
        own = checked_part(body, f"part '{node}' of '{model}'")
        own.apply_transform(matrix)
        material = str(getattr(getattr(body.visual, "material", None), "name", None) or "")
        found[str(node)] = Part(own, material, _color(body), _texture(body, own, f"part '{node}' of '{model}'"))
    if not found:
        raise MeshError(
            f"'{model}' holds no triangles",
            mesh if isinstance(mesh, str | Path) else None,
            "export the surface as a mesh",
        )
    return found


def _texture(body: trimesh.Trimesh, own: trimesh.Trimesh, what: str) -> tuple[Array, bytes] | None:
    try:
        found = texture_of(body)
    except MeshError as error:
        raise MeshError(f"{what} {error}") from None
    return found if len(own.vertices) == len(body.vertices) else None


def _ply(part: Part) -> bytes:
    """Return the mesh of a part with shading normals, split at creases, and texture coordinates if it has any."""
    if part.texture is None:
        return ply_bytes(part.body)
    shaded = finish(Mesh(np.asarray(part.body.vertices), np.asarray(part.body.faces), part.texture[0]))
    assert shaded.normals is not None
    return ply_of(shaded.vertices, shaded.normals, shaded.faces, shaded.uv)


def _loaded(path: Path) -> trimesh.Scene:
    """Return the `trimesh.Scene` of a file; raises `MeshError` where it cannot be read."""
    if path.suffix.lower() not in FORMATS:
        raise MeshError(f"a '{path.suffix}' file cannot be read", path, f"give one of {', '.join(FORMATS)}")
    if not path.is_file():
        raise MeshError("mesh file not found", path, "check the path")
    try:
        if path.suffix.lower() == ".obj":  # its objects and materials are its parts
            scene: Any = trimesh.load(path, force="scene", split_object=True, group_material=True)
            return scene
        scene = trimesh.load(path, force="scene")
    except Exception as error:  # trimesh raises what its parsers do
        raise MeshError(f"cannot be read ({type(error).__name__}: {error})", path, "export it again") from error
    if path.suffix.lower() in (".ply", ".stl"):  # one surface without a name
        return _scene_of(path.stem, scene.to_mesh())
    return scene


def _scene_of(name: str, body: trimesh.Trimesh) -> trimesh.Scene:
    """Return a scene with one part."""
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name=name, geom_name=name)
    return scene


def _move(body: trimesh.Trimesh, matrix: Array) -> None:
    whole = np.eye(4)
    whole[:3, :3] = matrix
    body.apply_transform(whole)


def _color(body: trimesh.Trimesh) -> tuple[float, ...]:
    """Return the linear RGB colour of a mesh's material in its file; grey where it has none."""
    material = getattr(body.visual, "material", None)
    main = getattr(material, "main_color", None)
    if material is None or main is None or getattr(body.visual, "kind", None) != "texture":
        return _GREY
    srgb = np.asarray(main[:3], dtype=np.float64) / 255.0
    is_linear = isinstance(material, trimesh.visual.material.PBRMaterial)  # glTF states its factors in linear RGB
    linear = srgb if is_linear else np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return tuple(linear.round(6).tolist())


def _joint(row: Mapping[str, Any], ids: Mapping[str, str], model: str) -> dict[str, Any]:
    table = dict(row)
    for part in table.get("shapes", ()):
        if part not in ids:
            raise UnknownNameError(f"part in the joints of mesh '{model}'", str(part), ids)
    if "shapes" in table:
        table["shapes"] = [ids[part] for part in table["shapes"]]
    return table
