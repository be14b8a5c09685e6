"""Finished frames of an unfinished shard: one file a frame, so that a stopped export loses no frame that was done."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from scarl_sionna.core.untrusted.files import open_regular
from scarl_sionna.dataset.encoding import EncodedFrame

from .files import MOST_BYTES, make_folder, write_whole
from .shards import ArrayInfo

_MAGIC = b"SCARLPK1"
_DIGEST_LENGTH = 32


class Pack:
    """A pack that is open for reading: names, types and places of its parts; the parts are read when asked for."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with open(path, "rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise ValueError("not a pack")
            length = int.from_bytes(file.read(8), "little")
            header = json.loads(file.read(length))
        self._start = len(_MAGIC) + 8 + length
        self.meta: dict[str, Any] = header["meta"]
        self.arrays = {name: ArrayInfo.from_dict(data) for name, data in header["arrays"].items()}
        self._places: dict[str, tuple[int, int]] = {name: (start, size) for name, start, size in header["parts"]}
        self.files = tuple(header["files"])
        self.configuration: str = header["configuration"]

    def size(self, name: str) -> int | None:
        """Return the length of a part [bytes], or None if the frame does not have it."""
        place = self._places.get(name)
        return None if place is None else place[1]

    def read(self, name: str) -> bytes:
        """Return a chunk or a file."""
        start, size = self._places[name]
        with open(self._path, "rb") as file:
            file.seek(self._start + start)
            return file.read(size)


def write_pack(path: Path, frame: EncodedFrame, configuration: str) -> None:
    """Write an encoded frame and the hash of its configuration into one file, whole or not at all."""
    parts = {**frame.chunks, **frame.files}
    places, offset = [], 0
    for name, data in parts.items():
        places.append((name, offset, len(data)))
        offset += len(data)
    header = json.dumps(
        {
            "configuration": configuration,
            "meta": frame.meta,
            "arrays": {name: info.to_dict() for name, info in frame.arrays.items()},
            "files": list(frame.files),
            "parts": places,
        }
    ).encode()
    body = b"".join([_MAGIC, len(header).to_bytes(8, "little"), header, *parts.values()])
    make_folder(path.parent)
    write_whole(path, body + hashlib.sha256(body).digest())


def is_whole(path: Path, configuration: str) -> bool:
    """Return whether a pack is there, its checksum is right and it is of a configuration."""
    digest = hashlib.sha256()
    try:
        with open_regular(path, MOST_BYTES) as file:
            left = path.stat().st_size - _DIGEST_LENGTH
            if left <= 0:
                return False
            while left > 0:
                block = file.read(min(left, 1 << 20))
                if not block:
                    return False
                digest.update(block)
                left -= len(block)
            if file.read() != digest.digest():
                return False
        return Pack(path).configuration == configuration
    except (OSError, ValueError, KeyError):
        return False
