"""Numbers of a recording that is spread over files: read where they are asked for, never as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import open_regular, read_text

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

    def whole(self, count: int) -> npt.NDArray[np.int16]:
        """Return all numbers of 16 bits.

        Raises
        ------
        InputFileError
            If they are not `count`, or cannot be read.
        """
        if self.num_bytes != 2 * count:
            raise InputFileError(f"has {self.num_bytes} bytes, one frame has {2 * count}", self.paths[0])
        return self.int16(0, count)


def numbered(folder: Path, before: str, after: str) -> dict[int, Path]:
    """Return the files ``before + number + after`` of a folder by their number, rising.

    Raises
    ------
    InputFileError
        If there is none.
    """
    found = {}
    for path in folder.glob(f"{before}*{after}"):
        number = path.name[len(before) : len(path.name) - len(after)]
        if number.isascii() and number.isdecimal() and len(number) < 18:
            found[int(number)] = path
    if not found:
        raise InputFileError(f"has no file {before}*{after}", folder)
    return dict(sorted(found.items()))


def text_of(path: Path, most: int) -> str:
    """Return the text of a file.

    Raises
    ------
    InputFileError
        If it cannot be opened, is no regular file, larger than `most` bytes, or no text.
    """
    try:
        return read_text(path, most)
    except OSError as error:
        raise _unreadable(path, error) from error


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
