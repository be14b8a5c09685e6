"""A scenario file that takes its motion from a trace of ASAM OSI or from SUMO's record: composed, exported, refused."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScenarioError, ScenarioFileError, ScenarioTimeError
from scarl_sionna.dataset import open_dataset
from scarl_sionna.fusion import Rig
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import RIG, run
from tests.lane_scene import lane_scene
from tests.osi_traces import DELIVERY_VAN, PEDESTRIAN, Moving, truth, view, write_trace

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
TEXT = """\
scene: synthetic.xml
rig: rig.yaml
name: recorded
num_frames: 3
frame_rate: 5.0
start_time: 1000.5
seed: 2
keep_default_actors: false
detail: light
ego:
  model: saloon
  trajectory: {kind: table, file: run_gt.osi}
traffic: {source: osi, file: run_gt.osi}
"""
FIRST = 1000.0
SPEEDS = {"9": 8.0, "11": -9.0}


def drive(ego: float = 0.0, first: float = FIRST, offset: float = 0.0) -> list[bytes]:
    """The host at 10 m/s, a van ahead of it, a car that comes, a man on the footpath, who is there from 0.6 s on."""
    messages = []
    for step in range(21):
        time = 0.1 * step
        others = [
            Moving(7, (10.0 * time + offset, ego, 0.75), velocity=(10.0, 0.0, 0.0)),
            Moving(9, (30.0 + 8.0 * time + offset, 0.0, 1.1), size=(5.2, 2.0, 2.2), vehicle=DELIVERY_VAN),
            Moving(11, (90.0 - 9.0 * time + offset, 7.0, 0.75), np.pi),
            Moving(12, (20.0 + 1.2 * time + offset, -6.0, 0.9), kind=PEDESTRIAN, vehicle=None),
        ]
        messages.append(truth(first + time, others[: 4 if step >= 6 else 3], host=7))
    return messages


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    lane_scene(tmp_path)
    Rig("two", RIG.subset("front/lidar", "front/radar").sensors).save(tmp_path / "rig.yaml")
    write_trace(tmp_path / "run_gt.osi", drive())
    (tmp_path / "recorded.yaml").write_text(TEXT)
    return tmp_path


def world_of(folder: Path, text: str = TEXT) -> ss.World:
    (folder / "recorded.yaml").write_text(text)
    return build_world(ScenarioSpec.load(folder / "recorded.yaml"))


def test_the_host_is_the_ego_vehicle_and_the_others_are_traffic(folder: Path) -> None:
    world = world_of(folder)
    assert world.ego == "ego" and {one.name for one in world.actors} == {"ego", "9", "11", "12"}
    for time in (1000.5, 1000.9):
        state, since = world.at(time), time - FIRST
        np.testing.assert_allclose(state.actor_pose("ego").position, [10.0 * since, 0.0, 0.0], atol=0.01)
        np.testing.assert_allclose(state.actor_twist("ego").linear, [10.0, 0.0, 0.0], atol=0.01)
        for name, begin, side in (("9", 30.0, 0.0), ("11", 90.0, 7.0)):
            np.testing.assert_allclose(
                state.actor_pose(name).position, [begin + SPEEDS[name] * since, side, 0.0], atol=0.01
            )
            np.testing.assert_allclose(state.actor_twist(name).linear, [SPEEDS[name], 0.0, 0.0], atol=0.01)
    there = [{item.name for item in world.at(time).boxes() if item.is_actor} for time in (1000.5, 1000.9)]
    assert there == [{"ego", "9", "11"}, {"ego", "9", "11", "12"}]  # the man has no box before he is there


def test_sensor_views_give_the_same_world(folder: Path) -> None:
    one = world_of(folder)
    write_trace(folder / "run_sv.osi", [view(each) for each in drive()])
    other = world_of(folder, TEXT.replace("run_gt", "run_sv"))
    for name in ("ego", "9", "11", "12"):
        poses = [world.at(1000.7).actor_pose(name) for world in (one, other)]
        assert poses[0].position.tobytes() == poses[1].position.tobytes()


def test_the_command_renders_a_recorded_trace(folder: Path) -> None:
    done = run(folder / "recorded.yaml", "--out", folder / "out")
    assert done.returncode == 0, done.stderr
    frames = list(open_dataset(folder / "out"))
    times = [frame.timestamp_ns / 1e9 for frame in frames]
    assert times == pytest.approx([1000.5, 1000.7, 1000.9])
    for time, frame in zip(times, frames, strict=True):
        (van,) = (item for item in frame.labels if item.name == "9")
        np.testing.assert_allclose(van.world_from_box.position[0], 30.0 + 8.0 * (time - FIRST), atol=0.15)
        assert van.num_lidar_points > 0 and frame.radar["front/radar"].num_paths > 0


def test_another_trace_is_another_dataset(folder: Path) -> None:
    from scarl_sionna.scenario.compose import compose
    from scarl_sionna.scenario.fingerprint import fingerprint

    prints = []
    for offset in (0.0, 0.5):
        write_trace(folder / "run_gt.osi", drive(offset=offset))
        prints.append(fingerprint(compose(ScenarioSpec.load(folder / "recorded.yaml"))))
    assert prints[0]["traffic"] != prints[1]["traffic"] and prints[0]["ego"] != prints[1]["ego"]


def test_an_ego_of_ones_own_meets_the_recorded_host(folder: Path) -> None:
    """Who is not the ego vehicle by the trace is traffic by its number, the host as well."""
    text = TEXT.replace(
        "{kind: table, file: run_gt.osi}", "{kind: route, lanes: [east_2], start: 100, speed: 8, since: 1000}"
    )
    assert {one.name for one in world_of(folder, text).actors} == {"ego", "7", "9", "11", "12"}
    taken = text.replace(
        "traffic:", "actors: [{name: van, model: van, trajectory: {kind: table, file: run_gt.osi, id: '9'}}]\ntraffic:"
    )
    assert {one.name for one in world_of(folder, taken).actors} == {"ego", "van", "7", "11", "12"}


@pytest.mark.parametrize(
    ("change", "kind", "line", "said"),
    [
        (("traffic: {source: osi, file: run_gt.osi}", "traffic: {source: osi}"), ScenarioError, 13, "a `file`"),
        (
            ("source: osi, file: run_gt", "source: osi, file: none_gt"),
            ScenarioFileError,
            13,
            "'none_gt.osi' is not there",
        ),
        (("source: osi, file: run_gt", "source: osi, file: bad_gt"), ScenarioFileError, 13, "ends within message 21"),
        (("table, file: run_gt", "table, file: bad_gt"), ScenarioFileError, 12, "ends within message 21"),
        (("table, file: run_gt.osi", "table, file: run_gt.osi, id: '8'"), ScenarioError, 12, "'8'"),
        (("start_time: 1000.5", "start_time: 5000.0"), ScenarioTimeError, 12, "1000 to 1002 s"),
        (("source: osi, file: run_gt", "source: osi, file: later_gt"), ScenarioTimeError, 13, "set start_time: 2000"),
    ],
)
def test_what_is_wrong_with_a_trace_is_told_with_its_line(folder: Path, change, kind, line: int, said: str) -> None:
    (folder / "bad_gt.osi").write_bytes((folder / "run_gt.osi").read_bytes()[:-9])
    write_trace(folder / "later_gt.osi", drive(first=2000.0))
    assert change[0] in TEXT
    with pytest.raises(kind, match=said) as caught:
        world_of(folder, TEXT.replace(*change))
    assert caught.value.problems[0].line == line


def test_sumos_record_has_the_ego_vehicle_as_well(folder: Path) -> None:
    """The same rule for floating car data: who is the ego vehicle by a table of the file is no traffic."""
    rows = "".join(
        f'<timestep time="{FIRST + 0.1 * step:.1f}">'
        f'<vehicle id="me" x="{1.0 * step:.2f}" y="0.0" angle="90" type="car"/>'
        f'<vehicle id="other" x="{40.0 + 0.8 * step:.2f}" y="0.0" angle="90" type="van"/></timestep>'
        for step in range(21)
    )
    (folder / "fcd.xml").write_text(f"<fcd-export>{rows}</fcd-export>")
    text = TEXT.replace("file: run_gt.osi}", "file: fcd.xml, id: me}", 1)
    text = text.replace("{source: osi, file: run_gt.osi}", "{source: fcd, file: fcd.xml}")
    world = world_of(folder, text)
    assert {one.name for one in world.actors} == {"ego", "other"}
    np.testing.assert_allclose(world.at(1000.7).actor_twist("ego").linear, [10.0, 0.0, 0.0], atol=0.01)


def test_the_example_drives_a_trace(tmp_path: Path) -> None:
    """`examples/osi_drive.yaml` with a trace beside it; the command is the same."""
    shutil.copy(EXAMPLES / "osi_drive.yaml", tmp_path)
    spec = ScenarioSpec.load(tmp_path / "osi_drive.yaml")
    with pytest.raises(ScenarioFileError, match="drive_gt.osi"):
        build_world(spec)
    assert spec.ego is not None and spec.traffic is not None and spec.traffic.source == "osi"
    lane = build_world(ScenarioSpec.preset("cut_in")).document.lanes.of_kind("drive")[0]
    ways = 20.0 + 10.0 * np.linspace(0.0, 3.0, 31)
    points, heads = lane.at(ways), lane.at(ways + 0.5) - lane.at(ways - 0.5)
    ahead, steps = lane.at(ways + 25.0), lane.at(ways + 25.5) - lane.at(ways + 24.5)
    messages = [
        truth(
            0.1 * step,
            [
                Moving(1, points[step] + [0.0, 0.0, 0.75], float(np.arctan2(heads[step, 1], heads[step, 0]))),
                Moving(2, ahead[step] + [0.0, 0.0, 0.75], float(np.arctan2(steps[step, 1], steps[step, 0]))),
            ],
            host=1,
        )
        for step in range(31)
    ]
    write_trace(tmp_path / "drive_gt.osi", messages)
    world = build_world(ScenarioSpec.load(tmp_path / "osi_drive.yaml"))
    assert {"ego", "2"} <= {one.name for one in world.actors}
    assert np.linalg.norm(world.at(1.0).actor_twist("ego").linear) == pytest.approx(10.0, abs=0.2)
