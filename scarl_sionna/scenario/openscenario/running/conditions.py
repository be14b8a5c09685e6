"""Conditions of OpenSCENARIO as numbers that are compared, or as states that last."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Protocol

import shapely

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.environment import Clock, date_time
from scarl_sionna.scenario.openscenario.reading.source import Node, parameter_name

from .distances import Distance, corners
from .motion import World, wrapped
from .positions import Position, read_position
from .signals import TrafficSignals

RULES = ("greaterThan", "lessThan", "equalTo", "greaterOrEqual", "lessOrEqual", "notEqualTo")
_SAME = 1e-4
"""Difference up to which two numbers count as equal."""
_STANDING = 1e-3
"""Speed below which an entity stands [m/s]."""
TRANSITIONS = ("startTransition", "endTransition", "stopTransition", "skipTransition")
STATES = ("standbyState", "runningState", "completeState")


class Stage(World, Protocol):
    """The run as conditions see it."""

    time: float
    signals: TrafficSignals

    @property
    def clock(self) -> Clock | None:
        """The time of day, where it is stated."""

    def element_state(self, kind: str, name: str, state: str, node: Node) -> bool:
        """Return whether an element of the storyboard is in a state, or in a transition right now."""


class Rule:
    """A comparison with a value; equality also where the value is passed between two instants."""

    def __init__(self, node: Node, value: float, default: str | None = None) -> None:
        self.kind, self.value = node.choice("rule", RULES, default), value

    def holds(self, found: float | None, before: float | None) -> bool:
        """Return whether a number fits, given the one at the instant before."""
        if found is None or math.isnan(found):
            return False
        away = found - self.value
        if self.kind in ("equalTo", "notEqualTo"):
            same = abs(away) <= _SAME
            if not same and before is not None and not math.isnan(before):
                same = (before - self.value) * away < 0.0
            return same if self.kind == "equalTo" else not same
        if self.kind == "greaterThan":
            return away > 0.0
        if self.kind == "greaterOrEqual":
            return away >= 0.0
        return away < 0.0 if self.kind == "lessThan" else away <= 0.0


class Test(ABC):
    """What a condition asks; it keeps what it saw at the last instant that was taken."""

    __test__ = False

    @abstractmethod
    def holds(self, stage: Stage) -> bool:
        """Return whether it is true now."""

    def keep(self, stage: Stage) -> None:  # noqa: B027  # most have nothing to keep
        """Keep what is needed of this instant."""

    def stirs(self, stage: Stage) -> bool:
        """Return whether something begins or ends now that `holds` will ask for later."""
        return False


class _Number(Test):
    """A number of the run that is compared."""

    def __init__(self, rule: Rule) -> None:
        self._rule, self._before = rule, math.nan

    @abstractmethod
    def _found(self, stage: Stage) -> float | None:
        """Return the number."""

    def holds(self, stage: Stage) -> bool:
        return self._rule.holds(self._found(stage), self._before)

    def keep(self, stage: Stage) -> None:
        found = self._found(stage)
        self._before = math.nan if found is None else found


class _Time(_Number):
    def __init__(self, node: Node) -> None:
        super().__init__(Rule(node, node.number("value", unit="s")))

    def _found(self, stage: Stage) -> float:
        return stage.time


class _Parameter(Test):
    def __init__(self, node: Node) -> None:
        name = "parameterRef" if node.has("parameterRef") else "variableRef"
        self._node, self._name = node, parameter_name(node, name)
        self._text, self._rule = node.text("value"), node.choice("rule", RULES)

    def holds(self, stage: Stage) -> bool:
        if self._name not in stage.parameters:
            raise self._node.error(f"'{self._name}' is not declared", f"known: {', '.join(stage.parameters)}")
        found = stage.parameters[self._name]
        try:
            return Rule(self._node, float(self._text)).holds(float(found), None)
        except ValueError:
            if self._rule not in ("equalTo", "notEqualTo"):
                raise self._node.error(
                    f"compares '{found[:40]}' and '{self._text[:40]}', which are no numbers"
                ) from None
            return (found == self._text) == (self._rule == "equalTo")


class _Element(Test):
    def __init__(self, node: Node) -> None:
        self._node = node
        self._kind, self._name = node.text("storyboardElementType"), node.text("storyboardElementRef")
        self._state = node.choice("state", (*TRANSITIONS, *STATES))

    def holds(self, stage: Stage) -> bool:
        return stage.element_state(self._kind, self._name, self._state, self._node)


class _TimeOfDay(_Number):
    """TimeOfDayCondition: of the day that the environment of <Init> states."""

    def __init__(self, node: Node) -> None:
        super().__init__(Rule(node, 0.0))
        self._node, self._when = node, date_time(node)

    def _found(self, stage: Stage) -> float:
        if stage.clock is None:
            raise self._node.error("the scenario has no time of day", "state a <TimeOfDay> in <Init>")
        return stage.clock.after(self._when, stage.time)


class _Signal(Test):
    """TrafficSignalCondition and TrafficSignalControllerCondition."""

    def __init__(self, node: Node) -> None:
        self._node, self._is_phase = node, node.tag == "TrafficSignalControllerCondition"
        self._name = node.text("trafficSignalControllerRef" if self._is_phase else "name")
        self._value = node.text("phase" if self._is_phase else "state")

    def holds(self, stage: Stage) -> bool:
        if self._is_phase:
            return stage.signals.phase(self._name, stage.time, self._node) == self._value
        return stage.signals.state(self._name, stage.time) == self._value


class _OfEntity(_Number):
    """A number of one triggering entity."""

    def __init__(self, node: Node, name: str, rule: Rule) -> None:
        super().__init__(rule)
        self.node, self.name = node, name


class _Speed(_OfEntity):
    def __init__(self, node: Node, name: str) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="m/s")))
        self._direction = node.choice("direction", ("longitudinal", "lateral", "vertical", "total"), "longitudinal")

    def _found(self, stage: Stage) -> float:
        motion = stage.motion(self.name, self.node)
        if self._direction == "lateral":
            return motion.drift
        return 0.0 if self._direction == "vertical" else motion.speed


class _Acceleration(_OfEntity):
    def __init__(self, node: Node, name: str) -> None:
        super().__init__(node, name, Rule(node, node.number("value")))
        if node.choice("direction", ("longitudinal", "lateral", "vertical", "total"), "longitudinal") in ("lateral",):
            raise node.unsupported("the longitudinal acceleration is read")

    def _found(self, stage: Stage) -> float:
        return stage.motion(self.name, self.node).acceleration


class _RelativeSpeed(_OfEntity):
    def __init__(self, node: Node, name: str) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="m/s")))
        if node.choice("direction", ("longitudinal", "lateral", "vertical", "total"), "longitudinal") == "lateral":
            raise node.unsupported("the longitudinal speed is read")
        self._other = node.text("entityRef")

    def _found(self, stage: Stage) -> float:
        own, other = stage.motion(self.name, self.node), stage.motion(self._other, self.node)
        return own.speed - other.speed


class _Travelled(_OfEntity):
    def __init__(self, node: Node, name: str) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="m"), "greaterOrEqual"))

    def _found(self, stage: Stage) -> float:
        return stage.motion(self.name, self.node).travelled


class _Away(_OfEntity):
    """DistanceCondition and RelativeDistanceCondition."""

    def __init__(self, node: Node, name: str, target: Position | None) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="m")))
        self._measure = Distance(node)
        self._target = target
        self._other = "" if target is not None else node.text("entityRef")

    def _found(self, stage: Stage) -> float | None:
        stage.motion(self.name, self.node)
        target = self._other if self._target is None else self._target.place(stage)
        found = self._measure.signed(stage, self.name, target)
        return None if found is None else abs(found)


class _Headway(_OfEntity):
    """TimeHeadwayCondition: the time to where the other one is; of others behind there is none."""

    def __init__(self, node: Node, name: str) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="s")))
        self._measure = Distance(node, "longitudinal")
        self._other = node.text("entityRef")

    def _found(self, stage: Stage) -> float | None:
        speed = stage.motion(self.name, self.node).speed
        found = self._measure.signed(stage, self.name, self._other)
        if found is None or found < 0.0:
            return None
        return found / speed if speed > _STANDING else math.inf


class _Collision(_OfEntity):
    """TimeToCollisionCondition: the distance by the speed at which it becomes smaller."""

    def __init__(self, node: Node, name: str, catalogs: Catalogs) -> None:
        super().__init__(node, name, Rule(node, node.number("value", unit="s")))
        self._measure = Distance(node, "longitudinal")
        target = node.need("TimeToCollisionConditionTarget").only()
        self._target: str | Position
        if target.tag == "EntityRef":
            self._target = target.text("entityRef")
        else:
            self._target = read_position(target, catalogs)

    def _found(self, stage: Stage) -> float | None:
        stage.motion(self.name, self.node)
        target = self._target if isinstance(self._target, str) else self._target.place(stage)
        found = self._measure.signed(stage, self.name, target)
        if found is None:
            return None
        closing = self._measure.closing(stage, self.name, target, found)
        return abs(found) / closing if closing > 1e-6 else None


class _Reach(Test):
    def __init__(self, node: Node, name: str, catalogs: Catalogs) -> None:
        self.node, self.name = node, name
        self._tolerance = node.number("tolerance", low=0.0, unit="m")
        self._position = read_position(node.need("Position"), catalogs)

    def holds(self, stage: Stage) -> bool:
        own, place = stage.motion(self.name, self.node), self._position.place(stage)
        return math.hypot(place.x - own.x, place.y - own.y) <= self._tolerance


class _Lasting(Test):
    """A state that must have lasted for a time."""

    def __init__(self, node: Node, name: str) -> None:
        self.node, self.name = node, name
        self._duration = node.number("duration", 0.0, 0.0, unit="s")
        self._since: float | None = None

    @abstractmethod
    def _is(self, stage: Stage) -> bool:
        """Return whether the state is there."""

    def holds(self, stage: Stage) -> bool:
        if not self._is(stage):
            return False
        since = stage.time if self._since is None else self._since
        return stage.time - since >= self._duration - 1e-9

    def stirs(self, stage: Stage) -> bool:
        return self._duration > 0.0 and self._is(stage) != (self._since is not None)

    def keep(self, stage: Stage) -> None:
        if not self._is(stage):
            self._since = None
        elif self._since is None:
            self._since = stage.time


class _StandStill(_Lasting):
    def _is(self, stage: Stage) -> bool:
        return abs(stage.motion(self.name, self.node).speed) < _STANDING


class _EndOfRoad(_Lasting):
    def _is(self, stage: Stage) -> bool:
        return stage.motion(self.name, self.node).beyond > 0.0


class _OffRoad(_Lasting):
    def _is(self, stage: Stage) -> bool:
        motion = stage.motion(self.name, self.node)
        if motion.beyond > 0.0:
            return True
        if stage.roads is None or motion.spot is None:
            return False
        table = stage.roads.lanes(motion.spot.road, motion.spot.section)
        return table.beside(motion.spot.s, motion.t(stage.roads)) > 0.0


class _Touch(Test):
    """CollisionCondition: bounding boxes overlap in plan."""

    def __init__(self, node: Node, name: str) -> None:
        target = node.only()
        if target.tag not in ("EntityRef", "ByType"):
            raise target.unsupported("EntityRef and ByType are read")
        self.node, self.name = node, name
        self._other = target.text("entityRef") if target.tag == "EntityRef" else ""
        self._kind = target.text("type", "") if target.tag == "ByType" else ""

    def holds(self, stage: Stage) -> bool:
        own = stage.motion(self.name, self.node)
        mine = shapely.Polygon(corners(own, stage.entities[self.name].box))
        for name, entity in stage.entities.items():
            kind = {"object": "miscellaneous"}.get(entity.kind, entity.kind)
            wanted = name == self._other if self._other else kind == self._kind
            if name == self.name or not wanted or name not in stage.motions or not stage.motions[name].is_present:
                continue
            if mine.intersects(shapely.Polygon(corners(stage.motions[name], entity.box))):
                return True
        return False


class _Clearance(Test):
    """RelativeClearanceCondition (1.2): nobody is on some lanes from behind to before the entity."""

    def __init__(self, node: Node, name: str) -> None:
        self.node, self.name = node, name
        self._reach = (node.number("distanceBackward", 0.0, 0.0), node.number("distanceForward", 0.0, 0.0))
        self._with_oncoming, is_free = node.truth("oppositeLanes"), node.truth("freeSpace")
        ranges = node.children("RelativeLaneRange")
        self._lanes = [(one.number("from", -99.0), one.number("to", 99.0)) for one in ranges]
        self._others = [one.text("entityRef") for one in node.children("EntityRef")]
        self._measure = Distance(node, "longitudinal")
        self._measure.system, self._measure.kind, self._measure.is_free = "road", "longitudinal", is_free

    def holds(self, stage: Stage) -> bool:
        own, roads = stage.motion(self.name, self.node), stage.roads
        if roads is None or own.spot is None:
            raise self.node.error("needs roads, and the scenario has no map")
        here = own.lane(roads)
        for name in self._others or list(stage.motions):
            other = stage.motion(name, self.node)
            if name == self.name or not other.is_present or other.spot is None:
                continue
            if not self._with_oncoming and math.cos(other.heading - own.heading) < 0.0:
                continue
            there = other.lane(roads)
            lanes = own.spot.way * (there - here - ((there > 0) - (here > 0)))  # there is no lane 0
            if self._lanes and not any(low <= lanes <= high for low, high in self._lanes):
                continue
            away = self._measure.signed(stage, self.name, name)
            if away is not None and -self._reach[0] <= away <= self._reach[1]:
                return False
        return True


class _RelativeAngle(_OfEntity):
    """RelativeAngleCondition (1.3): difference of the headings."""

    def __init__(self, node: Node, name: str) -> None:
        self._node, self._other = node, node.text("entityRef")
        if node.choice("angleType", ("heading", "pitch", "roll"), "heading") != "heading":
            raise node.unsupported("the heading is read")
        self._angle, self._tolerance = node.number("angle"), node.number("angleTolerance", 0.0, 0.0)
        rule = Rule(node, self._tolerance + 1e-9, "lessOrEqual")
        super().__init__(node, name, rule)

    def _found(self, stage: Stage) -> float:
        own, other = stage.motion(self.name, self._node), stage.motion(self._other, self._node)
        return abs(wrapped(own.heading - other.heading - self._angle))


class _Angle(_OfEntity):
    """AngleCondition (1.3): the heading in the world, or against the direction of the road or of the lane."""

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        if node.choice("angleType", ("heading", "pitch", "roll"), "heading") != "heading":
            raise node.unsupported("the heading is read")
        self._system = node.choice("coordinateSystem", ("entity", "lane", "road", "trajectory", "world"), "world")
        if self._system in ("entity", "trajectory"):
            raise node.unsupported("coordinateSystem world, road and lane are read")
        self._angle, self._tolerance = node.number("angle"), node.number("angleTolerance", 0.0, 0.0)
        super().__init__(node, name, Rule(node, self._tolerance + 1e-9, "lessOrEqual"))

    def _found(self, stage: Stage) -> float:
        own, base = stage.motion(self.name, self._node), 0.0
        if self._system != "world":
            if stage.roads is None or own.spot is None:
                raise self._node.error("needs roads, and the scenario has no map")
            base = stage.roads.point(own.spot.road, own.spot.s, 0.0)[2]
            if self._system == "lane":
                way = stage.roads.direction(own.spot.road, own.spot.section, own.lane(stage.roads))
                base += 0.0 if way > 0 else math.pi
        return abs(wrapped(own.heading - base - self._angle))


def read_test(node: Node, name: str, catalogs: Catalogs) -> Test:
    """Return the test in an ``<EntityCondition>`` for one triggering entity.

    Raises
    ------
    ScenarioError
        If it is not read or a value of it is wrong.
    """
    plain: dict[str, type[_OfEntity | _Lasting | _Touch | _Clearance]] = {
        "SpeedCondition": _Speed,
        "AccelerationCondition": _Acceleration,
        "RelativeSpeedCondition": _RelativeSpeed,
        "TraveledDistanceCondition": _Travelled,
        "TimeHeadwayCondition": _Headway,
        "StandStillCondition": _StandStill,
        "EndOfRoadCondition": _EndOfRoad,
        "OffroadCondition": _OffRoad,
        "CollisionCondition": _Touch,
        "RelativeAngleCondition": _RelativeAngle,
        "AngleCondition": _Angle,
        "RelativeClearanceCondition": _Clearance,
    }
    if node.tag in plain:
        return plain[node.tag](node, name)  # type: ignore[call-arg]
    if node.tag == "TimeToCollisionCondition":
        return _Collision(node, name, catalogs)
    if node.tag == "ReachPositionCondition":
        return _Reach(node, name, catalogs)
    if node.tag == "DistanceCondition":
        return _Away(node, name, read_position(node.need("Position"), catalogs))
    if node.tag == "RelativeDistanceCondition":
        return _Away(node, name, None)
    raise node.unsupported("see the table of conditions in docs/openscenario.md")


def read_value_test(node: Node) -> Test:
    """Return the test in a ``<ByValueCondition>``."""
    if node.tag == "SimulationTimeCondition":
        return _Time(node)
    if node.tag in ("ParameterCondition", "VariableCondition"):
        return _Parameter(node)
    if node.tag == "StoryboardElementStateCondition":
        return _Element(node)
    if node.tag in ("TrafficSignalCondition", "TrafficSignalControllerCondition"):
        return _Signal(node)
    if node.tag == "TimeOfDayCondition":
        return _TimeOfDay(node)
    remedy = {
        "UserDefinedValueCondition": "use a ParameterCondition",
    }
    raise node.unsupported(remedy.get(node.tag, "see the table of conditions in docs/openscenario.md"))
