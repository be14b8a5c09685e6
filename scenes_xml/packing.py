"""Packs meshes and textures of a scene or an actor into one file, and unpacks them again, byte for byte the same.

A packed folder holds what people read as plain files (XML, TOML), ``files.xz`` with everything else, and
``files.sha256`` with the checksum of every file, as ``sha256sum`` writes it. How a single file is packed stands in
`codecs`.
"""

from __future__ import annotations

import errno
import hashlib
import json
import lzma
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from .cache import DamagedError
from .codecs import FILTERS, Record, as_unpacked, compressed, decoded, encoded

PACK = "files.xz"
SUMS = "files.sha256"
RECORDED = ".recorded.sha256"
"""Beside unpacked files: checksums of PNGs that this version of Pillow compresses otherwise, and those that are
recorded of them."""
_PLAIN = (".xml", ".toml")


def checksums(folder: Path) -> dict[str, str]:
    """Return the recorded SHA-256 of every file of a packed folder, by its path within."""
    rows = [line.partition("  ") for line in _read(folder / SUMS).decode("utf-8").splitlines()]
    return {name: digest for digest, _, name in rows}


def _read(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise DamagedError(errno.EIO, f"{file} cannot be read ({error.strerror}); install the package again") from error


def content_key(folder: Path) -> str:
    """Return a hash of all that a packed folder unpacks to."""
    digest = hashlib.sha256(_read(folder / SUMS))
    for file in sorted(folder.iterdir()):
        if file.suffix in _PLAIN:
            digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def write_packed(folder: Path, build: Callable[[Path], object]) -> None:
    """Build a scene or an actor and write it, packed, into its folder of this package."""
    with tempfile.TemporaryDirectory() as temporary:
        built = Path(temporary) / folder.name
        build(built)
        files = {file.relative_to(built).as_posix(): file for file in sorted(built.rglob("*")) if file.is_file()}
        plain = [name for name in files if name.endswith(_PLAIN)]
        folder.mkdir(exist_ok=True)
        for name in plain:
            shutil.copyfile(files[name], folder / name)
        contents = {name: as_unpacked(name, file.read_bytes()) for name, file in files.items()}
        (folder / PACK).write_bytes(pack({name: content for name, content in contents.items() if name not in plain}))
        sums = [f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in contents.items()]
        (folder / SUMS).write_text("".join(sums), encoding="utf-8", newline="\n")


def unpack_into(source: Path, folder: Path) -> None:
    """Write all files of a packed folder of this package into another one.

    Raises
    ------
    DamagedError
        If a file of the package is missing or not what was packed.
    OSError
        If a file cannot be written.
    """
    recorded = checksums(source)
    other: list[str] = []
    for file in source.iterdir():
        if file.suffix in _PLAIN:
            shutil.copyfile(file, folder / file.name)

    def unpacked(part: tuple[Record, bytes]) -> None:
        name = part[0]["name"]
        content = decoded(*part)
        digest = hashlib.sha256(content).hexdigest()
        if digest != recorded[name]:
            if not name.endswith(".png"):
                raise ValueError(f"the checksum of {name} is wrong")
            other.append(f"{digest}  {recorded[name]}\n")
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)

    try:
        with ThreadPoolExecutor() as pool:  # compressing the pixels takes the time, and leaves Python free
            list(pool.map(unpacked, _parts(lzma.decompress(_read(source / PACK)))))
    except (lzma.LZMAError, ValueError, KeyError) as error:
        raise DamagedError(errno.EIO, f"{source / PACK} is damaged ({error}); install the package again") from error
    if other:
        (folder / RECORDED).write_text("".join(other), encoding="utf-8")


def recorded_digest(file: Path, digest: str) -> str:
    """Return the checksum that this package records for an unpacked file, given the one that it has on this machine.

    They differ only for a PNG with the same pixels that another version of Pillow compressed.
    """
    table = file.parent.parent / RECORDED
    if file.suffix == ".png" and table.is_file():
        lines = table.read_text(encoding="utf-8").splitlines()
        return dict(line.split() for line in lines).get(digest, digest)
    return digest


def pack(files: Mapping[str, bytes]) -> bytes:
    """Return files as one sequence of bytes; the same files give the same bytes with the same liblzma and libwebp."""
    streams: dict[str, tuple[list[Record], list[bytes]]] = {key: ([], []) for key in FILTERS}
    for name, content in sorted(files.items()):
        record, payload = encoded(name, content)
        records, payloads = streams["numbers" if record["kind"] == "ply" else "bytes"]
        records.append({"name": name, **record, "size": len(payload)})
        payloads.append(payload)
    packed = b""
    for key, (records, payloads) in streams.items():
        if records:
            head = json.dumps(records, separators=(",", ":")).encode()
            head += b" " * (-(len(head) + 1) % 4) + b"\n"  # numbers stay at multiples of four bytes
            packed += compressed(head + b"".join(payloads), key)
    return packed


def unpack(packed: bytes) -> dict[str, bytes]:
    """Return the files that `pack` packed, by name."""
    return {record["name"]: decoded(record, part) for record, part in _parts(lzma.decompress(packed))}


def _parts(data: bytes) -> Iterator[tuple[Record, bytes]]:
    """Yield record and payload of every file."""
    place = 0
    while place < len(data):
        end = data.index(b"\n", place) + 1
        records, place = json.loads(data[place:end]), end
        for record in records:
            yield record, data[place : place + record["size"]]
            place += record["size"]
