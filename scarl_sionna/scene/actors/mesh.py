"""Meshes of a user's own (glTF, OBJ, PLY, STL) as actor models.

Checked, turned upright, put on the ground and written to a folder.
"""

from __future__ import annotations

import hashlib
import json
import re
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

from scarl_sionna.core.errors import MaterialError, MeshError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.scene.document.mesh_files import ply_bytes

from .mesh_checks import check_measures, checked_part, open_edges
from .model import MOTIONS, ActorModel, check_colors, read_actor_model

Array = npt.NDArray[np.float64]
Material = str | Mapping[str, Any]

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl")
"""Files that are read."""
_VERSION = 1
"""Of what is written; a new number makes new folders."""
_AXES = {
    sign + axis: (1.0 if not sign else -1.0) * row
    for axis, row in zip("xyz", np.eye(3), strict=True)
    for sign in ("", "-")
}
_MATERIAL_KEYS = {
    "radio", "lidar_reflectance", "lidar_transmittance", "retroreflection", "retroreflected_luminance", "color",
    "roughness", "source", "lamp",
}  # fmt: skip # a table
_GREY = (0.5, 0.5, 0.5)


class _Part(NamedTuple):
    """One part of a file: its mesh, and the name and the linear RGB colour of its material there."""

    body: trimesh.Trimesh
    material: str
    color: tuple[float, ...]


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
        (linear RGB, 0 to 1; left out: that of the file, else grey), ``roughness``, ``lamp``, ``source``; or such names
        or tables by the name of a part or of a material of the file, with ``"*"`` for the rest.
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
    if not re.fullmatch(r"[A-Za-z0-9_\-]+", model):
        raise ParameterRangeError("name of the actor model", repr(model), "letters, digits, '_' and '-'")
    if semantic not in SEMANTIC_CLASSES:
        raise UnknownNameError(f"class of actor model '{model}'", str(semantic), SEMANTIC_CLASSES)
    kind = motion or {"Pedestrian": "walk" if joints else "stand", "Bicycle": "cycle", "Motorcycle": "cycle"}.get(
        semantic, "vehicle"
    )
    if kind not in MOTIONS:
        raise UnknownNameError(f"motion of actor model '{model}'", str(motion), MOTIONS)
    if not (np.isfinite(scale) and scale > 0.0):
        raise ParameterRangeError("scale", scale, "> 0 m for a unit of the file")
    is_gltf = path is not None and path.suffix.lower() in (".glb", ".gltf")
    own_up, own_forward = up or ("y" if is_gltf else "z"), forward or ("z" if is_gltf else "x")
    turn = _rotation(own_up, own_forward)
    parts = _parts(mesh, model)
    for part in parts.values():
        _move(part.body, scale * turn)
    low = np.min([part.body.bounds[0] for part in parts.values()], axis=0)
    high = np.max([part.body.bounds[1] for part in parts.values()], axis=0)
    check_measures(model, semantic, high - low, scale, own_up, own_forward)
    origin = np.array([*(low + high)[:2] / 2.0, low[2]])
    for part in parts.values():
        part.body.apply_translation(-origin)
    _warn_if_open(model, {name: part.body for name, part in parts.items()})
    ids = _ids(parts)
    tables = _material_tables(materials, parts, model)
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
    written = _Written(head, {ids[name]: (part.body, name) for name, part in parts.items()}, tables, rows)
    return read_actor_model(written.into(Path(folder)) if folder is not None else written.cached())


def _rotation(up: str, forward: str) -> Array:
    """Return the matrix that turns the axes of a file into forward, left, up."""
    for what, axis in (("up", up), ("forward", forward)):
        if axis not in _AXES:
            raise UnknownNameError(f"axis `{what}`", str(axis), _AXES)
    if up.lstrip("-") == forward.lstrip("-"):
        raise ParameterRangeError("forward", forward, f"an axis across `up` ({up})")
    ahead, above = _AXES[forward], _AXES[up]
    return np.stack([ahead, np.cross(above, ahead), above])


def _parts(mesh: str | Path | trimesh.Trimesh | trimesh.Scene, model: str) -> dict[str, _Part]:
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
        found[str(node)] = _Part(own, material, _color(body))
    if not found:
        raise MeshError(
            f"'{model}' holds no triangles",
            mesh if isinstance(mesh, str | Path) else None,
            "export the surface as a mesh",
        )
    return found


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


def _warn_if_open(model: str, parts: Mapping[str, trimesh.Trimesh]) -> None:
    counts = {part: number for part, body in parts.items() if (number := open_edges(body))}
    if counts:
        listed = ", ".join(
            f"'{part}' {number}" for part, number in sorted(counts.items(), key=lambda item: -item[1])[:5]
        )
        warnings.warn(
            f"mesh '{model}' is not closed: {sum(counts.values())} open edges "
            f"({listed}{' ...' if len(counts) > 5 else ''}). Radar rays "
            "that enter through the gaps are mirrored inside of the body and come back later than they should, "
            "and a sensor that stands "
            "inside is not always found; close the holes, or make panes and openings parts of materials of their own",
            ScarlWarning,
            stacklevel=3,
        )


def _ids(parts: Mapping[str, Any]) -> dict[str, str]:
    """Return an id of its own for each part: its name with what an id may hold."""
    ids: dict[str, str] = {}
    for part in parts:
        plain = re.sub(r"[^A-Za-z0-9_]+", "_", part).strip("_") or "part"
        name, number = plain, 1
        while name in ids.values():
            number += 1
            name = f"{plain}_{number}"
        ids[part] = name
    return ids


def _material_tables(
    materials: Material | Mapping[str, Material], parts: Mapping[str, _Part], model: str
) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return BSDF id and table of each part's material."""
    if isinstance(materials, str) or "radio" in materials:
        by_name: Mapping[str, Any] = {"*": materials}
    else:
        by_name = materials
    known = {"*", *parts, *(part.material for part in parts.values() if part.material)}
    if unknown := sorted(set(by_name) - known):
        raise UnknownNameError(f"part or material of mesh '{model}'", unknown[0], known)
    chosen: dict[str, tuple[str, dict[str, Any]]] = {}
    lacking = []
    for part, (_, material, file_color) in parts.items():
        key = next((key for key in (part, material, "*") if key in by_name), None)
        if key is None:
            lacking.append(f"'{part}'" + (f" (material '{material}')" if material else ""))
            continue
        stated = by_name[key]
        table = {"radio": stated} if isinstance(stated, str) else dict(stated)
        if unknown := sorted(set(table) - _MATERIAL_KEYS):
            raise UnknownNameError(f"key of the material of '{key}'", unknown[0], _MATERIAL_KEYS)
        if "radio" not in table:
            raise MaterialError(
                f"the material of '{key}' of mesh '{model}' lacks 'radio'; name one of docs/materials.md"
            )
        color = table.pop("color", None) or file_color
        table["color"] = list(check_colors({"color": color}, {"color": 0}, f"mesh '{model}', '{key}'")["color"])
        name = re.sub(r"[^A-Za-z0-9_]+", "_", model if key == "*" and not material else material or part)
        taken = {bsdf: other for bsdf, other in chosen.values()}
        number = 1
        while taken.get(own := name if number == 1 else f"{name}_{number}", table) != table:
            number += 1
        chosen[part] = own, table
    if lacking:
        listed = ", ".join(lacking[:5]) + (" ..." if len(lacking) > 5 else "")
        raise MaterialError(
            f"parts of mesh '{model}' have no material: {listed}; add them to `materials`, or '*' for the rest"
        )
    return chosen


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


class _Written:
    """The files of a model: XML, meshes and actor.toml."""

    def __init__(
        self,
        head: Mapping[str, Any],
        shapes: Mapping[str, tuple[trimesh.Trimesh, str]],
        tables: Mapping[str, tuple[str, dict[str, Any]]],
        joints: Sequence[Mapping[str, Any]],
    ) -> None:
        self._name = str(head["name"])
        bsdfs = dict(tables.values())
        lines = ["[actor]", *(f"{key} = {_toml(value)}" for key, value in head.items()), ""]
        xml = ['<scene version="3.0.0">']
        for bsdf, table in bsdfs.items():
            xml.append(_bsdf(bsdf, table))
            stated = {key: value for key, value in table.items() if key not in ("color", "roughness")}
            lines += [f"[materials.{bsdf}]", *(f"{key} = {_toml(value)}" for key, value in stated.items()), ""]
        for row in joints:
            lines += ["[[joints]]", *(f"{key} = {_toml(value)}" for key, value in row.items()), ""]
        self._files: dict[str, bytes] = {}
        for shape, (body, part) in shapes.items():
            xml.append(
                f'\t<shape type="ply" id="{shape}">\n\t\t<string name="filename" value="meshes/{shape}.ply"/>\n'
                f'\t\t<ref id="{tables[part][0]}" name="bsdf"/>\n\t</shape>'
            )
            self._files[f"meshes/{shape}.ply"] = ply_bytes(body)
        self._files[f"{self._name}.xml"] = "\n".join([*xml, "</scene>", ""]).encode()
        self._files["actor.toml"] = "\n".join(lines).encode()

    def into(self, folder: Path) -> Path:
        """Write the files into a folder, and return it."""
        try:
            self._into(folder)
        except OSError as error:
            raise MeshError(
                f"the model cannot be written ({error.strerror})", folder, "choose a folder that can be written"
            ) from error
        return folder

    def _into(self, folder: Path) -> None:
        (folder / "meshes").mkdir(parents=True, exist_ok=True)
        for name, content in self._files.items():
            (folder / name).write_bytes(content)

    def cached(self) -> Path:
        """Write the files into the cache folder, unless they lie there.

        All or nothing, so that several processes may do it at once.
        """
        from scenes_xml.cache import kept_folder

        digest = hashlib.sha256(str(_VERSION).encode())
        for name, content in self._files.items():
            digest.update(name.encode() + b"\0" + content)
        try:
            return kept_folder("actors", f"{self._name}-{digest.hexdigest()[:16]}", tuple(self._files), self._into)
        except OSError as error:
            raise MeshError(f"the model of '{self._name}': {error.strerror or error}, or give `folder`") from error


def _bsdf(name: str, table: Mapping[str, Any]) -> str:
    color = " ".join(f"{value:.6g}" for value in table["color"])
    return (
        f'\t<bsdf type="twosided" id="{name}">\n\t\t<bsdf type="principled">\n\t\t\t<rgb name="base_color" '
        f'value="{color}"/>\n'
        f'\t\t\t<float name="roughness" value="{float(table.get("roughness", 0.4)):g}"/>\n\t\t</bsdf>\n\t</bsdf>'
    )


def _toml(value: object) -> str:
    if isinstance(value, list | tuple | np.ndarray):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return json.dumps(value)
