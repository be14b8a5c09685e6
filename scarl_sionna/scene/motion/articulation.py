"""Moving parts of an actor: rigid segments whose motion relative to the actor follows from how the actor moves.

A wheel turns by the way that the car has travelled, a walker's limbs by the distance walked: no motion of a part is an
input of its own, so that ground contact and Doppler always agree with the trajectory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError

from .footprints import FootPrints, Ground, steps_forward
from .gait import FRACTIONS, SEGMENTS, WalkingGait, walking_gait
from .panels import PANEL, origin_of, panels_to
from .pedalling import PEDALLING_SEGMENTS, Cadence, PedallingLegs
from .swinging import Swing, swing_from_table
from .towing import TowedWheel, Towing, Trailer, rolled_on, towing_from_table
from .trajectory import (
    Motion,
    Trajectory,
    WheelWay,
    body_from_road,
    forward_speeds,
    is_steady,
    known_until,
    wheel_way,
)

PHASES = 16
"""Phases of a gait at which a walker's box is measured: between them a limb goes less than 2 % of its swing farther."""
PACE = 0.25
"""Step of the speeds [m/s] whose gaits walkers' boxes are measured at."""
USUAL = 1.5
"""Speed [m/s] of the steps that have room in the box of somebody whose way is told step by step."""
_SEGMENT = re.compile(rf"(?:^|_)({'|'.join(SEGMENTS)})(?:_[a-z]+)?$")
_PEDALLING = re.compile(rf"(?:^|_)({'|'.join(PEDALLING_SEGMENTS)})(?:_[a-z]+)?$")
_legs = lru_cache(maxsize=64)(PedallingLegs)
"""Riders of the same measures have the same legs: their reach is checked once."""
_KINGPIN = np.array([0.0, 0.0, 1.0])
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def forward_speed(trajectory: Trajectory, time: float) -> float:
    """Return the speed of an actor's origin along its heading [m/s]; negative when it reverses."""
    return float(forward_speeds(trajectory, np.array([time]))[0])


class Accumulated:
    """Integral over time of a rate that depends on an actor's forward speed: way travelled, phase of a gait.

    By an 8-point Gauss rule over panels.

    Parameters
    ----------
    trajectory : Trajectory
    rate : callable
        Rate [1/s] at a forward speed [m/s].

    Notes
    -----
    Counted from the trajectory's start, or from time 0 where it has none. Panels once integrated are kept, as far as
    the trajectory will not change; a steady motion (`is_steady`) needs none, however far from its origin.

    Raises
    ------
    ParameterRangeError
        From `at`, of a motion that is not steady, if more than `MOST_PANELS` are new.
    """

    def __init__(self, trajectory: Trajectory, rate: Callable[[float], float]) -> None:
        self._trajectory = trajectory
        self._rate = rate
        self._origin = origin_of(trajectory)
        self._sums = {0: 0.0}
        self._last = self._origin, 0.0

    def _integrals(self, starts: list[float], stops: list[float]) -> list[float]:
        """Return the integrals over some intervals."""
        start, stop = np.array(starts), np.array(stops)
        half, middle = (stop - start) / 2.0, (stop + start) / 2.0
        times = middle[:, None] + half[:, None] * _NODES
        speeds = forward_speeds(self._trajectory, times.ravel()).tolist()
        rates = np.array([self._rate(speed) for speed in speeds]).reshape(times.shape)
        return (half * (rates @ _WEIGHTS)).tolist()  # type: ignore[no-any-return]

    def at(self, time: float) -> float:
        """Return the integral up to a time [s]."""
        if time == self._last[0]:
            return self._last[1]
        if is_steady(self._trajectory):
            return self._rate(forward_speed(self._trajectory, self._origin)) * (time - self._origin)
        panel, known, step = panels_to(time, self._origin, self._sums)
        new = list(range(known, panel, step))
        starts = [self._origin + index * PANEL for index in (*new, panel)]
        *parts, rest = self._integrals(starts, [*(start + step * PANEL for start in starts[:-1]), time])
        final, total = known_until(self._trajectory), self._sums[known]
        for index, part in zip(new, parts, strict=True):
            total += part
            if self._origin + (index + step) * PANEL <= final:
                self._sums[index + step] = total
        if time <= final:
            self._last = time, total + rest
        return total + rest

    def on(self, trajectory: Trajectory) -> Accumulated:
        """Return the integral of the same rate over another trajectory."""
        return Accumulated(trajectory, self._rate)


class Reach(Protocol):
    """Postures that hold all others of a joint between them; equal ones, of joints that reach as far, are equal."""

    def postures(self) -> Iterable[Mapping[str, Motion]]:
        """Yield the motion of each shape relative to the actor, by shape id."""


@dataclass(frozen=True)
class WalkReach:
    """A person who stands, and one cycle of steps at a speed [m/s]; `shapes` as those of a `Walk`, in pairs."""

    shapes: tuple[tuple[str, str], ...]
    gait: WalkingGait
    speed: float

    def postures(self) -> Iterator[dict[str, Motion]]:
        """Yield the motion of each shape relative to the walker, by shape id."""
        for moved in _cycle(self.gait, self.speed):
            yield {shape: moved[segment] for shape, segment in self.shapes}


@lru_cache(maxsize=64)
def _cycle(gait: WalkingGait, speed: float) -> tuple[dict[str, Motion], ...]:
    """Return the motion of the segments of somebody who stands, and at phases of a steady gait."""
    steps = [gait.motions(phase, speed) for phase in np.linspace(0.0, 1.0, PHASES, endpoint=False)] if speed else []
    return (gait.motions(0.0, 0.0), *steps)


def _longest_step(gait: WalkingGait, trajectory: Trajectory) -> float:
    """Return a speed [m/s], a multiple of `PACE`, that a trajectory does not exceed.

    `USUAL` where nobody knows the trajectory yet.
    """
    if np.isfinite(known_until(trajectory)):
        fastest = USUAL
    elif np.isfinite(trajectory.start) and np.isfinite(trajectory.stop):
        count = max(int((trajectory.stop - trajectory.start) / PANEL), 1) + 1
        fastest = float(forward_speeds(trajectory, np.linspace(trajectory.start, trajectory.stop, count)).max())
    else:
        fastest = forward_speed(trajectory, min(max(0.0, trajectory.start), trajectory.stop))
    return min(PACE * float(np.ceil(max(fastest, 0.0) / PACE - 1e-6)), gait.fastest)


class Joint(Protocol):
    """Some shapes of an actor and how they move relative to it."""

    @property
    def shapes(self) -> Collection[str]:
        """Ids of the shapes that the joint moves."""

    @property
    def changes_shape(self) -> bool:
        """Whether the actor's box changes as the shapes move."""

    @property
    def reach(self) -> Reach | None:
        """Between which postures the shapes move on the whole trajectory; None where the actor's box stays."""

    def motions(self, time: float) -> Mapping[str, Motion]:
        """Return the motion of each shape relative to the actor, by shape id."""


class Rolling:
    """How far an actor has gone along its heading and how far it has turned, once for all of its wheels."""

    def __init__(self, trajectory: Trajectory) -> None:
        self._trajectory = trajectory
        self._way = Accumulated(trajectory, lambda speed: speed)
        self._origin = origin_of(trajectory)
        self._headings: dict[int, float] = {0: trajectory.pose(self._origin).yaw}
        self._last: tuple[float, list[float]] | None = None
        self._road: tuple[float, Motion] | None = None

    def _turned(self, time: float) -> float:
        """Return the turn since the start [rad]: no body turns half way round within a panel."""
        if is_steady(self._trajectory):
            return float(self._trajectory.twist(self._origin).angular[2]) * (time - self._origin)
        panel, known, step = panels_to(time, self._origin, self._headings)
        final, heading = known_until(self._trajectory), self._headings[known]
        for index in range(known, panel, step):
            when = self._origin + (index + step) * PANEL
            heading = _nearest_turn(self._trajectory.pose(when).yaw, heading)
            if when <= final:
                self._headings[index + step] = heading
        return _nearest_turn(self._trajectory.pose(time).yaw, heading) - self._headings[0]

    def at(self, time: float) -> list[float]:
        """Return way [m] and turn [rad] up to a time [s], and their rates."""
        if self._last is not None and self._last[0] == time:
            return self._last[1]
        ahead = self._trajectory.pose(time).rotation[:, 0]
        turning = np.cross(self._trajectory.twist(time).angular, ahead)
        yaw_rate = float((ahead[0] * turning[1] - ahead[1] * turning[0]) / (ahead[0] ** 2 + ahead[1] ** 2))
        found = [self._way.at(time), self._turned(time), forward_speed(self._trajectory, time), yaw_rate]
        if time <= known_until(self._trajectory):
            self._last = time, found
        return found

    def road(self, time: float) -> Motion:
        """Return how the frame that stands on the road moves in the actor's: at rest where its body does not tilt."""
        if self._road is None or self._road[0] != time or time > known_until(self._trajectory):
            self._road = time, body_from_road(self._trajectory, time) or Motion()
        return self._road[1]

    def steered(self, time: float, center: npt.NDArray[np.float64]) -> WheelWay | None:
        """Return how a steered wheel goes; None where nobody knows the bend."""
        return wheel_way(self._trajectory, time, (float(center[0]), float(center[1])))


def _nearest_turn(yaw: float, near: float) -> float:
    """Return an angle with the full turns added that bring it nearest to another [rad]."""
    return yaw + 2.0 * np.pi * round((near - yaw) / (2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class Wheel:
    """A wheel that rolls without slip about an axle along the actor's y axis: in a bend the outer one rolls farther.

    Attributes
    ----------
    shapes : tuple of str
        What turns; modelled in the actor's frame, where the wheel stands.
    center : ndarray of float64, shape (3,)
        Middle of the axle in the actor's frame [m].
    radius : float
        Rolling radius [m].
    steered : bool
        Whether it turns about an upright kingpin through its middle, to where that goes, on a trajectory that knows its
        bends (`wheel_way`).
    """

    shapes: tuple[str, ...]
    center: npt.NDArray[np.float64]
    radius: float
    rolling: Rolling
    steered: bool = False
    changes_shape: bool = False
    reach: None = None

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the turn about the axle, angle = way of the wheel / radius, and about the kingpin."""
        road = self.rolling.road(time)
        bend = self.rolling.steered(time, self.center) if self.steered else None
        if bend is not None:
            road = road.then(Motion.about(_KINGPIN, bend.angle, bend.rate, self.center))
            rolled, speed = bend.rolled, bend.speed
        else:
            way, turned, forward, yaw_rate = self.rolling.at(time)
            rolled, speed = way - self.center[1] * turned, forward - self.center[1] * yaw_rate
        return dict.fromkeys(self.shapes, rolled_on(road, self.center, self.radius, rolled, speed))


@dataclass(frozen=True, eq=False)
class Walk:
    """A walking person.

    `shapes` holds the segment of each shape, which is modelled in that segment's frame, see `gait.SEGMENTS`. Without
    `prints` the feet are those of a steady way straight ahead, which slide where the way is another; without `ground`
    they stand at the height of the actor's origin.
    """

    shapes: Mapping[str, str]
    gait: WalkingGait
    trajectory: Trajectory
    phase: Accumulated
    phase_offset: float = 0.0
    prints: FootPrints | None = None
    ground: Ground | None = None
    changes_shape: bool = True

    @property
    def reach(self) -> WalkReach:
        """What standing and the longest steps of the trajectory need; see `WalkReach`."""
        return WalkReach(tuple(self.shapes.items()), self.gait, _longest_step(self.gait, self.trajectory))

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the motion of every segment at the phase and the speed that the actor has."""
        step = 1e-3
        before = max(time - step, self.trajectory.start)
        after = min(time + step, self.trajectory.stop)
        speed, first, last = np.maximum(forward_speeds(self.trajectory, np.array([time, before, after])), 0.0).tolist()
        rise = (last - first) / max(after - before, step)
        prints = None if self.prints is None else self.prints.at(time)
        moved = self.gait.motions(self.phase.at(time) + self.phase_offset, speed, rise, prints)
        return {shape: moved[segment] for shape, segment in self.shapes.items()}


@dataclass(frozen=True, eq=False)
class Pedal:
    """A pedalling cyclist.

    `shapes` holds the part of each shape, which is modelled in that part's frame, see `pedalling`.
    """

    shapes: Mapping[str, str]
    legs: PedallingLegs
    cadence: Cadence
    trajectory: Trajectory
    turned: Accumulated
    start_angle: float = 0.0
    changes_shape: bool = False
    reach: None = None

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the motion of every part at the angle that the cranks have after the way so far."""
        rate = self.cadence.rate(forward_speed(self.trajectory, time))
        moved = self.legs.motions(self.turned.at(time) + self.start_angle, rate)
        return {shape: moved[part] for shape, part in self.shapes.items()}


def joints_on(joints: Sequence[Joint], trajectory: Trajectory) -> tuple[Joint, ...]:
    """Return the same joints of an actor that moves along another trajectory."""
    rolling = Rolling(trajectory)
    towing = next((joint.towing.on(trajectory) for joint in joints if isinstance(joint, Trailer)), None)
    found: list[Joint] = []
    for joint in joints:
        if isinstance(joint, Wheel):
            found.append(replace(joint, rolling=rolling))
        elif isinstance(joint, Walk):
            phase = joint.phase.on(trajectory)
            prints = _prints(trajectory, joint.gait, phase, joint.phase_offset, joint.ground)
            found.append(replace(joint, trajectory=trajectory, phase=phase, prints=prints))
        elif isinstance(joint, Pedal):
            found.append(replace(joint, trajectory=trajectory, turned=joint.turned.on(trajectory)))
        elif isinstance(joint, Swing):
            found.append(replace(joint, cycles=joint.cycles.on(trajectory)))
        elif isinstance(joint, Trailer | TowedWheel) and towing is not None:
            found.append(replace(joint, towing=towing))
        else:
            raise InputTypeError("joint", joint, "a Wheel, Walk, Pedal, Swing or Trailer")
    return tuple(found)


def joints_on_ground(joints: Sequence[Joint], ground: Ground) -> tuple[Joint, ...]:
    """Return the same joints of an actor whose feet, if it walks, stand on a ground."""
    return tuple(
        replace(
            joint,
            ground=ground,
            prints=joint.prints and _prints(joint.trajectory, joint.gait, joint.phase, joint.phase_offset, ground),
        )
        if isinstance(joint, Walk)
        else joint
        for joint in joints
    )


def joints_from_tables(
    tables: Sequence[Mapping[str, Any]], actor: str, shapes: Sequence[str], trajectory: Trajectory
) -> tuple[Joint, ...]:
    """Return the joints of an actor.

    Parameters
    ----------
    tables : sequence of mapping
        ``[[actors.joints]]`` of a scene.toml. Kinds: ``wheel`` (shapes, center, radius[, steered, towed]), ``walk``
        (height[, phase, and lengths of the body's own segments by the names of `gait.FRACTIONS`]) and ``pedal``
        (measures of :class:`.pedalling.PedallingLegs`, wheel_radius, gear[, ...]), whose shapes are
        those of the actor whose id ends in ``_<segment>`` or ``_<segment>_<detail>``, as ``walker_head_hair``;
        ``swing``, see :func:`.swinging.swing_from_table`; ``trailer``, see :func:`.towing.towing_from_table`, whose
        wheels are ``wheel`` with ``towed``.
    actor : str
        Whose joints they are, for error messages.
    shapes : sequence of str
        The actor's shapes.
    trajectory : Trajectory
        The actor's.

    Raises
    ------
    ParameterRangeError, UnknownNameError
        If a key is missing, unknown or not allowed, or a shape has two joints or is not there.
    """
    joints: list[Joint] = []
    taken: set[str] = set()
    rolling, towing = Rolling(trajectory), towing_from_table(tables, actor, shapes, trajectory)
    for number, table in enumerate(tables):
        what = f"{actor}.joints[{number}]"
        kind = str(table.get("kind", "wheel"))
        if kind == "wheel":
            joint: Joint = _wheel(table, what, shapes, rolling, towing)
        elif kind == "trailer" and towing is not None:
            joint = Trailer(tuple(table["shapes"]), towing)
        elif kind == "walk":
            joint = _walk(table, what, shapes, trajectory)
        elif kind == "pedal":
            joint = _pedal(table, what, shapes, trajectory)
        elif kind == "swing":
            joint = swing_from_table(table, what, shapes, trajectory, Accumulated(trajectory, lambda speed: speed))
        else:
            raise UnknownNameError(f"kind of {what}", kind, ("wheel", "walk", "pedal", "swing", "trailer"))
        used = set(joint.shapes)
        if twice := sorted(used & taken):
            raise ParameterRangeError(f"{what}.shapes", twice[0], "a shape without another joint")
        taken |= used
        joints.append(joint)
    return tuple(joints)


def _check_keys(table: Mapping[str, Any], what: str, required: set[str], optional: set[str]) -> None:
    if missing := required - set(table):
        raise ParameterRangeError(f"{what}.{sorted(missing)[0]}", "missing", "needed for this kind of joint")
    if unknown := set(table) - required - optional - {"kind"}:
        raise UnknownNameError(f"key of {what}", sorted(unknown)[0], required | optional | {"kind"})


def _wheel(
    table: Mapping[str, Any], what: str, shapes: Sequence[str], rolling: Rolling, towing: Towing | None
) -> Wheel | TowedWheel:
    _check_keys(table, what, {"shapes", "center", "radius"}, {"steered", "towed"})
    if unknown := [shape for shape in table["shapes"] if shape not in shapes]:
        raise UnknownNameError(f"shape of {what}", str(unknown[0]), shapes)
    center, radius = np.asarray(table["center"], dtype=np.float64), float(table["radius"])
    if center.shape != (3,) or not np.isfinite(center).all():
        raise ParameterRangeError(f"{what}.center", table["center"], "three finite coordinates [m]")
    if not (np.isfinite(radius) and radius > 0.0):
        raise ParameterRangeError(f"{what}.radius", f"{radius} m", "> 0 m")
    if table.get("towed", False):
        if towing is None:
            raise ParameterRangeError(f"{what}.towed", True, "false for an actor without a joint 'trailer'")
        return TowedWheel(tuple(table["shapes"]), center, radius, towing)
    return Wheel(tuple(table["shapes"]), center, radius, rolling, bool(table.get("steered", False)))


def _walk(table: Mapping[str, Any], what: str, shapes: Sequence[str], trajectory: Trajectory) -> Walk:
    _check_keys(table, what, {"height"}, {"phase", *FRACTIONS})
    found = _segments(shapes, _SEGMENT, SEGMENTS, what)
    own = tuple((name, float(table[name])) for name in FRACTIONS if name in table)
    gait = walking_gait(float(table["height"]), own)
    phase, offset = Accumulated(trajectory, lambda speed: gait.cadence(max(speed, 0.0))), float(table.get("phase", 0.0))
    return Walk(found, gait, trajectory, phase, offset, _prints(trajectory, gait, phase, offset))


def _prints(
    trajectory: Trajectory, gait: WalkingGait, phase: Accumulated, offset: float, ground: Ground | None = None
) -> FootPrints | None:
    """Return the prints of somebody whose next steps are known; None for who goes backward, or where nobody knows."""
    if np.isfinite(known_until(trajectory)) or not steps_forward(trajectory):
        return None
    return FootPrints(trajectory, gait, lambda time: phase.at(time) + offset, ground)


def _segments(shapes: Sequence[str], pattern: re.Pattern[str], segments: Sequence[str], what: str) -> dict[str, str]:
    """Return the segment of each shape whose id names one."""
    found = {shape: match[1] for shape in shapes if (match := pattern.search(shape))}
    if missing := [segment for segment in segments if segment not in found.values()]:
        raise ParameterRangeError(
            f"{what}.shapes", f"no shape ends in '_{missing[0]}'", "at least one shape for each segment of the body"
        )
    return found


def _pedal(table: Mapping[str, Any], what: str, shapes: Sequence[str], trajectory: Trajectory) -> Pedal:
    needed = {"axle", "crank", "hip", "foot_y", "upper_leg", "lower_leg", "pedal_from_ankle", "wheel_radius", "gear"}
    angles = {"foot_pitch_deg", "foot_swing_deg", "foot_lag_deg"}
    _check_keys(table, what, needed, angles | {"cadence_limit", "coast_above", "phase"})
    pairs = {}
    for name in ("axle", "hip", "pedal_from_ankle"):
        pair = np.asarray(table[name], dtype=np.float64)
        if pair.shape != (2,) or not np.isfinite(pair).all():
            raise ParameterRangeError(f"{what}.{name}", table[name], "two finite coordinates x, z [m]")
        pairs[name] = (float(pair[0]), float(pair[1]))
    lengths = {name: float(table[name]) for name in ("crank", "foot_y", "upper_leg", "lower_leg")}
    turns = {name.removesuffix("_deg"): np.radians(float(table[name])) for name in angles & set(table)}
    cadence = Cadence(
        float(table["wheel_radius"]),
        float(table["gear"]),
        float(table.get("cadence_limit", np.inf)) / 60.0,
        float(table.get("coast_above", np.inf)),
    )
    return Pedal(
        _segments(shapes, _PEDALLING, PEDALLING_SEGMENTS, what),
        _legs(**pairs, **lengths, **turns),
        cadence,
        trajectory,
        Accumulated(trajectory, cadence.rate),
        2.0 * np.pi * float(table.get("phase", 0.0)),
    )
