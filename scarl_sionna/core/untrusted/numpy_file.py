"""NumPy's files: plain arrays of a bounded size, whatever a header claims."""

from __future__ import annotations

import io
import math
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError

from .files import read_bytes

_MOST_MEMBERS = 1000
_DAMAGE = (zipfile.BadZipFile, zlib.error, ValueError, EOFError, NotImplementedError, RuntimeError, KeyError, OSError)


def read_npz(path: str | Path, most: int) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of an ``.npz`` file by name; `most` bounds the file and what it becomes [bytes].

    Raises
    ------
    InputFileError
        If it is no regular file, cut, damaged, too large, or holds Python objects.
    OSError
        If it cannot be opened.
    """
    data = read_bytes(path, most)
    arrays, left = {}, most
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            members = packed.infolist()
            if len(members) > _MOST_MEMBERS:
                raise InputFileError(f"holds {len(members)} arrays, at most {_MOST_MEMBERS} are read", path)
            for member in members:
                left -= member.file_size
                if left < 0:
                    raise InputFileError(f"becomes larger than {most} bytes", path)
                arrays[member.filename.removesuffix(".npy")] = _array(packed.read(member))
    except InputFileError:
        raise
    except _DAMAGE as error:
        raise InputFileError(f"is no .npz file, or damaged ({error})", path, "write it again") from error
    return arrays


def read_npy(path: str | Path, most: int) -> npt.NDArray[Any]:
    """Return the array of an ``.npy`` file of at most `most` bytes; errors as for :func:`read_npz`."""
    data = read_bytes(path, most)
    try:
        return _array(data)
    except _DAMAGE as error:
        raise InputFileError(f"is no .npy file, or damaged ({error})", path, "write it again") from error


def _array(data: bytes) -> npt.NDArray[Any]:
    """Return the array of the bytes of an ``.npy`` file, after a check that they are as many as its header claims."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in read_header:
        raise ValueError(f"version {version} of the format is not read")
    try:
        shape, fortran, dtype = read_header[version](file)
        count = math.prod(shape)
    except (SyntaxError, TypeError, RecursionError, MemoryError, TokenError) as error:  # a header is a Python literal
        raise ValueError(f"its header is damaged ({error})") from error
    if dtype.hasobject or dtype.itemsize == 0 or any(size < 0 for size in shape):
        raise ValueError(f"type {dtype} and shape {shape} are not read")
    if len(data) - file.tell() != count * dtype.itemsize:
        raise ValueError(f"holds {len(data) - file.tell()} bytes for {count} values of {dtype}")
    values = np.frombuffer(data, dtype, count, file.tell()).copy()
    return values.reshape(shape, order="F" if fortran else "C")
