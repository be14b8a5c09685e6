"""People of the family in a fixed posture: limbs turned as rigid segments, one shape for each material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...generators.geometry.mesh import Array, Mesh, merge
from ...generators.people.garments import dressed, outfit
from .family import PLAIN, origins, packed_bodies, surface
from .table import PEOPLE

Turn = tuple[float, float]
"""About the actor's y axis (negative flexes forward), then about x (the left arm's outward is positive) [deg]."""


@dataclass(frozen=True)
class Pose:
    """How a body holds itself.

    Attributes
    ----------
    turns : mapping of str to Turn
        Of segments, in the actor's frame; those left out hang straight, the head keeps the trunk's.
    hip : float or None
        Height of the hips [m]; None: as the legs need it.
    apart : tuple of str
        Segments that stay shapes of their own, for joints.
    bare : tuple of str
        Regions of clothes that are left out, as hems of those who sit.
    """

    turns: Mapping[str, Turn] = field(default_factory=dict)
    hip: float | None = None
    apart: tuple[str, ...] = ()
    bare: tuple[str, ...] = ()


def packed_lengths(name: str) -> dict[str, float]:
    """Return the lengths of a person's segments [m]."""
    bodies = packed_bodies()
    return bodies.lengths[bodies.names.index(name)]


def rotation(turn: Turn) -> Array:
    """Return the rotation of a turn, shape (3, 3)."""
    (cy, cx), (sy, sx) = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    return np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]]) @ about_y  # type: ignore[no-any-return]


def frames(lengths: Mapping[str, float], pose: Pose) -> dict[str, tuple[Array, Array]]:
    """Return rotation and origin of each segment in the actor's frame."""
    rest = origins(lengths)
    trunk = pose.turns.get("torso", (0.0, 0.0))
    hip = np.array([0.0, 0.0, rest["pelvis"][2] if pose.hip is None else pose.hip])
    found = {
        "pelvis": (rotation(pose.turns.get("pelvis", (0.0, 0.0))), hip),
        "torso": (rotation(trunk), hip),
        "head": (rotation(pose.turns.get("head", trunk)), hip + rotation(trunk) @ [0.0, 0.0, lengths["torso"]]),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        shoulder = rotation(trunk) @ [0.0, sign * lengths["half_shoulder"], lengths["torso"]]
        chains = (
            (("upper_arm", "lower_arm"), hip + shoulder),
            (("upper_leg", "lower_leg", "foot"), hip + np.array([0.0, sign * lengths["half_hip"], 0.0])),
        )
        for names, start in chains:
            for name in names:
                turned = rotation(pose.turns.get(f"{side}_{name}", (0.0, 0.0)))
                found[f"{side}_{name}"] = (turned, start)
                start = start + turned @ [0.0, 0.0, -lengths.get(name, 0.0)]
    return found


def posed(name: str, pose: Pose, light: bool) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of a person in a posture, name -> (mesh in the actor's frame, slot)."""
    bodies, person = packed_bodies(), next(person for person in PEOPLE if person.name == name)
    row = bodies.names.index(name)
    worn = outfit(person.top, person.bottom, person.hair, person.long_hair)
    kept = tuple(replace(layer, regions=tuple(set(layer.regions) - set(pose.bare))) for layer in worn.layers)
    worn = replace(worn, layers=kept)
    placed = frames(bodies.lengths[row], pose)
    groups: dict[str, list[Mesh]] = {}
    slots: dict[str, str] = {}
    for shape, (mesh, slot) in dressed(surface(bodies, row, int(light)), worn, PLAIN if light else ()).items():
        segment = shape.rpartition("_")[0]
        group = f"{segment}_{slot}" if segment in pose.apart else f"person_{slot}"
        turned, origin = placed[segment]
        normals = None if mesh.normals is None else mesh.normals @ turned.T
        groups.setdefault(group, []).append(replace(mesh, vertices=mesh.vertices @ turned.T + origin, normals=normals))
        slots[group] = slot
    return {group: (merge(meshes), slots[group]) for group, meshes in groups.items()}


def shifted(parts: Mapping[str, tuple[Mesh, str]], offset: Sequence[float]) -> dict[str, tuple[Mesh, str]]:
    """Return shapes moved by an offset [m]."""
    return {name: (mesh.moved(offset), slot) for name, (mesh, slot) in parts.items()}
