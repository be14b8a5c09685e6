"""Shards on several processes: workers of this machine, or those of any Dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import signal
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from scarl_sionna.core.cores import usable_cores
from scarl_sionna.core.errors import ExportError, OutputError, ScarlError, ScarlWarning
from scarl_sionna.core.packages import require
from scarl_sionna.dataset.store.manifest import MANIFEST

from .job import OnEvent, ShardJob, ShardReport, make_shard
from .noted import LOG, log_lines

if TYPE_CHECKING:
    from distributed import Client, Worker

TOPIC = "scarl-export"
CONNECT_SECONDS = 10.0
RESTART_SECONDS = 300.0
"""How long no worker of this machine may be there before the export gives up [s]; on a busy one a start takes 60."""
_AHEAD, _LEAST_AHEAD = 3, 256  # shards that are handed out at once: for each worker, and in all
_KEPT = "finished frames are kept; the same command goes on from there"


def run_on_cluster(
    jobs: list[ShardJob], workers: int, scheduler: str | None, on_event: OnEvent
) -> Iterator[ShardReport]:
    """Yield the report of each shard as it is finished.

    Parameters
    ----------
    jobs : list of ShardJob
    workers : int
        Processes to start on this machine, one thread each, if there is no `scheduler`. They share its cores.
    scheduler : str, optional
        Address of a Dask scheduler.
    on_event : callable
        Called for each frame.

    Warns
    -----
    ScarlWarning
        If there are fewer shards than `workers`, or the scheduler has no worker yet; and what the workers warn of.

    Raises
    ------
    ExportError
        If the scheduler is not there or goes away, or a worker dies on the same shard again and again.
    ScarlError
        Of the shard that failed.
    """
    distributed = require("distributed", "dask")
    with ExitStack() as stack:
        if scheduler is None:
            count = min(workers, len(jobs))
            if count < workers:
                warnings.warn(_idle_text(jobs, workers), ScarlWarning, stacklevel=2)
            client = stack.enter_context(_local_client(distributed, count))
            threads: int | None = max(usable_cores() // count, 1)
        else:
            client = stack.enter_context(_remote_client(distributed, scheduler))
            threads = None
            if not client.ncores():
                text = f"the Dask scheduler at {scheduler} has no worker yet; the export waits until one comes"
                warnings.warn(text, ScarlWarning, stacklevel=2)
        client.subscribe_topic(TOPIC, lambda event: on_event("frame", event[1]))
        yield from _reports(distributed, client, jobs, threads)


def _idle_text(jobs: list[ShardJob], workers: int) -> str:
    """Return what is said of workers that have nothing to do."""
    text = f"only {len(jobs)} of {workers} workers can work at once: shards to make: {len(jobs)}"
    if sum(len(job.scene.shard_range(job.shard, job.options)) for job in jobs) < workers:
        return f"{text}; fewer workers (--workers {len(jobs)}) do the same"
    return (
        f"{text}; a dataset of fewer frames a shard (--shard-frames, now {jobs[0].options.shard_frames}) gives all some"
    )


def _reports(
    distributed: ModuleType, client: Client, jobs: list[ShardJob], threads: int | None
) -> Iterator[ShardReport]:
    waiting = list(reversed(jobs))

    def hand_out(running: int) -> list[Any]:
        """Submit shards until enough of them are on their way: not all, for a job carries its whole specification."""
        most = max(_AHEAD * len(client.ncores()), _LEAST_AHEAD)
        chosen = [waiting.pop() for _ in range(min(most - running, len(waiting)))]
        return [client.submit(work, job, threads, key=f"shard-{job.name}-{id(client)}", pure=False) for job in chosen]

    running = distributed.as_completed(hand_out(0))
    try:
        for future in running:
            report: ShardReport = future.result()
            for line in report.log:
                LOG.warning("%s", line)
            for text in report.warnings:
                warnings.warn(text, ScarlWarning, stacklevel=2)
            yield report
            for new in hand_out(running.count()):
                running.add(new)
    except ScarlError:
        raise
    except distributed.KilledWorker as error:
        raise ExportError(
            f"workers died again and again on {error.args[0] if error.args else 'a shard'} (memory?); {_KEPT}"
        ) from error
    except _no_worker_errors(distributed) as error:
        raise ExportError(
            f"all workers died and none could be started again within {RESTART_SECONDS:g} s (memory?); {_KEPT}"
        ) from error
    except (
        asyncio.CancelledError,
        distributed.client.FutureCancelledError,
        OSError,
        distributed.comm.CommClosedError,
    ) as error:
        raise ExportError(f"the Dask scheduler was lost ({type(error).__name__}); {_KEPT}") from error


def _no_worker_errors(distributed: ModuleType) -> tuple[type[Exception], ...]:
    """Return the errors of a shard that found no worker; older versions of Dask have one of them."""
    names = ("NoWorkerError", "NoValidWorkerError")
    return tuple(getattr(distributed.scheduler, name) for name in names if hasattr(distributed.scheduler, name))


def work(job: ShardJob, threads: int | None) -> ShardReport:
    """Make a shard in a worker and tell the client of each frame."""
    from scarl_sionna.engine.memory import keep_freed_memory
    from scarl_sionna.engine.threads import limit_threads

    keep_freed_memory()
    if job.target is None and not (Path(job.root) / MANIFEST).exists():
        raise OutputError(
            f"this worker does not see the dataset {job.root}; give --out on a file system that all workers mount"
        )
    if threads is not None:
        limit_threads(threads)
    worker = require("distributed", "dask").get_worker()

    def tell(kind: str, data: dict[str, Any]) -> None:
        if kind == "frame":
            worker.log_event(TOPIC, data)

    try:
        with warnings.catch_warnings(record=True) as caught, log_lines() as lines:
            warnings.simplefilter("always", ScarlWarning)
            report = make_shard(job, tell)
    except ScarlError as error:
        raise portable(error) from None
    texts = (str(item.message) for item in caught if issubclass(item.category, ScarlWarning))
    return replace(report, warnings=tuple(texts), log=tuple(lines))


def portable(error: ScarlError) -> ScarlError:
    """Return an error that can be sent to another process: itself, or its text where it is made of more than that."""
    if isinstance(error, OutputError | ExportError):
        return error
    return ExportError(f"{type(error).__name__}: {error}")


def dask_setup(worker: Worker) -> None:
    """Let a worker of this machine ignore Ctrl-C, which a terminal sends to all processes.

    The process that started it stops it.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _mute()


def _mute() -> dict[logging.Logger, list[logging.Handler]]:
    """Take the handlers from Dask's logs and return them."""
    loggers = [logger for logger in logging.root.manager.loggerDict.values() if isinstance(logger, logging.Logger)]
    names = ("distributed", "tornado", "asyncio")
    before = {logger: logger.handlers[:] for logger in loggers if logger.name.split(".")[0] in names}
    for logger in before:
        logger.handlers[:] = [logging.NullHandler()]
    return before


@contextmanager
def _muted() -> Iterator[None]:
    """Keep Dask's own log in this process to itself.

    When it is stopped in the middle of its work, or loses its scheduler, it writes tracebacks of its connections, some
    of them at the highest level; what concerns the export comes as an exception.
    """
    before = _mute()
    try:
        yield
    finally:
        for logger, handlers in before.items():
            logger.handlers[:] = handlers


@contextmanager
def _local_client(distributed: ModuleType, count: int) -> Iterator[Client]:
    """Start worker processes on this machine."""
    import dask

    settings = {
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.worker.preload": [__name__],  # calls `dask_setup`
        "distributed.comm.timeouts.connect": "30s",
        # Dask gives a worker up for good that is not back after 15 s, and waits for ever when all are given up
        "distributed.deploy.lost-worker-timeout": "1h",
        "distributed.scheduler.no-workers-timeout": f"{RESTART_SECONDS:g}s",
        "distributed.worker.profile.enabled": False,  # a hundred looks a second at the stacks of all threads
        # what Dask does while it waits for shards, which take minutes; docs/performance.md, export
        "distributed.admin.tick.interval": "1s",
        "distributed.admin.tick.limit": "60s",
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.scheduler.work-stealing-interval": "2s",
    }
    with dask.config.set(settings), _muted(), ExitStack() as opened:
        try:
            cluster = opened.enter_context(
                distributed.LocalCluster(
                    n_workers=count,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=None,
                    dashboard_address=None,
                    silence_logs=logging.CRITICAL,  # of the workers until `dask_setup` mutes them
                )
            )
            client = opened.enter_context(distributed.Client(cluster))
        except RuntimeError as error:  # a process that is killed while it starts is not started again
            raise ExportError(
                f"the {count} worker processes of this machine did not start ({error}): one was killed, or memory is "
                "short; call the export again, it goes on where it was, or take fewer workers"
            ) from error
        yield client


@contextmanager
def _remote_client(distributed: ModuleType, address: str) -> Iterator[Client]:
    """Connect to a scheduler; it and its workers stay when the export is done."""
    with _muted():
        try:
            client = distributed.Client(address, timeout=CONNECT_SECONDS)
        except (OSError, TimeoutError, asyncio.TimeoutError, ValueError) as error:
            raise ExportError(
                f"no Dask scheduler answers at {address} within {CONNECT_SECONDS:g} s ({type(error).__name__}); "
                "start one with `dask scheduler`, or check the address"
            ) from error
        with client:
            yield client
