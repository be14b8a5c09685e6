"""A motorcycle without fairing. Frame: origin on the ground below the middle, x forward, y left, z up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...geometry.loft import ellipsoid, loft
from ...geometry.mesh import Array, Mesh, box, extrude, merge, tube
from .bicycle import Parts, bar, light_disc, mudguard, ring, without_ends


@dataclass(frozen=True)
class MotorcycleShape:
    """Measures of a motorcycle [m]."""

    wheelbase: float = 1.43
    wheel_radius: float = 0.31
    front_tyre: float = 0.060
    rear_tyre: float = 0.082
    grip: tuple[float, float, float] = (0.345, 0.345, 1.065)
    peg: tuple[float, float, float] = (-0.10, 0.205, 0.345)


def _wheel(shape: MotorcycleShape, half: float, light: bool) -> tuple[Mesh, Mesh]:
    if light:
        return _light_wheel(shape, half)
    around = 36
    tyre = ring(shape.wheel_radius - 0.055, 0.055, half, around, 10)
    middle = shape.wheel_radius - 0.105
    rim = ring(middle, 0.012, 0.8 * half, around, 6)
    hub = tube(np.array([[0.0, -half - 0.02, 0.0], [0.0, half + 0.02, 0.0]]), 0.035, 14)
    arms = []
    for turn in 2.0 * np.pi * np.arange(5) / 5.0:
        for side in (-0.35, 0.35):
            end = np.array([middle * np.cos(turn + 0.25 * side), 0.0, middle * np.sin(turn + 0.25 * side)])
            arms.append(without_ends(tube(np.array([[0.0, side * half, 0.0], end]), 0.011, 6), 6))
    brake = [light_disc(0.145, 0.006, around).moved((0.0, s * (half + 0.012), 0.0)) for s in (-1.0, 1.0)]
    return tyre, merge([rim, hub, *arms, *brake])


def _light_wheel(shape: MotorcycleShape, half: float) -> tuple[Mesh, Mesh]:
    """Return tyre and rim of few triangles; hub and brake disks are one drum."""
    tyre = ring(shape.wheel_radius - 0.055, 0.055, half, 12, 4)
    middle = shape.wheel_radius - 0.105
    turns = 2.0 * np.pi * np.arange(5) / 5.0
    arms = [tube(np.array([[0.0, 0.0, 0.0], [middle * np.cos(t), 0.0, middle * np.sin(t)]]), 0.016, 3) for t in turns]
    drum = light_disc(0.12, 2.0 * half + 0.03, 8)
    return tyre, merge([ring(middle, 0.012, 0.8 * half, 12, 3), drum, *(without_ends(arm, 3) for arm in arms)])


def _mirror(point: tuple[float, float, float], side: float) -> Array:
    return np.array([point[0], side * point[1], point[2]])


def _tank(light: bool) -> Mesh:
    rows = [
        (0.70, 0.15, 0.10, 0.06), (0.74, 0.24, 0.135, 0.08), (0.82, 0.275, 0.155, 0.10), (0.90, 0.25, 0.150, 0.12),
        (0.955, 0.18, 0.115, 0.13),
        (0.975, 0.10, 0.06, 0.13),
    ]  # fmt: skip # a table
    if light:
        rows = [rows[k] for k in (0, 2, 5)]
    return loft(np.array([(z, a, b, x, 0.0) for z, a, b, x in rows]), 8 if light else 26, 2.4)


def _engine(light: bool) -> Mesh:
    segments = 6 if light else 18
    case = [
        (0.20, 0.16, 0.10, 0.0),
        (0.23, 0.24, 0.15, 0.02),
        (0.36, 0.27, 0.17, 0.02),
        (0.44, 0.24, 0.16, 0.04),
        (0.47, 0.16, 0.12, 0.06),
    ]
    if light:
        case = [case[k] for k in (0, 2, 4)]
    block = loft(np.array([(z, a, b, x, 0.0) for z, a, b, x in case]), segments, 3.5)
    cylinders = [
        box((0.17, 0.30, 0.030 if not light else 0.22), (0.15, 0.0, 0.47 + 0.045 * k if not light else 0.56))
        for k in range(1 if light else 6)
    ]
    covers = [] if light else [light_disc(0.105, 0.05, 20).moved((-0.02, s * 0.175, 0.34)) for s in (-1.0, 1.0)]
    return merge([block, *cylinders, *covers])


def _exhaust(segments: int) -> Mesh:
    way = np.array(
        [
            [0.24, -0.07, 0.55],
            [0.34, -0.09, 0.46],
            [0.33, -0.11, 0.26],
            [0.20, -0.12, 0.185],
            [-0.10, -0.15, 0.20],
            [-0.30, -0.19, 0.27],
        ]
    )
    can = np.array([[-0.28, -0.19, 0.265], [-0.33, -0.20, 0.29], [-0.74, -0.215, 0.46], [-0.76, -0.215, 0.47]])
    if segments < 6:
        return merge([tube(way[[0, 2, 3, 5]], 0.022, 3), tube(can[[1, 3]], np.array([0.048, 0.052]), 5)])
    return merge([tube(way, 0.022, segments), tube(can, np.array([0.030, 0.052, 0.055, 0.045]), segments)])


def _steel(shape: MotorcycleShape, segments: int) -> Mesh:
    """Return frame and swing arm."""
    half, radius = shape.wheelbase / 2.0, shape.wheel_radius
    tubes = []
    for side in (-1.0, 1.0):
        tubes.append(
            bar(
                np.array([[0.50, side * 0.03, 0.86], [0.30, side * 0.12, 0.68], [-0.20, side * 0.13, 0.50]]),
                0.026,
                segments,
            )
        )
        tubes.append(bar(np.array([[-0.18, side * 0.13, 0.42], [-half, side * 0.13, radius]]), 0.026, segments))
        tubes.append(bar(np.array([[-0.16, side * 0.10, 0.60], [-0.70, side * 0.08, 0.78]]), 0.014, segments))
        if segments < 6:
            continue  # the stays of the pegs
        tubes.append(
            tube(
                np.array([[-0.15, side * 0.12, 0.38], _mirror(shape.peg, side) + [0.0, side * 0.05, 0.0]]),
                0.013,
                segments,
            )
        )
    tubes.append(bar(np.array([[-0.22, 0.0, 0.62], [-0.36, 0.0, 0.40]]), 0.04, segments))
    return merge(tubes)


def _front(shape: MotorcycleShape, segments: int) -> Mesh:
    """Return fork and handlebar."""
    half, radius = shape.wheelbase / 2.0, shape.wheel_radius
    x, y, z = shape.grip
    tubes = [
        tube(
            np.array([[half, s * 0.098, radius], [half - 0.09, s * 0.098, 0.55], [0.475, s * 0.098, 0.98]]),
            np.array([0.032, 0.030, 0.022]),
            segments,
        )
        for s in (-1.0, 1.0)
    ]
    tubes += [box((0.07, 0.24, 0.035), (0.49, 0.0, height)) for height in (0.80, 0.965)]
    bar = [
        (x, y + 0.09, z),
        (x + 0.03, y - 0.09, z),
        (0.455, 0.12, 1.03),
        (0.465, -0.12, 1.03),
        (x + 0.03, -y + 0.09, z),
        (x, -y - 0.09, z),
    ]
    return merge([*tubes, tube(np.array(bar), 0.014, segments)])


def build(shape: MotorcycleShape, light: bool = False) -> Parts:
    """Return the parts of a motorcycle, name -> (mesh, role)."""
    segments, half, radius = 4 if light else 12, shape.wheelbase / 2.0, shape.wheel_radius
    x, y, z = shape.grip
    seat = np.array([(0.0, 0.07), (-0.12, 0.11), (-0.30, 0.135), (-0.45, 0.12), (-0.66, 0.09), (-0.74, 0.05)]) + [
        -0.05,
        0.0,
    ]
    if light:
        seat = seat[[0, 2, 4, 5]]
    outline = np.concatenate([seat, seat[::-1] * [1.0, -1.0]])
    rear = [
        (0.70, 0.10, 0.06, -0.60, 0.0),
        (0.74, 0.24, 0.10, -0.60, 0.0),
        (0.785, 0.26, 0.11, -0.62, 0.0),
        (0.80, 0.2, 0.08, -0.62, 0.0),
    ]
    tail = loft(np.array(rear[::2] + rear[3:] if light else rear), segments * 2, 2.6)
    grips = [
        tube(
            np.array([(x - 0.002, s * (y + 0.095), z), (x + 0.015, s * (y - 0.045), z)]),
            0.020,
            3 if light else segments,
        )
        for s in (-1.0, 1.0)
    ]
    pegs = [
        tube(
            np.array([_mirror(shape.peg, s) - [0.0, s * 0.05, 0.0], _mirror(shape.peg, s) + [0.0, s * 0.05, 0.0]]),
            0.014,
            3 if light else 6,
        )
        for s in (-1.0, 1.0)
    ]
    guard = mudguard(np.array([half, 0.0, radius]), radius + 0.03, 35.0, 150.0, 0.065, 4 if light else 14)
    lamp = ellipsoid((0.565, 0.0, 0.86), (0.075, 0.10, 0.10), rows=3 if light else 10, segments=6 if light else 18)
    parts: Parts = {
        "bodywork": (merge([_tank(light), tail, guard]), "paint"),
        "engine": (_engine(light), "underbody_steel"),
        "steel": (_steel(shape, 3 if light else segments), "frame_steel"),
        "fork": (merge([_front(shape, 3 if light else segments), _exhaust(segments)]), "chrome"),
        "seat": (merge([extrude(outline, 0.765, 0.835), *grips, *pegs]), "trim"),
        "lamp_front": (lamp, "headlamp"),
        "lamp_rear": (box((0.03, 0.14, 0.05), (-0.875, 0.0, 0.755)), "taillamp"),
        "plate": (box((0.006, 0.20, 0.16), (-0.93, 0.0, 0.56)), "plate"),
    }
    for name, place, tyre_half in (("front", half, shape.front_tyre), ("rear", -half, shape.rear_tyre)):
        tyre, rim = (part.moved((place, 0.0, radius)) for part in _wheel(shape, tyre_half, light))
        parts |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    if not light:
        holder = tube(np.array([[-0.80, 0.0, 0.74], [-0.925, 0.0, 0.63], [-0.925, 0.0, 0.50]]), 0.02, 8)
        hugger = mudguard(np.array([-half, 0.0, radius]), radius + 0.025, 20.0, 110.0, 0.085, 12)
        radiator = box((0.035, 0.28, 0.26), (0.385, 0.0, 0.55))
        stalks = [
            tube(
                np.array(
                    [
                        (x + 0.02, s * (y - 0.06), z),
                        (x + 0.03, s * (y + 0.02), z + 0.13),
                        (x + 0.02, s * (y + 0.05), z + 0.16),
                    ]
                ),
                0.006,
                6,
            )
            for s in (-1.0, 1.0)
        ]
        mirrors = [
            ellipsoid((x + 0.02, s * (y + 0.07), z + 0.17), (0.018, 0.065, 0.042), rows=6, segments=12)
            for s in (-1.0, 1.0)
        ]
        blinkers = [
            ellipsoid((bx, s * by, bz), (0.03, 0.028, 0.022), rows=5, segments=8)
            for s in (-1.0, 1.0)
            for bx, by, bz in ((0.55, 0.19, 0.83), (-0.80, 0.16, 0.70))
        ]
        parts["trim"] = (merge([holder, hugger, radiator, *stalks, *mirrors]), "trim")
        parts["blinkers"] = (merge(blinkers), "indicator")
    return parts
