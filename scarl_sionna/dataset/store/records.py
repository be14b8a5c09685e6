"""The record of a finished shard: its frames, where its images and arrays are, and their checksums.

In the layout "files" each image and each array of a shard is a file (``images/...``, ``arrays/...``). In the layout
"packed" all of them are members of one ZIP file, the shard's *bundle*, under the same names; the record holds where
each begins, so that it is read without the table of contents of the ZIP file.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from scarl_sionna.core.errors import DatasetError, DatasetUnreachable, InputFileError
from scarl_sionna.core.untrusted.checked import checked
from scarl_sionna.core.untrusted.files import read_bytes
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.codec import checksum_of, with_checksum
from scarl_sionna.dataset.encoding import EncodedFrame, StoreOptions

from .files import MOST_JSON_BYTES, Files, LocalFiles, check_name, output_error, read_member
from .forms import MOST_SHARD_FRAMES, RecordForm
from .layout import METADATA
from .manifest import ARRAYS, IMAGES, SHARDS, DatasetPlan, ScenePlan
from .shards import ArrayInfo, array_metadata, group_metadata, index_length, parse_index, shard_key

Row = list[Any] | None
"""Checksum, number of frames, failed frames and bytes of a shard, as the manifest holds them."""
_MOST_TRIED = 1024
"""Frames in a shard, at most, that a lone first shard is recognized by: as many as the command line takes."""
EPOCH = (1980, 1, 1, 0, 0, 0)
"""Time of every member of a ZIP file, so that the same frames give the same bytes."""


@dataclass(frozen=True)
class ShardRecord:
    """What a finished shard holds.

    Attributes
    ----------
    configuration : str
        Hash of all that decides the frames' bytes.
    frames : tuple of int
        Frames that are there.
    failed : mapping of int to str
        Frames that are not, with the reason.
    arrays : mapping of str to ArrayInfo
    files : mapping of str to (int, str)
        Size [bytes] and SHA-256 of each image, array and JSON text, by its name in the dataset.
    bundle : (str, int, str), optional
        Name, size [bytes] and SHA-256 of the ZIP file that all of `files` are in; None: each is a file.
    starts : mapping of str to int
        Where each of `files` begins in the bundle [bytes].
    has_checksum : bool
        Whether its text has a checksum of its own. One of an earlier version has none; the manifest has one for it.
    """

    configuration: str
    frames: tuple[int, ...]
    failed: Mapping[int, str] = field(default_factory=dict)
    arrays: Mapping[str, ArrayInfo] = field(default_factory=dict)
    files: Mapping[str, tuple[int, str]] = field(default_factory=dict)
    bundle: tuple[str, int, str] | None = None
    starts: Mapping[str, int] = field(default_factory=dict)
    has_checksum: bool = field(default=True, compare=False)

    @property
    def on_disk(self) -> Mapping[str, tuple[int, str]]:
        """Size [bytes] and SHA-256 of each file that the shard has beside its record."""
        return self.files if self.bundle is None else {self.bundle[0]: self.bundle[1:]}

    @property
    def num_bytes(self) -> int:
        """Size of all files [bytes]."""
        return sum(size for size, _ in self.on_disk.values())

    def read(self, files: Files, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        """Return one of `files`, or its bytes from `start` to `stop`, wherever it is; nothing is checked."""
        if self.bundle is None:
            return files.read(name, start, stop)
        return read_member(files, self.bundle[0], name, (self.starts[name], self.files[name][0]), start, stop)

    def dump(self) -> str:
        """Return the record's text, its own checksum at its end."""
        places = {name: [] if self.bundle is None else [self.starts[name]] for name in self.files}
        data = {
            "configuration": self.configuration,
            "frames": list(self.frames),
            "failed": {str(index): self.failed[index] for index in sorted(self.failed)},
            "arrays": {name: self.arrays[name].to_dict() for name in sorted(self.arrays)},
            "files": {name: [*self.files[name], *places[name]] for name in sorted(self.files)},
            **({} if self.bundle is None else {"bundle": list(self.bundle)}),
        }
        return with_checksum(json.dumps(data, indent=0))

    @classmethod
    def load(cls, path: Path) -> ShardRecord:
        """Return the record in a file of this machine; errors as for :meth:`parse`, and `OSError`."""
        try:
            text = read_bytes(path, MOST_JSON_BYTES)
        except InputFileError as error:  # a pipe, or a link to a device, would hold it up for ever
            raise DatasetError(
                f"the record of a shard {error.strerror}", path, "run verify --repair, then export"
            ) from error
        return cls.parse(text, str(path))

    @classmethod
    def parse(cls, text: bytes, where: str = "") -> ShardRecord:
        """Return the record of :meth:`dump`.

        Raises
        ------
        DatasetError
            If it is damaged or names a file outside of the scene.
        """
        try:
            data = checked(RecordForm, parse_json(text))
            if data.checksum not in (None, checksum_of(text)):
                raise ValueError("its checksum is wrong")
            arrays = {
                check_name(name, "array"): ArrayInfo(info.dtype, tuple(info.shape), tuple(info.axes), info.attributes)
                for name, info in data.arrays.items()
            }
            files = {check_name(name, "file"): (item[0], item[1]) for name, item in data.files.items()}
            starts = {name: item[2] for name, item in data.files.items() if len(item) == 3}
            failed = {int(index): reason for index, reason in data.failed.items()}
            if data.bundle is not None:
                check_name(data.bundle[0], "file")
            has_checksum = data.checksum is not None
            return cls(data.configuration, tuple(data.frames), failed, arrays, files, data.bundle, starts, has_checksum)
        except ValueError as error:
            raise DatasetError(
                f"the record of a shard is damaged: {error!s:.200}", where, "run verify --repair, then export"
            ) from error


def record_name(scene: str, shard: int) -> str:
    """Return the name of a shard's record."""
    return f"{SHARDS}/{scene}/{shard:06d}.json"


def bundle_name(scene: str, shard: int) -> str:
    """Return the name of a shard's ZIP file."""
    return f"{SHARDS}/{scene}/{shard:06d}.zip"


def meta_name(scene: str, shard: int) -> str:
    """Return the name of the file with what of the frames stands in JSON."""
    return f"{SHARDS}/{scene}/{shard:06d}.frames.json"


def array_key(scene: str, name: str, shard: int, info: ArrayInfo) -> str:
    """Return the name of an array's shard file."""
    return shard_key(f"{ARRAYS}/{scene}/{name}", shard, info)


def image_name(scene: str, name: str) -> str:
    """Return the name of an image's file; `name` is that of the encoded frame."""
    return f"{IMAGES}/{scene}/{name}"


def read_record(root: Path, scene: str, shard: int) -> ShardRecord | None:
    """Return the record of a shard, or None if it is not finished."""
    path = root / record_name(scene, shard)
    try:
        return ShardRecord.load(path)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise output_error(path, error) from error


def is_full(row: Row, scene: ScenePlan, shard: int, options: StoreOptions) -> bool:
    """Return whether a shard has all of its frames."""
    return row is not None and row[1] == len(scene.shard_range(shard, options))


def shard_length(plan: DatasetPlan, records: Mapping[tuple[str, int], ShardRecord]) -> int | None:
    """Return the frames in a shard of which a plan makes the shards that are there, by scene and number; None: of none.

    The first frame of a shard tells it. The first shard of a scene has it in the hash of its configuration only.
    """
    scenes = {scene.name for scene in plan.scenes}
    last = max(((shard, scene) for scene, shard in records if scene in scenes), default=None)
    if last is None:
        return None
    shard, scene = last
    record = records[scene, shard]
    frames = (*record.frames, *record.failed) or (0,)
    lengths = (min(frames) // shard,) if shard else range(max(frames) + 1, _MOST_TRIED + 1)
    found = (
        length
        for length in lengths
        if 1 <= length <= MOST_SHARD_FRAMES and plan.scene_hash(scene, length) == record.configuration
    )
    return next(found, None)


def lost_file(root: Path, record: ShardRecord) -> str | None:
    """Return the first file that a record names and that is not in a folder with the size that it states."""
    return next((name for name, (size, _) in record.on_disk.items() if _size(root / name) != size), None)


def _size(path: Path) -> int | None:
    try:
        return path.stat().st_size if path.is_file() else None
    except OSError:
        return None


def shard_rows(
    files: Files,
    scene: ScenePlan,
    options: StoreOptions,
    known: Sequence[Row] = (),
    on_lost: Callable[[str], None] = lambda text: None,
) -> tuple[list[Row], dict[str, Any]]:
    """Return checksum, frames, failed frames and bytes of each finished shard, and the arrays.

    None for a shard that is not finished, or whose ZIP file is not there with the size that its record states (in an
    object store: not there); of those `on_lost` is told.

    A shard that `known` lists with all of its frames is not read again: its record is the largest part of a large
    dataset's bookkeeping. The arrays are those of the shards that were read.
    """
    rows: list[Row] = []
    arrays: dict[str, Any] = {}
    root = files.root if isinstance(files, LocalFiles) else None
    there = set(files.names(f"{SHARDS}/{scene.name}")) if root is None else set()
    for shard in range(scene.num_shards(options)):
        name = record_name(scene.name, shard)
        if not ((root / name).is_file() if root is not None else name.rpartition("/")[2] in there):
            rows.append(None)
            continue
        row, found = known[shard] if shard < len(known) else None, dict[str, ArrayInfo]()
        if not is_full(row, scene, shard, options):
            try:
                text = files.read(name)
                record = ShardRecord.parse(text)
            except DatasetUnreachable:
                raise
            except (FileNotFoundError, NotADirectoryError, InputFileError, DatasetError):
                rows.append(None)
                continue
            row = [hashlib.sha256(text).hexdigest(), len(record.frames), sorted(record.failed), record.num_bytes]
            found = dict(record.arrays)
        bundle = bundle_name(scene.name, shard)
        in_place = bundle.rpartition("/")[2] in there if root is None else [_size(root / bundle)] == (row or [])[3:4]
        if options.layout == "packed" and not in_place:
            on_lost(bundle)
            rows.append(None)
            continue
        rows.append(row)
        arrays.update(found)
    return rows, arrays


def write_members(file: IO[bytes], members: Iterable[tuple[str, Iterable[bytes]]]) -> dict[str, int]:
    """Write a ZIP file without compression, and return where the content of each member begins [bytes].

    Parameters
    ----------
    file : binary file
        Empty, open for writing and searching.
    members : iterable of (str, iterable of bytes)
        Name and content of each, which the ZIP file holds as it is.
    """
    starts = {}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name, parts in members:
            data = b"".join(parts)
            entry = zipfile.ZipInfo(name, EPOCH)
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            archive.writestr(entry, data)
            starts[name] = file.tell() - len(data)
    return starts


def metadata_texts(scene: ScenePlan, arrays: Mapping[str, ArrayInfo], options: StoreOptions) -> dict[str, str]:
    """Return the ``zarr.json`` files of the scene's arrays and of the groups above them, by name in the dataset.

    There are none in the layout "packed".
    """
    return {} if options.layout == "packed" else zarr_texts(scene, arrays, options)


def zarr_texts(scene: ScenePlan, arrays: Mapping[str, ArrayInfo], options: StoreOptions) -> dict[str, str]:
    """Return the ``zarr.json`` of the scene's arrays and of the groups above them, by name in the dataset."""
    top = f"{ARRAYS}/{scene.name}"
    texts = {f"{ARRAYS}/{METADATA}": group_metadata(), f"{top}/{METADATA}": group_metadata()}
    for name, info in arrays.items():
        parts = name.split("/")
        for depth in range(1, len(parts)):
            texts["/".join([top, *parts[:depth], METADATA])] = group_metadata()
        texts[f"{top}/{name}/{METADATA}"] = array_metadata(info, scene.num_frames, options.shard_frames)
    return texts


def unpack(files: Files, record: ShardRecord, scene: str, shard: int, options: StoreOptions) -> Iterator[EncodedFrame]:
    """Yield the encoded frames of a finished shard, bit for bit.

    Raises
    ------
    DatasetError
        If the shard is damaged.
    """
    metas = {meta["index"]: meta for meta in json.loads(record.read(files, meta_name(scene, shard)))}
    first = shard * options.shard_frames
    indices = {}
    for name, info in record.arrays.items():
        key = array_key(scene, name, shard, info)
        stop = record.files[key][0]
        tail = record.read(files, key, stop - index_length(options.shard_frames), stop)
        indices[name] = parse_index(tail, options.shard_frames)
    for index in record.frames:
        chunks, arrays = {}, {}
        for name, info in record.arrays.items():
            place = indices[name][index - first]
            if place is not None:
                arrays[name] = info
                key = array_key(scene, name, shard, info)
                chunks[name] = record.read(files, key, place[0], place[0] + place[1])
        prefix, end = image_name(scene, ""), f"/{index:06d}.png"
        images = {name.removeprefix(prefix): record.read(files, name) for name in record.files if name.endswith(end)}
        yield EncodedFrame(index, arrays, chunks, images, metas[index])
