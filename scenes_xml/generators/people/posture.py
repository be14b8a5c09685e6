"""A dressed body in a fixed posture: standing, on a saddle, or holding a handlebar.

Limbs reach their ends by two-link geometry, the surface bends at the joints by its weights, hands close about grips.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..geometry.mesh import Array, Mesh
from .garments import Outfit, Surface, covers, remainder, segmented, vertex_normals

KNUCKLES = 0.012
"""From the middle of the hand to where the fingers begin to close [m]."""
GRASP = 0.033
"""Radius at which the middle of the fingers goes about a grip [m]."""
BAR = 0.019
"""Least distance of skin from the middle of a grip [m]."""
CLOSED = 2.7
"""How far the fingers go about it [rad]."""
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
    foot, other_foot : tuple of float
        Left and right ankle; the right one mirrors the left where it is left out.
    gaze_deg : float
        By how much the head looks down.
    toe_out_deg, foot_pitch_deg : float
        Turn of the feet outward, and of their toes downward.
    elbow, knee : tuple of float
        Direction into which the left ones bend.
    """

    hip: Point
    lean_deg: float
    grip: Point
    foot: Point
    other_grip: Point | None = None
    other_foot: Point | None = None
    gaze_deg: float = 0.0
    toe_out_deg: float = 0.0
    foot_pitch_deg: float = 0.0
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


@dataclass(frozen=True)
class _Arm:
    """A hanging arm of a body: shoulder, elbow, and the middle of what its closed hand would hold [m]."""

    shoulder: Array
    elbow: Array
    held: Array
    along: Array
    thumb: Array
    palm: Array
    """Unit directions of the hand."""


def _arm(surface: Surface, side: str, arms_out_deg: float) -> _Arm:
    sign = 1.0 if side == "left" else -1.0
    shoulder, below = (surface.origins[f"{side}_{name}_arm"] for name in ("upper", "lower"))
    elbow = below + np.array([0.0, sign * np.tan(np.radians(arms_out_deg)) * (shoulder[2] - below[2]), 0.0])
    hand = np.unique(surface.faces[surface.regions == "hand"])
    hand = hand[surface.points[hand, 1] * sign > 0.0]
    middle = surface.points[hand].mean(axis=0)
    along = (middle - elbow) / np.linalg.norm(middle - elbow)
    thumb = np.array([1.0, 0.0, 0.0]) - along[0] * along
    thumb /= np.linalg.norm(thumb)
    palm = sign * np.cross(along, thumb)
    return _Arm(shoulder, elbow, middle + KNUCKLES * along + GRASP * palm, along, thumb, palm)


def _closed(points: Array, arm: _Arm) -> Array:
    """Return the points of a hand whose fingers go about what it holds, shape (num_points, 3)."""
    away = points - arm.held
    along, thumb, palm = (away @ way for way in (arm.along, arm.thumb, arm.palm))
    palm = np.where((along > 0.0) & (palm > -BAR), -BAR, palm)  # fingers that hang bent already
    angle = np.clip(along / GRASP, 0.0, CLOSED)
    past = np.maximum(along - CLOSED * GRASP, 0.0)
    beyond = along > 0.0
    moved = (
        arm.held
        + np.outer(-palm * np.sin(angle) + past * np.cos(angle), arm.along)
        + np.outer(thumb, arm.thumb)
        + np.outer(palm * np.cos(angle) + past * np.sin(angle), arm.palm)
    )
    moved = np.where(beyond[:, None], moved, points) - arm.held
    across = moved - np.outer(moved @ arm.thumb, arm.thumb)
    reach = np.linalg.norm(across, axis=1)
    out = np.maximum(BAR / np.maximum(reach, 1e-6), 1.0) - 1.0
    return arm.held + moved + across * out[:, None]  # type: ignore[no-any-return]


def _basis(first: Array, second: Array) -> Array:
    """Return the orthonormal basis of a direction and another near its second axis, as columns, shape (3, 3)."""
    x = first / np.linalg.norm(first)
    y = second - (second @ x) * x
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _turned(points: Array, axis: Array, angles: Array) -> Array:
    """Return vectors turned about a unit axis, each by its own angle [rad], shape (num_points, 3)."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    return points * c + np.cross(axis, points) * s + np.outer(points @ axis, axis) * (1.0 - c)  # type: ignore[no-any-return]


def _smooth(mesh: Mesh) -> Mesh:
    """Return a mesh with normals of its own, if it had any."""
    return mesh if mesh.normals is None else replace(mesh, normals=vertex_normals(mesh.vertices, mesh.faces))


@dataclass(frozen=True)
class Rider:
    """A body, what it wears and how it holds itself.

    Attributes
    ----------
    surface : Surface
    worn : Outfit
    lengths : mapping of str to float
        Of its segments [m].
    arms_out_deg : float
        How far its arms hang off the body at rest.
    posture : Posture
    """

    surface: Surface
    worn: Outfit
    lengths: Mapping[str, float]
    arms_out_deg: float
    posture: Posture

    def frames(self) -> dict[str, tuple[Array, Array]]:
        """Return rotation of each segment and where its origin is in the actor's frame [m]."""
        posture, lengths = self.posture, self.lengths
        hip, lean = np.array(posture.hip), turn_y(posture.lean_deg)
        found: dict[str, tuple[Array, Array]] = {
            "pelvis": (turn_y(0.5 * posture.lean_deg), hip),
            "torso": (lean, hip),
            "head": (turn_y(posture.gaze_deg), hip + lean @ [0.0, 0.0, lengths["torso"]]),
        }
        for side, sign in (("left", 1.0), ("right", -1.0)):
            mirror = np.array([1.0, sign, 1.0])
            ankle = mirror * posture.foot if sign > 0.0 or posture.other_foot is None else np.array(posture.other_foot)
            joint = hip + np.array([0.0, sign * lengths["half_hip"], 0.0])
            bend = mirror * posture.knee
            knee = two_links(joint, ankle, lengths["upper_leg"], lengths["lower_leg"], bend)
            found[f"{side}_upper_leg"] = (_hanging(joint, knee, bend), joint)
            found[f"{side}_lower_leg"] = (_hanging(knee, ankle, bend), knee)
            c, s = np.cos(np.radians(posture.toe_out_deg)), sign * np.sin(np.radians(posture.toe_out_deg))
            yaw = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            found[f"{side}_foot"] = (yaw @ turn_y(posture.foot_pitch_deg), ankle)
        return found

    def bent(self, points: Array) -> Array:
        """Return points of the body at rest where they are in the posture, shape (num_vertices, 3) [m]."""
        surface, placed = self.surface, self.frames()
        moved = np.zeros_like(points)
        for segment, weight in surface.weights.items():
            side, _, name = segment.partition("_")
            if name in ("upper_arm", "lower_arm"):
                at = self._arm_at(points, side, name)
            else:
                turned, origin = placed[segment]
                at = (points - surface.origins[segment]) @ turned.T + origin
            moved += weight[:, None] * at
        return moved

    def _arm_at(self, points: Array, side: str, name: str) -> Array:
        """Return where points would be, if they all were of an upper or of a lower arm."""
        posture, sign = self.posture, 1.0 if side == "left" else -1.0
        mirror = np.array([1.0, sign, 1.0])
        turned, origin = self.frames()["torso"]
        arm = _arm(self.surface, side, self.arms_out_deg)
        shoulder = turned @ (arm.shoulder - self.surface.origins["torso"]) + origin
        grip = mirror * posture.grip if sign > 0.0 or posture.other_grip is None else np.array(posture.other_grip)
        bend = mirror * posture.elbow
        upper, lower = arm.elbow - arm.shoulder, arm.held - arm.elbow
        elbow = two_links(shoulder, grip, float(np.linalg.norm(upper)), float(np.linalg.norm(lower)), bend)
        ahead = np.array([1.0, 0.0, 0.0])
        if name == "upper_arm":
            rotation = _basis(elbow - shoulder, -bend) @ _basis(upper, ahead).T
            return (points - arm.shoulder) @ rotation.T + shoulder  # type: ignore[no-any-return]
        way = lower / np.linalg.norm(lower)
        posed = _basis(grip - elbow, -bend)
        rotation = posed @ _basis(lower, ahead).T
        inward = rotation.T @ np.array([0.0, -sign, 0.0])  # where the thumb shall be, in the arm's frame at rest
        inward -= (inward @ way) * way
        thumb = arm.thumb - (arm.thumb @ way) * way
        twist = np.arctan2(np.cross(thumb, inward) @ way, thumb @ inward)
        away = _closed(points, arm) - arm.elbow
        share = np.clip((points - arm.elbow) @ way / (0.75 * float(np.linalg.norm(lower))), 0.0, 1.0)
        return _turned(away, way, share * twist) @ rotation.T + elbow  # type: ignore[no-any-return]

    def shapes(self, apart: Sequence[str] = (), plain: Sequence[str] = ()) -> dict[str, tuple[Mesh, str]]:
        """Return the shapes of the rider, name -> (mesh, slot).

        Segments in `apart` are shapes of their own in their own frames, bent at their ends as in the posture; feet are
        as at rest. All else is in the actor's frame.
        """
        found: dict[str, tuple[Mesh, str]] = {}
        surface, placed = self.surface, self.frames()
        for rest in covers(surface, self.worn, plain):
            points = self.bent(rest.points)
            cover = replace(rest, points=points, outward=vertex_normals(points, surface.faces[rest.is_own]))
            for segment in apart:
                is_foot = segment.endswith("foot")
                mesh = segmented(surface, rest if is_foot else cover, (segment,)).get(segment)
                if mesh is None:
                    continue
                if is_foot:
                    local = mesh.moved(-surface.origins[segment])
                else:
                    turned, origin = placed[segment]
                    local = _smooth(replace(mesh, vertices=(mesh.vertices - origin) @ turned))
                found[f"{segment}_{cover.slot}"] = (local, cover.slot)
            left = remainder(surface, cover, apart)
            if left is not None:
                found[f"rider_{cover.slot}"] = (_smooth(left), cover.slot)
        return found

    def hung(self, mesh: Mesh, segment: str) -> Mesh:
        """Return a mesh at rest that goes with the head or the torso, in the posture."""
        turned, origin = self.frames()[segment]
        return set_at(mesh.moved(-self.surface.origins[segment]), turned, origin)
