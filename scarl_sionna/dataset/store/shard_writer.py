"""One shard of a scene on its way to the disk.

Frames are kept as they are finished, and the whole is put in place at once.

The shard's record (``shards/000003.json``) is written last. Without its record a shard is not there; with it, every
file of the shard is whole.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType

from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.core.untrusted.checked import checked
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.encoding import EncodedFrame, StoreOptions

from .files import Batch, LocalFiles, check_name, make_folder, output_error, write_whole
from .forms import RecordForm
from .layout import METADATA, WORK_FOLDER, clear_work
from .locks import FileLock
from .manifest import ARRAYS, IMAGES, SHARDS, ScenePlan
from .packs import Pack, is_whole, write_pack
from .shards import ArrayInfo, array_metadata, group_metadata, index_length, parse_index, shard_index, shard_key


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
        Size [bytes] and SHA-256 of each file, by its name in the dataset.
    """

    configuration: str
    frames: tuple[int, ...]
    failed: Mapping[int, str] = field(default_factory=dict)
    arrays: Mapping[str, ArrayInfo] = field(default_factory=dict)
    files: Mapping[str, tuple[int, str]] = field(default_factory=dict)

    @property
    def num_bytes(self) -> int:
        """Size of all files [bytes]."""
        return sum(size for size, _ in self.files.values())

    def dump(self) -> str:
        """Return the record's text."""
        data = {
            "configuration": self.configuration,
            "frames": list(self.frames),
            "failed": {str(index): self.failed[index] for index in sorted(self.failed)},
            "arrays": {name: self.arrays[name].to_dict() for name in sorted(self.arrays)},
            "files": {name: list(self.files[name]) for name in sorted(self.files)},
        }
        return json.dumps(data, indent=0) + "\n"

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
            arrays = {
                check_name(name, "array"): ArrayInfo(info.dtype, tuple(info.shape), tuple(info.axes), info.attributes)
                for name, info in data.arrays.items()
            }
            files = {check_name(name, "file"): item for name, item in data.files.items()}
            failed = {int(index): reason for index, reason in data.failed.items()}
            return cls(data.configuration, tuple(data.frames), failed, arrays, files)
        except ValueError as error:
            raise DatasetError(
                f"the record of a shard is damaged: {error!s:.200}", where, "run verify --repair, then export"
            ) from error


def record_name(scene: str, shard: int) -> str:
    """Return the name of a shard's record."""
    return f"{SHARDS}/{scene}/{shard:06d}.json"


def meta_name(scene: str, shard: int) -> str:
    """Return the name of the file with what of the frames stands in JSON."""
    return f"{SHARDS}/{scene}/{shard:06d}.frames.json"


def array_key(scene: str, name: str, shard: int, info: ArrayInfo) -> str:
    """Return the name of an array's shard file."""
    return shard_key(f"{ARRAYS}/{scene}/{name}", shard, info)


def image_name(scene: str, name: str) -> str:
    """Return the name of an image's file; `name` is that of the encoded frame."""
    return f"{IMAGES}/{scene}/{name}"


class ShardWriter:
    """Writes one shard; use it as a context. It holds the shard's lock.

    Parameters
    ----------
    root : path
        The dataset.
    scene : ScenePlan
    shard : int
    options : StoreOptions
    configuration : str
        Hash of all that decides the scene's frames (`DatasetPlan.scene_hash`).
    lock_timeout : float
        How long to wait for another process that works on this shard [s].

    Raises
    ------
    OutputError
        On entering, if another process works on the shard, or the folder cannot be written.
    """

    def __init__(
        self,
        root: str | Path,
        scene: ScenePlan,
        shard: int,
        options: StoreOptions,
        configuration: str,
        lock_timeout: float = 120.0,
    ) -> None:
        self.root, self.scene, self.shard, self.options = Path(root), scene, shard, options
        self.work = _work(self.root, scene.name, shard)
        self.frames = scene.shard_range(shard, options)
        self.configuration = configuration
        self.failed: dict[int, str] = {}
        self._lock = FileLock(
            self.root,
            f"{scene.name}_{shard:06d}",
            timeout=lock_timeout,
            what=f"another process makes shard {shard} of {scene.name}",
        )
        self._complete = False
        self._done: set[int] = set()

    def __enter__(self) -> ShardWriter:
        self._lock.__enter__()
        try:
            self._look()
        except BaseException:
            self._lock.release()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release(remove=self._complete)

    @property
    def complete(self) -> bool:
        """Whether the shard is finished with all of its frames."""
        return self._complete

    @property
    def missing(self) -> tuple[int, ...]:
        """Frames that are still to be made."""
        return () if self._complete else tuple(index for index in self.frames if index not in self._done)

    def add(self, frame: EncodedFrame) -> None:
        """Keep a finished frame.

        Raises
        ------
        OutputError
            If it cannot be written; nothing is left of it then.
        """
        if frame.index not in self.frames:
            raise OutputError(
                f"frame {frame.index} does not belong to shard {self.shard} "
                f"({self.frames.start} to {self.frames.stop - 1})"
            )
        path = self._pack(frame.index)
        try:
            write_pack(path, frame, self.configuration)
        except OSError as error:
            raise output_error(path, error) from error
        self._done.add(frame.index)
        self.failed.pop(frame.index, None)

    def fail(self, index: int, reason: str) -> None:
        """Record that a frame could not be made."""
        self.failed[index] = reason

    def commit(self) -> ShardRecord:
        """Put the shard in place and return its record.

        Raises
        ------
        OutputError
            If the disk does not take it, or frames are neither kept nor failed; the finished frames stay.
        """
        absent = [index for index in self.missing if index not in self.failed]
        if absent:
            raise OutputError(f"shard {self.shard} of {self.scene.name} lacks the frames {absent}; make them first")
        if self._complete:
            return read_record(self.root, self.scene.name, self.shard)  # type: ignore[return-value]
        try:
            record = self._assemble()
            place = self.root / record_name(self.scene.name, self.shard)
            make_folder(place.parent)
            write_whole(place, record.dump(), self.work)
            clear_work(self.work)
        except OSError as error:
            for part in self.work.glob("part_*"):  # room for others on a full disk
                part.unlink(missing_ok=True)
            if isinstance(error, OutputError):
                raise
            raise output_error(self.root, error) from error
        self._complete = not record.failed
        return record

    def _look(self) -> None:
        """Find out what is there already."""
        record = read_record(self.root, self.scene.name, self.shard)
        if record is not None and set(record.frames) >= set(self.frames):
            self._complete = True
            clear_work(self.work)  # of a run that was killed after it had put the shard in place
            return
        try:
            if record is not None:
                self._reopen(record)
            self._done = {index for index in self.frames if is_whole(self._pack(index), self.configuration)}
            clear_work(self.work, keep=[self._pack(index).name for index in self._done])  # what a killed process left
        except OSError as error:
            raise output_error(self.work, error) from error

    def _reopen(self, record: ShardRecord) -> None:
        """Turn a finished shard whose frames failed, or that has to grow, into kept frames again."""
        for frame in unpack(LocalFiles(self.root), record, self.scene.name, self.shard, self.options):
            if not is_whole(self._pack(frame.index), self.configuration):
                write_pack(self._pack(frame.index), frame, self.configuration)
        (self.root / record_name(self.scene.name, self.shard)).unlink()

    def _pack(self, index: int) -> Path:
        return self.work / f"{index:06d}.pack"

    def _assemble(self) -> ShardRecord:
        """Write all files of the shard and return its record."""
        packs = {index: Pack(self._pack(index)) for index in sorted(self._done)}
        arrays: dict[str, ArrayInfo] = {}
        for pack in packs.values():
            for name, info in pack.arrays.items():
                if arrays.setdefault(name, info) != info:
                    raise OutputError(
                        f"array {name} of scene {self.scene.name} changes its shape from frame to frame: "
                        f"{arrays[name].shape}, {info.shape}"
                    )
        written: dict[str, tuple[int, str]] = {}
        make_folder(self.work)
        batch = Batch(self.root, self.work)
        for name in sorted(arrays):
            key = array_key(self.scene.name, name, self.shard, arrays[name])
            written[key] = batch.write(key, _shard_parts(name, packs, self.frames.start, self.options.shard_frames))
        for pack in packs.values():
            for name in pack.files:
                target = image_name(self.scene.name, name)
                written[target] = batch.write(target, [pack.read(name)])
        meta = json.dumps([pack.meta for pack in packs.values()], indent=0) + "\n"
        target = meta_name(self.scene.name, self.shard)
        written[target] = batch.write(target, [meta.encode()])
        _write_metadata(batch, self.root, self.scene, arrays, self.options)
        batch.publish()
        return ShardRecord(self.configuration, tuple(packs), dict(self.failed), arrays, written)


def _shard_parts(name: str, packs: Mapping[int, Pack], first: int, shard_frames: int) -> Iterator[bytes]:
    """Yield the chunks of an array in order, then the index."""
    lengths: list[int | None] = []
    for index in range(first, first + shard_frames):
        pack = packs.get(index)
        length = None if pack is None else pack.size(name)
        lengths.append(length)
        if pack is not None and length is not None:
            yield pack.read(name)
    yield shard_index(lengths)


def metadata_texts(scene: ScenePlan, arrays: Mapping[str, ArrayInfo], options: StoreOptions) -> dict[str, str]:
    """Return the ``zarr.json`` of the scene's arrays and of the groups above them, by name in the dataset."""
    top = f"{ARRAYS}/{scene.name}"
    texts = {f"{ARRAYS}/{METADATA}": group_metadata(), f"{top}/{METADATA}": group_metadata()}
    for name, info in arrays.items():
        parts = name.split("/")
        for depth in range(1, len(parts)):
            texts["/".join([top, *parts[:depth], METADATA])] = group_metadata()
        texts[f"{top}/{name}/{METADATA}"] = array_metadata(info, scene.num_frames, options.shard_frames)
    return texts


def _write_metadata(
    batch: Batch, root: Path, scene: ScenePlan, arrays: Mapping[str, ArrayInfo], options: StoreOptions
) -> None:
    """Write the ``zarr.json`` files that are not there or differ."""
    for name, text in metadata_texts(scene, arrays, options).items():
        try:
            if (root / name).read_text(encoding="utf-8") == text:
                continue
        except (FileNotFoundError, UnicodeDecodeError):
            pass
        batch.write(name, [text.encode()])


def unpack(
    files: LocalFiles, record: ShardRecord, scene: str, shard: int, options: StoreOptions
) -> Iterator[EncodedFrame]:
    """Yield the encoded frames of a finished shard, bit for bit.

    Raises
    ------
    DatasetError
        If the shard is damaged.
    """
    metas = {meta["index"]: meta for meta in json.loads(files.read(meta_name(scene, shard)))}
    first = shard * options.shard_frames
    indices = {}
    for name, info in record.arrays.items():
        key = array_key(scene, name, shard, info)
        stop = record.files[key][0]
        tail = files.read(key, stop - index_length(options.shard_frames), stop)
        indices[name] = parse_index(tail, options.shard_frames)
    for index in record.frames:
        chunks, arrays = {}, {}
        for name, info in record.arrays.items():
            place = indices[name][index - first]
            if place is not None:
                arrays[name] = info
                chunks[name] = files.read(array_key(scene, name, shard, info), place[0], place[0] + place[1])
        prefix, end = image_name(scene, ""), f"/{index:06d}.png"
        images = {name.removeprefix(prefix): files.read(name) for name in record.files if name.endswith(end)}
        yield EncodedFrame(index, arrays, chunks, images, metas[index])


def tidy_shard(root: Path, scene: ScenePlan, shard: int, options: StoreOptions) -> None:
    """Remove what a killed process left of a shard beside its files, if no process works on it; finished frames stay.

    Raises
    ------
    OutputError
        If another process works on it.
    DatasetError
        If its record is damaged.
    """
    with FileLock(root, f"{scene.name}_{shard:06d}") as lock:
        record = read_record(root, scene.name, shard)
        done = set() if record is None else set(record.frames)
        frames = set(scene.shard_range(shard, options))
        clear_work(_work(root, scene.name, shard), keep=[f"{index:06d}.pack" for index in frames - done])
        lock.release(remove=done >= frames)


def _work(root: Path, scene: str, shard: int) -> Path:
    """Return the folder of a shard that is in work."""
    return root / WORK_FOLDER / scene / f"{shard:06d}"


def read_record(root: Path, scene: str, shard: int) -> ShardRecord | None:
    """Return the record of a shard, or None if it is not finished."""
    path = root / record_name(scene, shard)
    try:
        return ShardRecord.parse(path.read_bytes(), str(path))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise output_error(path, error) from error
