"""Traffic without another simulator.

Vehicles by a car-following model on the lanes of a scene, people on foot, parked cars.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.seeds import generator
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike, body_of, usual_pace
from scarl_sionna.scenario.motion.paths import PathTrajectory, sample_motion
from scarl_sionna.scenario.motion.profiles import way_from_states
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory

from .bends import RoutePaths, along_line
from .driver import Driver
from .drivers import PASSES, STEP, Crowd, Obstacle, fresh, is_outside, thinned, too_many
from .people import walkers
from .planned import PlannedActor, draw_variant
from .separation import without_collisions
from .tracks import Track, TrackGraph, track_graph

Array = npt.NDArray[np.float64]

DEFAULT_MIX: Mapping[str, float] = {
    "saloon": 0.25, "estate": 0.15, "small_car": 0.25, "suv": 0.16, "pickup": 0.03, "van": 0.08, "box_van": 0.02,
    "lorry": 0.04, "bus": 0.015, "coach": 0.005,
}  # fmt: skip # a table
"""Shares of the models among vehicles."""
WARM_UP, CHANGING, WAITING = 5.0, 15.0, 30.0
"""Time that is simulated before the first instant, so that gaps and speeds fit together [s]: where vehicles have their
lane; where they change lanes, so that the fast have found theirs; where they wait, so that queues are there."""
_APART = 0.4
"""Part of the mean gap that vehicles have between them at least at first: who is nearer begins by being too slow."""
TOP_SPEED: Mapping[str, float] = {
    "bicycle": 6.0, "cargo_bike": 6.0, "scooter": 6.0,
    "lorry": 25.0, "articulated_lorry": 25.0, "bus": 27.8, "coach": 27.8,
}  # fmt: skip # a table
"""Of models that are slower than the limits of roads [m/s]."""


def simulate_traffic(
    network: LaneNetwork,
    traffic: TrafficSpec,
    span: tuple[float, float] = (0.0, 10.0),
    *,
    models: Mapping[str, BodyLike] | None = None,
    others: Sequence[tuple[Trajectory, BodyLike]] = (),
    names: str = "traffic",
) -> list[PlannedActor]:
    """Plan traffic on the lanes of a scene.

    Parameters
    ----------
    network : LaneNetwork
    traffic : TrafficSpec
        How much of it: `density`, vehicles for each kilometre of a drive lane [1/km]; `mix`, shares of actor models
        among them, by name (None: `DEFAULT_MIX`); `pedestrians` on walkways and `cyclists` on cycle lanes or else on
        drive lanes; `parked`, share of the parking places that are taken; `seed`, root of all random numbers (None: 0):
        same arguments, same bytes. Its `source` and `file` are not looked at.
    span : (float, float)
        First and last time at which the motion is known [s], at most an hour.
    models : mapping or None
        Bodies (actor models) by name; None, or a name that it lacks: the actor model of that name.
    others : sequence of (Trajectory, body)
        Actors whose motion is given, such as the ego: traffic follows them and gives way to them.
    names : str
        Beginning of the actors' names.

    Returns
    -------
    list of PlannedActor
        Vehicles, cyclists, people and parked cars, in this order, without a collision among each other and with
        `others`.

    Raises
    ------
    ParameterRangeError
        If the span is empty or too long, or there is no lane for what is asked for.
    UnknownNameError
        If a model is unknown.

    Warns
    -----
    ScarlWarning
        If lanes are too short for all that was asked for, or a motion was left out since it would have met another.

    Notes
    -----
    Intelligent Driver Model [1]_ with a jerk limit, in steps of 0.1 s. All begin at the speed at which the model
    neither accelerates nor brakes, 5 s before the span (15 s on roads of several lanes, 30 s where vehicles wait for
    signals or others). Bends at 2 m/s^2; a critical headway of 4.5 s where lanes yield; signals; stretches that two
    lanes share are used by one of them at a time. Random routes at forks. At open ends, lanes go on straight and level
    beyond the scene, so that vehicles come and go. Vehicles change between lanes of one direction (`Lane.left`) by
    MOBIL [3]_. People of all ages walk at 1.34 +- 0.2 m/s [2]_, children and the old slower, on the right of walkways
    and stand where these end. *Not modelled*: overtaking on the lane of those who come towards, turning back.

    References
    ----------
    .. [1] M. Treiber, A. Hennecke, D. Helbing, Phys. Rev. E 62, 1805, 2000.
    .. [2] U. Weidmann, Transporttechnik der Fussgaenger, ETH Zuerich, 1993.
    .. [3] A. Kesting, M. Treiber, D. Helbing, Transportation Research Record 1999, 86, 2007.
    """
    start_time, duration = span[0], span[1] - span[0]
    warm_up = _warm_up(network)
    if not 0.0 < duration <= 3600.0:
        raise ParameterRangeError("span", span, "a start, and a stop above 0 to 3600 s later")
    shares, seed = dict(traffic.mix or DEFAULT_MIX), traffic.seed or 0
    chosen = {name: body_of(name, models) for name in shares if traffic.density > 0.0}
    width = max([body.width for body in chosen.values()] + [1.8]) / 2.0
    longest = max([body.length for body in chosen.values()] + [4.6])
    graph = track_graph(network, duration + warm_up, width, longest, on_foot=traffic.pedestrians > 0)
    start, num_steps = start_time - warm_up, int(np.ceil((duration + warm_up) / STEP)) + 1
    instants: Array = start + STEP * np.arange(num_steps + 1, dtype=np.float64)
    obstacles = [_obstacle(graph, trajectory, ActorBody.of(body), instants) for trajectory, body in others]
    planner = _Planner(graph, generator(seed, "traffic"), duration + warm_up, obstacles)

    wanted: list[tuple[str, Mapping[str, float], int, Mapping[str, ActorBody]]] = []
    wanted += [("drive", shares, round(traffic.density * planner.kilometres("drive")), chosen)]
    wheels = "cycle" if graph.of_kind(["cycle"], inside=True) else "drive"
    bicycles = {"bicycle": body_of("bicycle", models)} if traffic.cyclists else {}
    wanted.append((wheels, {"bicycle": 1.0}, traffic.cyclists, bicycles))
    wanted.append(("walk", walkers() if traffic.pedestrians else {}, traffic.pedestrians, _Bodies(models)))
    for kind, kind_shares, count, bodies in wanted:
        if count and not graph.of_kind([kind], inside=True):
            raise ParameterRangeError(
                "lanes", f"none of kind '{kind}'", f"one for the {count} actors", "add lanes to the scene"
            )
        missing = count - planner.add(kind, kind_shares, count, bodies)
        if missing:
            warnings.warn(
                f"{missing} of {count} actors found no free place on lanes of kind '{kind}'", ScarlWarning, stacklevel=2
            )
    within = sum(graph.tracks[index].length for index in graph.of_kind(["drive"], inside=True)) / 1000.0
    for number in range(1, PASSES + 1):
        before = [fresh(driver) for driver, _ in planner.made]
        drivers = [driver for driver, _ in planner.made]
        Crowd(graph, drivers, network.signals, obstacles, planner.go_on, planner.paths).run(start, num_steps)
        coming = [is_outside(driver, graph.tracks) for driver in before]
        share = too_many(drivers, coming, graph.tracks, traffic.density * within)
        if share == 0.0 or number == PASSES:
            break
        kept = thinned(coming, share)
        planner.made = [
            (driver, model) for driver, (_, model), stays in zip(before, planner.made, kept, strict=True) if stays
        ]

    drive = _Drive(graph.tracks, planner.paths, instants, (start_time, start_time + duration), models)
    draw = generator(seed, "traffic_looks")
    actors = []
    counts: dict[str, int] = {}
    for driver, model in planner.made:
        counts[model] = counts.get(model, -1) + 1
        actors.append(drive.planned(f"{names}_{model}_{counts[model]}", model, driver, draw))
    actors += _parked(network, traffic.parked, shares, models, generator(seed, "parked"), names)
    times = start_time + np.linspace(0.0, duration, max(int(np.ceil(duration / STEP)), 1) + 1)
    return without_collisions(actors, times, others)


def _warm_up(network: LaneNetwork) -> float:
    """Return how long before the first instant the simulation begins [s]."""
    lanes = network.of_kind("drive")
    if any(lane.signal or lane.yield_to for lane in lanes):
        return WAITING
    return CHANGING if any(lane.left for lane in lanes) else WARM_UP


class _Bodies(dict[str, ActorBody]):
    """Bodies by model, read when somebody asks for them: of all people few are drawn."""

    def __init__(self, models: Mapping[str, BodyLike] | None) -> None:
        super().__init__()
        self._models = models

    def __missing__(self, name: str) -> ActorBody:
        self[name] = body_of(name, self._models)
        return self[name]


def _obstacle(graph: TrackGraph, trajectory: Trajectory, body: ActorBody, instants: Array) -> Obstacle:
    """Return where a given motion is on the tracks at each instant.

    Before and after its time it goes along them at the speed that it has at its ends.
    """
    known = np.clip(instants, trajectory.start, trajectory.stop)
    motion = sample_motion(trajectory, known)
    along = np.stack([np.cos(motion.heading), np.sin(motion.heading)], axis=1)
    speed = (motion.velocity[:, :2] * along).sum(1)
    places: list[dict[int, tuple[float, float]]] = [{} for _ in instants]
    for index, track in enumerate(graph.tracks):
        start, step = track.points[:-1, :2], np.diff(track.points[:, :2], axis=0)
        for offset in (body.length / 2.0, 0.0, -body.length / 2.0):
            spot = motion.position[:, :2] + offset * along
            share = np.clip(((spot[:, None] - start) * step).sum(2) / (step * step).sum(1), 0.0, 1.0)
            away = np.linalg.norm(start + share[..., None] * step - spot[:, None], axis=2)
            nearest = away.argmin(1)
            rows = np.arange(len(instants))
            way = track.chord[nearest] + share[rows, nearest] * np.diff(track.chord)[nearest]
            direction = step[nearest] / np.linalg.norm(step[nearest], axis=1, keepdims=True)
            forward = (direction * along).sum(1)
            level = (
                np.abs(np.interp(way, track.chord, track.points[:, 2]) - motion.position[:, 2]) < 2.5
            )  # not on a bridge above
            for row in np.flatnonzero(
                level & (away[rows, nearest] < body.width / 2.0 + (0.4 if track.kind == "walk" else 1.1))
            ):
                front = float(
                    way[row] + (body.length / 2.0 - offset if forward[row] > 0.0 else body.length / 2.0 + offset)
                )
                if front > places[row].get(index, (-np.inf, 0.0))[0]:
                    places[row][index] = (front, float(max(speed[row] * forward[row], 0.0)))
    for late in np.flatnonzero(known != instants).tolist():
        away = float(instants[late] - known[late])
        places[late] = dict(_carried(graph, index, front, pace, away) for index, (front, pace) in places[late].items())
    return Obstacle(body.length, places)


def _carried(graph: TrackGraph, index: int, front: float, speed: float, time: float) -> tuple[int, tuple[float, float]]:
    """Return track, way of the front [m] and speed [m/s] of a body some time [s] later, or earlier where negative."""
    front += speed * time
    while front < 0.0 and graph.tracks[index].before:
        index = graph.tracks[index].before[0]
        front += graph.tracks[index].length
    while front > graph.tracks[index].length and graph.tracks[index].next:
        front -= graph.tracks[index].length
        index = graph.tracks[index].next[0]
    return index, (front, speed)


class _Planner:
    """Places drivers on tracks, apart from each other and outside stretches that tracks share."""

    def __init__(
        self, graph: TrackGraph, draw: np.random.Generator, duration: float, obstacles: Sequence[Obstacle]
    ) -> None:
        self.graph, self.draw, self.duration = graph, draw, duration
        self.paths = RoutePaths(graph.tracks)
        self.made: list[tuple[Driver, str]] = []
        self.taken: dict[int, list[tuple[float, float]]] = {}
        for obstacle in obstacles:
            for track, (way, _) in obstacle.places[0].items():  # behind and before it stays free
                self.taken.setdefault(track, []).append((way - obstacle.length - 8.0, way + 15.0))

    def kilometres(self, kind: str) -> float:
        """Return the length of all tracks of a kind, run-ins included [km]."""
        entering = [
            self.graph.tracks[index]
            for index in self.graph.of_kind([kind])
            if self.graph.tracks[index].next or self.graph.tracks[index].lane
        ]
        return sum(track.length for track in entering) / 1000.0

    def add(self, kind: str, shares: Mapping[str, float], count: int, bodies: Mapping[str, ActorBody]) -> int:
        """Place up to `count` drivers; return how many found a place."""
        if not count:
            return 0
        indices = [
            index
            for index in self.graph.of_kind([kind])
            if self.graph.tracks[index].next or self.graph.tracks[index].lane
        ]
        lengths = np.array([self.graph.tracks[index].length for index in indices])
        share = _APART * max(float(lengths.sum()) / count - 5.0, 0.0)
        names = sorted(shares)
        weights = np.array([shares[name] for name in names], dtype=np.float64)
        placed = 0
        for _ in range(60 * count):
            if placed == count:
                break
            index = indices[int(self.draw.choice(len(indices), p=lengths / lengths.sum()))]
            way = float(self.draw.uniform(0.0, self.graph.tracks[index].length))
            model = names[int(self.draw.choice(len(names), p=weights / weights.sum()))]
            if self._is_free(index, way, bodies[model], share):
                self.taken.setdefault(index, []).append((way - bodies[model].length, way))
                self.made.append((self._driver(index, way, bodies[model], model), model))
                placed += 1
        return placed

    def _is_free(self, index: int, front: float, body: ActorBody, share: float) -> bool:
        """Return whether a body has room on a track: its share of the road [m], if no more than who drives needs."""
        track = self.graph.tracks[index]
        room = 0.4 if track.kind == "walk" else max(min(share, 2.0 + track.speed), 2.5)
        rear = front - body.length
        if rear < 0.5 or front > track.length - 0.5:
            return False
        if any(first - 0.3 < front and rear < last + 0.3 for _, first, last, _ in track.zones):
            return False
        return all(front + room < low or rear - room > high for low, high in self.taken.get(index, ()))

    def _driver(self, index: int, front: float, body: ActorBody, model: str) -> Driver:
        track = self.graph.tracks[index]
        spread = self.draw.normal(size=4).clip(-2.0, 2.0)
        if track.kind == "walk":
            pace = float(1.34 + 0.2 * spread[0]) * usual_pace(body)  # Weidmann 1993
            driver = Driver(body, [index], front, 0.9 * pace, 0.5, 1.0, 1.5, 0.4, 10.0, pace)
        else:
            by_muscle = model in ("bicycle", "cargo_bike", "scooter")
            top = TOP_SPEED.get(model, 60.0) * float(1.0 + 0.1 * spread[1] * by_muscle)
            heavy = body.length > 7.0
            share = float(1.0 + 0.06 * spread[0])
            driver = Driver(
                body,
                [index],
                front,
                min(top, track.speed),
                float(1.5 + 0.2 * spread[2]),
                0.8 if heavy else float(1.4 + 0.2 * spread[3]),
                2.0,
                2.0,
                share,
                top,
            )
        needed = (
            front + self.duration * min(driver.top_speed, max(one.speed for one in self.graph.tracks) * 1.15) + 40.0
        )
        driver.needed = needed
        driver.blocked_end = self.go_on(driver.route, needed)
        driver.prepare(self.graph.tracks, self.paths)
        return driver

    def go_on(self, route: list[int], needed: float) -> bool:
        """Extend a route by random ways until it is as long as needed [m]; return whether it ends before."""
        length = sum(self.graph.tracks[index].length for index in route)
        while length < needed:
            ways = self.graph.tracks[route[-1]].next
            if not ways:
                break
            route.append(ways[int(self.draw.integers(len(ways)))])
            length += self.graph.tracks[route[-1]].length
        return length < needed


@dataclass(frozen=True, eq=False)
class _Drive:
    """What was simulated.

    Tracks and the paths along them, instants (N,) [s], the span that motions shall be known for [s], bodies by model.
    """

    tracks: Sequence[Track]
    paths: RoutePaths
    instants: Array
    span: tuple[float, float]
    models: Mapping[str, BodyLike] | None

    def planned(self, name: str, model: str, driver: Driver, draw: np.random.Generator) -> PlannedActor:
        """Return a driver's motion as a trajectory on the smooth curve along its route."""
        states = np.array(driver.history)
        body = driver.body
        chords = states[:, 0] - driver.reference
        span = chords[[0, -1]]
        route = [self.tracks[index] for index in driver.route]
        if driver.changes:
            path, known, along = self.paths.changed(driver, body, (float(span[0]), float(span[1])))
            span, start = along_line(span, known, along), 0.0
        else:
            path, start = self.paths.path(driver.route, body), 0.0
        ends = path.way_of(span - start)
        scale = (ends[1] - ends[0]) / (chords[-1] - chords[0]) if chords[-1] - chords[0] > 5.0 else 1.0
        ways = ends[0] + scale * (chords - chords[0])
        way = way_from_states(self.instants, ways, scale * states[:, 1], scale * states[:, 2])
        trajectory = PathTrajectory(path, way, body, *self.span, name)
        variant = draw_variant(model, self.models, float(draw.uniform()))
        return PlannedActor(name, model, variant, trajectory, body, float(draw.uniform()), self._active(driver, route))

    def _active(self, driver: Driver, route: Sequence[Track]) -> tuple[float, float]:
        """Return the times at which a driver's middle is on the lanes [s], empty where it never is."""
        inside = np.array([track.lane is not None for track in route])
        middle = np.array(driver.history)[:, 0] - driver.body.length / 2.0
        place = np.clip(np.searchsorted(driver.enters, middle, side="right") - 1, 0, len(route) - 1)
        present = self.instants[inside[place]]
        if not present.size:
            return self.span[0], self.span[0]
        return max(float(present[0]), self.span[0]), min(float(present[-1]), self.span[1])


def _parked(
    network: LaneNetwork,
    share: float,
    mix: Mapping[str, float],
    models: Mapping[str, BodyLike] | None,
    draw: np.random.Generator,
    names: str,
) -> list[PlannedActor]:
    """Return parked cars on a share of the places, each one that fits."""
    count = round(share * len(network.parking))
    if not count:
        return []
    bodies = {name: body_of(name, models) for name in sorted(mix) if mix[name] > 0.0}
    actors = []
    for number in sorted(draw.permutation(len(network.parking))[:count].tolist()):
        place = network.parking[number]
        fitting = [name for name, body in bodies.items() if body.length <= place.length and body.motion == "vehicle"]
        order = float(draw.uniform())
        slack = draw.uniform(-1.0, 1.0, 2)
        if not fitting:
            continue
        weights = np.cumsum([mix[name] for name in fitting])
        model = fitting[int(np.searchsorted(weights, order * weights[-1]))]
        body, yaw = bodies[model], np.radians(place.yaw_deg + 1.0 * slack[1])
        along = 0.4 * (place.length - body.length) * slack[0]
        position = place.position + along * np.array([np.cos(yaw), np.sin(yaw), 0.0])
        trajectory = StaticTrajectory(Pose.from_heading(position, float(yaw)))
        actors.append(
            PlannedActor(
                f"{names}_parked_{number}", model, draw_variant(model, models, float(draw.uniform())), trajectory, body
            )
        )
    return actors
