"""The export: from scenarios to a verified dataset folder."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any
from uuid import uuid4

from scarl_sionna.core.errors import OutputError, ParameterRangeError, ScarlError
from scarl_sionna.core.temporary import clear_stale
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.dataset.store.layout import LOG_FILE
from scarl_sionna.dataset.store.remote import RemoteFolder, check_workers, is_address
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

from .job import OnError, OnEvent, ShardJob, ShardReport, forget_worlds, ignore, make_shard, output_root
from .noted import LOG, noted_warnings
from .plan import ExportPlan, plan_export, shards_of_part
from .report import ExportReport
from .stop import stoppable


@dataclass(frozen=True)
class ExportSettings:
    """Where and how an export runs; only `options`, `licence` and `description` show in the dataset.

    Attributes
    ----------
    workers : int
        Processes on this machine; 0: in this process.
    scheduler : str, optional
        Address of a Dask scheduler whose workers see the folder under the same path.
    part : (int, int), optional
        (i, n): only every n-th shard, beginning with the i-th; several such runs may work on one folder.
    on_error : {"raise", "record"}
        What a failing frame does: stop the export, or be recorded and tried again on the next call.
    options : StoreOptions
    overwrite : bool
        Remove the dataset that is there first; files that are not its own stay.
    licence, description : str
        For the dataset card.
    plan_file : path, optional
        Plan that jobs of an array share: read if it is there, else computed once and written. Each job compares what it
        makes with the files as they are then.
    scratch : path, optional
        Folder of this machine for what is not finished of a dataset in an object store (default: one of the user's
        cache for each address).
    """

    workers: int = 0
    scheduler: str | None = None
    part: tuple[int, int] | None = None
    on_error: OnError = "raise"
    options: StoreOptions = field(default_factory=StoreOptions)
    overwrite: bool = False
    licence: str = "not stated"
    description: str = ""
    plan_file: str | Path | None = None
    scratch: str | Path | None = None

    def __post_init__(self) -> None:
        if self.workers < 0:
            raise ParameterRangeError("workers", self.workers, ">= 0")
        if sum((self.workers > 0, self.scheduler is not None, self.part is not None)) > 1:
            raise ParameterRangeError("workers, scheduler, part", "more than one of them", "one of them")
        if self.overwrite and self.part is not None:
            raise ParameterRangeError(
                "overwrite", "with a part of the shards", "a run of the whole", "remove the folder first"
            )


def export(
    scenarios: Iterable[ScenarioSpec],
    out: str | Path,
    settings: ExportSettings | None = None,
    *,
    on_event: OnEvent = ignore,
) -> ExportReport:
    """Make a dataset of scenarios, or what is missing of it.

    The bytes do not depend on `workers`, `scheduler`, `part`, on the order of the scenarios, or on how often the export
    was stopped.

    Parameters
    ----------
    scenarios : iterable of ScenarioSpec
        Their `scene_name` differ; all have the same rig.
    out : path or str
        Folder, or address in an object store: ``s3://bucket/data``, ``gs://bucket/data``.
    settings : ExportSettings, optional
        Default: one process, this one.
    on_event : callable
        Called with ``"plan"`` (frames, done), ``"stage"``, ``"frame"`` and ``"shard"`` and their data.

    Returns
    -------
    ExportReport

    Raises
    ------
    OutputError
        If the folder cannot be written, is in use, or holds frames of another configuration.
    ExportError
        If a frame fails (`on_error` "raise"), a worker dies again and again, or the scheduler is not there.
    ScarlError
        Of a scenario that is not possible, before anything is made.
    ExportStopped
        A `KeyboardInterrupt`: Ctrl-C or SIGTERM came; finished frames are kept, the one in work is dropped.
    """
    with stoppable():
        return _export(scenarios, out, settings or ExportSettings(), on_event)


def _export(
    scenarios: Iterable[ScenarioSpec], out: str | Path, settings: ExportSettings, on_event: OnEvent
) -> ExportReport:
    started = perf_counter()
    clear_stale()  # here, too: an export that finds all of it finished, or its scene loaded, makes no folder of its own
    planning: list[str] = []
    with ExitStack() as stack:
        with noted_warnings(planning.append):
            plan = plan_export(scenarios, settings.options, settings.licence, settings.description, settings.plan_file)
            part = None if settings.part is None else f"{settings.part[0]}_of_{settings.part[1]}"
            folder = stack.enter_context(dataset_folder(out, plan, settings, part))
        stack.enter_context(_log_file(folder.root))
        for text in planning:
            LOG.warning("planning: warning: %s", text)
        jobs, report = _jobs(plan, folder, settings)
        on_event("plan", {"frames": report.num_frames, "done": report.num_kept, "shards": len(jobs)})
        LOG.info("%d frames, %d there, %d shards to make", report.num_frames, report.num_kept, len(jobs))
        try:
            for shard in run_jobs(jobs, settings, on_event):
                report.add(shard)
                on_event("shard", {"scene": shard.scene, "shard": shard.shard, "bytes": shard.num_bytes})
                LOG.info(
                    "%s shard %d: %d made, %d kept, %d failed",
                    shard.scene,
                    shard.shard,
                    shard.num_made,
                    shard.num_kept,
                    len(shard.failed),
                )
        except BaseException as error:
            LOG.error("stopped: %s: %s", type(error).__name__, error)
            if isinstance(error, KeyboardInterrupt):
                forget_worlds()
            with suppress(ScarlError, OSError):
                folder.finalize()
            raise
        folder.finalize()
        report.wall_seconds = perf_counter() - started
        LOG.info("%s", report)
    return report


def dataset_folder(
    out: str | Path, plan: ExportPlan, settings: ExportSettings, part: str | None = None
) -> DatasetFolder:
    """Return the folder or place of a dataset, not entered yet."""
    if not is_address(out):
        return DatasetFolder(out, plan.dataset, overwrite=settings.overwrite, part=part)
    if settings.workers or settings.scheduler is not None:
        check_workers(str(out))
    return RemoteFolder(str(out), plan.dataset, overwrite=settings.overwrite, part=part, scratch=settings.scratch)


def run_jobs(jobs: list[ShardJob], settings: ExportSettings, on_event: OnEvent) -> Iterator[ShardReport]:
    """Yield the report of each shard as it is finished."""
    if not jobs:
        return
    if settings.workers == 0 and settings.scheduler is None:
        for job in jobs:
            yield make_shard(job, on_event)
        return
    from .cluster import run_on_cluster

    yield from run_on_cluster(jobs, settings.workers, settings.scheduler, on_event)


def _jobs(plan: ExportPlan, folder: DatasetFolder, settings: ExportSettings) -> tuple[list[ShardJob], ExportReport]:
    """Return the shards that are not finished, and a report that counts those that are."""
    keys = [
        (name, shard)
        for name, scenario in sorted(plan.scenarios.items())
        for shard in range(-(-scenario.num_frames // folder.plan.options.shard_frames))
    ]
    target = folder.target.url if isinstance(folder, RemoteFolder) else None
    report = ExportReport(folder.given, 0, address=target or "")
    jobs, run = [], uuid4().hex
    root = output_root(folder.root)
    for name, shard in shards_of_part(keys, settings.part):
        scene = folder.plan.scene(name)
        frames = scene.shard_range(shard, folder.plan.options)
        report.num_frames += len(frames)
        if folder.is_finished(name, shard):
            report.num_kept += len(frames)
            report.num_bytes += folder.rows[name][shard][3]  # type: ignore[index]
        else:
            jobs.append(
                ShardJob(
                    root,
                    plan.scenarios[name],
                    plan.rig,
                    scene,
                    shard,
                    folder.plan.options,
                    folder.plan.scene_hash(name),
                    settings.on_error,
                    settings.plan_file is not None,
                    target,
                    folder.rows[name][shard] is not None,
                    run,
                )
            )
    return jobs, report


@contextmanager
def _log_file(root: Path) -> Iterator[None]:
    """Let the export's messages also go to a file in the dataset's folder."""
    try:
        handler: logging.Handler = logging.FileHandler(root / LOG_FILE, encoding="utf-8", delay=False)
    except OSError as error:
        raise OutputError(
            f"cannot write {root / LOG_FILE}: {error.strerror}; choose a folder that you may write to"
        ) from error
    handler.setFormatter(logging.Formatter(f"%(asctime)s {os.getpid()} %(levelname)s %(message)s"))
    handler.handleError = lambda record: None  # type: ignore[method-assign]  # a full disk stops the export, not its log
    level = LOG.level
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.removeHandler(handler)
        LOG.setLevel(level)
        with suppress(OSError):
            handler.close()


def describe(settings: ExportSettings) -> dict[str, Any]:
    """Return where an export runs, in words."""
    if settings.scheduler:
        return {"where": f"Dask workers of {settings.scheduler}"}
    return {"where": f"{settings.workers} processes" if settings.workers else "this process"}
