"""Constant tables of nuScenes, what our classes become in them, and tokens.

References
----------
.. [1] H. Caesar et al., "nuScenes: A multimodal dataset for autonomous driving", CVPR 2020, and its schema page.
.. [2] W. K. Fong et al., "Panoptic nuScenes", 2021: the 32 classes of lidarseg.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset.derived.boxes import MOVING_SPEED

TABLES = (
    "category",
    "attribute",
    "visibility",
    "instance",
    "sensor",
    "calibrated_sensor",
    "ego_pose",
    "log",
    "scene",
    "sample",
    "sample_data",
    "sample_annotation",
    "map",
)
"""Tables that the reader of nuScenes requires."""

CATEGORIES = (
    "noise", "animal", "human.pedestrian.adult", "human.pedestrian.child", "human.pedestrian.construction_worker",
    "human.pedestrian.personal_mobility", "human.pedestrian.police_officer", "human.pedestrian.stroller",
    "human.pedestrian.wheelchair", "movable_object.barrier", "movable_object.debris",
    "movable_object.pushable_pullable", "movable_object.trafficcone", "static_object.bicycle_rack", "vehicle.bicycle",
    "vehicle.bus.bendy", "vehicle.bus.rigid", "vehicle.car", "vehicle.construction", "vehicle.emergency.ambulance",
    "vehicle.emergency.police", "vehicle.motorcycle", "vehicle.trailer", "vehicle.truck", "flat.driveable_surface",
    "flat.other", "flat.sidewalk", "flat.terrain", "static.manmade", "static.other", "static.vegetation", "vehicle.ego",
)  # fmt: skip # a table
"""Category names; the index is the lidarseg label."""

CATEGORY_OF_CLASS = {
    "Unlabeled": "noise", "Roads": "flat.driveable_surface", "SideWalks": "flat.sidewalk", "Building": "static.manmade",
    "Wall": "static.manmade", "Fence": "static.manmade", "Pole": "static.manmade", "TrafficLight": "static.manmade",
    "TrafficSign": "static.manmade", "Vegetation": "static.vegetation", "Terrain": "flat.terrain", "Sky": "noise",
    "Pedestrian": "human.pedestrian.adult", "Rider": "human.pedestrian.adult", "Car": "vehicle.car",
    "Truck": "vehicle.truck", "Bus": "vehicle.bus.rigid", "Train": "static.other", "Motorcycle": "vehicle.motorcycle",
    "Bicycle": "vehicle.bicycle", "Static": "static.other", "Dynamic": "movable_object.pushable_pullable",
    "Other": "static.other", "Water": "flat.other", "RoadLine": "flat.driveable_surface", "Ground": "flat.other",
    "Bridge": "static.manmade", "RailTrack": "flat.other", "GuardRail": "static.manmade",
}  # fmt: skip # a table
"""Category of each of our semantic classes."""

LIDARSEG_LABEL = np.array([CATEGORIES.index(CATEGORY_OF_CLASS[name]) for name in SEMANTIC_CLASSES], dtype=np.uint8)
"""Lidarseg label by semantic id."""

CHILD_HEIGHT = 1.5
"""Pedestrians whose box is lower are children [m], as Germany's road traffic act (StVO, section 21) has it of those who
need a seat of their own: the dataset holds their size, not their age."""
RIDDEN_HEIGHT = 1.35
"""Cycles whose box is higher have a rider on them [m]."""
CATEGORY_OF_MODEL = {
    "wheelchair": "human.pedestrian.wheelchair", "pram": "human.pedestrian.stroller", "dog": "animal",
    "scooter": "human.pedestrian.personal_mobility", "sitting_man": "human.pedestrian.adult",
}  # fmt: skip # a table
"""Category of actor models whose class or size does not tell."""
_TRAFFIC = re.compile(r"traffic_(.+)_\d+")
_CHILD = "human.pedestrian.child"
_SITTING = ("sitting_man", "wheelchair")

VISIBILITY_LEVELS = (("v0-40", 0.4), ("v40-60", 0.6), ("v60-80", 0.8), ("v80-100", 1.0))
ATTRIBUTES = {
    "cycle.with_rider": "a rider is on it", "cycle.without_rider": "no rider is on it",
    "pedestrian.moving": "faster than 0.5 m/s", "pedestrian.standing": "slower than 0.5 m/s",
    "pedestrian.sitting_lying_down": "on a bench or in a wheelchair",
    "vehicle.moving": "faster than 0.5 m/s", "vehicle.stopped": "slower than 0.5 m/s, of an object that can move",
    "vehicle.parked": "a static object of the scene",
}  # fmt: skip # a table
CHANNEL_PLACES = {
    "front_left": "FRONT_LEFT", "front_center": "FRONT", "front_right": "FRONT_RIGHT",
    "back_left": "BACK_LEFT", "back_center": "BACK", "back_right": "BACK_RIGHT", "front": "FRONT", "back": "BACK",
}  # fmt: skip # a table


def token(*parts: object) -> str:
    """Return the token of a record: 32 hexadecimal digits that depend on its names only."""
    return hashlib.md5("\x1f".join(map(str, parts)).encode(), usedforsecurity=False).hexdigest()


def models_of(configuration: Mapping[str, Any]) -> dict[str, str]:
    """Return the models that a scene's configuration states, by the actors' names."""
    stated = configuration.get("actors", ())
    rows = [row for row in stated if isinstance(row, Mapping)] if isinstance(stated, list | tuple) else []
    return {str(row["name"]): str(row["model"]) for row in rows if row.get("name") and row.get("model")}


def _model(name: str, models: Mapping[str, str]) -> str:
    """Return the model of an object: as stated, by the name that built-in traffic gives, or a name that is one."""
    traffic = _TRAFFIC.fullmatch(name)
    return models.get(name) or (traffic[1] if traffic else name)


def category_of(item: ObjectState, models: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return the category of an object: of its model where that tells, else of its class and, of people, their height.

    `models` are those stated for the scene, by name.
    """
    kind = SEMANTIC_CLASSES[item.semantic]
    named = CATEGORY_OF_MODEL.get(_model(item.name, models))
    if named is not None and kind in ("Pedestrian", "Dynamic", "Bicycle"):
        return named
    return _CHILD if kind == "Pedestrian" and item.size[2] < CHILD_HEIGHT else CATEGORY_OF_CLASS[kind]


def lidarseg_labels(
    semantic: npt.NDArray[np.uint8],
    instance: npt.NDArray[np.uint16],
    objects: Sequence[ObjectState],
    models: Mapping[str, str] = MappingProxyType({}),
) -> npt.NDArray[np.uint8]:
    """Return the lidarseg labels (n,) of points: of their class, or of the category of their object where that differs.

    `models` as of `category_of`.
    """
    label = LIDARSEG_LABEL[semantic]
    for item in objects:
        category = category_of(item, models)
        if category != CATEGORY_OF_CLASS[SEMANTIC_CLASSES[item.semantic]]:
            label[instance == item.instance] = CATEGORIES.index(category)
    return label


def category_table() -> list[dict[str, Any]]:
    """Return the category records, with the lidarseg label as ``index``."""
    return [
        {"token": token("category", name), "name": name, "description": "", "index": index}
        for index, name in enumerate(CATEGORIES)
    ]


def attribute_table() -> list[dict[str, Any]]:
    """Return the attribute records."""
    return [{"token": token("attribute", n), "name": n, "description": text} for n, text in ATTRIBUTES.items()]


def visibility_table() -> list[dict[str, Any]]:
    """Return the visibility records."""
    return [
        {"token": str(index + 1), "level": level, "description": f"visible part of the box's outline, {level[1:]} %"}
        for index, (level, _) in enumerate(VISIBILITY_LEVELS)
    ]


def visibility_token(fraction: float) -> str:
    """Return the visibility token of a visible part between 0 and 1."""
    return str(1 + sum(fraction > limit for _, limit in VISIBILITY_LEVELS[:-1]))


def attribute_tokens(
    category: str, item: ObjectState, speed: float, models: Mapping[str, str] = MappingProxyType({})
) -> list[str]:
    """Return the attribute of an object of a category at a speed [m/s]: none for what has none in nuScenes."""
    moving = speed > MOVING_SPEED
    if category in ("vehicle.bicycle", "vehicle.motorcycle"):
        name = "cycle.with_rider" if item.size[2] > RIDDEN_HEIGHT else "cycle.without_rider"
    elif category.startswith("vehicle."):
        name = "vehicle.moving" if moving else "vehicle.stopped" if item.is_actor else "vehicle.parked"
    elif category.startswith("human.") and _model(item.name, models) in _SITTING:
        name = "pedestrian.sitting_lying_down"
    elif category.startswith("human."):
        name = "pedestrian.moving" if moving else "pedestrian.standing"
    else:
        return []
    return [token("attribute", name)]


def has_boxes(category: str) -> bool:
    """Return whether nuScenes gives boxes to a category."""
    return (
        category.startswith(("human.", "vehicle.", "movable_object.", "static_object.", "animal"))
        and category != "vehicle.ego"
    )


def channel(prefix: str, sensor: str) -> str:
    """Return the channel of a sensor: ``front_left/rgb`` is ``CAM_FRONT_LEFT``, ``roof/rgb`` is ``CAM_ROOF_RGB``."""
    place = CHANNEL_PLACES.get(sensor.rpartition("/")[0] or sensor)
    return f"{prefix}_{place}" if place else full_channel(prefix, sensor)


def full_channel(prefix: str, sensor: str) -> str:
    """Return a channel with the whole name of the sensor."""
    return f"{prefix}_{sensor}".upper().replace("/", "_").replace("-", "_")
