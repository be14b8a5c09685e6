"""MATLAB's files of level 5 (versions 5 to 7): numeric arrays of a bounded size, whatever a header claims.

References
----------
.. [1] The MathWorks, *MAT-File Format*, R2019b, chapter 1.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError

from .files import read_bytes

_MATRIX, _COMPRESSED = 14, 15
_TYPES = {1: "<i1", 2: "<u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 9: "<f8", 12: "<i8", 13: "<u8"}
_CLASSES = {6: "<f8", 7: "<f4", 8: "<i1", 9: "<u1", 10: "<i2", 11: "<u2", 12: "<i4", 13: "<u4", 14: "<i8", 15: "<u8"}
_COMPLEX = 1 << 11
_MOST_DIMENSIONS = 16


class _Element(NamedTuple):
    """Type and bytes of a data element."""

    kind: int
    data: memoryview


def read_mat(path: str | Path, most: int) -> dict[str, npt.NDArray[Any]]:
    """Return the real numeric arrays of a ``.mat`` file by name; others are passed over.

    Parameters
    ----------
    path : str or Path
    most : int
        Largest size of the file, and of what it becomes [bytes].

    Raises
    ------
    InputFileError
        If it is no regular file, of another level or byte order, cut, damaged, or becomes larger.
    OSError
        If it cannot be opened.
    """
    data = memoryview(read_bytes(path, most))
    if len(data) < 128 or bytes(data[126:128]) != b"IM":
        raise InputFileError("is no MATLAB file of level 5, little-endian", path, "save it with '-v7'")
    out: dict[str, npt.NDArray[Any]] = {}
    left = most
    try:
        for element in _elements(data[128:]):
            if element.kind == _COMPRESSED:
                whole = memoryview(_unpacked(element.data, left))
                left -= len(whole)
                element = next(_elements(whole))
            if element.kind == _MATRIX:
                found = _array(element.data)
                if found is not None:
                    out[found[0]] = found[1]
    except (ValueError, StopIteration, zlib.error, struct.error) as error:
        raise InputFileError(f"is damaged ({error or 'it ends early'})", path, "save it again") from error
    return out


def _elements(data: memoryview) -> Iterator[_Element]:
    """Yield the data elements that follow each other; each is padded to 8 bytes, but compressed ones."""
    place = 0
    while place < len(data):
        first, size = struct.unpack_from("<II", data, place)
        if first >> 16:  # small: type, size and up to four bytes in eight
            kind, size, start, step = first & 0xFFFF, first >> 16, place + 4, 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            kind, start = first, place + 8
            step = 8 + (size if kind == _COMPRESSED else -(-size // 8) * 8)
        if start + size > len(data):
            raise ValueError(f"an element of {size} bytes, {len(data) - start} are left")
        yield _Element(kind, data[start : start + size])
        place += step


def _unpacked(data: memoryview, most: int) -> bytes:
    packed = zlib.decompressobj()
    out = packed.decompress(data, max(most, 0) + 1)
    if len(out) > most:
        raise ValueError(f"it becomes larger than {most} bytes")
    if not packed.eof:
        raise ValueError("packed data is cut")
    return out


def _array(data: memoryview) -> tuple[str, npt.NDArray[Any]] | None:
    """Return name and values of a matrix; None if it is no real numeric one."""
    parts = _elements(data)
    (flags,) = struct.unpack_from("<I", next(parts).data)
    if flags & 0xFF not in _CLASSES or flags & _COMPLEX:
        return None
    sizes = next(parts).data
    shape = struct.unpack(f"<{len(sizes) // 4}i", sizes)
    name = bytes(next(parts).data).decode("ascii", "replace")
    values = next(parts)
    if values.kind not in _TYPES or not 1 <= len(shape) <= _MOST_DIMENSIONS or min(shape) < 0:
        raise ValueError(f"values of type {values.kind}, shape {shape}")
    stored = np.dtype(_TYPES[values.kind])
    if len(values.data) != math.prod(shape) * stored.itemsize:
        raise ValueError(f"{len(values.data)} bytes of {stored} for shape {shape}")
    numbers = np.frombuffer(values.data, stored).astype(_CLASSES[flags & 0xFF], copy=False)
    return name, numbers.reshape(shape, order="F")
