"""Motions of a scenario through stated points: turning back on foot, stated headings at one speed, shifted kerbs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, ScenarioPlace
from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody
from scarl_sionna.scenario.motion.ground import shifted_way
from scarl_sionna.scenario.motion.motions import Setting, trajectory_of
from scarl_sionna.scenario.motion.on_foot import legs_of, timed_walk
from scarl_sionna.scenario.randomize import Jitter
from scarl_sionna.scenario.spec.motion import WaypointsSpec
from scarl_sionna.scene.motion.trajectory import Trajectory

CAR = ActorBody(4.6, 1.8, 1.45, 2.7, -1.35)
SETTING = Setting("urban_crossing", None, 0.0, 12.0, Path)


def motion(body: ActorBody = WALKER, jitter: Jitter | None = None, **stated: object) -> Trajectory:
    spec = WaypointsSpec(**stated)  # type: ignore[arg-type]
    return trajectory_of(spec, "a", body, SETTING, lambda *keys: ScenarioPlace(), jitter)


THERE_AND_BACK = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
STANDING = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    "stated",
    [
        {"positions": THERE_AND_BACK, "speed": 1.3},
        {"positions": THERE_AND_BACK, "times": [0.0, 4.0, 9.0]},
        {"positions": STANDING, "times": [0.0, 4.0, 5.0, 9.0]},
        {"positions": STANDING, "times": [0.0, 3.0, 7.0, 10.0]},
        {"positions": [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 1.0, 0.0], [2.0, 4.0, 0.0]], "speed": 1.3},
        {"positions": [*THERE_AND_BACK, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "speed": 1.3},
    ],
)
def test_who_turns_back_stops_and_turns_on_the_spot(stated: dict) -> None:
    walk = motion(**stated)
    step = 1e-3
    times = np.arange(walk.start, min(walk.stop, 12.0), step)
    poses, twists = [walk.pose(time) for time in times], [walk.twist(time) for time in times]
    place = np.array([pose.position for pose in poses])
    velocity = np.array([twist.linear for twist in twists])
    yaw = np.unwrap([pose.yaw for pose in poses])
    rate = np.array([twist.angular[2] for twist in twists])
    assert np.abs(np.diff(place, axis=0) / step - (velocity[:-1] + velocity[1:]) / 2).max() < 1e-3
    assert np.abs(np.diff(yaw) / step - (rate[:-1] + rate[1:]) / 2).max() < 0.02
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() / step < 6.0
    spot = np.linalg.norm(place - [4.0, 0.0, 0.0], axis=1) < 1e-3
    angle = 153.4 if [2.0, 1.0, 0.0] in stated["positions"] else 180.0
    assert np.degrees(np.abs(yaw[spot][-1] - yaw[spot][0])) == pytest.approx(angle, abs=1.0)
    assert np.abs(rate[spot]).max() <= 1.9 * np.pi / 2 * 1.01 and np.abs(velocity[spot]).max() < 0.1


def test_a_walk_ends_at_its_last_point() -> None:
    walk = motion(positions=THERE_AND_BACK, speed=1.3)
    assert walk.stop == pytest.approx(12.5) and walk.pose(12.0).position == pytest.approx([0.0, 0.0, 0.0], abs=1e-3)
    assert motion(positions=THERE_AND_BACK, times=[0.0, 4.0, 9.0]).pose(9.0).position == pytest.approx(
        [0.0, 0.0, 0.0], abs=1e-3
    )


@pytest.mark.parametrize("body", [CAR, WALKER])
def test_a_speed_with_stated_headings_is_kept_along_the_curve(body: ActorBody) -> None:
    bend = {"positions": [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 10.0, 0.0]], "speed": 3.0}
    drive = motion(body, **bend, yaw_deg=[0.0, 0.0, 0.0, 90.0])
    for time in np.arange(0.0, 9.0, 0.05):
        assert np.linalg.norm(drive.twist(time).linear) == pytest.approx(3.0, rel=0.01)
    near = min(np.linalg.norm(drive.pose(time).position - [20.0, 0.0, 0.0]) for time in np.arange(6.0, 9.0, 0.002))
    assert near < 0.01
    later = motion(body, **bend, yaw_deg=[0.0, 0.0, 0.0, 90.0], depart=2.0)
    assert later.start == 0.0 and later.stop > 11.5
    assert later.pose(1.9).position == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert np.linalg.norm(later.twist(6.0).linear) == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize("pace", [{"speed": 1.3}, {"times": [0.0, 1.5, 2.0, 6.0]}])
@pytest.mark.parametrize("along", [-0.8, 0.7])
def test_a_shifted_way_has_its_kerbs_where_they_are(pace: dict, along: float) -> None:
    kerb = [[0.0, 0.0, 0.12], [2.0, 0.0, 0.12], [2.2, 0.0, 0.0], [8.0, 0.0, 0.0]]
    walk = motion(positions=kerb, jitter=Jitter(along, 0.2), **pace)
    for time in np.arange(walk.start, min(walk.stop, 6.0), 0.05):
        x, y, z = walk.pose(time).position
        assert y == pytest.approx(0.2, abs=1e-2)
        assert z == pytest.approx(np.interp(x, [2.0, 2.2], [0.12, 0.0]), abs=0.025)


TO_AND_FRO = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]


@pytest.mark.parametrize("step", [1.0, 2.0, 2.2, 6.0])
def test_two_turns_in_a_row_leave_half_of_the_time_between_them_to_go(step: float) -> None:
    walk = motion(positions=TO_AND_FRO, times=(step * np.arange(4)).tolist())
    times = np.arange(walk.start, walk.stop, 0.005)
    speed = np.array([np.linalg.norm(walk.twist(time).linear) for time in times])
    between = (times > step) & (times < 2.0 * step)
    assert speed[between].max() < 1.9 * 3.0 / min(0.5 * step, step - 1e-3) * 1.01
    assert np.count_nonzero(speed[between] > 1e-3) * 0.005 >= 0.5 * step - 0.15
    assert walk.pose(1.5 * step).position[0] == pytest.approx(1.5, abs=0.02)
    assert np.degrees(abs(walk.pose(1.5 * step).yaw)) == pytest.approx(180.0, abs=1.0)


@pytest.mark.parametrize("times", [[0.0, 4.0], [0.0, 4.0, 9.0, 10.0], [0.0, 4.0, 3.0], [0.0, 4.0, np.nan]])
def test_times_of_who_turns_back_are_as_many_as_points_and_rise(times: list[float]) -> None:
    with pytest.raises(ParameterRangeError, match=r"a\.times.*3 strictly rising times"):
        timed_walk(np.array(THERE_AND_BACK), times, WALKER, "a")


def test_who_goes_up_does_not_turn() -> None:
    west = np.array([[0.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [-1.0, 0.0, 0.5], [-2.0, 0.0, 0.5], [0.0, 0.0, 0.5]])
    assert legs_of(west[:4], "a") == [(0, 3)]
    assert legs_of(west, "a") == [(0, 3), (3, 4)]
    assert legs_of(west[1:4], "a") == [(0, 2)] and legs_of(west[1:3], "a") == [(0, 1)]


@pytest.mark.parametrize(
    "stated",
    [
        {"positions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]},
        {"positions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]},
        {"positions": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "yaw_deg": [0.0, 0.0]},
    ],
)
def test_who_sets_off_on_a_short_way_gets_as_fast_as_there_is_room(stated: dict) -> None:
    walk = motion(**stated, speed=1.4, depart=2.0)
    times = np.arange(0.0, 12.0, 0.01)
    speed = [np.linalg.norm(walk.twist(time).linear) for time in times]
    place = np.array([walk.pose(time).position[0] for time in times])
    assert np.abs(place[times < 2.0]).max() < 1e-3 and 0.8 < max(speed) < 1.1
    assert place.max() == pytest.approx(1.0, abs=2e-3)
    assert place[-1] == pytest.approx(stated["positions"][-1][0], abs=2e-3)


def helix(turns: float = 2.0, radius: float = 8.0, climb: float = 3.0) -> np.ndarray:
    turn = np.linspace(0.0, 2.0 * np.pi * turns, int(48 * turns) + 1)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), climb * turn / (2.0 * np.pi)])


@pytest.mark.parametrize("body", [CAR, WALKER])
def test_a_shifted_way_up_a_ramp_that_winds_stays_on_its_level(body: ActorBody) -> None:
    points = helix()
    times = np.linspace(0.0, 80.0, len(points))
    ways = [
        motion(body, jitter, positions=points.tolist(), times=times.tolist()) for jitter in (None, Jitter(0.6, 0.2))
    ]
    heights = np.array([[way.pose(time).position[2] for time in np.arange(0.0, 80.0, 0.5)] for way in ways])
    assert np.abs(heights[1] - heights[0]).max() < 0.1  # 6 % of the shift up or down


@pytest.mark.parametrize(
    ("positions", "heights"),
    [
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [0.0, 0.0]),
        ([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [10.0, 0.0, 10.0]], [0.0, 10.0, 10.0]),
    ],
)
def test_who_stands_or_goes_straight_up_keeps_the_heights_when_shifted(positions: list, heights: list[float]) -> None:
    stated = {"positions": positions, "times": [4.0 * k for k in range(len(positions))]}
    drive = motion(CAR, Jitter(0.5, 0.1), **stated, yaw_deg=np.linspace(0.0, 90.0, len(positions)).tolist())
    for time, point, height in zip(stated["times"], positions, heights, strict=True):
        place = drive.pose(time).position
        assert place == pytest.approx([point[0] + 0.5, 0.1, height])


def test_a_shift_is_further_than_the_pieces_of_a_ramp_are_long() -> None:
    ramp = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.2, 0.0, 0.05], [2.4, 0.0, 0.12], [8.0, 0.0, 0.12]])
    moved, ground = shifted_way(ramp, np.array([1.0, 0.0, 0.0]))
    assert moved[:, 2] == pytest.approx([0.0, 0.12, 0.12, 0.12, 0.12]) and ground is not None
    back, _ = shifted_way(ramp, np.array([-0.3, 0.0, 0.0]))
    assert back[:, 2] == pytest.approx([0.0, 0.0, 0.0, 0.025, 0.12])
    over = np.concatenate([ramp, [[8.0, 3.0, 3.0], [2.1, 0.0, 3.0]]])
    assert shifted_way(over, np.array([0.1, 0.0, 0.0]))[1] is None
