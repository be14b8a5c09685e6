"""Mesh files of a scene before the engine sees them: it does not survive indices that point outside, or NaN.

PLY with triangles alone is checked here at the speed of the disk; what else PLY and OBJ can hold is left to trimesh.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import MeshError
from scarl_sionna.core.untrusted.files import MEGABYTE, read_bytes

if TYPE_CHECKING:
    import trimesh

FARTHEST = 1e6
"""Coordinates beyond it [m] are no place in a scene."""
_MOST_BYTES = 2000 * MEGABYTE
_LONGEST_HEADER = 65_536
_CREASE = np.radians(35.0)
"""Edges flatter than this are shaded smooth."""
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip # a table


@dataclass(frozen=True)
class _Element:
    """One element of a PLY header: properties are (name, type) or, for a list, (name, type of count, of entries)."""

    name: str
    count: int
    properties: list[tuple[str, ...]]

    @property
    def is_plain(self) -> bool:
        return all(len(item) == 2 for item in self.properties)


def check_mesh(shape_id: str, file: Path, kind: str) -> None:
    """Raise unless a PLY or OBJ file holds triangles between finite points that are there.

    Raises
    ------
    MeshError
        If it cannot be read, is cut, has no faces, or a vertex or an index is not allowed.
    """
    try:
        about = file.stat()
        _check(file, kind, about.st_mtime_ns, about.st_size)
    except MeshError as error:
        raise MeshError(f"mesh of shape '{shape_id}' {error}", file) from None  # with its remedy
    except OSError as error:
        raise MeshError(f"mesh of shape '{shape_id}' cannot be read ({error.strerror})", file) from error


@lru_cache(maxsize=4096)
def _check(file: Path, kind: str, changed: int, size: int) -> None:
    data = read_bytes(file, _MOST_BYTES)
    if kind == "ply":
        if not data.startswith(b"ply"):
            raise MeshError("is not a PLY file")
        try:
            _check_ply(data)
        except (ValueError, IndexError, UnicodeDecodeError, OverflowError) as error:
            raise MeshError(f"is damaged ({error})", remedy="export it again") from error
    else:
        _check_obj(data)


def _check_ply(data: bytes) -> None:
    head, mark, _ = data[:_LONGEST_HEADER].partition(b"end_header")
    start = data.find(b"\n", len(head) + len(mark)) + 1
    if not mark or not start:
        raise ValueError("its header has no end")
    form, elements = _header(head.decode("ascii").splitlines())
    by_name = {element.name: element for element in elements}
    vertex, face = by_name.get("vertex"), by_name.get("face")
    if face is None or vertex is None or face.count < 1 or vertex.count < 3:
        raise MeshError("has no faces", remedy="export it again with triangles")
    if form == "ascii":
        points, faces = _ascii(data[start:], elements)
    elif form in ("binary_little_endian", "binary_big_endian"):
        points, faces = _binary(data, start, elements, "<" if form == "binary_little_endian" else ">")
    else:
        raise ValueError(f"its format '{form}' is not known")
    check_triangles(points, faces)


def _header(lines: list[str]) -> tuple[str, list[_Element]]:
    """Return the format and the elements of a PLY file."""
    form, elements = "", list[_Element]()
    for line in lines[1:]:
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format":
            form = words[1]
        elif words[0] == "element":
            count = int(words[2])
            if not 0 <= count < 2**31:
                raise ValueError(f"it claims {count} of the element '{words[1]}'")
            elements.append(_Element(words[1], count, []))
        elif words[0] == "property":
            types = words[2:4] if words[1] == "list" else words[1:2]
            if any(kind not in _TYPES for kind in types):
                raise ValueError(f"the type in '{line}' is not known")
            elements[-1].properties.append((words[-1], *(_TYPES[kind] for kind in types)))
        else:
            raise ValueError(f"its header has the line '{line[:40]}'")
    return form, elements


def _fields(element: _Element, order: str, corners: int = 3) -> np.dtype[np.void]:
    """Return the type of a row, every list with as many entries as a triangle has corners."""
    fields: list[tuple[str, str] | tuple[str, str, tuple[int]]] = []
    for name, *types in element.properties:
        if len(types) == 1:
            fields.append((name, order + types[0]))
        else:
            fields += [(f"{name} count", order + types[0]), (name, order + types[1], (corners,))]
    return np.dtype(fields)


def _binary(
    data: bytes, start: int, elements: list[_Element], order: str
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return the vertices and the triangles of a binary PLY file."""
    points = np.zeros((0, 3))
    for element in elements:
        kind = _fields(element, order)
        if element.count * kind.itemsize > len(data) - start:
            raise ValueError(
                f"it is cut, or faces are no triangles: {element.count} '{element.name}' take "
                f"{element.count * kind.itemsize} bytes, {len(data) - start} are left"
            )
        rows = np.frombuffer(data, kind, element.count, start)
        start += rows.nbytes
        if element.name == "vertex":
            points = np.stack([rows[axis].astype(np.float64) for axis in "xyz"], axis=1)
        elif not element.is_plain:
            lists = [item[0] for item in element.properties if len(item) == 3]
            if any((rows[f"{name} count"] != 3).any() for name in lists):
                raise MeshError("has faces that are no triangles", remedy="export it again with triangles")
            if element.name == "face":
                return points, rows[_indices(element)].astype(np.int64)
    raise ValueError("it has no list of vertices for its faces")


def _ascii(data: bytes, elements: list[_Element]) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return the vertices and the triangles of a PLY file in plain text."""
    words: Iterator[bytes] = iter(data.split())
    points, faces = list[list[float]](), list[list[int]]()
    try:
        for element in elements:
            for _ in range(element.count):
                row: dict[str, list[float]] = {}
                for name, *types in element.properties:
                    size = 1 if len(types) == 1 else int(next(words))
                    if len(types) == 2 and size != 3:
                        raise MeshError("has faces that are no triangles", remedy="export it again with triangles")
                    row[name] = [float(next(words)) for _ in range(size)]
                if element.name == "vertex":
                    points.append([row[axis][0] for axis in "xyz"])
                elif element.name == "face":
                    faces.append([int(number) for number in row[_indices(element)]])
    except (StopIteration, KeyError) as error:
        raise ValueError(f"it is cut, or lacks {error}") from error
    return np.array(points).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _indices(element: _Element) -> str:
    known = [item[0] for item in element.properties if item[0] in ("vertex_indices", "vertex_index")]
    if not known:
        raise ValueError("its faces have no vertex_indices")
    return known[0]


def check_triangles(points: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> None:
    """Raise unless vertices (n, 3) [m] are finite and near, and triangles (m, 3) have corners among them.

    Raises
    ------
    MeshError
        With the first vertex or face that is not allowed.
    """
    if points.ndim != 2 or points.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise MeshError(
            f"has vertices of shape {points.shape} and faces of shape {faces.shape}, not (n, 3) and (m, 3)",
            remedy="export it again with triangles",
        )
    bad = ~(np.abs(points) <= FARTHEST).all(axis=1)  # NaN is not within, either
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        raise MeshError(
            f"has an invalid vertex position, not finite or beyond {FARTHEST:g} m: vertex {row} at "
            f"{points[row].tolist()} m",
            remedy="export it again",
        )
    outside = (faces < 0) | (faces >= len(points))
    if outside.any():
        row, corner = (int(index) for index in np.argwhere(outside)[0])
        raise MeshError(
            f"has face {row} with vertex {faces[row, corner]}, there are {len(points)}", remedy="export it again"
        )


def _check_obj(data: bytes) -> None:
    """Raise unless an OBJ file has finite vertices and faces between them; indices count from 1, or back from -1."""
    points, faces = list[list[float]](), list[list[int]]()
    try:
        for line in data.decode("utf-8", "replace").splitlines():
            words = line.split()
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
                if len(points[-1]) != 3:
                    raise ValueError(f"vertex {len(points)} has {len(points[-1])} coordinates")
            elif words[:1] == ["f"]:
                corners = [int(word.partition("/")[0]) for word in words[1:]]
                if len(corners) not in (3, 4):
                    raise ValueError(f"face {len(faces) + 1} has {len(corners)} corners, 3 or 4 are read")
                corners = [len(points) + corner if corner < 0 else corner - 1 for corner in corners]
                faces += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
    except ValueError as error:
        raise MeshError(f"is damaged ({error})", remedy="export it again") from error
    if not faces:
        raise MeshError("has no faces", remedy="export it again with triangles")
    try:
        indices = np.array(faces, dtype=np.int64)
    except OverflowError as error:
        raise MeshError("has a face with a vertex that is not there", remedy="export it again") from error
    check_triangles(np.array(points, dtype=np.float64).reshape(-1, 3), indices)


def ply_bytes(body: trimesh.Trimesh) -> bytes:
    """Return a binary PLY with shading normals, split at creases."""
    from trimesh.graph import smooth_shade

    smooth = smooth_shade(body, angle=_CREASE)
    return ply_of(smooth.vertices, smooth.vertex_normals, smooth.faces)


def ply_of(
    vertices: npt.NDArray[np.float64],
    normals: npt.NDArray[np.float64],
    triangles: npt.NDArray[np.int64],
    uv: npt.NDArray[np.float64] | None = None,
) -> bytes:
    """Return a binary PLY of vertices (n, 3) [m], their normals, faces (m, 3), and texture coordinates (n, 2)."""
    names = ["x", "y", "z", "nx", "ny", "nz", *(() if uv is None else ("u", "v"))]
    columns = np.concatenate([vertices, normals, *(() if uv is None else (uv,))], axis=1).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(columns)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"], faces["index"] = 3, triangles
    return "\n".join(header).encode("ascii") + columns.tobytes() + faces.tobytes()
