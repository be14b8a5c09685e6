"""Removes what is damaged in a dataset, so that the next export makes it again; nothing that is not its own."""

from __future__ import annotations

import os
from pathlib import Path

from scarl_sionna.core.errors import DatasetError, OutputError

from .findings import STRAY, UNFINISHED_STRAY, Verification
from .readers.reader import Dataset
from .store.files import LocalFiles, output_error
from .store.layout import MARKED, METADATA, Layout, files_under, is_temporary, prune, remove_file
from .store.manifest import ARRAYS
from .store.records import ShardRecord, bundle_name, metadata_texts, record_name, shard_rows
from .store.remote import RemoteFolder
from .store.writer import DatasetFolder


def repair_store(dataset: Dataset, found: Verification) -> None:
    """Remove damaged shards of a dataset in an object store, and what of its own belongs to nothing."""
    if not (found.faults or found.unfinished):
        return
    folder = RemoteFolder(dataset.place, dataset.plan, repair=True)
    with folder:
        layout = Layout(folder.plan)
        for scene, shard in sorted({(f.scene, f.shard) for f in found.faults if f.scene is not None}):
            if shard is not None:
                folder.target.remove(record_name(scene, shard))
                folder.target.remove(bundle_name(scene, shard))
                found.removed.append((scene, shard))
        for fault in [*found.faults, *found.unfinished]:
            if fault.what in (STRAY, UNFINISHED_STRAY) and layout.owns(fault.name):
                folder.target.remove(fault.name)
        folder.finalize(afresh=True)


def repair_folder(root: Path, dataset: Dataset, found: Verification) -> None:
    """Remove damaged shards and what of the dataset's own belongs to nothing, and write the rest anew."""
    damaged = {
        (fault.scene, fault.shard) for fault in found.faults if fault.scene is not None and fault.shard is not None
    }
    strays = [
        fault.name
        for fault in [*found.faults, *found.unfinished]
        if fault.what in (STRAY, UNFINISHED_STRAY) or is_temporary(fault.name)
    ]
    with DatasetFolder(root, dataset.plan, repair=True) as folder:
        layout, removed = Layout(folder.plan), list[str]()
        try:
            for scene, shard in sorted(damaged):
                place = root / record_name(scene, shard)
                try:
                    named = list(ShardRecord.load(place).on_disk)
                except (OSError, DatasetError):
                    named = []
                files = [name for name in named if layout.owns(name) and layout.shard_of(name) == (scene, shard)]
                _remove(root, record_name(scene, shard), found)  # first: without its record the shard is not there
                removed += files
                for name in files:
                    _remove(root, name, found)
                found.removed.append((scene, shard))
            strays += [
                name for scene in {scene for scene, _ in damaged} for name in _metadata_of_nothing(folder, scene)
            ]
            for name in strays:
                _remove(root, name, found)
            prune(root, [*strays, *removed])
            for name in MARKED:
                if (root / name).is_dir():
                    remove_file(root / name)  # if nothing is in it
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise output_error(root, error) from error
        folder.finalize(afresh=True)


def _metadata_of_nothing(folder: DatasetFolder, scene: str) -> list[str]:
    """Return the metadata of a scene's arrays that none of its shards has."""
    plan = folder.plan.scene(scene)
    known = metadata_texts(plan, shard_rows(LocalFiles(folder.root), plan, folder.plan.options)[1], folder.plan.options)
    layout = Layout(folder.plan)
    names = [name for name, is_folder in files_under(folder.root, [f"{ARRAYS}/{scene}"]) if not is_folder]
    return [name for name in names if name.endswith(f"/{METADATA}") and name not in known and layout.owns(name)]


def _remove(root: Path, name: str, found: Verification) -> None:
    """Remove a file of the dataset; a link is removed itself, and nothing that is reached by one."""
    path = root / name
    if os.path.realpath(path.parent) != os.path.join(os.path.realpath(root), os.path.dirname(name)).rstrip("/"):
        return
    if not remove_file(path):
        found.foreign.append(f"{name}/ (a folder where a file belongs)")
