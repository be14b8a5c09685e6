"""Motions of a scenario through stated points: turning back on foot, stated headings at one speed, shifted kerbs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ScenarioPlace
from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody
from scarl_sionna.scenario.motion.motions import Setting, trajectory_of
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
