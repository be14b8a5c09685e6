"""The same radar settings through every door: rig file, scenario file, command line and Python give the same bytes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

import scarl_sionna as ss
from scarl_sionna.cli import app
from scarl_sionna.core.errors import ScarlError
from scarl_sionna.dataset import open_dataset
from scarl_sionna.fusion import Rig
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world, resolve_rig, simulate
from tests.exports import RIG, scenario_files

RAYCAST = ss.RadarSettings.of("raycast", num_rays=700, noise=False, hits_per_cell=None)
"""SCaRL's own method, without the receiver's noise; none of these is the default of the tiny rig."""
RADAR_ALONE = RIG.subset("front/radar")


@pytest.fixture(scope="module")
def scenario(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("doors")
    path = scenario_files(folder, drive=2)[0]
    RADAR_ALONE.save(folder / "rig.yaml")
    return path


def export(out: Path, *arguments: object) -> tuple[list[bytes], str]:
    """Return the raw data of a dataset that the command makes, and its fingerprint."""
    result = CliRunner().invoke(app, ["export", *map(str, arguments), "--out", str(out)])
    assert result.exit_code == 0, result.output
    dataset = open_dataset(out)
    return [frame.radar["front/radar"].adc_int.tobytes() for frame in dataset], dataset.manifest["configuration_hash"]


@pytest.fixture(scope="module")
def by_rig_file(scenario, tmp_path_factory) -> tuple[list[bytes], str]:
    folder = tmp_path_factory.mktemp("by_rig")
    RADAR_ALONE.with_radar(RAYCAST).save(folder / "rig.yaml")
    own = ScenarioSpec.load(scenario).with_(rig=str(folder / "rig.yaml"))
    own.save(folder / "drive.yaml")
    return export(folder / "out", folder / "drive.yaml")


def test_scenario_file(scenario, by_rig_file, tmp_path) -> None:
    text = (
        scenario.read_text() + "radar: {method: raycast, noise: false, raycast: {num_rays: 700, hits_per_cell: null}}\n"
    )
    (tmp_path / "drive.yaml").write_text(text)
    assert export(tmp_path / "out", tmp_path / "drive.yaml") == by_rig_file


def test_command_line(scenario, by_rig_file, tmp_path) -> None:
    options = ("--method", "raycast", "--no-noise", "--set", "radar.raycast.num_rays=700")
    options += ("--set", "radar.raycast.hits_per_cell=null")
    assert export(tmp_path / "out", scenario, *options) == by_rig_file


def test_python(scenario, by_rig_file) -> None:
    spec = ScenarioSpec.load(scenario)
    world, times = load_world(spec), [spec.start_time + index / spec.frame_rate for index in range(2)]
    frames = list(simulate(world, resolve_rig(spec), times, spec.seed, radar=RAYCAST))
    assert [frame.radars["front/radar"].adc_int.tobytes() for frame in frames] == by_rig_file[0]
    one = ss.observe(world, resolve_rig(spec.with_(radar=RAYCAST)), times[1], spec.seed)
    assert one.radars["front/radar"].adc_int.tobytes() == by_rig_file[0][1]


def test_another_setting_is_another_dataset(scenario, by_rig_file, tmp_path) -> None:
    data, fingerprint = export(tmp_path / "out", scenario, "--method", "raycast")
    assert fingerprint != by_rig_file[1] and data != by_rig_file[0]
    stored = Rig.from_dict(open_dataset(tmp_path / "out").manifest["configuration"]["rig"])["front/radar"].settings
    assert stored.method == "raycast" and stored.noise and stored.raycast.num_rays == 500


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--method", "raycat", "did you mean|Input should be 'auto'"),
        ("--tolerance-db", "0", "greater than 0"),
        ("--tube-budget", "-1", "greater than or equal to 0"),
        ("--chirps-per-block", "0", "greater than or equal to 1"),
        ("--max-distance", "-3", "greater than 0"),
        ("--set", "radar.raycast.num_ray=3", "did you mean 'num_rays'"),
        ("--set", "radar.raycast.num_rays", "FIELD=VALUE"),
        ("--set", "radr.noise=false", "did you mean 'radar'"),
        ("--quality", "superb", "draft"),
    ],
)
@pytest.mark.parametrize("command", ["export", "demo", "preview"])
def test_bad_options_are_errors_of_every_command(scenario, tmp_path, command, option, value, message) -> None:
    target = {"export": [str(scenario)], "demo": ["--scenario", str(scenario)], "preview": [str(scenario)]}[command]
    out = tmp_path / ("out.gif" if command == "preview" else "out")
    result = CliRunner().invoke(app, [command, *target, "--out", str(out), option, value])
    assert result.exit_code == 2, result.output
    assert re.search(message, " ".join(result.output.split())), result.output
    assert not out.exists()


def test_bad_settings_in_files(scenario, tmp_path) -> None:
    (tmp_path / "drive.yaml").write_text(scenario.read_text() + "radar: {methd: raycast}\n")
    with pytest.raises(ScarlError, match="methd"):
        ScenarioSpec.load(tmp_path / "drive.yaml")
    data = RADAR_ALONE.to_dict()
    data["sensors"][0]["settings"]["accuracy"]["tube_budget"] = -1
    with pytest.raises(ScarlError, match="tube_budget"):
        Rig.from_dict(data)
    with pytest.raises(ScarlError, match="a RadarSettings"):
        RIG.with_radar({"method": "raycast"})  # type: ignore[arg-type]


def test_a_changed_file_that_the_settings_name_is_another_configuration(scenario, tmp_path) -> None:
    """The rig holds a path; what decides the frames is the content."""
    table = tmp_path / "rcs.toml"
    table.write_text("[Car]\ngamma = 0.5\nsource = 'a test'\n")
    options = (scenario, "--method", "raycast", "--set", f"radar.raycast.class_rcs={table}")
    first = export(tmp_path / "first", *options)[1]
    assert export(tmp_path / "again", *options)[1] == first
    table.write_text("[Car]\ngamma = 0.25\nsource = 'a test'\n")
    assert export(tmp_path / "changed", *options)[1] != first
    result = CliRunner().invoke(app, ["export", *map(str, options), "--out", str(tmp_path / "first")])
    assert result.exit_code == 2 and "settings_files" in result.output.replace("\n", "")
    table.unlink()
    result = CliRunner().invoke(app, ["export", *map(str, options), "--out", str(tmp_path / "none")])
    assert result.exit_code == 2 and "class_rcs" in result.output and not (tmp_path / "none").exists()
