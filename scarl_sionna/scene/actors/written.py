"""What actor models of a user's own files have in common: axes, materials, and the files that are written of them."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import trimesh

from scarl_sionna.core.errors import MaterialError, MeshError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES

from .model import MOTIONS, check_colors
from .textures import texture_name

Array = npt.NDArray[np.float64]
Material = str | Mapping[str, Any]

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


class Part(NamedTuple):
    """One part of a file: its mesh, and the name, the linear RGB colour and the texture of its material there.

    The texture: coordinates (num_vertices, 2), v from the top, and an image as PNG; None without one.
    """

    body: trimesh.Trimesh
    material: str
    color: tuple[float, ...]
    texture: tuple[Array, bytes] | None = None


def checked_kind(model: str, semantic: str, motion: str | None, walks: bool, scale: float) -> str:
    """Return how a model moves, after a check of its name, its class and the scale of its file.

    Raises
    ------
    ParameterRangeError, UnknownNameError
        If one is not allowed.
    """
    if not re.fullmatch(r"[A-Za-z0-9_\-]+", model):
        raise ParameterRangeError("name of the actor model", repr(model), "letters, digits, '_' and '-'")
    if semantic not in SEMANTIC_CLASSES:
        raise UnknownNameError(f"class of actor model '{model}'", str(semantic), SEMANTIC_CLASSES)
    kind = motion or {"Pedestrian": "walk" if walks else "stand", "Bicycle": "cycle", "Motorcycle": "cycle"}.get(
        semantic, "vehicle"
    )
    if kind not in MOTIONS:
        raise UnknownNameError(f"motion of actor model '{model}'", str(motion), MOTIONS)
    if not (np.isfinite(scale) and scale > 0.0):
        raise ParameterRangeError("scale", scale, "> 0 m for a unit of the file")
    return kind


def rotation(up: str, forward: str) -> Array:
    """Return the matrix that turns the axes of a file into forward, left, up."""
    for what, axis in (("up", up), ("forward", forward)):
        if axis not in _AXES:
            raise UnknownNameError(f"axis `{what}`", str(axis), _AXES)
    if up.lstrip("-") == forward.lstrip("-"):
        raise ParameterRangeError("forward", forward, f"an axis across `up` ({up})")
    ahead, above = _AXES[forward], _AXES[up]
    return np.stack([ahead, np.cross(above, ahead), above])


def ids_of(parts: Mapping[str, Any]) -> dict[str, str]:
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


def material_tables(
    materials: Material | Mapping[str, Material], parts: Mapping[str, Part], model: str
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
    for part, (_, material, file_color, texture) in parts.items():
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
        own_color = table.pop("color", None)
        color = own_color or file_color
        table["color"] = list(check_colors({"color": color}, {"color": 0}, f"mesh '{model}', '{key}'")["color"])
        if texture is not None and own_color is None:
            table["texture"] = texture_name(texture[1])
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


class WrittenModel:
    """The files of a model: XML, meshes and actor.toml."""

    def __init__(
        self,
        head: Mapping[str, Any],
        shapes: Mapping[str, tuple[bytes, str]],
        tables: Mapping[str, tuple[str, dict[str, Any]]],
        joints: Sequence[Mapping[str, Any]],
        bending: Mapping[str, Any] | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> None:
        self._name = str(head["name"])
        bsdfs = dict(tables.values())
        lines = ["[actor]", *(f"{key} = {_toml(value)}" for key, value in head.items()), ""]
        xml = ['<scene version="3.0.0">']
        for bsdf, table in bsdfs.items():
            xml.append(_bsdf(bsdf, table))
            stated = {key: value for key, value in table.items() if key not in ("color", "roughness", "texture")}
            lines += [f"[materials.{bsdf}]", *(f"{key} = {_toml(value)}" for key, value in stated.items()), ""]
        for row in joints:
            lines += ["[[joints]]", *(f"{key} = {_toml(value)}" for key, value in row.items()), ""]
        if bending is not None:
            parts = {"bending.parts": bending["parts"]}
            for name, rows in {"bending": {k: v for k, v in bending.items() if k != "parts"}, **parts}.items():
                lines += [f"[{name}]", *(f"{key} = {_toml(value)}" for key, value in rows.items()), ""]
        self._files: dict[str, bytes] = dict(files or {})
        for shape, (mesh, part) in shapes.items():
            xml.append(
                f'\t<shape type="ply" id="{shape}">\n\t\t<string name="filename" value="meshes/{shape}.ply"/>\n'
                f'\t\t<ref id="{tables[part][0]}" name="bsdf"/>\n\t</shape>'
            )
            self._files[f"meshes/{shape}.ply"] = mesh
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
        for name, content in self._files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
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


def textures_of(parts: Mapping[str, Part]) -> dict[str, bytes]:
    """Return the images of parts by their files."""
    return {texture_name(part.texture[1]): part.texture[1] for part in parts.values() if part.texture is not None}


def _bsdf(name: str, table: Mapping[str, Any]) -> str:
    color = " ".join(f"{value:.6g}" for value in table["color"])
    look = f'<rgb name="base_color" value="{color}"/>'
    if "texture" in table:
        file = f'<string name="filename" value="{table["texture"]}"/>'
        look = f'<texture type="bitmap" name="base_color">{file}</texture>'
    return (
        f'\t<bsdf type="twosided" id="{name}">\n\t\t<bsdf type="principled">\n\t\t\t{look}\n'
        f'\t\t\t<float name="roughness" value="{float(table.get("roughness", 0.4)):g}"/>\n\t\t</bsdf>\n\t</bsdf>'
    )


def _toml(value: object) -> str:
    if isinstance(value, list | tuple | np.ndarray):
        return "[" + ", ".join(_toml(one) for one in value) + "]"
    return json.dumps(value)
