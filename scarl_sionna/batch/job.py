"""The work on one shard, in whatever process.

Simulate what is missing, compress and keep it meanwhile, put it in place.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from time import perf_counter, thread_time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

from scarl_sionna.core.errors import ExportError, OutputError, ScarlError
from scarl_sionna.core.results import Frame
from scarl_sionna.dataset.encoding import StoreOptions, encode_frame
from scarl_sionna.dataset.store.manifest import ScenePlan, differences, hash_of
from scarl_sionna.dataset.store.remote import fetch_shard, send_shard
from scarl_sionna.dataset.store.shard_writer import ShardWriter
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, observe

from .noted import LOG, logged_warnings
from .stop import check

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

OnError = Literal["record", "raise"]
OnEvent = Callable[[str, dict[str, Any]], None]
"""Called with ``"stage"`` (scene, frame, stage, part of the frame) and ``"frame"`` (scene, frame, seconds, bytes or
failed)."""

_AHEAD = 2  # frames that wait to be compressed: more would only take memory


@dataclass(frozen=True)
class ShardJob:
    """One shard to make; plain data that can be sent to another process.

    `target`: address of the object store that it goes to when it is finished; `is_begun_there`: some frames are there.
    `run` tells the export that asks for it from others: what a plan file says is compared with the files in each.
    """

    root: str
    scenario: ScenarioSpec
    rig: Rig
    scene: ScenePlan
    shard: int
    options: StoreOptions
    configuration: str
    on_error: OnError = "raise"
    is_planned_before: bool = False
    target: str | None = None
    is_begun_there: bool = False
    run: str = ""

    @property
    def name(self) -> str:
        """Scene and number."""
        return f"{self.scene.name}/{self.shard:06d}"


@dataclass(frozen=True)
class ShardReport:
    """What became of a shard.

    Attributes
    ----------
    scene : str
    shard : int
    num_made, num_kept : int
        Frames made now, and kept from before.
    failed : mapping of int to str
        Frames that could not be made, with the reason.
    num_bytes : int
        Size of the shard [bytes].
    seconds : mapping of str to float
        By stage: those of the sensors, ``scene`` (loading), ``encoding`` (CPU time of the threads that compress),
        ``keeping`` (writing the finished frames), ``waiting`` (simulation held up by the two), ``putting in place``.
    warnings, log : tuple of str
        Of a worker: warnings for this process to show, and lines for the export's log.
    """

    scene: str
    shard: int
    num_made: int
    num_kept: int
    failed: dict[int, str]
    num_bytes: int
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    log: tuple[str, ...] = ()


def ignore(kind: str, data: dict[str, Any]) -> None:
    """Report nothing."""


def make_shard(job: ShardJob, on_event: OnEvent = ignore) -> ShardReport:
    """Make what is missing of a shard.

    Raises
    ------
    ExportError
        If a frame fails and `job.on_error` is ``"raise"``; the frames before it are kept.
    OutputError
        If the disk does not take it, or another process works on the shard.
    ExportStopped
        If a signal asked for it; the frame in work is dropped, those before it are kept.
    """
    seconds: dict[str, float] = {}
    rig, scenario = job.rig, job.scenario
    if job.target is not None and job.is_begun_there:
        fetch_shard(job.target, Path(job.root), job.scene, job.shard)
    with ShardWriter(job.root, job.scene, job.shard, job.options, job.configuration) as shard:
        missing = shard.missing
        kept = len(shard.frames) - len(missing)
        if missing:
            started = perf_counter()
            if job.is_planned_before:
                _check_plan(job)
            with logged_warnings(job.scene.name):
                world = _world(scenario, hash_of(dict(job.scene.configuration)))
            _add(seconds, "scene", perf_counter() - started)
        with FrameSink(shard, job.options, on_event, seconds) as sink:
            for index in missing:
                try:
                    with logged_warnings(f"frame {index} of {job.scene.name}"):
                        frame = observe(
                            world,
                            rig,
                            scenario.start_time + index / scenario.frame_rate,
                            scenario.seed,
                            index=index,
                            on_stage=_stages(job.scene.name, index, on_event),
                        )
                except Exception as error:
                    check(error)
                    _fail(job, shard, index, error, on_event)
                else:
                    check()  # an exception that the engine swallowed may have left its mark on the frame
                    for stage, taken in frame.timings.items():
                        _add(seconds, stage, taken)
                    sink.put(frame)
        for index, cause in sink.failed:
            _fail(job, shard, index, cause, on_event)
        started = perf_counter()
        record = shard.commit()
        if job.target is not None:
            send_shard(job.target, Path(job.root), job.scene, job.shard, record)
        _add(seconds, "putting in place", perf_counter() - started)
    failed = dict(record.failed)
    return ShardReport(job.scene.name, job.shard, len(missing) - len(failed), kept, failed, record.num_bytes, seconds)


class FrameSink:
    """Compresses and keeps frames in threads of its own while the next one is simulated; use it as a context.

    Leaving it waits until all frames are kept. A frame that the schema does not take is listed in `failed`; a disk that
    does not take it raises :class:`OutputError`.
    """

    def __init__(
        self,
        shard: ShardWriter,
        options: StoreOptions,
        on_event: OnEvent = ignore,
        seconds: dict[str, float] | None = None,
    ) -> None:
        self._shard, self._options, self._on_event = shard, options, on_event
        self._seconds: dict[str, float] = {} if seconds is None else seconds
        self._writer = ThreadPoolExecutor(1, "scarl-writer")
        self._pool = TimedPool(2)
        self._pending: deque[Future[None]] = deque()
        self._last = perf_counter()
        self.failed: list[tuple[int, Exception]] = []

    def __enter__(self) -> FrameSink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._wait(0)
        except OutputError:
            if error is None:
                raise
        finally:
            self._writer.shutdown()
            self._pool.shutdown()
            _add(self._seconds, "encoding", self._pool.cpu_seconds)

    def put(self, frame: Frame) -> None:
        """Hand a frame over; waits while two are on their way."""
        self._wait(_AHEAD - 1)
        self._pending.append(self._writer.submit(self._keep, frame))

    def _wait(self, most: int) -> None:
        started = perf_counter()
        while len(self._pending) > most:
            self._pending.popleft().result()
        _add(self._seconds, "waiting", perf_counter() - started)

    def _keep(self, frame: Frame) -> None:
        try:
            encoded = encode_frame(frame, self._options, self._pool)
        except Exception as error:
            self.failed.append((frame.index, error))
            return
        started = perf_counter()
        self._shard.add(encoded)
        _add(self._seconds, "keeping", perf_counter() - started)
        now = perf_counter()
        self._on_event(
            "frame",
            {
                "scene": self._shard.scene.name,
                "frame": frame.index,
                "seconds": now - self._last,
                "bytes": encoded.num_bytes,
            },
        )
        self._last = now


P = ParamSpec("P")
T = TypeVar("T")


class TimedPool(ThreadPoolExecutor):
    """Threads that add up the CPU time of their work."""

    def __init__(self, num_threads: int) -> None:
        super().__init__(num_threads, "scarl-encoder")
        self._taken: deque[float] = deque()

    @property
    def cpu_seconds(self) -> float:
        """CPU time of all work that is done [s]."""
        return sum(self._taken)

    def submit(self, function: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run a function in a thread."""

        def timed() -> T:
            started = thread_time()
            try:
                return function(*args, **kwargs)
            finally:
                self._taken.append(thread_time() - started)

        return super().submit(timed)


@lru_cache(maxsize=2)
def _world(scenario: ScenarioSpec, content: str) -> World:
    """Return the loaded scene; kept, for the next shard of this process is likely to be of the same scene.

    `content`: hash of what the plan says of it, which has the checksums of all its files: an edited one is read anew.
    What earlier scenes left goes back to the system first, so that a process that makes many drives stays as large as
    after the first few.
    """
    from scarl_sionna.engine.memory import release_memory

    release_memory()
    return load_world(scenario)


def _check_plan(job: ShardJob) -> None:
    """Raise if the files of a scenario are no longer those of the plan that the export took from a file."""
    now = ScenePlan(job.scene.name, 1, _configuration(job.scenario, job.run)).configuration
    there = {name: value for name, value in job.scene.configuration.items() if name != "settings_files"}
    found = differences(there, dict(now))
    if found:
        raise ExportError(
            f"{job.scene.name} is not what the plan file says ({'; '.join(found[:3])}): files have changed since; "
            "remove the plan file, and export into another folder"
        )


@lru_cache(maxsize=2)
def _configuration(scenario: ScenarioSpec, run: str) -> dict[str, Any]:
    from .plan import scene_configuration

    return scene_configuration(scenario)


def forget_worlds() -> None:
    """Forget loaded scenes: one that a signal caught in motion is in no state to go on from."""
    _world.cache_clear()


def _fail(job: ShardJob, shard: ShardWriter, index: int, error: Exception, on_event: OnEvent) -> None:
    reason = f"{type(error).__name__}: {error}"
    if job.on_error == "raise":
        if isinstance(error, ScarlError):
            raise error
        raise ExportError(
            f"frame {index} of {job.scene.name} failed ({reason}); the frames before it are kept, "
            "and --on-error record goes on "
            "without it"
        ) from error
    LOG.warning("frame %d of %s failed: %s", index, job.scene.name, reason, exc_info=error)
    shard.fail(index, reason)
    on_event("frame", {"scene": job.scene.name, "frame": index, "failed": reason, "bytes": 0, "seconds": 0.0})


def _stages(scene: str, index: int, on_event: OnEvent) -> Callable[[str, float], None]:
    return lambda stage, part: on_event("stage", {"scene": scene, "frame": index, "stage": stage, "part": part})


def _add(seconds: dict[str, float], stage: str, taken: float) -> None:
    seconds[stage] = seconds.get(stage, 0.0) + taken


def output_root(root: str | Path) -> str:
    """Return a path that means the same in another process."""
    return str(Path(root).resolve())
