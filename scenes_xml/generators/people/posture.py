"""A body in a fixed posture: standing, on a saddle, or holding a handlebar.

Limbs reach their ends by two-link geometry.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.mesh import Array, Mesh
from .pedestrian import LOWER_ARM, LOWER_LEG, TORSO, UPPER_ARM, UPPER_LEG, BodyShape, body

HALF_SHOULDER = 0.1295
PALM = 0.95 * LOWER_ARM + 0.04
"""From the elbow to the middle of a closed hand [heights]."""
Point = tuple[float, float, float]


@dataclass(frozen=True)
class Posture:
    """Where the ends of the limbs are; positions in the actor's frame [m].

    Attributes
    ----------
    hip : tuple of float
        Middle between the hip joints.
    lean_deg : float
        Of the trunk, forward.
    grip, other_grip : tuple of float
        Middle of the left and the right hand; the right one mirrors the left where it is left out.
    foot, other_foot : tuple of float, optional
        Left and right ankle. Without `foot` the legs are left out.
    gaze_deg : float
        By how much the head looks down.
    toe_out_deg, foot_pitch_deg : float
        Turn of the feet outward, and of their toes downward.
    hip_width : float
        Half the distance of the hip joints.
    elbow, knee : tuple of float
        Direction into which the left ones bend.
    """

    hip: Point
    lean_deg: float
    grip: Point
    other_grip: Point | None = None
    foot: Point | None = None
    other_foot: Point | None = None
    gaze_deg: float = 0.0
    toe_out_deg: float = 0.0
    foot_pitch_deg: float = 0.0
    hip_width: float = 0.09
    elbow: Point = (-0.5, 0.6, -0.6)
    knee: Point = (1.0, 0.15, 0.3)


def turn_y(angle_deg: float) -> Array:
    """Return the rotation about y, x towards -z for a positive angle."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def set_at(part: Mesh, rotation: Array, origin: Sequence[float] | Array) -> Mesh:
    """Return a mesh of a local frame in the frame in which this has a rotation, shape (3, 3), and an origin [m]."""
    return replace(part, vertices=part.vertices @ rotation.T + np.asarray(origin, float))


def two_links(start: Array, end: Array, first: float, second: float, bend: Array) -> Array:
    """Return where two links of given lengths from `start` to `end` meet, bent towards `bend` [m].

    Raises
    ------
    ValueError
        If they do not reach.
    """
    way = end - start
    distance = float(np.linalg.norm(way))
    if not abs(first - second) < distance < first + second:
        raise ValueError(f"links of {first:.3f} and {second:.3f} m do not span {distance:.3f} m")
    unit = way / distance
    side = bend - (bend @ unit) * unit
    along = (distance**2 + first**2 - second**2) / (2.0 * distance)
    return start + along * unit + np.sqrt(first**2 - along**2) * side / np.linalg.norm(side)


def _hanging(start: Array, end: Array, front: Array) -> Array:
    """Return the rotation that takes a limb along -z from `start` towards `end`, its x near `front`."""
    z = (start - end) / np.linalg.norm(end - start)
    y = np.cross(z, front)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, z), y, z], axis=1)


def posed(shape: BodyShape, posture: Posture, light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of a body in the actor's frame, name -> (mesh, role), see :func:`pedestrian.body`."""
    h = shape.height
    parts = body(replace(shape, leg_inset=0.0, arm_inset=0.0), light)
    hip, lean = np.array(posture.hip), turn_y(posture.lean_deg)
    frames: dict[str, tuple[Array, Array]] = {
        "pelvis": (turn_y(0.5 * posture.lean_deg), hip),
        "torso": (lean, hip),
        "head": (turn_y(posture.gaze_deg), hip + lean @ [0.0, 0.0, TORSO * h]),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        mirror = np.array([1.0, sign, 1.0])
        grip = mirror * posture.grip if sign > 0.0 or posture.other_grip is None else np.array(posture.other_grip)
        shoulder = hip + lean @ [0.0, sign * (HALF_SHOULDER * shape.shoulders - shape.arm_inset) * h, TORSO * h]
        frames |= _limb(
            f"{side}_upper_arm",
            f"{side}_lower_arm",
            shoulder,
            grip,
            (UPPER_ARM * h, PALM * h),
            mirror * posture.elbow,
            -1.0,
        )
        if posture.foot is None:
            continue
        ankle = mirror * posture.foot if sign > 0.0 or posture.other_foot is None else np.array(posture.other_foot)
        joint = hip + np.array([0.0, sign * posture.hip_width, 0.0])
        frames |= _limb(
            f"{side}_upper_leg",
            f"{side}_lower_leg",
            joint,
            ankle,
            (UPPER_LEG * h, LOWER_LEG * h),
            mirror * posture.knee,
            1.0,
        )
        c, s = np.cos(np.radians(posture.toe_out_deg)), sign * np.sin(np.radians(posture.toe_out_deg))
        yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        frames[f"{side}_foot"] = (yaw @ turn_y(posture.foot_pitch_deg), ankle)
    placed = {}
    for name, (part, role) in parts.items():
        segment = name.removesuffix("_hair").removesuffix("_hand")
        if segment in frames:
            placed[name] = (set_at(part, *frames[segment]), role)
    return placed


def head_frame(shape: BodyShape, posture: Posture) -> tuple[Array, Array]:
    """Return rotation and origin of the head's frame in the actor's."""
    return turn_y(posture.gaze_deg), np.array(posture.hip) + turn_y(posture.lean_deg) @ [0.0, 0.0, TORSO * shape.height]


def torso_frame(posture: Posture) -> tuple[Array, Array]:
    """Return rotation and origin of the torso's frame in the actor's."""
    return turn_y(posture.lean_deg), np.array(posture.hip)


def _limb(
    upper: str, lower: str, start: Array, end: Array, lengths: tuple[float, float], bend: Array, front: float
) -> dict[str, tuple[Array, Array]]:
    middle = two_links(start, end, *lengths, bend)
    return {
        upper: (_hanging(start, middle, front * bend), start),
        lower: (_hanging(middle, end, front * bend), middle),
    }
