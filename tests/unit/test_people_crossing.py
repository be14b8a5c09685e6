"""People go over roads at green, before vehicles that can stop, after those that cannot; who yields waits before."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from scarl_sionna.scenario.motion.bodies import WALKER, ActorBody
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.bends import RoutePaths
from scarl_sionna.scenario.traffic.driver import Driver
from scarl_sionna.scenario.traffic.drivers import STEP, Crowd, Obstacle
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scenario.traffic.tracks import TrackGraph, track_graph
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables

STEPS = 200
Array = npt.NDArray[np.float64]


def line(start: tuple[float, float], end: tuple[float, float]) -> list[list[float]]:
    count = int(np.hypot(end[0] - start[0], end[1] - start[1])) + 1
    return np.column_stack([np.linspace(start, end, count), np.zeros(count)]).tolist()  # type: ignore[no-any-return]


def street(**signal: object) -> LaneNetwork:
    """A street of two lanes along x, and a way on foot over it at x = 0: kerbs at y = -3.5 and 3.5 m."""
    tables: list[dict[str, object]] = [
        {"name": "there", "points": line((-80.0, -1.75), (80.0, -1.75)), "speed": 13.9},
        {"name": "back", "points": line((80.0, 1.75), (-80.0, 1.75)), "speed": 13.9},
        {"name": "pavement", "kind": "walk", "width": 1.2, "points": line((0.0, -12.0), (0.0, -3.5)), "speed": 1.5,
         "next": ["zebra"], **signal},
        {"name": "zebra", "kind": "walk", "width": 1.2, "points": line((0.0, -3.5), (0.0, 3.5)), "speed": 1.5,
         "next": ["beyond"]},
        {"name": "beyond", "kind": "walk", "width": 1.2, "points": line((0.0, 3.5), (0.0, 30.0)), "speed": 1.5},
    ]  # fmt: skip # a table
    return lanes_from_tables(tables, signals={"cycle": 20.0, "green": {"walk": [10.0, 18.0]}})


def moved(
    network: LaneNetwork, drivers: dict[str, tuple[list[str], float, float]], given: dict[str, Array] | None = None
) -> tuple[TrackGraph, dict[str, Array]]:
    """Return the graph, and way, speed and acceleration of drivers on lanes from a way on, at a speed [m/s]."""
    graph = track_graph(network, 20.0, 0.9, 4.6)
    names = {track.lane: index for index, track in reversed(list(enumerate(graph.tracks))) if track.lane}
    paths, made = RoutePaths(graph.tracks), {}
    for name, (lanes, front, speed) in drivers.items():
        route = [names[lane] for lane in lanes]
        on_foot = graph.tracks[route[0]].kind == "walk"
        body = WALKER if on_foot else ActorBody()
        rest = (0.5, 1.0, 1.5, 0.4, 10.0, 1.4) if on_foot else (1.5, 1.4, 2.0, 2.0, 1.0, 60.0)
        made[name] = Driver(body, route, front, speed, *rest)
        made[name].prepare(graph.tracks, paths)
    bodies = [
        Obstacle(4.6, [{names[lane]: (float(way), 0.0)} for way in np.r_[ways, np.full(5, ways[-1])]])
        for lane, ways in (given or {}).items()
    ]
    crowd = Crowd(graph, list(made.values()), network.signals, bodies)
    crowd.run(0.0, STEPS)
    return graph, {name: np.array(driver.history) for name, driver in made.items()}


def span(graph: TrackGraph, lane: str, other: str) -> tuple[float, float]:
    """Return the stretch of a lane that it shares with another [m]."""
    (zones,) = [
        [zone[1:3] for zone in track.zones if other in {graph.tracks[side].lane for side in graph.sides[zone[0]]}]
        for track in graph.tracks
        if track.lane == lane
    ]
    return min(first for first, _ in zones), max(last for _, last in zones)


ON_FOOT = ["pavement", "zebra", "beyond"]
TIMES = STEP * np.arange(STEPS + 1)


def test_people_wait_for_green_at_the_kerb() -> None:
    _, states = moved(street(signal="walk"), {"woman": (ON_FOOT, 2.0, 1.4)})
    way = states["woman"][:, 0]
    entered = TIMES[np.searchsorted(way, 8.5)]  # the front over the kerb
    assert 10.0 <= entered < 13.0
    assert 7.0 < way[90] < 8.5  # she stands there
    assert way[-1] > 8.5 + 7.0 + 0.5


@pytest.mark.parametrize("away", [52.0, 58.0, 75.0])
def test_vehicles_that_can_stop_let_people_over(away: float) -> None:
    graph, states = moved(
        street(), {"car": (["there"], 80.0 - away, 10.0), "woman": (ON_FOOT, 6.0, 1.4)}
    )  # 1.8 s from the kerb
    alone = moved(street(), {"woman": (ON_FOOT, 6.0, 1.4)})[1]["woman"]
    np.testing.assert_allclose(states["woman"], alone, atol=1e-9)  # her way is that of nobody else
    first, last = span(graph, "there", "zebra")
    mine = span(graph, "zebra", "there")
    on_it = (states["woman"][:, 0] - 8.5 > mine[0]) & (states["woman"][:, 0] - WALKER.length - 8.5 < mine[1])
    car = states["car"][:, 0]
    assert not np.any(on_it & (car > first) & (car - 4.6 < last))
    assert states["car"][:, 2].min() > -4.5
    assert car[-1] > last + 10.0  # it goes on afterwards


def test_people_let_vehicles_pass_that_cannot_stop() -> None:
    graph, states = moved(street(), {"car": (["there"], 65.0, 12.0), "woman": (ON_FOOT, 6.0, 1.4)})
    first, last = span(graph, "there", "zebra")
    alone = moved(street(), {"car": (["there"], 65.0, 12.0)})[1]["car"]
    np.testing.assert_allclose(states["car"], alone, atol=1e-9)
    clear = TIMES[np.searchsorted(states["car"][:, 0] - 4.6, last)]
    entered = TIMES[np.searchsorted(states["woman"][:, 0] - 8.5, span(graph, "zebra", "there")[0])]
    assert entered >= clear > 0.5
    assert first < last


@pytest.mark.parametrize("lane", ["there", "back"])
def test_people_cross_all_lanes_before_or_after_who_does_not_react(lane: str) -> None:
    given = 40.0 + 9.0 * TIMES  # over the zebra from 4.3 s on
    graph, states = moved(street(), {"woman": (ON_FOOT, 4.5, 1.4)}, {lane: np.minimum(given, 160.0)})
    first, last = span(graph, lane, "zebra")
    mine = span(graph, "zebra", "there")[0], span(graph, "zebra", "back")[1]
    way = states["woman"][:, 0] - 8.5
    on_road = (way > mine[0]) & (way - WALKER.length < mine[1])
    assert on_road.any()
    assert not np.any(on_road & (given > first) & (given - 4.6 < last))
    assert np.all(states["woman"][on_road, 1] > 0.4)  # nobody stands on the road


def test_who_yields_waits_before_the_crossing_of_both_lanes() -> None:
    tables: list[dict[str, object]] = [
        {"name": "major", "points": line((-80.0, 0.0), (80.0, 0.0)), "speed": 13.9},
        {"name": "minor", "points": line((0.0, -60.0), (0.0, -8.0)), "speed": 13.9, "next": ["over"]},
        {
            "name": "over",
            "points": line((0.0, -8.0), (0.0, 20.0)),
            "speed": 13.9,
            "next": ["on"],
            "yield_to": ["major"],
        },
        {"name": "on", "points": line((0.0, 20.0), (0.0, 60.0)), "speed": 13.9},
    ]
    graph, states = moved(
        lanes_from_tables(tables), {"first": (["major"], 20.0, 12.0), "other": (["minor", "over", "on"], 25.0, 8.0)}
    )
    begins, _ = span(graph, "over", "major")
    _, last = span(graph, "major", "over")
    passed = int(np.searchsorted(states["first"][:, 0] - 4.6, last))
    assert 20 < passed < STEPS - 40
    assert states["other"][:passed, 0].max() < 52.0 + begins
    assert states["other"][passed, 0] > 52.0 + begins - 8.0  # and there, not far before
    assert states["other"][-1, 0] > 52.0 + begins + 10.0


def test_people_enter_the_crossing_with_lights_at_green_and_hardly_anybody_is_lost() -> None:
    """Vehicles that turn left wait before the lanes that they cross: nearly all are apart to the end."""
    network = read_document(find_scene("signalised_crossing")).lanes
    assert network.signals is not None
    actors = simulate_traffic(network, TrafficSpec(density=6.0, pedestrians=16, seed=3), (0.0, 40.0))
    walkers = [actor for actor in actors if actor.body.motion == "walk"]
    assert sum(actor.body.motion == "vehicle" for actor in actors) > 10
    assert len(walkers) >= 15
    times, entered = np.arange(0.0, 40.0, 0.25), 0
    for actor in walkers:
        places = np.array([actor.trajectory.pose(time).position[:2] for time in times])
        for lane in network.of_kind("walk"):
            if not lane.name.startswith("zebra"):
                continue
            group = "walk_main" if lane.name.split("_")[1] in ("west", "east") else "walk_side"
            start, step = lane.points[0, :2], lane.points[-1, :2] - lane.points[0, :2]
            along, aside = (places - start) @ step / lane.length, (places - start) @ [-step[1], step[0]] / lane.length
            over = (along[:-1] < 0.0) & (along[1:] >= 0.0) & (np.abs(aside[1:]) < 1.5)
            for time in times[1:][over]:
                entered += 1
                assert network.signals.is_green(group, float(time) - 1.0), (actor.name, lane.name, time)
    assert entered >= 2
