"""Which element of an Action is which action; those that are not read are errors, those without effect are noted."""

from __future__ import annotations

from dataclasses import replace

from scarl_sionna.scenario.openscenario.reading.catalogs import Catalogs
from scarl_sionna.scenario.openscenario.reading.environment import read_environment
from scarl_sionna.scenario.openscenario.reading.source import Node, parameter_name
from scarl_sionna.scenario.openscenario.reading.swarms import Swarm

from .actions import Action, DistanceAction, SpeedAction, SpeedProfileAction, Stage, SynchronizeAction
from .placing import (
    AssignRouteAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    TeleportAction,
    VisibilityAction,
)
from .processes import Process

_REMEDY = {
    "RandomRouteAction": "use an AssignRouteAction",
    "TrafficAction": "a TrafficSwarmAction is read; or name the vehicles, or write a scenario file whose `traffic` is "
    "built in (density), with this file's entities as its `actors` by tables",
    "UserDefinedAction": "use actions of the standard",
    "TrailerAction": "let the trailer be an entity of its own",
}


class _Nothing(Action):
    """An action without an effect on motion."""

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Do nothing."""
        return None


class _Parameter(Action):
    """GlobalAction/ParameterAction or VariableAction."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._name = parameter_name(node, "parameterRef" if node.has("parameterRef") else "variableRef")
        self._change = node.only()
        kind = self._change.tag.replace("Parameter", "").replace("Variable", "")
        if kind == "SetAction":
            self._value = self._change.text("value")
            self._rule = None
        elif kind == "ModifyAction":
            rule = self._change.need("Rule").only()
            self._rule, self._by = rule.tag, rule.number("value")
            if rule.tag not in ("AddValue", "MultiplyByValue"):
                raise rule.unsupported("AddValue and MultiplyByValue are read")
        else:
            raise self._change.unsupported("SetAction and ModifyAction are read")

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Change the value that conditions see."""
        if self._name not in stage.parameters:
            raise self.node.error(f"'{self._name}' is not declared", f"known: {', '.join(stage.parameters)}")
        if self._rule is None:
            stage.parameters[self._name] = self._value
            return None
        try:
            before = float(stage.parameters[self._name])
        except ValueError:
            raise self.node.error(f"'{self._name}' = '{stage.parameters[self._name][:40]}' is no number") from None
        stage.parameters[self._name] = repr(before + self._by if self._rule == "AddValue" else before * self._by)
        return None


class _EntityAction(Action):
    """GlobalAction/EntityAction: an entity comes or goes."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._name = node.text("entityRef")
        self._what = node.only()
        if self._what.tag not in ("AddEntityAction", "DeleteEntityAction"):
            raise self._what.unsupported("AddEntityAction and DeleteEntityAction are read")
        self._teleport = None
        if self._what.tag == "AddEntityAction":
            self._teleport = TeleportAction(self._what, catalogs)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Let the entity be there from now on, or no more."""
        if self._name not in stage.entities:
            raise self.node.error(f"'{self._name}' is no entity", f"known: {', '.join(stage.entities)}")
        if self._teleport is not None:
            self._teleport.begin(stage, self._name)
        stage.show(self._name, self._teleport is not None, self.node)
        return None


class _EnvironmentAction(Action):
    """GlobalAction/EnvironmentAction: light and weather from now on."""

    def __init__(self, node: Node, catalogs: Catalogs) -> None:
        super().__init__(node)
        self._stated = read_environment(node, catalogs)

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Let it hold from now on."""
        stage.surround(self._stated)
        return None


class _SwarmAction(Action):
    """GlobalAction/TrafficAction/TrafficSwarmAction: vehicles round an entity from now on."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        self._swarm = Swarm.read(node.need("TrafficSwarmAction"))

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Let it be there from now on."""
        if self._swarm.central not in stage.entities:
            raise self.node.error(f"'{self._swarm.central}' is no entity", f"known: {', '.join(stage.entities)}")
        stage.swarms.append(replace(self._swarm, start=stage.time))
        return None


class _SignalAction(Action):
    """GlobalAction/InfrastructureAction/TrafficSignalAction: the state of a signal, or the phase of a controller."""

    def __init__(self, node: Node) -> None:
        super().__init__(node)
        what = node.need("TrafficSignalAction").only()
        if what.tag not in ("TrafficSignalStateAction", "TrafficSignalControllerAction"):
            raise what.unsupported("TrafficSignalStateAction and TrafficSignalControllerAction are read")
        if what.child("Phase") is not None:
            raise what.unsupported("put the phases into the controller in <RoadNetwork>", "brings phases of its own")
        self._is_state, self._what = what.tag == "TrafficSignalStateAction", what
        self._name = what.text("name" if self._is_state else "trafficSignalControllerRef")
        self._value = what.text("state" if self._is_state else "phase")

    def begin(self, stage: Stage, actor: str) -> Process | None:
        """Set it now."""
        if self._is_state:
            stage.signals.set_state(self._name, self._value, stage.time)
        else:
            stage.signals.set_phase(self._name, self._value, stage.time, self._what)
        return None


def read_action(node: Node, catalogs: Catalogs) -> list[Action]:
    """Return the actions in an ``<Action>`` of an event.

    Raises
    ------
    ScenarioError
        If an action is not read or a value of it is wrong.
    """
    found: list[Action] = []
    for one in node.children():
        if one.tag == "PrivateAction":
            found += read_private(one, catalogs)
        elif one.tag == "GlobalAction":
            found += read_global(one, catalogs)
        else:
            raise one.unsupported(_REMEDY.get(one.tag, "PrivateAction and GlobalAction are read"))
    return found


def read_private(node: Node, catalogs: Catalogs) -> list[Action]:
    """Return the actions in a ``<PrivateAction>``."""
    found: list[Action] = []
    for one in node.children():
        if one.tag in ("LongitudinalAction", "LateralAction", "RoutingAction"):
            found += [_read(inner, catalogs) for inner in one.children()]
        elif one.tag in ("ControllerAction", "ActivateControllerAction", "AssignControllerAction"):
            one.note("has no effect: the entity keeps lane and speed but for its actions")
            found.append(_Nothing(one))
        elif one.tag == "AppearanceAction":
            one.note("has no effect")
            found.append(_Nothing(one))
        else:
            found.append(_read(one, catalogs))
    return found


def _read(node: Node, catalogs: Catalogs) -> Action:
    plain: dict[str, type[Action]] = {
        "SpeedAction": SpeedAction,
        "SpeedProfileAction": SpeedProfileAction,
        "LongitudinalDistanceAction": DistanceAction,
        "LaneChangeAction": LaneChangeAction,
        "LaneOffsetAction": LaneOffsetAction,
        "LateralDistanceAction": LateralDistanceAction,
        "VisibilityAction": VisibilityAction,
    }
    if node.tag in plain:
        return plain[node.tag](node)
    if node.tag == "TeleportAction":
        return TeleportAction(node, catalogs)
    if node.tag == "SynchronizeAction":
        return SynchronizeAction(node, catalogs)
    if node.tag == "FollowTrajectoryAction":
        return FollowTrajectoryAction(node, catalogs)
    if node.tag in ("AssignRouteAction", "AcquirePositionAction"):
        return AssignRouteAction(node, catalogs)
    raise node.unsupported(_REMEDY.get(node.tag, "see the table of actions in docs/openscenario.md"))


def read_global(node: Node, catalogs: Catalogs) -> list[Action]:
    """Return the actions in a ``<GlobalAction>``."""
    found: list[Action] = []
    for one in node.children():
        if one.tag == "EnvironmentAction":
            found.append(_EnvironmentAction(one, catalogs))
        elif one.tag in ("ParameterAction", "VariableAction"):
            found.append(_Parameter(one))
        elif one.tag == "EntityAction":
            found.append(_EntityAction(one, catalogs))
        elif one.tag == "InfrastructureAction":
            found.append(_SignalAction(one))
        elif one.tag == "TrafficAction" and one.child("TrafficSwarmAction") is not None:
            found.append(_SwarmAction(one))
        elif one.tag == "SetMonitorAction":
            found.append(_Nothing(one))
        else:
            raise one.unsupported(_REMEDY.get(one.tag, "see the table of actions in docs/openscenario.md"))
    return found
