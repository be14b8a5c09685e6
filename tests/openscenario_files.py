"""OpenSCENARIO files as texts, put together by the tests, and where their entities are at a time."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np

from scarl_sionna.scenario.openscenario.actors import read_openscenario
from scarl_sionna.scenario.traffic.planned import PlannedActor
from tests import street_maps as maps

LANE = 3.5
LENGTH = 900.0
STRAIGHT = maps.street_map(
    maps.road(
        maps.piece("<line/>", LENGTH),
        LENGTH,
        maps.section([maps.lane(1)], [maps.lane(-1, mark="broken"), maps.lane(-2)]),
    )
)
"""Road 1 along +x from the origin: lane 1 comes back, lanes -1 and -2 lead away; each 3.5 m wide."""
RADIUS = 60.0
ARC = maps.street_map(maps.road(maps.piece(f'<arc curvature="{1.0 / RADIUS!r}"/>', 150.0), 150.0))
"""Road 1, a bend to the left from the origin, beginning along +x."""


def vehicle(name: str, category: str = "car", more: str = "") -> str:
    """Return a ScenarioObject with a box of 4.5 m, 1.4 m before its rear axle."""
    return (
        f'<ScenarioObject name="{name}"><Vehicle name="v" vehicleCategory="{category}">'
        '<BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>'
        '<Performance maxSpeed="70" maxDeceleration="10" maxAcceleration="8"/>'
        f"<Properties/></Vehicle>{more}</ScenarioObject>"
    )


def on_lane(s: float, lane: int = -1, road: str = "1", offset: float = 0.0, more: str = "") -> str:
    """Return a Position on a lane."""
    inside = f'<LanePosition roadId="{road}" laneId="{lane}" s="{s!r}" offset="{offset!r}">{more}</LanePosition>'
    return f"<Position>{inside}</Position>"


def teleport(position: str) -> str:
    """Return a PrivateAction that puts an entity at a place."""
    return f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"


def speed(
    value: float, shape: str = "step", dimension: str = "time", amount: float = 0.0, target: str | None = None
) -> str:
    """Return a PrivateAction that changes the speed."""
    aim = target or f'<AbsoluteTargetSpeed value="{value!r}"/>'
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        f'<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{amount!r}"/>'
        f"<SpeedActionTarget>{aim}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"
    )


def lane_change(target: str, shape: str = "sinusoidal", dimension: str = "time", amount: float = 3.0) -> str:
    """Return a PrivateAction that changes the lane."""
    return (
        "<PrivateAction><LateralAction><LaneChangeAction>"
        f'<LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{amount!r}"/>'
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"
    )


def init(name: str, position: str, value: float = 0.0, more: str = "") -> str:
    """Return the Init actions of an entity."""
    return f'<Private entityRef="{name}">{teleport(position)}{speed(value)}{more}</Private>'


def condition(inside: str, edge: str = "rising", delay: float = 0.0) -> str:
    """Return a ConditionGroup of one condition."""
    return (
        f'<ConditionGroup><Condition name="c" conditionEdge="{edge}" delay="{delay!r}">{inside}</Condition>'
        "</ConditionGroup>"
    )


def after(seconds: float) -> str:
    """Return the group that is true from a time on."""
    test = f'<SimulationTimeCondition value="{seconds!r}" rule="greaterThan"/>'
    return condition(f"<ByValueCondition>{test}</ByValueCondition>", "none")


def of_entity(name: str, test: str, edge: str = "rising", delay: float = 0.0) -> str:
    """Return the group of a condition of an entity."""
    return condition(
        f'<ByEntityCondition><TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="{name}"/>'
        f"</TriggeringEntities><EntityCondition>{test}</EntityCondition></ByEntityCondition>",
        edge,
        delay,
    )


def event(action: str, trigger: str, name: str = "event", priority: str = "parallel", count: int = 1) -> str:
    """Return an Event."""
    begin = f"<StartTrigger>{trigger}</StartTrigger>" if trigger else ""
    return (
        f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{count}">'
        f'<Action name="{name}_action">{action}</Action>{begin}</Event>'
    )


def group(actor: str, *events: str, name: str = "group") -> str:
    """Return a ManeuverGroup of one actor and one Maneuver."""
    actors = f'<EntityRef entityRef="{actor}"/>' if actor else ""
    return (
        f'<ManeuverGroup name="{name}" maximumExecutionCount="1"><Actors selectTriggeringEntities="false">{actors}'
        f'</Actors><Maneuver name="{name}_maneuver">{"".join(events)}</Maneuver></ManeuverGroup>'
    )


def scenario(
    entities: str,
    actions: str,
    groups: str = "",
    stop: float | str = 10.0,
    *,
    parameters: str = "",
    catalogs: str = "",
    map_file: str | None = "road.xodr",
    minor: int = 2,
) -> str:
    """Return a whole file; `actions` are those of Init, `groups` those of its one act."""
    logic = "" if map_file is None else f'<LogicFile filepath="{map_file}"/>'
    act = ""
    if groups:
        begin = f"<StartTrigger>{after(0.0)}</StartTrigger>"
        act = f'<Story name="story"><Act name="act">{groups}{begin}</Act></Story>'
    end = after(stop) if isinstance(stop, float) else stop
    return (
        f'<?xml version="1.0"?>\n<OpenSCENARIO>\n<FileHeader revMajor="1" revMinor="{minor}" '
        f'date="2024-01-01T00:00:00" description="" author=""/>\n'
        f"<ParameterDeclarations>{parameters}</ParameterDeclarations>\n"
        f"<CatalogLocations>{catalogs}</CatalogLocations>\n<RoadNetwork>{logic}</RoadNetwork>\n"
        f"<Entities>{entities}</Entities>\n<Storyboard>\n<Init><Actions>{actions}</Actions></Init>\n{act}\n"
        f"<StopTrigger>{end}</StopTrigger>\n</Storyboard>\n</OpenSCENARIO>\n"
    )


def written(folder: Path, text: str, street: str = STRAIGHT) -> Path:
    """Write a scenario and its map and return its path."""
    (folder / "road.xodr").write_text(street)
    path = folder / "drive.xosc"
    path.write_text(text)
    return path


def run(folder: Path, text: str, street: str = STRAIGHT) -> dict[str, PlannedActor]:
    """Return the actors of a scenario, by name; a warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return {actor.name: actor for actor in read_openscenario(written(folder, text, street))}


def rear_axle(actor: PlannedActor, time: float) -> np.ndarray:
    """Return where the reference point of an entity is: its rear axle on the ground (3,) [m]."""
    pose = actor.trajectory.pose(time)
    return pose.position + pose.rotation @ np.array([actor.body.rear_axle, 0.0, 0.0])
