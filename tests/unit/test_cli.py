"""Command line: help, version, and one clear message with exit code 2 for a user's mistake."""

from __future__ import annotations

import importlib.metadata

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app

RUNNER = CliRunner()


def test_help_names_what_exists_and_nothing_else() -> None:
    result = RUNNER.invoke(app, ["--help"])
    assert result.exit_code == 0
    for word in ("demo", "info", "--version"):
        assert word in result.stdout
    for word in ("export", "preview", "rcs", "bench", "calibrate"):
        assert word not in result.stdout


def test_demo_help_tells_the_defaults() -> None:
    result = RUNNER.invoke(app, ["demo", "--help"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    for word in ("--out", "--frames", "--quality", "--scene", "--rig", "--seed", "--overwrite", "default: 5", "draft"):
        assert word in result.stdout


def test_version_is_the_packages() -> None:
    result = RUNNER.invoke(app, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"scarl-sionna {importlib.metadata.version('scarl-sionna')}\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--frames", "0"], "num_frames = 0"),
        (["--frames", "-2"], "num_frames = -2"),
        (["--quality", "best"], "'draft' or 'full'"),
        (["--rig", "sideways"], "unknown rig 'sideways' (known: front, scarl)"),
        (["--rig", "none.yaml"], "rig file = none.yaml"),
        (["--scene", "highway_guardrial"], "did you mean 'highway_guardrail'"),
        (["--scene", "none.xml"], "none.xml"),
        (["--seed", "-1"], "seed = -1"),
        (["--frame-rate", "0"], "frame_rate = 0"),
        (["--frames", "100000"], "outside the motion"),
        (["--scenario", "none.yaml"], "scenario file = none.yaml"),
    ],
)
def test_a_mistake_gives_one_message_and_exit_code_2(tmp_path, arguments, message) -> None:
    result = RUNNER.invoke(app, ["demo", "--out", str(tmp_path / "out"), *arguments])
    assert result.exit_code == 2
    assert message in result.stderr
    assert "Traceback" not in result.stderr
    assert not list(tmp_path.glob("out/frame_*"))


def test_a_folder_that_cannot_be_written(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    result = RUNNER.invoke(app, ["demo", "--out", str(tmp_path / "file" / "out")])
    assert result.exit_code == 2
    assert "choose a folder that you may write to" in result.stderr


def test_debug_shows_the_exception(tmp_path) -> None:
    result = RUNNER.invoke(app, ["--debug", "demo", "--frames", "0", "--out", str(tmp_path)])
    assert type(result.exception).__name__ == "ParameterRangeError"


def test_a_number_that_is_none_is_a_usage_error() -> None:
    result = RUNNER.invoke(app, ["demo", "--frames", "many"])
    assert result.exit_code == 2
    assert "--frames" in result.stderr
