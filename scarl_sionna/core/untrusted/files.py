"""Bytes and texts of files: regular files only, up to a size."""

from __future__ import annotations

import os
import stat
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from scarl_sionna.core.errors import InputFileError

MEGABYTE = 1_000_000

Stamps = tuple[tuple[int, int], ...]
"""When files were last changed [ns since 1970], and their sizes [bytes]."""


def stamps(*files: Path | None) -> Stamps:
    """Return when files were changed and how large they are, (0, 0) for None or what cannot be looked at.

    In the key of a cache of what was read from them, so that an edited file is read anew.
    """
    found = []
    for file in files:
        try:
            about = None if file is None else file.stat()
        except OSError:
            about = None
        found.append((0, 0) if about is None else (about.st_mtime_ns, about.st_size))
    return tuple(found)


@contextmanager
def open_regular(path: str | Path, most: int) -> Iterator[BinaryIO]:
    """Open a file for reading; a pipe or a device, which could wait or go on for ever, is refused.

    Parameters
    ----------
    path : str or Path
    most : int
        Largest size [bytes].

    Raises
    ------
    InputFileError
        If it is no regular file, or larger.
    OSError
        If the system does not let it be opened.
    """
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb") as file:
        about = os.fstat(descriptor)
        if not stat.S_ISREG(about.st_mode):
            raise InputFileError("is no regular file", path, "give a file, no folder, pipe or device")
        if about.st_size > most:
            raise InputFileError(f"has {about.st_size} bytes, at most {most} are read", path, "give a smaller file")
        yield file


def read_bytes(path: str | Path, most: int) -> bytes:
    """Return the bytes of a file of at most `most` bytes; errors as for :func:`open_regular`."""
    with open_regular(path, most) as file:
        return file.read(min(os.fstat(file.fileno()).st_size + 1, most))  # `most` itself would be set aside at once


def read_text(path: str | Path, most: int, encoding: str = "utf-8") -> str:
    """Return the text of a file of at most `most` bytes.

    Raises
    ------
    InputFileError
        As :func:`open_regular`, or if it is no text.
    OSError
        If the system does not let it be opened.
    """
    try:
        return read_bytes(path, most).decode(encoding)
    except UnicodeDecodeError as error:
        raise InputFileError(f"is no text ({error})", path, "give a file in UTF-8") from error


def gunzipped(data: bytes, most: int, path: str | Path) -> bytes:
    """Return what a gzip file holds.

    Raises
    ------
    InputFileError
        If it is cut or damaged, or would become larger than `most` bytes.
    """
    parts, left = [], most
    try:
        while data:
            unpacker = zlib.decompressobj(wbits=16 + zlib.MAX_WBITS)
            part = unpacker.decompress(data, left + 1)
            if len(part) > left:
                raise InputFileError(f"becomes larger than {most} bytes", path, "give a smaller file")
            if not unpacker.eof:
                raise InputFileError("is cut", path, "give the whole file")
            parts.append(part)
            left -= len(part)
            data = unpacker.unused_data.lstrip(b"\0")
    except zlib.error as error:
        raise InputFileError(f"is no gzip file, or damaged ({error})", path) from error
    return b"".join(parts)
