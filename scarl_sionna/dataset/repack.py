"""A dataset in the other layout: two files a shard, or a file for each image and array; every byte of them the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from scarl_sionna.core.errors import DatasetError

from .formats.source import OnProgress, no_progress
from .readers.reader import open_dataset
from .store.writer import DatasetFolder


def repack_dataset(
    place: str | Path, out: str | Path, layout: Literal["packed", "files"], *, on_progress: OnProgress = no_progress
) -> Path:
    """Write a dataset in another layout, as an export with this layout would have made it.

    What is finished is copied, each file held to its checksum; the same call goes on where it was stopped.

    Parameters
    ----------
    place : path or str
        Of the dataset; also an fsspec URL, or archives.
    out : path
        Folder of the new dataset.
    layout : {"packed", "files"}
        See `StoreOptions`.
    on_progress : callable
        Called with the number of shards and of all of them.

    Raises
    ------
    DatasetError
        If there is no dataset, it has this layout already, or a file is not what was written.
    OutputError
        If the folder cannot be written, is in use, or holds something else.
    """
    dataset = open_dataset(place)
    if dataset.plan.options.layout == layout:
        raise DatasetError(f"has the layout '{layout}' already", place, "copy it as it is")
    plan = replace(dataset.plan, options=replace(dataset.plan.options, layout=layout))
    shards = [(scene, shard) for scene in plan.scenes for shard in range(scene.num_shards(plan.options))]
    with DatasetFolder(out, plan) as folder:
        for done, (scene, shard) in enumerate(shards, 1):
            if not folder.is_finished(scene.name, shard):
                found = dataset.scene(scene.name).members(shard)
                if found is not None:
                    with folder.shard(scene.name, shard) as writer:
                        writer.copy(*found)
            on_progress(done, len(shards))
        folder.finalize()
    return Path(out)
