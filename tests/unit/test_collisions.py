"""Collisions of boxes with known answers; checks of motion; and of the ground in a scene of the package."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.engine.load import load_scene
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.checks.motion import (
    check_extent,
    check_ground,
    check_motion,
    contacts,
    ground_heights,
    scene_extent,
)
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory, WaypointTrajectory


def stands(x: float, y: float, yaw_deg: float = 0.0, z: float = 0.0) -> StaticTrajectory:
    return StaticTrajectory(Pose.from_euler([x, y, z], yaw=np.radians(yaw_deg)))


def moves(x: float, speed: float, y: float = 0.0) -> ConstantTwistTrajectory:
    return ConstantTwistTrajectory(Pose.from_euler([x, y, 0.0]), Twist([speed, 0.0, 0.0]))


def test_first_time_and_depth() -> None:
    # fronts of 4 m boxes at 10 m/s: the gap of 26 m is closed after 2.6 s
    times = np.arange(0.0, 4.0, 0.05)
    (hit,) = find_collisions([("a", moves(0.0, 10.0), (4.0, 2.0)), ("b", stands(30.0, 0.3), (4.0, 2.0))], times)
    assert (hit.first, hit.second) == ("a", "b")
    assert hit.time == pytest.approx(2.65, abs=0.051)
    assert hit.depth == pytest.approx(1.7)  # the widths overlap by 2 - 0.3 m, once the lengths overlap by more
    assert hit.last == pytest.approx(3.35, abs=0.051)


@pytest.mark.parametrize(("gap", "touch"), [(-1e-6, True), (1e-6, False)])
@pytest.mark.parametrize("yaw_deg", [0.0, 37.0, 90.0])
def test_boxes_that_just_touch(gap: float, touch: bool, yaw_deg: float) -> None:
    # a corner of a turned box towards the flat side of another one: its reach is (l |cos| + w |sin|) / 2
    angle = np.radians(yaw_deg)
    reach = (4.0 * abs(np.cos(angle)) + 2.0 * abs(np.sin(angle))) / 2.0
    actors = [("a", stands(0.0, 0.0), (4.0, 2.0)), ("b", stands(2.0 + reach + gap, 0.1, yaw_deg), (4.0, 2.0))]
    assert bool(find_collisions(actors, [0.0])) is touch


def test_corners_that_circles_do_not_tell() -> None:
    # two crossed long boxes whose circles overlap, but not the boxes
    actors = [
        ("a", stands(0.0, 0.0), (12.0, 2.0)),
        ("b", stands(0.0, 7.1, 90.0), (12.0, 2.0)),
        ("c", stands(7.2, 3.0, 90.0), (6.0, 2.0)),
    ]
    assert find_collisions(actors, [0.0]) == []


def test_heights_and_times_count() -> None:
    bridge = ("bridge", stands(0.0, 0.0, z=4.5), (10.0, 10.0, 1.0))
    assert find_collisions([("car", stands(0.0, 0.0), (4.0, 2.0, 1.5)), bridge], [0.0]) == []
    assert len(find_collisions([("lorry", stands(0.0, 0.0), (8.0, 2.5, 4.6)), bridge], [0.0])) == 1
    late = WaypointTrajectory([5.0, 6.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert find_collisions([("a", late, (4.0, 2.0)), ("b", stands(0.0, 0.0), (4.0, 2.0))], [0.0, 4.9]) == []


@given(st.floats(-6.0, 6.0), st.floats(-6.0, 6.0), st.floats(0.0, 360.0), st.floats(0.0, 360.0))
def test_agrees_with_points(x: float, y: float, first: float, second: float) -> None:
    """Independent answer: a dense grid of points of one box lies in the other one or not."""
    pair = [("a", stands(0.0, 0.0, first), (4.0, 2.0)), ("b", stands(x, y, second), (5.0, 1.6))]
    found = find_collisions(pair, [0.0])
    grid = np.stack(np.meshgrid(np.linspace(-2.5, 2.5, 101), np.linspace(-0.8, 0.8, 33), [0.0]), -1).reshape(-1, 3)
    local = pair[0][1].world_from_actor.inverse().apply(pair[1][1].world_from_actor.apply(grid))
    inside = bool(np.any((np.abs(local[:, 0]) < 2.0) & (np.abs(local[:, 1]) < 1.0)))
    if inside:
        assert found
    elif found:
        assert found[0].depth < 0.08  # between the points of the grid, 5 cm apart


def test_arguments() -> None:
    with pytest.raises(ParameterRangeError, match="every name once"):
        find_collisions([("a", stands(0.0, 0.0), (4.0, 2.0))] * 2, [0.0])
    with pytest.raises(ParameterRangeError, match="measures of 'a'"):
        find_collisions([("a", stands(0.0, 0.0), (4.0, -2.0)), ("b", stands(0.0, 9.0), (4.0, 2.0))], [0.0])
    with pytest.raises(ParameterRangeError, match="times"):
        find_collisions([], [])


def test_motion_faults() -> None:
    class Jumps(ConstantTwistTrajectory):
        def pose(self, time: float) -> Pose:
            return Pose(super().pose(time).position + [0.0, 1.0 if time > 2.0 else 0.0, 0.0])

    times = np.arange(0.0, 5.0, 0.05)
    jumping = Jumps(Pose(), Twist([10.0, 0.0, 0.0]))
    assert check_motion([("steady", moves(0.0, 10.0))], times) == []
    (fault,) = check_motion([("a", jumping)], times)
    assert (fault.what, fault.time) == ("jump", pytest.approx(2.0)) and fault.value == pytest.approx(1.0)
    (fast,) = check_motion([("a", moves(0.0, 80.0))], times)
    assert fast.what == "speed" and fast.value == pytest.approx(80.0)
    hard = WaypointTrajectory([0.0, 1.0, 2.0], [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [30.0, 0.0, 0.0]])
    assert {fault.what for fault in check_motion([("a", hard)], times)} == {"acceleration"}


def test_ground_and_extent_of_a_scene() -> None:
    world = load_scene("urban_crossing")
    car = ActorBody()
    low, high = scene_extent(world)
    spot = world.at(0.0).actor_pose("car_ahead").position
    right = StaticTrajectory(Pose(spot))  # its own mesh stands there, too, and is no ground
    actors = [
        (name, StaticTrajectory(Pose(spot + [0.0, 0.0, lift])), car)
        for name, lift in (("floats", 0.2), ("sinks", -0.3), ("stands", 0.02))
    ]
    faults = {fault.name: fault.height for fault in check_ground(world, [("right", right, car), *actors], [0.0])}
    assert set(faults) == {"floats", "sinks"}
    assert faults["floats"] == pytest.approx(0.2, abs=0.02) and faults["sinks"] == pytest.approx(-0.3, abs=0.02)
    away = (high + [50.0, 0.0, 0.0]) * [1.0, 1.0, 0.0]
    assert ground_heights(world, [away])[0] == -np.inf
    assert check_extent(world, [("in", right, car), ("out", StaticTrajectory(Pose(away)), car)], [0.0, 1.0]) == [
        ("out", 0.0)
    ]
    assert check_ground(world, [("out", StaticTrajectory(Pose(away)), car)], [0.0])[0].height == np.inf
    assert np.all(low < high)
    assert len(contacts(car)) == 4
