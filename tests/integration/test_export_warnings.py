"""Warnings of an export: each kind is shown once by the command, and all are in its log, with the frame."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from scarl_sionna.batch import ExportSettings, cluster, export
from scarl_sionna.batch import job as job_module
from scarl_sionna.cli import app
from scarl_sionna.cli.common import MOST_KINDS, warning_lines
from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import observe
from tests.exports import scenario_files

RUNNER = CliRunner()


def logged(out: Path) -> list[str]:
    """Return the warnings in an export's log, without the time and the process."""
    lines = (out / "export.log").read_text().splitlines()
    return [line.partition(" WARNING ")[2] for line in lines if " WARNING " in line]


@pytest.fixture
def warned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let each frame of an export in this process warn twice."""

    def observed(*arguments: object, index: int, **options: object) -> object:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ScarlWarning)
            frame = observe(*arguments, index=index, **options)  # type: ignore[arg-type]
        warnings.warn(f"{index + 1} paths are longer than the ramp of 'radar {index}'", ScarlWarning, stacklevel=1)
        warnings.warn("the sun is below the horizon", ScarlWarning, stacklevel=1)
        return frame

    monkeypatch.setattr(job_module, "observe", observed)


@pytest.mark.usefixtures("warned")
def test_each_kind_is_shown_once_and_all_are_in_the_log(tmp_path: Path) -> None:
    (path,) = scenario_files(tmp_path / "s", one=3)
    out = tmp_path / "out"
    result = RUNNER.invoke(app, ["export", str(path), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert [line for line in result.stderr.splitlines() if line.startswith("warning: ")] == [
        "warning: 1 paths are longer than the ramp of 'radar 0' (and 2 more of this kind; --debug shows all)",
        "warning: the sun is below the horizon (3 times)",
    ]
    found = [line for line in logged(out) if "horizon" in line or "longer" in line]
    assert found[:2] == [
        "frame 0 of one: warning: 1 paths are longer than the ramp of 'radar 0'",
        "frame 0 of one: warning: the sun is below the horizon",
    ]
    assert len(found) == 6 and found[-1] == "frame 2 of one: warning: the sun is below the horizon"
    again = RUNNER.invoke(app, ["--debug", "export", str(path), "--out", str(out), "--overwrite"])
    assert sum(line.startswith("warning: ") for line in again.stderr.splitlines()) == 4


def test_warnings_of_workers_are_shown_and_in_the_log(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    (path,) = scenario_files(tmp_path / "s", one=2)
    found = []
    for workers in (0, 1, 2):
        out = tmp_path / str(workers)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", ScarlWarning)
            export([ScenarioSpec.load(path)], out, ExportSettings(workers=workers))
        found.append((logged(out), sorted(str(item.message) for item in caught if item.category is ScarlWarning)))
    assert found[0] == found[1] and found[2][0] == found[0][0]
    (idle,) = set(found[2][1]) - set(found[0][1])
    assert idle.startswith("only 1 of 2 workers can work at once") and "--shard-frames, now 3" in idle
    assert found[0][0] and all(re.match(r"frame [01] of one: warning: ", line) for line in found[0][0])
    assert len(found[0][0]) == len(found[0][1])


@pytest.mark.parametrize(
    ("workers", "advice"),
    [(4, "--shard-frames, now 8) gives all some"), (5, "fewer workers (--workers 1) do the same")],
)
def test_fewer_frames_a_shard_are_advised_only_where_they_give_all_workers_some(workers, advice) -> None:
    scene, options = SimpleNamespace(shard_range=lambda shard, options: range(4)), StoreOptions(shard_frames=8)
    jobs = [SimpleNamespace(scene=scene, shard=0, options=options)]
    text = cluster._idle_text(jobs, workers)  # type: ignore[arg-type]
    assert text.startswith(f"only 1 of {workers} workers can work at once") and text.endswith(advice)


def test_a_failed_export_shows_its_warnings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*arguments: object, **options: object) -> object:
        warnings.warn("all is lost", ScarlWarning, stacklevel=1)
        raise ValueError("no such thing")

    monkeypatch.setattr(job_module, "observe", fails)
    (path,) = scenario_files(tmp_path / "s", one=1)
    result = RUNNER.invoke(app, ["export", str(path), "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "warning: all is lost\nerror: frame 0 of one failed (ValueError: no such thing)" in result.stderr


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("3 object(s) of 0.5 m are small", "12 object(s) of 1.2e-3 m are small"),
        ("'car 1' is near", "'a wall' is near"),
        ("front/radar: left out sign_1, sign_2 and post_3; raise it", "back/radar: left out sign_7; raise it"),
    ],
)
def test_texts_that_differ_by_numbers_and_names_are_of_one_kind(first: str, second: str) -> None:
    assert warning_lines([first, second]) == [f"warning: {first} (and 1 more of this kind; --debug shows all)"]
    assert warning_lines([first, second, first], all_of_them=True) == [
        f"warning: {first} (2 times)",
        f"warning: {second}",
    ]


def test_kinds_beyond_the_most_are_counted() -> None:
    texts = [f"{'a' * count} is off" for count in range(1, MOST_KINDS + 4) for _ in range(2)]
    lines = warning_lines(texts)
    assert len(lines) == MOST_KINDS + 1 and lines[0] == "warning: a is off (2 times)"
    assert lines[-1] == "warning: 6 more warnings of 3 other kinds; --debug shows all"
    assert len(warning_lines(texts, all_of_them=True)) == MOST_KINDS + 3
    assert warning_lines([]) == []
