"""Writer of scene.toml."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .geometry.mesh import Array
from .xml import Bsdf


@dataclass(frozen=True)
class Instance:
    """A static instance: semantic class, patterns of its shapes, whether it has a 3D box, and its group of lights."""

    name: str
    semantic: str
    shapes: tuple[str, ...]
    is_object: bool
    signal: str | None = None


@dataclass(frozen=True)
class ActorEntry:
    """A moving instance: waypoints (times [s], positions [m], headings [deg] or None) and joints as tables.

    One time alone: it stands.  With a `model` (a name of scenes_xml/actors) its shapes, class and joints are the
    model's, in the colours `variant`, its gait at `phase` [cycles] at the first time.
    """

    name: str
    semantic: str
    times: Array
    positions: Array
    yaw_deg: Array | None = None
    joints: Sequence[Mapping[str, Any]] = field(default_factory=tuple)
    model: str | None = None
    variant: str | None = None
    detail: str | None = None
    phase: float = 0.0


@dataclass(frozen=True)
class Lane:
    """A lane: `kind` is ``drive``, ``cycle``, ``walk`` or ``parking``.

    Centre line, shape (n, 3) [m], in the direction of travel.

    `width` [m], `speed` limit [m/s], names of the lanes that continue it, of its left neighbour, of those with right of
    way over its end, and its signal group: as docs/scenes.md says.
    """

    name: str
    points: Array
    kind: str = "drive"
    width: float = 3.25
    speed: float = 13.9
    next: tuple[str, ...] = ()
    left: str | None = None
    yield_to: tuple[str, ...] = ()
    signal: str | None = None


@dataclass(frozen=True)
class Parking:
    """A place of a parked car: its middle on the ground [m], heading [deg] and size [m]."""

    position: tuple[float, float, float]
    yaw_deg: float = 0.0
    length: float = 5.0
    width: float = 2.2


def scene_toml(
    head: Mapping[str, Any],
    bsdfs: Mapping[str, Bsdf],
    instances: Sequence[Instance],
    actors: Sequence[ActorEntry],
    lighting: str = "day",
    lanes: Sequence[Lane] = (),
    parking: Sequence[Parking] = (),
    signals: Mapping[str, Any] | None = None,
) -> str:
    """Return the text of a scene.toml: `head` is its table ``[scene]``, `lighting` the preset of its light.

    `signals` holds the `cycle` [s] and for each group (`green`) the start and the end of its green [s].
    """
    lines = ["[scene]", *(f"{key} = {toml_value(value)}" for key, value in head.items()), ""]
    lines += ["[lighting]", f"preset = {toml_value(lighting)}", ""]
    for name, b in bsdfs.items():
        lines += [f"[materials.{name}]", *(f"{key} = {toml_value(value)}" for key, value in b.table().items()), ""]
    for item in instances:
        lines += ["[[instances]]", f'name = "{item.name}"', f'class = "{item.semantic}"']
        lines += [f"shapes = {toml_value(item.shapes)}", f"object = {toml_value(item.is_object)}"]
        lines += [f'signal = "{item.signal}"', ""] if item.signal is not None else [""]
    for actor in actors:
        lines += ["[[actors]]", f'name = "{actor.name}"']
        if actor.model is None:
            lines += [f'class = "{actor.semantic}"', f'shapes = ["{actor.name}_*"]']
        else:
            lines.append(f'model = "{actor.model}"')
            lines += [f'variant = "{actor.variant}"'] if actor.variant else []
            lines += [f'detail = "{actor.detail}"'] if actor.detail else []
            lines += [f"phase = {toml_value(actor.phase)}"] if actor.phase else []
        lines += _trajectory(actor)
        for joint in actor.joints:
            lines += ["[[actors.joints]]", *(f"{key} = {toml_value(value)}" for key, value in joint.items()), ""]
    for lane in lanes:
        lines += _lane(lane)
    for place in parking:
        lines += ["[[parking]]", f"position = {toml_value(np.round(place.position, 4).tolist())}"]
        lines += [
            f"{key} = {toml_value(round(float(getattr(place, key)), 4))}" for key in ("yaw_deg", "length", "width")
        ] + [""]
    if signals:
        green = ", ".join(f"{group} = {toml_value(list(span))}" for group, span in signals["green"].items())
        lines += ["[signals]", f"cycle = {toml_value(signals['cycle'])}", f"green = {{ {green} }}", ""]
    return "\n".join(lines)


def _trajectory(actor: ActorEntry) -> list[str]:
    if len(actor.times) == 1:
        yaw = 0.0 if actor.yaw_deg is None else round(float(actor.yaw_deg[0]), 6)
        place = toml_value([round(float(value), 6) for value in actor.positions[0]])
        return ["[actors.trajectory]", 'kind = "static"', f"position = {place}", f"yaw_deg = {toml_value(yaw)}", ""]
    lines = ["[actors.trajectory]", 'kind = "waypoints"', f"times = {toml_value(actor.times)}"]
    if actor.yaw_deg is not None:
        lines.append(f"yaw_deg = {toml_value(np.round(actor.yaw_deg, 6))}")
    return [*lines, "positions = [", *_rows(actor.positions, 6), "]", ""]


def _lane(lane: Lane) -> list[str]:
    lines = [
        "[[lanes]]",
        f"name = {toml_value(lane.name)}",
        f'kind = "{lane.kind}"',
        f"width = {toml_value(float(lane.width))}",
    ]
    lines += [f"speed = {toml_value(float(lane.speed))}", "points = [", *_rows(np.asarray(lane.points, float), 4), "]"]
    for key in ("next", "left", "yield_to", "signal"):
        value = getattr(lane, key)
        lines += [f"{key} = {toml_value(value)}"] if value else []
    return [*lines, ""]


def _rows(points: Array, digits: int) -> list[str]:
    return [
        f"    [{x + 0.0:.{digits}f}, {y + 0.0:.{digits}f}, {z + 0.0:.{digits}f}]," for x, y, z in points.round(digits)
    ]


def toml_value(value: object) -> str:
    """Return a value as TOML; floats with six digits."""
    if isinstance(value, bool | str):
        return json.dumps(value)
    if isinstance(value, tuple | list | np.ndarray):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return f"{value + 0.0:g}" if isinstance(value, float) else str(value)
