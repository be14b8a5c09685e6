"""Entities of a scenario: ScenarioObjects with their measures and limits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from .catalogs import Catalogs
from .source import Node

MOST_ENTITIES = 500
_KINDS = {"Vehicle": "vehicle", "Pedestrian": "pedestrian", "MiscObject": "object"}
_CATEGORY = {"vehicle": "vehicleCategory", "pedestrian": "pedestrianCategory", "object": "miscObjectCategory"}

MODELS: Mapping[str, tuple[str, ...]] = {
    "car": ("small_car", "saloon", "estate", "suv", "pickup"), "van": ("van",),
    "truck": ("box_van", "lorry", "articulated_lorry"), "bus": ("bus", "coach"), "tram": ("tram",),
    "motorbike": ("motorcycle",), "bicycle": ("bicycle",), "standup_scooter": ("scooter",),
    "standupScooter": ("scooter",), "wheelchair": ("wheelchair",), "animal": ("dog",),
}  # fmt: skip # a table
"""Actor models by category of vehicles."""


@dataclass(frozen=True)
class Box:
    """Bounding box: middle from the reference point, and size [m]."""

    x: float = 1.4
    y: float = 0.0
    z: float = 0.75
    length: float = 4.5
    width: float = 1.8
    height: float = 1.5

    @property
    def front(self) -> float:
        """How far the box reaches before the reference point [m]."""
        return self.x + 0.5 * self.length

    @property
    def rear(self) -> float:
        """How far the box reaches behind the reference point [m]."""
        return 0.5 * self.length - self.x


@dataclass(frozen=True, eq=False)
class Entity:
    """One ScenarioObject.

    Attributes
    ----------
    name : str
    kind : str
        ``vehicle``, ``pedestrian`` or ``object``.
    category : str
        That of the file, as ``car``.
    label : str
        Name of the vehicle, as in a catalog.
    box : Box
    max_speed, max_acceleration, max_deceleration : float
        Of its Performance [m/s, m/s2].
    node : Node
        Where it stands.
    properties : mapping
    """

    name: str
    kind: str
    category: str
    label: str
    box: Box
    max_speed: float
    max_acceleration: float
    max_deceleration: float
    node: Node
    properties: Mapping[str, str] = field(default_factory=dict)


def read_entities(root: Node, catalogs: Catalogs) -> dict[str, Entity]:
    """Return the entities of a scenario by name, in the order of the file.

    Raises
    ------
    ScenarioError
        If an element or value of one is wrong, or a name stands twice.
    """
    found: dict[str, Entity] = {}
    holder = root.need("Entities")
    objects = holder.children("ScenarioObject")
    if not 1 <= len(objects) <= MOST_ENTITIES:
        raise holder.error(f"has {len(objects)} <ScenarioObject>", f"1 to {MOST_ENTITIES} are read")
    for selection in holder.children("EntitySelection"):
        selection.problems.errors.append(selection.unsupported("name the entities one by one"))
    for node in objects:
        with root.problems.collected():
            entity = _entity(node, catalogs)
            if entity.name in found:
                raise node.error(f"'{entity.name}' is the name of another entity")
            found[entity.name] = entity
    return found


def _entity(node: Node, catalogs: Catalogs) -> Entity:
    name = node.text("name")
    body = node.need("Vehicle", "Pedestrian", "MiscObject", "CatalogReference", "ExternalObjectReference")
    if body.tag == "CatalogReference":
        body = catalogs.resolve(body)
    if body.tag not in _KINDS:
        raise body.unsupported("give a Vehicle, Pedestrian or MiscObject")
    for controller in node.children("ObjectController"):
        if controller.children():
            controller.note("has no effect: the entity keeps lane and speed but for its actions")
    body = body.declared()
    kind = _KINDS[body.tag]
    category = body.text(_CATEGORY[kind], "none")
    for trailer in body.children("Trailer"):
        if trailer.children("Trailer", "Vehicle", "CatalogReference"):
            trailer.note("is not there: give it as an entity of its own")
    performance = body.child("Performance")
    limits = [math.inf] * 3
    if performance is not None:
        limits = [performance.limit(one) for one in ("maxSpeed", "maxAcceleration", "maxDeceleration")]
    properties: dict[str, str] = {}
    for holder in body.children("Properties"):
        for one in holder.children("Property"):
            properties[str(one.element.get("name", ""))] = one.text("value", "")
    return Entity(
        name, kind, category, body.name(), _box(body, kind), limits[0], limits[1], limits[2], node, properties
    )


def _box(body: Node, kind: str) -> Box:
    holder = body.child("BoundingBox")
    if holder is None:
        return Box() if kind == "vehicle" else Box(0.0, 0.0, 0.9, 0.6, 0.6, 1.8)
    center, size = holder.need("Center"), holder.need("Dimensions")
    return Box(
        *(center.number(axis, low=-100.0, high=100.0) for axis in "xyz"),
        *(size.number(one, low=0.0, high=100.0) for one in ("length", "width", "height")),
    )
