"""One shard of a scene on its way to the disk.

Frames are kept as they are finished, and the whole is put in place at once.

The shard's record (``shards/<scene>/000003.json``) is written last. Without its record a shard is not there; with it,
every file of the shard is whole.
"""

from __future__ import annotations

import hashlib
import json
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType

from scarl_sionna.core.errors import OutputError, ScarlWarning
from scarl_sionna.dataset.encoding import EncodedFrame, StoreOptions

from .files import Batch, LocalFiles, holds_text, make_folder, output_error, write_whole
from .layout import WORK_FOLDER, clear_work, remove_file
from .locks import FileLock
from .manifest import ScenePlan
from .packs import Pack, is_whole, write_pack
from .records import (
    ShardRecord,
    array_key,
    bundle_name,
    image_name,
    lost_file,
    meta_name,
    metadata_texts,
    read_record,
    record_name,
    unpack,
    write_members,
)
from .shards import ArrayInfo, shard_index


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

    Warns
    -----
    ScarlWarning
        On entering, if a file of a finished shard of the layout "files" is not there with the size that was written;
        the first one is named, and all of the shard is to be made again.

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
        self.root, self.scene, self.shard, self.options = Path(root).absolute(), scene, shard, options
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
        return self._put(self._assemble)

    def copy(self, there: ShardRecord, members: Iterable[tuple[str, Iterable[bytes]]]) -> ShardRecord:
        """Put a finished shard of another dataset in place, its files byte for byte, in the layout of this one.

        Parameters
        ----------
        there : ShardRecord
            Of the other shard.
        members : iterable of (str, iterable of bytes)
            Name and content of each of its files.

        Raises
        ------
        OutputError
            If the disk does not take it.
        """
        return self._put(lambda: self._write(members, there.frames, there.failed, there.arrays))

    def _put(self, assemble: Callable[[], ShardRecord]) -> ShardRecord:
        try:
            record = assemble()
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
        if record is not None and (lost := lost_file(self.root, record)) is not None:
            if record.bundle is None:  # `DatasetFolder` tells of ZIP files
                warnings.warn(
                    f"not in {self.root} with the size that was written: {lost}; shard {self.shard} of "
                    f"{self.scene.name} is made again",
                    ScarlWarning,
                    stacklevel=3,
                )
            remove_file(self.root / record_name(self.scene.name, self.shard))  # all is made again
            record = None
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
        members = sorted(self._members(packs, arrays), key=lambda item: item[0])
        return self._write(members, tuple(packs), self.failed, arrays)

    def _write(
        self,
        members: Iterable[tuple[str, Iterable[bytes]]],
        frames: tuple[int, ...],
        failed: Mapping[int, str],
        arrays: Mapping[str, ArrayInfo],
    ) -> ShardRecord:
        """Write the files of the shard, give them their names, and return its record."""
        make_folder(self.work)
        batch = Batch(self.root, self.work)
        bundle, starts = None, dict[str, int]()
        if self.options.layout == "packed":
            place = bundle_name(self.scene.name, self.shard)
            written = dict[str, tuple[int, str]]()
            digested = ((name, _digested(name, parts, written)) for name, parts in members)
            size, digest, starts = batch.write_with(place, lambda file: write_members(file, digested))
            bundle = (place, size, digest)
        else:
            written = {name: batch.write(name, parts) for name, parts in members}
        _write_metadata(batch, self.root, self.scene, arrays, self.options)
        batch.publish()
        return ShardRecord(self.configuration, frames, dict(failed), arrays, written, bundle, starts)

    def _members(
        self, packs: Mapping[int, Pack], arrays: Mapping[str, ArrayInfo]
    ) -> Iterator[tuple[str, Iterable[bytes]]]:
        """Yield name and content of each array, image and JSON text of the shard; a content is read in its turn."""
        for name in sorted(arrays):
            key = array_key(self.scene.name, name, self.shard, arrays[name])
            yield key, _shard_parts(name, packs, self.frames.start, self.options.shard_frames)
        for pack in packs.values():
            yield from ((image_name(self.scene.name, name), map(pack.read, [name])) for name in pack.files)
        meta = json.dumps([pack.meta for pack in packs.values()], indent=0) + "\n"
        yield meta_name(self.scene.name, self.shard), [meta.encode()]


def _digested(name: str, parts: Iterable[bytes], written: dict[str, tuple[int, str]]) -> Iterator[bytes]:
    """Yield the parts of a file, and put its size [bytes] and SHA-256 into `written` at its end."""
    digest, size = hashlib.sha256(), 0
    for part in parts:
        yield part
        digest.update(part)
        size += len(part)
    written[name] = size, digest.hexdigest()


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


def _write_metadata(
    batch: Batch, root: Path, scene: ScenePlan, arrays: Mapping[str, ArrayInfo], options: StoreOptions
) -> None:
    """Write the ``zarr.json`` files that are not there or differ."""
    for name, text in metadata_texts(scene, arrays, options).items():
        if not holds_text(root / name, text):
            batch.write(name, [text.encode()])


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
