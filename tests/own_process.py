"""Tests marked `own_process` run in a process of their own and are reported where they stand.

There is one for all of a file, or for all of a file whose marks have the same argument: `own_process("first")`. Those
marked `own_process(shared=True)` run in one process for one such file after another (`helper_process`), until it holds
much; each start would cost five seconds of CPU time. So do all tests of a file that starts when the worker itself
already holds much (`conftest.FULL_MEMORY`).

TensorFlow stays in a process for ever and takes 0.5 GB; with it and a detailed scene a worker would pass the goal of
1.5 GB.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.children import with_parent
from tests.helper_process import REPO, HelperProcess

RESULTS = "SCARL_TEST_RESULTS"
"""Environment variable of such a process: the file to which it writes a line for each finished part of a test."""

WITHOUT = [f"-pno:{name}" for name in ("cacheprovider", "hypothesispytest", "zarr", "xdist", "xdist.looponfail")]
"""Plugins that such a process starts without: a second of CPU time each time."""

SHARED_MEMORY = 0.8e9
"""A shared process that holds more than this [bytes] after a file ends; the engine alone takes 0.4 GB, and the next
file may need a whole frame beside."""

peaks: dict[str, int] = {}
"""Most memory of each such process that this one has started [bytes], by the file."""
_outcomes: dict[str, dict[str, tuple[str, str]]] = {}
_shared = HelperProcess(SHARED_MEMORY)


def send_away(items: list[pytest.Item], options: list[str]) -> None:
    """Let marked tests take their outcome from the other process, which starts with the first of a file."""
    marked = [item for item in items if "own_process" in item.keywords]
    _send([item for item in marked if not _is_shared(item)], options, _end_of_own)
    _send([item for item in marked if _is_shared(item)], options, _shared.run)


def send_to(helper: HelperProcess, items: list[pytest.Item], options: list[str]) -> None:
    """Let these tests take their outcome from a process that has run those of other files."""
    _send(items, options, helper.run)


Run = Callable[[list[str], dict[str, str], Path], str]
"""Runs pytest with arguments and variables of the environment and returns how it ended; what it prints is in a file."""


def _send(items: list[pytest.Item], options: list[str], run: Run) -> None:
    sent = [] if RESULTS in os.environ else [item for item in items if not any(item.iter_markers("skip"))]
    groups: dict[tuple[object, ...], list[str]] = {}
    for item in sent:
        groups.setdefault(_group(item), []).append(item.nodeid)
    for item in sent:
        together = groups[_group(item)]
        item.fixturenames = []  # type: ignore[attr-defined]  # a new list: other cases of the function share the old one
        item.runtest = partial(_take_outcome, item.nodeid, together, options, run)  # type: ignore[method-assign]


def _is_shared(item: pytest.Item) -> bool:
    return any(mark.kwargs.get("shared", False) for mark in item.iter_markers("own_process"))


def _group(item: pytest.Item) -> tuple[object, ...]:
    """Return what the tests of one process have in common."""
    return (item.path, *(argument for mark in item.iter_markers("own_process") for argument in mark.args))


def write_report(report: pytest.TestReport) -> None:
    """Write the outcome of a part of a test, in the process that runs it."""
    if report.when == "call" or report.outcome != "passed":
        text = str(report.longrepr[2]) if isinstance(report.longrepr, tuple) else report.longreprtext
        with open(os.environ[RESULTS], "a", encoding="utf-8") as file:
            file.write(json.dumps([report.nodeid, report.outcome, text]) + "\n")


def write_peak(peak: int) -> None:
    """Write the most memory that the process had [bytes], in the process that runs the tests."""
    with open(os.environ[RESULTS], "a", encoding="utf-8") as file:
        file.write(json.dumps(["", "peak", str(peak)]) + "\n")


def _take_outcome(nodeid: str, together: list[str], options: list[str], run: Run) -> None:
    first = together[0]
    if first not in _outcomes:
        _outcomes[first] = _outcomes_of(together, options, run)
    outcome, text = _outcomes[first].get(nodeid, ("failed", _outcomes[first][""][1]))
    if outcome == "skipped":
        pytest.skip(text)
    if outcome != "passed":
        pytest.fail(text, pytrace=False)


def _end_of_own(arguments: list[str], environment: dict[str, str], printed: Path) -> str:
    with printed.open("w") as output:
        done = subprocess.run(
            [sys.executable, "-m", "pytest", *arguments],
            cwd=REPO,
            env={**os.environ, **environment},
            stdout=output,
            stderr=subprocess.STDOUT,
            check=False,
            **with_parent(),
        )
    return str(done.returncode)


def _outcomes_of(nodeids: list[str], options: list[str], run: Run) -> dict[str, tuple[str, str]]:
    """Return outcome and text of each test; under the empty name the end of what the process printed."""
    with tempfile.TemporaryDirectory() as folder:
        results, printed = Path(folder) / "results", Path(folder) / "printed"
        results.touch()
        end = run(["-q", *WITHOUT, *options, *nodeids], {RESULTS: str(results)}, printed)
        found = {"": ("failed", f"the test's own process ended with {end}:\n{_end_of_text(printed)}")}
        for line in results.read_text(encoding="utf-8").splitlines():
            nodeid, outcome, text = json.loads(line)
            if outcome == "peak":
                peaks[nodeids[0].partition("::")[0]] = max(int(text), peaks.get(nodeids[0].partition("::")[0], 0))
                continue
            if found.get(nodeid, ("passed",))[0] == "passed":  # a failed teardown counts, too
                found[nodeid] = outcome, text
    return found


def _end_of_text(printed: Path) -> str:
    lines = printed.read_text(encoding="utf-8", errors="replace").splitlines() if printed.exists() else []
    # after a crash Python names all compiled modules, in a line that is longer than where it happened
    lines = [line for line in lines if not line.startswith("Extension modules: ")]
    crash = next((k for k, line in enumerate(lines) if "Fatal Python error" in line), None)
    return "\n".join(lines)[-4000:] if crash is None else "\n".join(lines[crash : crash + 30])
