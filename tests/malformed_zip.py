"""ZIP files whose table of contents lies: counts, places, sizes, names, flags."""

from __future__ import annotations

import io
import random
import struct
import warnings
import zipfile

_ENTRY, _END = b"PK\x01\x02", b"PK\x05\x06"
_HUGE = (0xFFFF, 0xFFFFFFFF, 0x7FFFFFFF, 2**31 - 1, 2**24, 1, 0)
NAMES = (
    "../x",
    "/proc/x",
    "..",
    ".",
    "a\\b",
    "a/../../x",
    "\0",
    "a\0.png",
    "x" * 60_000,
    "arrays/a/../../../x",
    "\u202e",
)
"""Names of files that could lead out of a folder, or have no business there."""


def evil_zip(data: bytes, rng: random.Random) -> bytes:
    """Return a ZIP file of stored members with something in its structure changed; what its members hold is whole."""
    changes = (_counts, _places, _sizes, _flags, _renamed, _doubled, _compressed, _cut, _in_front, _with_zip64)
    return rng.choice(changes)(bytearray(data), rng)


def _field(data: bytearray, at: int, form: str, value: int) -> bytes:
    size = struct.calcsize(form)
    struct.pack_into(form, data, at, value % 256**size)
    return bytes(data)


def _entry(data: bytearray, rng: random.Random) -> int:
    """Return where an entry of the table of contents begins."""
    found, at = [], data.find(_ENTRY)
    while at >= 0:
        found.append(at)
        at = data.find(_ENTRY, at + 4)
    return rng.choice(found)


def _counts(data: bytearray, rng: random.Random) -> bytes:
    end = data.rfind(_END)
    at, form = rng.choice(((8, "<H"), (10, "<H"), (12, "<I"), (16, "<I"), (20, "<H"), (4, "<H"), (6, "<H")))
    return _field(data, end + at, form, rng.choice((*_HUGE, rng.randrange(2**16))))


def _places(data: bytearray, rng: random.Random) -> bytes:
    return _field(data, _entry(data, rng) + 42, "<I", rng.choice((*_HUGE, rng.randrange(len(data)))))


def _sizes(data: bytearray, rng: random.Random) -> bytes:
    at, form = rng.choice(((16, "<I"), (20, "<I"), (24, "<I"), (28, "<H"), (30, "<H"), (32, "<H")))
    return _field(data, _entry(data, rng) + at, form, rng.choice((*_HUGE, rng.randrange(2**16))))


def _flags(data: bytearray, rng: random.Random) -> bytes:
    at, value = rng.choice(((8, 1), (8, 0x41), (8, 8), (8, 0x800), (10, 8), (10, 12), (10, 14), (10, 99), (10, 93)))
    return _field(data, _entry(data, rng) + at, "<H", value)


def _members(data: bytearray) -> list[tuple[str, bytes]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(name, archive.read(name)) for name in archive.namelist()]


def _zip(members: list[tuple[str, bytes]], how: int = zipfile.ZIP_STORED) -> bytes:
    place = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(place, "w", how) as archive:
        warnings.simplefilter("ignore")  # of a name that is there twice
        for name, content in members:
            archive.writestr(zipfile.ZipInfo(name), content, how)
    return place.getvalue()


def _renamed(data: bytearray, rng: random.Random) -> bytes:
    members = _members(data)
    index = rng.randrange(len(members))
    members[index] = (rng.choice(NAMES), members[index][1])
    return _zip(members)


def _doubled(data: bytearray, rng: random.Random) -> bytes:
    members = _members(data)
    name, content = rng.choice(members)
    return _zip([*members, (name, content[::-1])])


def _compressed(data: bytearray, rng: random.Random) -> bytes:
    members = _members(data)
    if rng.random() < 0.5:  # what a few kilobytes say they are
        members[rng.randrange(len(members))] = (members[0][0], bytes(20_000_000))
    return _zip(members, rng.choice((zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)))


def _cut(data: bytearray, rng: random.Random) -> bytes:
    if rng.random() < 0.5:
        return bytes(data[: rng.randrange(len(data))])
    start = rng.randrange(data.find(_ENTRY), len(data))
    return bytes(data[:start] + data[min(len(data), start + rng.randrange(1, 60)) :])


def _in_front(data: bytearray, rng: random.Random) -> bytes:
    return rng.randbytes(rng.choice((1, 30, 5000))) + bytes(data)


def _with_zip64(data: bytearray, rng: random.Random) -> bytes:
    """Say that the numbers are in the larger form of the end, and put any there."""
    end = data.rfind(_END)
    sizes = [rng.choice((0, 1, 2**31, 2**48, 2**63, 2**64 - 1, rng.randrange(end))) for _ in range(4)]
    record = struct.pack("<4sQ2H2I4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, *sizes)
    locator = struct.pack("<4sIQI", b"PK\x06\x07", 0, rng.choice((end, sizes[0])), 1)
    return bytes(data[:end]) + record + locator + bytes(data[end:])
