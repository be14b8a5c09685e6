"""Built-in traffic: repeatable, without collisions, by signals and right of way, and within what vehicles can do."""

from __future__ import annotations

import time

import numpy as np
import numpy.typing as npt
import pytest

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.checks.motion import check_motion
from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody, usual_pace
from scarl_sionna.scenario.motion.paths import PathTrajectory, sample_motion
from scarl_sionna.scenario.motion.profiles import SpeedProfile
from scarl_sionna.scenario.motion.routes import Route
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.driver import Driver
from scarl_sionna.scenario.traffic.drivers import CRITICAL_HEADWAY
from scarl_sionna.scenario.traffic.people import walkers
from scarl_sionna.scenario.traffic.planned import PlannedActor
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scene.actors.model import person_ages, read_actor_model
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables

BODIES = {
    "saloon": ActorBody(),
    "small_car": ActorBody(3.9, 1.7, 1.5, 2.5, -1.25),
    "suv": ActorBody(4.7, 1.9, 1.7, 2.8, -1.4),
    "van": ActorBody(5.6, 2.0, 2.4, 3.4, -1.6),
    "lorry": ActorBody(9.0, 2.5, 3.6, 5.2, -2.6),
    "bicycle": ActorBody(1.8, 0.6, 1.75, 1.1, -0.55, "cycle"),
    "adult_man": WALKER,
    "adult_woman": WALKER,
    "child": WALKER,
}
Table = dict[str, object]


def curve(
    start: npt.ArrayLike, heading: float, end: npt.ArrayLike, leaving: float, count: int = 14
) -> list[list[float]]:
    """Return points of a smooth curve between two poses in plan."""
    p, q = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    x, reach = np.linspace(0.0, 1.0, count)[:, None], np.linalg.norm(q - p)
    t, u = (reach * np.array([np.cos(a), np.sin(a)]) for a in (heading, leaving))
    plan = (2 * x**3 - 3 * x**2 + 1) * p + (x**3 - 2 * x**2 + x) * t + (3 * x**2 - 2 * x**3) * q + (x**3 - x**2) * u
    return np.column_stack([plan, np.zeros(count)]).tolist()  # type: ignore[no-any-return]


def crossing(signals: bool = True) -> LaneNetwork:
    """Four arms, straight on, right and left turns; main road along x."""
    tables: list[Table] = []
    for arm in range(4):
        turn = arm * np.pi / 2
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        pose = [
            rotation @ [-15.0, -1.75],
            rotation @ [-100.0, -1.75],
            rotation @ [-15.0, 1.75],
            rotation @ [-100.0, 1.75],
        ]
        ways = {"straight": (arm + 2) % 4, "right": (arm + 3) % 4, "left": (arm + 1) % 4}
        inbound: Table = {
            "name": f"in_{arm}",
            "points": [[*pose[1], 0.0], [*pose[0], 0.0]],
            "next": [f"{way}_{arm}" for way in ways],
        }
        if signals:
            inbound["signal"] = "main" if arm % 2 == 0 else "side"
        elif arm % 2 == 1:
            inbound["yield_to"] = [f"in_{(arm + 1) % 4}", f"in_{(arm + 3) % 4}"]
        tables += [inbound, {"name": f"out_{arm}", "points": [[*pose[2], 0.0], [*pose[3], 0.0]]}]
        for way, target in ways.items():
            leave = target * np.pi / 2
            end = np.array([[np.cos(leave), -np.sin(leave)], [np.sin(leave), np.cos(leave)]]) @ [-15.0, 1.75]
            points = curve(pose[0], turn, end, leave + np.pi)
            tables.append({"name": f"{way}_{arm}", "points": points, "next": [f"out_{target}"], "speed": 10.0})
    for side, y in (("a", -8.0), ("b", 8.0)):
        tables.append(
            {
                "name": f"walk_{side}",
                "kind": "walk",
                "width": 2.0,
                "speed": 3.0,
                "points": [[-90.0, y, 0.1], [-20.0, y, 0.1]],
            }
        )
    places = [{"position": [x, -4.8, 0.0]} for x in (-70.0, -60.0, -50.0, -40.0)]
    return lanes_from_tables(
        tables, places, {"cycle": 30.0, "green": {"main": [0.0, 11.0], "side": [15.0, 26.0]}} if signals else None
    )


def bytes_of(actors: list[PlannedActor]) -> bytes:
    times = np.linspace(0.0, 8.0, 41)
    rows = [sample_motion(actor.trajectory, times).position.tobytes() + actor.name.encode() for actor in actors]
    return b"".join(rows)


def boxes(actors: list[PlannedActor]) -> list[tuple[str, object, ActorBody]]:
    return [(actor.name, actor.trajectory, actor.body) for actor in actors]


@pytest.fixture(scope="module")
def busy() -> list[PlannedActor]:
    spec = TrafficSpec(density=25.0, seed=3, pedestrians=10, cyclists=2, parked=0.5)
    return simulate_traffic(crossing(), spec, (0.0, 30.0), models=BODIES)


def test_same_seed_same_bytes() -> None:
    network = crossing()
    first, again, other = (
        bytes_of(simulate_traffic(network, TrafficSpec(density=15.0, seed=seed), (0.0, 8.0), models=BODIES))
        for seed in (0, 0, 1)
    )
    assert first == again and first != other


def test_no_collision_and_possible_motion(busy: list[PlannedActor]) -> None:
    assert find_collisions(boxes(busy), np.linspace(0.0, 30.0, 301)) == []  # type: ignore[arg-type]
    assert check_motion([(one.name, one.trajectory) for one in busy], np.linspace(0.01, 29.99, 300)) == []
    fine = np.linspace(0.0, 30.0, 1501)
    for actor in busy:
        if isinstance(actor.trajectory, PathTrajectory):
            assert actor.trajectory.speed(fine).min() > -0.05
            assert actor.trajectory.acceleration(fine).min() > -9.5  # brakes of 8 m/s2, and the last landing at rest
            assert actor.trajectory.acceleration(fine).max() < 2.6


def test_people_on_foot_are_of_all_ages_and_walk_as_fast_as_they_can() -> None:
    """Shares of children and adults; nobody is drawn a pace that the gait does not have."""
    shares, ages = walkers(), person_ages()
    assert set(shares) == set(ages) and sum(shares.values()) == pytest.approx(1.0)
    assert sum(share for name, share in shares.items() if ages[name] < 16) == pytest.approx(0.16)
    for name in list(ages)[::6]:
        model = read_actor_model(name)
        joint = next(row for row in model.joints if row["kind"] == "walk")
        fastest = 3.0 * (joint["upper_leg"] + joint["lower_leg"])
        assert (1.34 + 2.0 * 0.2) * usual_pace(ActorBody.of(model)) < fastest
    adult, child, old = (ActorBody(1.0, 0.5, height, 0.0, 0.0, "walk", age) for height, age in HEIGHTS)
    assert usual_pace(adult) == 1.0 and usual_pace(child) == pytest.approx(0.85) and usual_pace(old) == 0.75


HEIGHTS = ((1.75, 30.0), (1.22, 7.0), (1.6, 80.0))


def test_who_is_there(busy: list[PlannedActor]) -> None:
    models = [actor.model for actor in busy]
    people = [model for model in models if model in person_ages()]
    assert len(people) == 10 and len(set(people)) > 5
    assert models.count("bicycle") == 2
    assert sum("parked" in actor.name for actor in busy) == 2
    # 25 vehicles on each of the kilometres inside: those that are in the scene at the beginning (Poisson: 5 sigma)
    length = sum(lane.length for lane in crossing().of_kind("drive")) / 1000.0
    inside = sum(
        actor.active[0] <= 0.0 < actor.active[1] and "parked" not in actor.name and actor.body.motion == "vehicle"
        for actor in busy
    )
    assert abs(inside - 25.0 * length) < 5.0 * np.sqrt(25.0 * length)
    assert len({actor.name for actor in busy}) == len(busy)


def test_nobody_passes_a_red_signal(busy: list[PlannedActor]) -> None:
    """A stop line is crossed by green, or within the time in which a driver could not have stopped any more."""
    network = crossing()
    assert network.signals is not None
    crossed = 0
    for actor in busy:
        if actor.body.motion != "vehicle" or "parked" in actor.name:
            continue
        fine = np.linspace(0.0, 30.0, 3001)
        motion = sample_motion(actor.trajectory, fine)
        front = motion.position[:, :2] + actor.body.length / 2.0 * np.stack(
            [np.cos(motion.heading), np.sin(motion.heading)], 1
        )
        for arm in range(4):
            lane = network[f"in_{arm}"]
            direction = (lane.points[-1] - lane.points[0])[:2] / lane.length
            beyond = (front - lane.points[-1, :2]) @ direction
            near = np.abs((front - lane.points[-1, :2]) @ [-direction[1], direction[0]]) < 1.0
            passing = np.flatnonzero(
                (beyond[:-1] < 0.0)
                & (beyond[1:] >= 0.0)
                & near[1:]
                & (np.cos(motion.heading[1:]) * direction[0] + np.sin(motion.heading[1:]) * direction[1] > 0.9)
            )
            for index in passing:
                crossed += 1
                group = str(lane.signal)
                start, stop = network.signals.green[group]
                late = (fine[index] - stop) % 30.0
                # v / (2 b) <= 15 / (2 * 4) s after the end of green: stopping would have needed more than 4 m/s2
                assert network.signals.is_green(group, float(fine[index])) or late < 2.0, (
                    actor.name,
                    fine[index],
                    start,
                    stop,
                )
    assert crossed >= 5


def test_right_of_way_without_signals() -> None:
    actors = simulate_traffic(crossing(signals=False), TrafficSpec(density=15.0, seed=1), (0.0, 25.0), models=BODIES)
    assert find_collisions(boxes(actors), np.linspace(0.0, 25.0, 251)) == []  # type: ignore[arg-type]
    assert CRITICAL_HEADWAY == 4.5


def test_idm_equilibrium() -> None:
    """In equilibrium behind a leader the gap is (s0 + v T) / sqrt(1 - (v / v0)^4) (Treiber 2000, Eq. 4)."""
    driver = Driver(ActorBody(), [0], 0.0, 10.0, 1.5, 1.4, 2.0, 2.0, 1.0, 60.0)
    gap = (2.0 + 10.0 * 1.5) / np.sqrt(1.0 - (10.0 / 15.0) ** 4)
    assert driver.follow(gap, 0.0, 15.0) == pytest.approx(0.0, abs=1e-12)
    assert driver.follow(0.8 * gap, 0.0, 15.0) < 0.0 < driver.follow(1.2 * gap, 0.0, 15.0)
    driver.settle(gap, 10.0, 15.0)
    assert driver.speed == pytest.approx(10.0, abs=0.01)
    driver.settle(1e9, 0.0, 15.0)
    assert driver.speed == pytest.approx(15.0, abs=0.01)


def test_traffic_follows_a_given_actor() -> None:
    network = lanes_from_tables([{"name": "a", "points": [[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]]}])
    ego = Route(network, ["a"]).trajectory(60.0, SpeedProfile(3.0), model=ActorBody(), duration=20.0)
    actors = simulate_traffic(
        network, TrafficSpec(density=20.0, seed=5), (0.0, 20.0), models=BODIES, others=[(ego, ActorBody())]
    )
    assert find_collisions([("ego", ego, ActorBody()), *boxes(actors)], np.linspace(0.0, 20.0, 401)) == []  # type: ignore[list-item]
    behind = [one for one in actors if one.trajectory.pose(0.0).position[0] < 60.0]
    assert behind and all(one.trajectory.pose(20.0).position[0] < ego.pose(20.0).position[0] for one in behind)


def test_200_actors_for_10_s_in_5_s() -> None:
    tables = [{"name": f"l{row}", "points": [[0.0, 8.0 * row, 0.0], [500.0, 8.0 * row, 0.0]]} for row in range(12)]
    network = lanes_from_tables(tables)
    begin = time.process_time()
    actors = simulate_traffic(network, TrafficSpec(density=26.0, seed=0), (0.0, 10.0), models=BODIES)
    taken = time.process_time() - begin
    assert len(actors) >= 200
    assert taken < 5.0, f"{taken:.1f} s CPU"


def test_arguments() -> None:
    network = lanes_from_tables([{"name": "a", "points": [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]}])
    for change in (
        {"density": -1.0},
        {"parked": 1.5},
        {"pedestrians": -1},
        {"mix": {"saloon": 0.0}},
        {"cyclists": 1.5},
    ):
        with pytest.raises(ParameterRangeError, match=next(iter(change))):
            TrafficSpec(**change)  # type: ignore[arg-type]
    for span in ((0.0, 0.0), (1.0, 0.0), (0.0, 3601.0), (0.0, float("nan"))):
        with pytest.raises(ParameterRangeError, match="span"):
            simulate_traffic(network, TrafficSpec(), span, models=BODIES)
    with pytest.raises(ParameterRangeError, match="none of kind 'walk'"):
        simulate_traffic(network, TrafficSpec(density=0.0, pedestrians=3), models=BODIES)
    with pytest.warns(ScarlWarning, match="found no free place"):
        simulate_traffic(network, TrafficSpec(density=150.0), (0.0, 1.0), models=BODIES)
