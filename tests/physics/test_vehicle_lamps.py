"""Brake lamps and indicators of vehicles: lit by what the trajectory does, with the light that regulations ask for."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.light.lamps import BRAKE_INTENSITY, INDICATOR_INTENSITY, parked_shapes
from scarl_sionna.engine.light.sky import LUMINANCE_WEIGHTS, UNIT_LUMINANCE
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.paths import LateralShift
from scarl_sionna.scenario.motion.routes import Route, vehicle_trajectory
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import lanes_from_tables
from scarl_sionna.scene.motion.signalling import BRAKING, indicated, is_braking, is_flash, is_parked
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory, WaypointTrajectory
from tests.scenes import Thing, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has, too much memory

TIMES = np.linspace(0.0, 12.0, 241)
STEADY = ConstantTwistTrajectory(Pose(), Twist([10.0, 0.0, 0.0]), 0.0, 12.0)


def along(x, y=None):
    """Return the trajectory through positions at `TIMES`."""
    y = np.zeros_like(x) if y is None else y
    return WaypointTrajectory(TIMES, np.column_stack([x, y, np.zeros_like(x)]))


def slowing(rate: float):
    """Return 15 m/s up to 4 s, then a deceleration up to 6 s, and on with what is left."""
    t = np.clip(TIMES - 4.0, 0.0, 2.0)
    return along(15.0 * TIMES - 0.5 * rate * t**2 - rate * t.max() * np.clip(TIMES - 6.0, 0.0, None))


def lane_change(shift: float, speed: float = 15.0):
    """Return a cosine from 4 to 7 s."""
    share = np.clip((TIMES - 4.0) / 3.0, 0.0, 1.0)
    return along(speed * TIMES, shift * 0.5 * (1.0 - np.cos(np.pi * share)))


def arc(radius: float, speed: float, turn: float = np.inf):
    """Return a bend to the left from the start, that ends after `turn` [rad]."""
    angle = np.minimum(speed * TIMES / radius, turn)
    rest = speed * TIMES - angle * radius
    return along(radius * np.sin(angle) + rest * np.cos(angle), radius * (1.0 - np.cos(angle)) + rest * np.sin(angle))


@pytest.mark.parametrize(("rate", "lit"), [(0.8 * BRAKING, False), (1.2 * BRAKING, True), (6.0, True)])
def test_brakes_show_while_it_gets_slower(rate, lit):
    way = slowing(rate)
    assert [is_braking(way, t) for t in (1.0, 3.5, 5.0, 7.0)] == [False, False, lit, False]


def test_speeding_up_shows_nothing_and_standing_does():
    way = along(np.where(TIMES < 4.0, 0.0, 0.5 * 2.0 * (TIMES - 4.0) ** 2))
    assert [is_braking(way, t) for t in (1.0, 3.0, 6.0, 11.0)] == [True, True, False, False]
    assert is_parked(StaticTrajectory(Pose())) and not is_braking(StaticTrajectory(Pose()), 0.0)


@pytest.mark.parametrize(("shift", "side"), [(3.5, "left"), (-3.5, "right"), (0.6, None)])
def test_a_change_of_lane_is_indicated_before_and_while_it_lasts(shift, side):
    way = lane_change(shift)
    assert [indicated(way, t) for t in (1.0, 3.2, 4.5, 5.5, 9.5)] == [None, side, side, side, None]


@pytest.mark.parametrize(("radius", "speed"), [(60.0, 9.0), (150.0, 17.0), (500.0, 30.0)])
def test_no_bend_of_the_road_is_a_change_of_lane(radius, speed):
    """An arc ends on the mean of its headings from where it begins: the chord's direction."""
    assert {indicated(arc(radius, speed), t) for t in np.linspace(0.0, 12.0, 49)} == {None}


def swinging(shifts=()):
    """Return a drive at 15 m/s along a lane that swings 3.5 m to the left from 60 to 105 m, and changes beside it."""
    x = np.arange(0.0, 301.0)
    share = np.clip((x - 60.0) / 45.0, 0.0, 1.0)
    points = np.column_stack([x, 3.5 * 0.5 * (1.0 - np.cos(np.pi * share)), np.zeros_like(x)])
    network = lanes_from_tables([{"name": "a", "points": points.tolist()}])
    return points, Route(network, ["a"], shifts=shifts).trajectory(5.0, 15.0, model=ActorBody(), duration=12.0)


def test_a_road_that_swings_aside_is_no_change_of_lane():
    """By points alone it looks like one; who leaves the swinging lane for the next one indicates."""
    points, way = swinging()
    times = np.linspace(0.5, 11.5, 45)
    assert {indicated(way, t) for t in times} == {None}
    assert "left" in {
        indicated(vehicle_trajectory(points[5:185], speed=15.0, model=ActorBody()), t) for t in times[:-4]
    }
    _, changing = swinging([LateralShift(100.0, 45.0, -3.5)])
    assert [indicated(changing, t) for t in (0.5, 6.0, 7.5, 11.0)] == [None, "right", "right", None]
    hidden = PresentTrajectory(changing, (0.0, 12.0))
    assert indicated(hidden, 6.0) == "right"


def test_a_turn_is_indicated():
    way = arc(10.0, 4.0, np.pi / 2)  # 90 deg in 3.9 s
    assert indicated(way, 1.0) == "left"
    assert indicated(way, 9.0) is None


def test_indicators_flash_as_often_as_the_law_asks():
    times = np.arange(0.0, 60.0, 0.01) + 0.005
    lit = np.array([is_flash(t) for t in times])
    assert 60 <= np.count_nonzero(lit[1:] & ~lit[:-1]) + 1 <= 120
    assert lit.mean() == pytest.approx(0.5, abs=0.01)


def radiance(world, time, shape):
    """Return the luminance of a glowing shape [cd/m2]; None where it is no lamp."""
    scene = world.at(time).optical_scene()
    with variant.optical() as mi:
        params = mi.traverse(scene)
        key = f"{shape}.emitter.radiance.value"
        if key not in params:
            return None
        return float(np.array(params[key], dtype=np.float64).ravel() @ LUMINANCE_WEIGHTS) * UNIT_LUMINANCE


def seen_from(world, part, axis):
    """Return the area of a part's faces that look along an axis [m2]: what is seen of it from there."""
    mesh = world.mesh(world.parts.name.index(part))
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.abs(np.cross(b - a, c - a)[:, axis]).sum() / 4.0)


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Return a function that gives a world with a car on a trajectory under a lighting, on a bare road."""
    road = Thing("road", plane(400.0, 60.0), "Roads", is_object=False)
    base = ss.load_scene(write_scene(tmp_path_factory.mktemp("street"), [road]))

    def with_car(trajectory, preset):
        world = ss.stage(base, [ss.StagedActor("it", "saloon", trajectory)])
        return world.with_lighting(Lighting.preset(preset))

    return with_car


def test_a_car_that_brakes_has_its_lamps_intensity_by_day_and_night(street):
    for preset, rest in (("day", 0.0), ("night", 16.0)):
        world = street(slowing(5.0), preset)
        area = seen_from(world, "it_taillamps", 0)
        assert radiance(world, 5.0, "it_taillamps") * area == pytest.approx(2.0 * BRAKE_INTENSITY, rel=1e-3)
        assert radiance(world, 2.0, "it_taillamps") * area == pytest.approx(rest, rel=1e-3)
        assert (radiance(world, 2.0, "it_headlamps") is not None) == (preset == "night")


def test_an_indicator_blinks_on_its_side(street):
    world = street(lane_change(3.5), "day")
    times = (4.5, 4.5 + 1.0 / 3.0)
    assert [is_flash(t) for t in times] == [False, True]
    shown = [radiance(world, t, "it_indicators_left") for t in times]
    assert shown[0] == 0.0
    largest = max(seen_from(world, "it_indicators_left", axis) for axis in range(3))
    assert shown[1] * largest == pytest.approx(INDICATOR_INTENSITY, rel=1e-3)
    assert radiance(world, times[1], "it_indicators_right") == 0.0


def test_a_parked_car_is_dark_and_a_steady_one_adds_no_lamp_by_day(street):
    parked = street(StaticTrajectory(Pose()), "night")
    assert radiance(parked, 0.0, "it_headlamps") is radiance(parked, 0.0, "it_taillamps") is None
    assert radiance(street(STEADY, "day"), 1.0, "it_taillamps") is None
    assert radiance(street(STEADY, "night"), 1.0, "it_taillamps") > 0.0


def test_vehicles_that_are_objects_of_a_place_are_parked():
    document = read_document(find_scene("urban_crossing"))
    kinds = {shape: document.materials[bsdf].lamp for shape, bsdf in document.bsdf_of_shape.items()}
    lamps = {shape for shape, lamp in kinds.items() if lamp in ("headlamp", "taillamp")}
    dark = lamps & parked_shapes(document)
    assert len(dark) == 14 and all(shape.startswith("parked_") for shape in dark)
    assert {"ego_headlamps", "oncoming_taillamps"} <= lamps - dark


def test_cars_in_bays_are_parked():
    document = read_document(find_scene("parking_garage"))
    lamps = {shape for shape, bsdf in document.bsdf_of_shape.items() if document.materials[bsdf].lamp}
    dark = lamps & parked_shapes(document)
    assert len(dark) == 2 * 12 and all(shape.startswith("parked_") for shape in dark)
    assert {"ego_headlamps", "car_ahead_taillamps"} <= lamps - dark
