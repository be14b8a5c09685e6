"""Numbers of a recording that is spread over files: read where they are asked for, never as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import open_regular

LARGEST_FILE = 10**13
"""Of which a frame at a time is read [bytes]."""


class Pieces:
    """Files that follow each other as one.

    Parameters
    ----------
    paths : sequence of Path

    Raises
    ------
    InputFileError
        If one is no regular file or cannot be opened.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self.paths = tuple(paths)
        self.sizes = tuple(_size(path) for path in self.paths)

    @property
    def num_bytes(self) -> int:
        """All files together [bytes]."""
        return sum(self.sizes)

    def int16(self, offset: int, count: int) -> npt.NDArray[np.int16]:
        """Return `count` little-endian numbers of 16 bits from a byte on.

        Raises
        ------
        InputFileError
            If the files end before, or one cannot be read any more.
        """
        parts, left = [], 2 * count
        for path, size in zip(self.paths, self.sizes, strict=True):
            if offset < size and left:
                part = _part(path, offset, min(left, size - offset))
                parts.append(part)
                left -= len(part)
            offset = max(0, offset - size)
        if left:
            raise InputFileError(f"ends {left} bytes before the frame does", self.paths[-1], "copy the capture again")
        return np.frombuffer(b"".join(parts), "<i2").astype(np.int16, copy=False)


def _size(path: Path) -> int:
    try:
        with open_regular(path, LARGEST_FILE) as file:
            return file.seek(0, 2)
    except OSError as error:
        raise _unreadable(path, error) from error


def _part(path: Path, offset: int, count: int) -> bytes:
    try:
        with open_regular(path, LARGEST_FILE) as file:
            file.seek(offset)
            part = file.read(count)
    except OSError as error:
        raise _unreadable(path, error) from error
    if len(part) != count:
        raise InputFileError("has become shorter", path, "copy the capture again")
    return part


def _unreadable(path: Path, error: OSError) -> InputFileError:
    return error if isinstance(error, InputFileError) else InputFileError(f"cannot be read ({error.strerror})", path)
