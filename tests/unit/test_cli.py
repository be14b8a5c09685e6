"""Command line: help, version, and one clear message with exit code 2 for a user's mistake."""

from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.schema import SCHEMA_VERSION
from tests.exports import scenario_files
from tests.frames import RIG, make_frame
from tests.scenes import box

RUNNER = CliRunner()


def test_help_names_what_exists_and_nothing_else() -> None:
    result = RUNNER.invoke(app, ["--help"])
    assert result.exit_code == 0
    for word in ("demo", "export", "verify", "preview", "info", "rcs", "--version"):
        assert word in result.stdout
    commands = {command.name or command.callback.__name__ for command in app.registered_commands}
    assert commands == {"demo", "rcs", "info"}


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
    assert not list(tmp_path.glob("out/shards/*"))


def test_a_folder_that_cannot_be_written(tmp_path) -> None:
    (tmp_path / "file").write_text("")
    result = RUNNER.invoke(app, ["demo", "--out", str(tmp_path / "file" / "out")])
    assert result.exit_code == 2
    assert "choose a folder that you may write to" in result.stderr


def test_debug_shows_the_exception(tmp_path) -> None:
    result = RUNNER.invoke(app, ["--debug", "demo", "--frames", "0", "--out", str(tmp_path)])
    assert isinstance(result.exception, ParameterRangeError)


def test_a_number_that_is_none_is_a_usage_error() -> None:
    result = RUNNER.invoke(app, ["demo", "--frames", "many"])
    assert result.exit_code == 2
    assert "--frames" in result.stderr


def test_rcs_prints_and_plots_a_cut(tmp_path: Path) -> None:
    box((0.1, 0.1, 0.002)).export(tmp_path / "plate.ply")
    plot = tmp_path / "cut.png"
    arguments = ["rcs", str(tmp_path / "plate.ply"), "--cut", "elevation", "--step", "10", "--plot", str(plot)]
    result = RUNNER.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    rows = [line.split(",") for line in result.stdout.splitlines()]
    assert rows[0] == ["theta_deg", "VV_dbsm", "HH_dbsm"] and len(rows) == 1 + 19
    # plate of 10 cm at 77 GHz head-on: 4 pi A^2 / lambda^2 = 19.1855 dBsm, exact in physical optics
    assert float(rows[1][1]) == pytest.approx(19.1855, abs=1e-3)
    assert plot.stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["lost.ply"], "there is no such file"),
        (["plate.ply", "--polarization", "XX"], "unknown polarization 'XX'"),
        (["plate.ply", "--freq", "-1"], "frequency = -1.0 Hz"),
        (["plate.ply", "--material", "kryptonite"], "unknown radio material 'kryptonite'"),
    ],
)
def test_rcs_refuses(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str) -> None:
    monkeypatch.chdir(tmp_path)
    box((0.1, 0.1, 0.002)).export("plate.ply")
    result = RUNNER.invoke(app, ["rcs", *arguments])
    assert result.exit_code == 2 and message in result.output


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("dataset")
    return write_dataset(folder / "out", RIG.to_dict(), {"street": [make_frame(0), make_frame(1)]})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["none.yaml"], "scenario file = none.yaml"),
        (["highway_guardrial"], "did you mean 'highway_guardrail'"),
        (["highway_guardrail", "--frames", "0"], "num_frames = 0"),
        (["highway_guardrail", "--method", "hybrid"], "'hybrid' without a plan is not allowed (allowed: auto, raycast"),
        (["highway_guardrail", "--method", "scatterers"], "models` of a scenario or rig file, or by --set 'radar"),
        (["highway_guardrail", "--method", "hybrid", "--dry-run"], "`radar.plan` of a scenario or rig file"),
        (["highway_guardrail", "--shard", "4/4"], "--shard = 4/4 is not allowed (allowed: i/n with 0 <= i < n"),
        (["highway_guardrail", "--shard", "one"], "--shard = one"),
        (["highway_guardrail", "--on-error", "ignore"], "record or raise"),
        (["highway_guardrail", "--radar-format", "float"], "int16 or complex64"),
        (["highway_guardrail", "highway_guardrail"], "two of the name 'highway_guardrail'"),
        (["highway_guardrail", "--workers", "2", "--shard", "0/2"], "more than one of them"),
        (["highway_guardrail", "--frames", "100000"], "outside the motion"),
    ],
)
def test_export_refuses(tmp_path: Path, arguments: list[str], message: str) -> None:
    result = RUNNER.invoke(app, ["export", *arguments, "--out", str(tmp_path / "out")])
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert not list(tmp_path.glob("out/shards/*"))


def test_a_dry_run_measures_and_writes_nothing(tmp_path: Path) -> None:
    (path,) = scenario_files(tmp_path / "s", one=5)
    result = RUNNER.invoke(app, ["export", str(path), "--frames", "70", "--dry-run", "--out", str(tmp_path / "out")])
    assert result.exit_code == 0, result.output
    for word in ("frames: 70", "size:", "kB a frame", "time:", "s a frame", "free"):
        assert word in result.stdout
    assert not (tmp_path / "out").exists()


def test_verify_preview_and_info_of_a_dataset(dataset: Path, tmp_path: Path) -> None:
    good = RUNNER.invoke(app, ["verify", str(dataset)])
    assert (good.exit_code, good.stdout.splitlines()[-1]) == (0, "whole and complete")
    shown = RUNNER.invoke(app, ["info", str(dataset)])
    assert shown.exit_code == 0
    for word in (
        "2 frames in 1 scenes",
        f"schema version {SCHEMA_VERSION}",
        "scene street: 2 of 2 frames, train",
        "sensor radar: radar",
    ):
        assert word in shown.stdout
    sheet = tmp_path / "sheet.png"
    drawn = RUNNER.invoke(app, ["preview", str(dataset), "--frame", "1", "--out", str(sheet)])
    assert drawn.exit_code == 0, drawn.output
    assert sheet.stat().st_size > 10_000
    beyond = RUNNER.invoke(app, ["preview", str(dataset), "--frame", "2", "--out", str(sheet)])
    assert beyond.exit_code == 2 and "no frame 2: it holds 2 frames" in beyond.stderr


@pytest.mark.parametrize("command", ["verify", "preview", "info"])
def test_a_folder_that_is_no_dataset(tmp_path: Path, command: str) -> None:
    result = RUNNER.invoke(app, [command, str(tmp_path)])
    assert result.exit_code == 2
    assert "no dataset here (no manifest.json); give the folder that `scarl-sionna export --out` wrote" in result.stderr
