"""Puts a finished dataset into one archive a shard, and takes it out again, byte for byte."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

from scarl_sionna.core.errors import DatasetError, OutputError

from .formats.output import whole_folder
from .formats.source import OnProgress, no_progress
from .readers.reader import Dataset, open_dataset
from .store.archives import COMMON, INDEX, ArchivedFiles, archive_name, index_text, shard_of
from .store.atomic import partial_path
from .store.files import output_error
from .store.layout import CARD, LOG_FILE, METADATA
from .store.manifest import ARRAYS, BACKUP, MANIFEST, ScenePlan
from .store.records import ShardRecord, record_name, write_members

_MOST = 2**31
"""Largest file that goes into an archive [bytes]: beyond it a ZIP file has another head."""


def archive_dataset(
    place: str | Path, out: str | Path, *, overwrite: bool = False, on_progress: OnProgress = no_progress
) -> Path:
    """Write a finished dataset as archives: one ZIP file a shard instead of one file an image and an array.

    `open_dataset` and all that read through it read the archives as they are; `restore_dataset`, or ``unzip``, brings
    the files back.

    Parameters
    ----------
    place : path or str
        Of the dataset; also an fsspec URL.
    out : path
        Folder to make.
    overwrite : bool
        Replace archives that were written before.
    on_progress : callable
        Called with the number of shards and of all of them.

    Raises
    ------
    DatasetError
        If there is no dataset, it is not finished, in archives already, or a file is not what was written.
    OutputError
        If the folder is there or cannot be written.
    """
    dataset = open_dataset(place)
    if isinstance(dataset.files, ArchivedFiles):
        raise DatasetError("is in archives already", place, "copy it as it is")
    if dataset.plan.options.layout == "packed":
        raise DatasetError("has two files a shard already", place, "copy it as it is")
    shards = [(s, n) for s in dataset.plan.scenes for n in range(s.num_shards(dataset.plan.options))]
    rows = dataset.manifest.shards
    for scene, number in shards:
        if number >= len(rows.get(scene.name, [])) or rows[scene.name][number] is None:
            raise DatasetError(
                f"shard {number} of {scene.name} is not finished", place, "run the export to its end first"
            )
    mark = {"format": INDEX, "scenes": dataset.scenes}
    sizes: dict[str, list[int]] = {scene.name: [] for scene in dataset.plan.scenes}
    with whole_folder(out, mark, overwrite) as folder:
        metadata = {f"{ARRAYS}/{METADATA}"}
        for done, (scene, number) in enumerate(shards, 1):
            path = folder / archive_name(scene.name, number)
            path.parent.mkdir(parents=True, exist_ok=True)
            names, read = _of_shard(dataset, scene, number)
            sizes[scene.name].append(_write(path, names, read))
            metadata |= _metadata(scene.name, names, dataset)
            on_progress(done, len(shards))
        there = [name for name in (MANIFEST, BACKUP, CARD, LOG_FILE, *sorted(metadata)) if _is_there(dataset, name)]
        common = _write(folder / COMMON, there, dataset.files.read)
        if CARD in there:
            (folder / CARD).write_bytes(dataset.files.read(CARD))
        (folder / INDEX).write_text(index_text(dataset.plan.options.shard_frames, common, sizes), encoding="utf-8")
    return Path(out)


def restore_dataset(place: str | Path, out: str | Path, *, on_progress: OnProgress = no_progress) -> Path:
    """Write the files of a dataset in archives as they were.

    Parameters
    ----------
    place : path or str
        Of the archives; also an fsspec URL.
    out : path
        Folder to make; it must not be there.
    on_progress : callable
        Called with the number of archives and of all of them.

    Raises
    ------
    DatasetError
        If there are no archives, or one is damaged.
    OutputError
        If the folder is there or cannot be written.
    """
    out = Path(out)
    files = open_dataset(place).files
    if not isinstance(files, ArchivedFiles):
        raise DatasetError("is not in archives", place, "copy it as it is")
    if out.exists():
        raise OutputError(f"{out} is there; choose another folder")
    partial = partial_path(out)
    archives = files.archives()
    try:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir(parents=True)
        for done, (archive, size) in enumerate(archives, 1):
            for name in files.table(archive, size):
                target = partial / name
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(files.read(name))
            on_progress(done, len(archives))
        partial.rename(out)
    except OSError as error:
        raise output_error(out, error) from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)
    return out


def _of_shard(dataset: Dataset, scene: ScenePlan, number: int) -> tuple[list[str], Callable[[str], bytes]]:
    """Return the names of a shard's files, and what reads one and holds it to its checksum."""
    record = record_name(scene.name, number)
    text = dataset.files.read(record)
    row = dataset.manifest.shards[scene.name][number]
    if row is None or hashlib.sha256(text).hexdigest() != row[0]:
        raise DatasetError(f"{record} is not what was written", dataset.place, "run `scarl-sionna verify --repair`")
    written = ShardRecord.parse(text, record).files

    def read(name: str) -> bytes:
        if name == record:
            return text
        data = dataset.files.read(name)
        size, digest = written[name]
        if (len(data), hashlib.sha256(data).hexdigest()) != (size, digest):
            raise DatasetError(f"{name} is not what was written", dataset.place, "run `scarl-sionna verify --repair`")
        return data

    frames = dataset.plan.options.shard_frames
    for name in written:
        if shard_of(name, frames) != (scene.name, number):
            raise DatasetError(f"{name} does not belong to the shard {number} of {scene.name}", dataset.place)
    return [record, *written], read


def _metadata(scene: str, names: Iterable[str], dataset: Dataset) -> set[str]:
    """Return the metadata files of the arrays of a shard and of the groups above them."""
    found = set()
    for name in names:
        if name.startswith(f"{ARRAYS}/{scene}/") and shard_of(name, dataset.plan.options.shard_frames):
            parts = name.partition("/c/")[0].split("/")
            found |= {"/".join([*parts[:depth], METADATA]) for depth in range(2, len(parts) + 1)}
    return found


def _is_there(dataset: Dataset, name: str) -> bool:
    try:
        dataset.files.read(name, 0, 1)
    except FileNotFoundError:
        return False
    return True


def _write(path: Path, names: Iterable[str], read: Callable[[str], bytes]) -> int:
    """Write an archive of files and return its size [bytes]."""
    path.parent.mkdir(parents=True, exist_ok=True)

    def content(name: str) -> list[bytes]:
        data = read(name)
        if len(data) >= _MOST:
            raise DatasetError(f"{name} has {len(data)} bytes", None, "export with fewer frames in a shard")
        return [data]

    with open(path, "wb") as file:
        write_members(file, ((name, content(name)) for name in names))
    return path.stat().st_size
