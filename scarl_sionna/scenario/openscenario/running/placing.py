"""Actions that decide where an entity is: beside its lane, on a trajectory, on a route, at a place, or not there."""

from __future__ import annotations

import math
from dataclasses import replace

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.source import Node
from scarl_sionna.scenario.openscenario.roads.network import Roads, Spot

from .actions import START, Action, Stage
from .distances import Distance
from .dynamics import SHAPES, Transition
from .motion import Motion
from .positions import Place, beside, placed, read_position, read_route
from .processes import KeepAside, Process, Shift
from .shapes import Follow, Trajectory

GAP = 0.5
"""How far a trajectory or a place may be from an entity that goes there during the run [m]."""
_GENTLE = 2.0
"""Lateral acceleration of a change of the offset where the file states none [m/s2]."""


class LaneChangeAction(Action):
    """LateralAction/LaneChangeAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._dynamics = Transition.read(node.need("LaneChangeActionDynamics"))
        self._target = node.need("LaneChangeTarget").only()
        if self._target.tag not in ("AbsoluteTargetLane", "RelativeTargetLane"):
            raise self._target.unsupported("AbsoluteTargetLane and RelativeTargetLane are read")
        self._value = self._target.whole("value")
        self._offset = node.number("targetLaneOffset", 0.0)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin to move to the middle of the target lane, or beside it."""
        motion, roads = on_roads(stage, actor, self.node)
        spot = motion.spot
        assert spot is not None
        lane = self._value
        if self._target.tag == "RelativeTargetLane":
            other = stage.motion(self._target.text("entityRef"), self._target)
            if other.spot is None:
                raise self.node.error("needs roads, and the scenario has no map")
            lane = beside(other.lane(roads), self._value * other.spot.way)
        known = roads.section(spot).lanes
        if lane not in known:
            numbers = ", ".join(str(one) for one in known)
            raise self._target.error(
                f"road '{spot.road}' has no lane {lane} at s = {spot.s:.4g} m", f"it has {numbers}"
            )
        t = motion.t(roads)
        changed = Spot(spot.road, spot.section, lane, spot.s, spot.way)
        left = spot.way * (t - roads.middle(changed))
        stage.put(actor, replace(motion, spot=changed, left=left))
        return shifted(stage, actor, self._dynamics, spot.way * self._offset, self.node)


class LaneOffsetAction(Action):
    """LateralAction/LaneOffsetAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        dynamics = node.need("LaneOffsetActionDynamics")
        self._shape = dynamics.choice("dynamicsShape", SHAPES)
        self._acceleration = dynamics.limit("maxLateralAcc")
        self._target = node.need("LaneOffsetTarget").only()
        if self._target.tag not in ("AbsoluteTargetLaneOffset", "RelativeTargetLaneOffset"):
            raise self._target.unsupported("AbsoluteTargetLaneOffset and RelativeTargetLaneOffset are read")
        self._value = self._target.number("value", unit="m")
        self._is_continuous = node.truth("continuous", False)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin to move beside the middle of the lane; the offset is positive in the direction of t."""
        motion, roads = on_roads(stage, actor, self.node)
        spot = motion.spot
        assert spot is not None
        own = Spot(spot.road, spot.section, motion.lane(roads), spot.s, spot.way)
        before = spot.way * (motion.t(roads) - roads.middle(own))
        stage.put(actor, replace(motion, spot=own, left=before))
        wanted = spot.way * self._value
        if self._target.tag == "RelativeTargetLaneOffset":
            other = stage.motion(self._target.text("entityRef"), self._target)
            assert other.spot is not None
            wanted += spot.way * (other.t(roads) - roads.middle(own))
        if self._shape == "step":
            return shifted(stage, actor, Transition("step", "time", 0.0), wanted, self.node)
        time = offset_time(self._shape, wanted - before, self._acceleration)
        return shifted(
            stage, actor, Transition(self._shape, "time", time), wanted, self.node, is_continuous=self._is_continuous
        )


class LateralDistanceAction(Action):
    """LateralAction/LateralDistanceAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._other = node.text("entityRef")
        self._measure = Distance(node, "lateral")
        self._gap = node.number("distance", 0.0, 0.0, unit="m")
        words = ("any", "leftToReferencedEntity", "rightToReferencedEntity")
        self._displacement = node.choice("displacement", words, "any")
        self._is_continuous = node.truth("continuous")
        constraints = node.child("DynamicConstraints")
        names = ("maxAcceleration", "maxDeceleration", "maxSpeed")
        limits = [math.inf] * 3 if constraints is None else [constraints.limit(name) for name in names]
        self._limits = (min(limits[0], _GENTLE), min(limits[1], _GENTLE), limits[2])

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin to keep the distance, on the side that is stated, else on the one where the actor is."""
        on_roads(stage, actor, self.node)
        now = self._measure.signed(stage, actor, self._other)
        if now is None:
            raise self.node.error(f"'{self._other}' is not on the roads")
        side = 1.0 if now >= 0.0 else -1.0
        if self._displacement != "any":
            side = 1.0 if self._displacement == "rightToReferencedEntity" else -1.0
        return KeepAside(actor, self._other, self._measure, self._gap, side, self._is_continuous, self._limits)


def offset_time(shape: str, change: float, acceleration: float) -> float:
    """Return how long a change of the offset takes with a largest lateral acceleration [s].

    A sinusoidal one has pi^2 d / (2 T^2) at its ends, a cubic one 6 d / T^2; a linear one is given the time of the
    cubic.
    """
    limit = acceleration if math.isfinite(acceleration) else _GENTLE
    factor = 0.5 * math.pi**2 if shape == "sinusoidal" else 6.0
    return math.sqrt(factor * abs(change) / limit)


def shifted(
    stage: Stage, actor: str, dynamics: Transition, wanted: float, node: Node, *, is_continuous: bool = False
) -> Process | None:
    """Return the change from the present offset to another one; at the start it may be a step."""
    motion = stage.motions[actor]
    change = wanted - motion.left
    distance = dynamics.value if dynamics.dimension == "distance" and dynamics.shape != "step" else 0.0
    time = 0.0 if distance > 0.0 else dynamics.time(change, node) if dynamics.dimension != "distance" else 0.0
    if distance <= 0.0 and time <= 0.0 and not (is_continuous and abs(change) < 1e-6):
        if stage.time > START and abs(change) > 0.05:
            raise node.unsupported(
                "give the shape sinusoidal, cubic or linear and a time", f"jumps {change:.3g} m to the side"
            )
        stage.put(actor, replace(motion, left=wanted))
        return None
    moved = (motion.travelled, motion.left, wanted)
    return Shift(node, stage.time, *moved, dynamics.shape, time, distance, is_continuous=is_continuous)


class FollowTrajectoryAction(Action):
    """RoutingAction/FollowTrajectoryAction."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        holder = node.child("TrajectoryRef") or node
        found = holder.need("Trajectory", "CatalogReference")
        if found.tag == "CatalogReference":
            found = catalogs.resolve(found)
        self._trajectory = Trajectory(found.declared(), catalogs)
        self._start = node.number("initialDistanceOffset", 0.0, 0.0)
        reference = node.child("TimeReference")
        timing = None if reference is None else reference.child("Timing")
        self._timing = None
        if timing is not None:
            is_absolute = timing.choice("domainAbsoluteRelative", ("absolute", "relative")) == "absolute"
            self._timing = (is_absolute, timing.number("scale", 1.0, 1e-6), timing.number("offset", 0.0))

    def first_place(self, stage: Stage) -> Place:
        """Return where the trajectory begins, for an entity that has no other place."""
        x, y, heading = self._trajectory.line(stage, "").at(self._start)
        return placed(stage.roads, x, y, heading)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Begin to follow the trajectory, whose positions are those of now."""
        motion, line = stage.motions[actor], self._trajectory.line(stage, actor)
        if self._start >= line.length:
            raise self.node.error(
                f"initialDistanceOffset = {self._start:g} m, the trajectory is {line.length:.4g} m long"
            )
        facing = -1 if motion.speed < 0.0 and self._timing is None else 1
        follow = Follow(line, self._start, None, facing)
        if self._timing is not None:
            if line.times is None:
                raise self.node.error("has a <Timing>, and its trajectory has no times", "give the points times")
            is_absolute, scale, offset = self._timing
            follow = Follow.timed(line, 0.0 if is_absolute else stage.time, scale, offset, self._start)
        start = self._start if self._timing is None else follow.way_at(stage.time)
        x, y, heading = line.at(start)
        away = math.hypot(x - motion.x, y - motion.y)
        if stage.time > START and away > GAP:
            raise self.node.unsupported(
                "let the trajectory begin where the entity is",
                f"begins {away:.3g} m away from '{actor}' at {stage.time:.4g} s; jumps",
            )
        heading += 0.0 if facing > 0 else math.pi
        stage.put(actor, replace(motion, x=x, y=y, heading=heading, along=start, drift=0.0))
        return follow


class AssignRouteAction(Action):
    """RoutingAction/AssignRouteAction and AcquirePositionAction: which way is taken at junctions."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._route = read_route(node, catalogs) if node.tag == "AssignRouteAction" else None
        self._goal = None if self._route is not None else read_position(node.need("Position"), catalogs)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Keep the roads of the route for the actor."""
        if self._route is not None:
            stage.routes[actor] = self._route.planned(stage)[1]
            return None
        motion, roads = on_roads(stage, actor, self.node)
        assert self._goal is not None
        goal = self._goal.place(stage).spot
        assert motion.spot is not None and goal is not None
        found = roads.roads_between(motion.spot, goal.road)
        if found is None:
            raise self.node.error(f"no road leads '{actor}' to this position")
        stage.routes[actor] = tuple(found)
        return None


class TeleportAction(Action):
    """PrivateAction/TeleportAction: a place at the start, or another one during the run.

    Who is carried elsewhere leaves one way and begins another, each smooth by itself; not the ego vehicle.
    """

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._position = read_position(node.need("Position"), catalogs)
        self.has_carried = False

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Put the actor at the position."""
        place = self._position.place(stage)
        known = stage.motions.get(actor)
        self.has_carried = False
        if known is None or stage.time <= START:
            stage.put(actor, at_place(place, stage.time, known))
            return None
        away = math.hypot(place.x - known.x, place.y - known.y)
        if away <= GAP:
            return None
        if actor == stage.hero:
            raise self.node.unsupported(
                "let it drive there: it carries the sensors",
                f"carries '{actor}' {away:.4g} m at {stage.time:.4g} s; the ego vehicle does not jump",
            )
        self.has_carried = True
        put = at_place(place, stage.time, known)
        stage.put(actor, replace(put, travelled=known.travelled, is_present=known.is_present, leap=known.leap + 1))
        return None


def at_place(place: Place, time: float, known: Motion | None = None) -> Motion:
    """Return the motion of an entity that is put at a place."""
    speed = 0.0 if known is None else known.speed
    return Motion(time, place.x, place.y, place.heading, speed, spot=place.spot, left=place.left, z=place.z)


class VisibilityAction(Action):
    """PrivateAction/VisibilityAction: not there for sensors is not there."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        seen = (node.truth("graphics"), node.truth("sensors"))
        if seen[0] != seen[1]:
            raise node.unsupported(
                "give both the same value", f"with graphics {seen[0]} and sensors {seen[1]} is not read".lower()
            )
        self._is_seen = seen[1]

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Show or hide the actor."""
        stage.show(actor, self._is_seen, self.node)
        return None


def on_roads(stage: Stage, actor: str, node: Node) -> tuple[Motion, Roads]:
    """Return an actor's motion and the roads; an error where there are none."""
    motion = stage.motions[actor]
    if stage.roads is None or motion.spot is None:
        raise node.error("needs roads, and the scenario has no map", "name a <LogicFile> or a scene of .xodr")
    return motion, stage.roads
