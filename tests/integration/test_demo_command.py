"""The demo as a user runs it: the same bytes from YAML and Python, and no half frame after a kill or Ctrl-C."""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.lidar_spec import LidarSpec
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.export import frame_folders, read_frame
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario import ScenarioSpec

EXAMPLES = Path(__file__).parents[2] / "examples"
PLACE = Pose([2.36, 0.0, 0.8])
RIG = Rig(
    "tiny",
    (
        SensorMount("front/camera", "camera", CameraSpec(width=32, height=18, samples_per_pixel=1), PLACE),
        SensorMount("front/lidar", "lidar", LidarSpec(num_azimuth=60, num_elevation=8), PLACE),
        SensorMount("front/radar", "radar", RadarSpec(num_rays=2_000, num_chirps=16, num_samples=128), PLACE),
    ),
)


@pytest.fixture(scope="module")
def scenario_path(tmp_path_factory) -> Path:
    """Return the file of the example's scenario with a tiny rig."""
    folder = tmp_path_factory.mktemp("scenario")
    RIG.save(folder / "rig.yaml")
    example = ScenarioSpec.load(EXAMPLES / "highway_demo.yaml")
    example.with_(rig=str(folder / "rig.yaml"), num_frames=2).save(folder / "scenario.yaml")
    return folder / "scenario.yaml"


@pytest.fixture(scope="module")
def from_command(scenario_path, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("command") / "out"
    result = CliRunner().invoke(app, ["demo", "--scenario", str(scenario_path), "--out", str(out)])
    assert result.exit_code == 0, result.output
    assert "2 frames written" in result.stdout
    for stage in ("scene", "camera", "lidar", "radar", "writing", "contact sheet"):
        assert stage in result.stdout
    return out


def contents(out: Path) -> dict[str, bytes]:
    """Return all files of a folder."""
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}


def example_module():
    spec = importlib.util.spec_from_file_location("highway_demo", EXAMPLES / "highway_demo.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_in_python_and_in_yaml_are_the_same_scenario() -> None:
    assert ScenarioSpec.load(EXAMPLES / "highway_demo.yaml") == example_module().SCENARIO == ScenarioSpec()


def test_the_example_in_python_gives_the_same_bytes_as_the_command(scenario_path, from_command, tmp_path) -> None:
    example_module().main(str(tmp_path / "out"), ScenarioSpec.load(scenario_path))
    assert contents(tmp_path / "out") == contents(from_command)
    assert len(contents(from_command)) == 2 + 2 * (1 + 4 + 1 + 1)


def test_every_sensor_of_a_frame_has_its_files_and_reads_back(from_command) -> None:
    for index, folder in enumerate(frame_folders(from_command)):
        frame = read_frame(folder)
        assert (frame.index, frame.timestamp_ns) == (index, index * 100_000_000)
        assert tuple(frame.results) == RIG.names
    assert (from_command / "contact_sheet.png").stat().st_size > 50_000


def start(scenario: Path, out: Path, frames: int) -> subprocess.Popen:
    command = [sys.executable, "-m", "scarl_sionna.cli", "demo", "--scenario", str(scenario), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--frames", str(frames)], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )


def wait_for(path: Path, process: subprocess.Popen) -> None:
    for _ in range(2_400):
        if path.exists() or process.poll() is not None:
            return
        time.sleep(0.025)
    raise AssertionError(f"{path} did not appear in 60 s")


def test_a_killed_run_leaves_whole_frames_and_goes_on(scenario_path, from_command, tmp_path) -> None:
    out = tmp_path / "out"
    process = start(scenario_path, out, frames=60)
    wait_for(out / "frame_000001", process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    before = contents(out)
    complete = frame_folders(out)
    assert 2 <= len(complete) < 60
    for folder in complete:
        assert tuple(read_frame(folder).results) == RIG.names
    more = len(complete) + 1
    again = CliRunner().invoke(
        app, ["demo", "--scenario", str(scenario_path), "--out", str(out), "--frames", str(more)]
    )
    assert again.exit_code == 0, again.output
    assert f"1 frames written, {more - 1} kept from before" in again.stdout
    after = contents(out)
    assert all(after[name] == data for name, data in before.items() if name.startswith("frame_"))
    assert not [name for name in after if "partial" in name]
    assert {n: d for n, d in after.items() if n.startswith(("frame_000000", "frame_000001"))} == {
        n: d for n, d in contents(from_command).items() if n.startswith("frame_")
    }


def test_ctrl_c_keeps_the_finished_frames_and_says_so(scenario_path, tmp_path) -> None:
    out = tmp_path / "out"
    process = start(scenario_path, out, frames=60)
    wait_for(out / "frame_000000", process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"finished frames are kept in {out}" in errors
    assert "Traceback" not in errors
    assert frame_folders(out)
    assert not list(out.glob(".partial*"))
