"""How a single file is packed: numbers of meshes and pixels of textures, in the form that compresses best.

Coordinates of a PLY are multiples of 1e-5 and are packed as whole numbers, column by column. Where that is smaller,
what can be foretold is left out: the fourth corner of a leaf closes a parallelogram, a normal is that of the faces
around its vertex; packed are the differences. A PNG is packed by its pixels, or by WebP without loss, and is compressed
again when it is unpacked. A file that would not come back as it was is packed as it is.
"""

from __future__ import annotations

import io
import lzma
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from PIL import Image

FILTERS = {
    "numbers": {"lc": 0, "lp": 2, "pb": 2},  # four bytes a number
    "bytes": {"lc": 3, "lp": 0, "pb": 0},
}
"""Settings of LZMA for what is packed as numbers, and for all else."""
Record = dict[str, Any]
_STEPS = {"x": 1e5, "y": 1e5, "z": 1e5, "nx": 1e4, "ny": 1e4, "nz": 1e4, "u": 1e5, "v": 1e5}
"""Steps per unit to which each column of a PLY is rounded (see generators/geometry/mesh.py)."""
_COUNTS = re.compile(rb"element vertex (\d+)\n.*element face (\d+)\n", re.DOTALL)


def compressed(content: bytes, key: str) -> bytes:
    """Return bytes compressed by LZMA with the filters of that key of `FILTERS`."""
    filters = [{"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "dict_size": 16 << 20, **FILTERS[key]}]
    return lzma.compress(content, format=lzma.FORMAT_XZ, filters=filters)


def encoded(name: str, content: bytes) -> tuple[Record, bytes]:
    """Return the record and the payload of a file, in the smallest of its forms that gives the same bytes again."""
    encoder = {".ply": _ply_encoded, ".png": _png_encoded}.get(Path(name).suffix)
    found = encoder(content) if encoder else None
    if found is not None and decoded(*found) == content:
        return found
    return {"kind": "raw"}, content


def decoded(record: Record, payload: bytes) -> bytes:
    """Return the bytes of a file that `encoded` made this record and payload of."""
    return _DECODERS[record["kind"]](record, payload)


def _raw(record: Record, payload: bytes) -> bytes:
    return payload


def _columns(header: str) -> list[str]:
    """Return the names of the columns of a PLY's vertices."""
    return re.findall(r"property float (\w+)\n", header)


def _steps(names: list[str]) -> np.ndarray:
    """Return the steps per unit of columns, shape (num_columns,)."""
    return np.array([_STEPS.get(name, 1.0) for name in names])


def _ply_encoded(content: bytes) -> tuple[Record, bytes] | None:
    end = content.find(b"end_header\n") + len(b"end_header\n")
    counts = _COUNTS.search(content, 0, end)
    if counts is None:
        return None
    num_vertices, num_faces = int(counts[1]), int(counts[2])
    header = content[:end].decode("ascii")
    names = _columns(header)
    if len(content) != end + 4 * num_vertices * len(names) + 13 * num_faces:
        return None
    vertices = np.frombuffer(content, "<f4", num_vertices * len(names), end).reshape(num_vertices, len(names))
    faces = np.frombuffer(content, np.uint8, -1, end + vertices.nbytes).reshape(num_faces, 13)[:, 1:].copy().view("<i4")
    rounded = np.round(vertices.astype(float) * _steps(names))
    if not (np.abs(rounded) < 2**30).all():
        return None
    numbers, corners = rounded.T.astype("<i4"), faces.T
    record: Record = {"kind": "ply", "header": header, "vertices": num_vertices}
    if names[:3] == ["x", "y", "z"] and corners.size and corners.min() >= 0 and corners.max() < num_vertices:
        numbers = numbers.copy()
        if names[3:6] == ["nx", "ny", "nz"]:
            foretold = numbers[3:6] - _foretold_normals(numbers[:3], corners)
            if _is_smaller(_unsigned(foretold), numbers[3:6]):
                record["normals"] = True
                numbers[3:6] = _unsigned(foretold)
        if num_vertices % 4 == 0:
            sides = _unsigned(_sides(numbers[:3]))
            if _is_smaller(sides, numbers[:3]):
                record["quads"] = True
                numbers[:3] = sides
    return record, numbers.tobytes() + corners.tobytes()


def _ply(record: Record, payload: bytes) -> bytes:
    names, num_vertices = _columns(record["header"]), record["vertices"]
    numbers = np.frombuffer(payload, "<i4", num_vertices * len(names)).reshape(len(names), num_vertices).copy()
    corners = np.frombuffer(payload, "<i4", -1, numbers.nbytes).reshape(3, -1)
    if record.get("quads"):
        numbers[:3] = _from_sides(_signed(numbers[:3]))
    if record.get("normals"):
        numbers[3:6] = _signed(numbers[3:6]) + _foretold_normals(numbers[:3], corners)
    faces = np.zeros(corners.shape[1], dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"], faces["index"] = 3, corners.T
    vertices = (numbers.T / _steps(names)).astype("<f4")
    return record["header"].encode("ascii") + vertices.tobytes() + faces.tobytes()


def _is_smaller(numbers: np.ndarray, others: np.ndarray) -> bool:
    return len(compressed(numbers.tobytes(), "numbers")) < len(compressed(others.tobytes(), "numbers"))


def _unsigned(numbers: np.ndarray) -> np.ndarray:
    """Return small numbers of both signs as small ones without: 0, -1, 1, -2 as 0, 1, 2, 3."""
    return ((numbers << 1) ^ (numbers >> 31)).astype("<i4")


def _signed(numbers: np.ndarray) -> np.ndarray:
    bits = numbers.view("<u4")
    return ((bits >> 1) ^ (0 - (bits & 1))).view("<i4")


def _sides(places: np.ndarray) -> np.ndarray:
    """Return places by the corners of quads, shape (3, num_vertices).

    Of each four vertices the first, the way to the second, the way on to the third, and how far the fourth is off the
    parallelogram of these.
    """
    first, second, third, fourth = (places[:, corner::4] for corner in range(4))
    sides = np.stack([first, second - first, third - second, fourth - third + second - first], axis=1)
    return sides.reshape(places.shape)


def _from_sides(sides: np.ndarray) -> np.ndarray:
    first, over, up, rest = (side[:, 0] for side in np.split(sides.reshape(3, 4, -1), 4, axis=1))
    second, third, fourth = first + over, first + over + up, first + up + rest
    return np.stack([first, second, third, fourth], axis=2).reshape(sides.shape)


def _foretold_normals(places: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return unit normals [steps], shape (3, num_vertices): the mean of the faces around each vertex, by area."""
    points = places.T.astype(float)
    first, second, third = (points[corner] for corner in corners)
    with np.errstate(over="ignore", invalid="ignore"):
        of_faces = np.cross(second - first, third - first)
    sums = np.zeros_like(points)
    for corner in corners:
        np.add.at(sums, corner, of_faces)
    lengths = np.sqrt((sums**2).sum(axis=1, keepdims=True))
    return np.round(sums / np.where(lengths > 0, lengths, 1.0) * _STEPS["nx"]).T.astype("<i4")


def _png_encoded(content: bytes) -> tuple[Record, bytes] | None:
    from PIL import Image

    image = Image.open(io.BytesIO(content))
    if image.mode not in ("L", "RGB") or image.info:
        return None
    record: Record = {"kind": "png", "mode": image.mode, "shape": image.size, "colors": 0}
    packed = io.BytesIO()
    image.convert("RGB").save(packed, "WEBP", lossless=True, quality=100, method=6, exact=True)
    forms = [({**record, "is_webp": True}, packed.getvalue()), (record, image.tobytes())]
    if image.mode == "RGB":
        pixels = np.asarray(image).reshape(-1, 3)
        colors, index = np.unique(pixels, axis=0, return_inverse=True)
        if len(colors) <= 256:
            forms.append(({**record, "colors": len(colors)}, colors.tobytes() + index.astype(np.uint8).tobytes()))
    return min(forms, key=lambda form: len(compressed(form[1], "bytes")))


def _png(record: Record, payload: bytes) -> bytes:
    from PIL import Image

    if record.get("is_webp"):
        image = Image.open(io.BytesIO(payload)).convert(record["mode"])
    else:
        if record["colors"]:
            colors = np.frombuffer(payload, np.uint8, 3 * record["colors"]).reshape(-1, 3)
            payload = colors[np.frombuffer(payload, np.uint8, -1, colors.nbytes)].tobytes()
        image = Image.frombytes(record["mode"], tuple(record["shape"]), payload)
    return _png_of(image)


def _png_of(image: Image.Image) -> bytes:
    written = io.BytesIO()
    image.save(written, "PNG", optimize=True)
    return written.getvalue()


def as_unpacked(name: str, content: bytes) -> bytes:
    """Return a file of these pixels or bytes as it will be unpacked, however its builder compressed it."""
    from PIL import Image

    return _png_of(Image.open(io.BytesIO(content))) if name.endswith(".png") else content


_DECODERS: dict[str, Callable[[Record, bytes], bytes]] = {"raw": _raw, "ply": _ply, "png": _png}
