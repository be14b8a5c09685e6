"""Packs meshes and textures of a scene or an actor into one file, and unpacks them again, byte for byte the same.

A packed folder holds what people read as plain files (XML, TOML), ``files.xz`` with everything else, and
``files.sha256`` with the checksum of every file, as ``sha256sum`` writes it. Coordinates of a PLY are multiples of 1e-5
and are packed as whole numbers, column by column; a PNG is packed by its pixels and compressed again when it is
unpacked. A file that would not come back as it was is packed as it is.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import lzma
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from .cache import DamagedError

PACK = "files.xz"
SUMS = "files.sha256"
RECORDED = ".recorded.sha256"
"""Beside unpacked files: checksums of PNGs that this version of Pillow compresses otherwise, and those that are
recorded of them."""
_PLAIN = (".xml", ".toml")
_STEPS = {"x": 1e5, "y": 1e5, "z": 1e5, "nx": 1e4, "ny": 1e4, "nz": 1e4, "u": 1e5, "v": 1e5}
"""Steps per unit to which each column of a PLY is rounded (see generators/geometry/mesh.py)."""
_COUNTS = re.compile(rb"element vertex (\d+)\n.*element face (\d+)\n", re.DOTALL)
_FILTERS = {
    "numbers": {"lc": 0, "lp": 2, "pb": 2},  # four bytes a number
    "bytes": {"lc": 3, "lp": 0, "pb": 0},
}
Record = dict[str, Any]


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
        (folder / PACK).write_bytes(
            pack({name: file.read_bytes() for name, file in files.items() if name not in plain})
        )
        sums = [f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {name}\n" for name, file in files.items()]
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
        content = _DECODERS[part[0]["kind"]](*part)
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
    """Return files as one sequence of bytes; the same files give the same bytes with the same version of liblzma."""
    streams: dict[str, tuple[list[Record], list[bytes]]] = {key: ([], []) for key in _FILTERS}
    for name, content in sorted(files.items()):
        record, payload = _encoded(name, content)
        records, payloads = streams["numbers" if record["kind"] == "ply" else "bytes"]
        records.append({"name": name, **record, "size": len(payload)})
        payloads.append(payload)
    packed = b""
    for key, (records, payloads) in streams.items():
        if records:
            head = json.dumps(records, separators=(",", ":")).encode()
            head += b" " * (-(len(head) + 1) % 4) + b"\n"  # numbers stay at multiples of four bytes
            filters = [
                {"id": lzma.FILTER_LZMA2, "preset": 9 | lzma.PRESET_EXTREME, "dict_size": 16 << 20, **_FILTERS[key]}
            ]
            packed += lzma.compress(head + b"".join(payloads), format=lzma.FORMAT_XZ, filters=filters)
    return packed


def unpack(packed: bytes) -> dict[str, bytes]:
    """Return the files that `pack` packed, by name."""
    return {record["name"]: _DECODERS[record["kind"]](record, part) for record, part in _parts(lzma.decompress(packed))}


def _parts(data: bytes) -> Iterator[tuple[Record, bytes]]:
    """Yield record and payload of every file."""
    place = 0
    while place < len(data):
        end = data.index(b"\n", place) + 1
        records, place = json.loads(data[place:end]), end
        for record in records:
            yield record, data[place : place + record["size"]]
            place += record["size"]


def _encoded(name: str, content: bytes) -> tuple[Record, bytes]:
    """Return the record and the payload of a file, in the smallest of its forms that gives the same bytes again."""
    encoder = {".ply": _ply_encoded, ".png": _png_encoded}.get(Path(name).suffix)
    found = encoder(content) if encoder else None
    if found is not None and _DECODERS[found[0]["kind"]](*found) == content:
        return found
    return {"kind": "raw"}, content


def _raw(record: Record, payload: bytes) -> bytes:
    return payload


def _steps(header: str) -> np.ndarray:
    """Return the steps per unit of each column of vertices, shape (num_columns,)."""
    return np.array([_STEPS.get(name, 1.0) for name in re.findall(r"property float (\w+)\n", header)])


def _ply_encoded(content: bytes) -> tuple[Record, bytes] | None:
    end = content.find(b"end_header\n") + len(b"end_header\n")
    counts = _COUNTS.search(content, 0, end)
    if counts is None:
        return None
    num_vertices, num_faces = int(counts[1]), int(counts[2])
    header = content[:end].decode("ascii")
    steps = _steps(header)
    if len(content) != end + 4 * num_vertices * len(steps) + 13 * num_faces:
        return None
    vertices = np.frombuffer(content, "<f4", num_vertices * len(steps), end).reshape(num_vertices, len(steps))
    faces = np.frombuffer(content, np.uint8, -1, end + vertices.nbytes).reshape(num_faces, 13)[:, 1:].copy().view("<i4")
    numbers = np.round(vertices.astype(float) * steps)
    if not (np.abs(numbers) < 2**31).all():
        return None
    record = {"kind": "ply", "header": header, "vertices": num_vertices}
    return record, numbers.T.astype("<i4").tobytes() + faces.T.tobytes()


def _ply(record: Record, payload: bytes) -> bytes:
    steps, num_vertices = _steps(record["header"]), record["vertices"]
    numbers = np.frombuffer(payload, "<i4", num_vertices * len(steps)).reshape(len(steps), num_vertices).T
    corners = np.frombuffer(payload, "<i4", -1, numbers.nbytes).reshape(3, -1).T
    faces = np.zeros(len(corners), dtype=[("count", "u1"), ("index", "<i4", 3)])
    faces["count"], faces["index"] = 3, corners
    return record["header"].encode("ascii") + (numbers / steps).astype("<f4").tobytes() + faces.tobytes()


def _png_encoded(content: bytes) -> tuple[Record, bytes] | None:
    from PIL import Image

    image = Image.open(io.BytesIO(content))
    if image.mode not in ("L", "RGB") or image.info:
        return None
    record: Record = {"kind": "png", "mode": image.mode, "shape": image.size}
    if image.mode == "RGB":
        pixels = np.asarray(image).reshape(-1, 3)
        colors, index = np.unique(pixels, axis=0, return_inverse=True)
        if len(colors) <= 256:
            return {**record, "colors": len(colors)}, colors.tobytes() + index.astype(np.uint8).tobytes()
    return {**record, "colors": 0}, image.tobytes()


def _png(record: Record, payload: bytes) -> bytes:
    from PIL import Image

    if record["colors"]:
        colors = np.frombuffer(payload, np.uint8, 3 * record["colors"]).reshape(-1, 3)
        payload = colors[np.frombuffer(payload, np.uint8, -1, colors.nbytes)].tobytes()
    written = io.BytesIO()
    Image.frombytes(record["mode"], tuple(record["shape"]), payload).save(written, "PNG", optimize=True)
    return written.getvalue()


_DECODERS: dict[str, Callable[[Record, bytes], bytes]] = {"raw": _raw, "ply": _ply, "png": _png}
