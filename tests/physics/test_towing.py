"""Towed trailers: steady bends and straight ways in closed form, axles that do not slip, velocities as derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.motion.bodies import ActorBody, TrailerBody
from scarl_sionna.scenario.motion.paths import PathTrajectory
from scarl_sionna.scenario.motion.profiles import SpeedProfile
from scarl_sionna.scenario.motion.routes import timed_trajectory, vehicle_trajectory
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.motion.articulation import Joint, joints_from_tables, joints_on
from scarl_sionna.scene.motion.towing import Towing
from scarl_sionna.scene.motion.trajectory import ConstantTwistTrajectory, StaticTrajectory, Trajectory

TRACTOR = ActorBody(16.5, 2.55, 4.0, 3.8, 3.05)
AHEAD, LENGTH, HEIGHT = 0.6, 7.7, 1.15
HITCH = (TRACTOR.rear_axle + AHEAD, 0.0, HEIGHT)
TABLES = [
    {"kind": "trailer", "shapes": ["box"], "hitch": HITCH, "length": LENGTH, "span": [-8.25, 5.35]},
    {"kind": "wheel", "shapes": ["left"], "center": [HITCH[0] - LENGTH, 1.05, 0.5], "radius": 0.5, "towed": True},
    {"kind": "wheel", "shapes": ["right"], "center": [HITCH[0] - LENGTH, -1.05, 0.5], "radius": 0.5, "towed": True},
]


def joints(trajectory: Trajectory) -> tuple[Joint, ...]:
    return joints_from_tables(TABLES, "lorry", ["box", "left", "right"], trajectory)


class Circle:
    """A lorry whose drive axle goes round a circle, to the left where the radius is positive; known for all times."""

    start, stop = -np.inf, np.inf

    def __init__(self, radius: float, speed: float = 5.0) -> None:
        self.radius, self.rate = radius, speed / radius

    def pose(self, time: float) -> Pose:
        turn = self.rate * time
        axle = self.radius * np.array([np.sin(turn), 1.0 - np.cos(turn), 0.0])
        return Pose.from_euler(axle - TRACTOR.rear_axle * np.array([np.cos(turn), np.sin(turn), 0.0]), yaw=turn)

    def twist(self, time: float) -> Twist:
        turn = self.rate * time
        along, left = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0]])
        return Twist(self.rate * (self.radius * along - TRACTOR.rear_axle * left), [0.0, 0.0, self.rate])


def test_a_steady_motion_is_known_at_once_at_the_clock_of_unix() -> None:
    now, angle = 1.7e9 + 0.25, 0.1
    stands = Towing(StaticTrajectory(Pose()), HITCH, LENGTH).at(now)
    assert (stands.angle, stands.way, stands.turned) == (0.0, 0.0, 0.0)
    going = ConstantTwistTrajectory(Pose.from_euler(np.zeros(3), yaw=-angle), Twist([6.0, 0.0, 0.0]))
    for motion in (going, PresentTrajectory(going, (0.0, 2e9))):
        towed = Towing(motion, HITCH, LENGTH).at(now)
        assert (towed.angle, towed.way) == (pytest.approx(angle, abs=1e-12), pytest.approx(6.0 * now, rel=1e-12))
    with pytest.raises(ParameterRangeError, match="within 250000 s of 0 s"):
        Towing(Circle(30.0), HITCH, LENGTH).at(now)


def slalom() -> PathTrajectory:
    """Return a way with bends of down to 12 m over a hill and a valley of 5 %, with a stop."""
    x = np.arange(0.0, 121.0, 2.0)
    points = np.column_stack([x, 5.0 * np.sin(x / 9.0), 1.0 * np.sin(x / 20.0)])
    return vehicle_trajectory(points, speed=SpeedProfile(6.0).hold(3.0).reach(3.0, 2.0, 4.0), model=TRACTOR)


@pytest.mark.parametrize("radius", [12.0, 30.0, 200.0, -30.0])
def test_in_a_steady_bend_the_axles_go_round_one_centre(radius: float) -> None:
    """Right triangles at the coupling: tan of one angle is AHEAD / R, sin of the other LENGTH / sqrt(R^2 + AHEAD^2)."""
    exact = np.arctan(AHEAD / radius) - np.arcsin(LENGTH / np.hypot(radius, AHEAD)) * np.sign(radius)
    towing = Towing(Circle(radius), HITCH, LENGTH)
    for time in (-4.0, 0.0, 3.3, 20.0):
        assert towing.at(time).angle == pytest.approx(exact, abs=1e-9)
    inside = np.sqrt(radius**2 + AHEAD**2 - LENGTH**2) / abs(radius)
    assert towing.at(20.0).way == pytest.approx(20.0 * 5.0 * inside, rel=1e-9)


def test_on_the_straight_the_tangent_of_half_the_angle_decays_with_the_way() -> None:
    """tan(angle / 2) = tan(angle_0 / 2) exp(-s / LENGTH): the tractrix, after a bend."""

    class Bend:
        """A bend of 20 m until 0 s, then straight on, at 6 m/s."""

        start, stop = -1.0, 20.0

        def pose(self, time: float) -> Pose:
            return Circle(20.0, 6.0).pose(time) if time < 0.0 else Pose([6.0 * time - TRACTOR.rear_axle, 0.0, 0.0])

        def twist(self, time: float) -> Twist:
            return Circle(20.0, 6.0).twist(time) if time < 0.0 else Twist([6.0, 0.0, 0.0])

    towing = Towing(Bend(), HITCH, LENGTH)
    first = towing.at(0.25).angle
    assert first < -0.2
    for time in (0.3, 1.0, 5.0, 12.0):
        exact = 2.0 * np.arctan(np.tan(first / 2.0) * np.exp(-6.0 * (time - 0.25) / LENGTH))
        assert towing.at(time).angle == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("motion", [slalom(), Circle(15.0)], ids=["slalom", "circle"])
def test_what_touches_the_road_rests(motion) -> None:
    """On the level to the side, too; on hills of 5 % the trailer turns as on the level."""
    level = not np.isfinite(motion.start)
    parts = joints(motion)
    times = np.linspace(0.05, 15.0, 41) if level else np.linspace(0.1, motion.stop - 0.1, 41)
    for time in times.tolist():
        pose, twist = motion.pose(time), motion.twist(time)
        for joint in parts[1:]:
            moved = joint.motions(time)[joint.shapes[0]]
            trailer = parts[0].motions(time)["box"].pose
            below = trailer.apply(np.array(joint.center) - [0.0, 0.0, joint.radius])
            slip = pose.rotate(moved.twist.velocity_at(below - moved.pose.position))
            slip += twist.velocity_at(pose.rotate(below))
            across = pose.rotate(trailer.rotate([0.0, 1.0, 0.0]))
            along = pose.rotate(trailer.rotate([1.0, 0.0, 0.0]))
            assert abs(slip @ across) < (1e-7 if level else 0.02)
            assert abs(slip @ along) < (1e-7 if level else 0.05)


@pytest.mark.parametrize("motion", [slalom(), Circle(15.0)], ids=["slalom", "circle"])
def test_velocities_are_derivatives(motion) -> None:
    step, points = 1e-5, np.array([[-8.0, 1.2, 4.0], [HITCH[0] - LENGTH + 0.4, 1.05, 0.5]])
    parts = joints(motion)
    stop = min(motion.stop, 15.0)
    for time in np.linspace(0.05, stop - 0.05, 31).tolist():
        for joint in parts:
            now, later, earlier = (joint.motions(time + shift)[joint.shapes[0]] for shift in (0.0, step, -step))
            slope = (later.pose.apply(points) - earlier.pose.apply(points)) / (2.0 * step)
            places = now.pose.apply(points)
            exact = np.array([now.twist.velocity_at(place - now.pose.position) for place in places])
            np.testing.assert_allclose(exact, slope, atol=2e-5)


def test_the_axle_stands_on_the_road_over_hill_and_valley() -> None:
    """Off by its own track, 1 m beside the vehicle's on a slope of 5 %; in the vehicle's plane by over 10 cm."""
    motion, worst, level = slalom(), 0.0, 0.0
    trailer = joints(motion)[0]
    middle = np.array([HITCH[0] - LENGTH, 0.0, 0.0])
    for time in np.linspace(3.0, motion.stop - 0.1, 60).tolist():  # before its first point the road is level
        pose = motion.pose(time)
        place = pose.apply(trailer.motions(time)["box"].pose.apply(middle))
        worst = max(worst, abs(place[2] - np.sin(place[0] / 20.0)))
        level = max(level, abs(pose.apply(middle)[2] - np.sin(pose.apply(middle)[0] / 20.0)))
    assert worst < 0.03 and level > 0.10


def test_a_trailer_that_is_backed_round_a_bend_folds_and_one_that_is_backed_straight_does_not() -> None:
    points = [[0.0, 0.0, 0.0], [-10.0, 0.0, 0.0], [-20.0, 2.0, 0.0], [-28.0, 8.0, 0.0], [-32.0, 16.0, 0.0]]
    bent = timed_trajectory(points, [0.0, 5.0, 10.0, 15.0, 20.0], TRACTOR, reverse=True)
    towing = Towing(bent, HITCH, LENGTH, "the trailer of 'lorry'")
    with pytest.raises(ParameterRangeError, match="the trailer of 'lorry' at 1.* s"):
        for time in np.arange(0.0, 20.0, 0.25).tolist():
            towing.at(time)
    back = ConstantTwistTrajectory(Pose(), Twist([-2.0, 0.0, 0.0]), 0.0, 20.0)
    assert Towing(back, HITCH, LENGTH).at(19.0).angle == pytest.approx(0.0, abs=1e-9)
    assert Towing(back, HITCH, LENGTH).at(19.0).way == pytest.approx(-38.0)


def test_it_follows_another_way_and_stands_in_a_bend_as_it_came() -> None:
    motion = slalom()
    moved = joints_on(joints(StaticTrajectory(Pose())), PresentTrajectory(motion, (2.0, 5.0)))
    for one, other in zip(moved, joints(motion), strict=True):
        found, wanted = (joint.motions(6.0)[joint.shapes[0]].pose for joint in (one, other))
        np.testing.assert_allclose(found.apply([1.0, 2.0, 3.0]), wanted.apply([1.0, 2.0, 3.0]), atol=1e-9)
    np.testing.assert_allclose(joints(StaticTrajectory(Pose()))[0].motions(3.0)["box"].pose.position, 0.0, atol=1e-12)


def test_tables_that_cannot_be() -> None:
    def made(*tables):
        return joints_from_tables(tables, "lorry", ["box", "left", "right"], StaticTrajectory(Pose()))

    with pytest.raises(ParameterRangeError, match=r"joints\[0\].towed"):
        made(TABLES[1])
    with pytest.raises(ParameterRangeError, match="one trailer"):
        made(TABLES[0], TABLES[0])
    with pytest.raises(ParameterRangeError, match="length"):
        made({**TABLES[0], "length": 0.0})
    with pytest.raises(ParameterRangeError, match="hitch"):
        made({**TABLES[0], "hitch": [1.0, 0.0]})
    with pytest.raises(ParameterRangeError, match="span"):
        made({**TABLES[0], "span": [5.35, -8.25]})
    with pytest.raises(UnknownNameError, match="wall"):
        made({**TABLES[0], "shapes": ["wall"]})


def test_a_trailer_touches_what_stands_inside_of_its_bend_and_not_what_stands_behind_the_vehicle() -> None:
    body = ActorBody(16.5, 2.55, 4.0, 3.72, TRACTOR.rear_axle, trailer=TrailerBody(HITCH[0], LENGTH, -8.25, 5.34))
    here = Circle(15.0).pose(3.0)
    inside, behind, far = (
        StaticTrajectory(Pose(here.apply(spot))) for spot in ([-6.5, 5.5, 0], [-7, -1, 0], [-7, 9, 0])
    )
    others = [("inside", inside, (1.0, 1.0)), ("behind", behind, (1.0, 1.0)), ("far", far, (1.0, 1.0))]
    hits = find_collisions([("lorry", Circle(15.0), body), *others], [3.0])
    assert [(hit.first, hit.second) for hit in hits] == [("lorry", "inside")]
    rigid = find_collisions([("lorry", Circle(15.0), replace(body, trailer=None)), *others], [3.0])
    assert [(hit.first, hit.second) for hit in rigid] == [("lorry", "behind")]


def test_the_articulated_lorry_in_a_world(tmp_path) -> None:
    """Velocities of vertices are their derivatives, tyres stand on the road, and the box of the track stays."""
    (tmp_path / "road.xml").write_text(
        """<scene version="3.0.0"><bsdf type="diffuse" id="asphalt"/><shape type="rectangle" id="road">
        <transform name="to_world"><scale value="200"/></transform><ref id="asphalt" name="bsdf"/></shape></scene>""",
        encoding="utf-8",
    )
    model = read_actor_model("articulated_lorry")
    angle = np.linspace(0.0, 4.0, 80)
    points = np.column_stack([20.0 * np.sin(angle), 20.0 - 20.0 * np.cos(angle), 0.0 * angle])
    motion = vehicle_trajectory(points, speed=5.0, model=ActorBody.of(model))
    world = ss.stage(tmp_path / "road.xml", [ss.StagedActor("it", model, motion, detail="light")])
    time, step = 6.0, 1e-4
    before, state, after = (world.at(time + shift) for shift in (-step, 0.0, step))
    bend = model.joints[0]["length"] / np.hypot(20.0, 0.6)
    trailer = world.parts.name.index("it_load_box")
    yaw = state.part_pose(trailer).yaw - state.actor_pose("it").yaw
    assert np.remainder(yaw, 2.0 * np.pi) - 2.0 * np.pi == pytest.approx(
        np.arctan(0.6 / 20.0) - np.arcsin(bend), abs=2e-3
    )
    for part in np.flatnonzero(world.parts.actor >= 0).tolist():
        corners = world.mesh(part).vertices[:: max(len(world.mesh(part).vertices) // 9, 1)]
        first, places, last = (moment.part_pose(part).apply(corners) for moment in (before, state, after))
        found = state.point_velocity(np.full(len(places), part), places)
        np.testing.assert_allclose(found, (last - first) / (2.0 * step), atol=2e-3)
        if world.parts.name[part].startswith("it_wheel"):
            assert state.part_pose(part).apply(world.mesh(part).vertices)[:, 2].min() == pytest.approx(0.0, abs=0.02)
    (box,) = (box for box in state.boxes() if box.name == "it")
    np.testing.assert_allclose(box.size, [16.5, 2.55, 4.0], atol=0.06)
    assert box.tight_size[1] > box.size[1] + 3.0 and box.tight_center[1] > 1.0  # to the inside of the bend
