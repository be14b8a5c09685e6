"""People: a body of rigid segments, each in its own frame, as the walking model of the simulator moves them.

Frames: origin at the joint nearer to the pelvis (head: neck; torso and pelvis: lower end of the spine), x forward, y
left, z up; straight limbs hang along -z, a foot points along x. Lengths are fractions of the body's height, from V. C.
Chen, *The Micro-Doppler Effect in Radar*, 2nd ed., 2019, section 4.1; girths are drawn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.mesh import Array, Mesh, grid, merge, outward

UPPER_LEG, LOWER_LEG, FOOT = 0.245, 0.246, 0.143
UPPER_ARM, LOWER_ARM = 0.188, 0.152
TORSO, HEAD = 0.288, 0.130
LIGHT_SIDES, LIGHT_TRUNK = 12, 14
"""Corners of the limbs' and of the trunk's cross-sections at the light level: few enough for traffic, and so many that
faces bend by less than the radar's `crease_angle_deg` (35 deg), so that it takes them for round."""


@dataclass(frozen=True)
class BodyShape:
    """A body.

    Attributes
    ----------
    height : float
        [m]
    build : float
        Girths over those of an average adult.
    head_scale : float
        Size of the head over an adult's; children have larger ones.
    shoulders, hips : float
        Widths of the upper and of the lower trunk over those of the average adult.
    leg_inset, arm_inset : float
        By how much the limbs are drawn nearer to the middle than their joints [heights]: the model's joints stand as
        far apart as the outer measures of pelvis and shoulders. Limbs turn about y, so the motion is the same.
    """

    height: float = 1.75
    build: float = 1.0
    head_scale: float = 1.0
    shoulders: float = 1.0
    hips: float = 1.0
    leg_inset: float = 0.0
    arm_inset: float = 0.0


def loft(rings: Array, segments: int = 20, exponent: float = 2.2) -> Mesh:
    """Return the closed body through superellipses.

    Parameters
    ----------
    rings : ndarray, shape (n, 5)
        Each: z, half extent along x, half extent along y, middle x, middle y [m].
    segments : int
        Corners of a ring.
    exponent : float
        2 is an ellipse, larger is boxier.
    """
    rings = np.asarray(rings, float)
    angle = np.arange(segments) * 2 * np.pi / segments
    cos, sin = np.cos(angle), np.sin(angle)
    unit = np.stack([np.sign(cos) * np.abs(cos) ** (2 / exponent), np.sign(sin) * np.abs(sin) ** (2 / exponent)], -1)
    points = np.empty((len(rings), segments, 3))
    points[..., 0] = rings[:, 3:4] + rings[:, 1:2] * unit[:, 0]
    points[..., 1] = rings[:, 4:5] + rings[:, 2:3] * unit[:, 1]
    points[..., 2] = rings[:, :1]
    parts = [grid(points, close_columns=True)]
    k = np.arange(segments)
    for ring, order in ((points[0], -1), (points[-1], 1)):
        fan = np.stack([k, (k + 1) % segments, np.full(segments, segments)], 1)[:, ::order]
        parts.append(Mesh(np.vstack([ring, ring.mean(0)]), fan.astype(np.int64)))
    side = parts[0]
    rising = rings[-1, 0] > rings[0, 0]
    parts[0] = side.flipped() if rising else side
    if not rising:
        parts[1], parts[2] = parts[1].flipped(), parts[2].flipped()
    return outward(merge(parts))


Stations = list[tuple[float, float, float]]


def _limb(stations: Stations, length: float, scale: float, few: tuple[float, ...] | None = None) -> Mesh:
    """Return a limb along -z with round ends; a station is (part of the length, half girth along x, along y).

    With `few` parts of the length it has a few sides through these and pointed ends.
    """
    if few is not None:
        return _few_sided(stations, length, scale, few)
    t, rx, ry = np.array(stations).T
    fine = np.linspace(0, 1, 13)
    x, y = np.interp(fine, t, rx) * scale, np.interp(fine, t, ry) * scale
    rows = [(-s * length, a, b, 0.0, 0.0) for s, a, b in zip(fine, x, y, strict=True)]
    cap = np.radians([80.0, 55.0, 28.0])
    top = [(np.sin(c) * x[0] * 0.9, x[0] * np.cos(c), y[0] * np.cos(c), 0.0, 0.0) for c in cap]
    bottom = [(-length - np.sin(c) * x[-1] * 0.9, x[-1] * np.cos(c), y[-1] * np.cos(c), 0.0, 0.0) for c in cap[::-1]]
    return loft(np.array(top + rows + bottom), 14, 2.0)


def fair_girth(sides: int) -> float:
    """Return by how much a cross-section of a few sides is wider than the round one of the same mean width (Cauchy)."""
    return float(np.pi / (sides * np.sin(np.pi / sides)))


def _few_sided(stations: Stations, length: float, scale: float, at: tuple[float, ...]) -> Mesh:
    """Return a limb of `LIGHT_SIDES` sides, whose girth is the round limb's, and so its mean width around it."""
    t, rx, ry = np.array(stations).T
    share = np.array(at)
    girth = scale * fair_girth(LIGHT_SIDES)
    x, y = np.interp(share, t, rx) * girth, np.interp(share, t, ry) * girth
    mesh = loft(np.stack([-share * length, x, y, 0.0 * x, 0.0 * x], 1), LIGHT_SIDES, 2.0)
    vertices = mesh.vertices.copy()
    on_axis = np.hypot(vertices[:, 0], vertices[:, 1]) < 1e-9
    vertices[on_axis, 2] += np.where(vertices[on_axis, 2] > -0.5 * length, 0.6 * x[0], -0.8 * x[-1])
    return replace(mesh, vertices=vertices)


def body(shape: BodyShape, light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of a body, name -> (mesh, role).

    a name is a segment's, with a suffix where it has several shapes.

    Roles: ``skin``, ``hair``, ``top``, ``trousers``, ``shoes``. A `light` body has one shape for each of the 13
    segments and the hair, of a twelfth of the triangles.
    """
    h, g = shape.height, shape.height * shape.build
    parts: dict[str, tuple[Mesh, str]] = {
        "torso": (_torso(h, g, shape.shoulders, light), "top"),
        "pelvis": (_pelvis(h, g, shape.hips, light), "trousers"),
        "head": (_head(h * shape.head_scale, g, light), "skin"),
        "head_hair": (_hair(h * shape.head_scale, light), "hair"),
    }
    thigh = [(0.0, 0.052, 0.050), (0.35, 0.050, 0.046), (0.8, 0.037, 0.036), (1.0, 0.034, 0.034)]
    calf = [(0.0, 0.034, 0.034), (0.3, 0.037, 0.034), (0.6, 0.031, 0.029), (1.0, 0.026, 0.025)]
    upper = [(0.0, 0.031, 0.031), (0.5, 0.029, 0.028), (1.0, 0.025, 0.025)]
    lower = [(0.0, 0.025, 0.025), (0.3, 0.025, 0.024), (0.95, 0.018, 0.018), (1.0, 0.018, 0.018)]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        leg, arm = (0.0, -sign * shape.leg_inset * h, 0.0), (0.0, -sign * shape.arm_inset * h, 0.0)
        thigh_at, calf_at, arm_at = ((0.1, 1.0), (0.0, 0.35, 1.0), (0.0, 1.0)) if light else (None, None, None)
        parts[f"{side}_upper_leg"] = (_limb(thigh, UPPER_LEG * h, g, thigh_at).moved(leg), "trousers")
        parts[f"{side}_lower_leg"] = (_limb(calf, LOWER_LEG * h, g, calf_at).moved(leg), "trousers")
        parts[f"{side}_foot"] = (_shoe(h, light).moved(leg), "shoes")
        parts[f"{side}_upper_arm"] = (_limb(upper, UPPER_ARM * h, g, arm_at).moved(arm), "top")
        if light:
            parts[f"{side}_lower_arm"] = (_limb(lower, (LOWER_ARM + 0.06) * h, g, arm_at).moved(arm), "top")
        else:
            parts[f"{side}_lower_arm"] = (_limb(lower, LOWER_ARM * h * 0.97, g).moved(arm), "top")
            parts[f"{side}_lower_arm_hand"] = (_hand(h).moved(arm), "skin")
    return parts


def _rings(table: list[tuple[float, float, float, float]], h: float, g: float, count: int = 18) -> Array:
    """Return rings from (z, half depth, half width, middle x), z and x in heights, girths in girths, smoothed."""
    z, depth, width, middle = np.array(table).T
    fine = np.unique(np.concatenate([np.linspace(z[0], z[-1], count), z[[0, -1]]]))
    columns = [np.interp(fine, z, c) for c in (depth, width, middle)]
    return np.stack([fine * h, columns[0] * g, columns[1] * g, columns[2] * h, 0 * fine], 1)


def _rows(table: list[tuple[float, float, float, float]], h: float, g: float) -> Array:
    """Return the rings of :func:`_rings` at the rows of the table themselves."""
    return np.array([(z * h, depth * g, width * g, middle * h, 0.0) for z, depth, width, middle in table])


def _torso(h: float, g: float, shoulders: float, light: bool) -> Mesh:
    table = [
        (0.000, 0.056, 0.078, 0.000), (0.05, 0.056, 0.079, 0.000), (0.11, 0.061, 0.087, 0.002), (0.19, 0.068, 0.099,
        0.004),
        (0.240, 0.064, 0.116, 0.000), (0.272, 0.053, 0.127, -0.003), (0.297, 0.040, 0.118, -0.006), (0.312, 0.032,
        0.070, -0.006),
        (0.320, 0.026, 0.035, -0.005),
    ]  # fmt: skip # a table
    table = [(z, depth, width * (1.0 + (shoulders - 1.0) * min(z / 0.24, 1.0)), x) for z, depth, width, x in table]
    if light:
        return loft(_rows([table[k] for k in (0, 3, 5, 8)], h, g), LIGHT_TRUNK, 2.4)
    return loft(_rings(table, h, g, 18), 26, 2.4)


def _pelvis(h: float, g: float, hips: float, light: bool) -> Mesh:
    table = [
        (-0.055, 0.030, 0.050, -0.004), (-0.035, 0.056, 0.086, -0.006), (0.0, 0.064, 0.097, -0.006), (0.03, 0.060,
        0.090, -0.002),
        (0.055, 0.057, 0.080, 0.0),
    ]  # fmt: skip # a table
    table = [
        (z, depth, width * (hips if z <= 0.0 else 1.0 + (hips - 1.0) * (1.0 - z / 0.055)), x)
        for z, depth, width, x in table
    ]
    if light:
        return loft(_rows([table[k] for k in (0, 2, 4)], h, g), LIGHT_TRUNK, 2.3)
    return loft(_rings(table, h, g, 18), 26, 2.3)


def ellipsoid(
    centre: tuple[float, float, float],
    radii: tuple[float, float, float],
    low: float = -1.0,
    rows: int = 14,
    segments: int = 22,
) -> Mesh:
    """Return an ellipsoid [m], cut off below `low` of its half height."""
    z = np.sin(np.radians(np.linspace(np.degrees(np.arcsin(max(low, -0.997))), 86.0, rows)))
    r = np.sqrt(1 - z * z)
    columns = [centre[2] + z * radii[2], r * radii[0], r * radii[1], np.full(rows, centre[0]), np.full(rows, centre[1])]
    return loft(np.stack(columns, 1), segments, 2.1)


def _head(h: float, g: float, light: bool) -> Mesh:
    if light:
        neck = _rings([(-0.02, 0.031, 0.032, -0.006), (0.05, 0.028, 0.028, 0.0)], h, g, 2)
        return merge(
            [
                loft(neck, 4, 2.0),
                ellipsoid((0.012 * h, 0.0, 0.072 * h), (0.053 * h, 0.044 * h, 0.065 * h), rows=5, segments=12),
            ]
        )
    skull = ellipsoid((0.008 * h, 0.0, 0.078 * h), (0.051 * h, 0.043 * h, 0.062 * h))
    jaw = ellipsoid((0.022 * h, 0.0, 0.045 * h), (0.034 * h, 0.033 * h, 0.036 * h))
    nose = ellipsoid((0.060 * h, 0.0, 0.066 * h), (0.009 * h, 0.008 * h, 0.014 * h), rows=6)
    ears = [
        ellipsoid((0.003 * h, s * 0.0435 * h, 0.070 * h), (0.011 * h, 0.006 * h, 0.018 * h), rows=6) for s in (-1, 1)
    ]
    neck = _rings([(-0.02, 0.031, 0.032, -0.006), (0.03, 0.030, 0.031, -0.003), (0.05, 0.028, 0.028, 0.0)], h, g)
    return merge([loft(neck, 16, 2.0), skull, jaw, nose, *ears])


def _hair(h: float, light: bool) -> Mesh:
    if light:
        return ellipsoid(
            (-0.010 * h, 0.0, 0.082 * h), (0.050 * h, 0.0475 * h, 0.0625 * h), low=-0.2, rows=3, segments=12
        )
    cap = ellipsoid((-0.003 * h, 0.0, 0.084 * h), (0.0535 * h, 0.0475 * h, 0.0625 * h), low=0.05)
    back = ellipsoid((-0.020 * h, 0.0, 0.070 * h), (0.038 * h, 0.0445 * h, 0.055 * h), low=-0.75)
    return merge([cap, back])


def _hand(h: float) -> Mesh:
    tip = LOWER_ARM * h * 0.95
    rows = [
        (-tip, 0.014, 0.010),
        (-tip - 0.02 * h, 0.021, 0.011),
        (-tip - 0.045 * h, 0.021, 0.012),
        (-tip - 0.075 * h, 0.017, 0.010),
        (-tip - 0.088 * h, 0.008, 0.006),
    ]
    return loft(np.array([(z, a * h, b * h, 0.004 * h, 0.0) for z, a, b in rows]), 12, 2.3)


def _shoe(h: float, light: bool = False) -> Mesh:
    """Return a shoe: heel at -0.25, toe at 0.8, sole at -0.25 lengths of the foot from the ankle."""
    foot = FOOT * h
    x = np.array([-0.25, -0.21, -0.1, 0.1, 0.3, 0.5, 0.68, 0.77, 0.8])
    top = np.array([-0.10, 0.02, 0.09, 0.06, -0.04, -0.10, -0.14, -0.18, -0.22])
    half = np.array([0.09, 0.13, 0.15, 0.155, 0.175, 0.185, 0.155, 0.10, 0.05])
    sole = -0.25 + 0.02 * np.clip((x - 0.6) / 0.2, 0, 1)
    if light:
        x, top, half, sole = (column[[0, 3, 8]] for column in (x, top, half, sole))
    rows = []
    for xi, ti, wi, si in zip(x, top, half, sole, strict=True):
        angle = np.linspace(0, np.pi, 3 if light else 9)
        y, z = wi * np.cos(angle), si + 0.05 + (ti - si - 0.05) * np.sin(angle) ** 0.8
        ring = np.concatenate([np.stack([y, z], 1), [[-wi, si], [wi, si]]])
        rows.append(np.column_stack([np.full(len(ring), xi), ring]))
    points = np.array(rows) * foot
    parts = [grid(points, close_columns=True)]
    n = points.shape[1]
    k = np.arange(n)
    for ring, order in ((points[0], 1), (points[-1], -1)):
        fan = np.stack([k, (k + 1) % n, np.full(n, n)], 1)[:, ::order]
        parts.append(Mesh(np.vstack([ring, ring.mean(0)]), fan.astype(np.int64)))
    return outward(merge(parts))
