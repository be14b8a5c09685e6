"""Wheels of the ready scenarios stand on the ground; what drives backwards over a kerb follows it."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import OutsideSceneError, ParameterRangeError, ScenarioValueError
from scarl_sionna.core.pose import Pose
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from scarl_sionna.scenario.checks.motion import check_ground, contacts, ground_heights
from scarl_sionna.scenario.compose import build_world, compose
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.ground import GroundLine
from scarl_sionna.scenario.motion.paths import SmoothPath
from scarl_sionna.scenario.motion.routes import timed_trajectory
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, is_present, road_pose
from scenes_xml import scene_names

CONTACT = 0.01
"""Distance of a wheel from the ground below it that is allowed [m]."""
BANKED = {"oncoming_overtaker": 0.035}
"""Where roads fall to both sides and vehicles, which do not roll, stand level [m]: by 2 to 2.5 %."""
PATCH = 0.005
"""Rays this far to both sides of the middle of a wheel: one alone may fall through the joint of two meshes [m]."""
HALF_TRACK, BASE = 0.72, 2.7  # of the default body [m]
HALF_BUS = 1.15
"""From the middle of a bus's or lorry's axle to the outside of its tyres [m]."""
CAR = ActorBody()


def below(world: World, points: np.ndarray) -> np.ndarray:
    """Return the height of the ground below points: the highest of three along y."""
    return np.max([ground_heights(world, points + [0.0, side, 0.0]) for side in (-PATCH, 0.0, PATCH)], axis=0)


def wheels_off(world: World, name: str, step: float) -> dict[str, float]:
    """Return the largest distance of a wheel from the ground [m], by vehicle."""
    spec, found = ScenarioSpec.preset(name), {}
    for member in compose(spec).members:
        motion, feet = member.actor.trajectory, contacts(member.body)
        if len(feet) == 1:
            continue  # on foot
        times = np.arange(spec.times[0], spec.times[-1], step)[: 1 if isinstance(motion, StaticTrajectory) else None]
        points = [road_pose(motion, time).apply(feet) for time in times.tolist() if is_present(motion, time)]
        if points:
            whole = np.concatenate(points)
            found[member.actor.name] = float(np.abs(whole[:, 2] - below(world, whole)).max())
    return found


@pytest.fixture(scope="module")
def drive() -> World:
    return build_world(ScenarioSpec.preset("backing_out_of_a_drive"))


def test_a_car_that_backs_out_of_a_drive_stands_on_its_wheels(drive) -> None:
    off = wheels_off(drive, "backing_out_of_a_drive", 0.25)
    assert "backing" in off and max(off.values()) < CONTACT, off


@pytest.mark.some(6)
@pytest.mark.slow
@pytest.mark.parametrize("name", scenario_names())
def test_wheels_of_all_scenarios_stand_on_the_ground(name) -> None:
    off = wheels_off(build_world(ScenarioSpec.preset(name)), name, 0.01)
    assert max(off.values()) < BANKED.get(name, CONTACT), off


@pytest.mark.some(3)
@pytest.mark.slow
@pytest.mark.parametrize("scene", scene_names())
def test_rear_wheels_of_all_that_drives_find_room_beside_the_middle_of_lanes(scene) -> None:
    world = load_scene(scene, detail="light")
    network = world.document.lanes
    for lane in () if network is None else network.lanes:
        if lane.kind != "drive":
            continue
        way = np.linspace(0.5, lane.length - 0.5, max(int(2.0 * lane.length), 2))
        line = SmoothPath(lane.points).at(way)
        ahead = np.gradient(line[:, :2], way, axis=0)
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.linalg.norm(ahead, axis=1, keepdims=True)
        for side in (-HALF_BUS, HALF_BUS):
            off = np.abs(ground_heights(world, line + np.pad(side * left, ((0, 0), (0, 1)))) - line[:, 2])
            assert off.max() < 0.05, (lane.name, line[off.argmax()].round(1), off.max())  # a road falls by 2.5 %


def test_a_wheel_in_a_kerb_is_no_place() -> None:
    spec = ScenarioSpec.preset("backing_out_of_a_drive")
    level = spec.actors[0].trajectory.with_(reverse=False, ground=None, yaw_deg=(90.0,) * 8)
    sunk = spec.with_(actors=(spec.actors[0].with_(trajectory=level), *spec.actors[1:]))
    with pytest.raises(OutsideSceneError, match="'backing' is 0.1[0-9]* m above the ground"):
        build_world(sunk)


def test_one_wheel_alone_is_a_fault(drive) -> None:
    pose = drive.at(0.0).actor_pose("ego")
    tilted = Pose.from_euler(pose.position, yaw=pose.yaw, roll=np.radians(9.0))
    actors = [("tilted", StaticTrajectory(tilted), CAR)]
    (fault,) = check_ground(drive, actors, [0.0])
    assert abs(fault.height) == pytest.approx(HALF_TRACK * np.sin(np.radians(9.0)), abs=0.01)
    assert check_ground(drive, actors, [0.0], wheel=0.2) == []


RAMP = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0, 0.0, 0.3], [30.0, 0.0, 0.3]]


def test_both_axles_of_a_car_that_drives_backwards_follow_the_ground() -> None:
    ground = GroundLine(RAMP)
    times, ways = np.array([0.0, 2.0, 4.0, 6.0, 8.0]), [[x, 0.0, 9.0] for x in (12.0, 10.0, 7.0, 4.0, 2.5)]
    motion = timed_trajectory(ways, times, CAR, ground=ground, reverse=True)
    for time, (x, _, _) in zip(times.tolist(), ways, strict=True):
        assert motion.pose(time).position[0] == pytest.approx(x, abs=0.01)
        np.testing.assert_allclose(motion.pose(time).yaw, 0.0, atol=1e-9)  # it looks along +x and goes along -x
    assert np.all(motion.forward_speeds(np.linspace(0.5, 7.5, 20)) < 0.0)
    for time in np.linspace(0.0, 8.0, 41):
        axles = motion.pose(time).apply([[CAR.rear_axle, 0.0, 0.0], [CAR.rear_axle + BASE, 0.0, 0.0]])
        np.testing.assert_allclose(axles[:, 2], ground(axles[:, :2]), atol=0.003)  # rounded at the corners
        if 1e-3 < time < 8.0 - 1e-3:
            before, after = (motion.pose(time + shift) for shift in (-1e-4, 1e-4))
            rate = (after.position - before.position) / 2e-4
            np.testing.assert_allclose(rate, motion.twist(time).linear, atol=1e-4)


def test_a_ground_line_is_straight_between_its_points_and_level_beyond() -> None:
    ground = GroundLine(RAMP)
    np.testing.assert_allclose(ground([[-3.0, 0.5], [3.5, -1.0], [4.0, 0.0], [99.0, 0.0]]), [0.0, 0.15, 0.2, 0.3])
    with pytest.raises(ParameterRangeError, match="twice in a row"):
        GroundLine([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(ParameterRangeError, match="shape"):
        GroundLine([[0.0, 0.0, 0.0]])


def test_backwards_needs_times_and_states_no_headings() -> None:
    base = {"kind": "waypoints", "positions": [[0, 0], [5, 0]], "reverse": True}
    for wrong in ({"speed": 2.0}, {"times": [0, 3], "yaw_deg": [0, 0]}):
        with pytest.raises(ScenarioValueError, match="`reverse` and `ground` with `times` and without `yaw_deg`"):
            ScenarioSpec(scene="urban_crossing", actors=[{"name": "a", "model": "suv", "trajectory": base | wrong}])


def _ground(folder, *planes: str) -> World:
    """Return a world of planes of concrete, each by the `to_world` of a square of 2 m."""
    shapes = "".join(
        f'<shape type="rectangle" id="ground_{index}"><transform name="to_world">{plane}</transform>'
        '<ref id="concrete"/></shape>'
        for index, plane in enumerate(planes)
    )
    bsdf = '<bsdf type="twosided" id="concrete"><bsdf type="diffuse"/></bsdf>'
    path = folder / "ground.xml"
    path.write_text(f'<scene version="3.0.0">{bsdf}{shapes}</scene>')
    return load_scene(path)


@pytest.mark.parametrize(("slope", "stands"), [(0.08, True), (0.12, True), (0.3, False)])
def test_a_banked_road_is_ground_to_stand_on_and_a_bank_is_none(tmp_path, slope: float, stands: bool) -> None:
    angle = np.degrees(np.arctan(slope))
    world = _ground(tmp_path, f'<scale value="20"/><rotate x="1" angle="{angle}"/>')
    car = [("car", StaticTrajectory(Pose(np.zeros(3))), CAR)]
    assert (check_ground(world, car, [0.0], 0.2) == []) is stands


def test_wheels_on_both_sides_of_a_kerb_are_found(tmp_path) -> None:
    half = '<scale x="20" y="10"/><translate y="{y}" z="{z}"/>'
    world = _ground(tmp_path, half.format(y=10.0, z=0.1), half.format(y=-10.0, z=-0.1))
    faults = check_ground(world, [("car", StaticTrajectory(Pose(np.zeros(3))), CAR)], [0.0], 0.2)
    assert [abs(fault.height) for fault in faults] == pytest.approx([0.1], abs=1e-3)
