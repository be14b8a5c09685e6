"""Accelerations, jerks, bends and overlaps of the ready scenarios, and of traffic, at 100 Hz."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.paths import SmoothPath, sample_motion
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.spec.scenario import ScenarioSpec, scenario_names
from scarl_sionna.scenario.traffic.bends import LATERAL, bend_speeds
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.motion.trajectory import Trajectory

STEP = 0.01
"""Between two velocities [s]."""
HARDEST = 8.1
"""What brakes give, 8 m/s^2, and what a body's middle turns beside it [m/s^2]."""
JERK = 25.5
"""Of an emergency, 25 m/s^3, at the body's middle [m/s^3]."""
CAR = ActorBody()


def strains(motion: Trajectory, first: float, last: float) -> tuple[float, float, float]:
    """Return the largest acceleration along and across the heading [m/s^2], and jerk [m/s^3], of a body's origin."""
    times = np.arange(max(first, motion.start), min(last, motion.stop), STEP)
    if len(times) < 5:
        return 0.0, 0.0, 0.0
    found = sample_motion(motion, times)
    along = np.stack([np.cos(found.heading), np.sin(found.heading)], axis=1)
    pull = np.gradient(found.velocity[:, :2], STEP, axis=0)
    across = pull[:, 1] * along[:, 0] - pull[:, 0] * along[:, 1]
    jerk = np.linalg.norm(np.gradient(pull, STEP, axis=0)[2:-2], axis=1)
    return float(np.abs((pull * along).sum(1)).max()), float(np.abs(across).max()), float(jerk.max())


@pytest.mark.some(6)
@pytest.mark.parametrize("name", scenario_names())
@pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.ScarlWarning")
def test_motions_of_ready_scenarios_stay_within_their_limits(name) -> None:
    spec = ScenarioSpec.preset(name)
    for member in compose(spec).members:
        along, across, jerk = strains(member.actor.trajectory, spec.times[0], spec.times[-1])
        assert along < HARDEST, (member.actor.name, along)
        assert across < LATERAL, (member.actor.name, across)
        assert jerk < JERK, (member.actor.name, jerk)


@pytest.mark.some(6)
@pytest.mark.parametrize("name", scenario_names())
@pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.ScarlWarning")
def test_bodies_of_ready_scenarios_never_touch(name) -> None:
    spec = ScenarioSpec.preset(name)
    bodies = [(member.actor.name, member.actor.trajectory, member.body) for member in compose(spec).members]
    assert find_collisions(bodies, np.arange(spec.times[0], spec.times[-1], STEP)) == []


@pytest.mark.some(2)
@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize("scene", ["roundabout", "parking_garage", "signalised_crossing", "motorway", "country_road"])
def test_traffic_takes_bends_at_ease(scene, seed) -> None:
    network = read_document(find_scene(scene)).lanes
    assert network is not None
    hardest, on_foot = 0.0, 12 if scene == "roundabout" else 0  # its pavements have corners
    spec = TrafficSpec(density=15.0, cyclists=3, pedestrians=on_foot, seed=seed)
    for actor in simulate_traffic(network, spec, (0.0, 12.0)):
        first, last = max(actor.active[0], 0.0), min(actor.active[1], 12.0)
        along, across, _ = strains(actor.trajectory, first, last)
        assert along < HARDEST and across < LATERAL, (actor.name, along, across)
        hardest = max(hardest, across)
        if hasattr(actor.trajectory, "way"):
            times = np.arange(first, last, STEP)
            speeds = actor.trajectory.speed(times)
            assert speeds.size == 0 or speeds.min() > -0.01  # nobody rolls back at a stop
            jerks = actor.trajectory.way.derivative(3)(times)
            assert speeds.size == 0 or np.abs(jerks).max() < JERK, (actor.name, np.abs(jerks).max())
    assert hardest > 0.6 * LATERAL or scene == "motorway"  # they do not crawl either


def test_a_circle_is_driven_at_the_speed_of_its_radius() -> None:
    radius, angle = 15.0, np.linspace(0.0, 5.0, 200)
    points = np.column_stack([radius * np.sin(angle), radius - radius * np.cos(angle), 0.0 * angle])
    fronts = np.arange(0.0, 70.0)
    path = SmoothPath(points, extend=(10.0, 10.0))
    speeds = bend_speeds(path, CAR, fronts)
    at_ease = np.sqrt((1.8 - 1.5 * -CAR.rear_axle / radius) * radius)  # v^2 / R and what setting off adds
    np.testing.assert_allclose(speeds[20:60], at_ease, rtol=0.02)
    straight = SmoothPath([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    assert bend_speeds(straight, CAR, fronts).min() > 100.0


def test_a_bend_holds_until_the_rear_axle_has_left_it() -> None:
    angle = np.linspace(0.0, np.pi / 2.0, 40)
    bend = np.column_stack([40.0 + 10.0 * np.sin(angle), 10.0 - 10.0 * np.cos(angle), 0.0 * angle])
    points = np.concatenate([[[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]], bend, [[50.0, 30.0, 0.0], [50.0, 60.0, 0.0]]])
    path, fronts = SmoothPath(points), np.arange(0.0, 100.0)
    speeds = bend_speeds(path, CAR, fronts)
    begin, end = 40.0, 40.0 + 5.0 * np.pi
    behind = CAR.length / 2.0 - CAR.rear_axle
    slow = fronts[speeds < 5.0]
    assert slow.min() == pytest.approx(begin + behind, abs=4.0) and slow.max() == pytest.approx(end + behind, abs=4.0)
