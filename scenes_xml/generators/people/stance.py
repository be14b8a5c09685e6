"""A body of MakeHuman put upright: limbs straight below their joints, as a walker's segments at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.mesh import Array
from .makehuman import MakeHuman
from .topology import REGIONS, SEGMENTS, Topology

SOLE = 0.018
"""Thickness of a shoe's sole [m]."""
SHOE = 0.006
"""How much longer a shoe is than the foot, at each end [m]."""
CLEAR = 0.012
"""Distance of a skirt from the body [m]."""
TUCK = 0.003
"""How far the upper edge of a skirt is below the surface [m]."""
SWING = 0.42
"""How much farther to the front and to the back a skirt is, over the height below the hip."""
LENGTHS = ("half_shoulder", "torso", "half_hip", "upper_leg", "lower_leg", "foot", "upper_arm", "lower_arm")
"""Lengths of a walker's segments that a body has of its own, see `scarl_sionna.scene.motion.gait`."""


@dataclass(frozen=True)
class Stance:
    """A half of a body that stands.

    Attributes
    ----------
    points : ndarray, shape (num_vertices, 3)
        In the walker's frame: hips at x = 0, soles of the shoes at z = 0 [m].
    lengths : dict
        By the names of `LENGTHS` [m].
    """

    points: Array
    lengths: dict[str, float]


def _turn(start: Array, end: Array) -> Array:
    """Return the smallest rotation that takes a direction to another, shape (3, 3)."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    v, c = np.cross(a, b), float(a @ b)
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + c)  # type: ignore[no-any-return]


def _outside(points: Array, topology: Topology, hip: float) -> None:
    """Push skirts out of hips and thighs, around an upright axis; below the hip [m] thighs have room to swing."""
    skirts, legs = (
        np.unique(topology.faces[0][np.isin(topology.regions[0], [REGIONS.index(name) for name in names])])
        for names in (("hem", "skirt", "long_skirt"), ("chest", "waist", "seat", "thigh", "lap"))
    )
    middle = np.array([points[skirts, 0].mean(), 0.0])
    arms = topology.weights[legs][:, [SEGMENTS.index("upper_arm"), SEGMENTS.index("lower_arm")]].sum(axis=1) > 0.1
    below = points[legs[~arms]] * 1.0
    ways, radii = _around(np.concatenate([below, below * [1.0, -1.0, 1.0]]), middle)
    top = points[skirts, 2].max()
    heights = np.concatenate([below[:, 2], below[:, 2]])
    for vertex in skirts:
        (way,), (radius,) = _around(points[[vertex]], middle)
        near = (np.abs(np.angle(np.exp(1j * (ways - way)))) < 0.2) & (np.abs(heights - points[vertex, 2]) < 0.035)
        if near.any():
            share = min((top - points[vertex, 2]) / 0.08, 1.0)
            least = float(radii[near].max()) + CLEAR * share - TUCK
            wanted = least + share * max(radius - least, 0.0)
            points[vertex, :2] = middle + (points[vertex, :2] - middle) * wanted / radius
        points[vertex, 0] += SWING * np.cos(way) * max(hip - points[vertex, 2], 0.0)


def _around(points: Array, middle: Array) -> tuple[Array, Array]:
    """Return the angle [rad] and the distance [m] of points around an upright axis, shape (num_points,) each."""
    away = points[:, :2] - middle
    return np.arctan2(away[:, 1], away[:, 0]), np.hypot(away[:, 0], away[:, 1])


def upright(mesh: MakeHuman, topology: Topology, points: Array, height: float, arms_out_deg: float) -> Stance:
    """Return a half of a body, scaled to a height without shoes [m], its limbs hanging.

    Parameters
    ----------
    points : ndarray, shape (num_vertices, 3)
        All vertices of the base mesh.
    arms_out_deg : float
        By how much the arms stand off the body.
    """
    body = np.unique(mesh.quads[mesh.groups == "body"])
    points = points * (height / float(np.ptp(points[body, 2])))
    points[:, 2] -= points[body, 2].min()
    at = {name: mesh.joint(points, f"l-{name}") for name in ("shoulder", "elbow", "hand", "upper-leg", "knee")}
    half = points[topology.vertices]
    feet = half[topology.weights[:, SEGMENTS.index("foot")] > 0.5]
    heel, toe = feet[:, 0].min() - SHOE, feet[:, 0].max() + SHOE
    foot = (toe - heel) / 1.05  # heel at -0.25, toe at 0.8, sole at -0.25 lengths from the ankle
    ankle = np.array([heel + 0.25 * foot, mesh.joint(points, "l-ankle")[1], 0.25 * foot - SOLE])
    out = np.radians(arms_out_deg)
    aside = np.array([0.0, np.sin(out), -np.cos(out)])
    down = np.array([0.0, 0.0, -1.0])
    thigh, shank = _turn(at["knee"] - at["upper-leg"], down), _turn(ankle - at["knee"], down)
    upper, lower = _turn(at["elbow"] - at["shoulder"], aside), _turn(at["hand"] - at["elbow"], 0.6 * aside + 0.4 * down)
    lengths = {
        "half_hip": at["upper-leg"][1],
        "half_shoulder": at["shoulder"][1],
        "torso": at["shoulder"][2] - at["upper-leg"][2],
        "upper_leg": float(np.linalg.norm(at["knee"] - at["upper-leg"])),
        "lower_leg": float(np.linalg.norm(ankle - at["knee"])),
        "foot": foot,
        "upper_arm": float(np.linalg.norm(at["elbow"] - at["shoulder"])) * float(np.cos(out)),
        "lower_arm": float(np.linalg.norm(at["hand"] - at["elbow"])),
    }
    knee = at["upper-leg"] + thigh @ (at["knee"] - at["upper-leg"])
    elbow = at["shoulder"] + upper @ (at["elbow"] - at["shoulder"])
    moves = {
        "upper_leg": (thigh, at["upper-leg"], at["upper-leg"]),
        "lower_leg": (shank, at["knee"], knee),
        "foot": (np.eye(3), ankle, knee + shank @ (ankle - at["knee"])),
        "upper_arm": (upper, at["shoulder"], at["shoulder"]),
        "lower_arm": (lower, at["elbow"], elbow),
    }
    placed = np.zeros_like(half)
    for number, name in enumerate(SEGMENTS):
        rotation, start, end = moves.get(name, (np.eye(3), np.zeros(3), np.zeros(3)))
        placed += topology.weights[:, [number]] * ((half - start) @ rotation.T + end)
    placed[: topology.num_middle, 1] = 0.0  # both legs pull at them
    placed -= [at["upper-leg"][0], 0.0, 0.0]
    _outside(placed, topology, at["upper-leg"][2])
    stands = lengths["upper_leg"] + lengths["lower_leg"] + 0.25 * foot
    placed[:, 2] += stands - at["upper-leg"][2]
    return Stance(placed, {name: round(float(lengths[name]), 4) for name in LENGTHS})
