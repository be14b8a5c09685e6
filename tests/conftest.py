"""Options and environment of the whole test suite."""

from __future__ import annotations

import gc
import os
import signal
import sys
from typing import Any, ClassVar

os.environ["MPLBACKEND"] = "Agg"  # no test opens a window
os.environ.setdefault(
    "OPENBLAS_NUM_THREADS", "1"
)  # workers share the cores: BLAS threads that wait for each other burn them

if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as a shell starts what is to run in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)  # commands that tests start inherit that it counts

import pytest
from hypothesis import settings

from scarl_sionna.engine.memory import forget_peak, release_memory, resident_bytes, share_heaps
from tests import own_process
from tests.helper_process import HelperProcess

share_heaps()  # a worker would come to hold 1.4 GB of freed memory at the ends of its threads' heaps
gc.disable()  # until all tests are collected: nothing of them goes before the end, and looking for it takes seconds

# no deadline: an example takes longer on a machine with other work; in CI the same examples in every run, so that a
# failure is the change's own
settings.register_profile("here", deadline=None)
settings.register_profile("ci", derandomize=True, deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "here")

GOAL_MEMORY, MOST_MEMORY = 1.5e9, 2e9
"""Bytes that a process of the tests should take at most, and those above which a session fails. A world that a module
keeps too long, or a cache without a bound, shows here first."""
MUCH_MEMORY, MORE_MEMORY = 0.6e9, 0.1e9
"""A process with more than the first gives back what it no longer uses whenever it has grown by the second; the engine
takes 0.3 GB, TensorFlow 0.5 GB more."""
FULL_MEMORY = 1.2e9
"""A process that holds more than this after giving back lets another one run the tests of further files: what compiled
kernels, modules and a scattered heap take grows with the number of files."""
PEAKS = pytest.StashKey[dict[str, int]]()
"""Peak of each file's tests [bytes]."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-slow", action="store_true", help="also run the tests that are marked slow")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[PEAKS] = {}
    _Memory.peaks.clear()  # what ran before in this process is another run
    _Memory.file = ""
    if config.pluginmanager.hasplugin("xdist"):
        config.pluginmanager.register(_Workers(config.stash[PEAKS]))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    run_slow = config.getoption("--run-slow")
    skip = pytest.mark.skip(reason="slow: runs with --run-slow")
    for item in items:
        if "slow" in item.keywords and not run_slow:
            item.add_marker(skip)
    if not run_slow:
        _keep_some(items)
    own_process.send_away(items, ["--run-slow"] if run_slow else [])


@pytest.hookimpl(trylast=True)
def pytest_collection_finish(session: pytest.Session) -> None:
    """Keep the collector from what lives until the end, all modules and tests: each search took 0.4 s."""
    _Memory.session = session
    gc.collect()
    gc.freeze()
    gc.enable()


def _keep_some(items: list[pytest.Item]) -> None:
    """Skip all but a few cases of each test that is marked `some`: the first, the last, and evenly between."""
    cases: dict[tuple[object, ...], list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("some") and "slow" not in item.keywords:
            cases.setdefault(
                (item.path, getattr(item, "cls", None), getattr(item, "originalname", item.name)), []
            ).append(item)
    for alike in cases.values():
        count = int(next(alike[0].iter_markers("some")).args[0])
        kept = {round(k * (len(alike) - 1) / max(count - 1, 1)) for k in range(count)}
        for index in set(range(len(alike))) - kept:
            alike[index].add_marker(pytest.mark.skip(reason="one of many alike cases: runs with --run-slow"))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if own_process.RESULTS in os.environ:
        own_process.write_report(report)


def pytest_runtest_logstart(nodeid: str) -> None:
    """Before the first test of a file, when the fixtures of the last one are gone: give back what nobody uses."""
    file = nodeid.partition("::")[0]
    if file != _Memory.file:
        _note_peak()
        if resident_bytes()[0] > MUCH_MEMORY:
            job = sys.modules.get("scarl_sionna.batch.job")
            if job is not None:
                job._world.cache_clear()  # an export keeps two worlds for its next shard
            _give_back()
            if _Memory.after_release > FULL_MEMORY and _Memory.session is not None:
                own_process.send_to(_Memory.helper, *_rest_of(file, _Memory.session))
        forget_peak()
    _Memory.file = file


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """After the last test of a module: empty the caches of its helpers, which would keep their worlds."""
    module = getattr(item, "module", None)
    if module is not None and getattr(nextitem, "module", None) is not module:
        for helper in vars(module).values():
            if getattr(helper, "__module__", None) == module.__name__ and hasattr(helper, "cache_clear"):
                helper.cache_clear()


def pytest_runtest_logfinish() -> None:
    """After a test: the same, once there is more than the last time."""
    if resident_bytes()[0] > max(MUCH_MEMORY, _Memory.after_release + MORE_MEMORY):
        _give_back()


def _rest_of(file: str, session: pytest.Session) -> tuple[list[pytest.Item], list[str]]:
    """Return the tests of a file that no mark has sent away, and the options that their process needs."""
    items = [
        item for item in session.items if item.nodeid.partition("::")[0] == file and "own_process" not in item.keywords
    ]
    return items, ["--run-slow"] if session.config.getoption("--run-slow") else []


def _give_back() -> None:
    release_memory()
    _Memory.after_release = resident_bytes()[0]


def _note_peak() -> None:
    if _Memory.file:
        _Memory.peaks[_Memory.file] = max(resident_bytes()[1], _Memory.peaks.get(_Memory.file, 0))


class _Memory:
    """The session, the file whose tests run, memory held after the last giving back [bytes], the peaks, who helps."""

    session: ClassVar[pytest.Session | None] = None
    file = ""
    after_release = 0
    peaks: ClassVar[dict[str, int]] = {}
    helper: ClassVar[HelperProcess] = HelperProcess(FULL_MEMORY)


def merge(peaks: dict[str, int], others: dict[str, int]) -> None:
    """Keep the larger peak of each file: the process that only reports a worker's tests has one of its own."""
    peaks.update({name: max(peak, peaks.get(name, 0)) for name, peak in others.items()})


class _Workers:
    """Collects the peaks of the workers in the process that started them."""

    def __init__(self, peaks: dict[str, int]) -> None:
        self.peaks = peaks

    def pytest_testnodedown(self, node: Any) -> None:
        merge(self.peaks, getattr(node, "workeroutput", {}).get("peak_memory", {}))


def pytest_sessionfinish(session: pytest.Session) -> None:
    output = getattr(session.config, "workeroutput", None)
    _note_peak()
    mine = dict(_Memory.peaks)
    merge(mine, own_process.peaks)
    if own_process.RESULTS in os.environ:
        own_process.write_peak(max(mine.values(), default=0))
    if output is not None:  # a worker of xdist: the controller judges
        output["peak_memory"] = mine
        return
    peaks = session.config.stash[PEAKS]
    merge(peaks, {**mine, "this process": resident_bytes()[1]})
    if max(peaks.values()) > MOST_MEMORY and not session.config.getoption("--run-slow"):
        session.exitstatus = max(session.exitstatus, pytest.ExitCode.TESTS_FAILED)


def pytest_unconfigure(config: pytest.Config) -> None:
    """After the last line of the report: say that memory made the run fail, which no test does."""
    peaks = config.stash.get(PEAKS, {})
    if "workeroutput" in vars(config) or config.getoption("--run-slow"):
        return
    for name, peak in peaks.items():
        if peak > MOST_MEMORY:
            print(f"failed: {name} took {peak / 1e9:.2f} GB of memory, at most {MOST_MEMORY / 1e9:g} are allowed")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    peaks = sorted(config.stash[PEAKS].items(), key=lambda item: -item[1])
    if not peaks:
        return
    most = ", ".join(
        f"{peak / 1e9:.2f} GB {name}" for name, peak in peaks if peak in (peaks[0][1],) or peak > GOAL_MEMORY
    )
    terminalreporter.write_line(f"peak memory: {most}", red=peaks[0][1] > GOAL_MEMORY)
