"""The demo as a user runs it: the same bytes from YAML and Python, and no half frame after a kill or Ctrl-C."""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset import open_dataset
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.children import with_parent
from tests.exports import contents, kept_frames, wait_until
from tests.frames import assert_same

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory
EXAMPLES = Path(__file__).parents[2] / "examples"
PLACE = Pose([2.36, 0.0, 0.8])
RIG = Rig(
    "tiny",
    (
        SensorMount("front/camera", "camera", CameraSpec(width=32, height=18, samples_per_pixel=1), PLACE),
        SensorMount("front/lidar", "lidar", LidarSpec(num_azimuth=60, num_elevation=8), PLACE),
        SensorMount(
            "front/radar",
            "radar",
            RadarSpec().with_(num_chirps=16, num_samples=128),
            PLACE,
            RadarSettings.of("raycast", num_rays=2_000),
        ),
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
    for stage in ("scene", "camera", "lidar", "radar", "encoding", "contact sheet"):
        assert stage in result.stdout
    return out


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
    assert (tmp_path / "out" / "contact_sheet.png").read_bytes() == (from_command / "contact_sheet.png").read_bytes()


def test_every_sensor_of_a_frame_has_its_files_and_reads_back(from_command) -> None:
    dataset = open_dataset(from_command)
    assert len(dataset) == 2
    for index, stored in enumerate(dataset):
        frame = stored.to_frame()
        assert (frame.index, frame.timestamp_ns) == (index, index * 100_000_000)
        assert tuple(frame.results) == RIG.names
        for image in ("rgb", "depth", "semantic", "instance"):
            folder = from_command / "images" / "highway_guardrail" / "front" / "camera" / image
            assert (folder / f"{index:06d}.png").stat().st_size > 50
    assert (from_command / "contact_sheet.png").stat().st_size > 50_000


def start_demo(scenario: Path, out: Path, frames: int) -> subprocess.Popen:
    command = [sys.executable, "-m", "scarl_sionna.cli", "demo", "--scenario", str(scenario), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--frames", str(frames)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        **with_parent(),
    )


@pytest.mark.slow
def test_a_killed_run_leaves_whole_frames_and_goes_on(scenario_path, from_command, tmp_path) -> None:
    out = tmp_path / "out"
    process = start_demo(scenario_path, out, frames=60)
    assert wait_until((out / "shards" / "highway_guardrail" / "000000.json").exists, process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    complete = len(open_dataset(out))
    assert 8 <= complete < 60
    again = CliRunner().invoke(
        app, ["demo", "--scenario", str(scenario_path), "--out", str(out), "--frames", str(complete)]
    )
    assert again.exit_code == 0, again.output
    assert f"0 frames written, {complete} kept from before" in again.stdout
    before = open_dataset(from_command)
    for stored, short in zip(open_dataset(out), before, strict=False):
        assert tuple(stored.sensors) == RIG.names
        assert_same(stored.to_frame(), short.to_frame())


@pytest.mark.slow
def test_ctrl_c_keeps_the_finished_frames_and_says_so(scenario_path, tmp_path) -> None:
    out = tmp_path / "out"
    process = start_demo(scenario_path, out, frames=60)
    assert wait_until(lambda: bool(kept_frames(out)), process)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"finished frames are kept in {out}" in errors
    assert "Traceback" not in errors
    assert kept_frames(out)
