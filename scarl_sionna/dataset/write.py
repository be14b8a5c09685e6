"""Writes frames that are at hand as a dataset, without an export."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol

from scarl_sionna.core.results import Frame

from .encoding import StoreOptions, encode_frame
from .store.manifest import DatasetPlan, ScenePlan
from .store.writer import DatasetFolder


class _Rig(Protocol):
    """A rig, which stands beside this package."""

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""


def write_dataset(
    root: str | Path,
    rig: Mapping[str, Any] | _Rig,
    scenes: Mapping[str, Iterable[Frame]],
    *,
    options: StoreOptions | None = None,
    configuration: Mapping[str, Any] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write frames that are at hand as a dataset.

    Parameters
    ----------
    root : path
    rig : Rig, or mapping of `Rig.to_dict()`
        It made all frames.
    scenes : mapping of str to iterable of Frame
        Frames by scene; their indices begin at 0 and have no gaps.
    options : StoreOptions, optional
    configuration : mapping, optional
        Plain data on how the frames were made, the same for all scenes.
    overwrite : bool
        Remove the dataset that is there first; files that are not its own stay.

    Raises
    ------
    OutputError
        If the folder cannot be written, holds other data, or a frame has something that the schema does not know.
    """
    frames = {name: list(items) for name, items in scenes.items()}
    plans = tuple(ScenePlan(name, len(items), configuration or {}) for name, items in frames.items())
    plan = DatasetPlan(rig if isinstance(rig, Mapping) else rig.to_dict(), plans, options or StoreOptions())
    with DatasetFolder(root, plan, overwrite=overwrite) as folder, ThreadPoolExecutor(2) as pool:
        options = folder.plan.options
        for name, items in frames.items():
            shards = defaultdict(list)
            for frame in items:
                shards[frame.index // options.shard_frames].append(frame)
            for number, group in shards.items():
                with folder.shard(name, number) as shard:
                    for frame in group:
                        if frame.index in shard.missing:
                            shard.add(encode_frame(frame, options, pool))
                    shard.commit()
        folder.finalize()
    return Path(root)
