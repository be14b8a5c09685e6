"""A city bicycle: diamond frame, fork, wheels with spokes, cranks and pedals, from its measures.

Frame: origin on the ground below the middle, x forward, y left, z up; the chain is on the right. Cranks and pedals are
in the frames in which the simulator's pedalling model turns them: origin at the axle, left crank along x; pedals at
their own axle, level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...geometry.loft import ellipsoid
from ...geometry.mesh import Array, Mesh, box, extrude, grid, merge, outward, revolve, tube

Parts = dict[str, tuple[Mesh, str]]


@dataclass(frozen=True)
class BicycleShape:
    """Measures of a bicycle [m]; defaults are those of a city bicycle with 28 inch wheels (37-622)."""

    wheelbase: float = 1.08
    wheel_radius: float = 0.346
    tyre: float = 0.018
    axle: tuple[float, float] = (-0.10, 0.285)
    crank: float = 0.17
    foot_y: float = 0.125
    gear: float = 2.3
    seat_angle_deg: float = 72.5
    head_angle_deg: float = 71.0
    saddle: tuple[float, float] = (-0.335, 0.925)
    """x and z of the top of the saddle's middle."""
    grip: tuple[float, float, float] = (0.255, 0.265, 1.055)

    @property
    def front(self) -> Array:
        """Front axle, shape (3,)."""
        return np.array([self.wheelbase / 2.0, 0.0, self.wheel_radius])

    @property
    def rear(self) -> Array:
        """Rear axle, shape (3,)."""
        return np.array([-self.wheelbase / 2.0, 0.0, self.wheel_radius])

    def steering(self, height: float) -> Array:
        """Return the point of the steering axis that is `height` along it above the front axle, shape (3,)."""
        angle = np.radians(self.head_angle_deg)
        up, ahead = np.array([-np.cos(angle), 0.0, np.sin(angle)]), np.array([np.sin(angle), 0.0, np.cos(angle)])
        return np.asarray(self.front - 0.045 * ahead + height * up)

    def seat_tube(self, length: float) -> Array:
        """Return the point of the seat tube at a length from the cranks' axle, shape (3,)."""
        angle = np.radians(self.seat_angle_deg)
        return np.array([self.axle[0] - length * np.cos(angle), 0.0, self.axle[1] + length * np.sin(angle)])


def ring(radius: float, depth: float, width: float, around: int, across: int) -> Mesh:
    """Return a ring about y: middle radius, half extents of its section along the radius and along y [m]."""
    turn = np.linspace(0.0, 2.0 * np.pi, across + 1)
    return outward(revolve(np.stack([radius + depth * np.cos(turn), width * np.sin(turn)], 1), around, "y"))


def disc(radius: float, width: float, segments: int) -> Mesh:
    """Return a solid disc about y [m]."""
    profile = [(1e-4, -width / 2.0), (radius, -width / 2.0), (radius, width / 2.0), (1e-4, width / 2.0)]
    return outward(revolve(np.array(profile), segments, "y"))


def light_disc(radius: float, width: float, segments: int) -> Mesh:
    """Return the disc of :func:`disc` without a hole of 0.1 mm: two thirds of its triangles [m]."""
    profile = [(0.0, -width / 2.0), (radius, -width / 2.0), (radius, width / 2.0), (0.0, width / 2.0)]
    return outward(revolve(np.array(profile), segments, "y"))


def without_ends(bar: Mesh, segments: int) -> Mesh:
    """Return a `tube` without its two end faces, for one whose ends are hidden."""
    return replace(bar, faces=bar.faces[: -2 * segments])


def spokes(hub: float, rim: float, flange: float, number: int, thickness: float) -> Mesh:
    """Return tangential wire spokes from the flanges of a hub to a rim, as three-sided wires [m].

    Those up to 8 without end faces.
    """
    wires = []
    for k in range(number):
        at = 2.0 * np.pi * k / number
        lean = 0.9 if (k // 2) % 2 else -0.9
        side = flange if k % 2 else -flange
        start = [hub * np.cos(at + lean), side, hub * np.sin(at + lean)]
        wire = tube(np.array([start, [rim * np.cos(at), 0.0, rim * np.sin(at)]]), thickness, 3)
        wires.append(wire if number > 8 else without_ends(wire, 3))
    return merge(wires)


def wheel(shape: BicycleShape, light: bool) -> tuple[Mesh, Mesh]:
    """Return tyre and rim (with hub and spokes) of a wheel about the origin."""
    around = (12 if shape.wheel_radius < 0.3 else 16) if light else 40
    middle = shape.wheel_radius - shape.tyre
    tyre = ring(middle, shape.tyre, shape.tyre, around, 3 if light else 8)
    rim = ring(middle - 0.020, 0.008, 0.012, min(around, 14) if light else around, 3 if light else 6)
    hub = bar(np.array([[0.0, -0.05, 0.0], [0.0, 0.05, 0.0]]), 0.017, 4 if light else 12)
    wires = spokes(0.026, middle - 0.022, 0.032, 8 if light else 24, 0.0015 if light else 0.001)
    flanges = [] if light else [disc(0.03, 0.003, 14).moved((0.0, y, 0.0)) for y in (-0.032, 0.032)]
    return tyre, merge([rim, hub, wires, *flanges])


def bar(path: Array, radius: float | Array, segments: int) -> Mesh:
    """Return a `tube`; one of the light level, of 3 or 4 sides, without end faces: other bars hide them."""
    whole = tube(path, radius, segments)
    return whole if segments > 4 else without_ends(whole, segments)


def _line(*points: Array, radius: float, segments: int) -> Mesh:
    return bar(np.array(points), radius, segments)


def frame(shape: BicycleShape, segments: int) -> Mesh:
    """Return the frame without the fork."""
    thin = 3 if segments == 4 else segments
    bracket, seat_top = shape.seat_tube(0.0), shape.seat_tube(0.50)
    low, high = shape.steering(0.42), shape.steering(0.56)
    tubes = [
        _line(bracket, seat_top, radius=0.016, segments=segments),
        _line(low, high, radius=0.020, segments=segments),
        _line(shape.seat_tube(0.47), high - 0.02 * (high - low), radius=0.015, segments=segments),
        _line(bracket, low + 0.2 * (high - low), radius=0.019, segments=segments),
        tube(bracket + np.array([[0.0, -0.037, 0.0], [0.0, 0.037, 0.0]]), 0.023, segments),
    ]
    for side in (-1.0, 1.0):
        out = np.array([0.0, side * 0.058, 0.0])
        near = np.array([0.0, side * 0.030, 0.0])
        tubes.append(_line(bracket + near, shape.rear + out, radius=0.009, segments=thin))
        tubes.append(_line(shape.seat_tube(0.45) + 0.6 * near, shape.rear + out, radius=0.008, segments=thin))
    return merge(tubes)


def _fork(shape: BicycleShape, segments: int) -> Mesh:
    crown = shape.steering(0.40)
    tubes = [_line(shape.steering(0.56), shape.steering(0.62), radius=0.014, segments=segments)]
    for side in (-1.0, 1.0):
        out = np.array([0.0, side * 0.052, 0.0])
        way = [crown + 0.3 * out, crown + out - [0.0, 0.0, 0.02], shape.steering(0.16) + out, shape.front + out]
        tubes.append(bar(np.array(way), np.array([0.014, 0.013, 0.011, 0.008]), segments))
    return merge(tubes)


def _handlebar(shape: BicycleShape, segments: int) -> tuple[Mesh, Mesh]:
    x, y, z = shape.grip
    stem = shape.steering(0.62)
    clamp = np.array([x + 0.07, 0.0, z - 0.015])
    half = [(x - 0.012, y + 0.065, z), (x, y - 0.05, z), (x + 0.05, y - 0.13, z - 0.010), (clamp[0], 0.03, clamp[2])]
    if segments < 6:
        half = [half[0], half[2], half[3]]
    way = [*half, *[(a, -b, c) for a, b, c in half[::-1]]]
    thin = 3 if segments == 4 else segments
    handlebar = merge([bar(np.array(way), 0.0115, segments), _line(stem, clamp, radius=0.015, segments=thin)])
    grips = merge(
        [
            tube(np.array([(x - 0.013, s * (y + 0.068), z), (x - 0.003, s * (y - 0.055), z)]), 0.017, segments)
            for s in (-1.0, 1.0)
        ]
    )
    return handlebar, grips


def saddle(shape: BicycleShape, segments: int) -> Mesh:
    """Return the saddle: a pear in plan."""
    x, z = shape.saddle
    half = [
        (0.155, 0.018),
        (0.12, 0.023),
        (0.05, 0.032),
        (-0.02, 0.062),
        (-0.075, 0.082),
        (-0.115, 0.070),
        (-0.125, 0.030),
    ]
    if segments < 6:
        half = half[::2]
    outline = np.array([*half, *[(a, -b) for a, b in half[::-1]]]) + [x, 0.0]
    return extrude(outline, z - 0.045, z)


def mudguard(axle: Array, radius: float, start_deg: float, stop_deg: float, width: float, rows: int) -> Mesh:
    """Return a mudguard over a wheel from one angle to another, counted from ahead over the top."""
    angle = np.radians(np.linspace(start_deg, stop_deg, rows))
    across = np.linspace(-1.0, 1.0, 5)
    away = radius - 0.010 * across**2
    points = np.stack(
        [
            axle[0] + np.cos(angle)[:, None] * away,
            np.broadcast_to(width * across, (rows, 5)),
            axle[2] + np.sin(angle)[:, None] * away,
        ],
        axis=-1,
    )
    return grid(points)


def _rack(shape: BicycleShape) -> Mesh:
    x, z = shape.rear[0], 2.0 * shape.wheel_radius + 0.055
    bars = []
    for y in (-0.055, 0.0, 0.055):
        bars.append(tube(np.array([(x - 0.13, y, z), (x + 0.21, y, z)]), 0.005, 6))
    for side in (-0.055, 0.055):
        bars.append(tube(np.array([(x, 1.1 * side, shape.wheel_radius), (x - 0.04, side, z)]), 0.004, 5))
    bars += [tube(np.array([(x + a, -0.055, z), (x + a, 0.055, z)]), 0.004, 5) for a in (-0.13, 0.21)]
    bars.append(_line(np.array([x + 0.21, 0.0, z]), shape.seat_tube(0.46), radius=0.005, segments=5))
    return merge(bars)


def _chain(shape: BicycleShape) -> Mesh:
    big, small = 0.088, 0.088 / shape.gear
    y = -0.045
    runs = []
    for sign in (1.0, -1.0):
        start = [shape.axle[0], y, shape.axle[1] + sign * big]
        runs.append(tube(np.array([start, [shape.rear[0], y, shape.rear[2] + sign * small]]), 0.0045, 4))
    return merge([*runs, disc(small, 0.006, 12).moved((shape.rear[0], y, shape.rear[2]))])


def cranks(shape: BicycleShape, light: bool) -> Mesh:
    """Return both cranks, their axle and the chainring, in the frame that turns with them."""
    segments = 4 if light else 10
    axle = bar(np.array([[0.0, -0.066, 0.0], [0.0, 0.066, 0.0]]), 0.011, segments)
    arms = [
        tube(np.array([[0.0, s * 0.062, 0.0], [s * shape.crank, s * 0.074, 0.0]]), np.array([0.015, 0.011]), segments)
        for s in (1.0, -1.0)
    ]
    teeth = (
        light_disc(0.088, 0.004, 8)
        if light
        else merge([ring(0.083, 0.006, 0.003, 36, 4), disc(0.035, 0.004, 14), *_spider()])
    )
    return merge([axle, *arms, teeth.moved((0.0, -0.045, 0.0))])


def _spider() -> list[Mesh]:
    turn = 2.0 * np.pi * np.arange(5) / 5.0
    return [tube(np.array([[0.0, 0.0, 0.0], [0.08 * np.cos(t), 0.0, 0.08 * np.sin(t)]]), 0.005, 5) for t in turn]


def pedal(shape: BicycleShape, side: float, light: bool) -> Mesh:
    """Return the pedal of a side (1 left, -1 right), with its axle towards the crank."""
    body = box((0.088, 0.090, 0.022))
    if light:
        return body
    inner = side * (0.074 - shape.foot_y)
    return merge([body, tube(np.array([[0.0, inner, 0.0], [0.0, side * 0.035, 0.0]]), 0.006, 6)])


def build(shape: BicycleShape, light: bool = False) -> Parts:
    """Return the parts of a bicycle, name -> (mesh, role).

    Roles: ``paint``, ``tyre``, ``rim``, ``chrome``, ``trim``, ``headlamp``, ``taillamp``. The parts ``cranks``,
    ``left_pedal`` and ``right_pedal`` are in their own frames.
    """
    segments = 4 if light else 10
    handlebar, grips = _handlebar(shape, segments)
    post = _line(
        shape.seat_tube(0.48),
        np.array([shape.saddle[0] + 0.02, 0.0, shape.saddle[1] - 0.04]),
        radius=0.0135,
        segments=segments,
    )
    lamp = shape.steering(0.49) + [0.066, 0.0, 0.0]
    holder = _line(shape.steering(0.49), lamp - [0.006, 0.0, 0.0], radius=0.008, segments=3 if light else segments)
    parts: Parts = {
        "frame": (merge([frame(shape, segments), _fork(shape, segments)]), "paint"),
        "handlebar": (merge([handlebar, post, holder]), "chrome"),
        "saddle": (merge([saddle(shape, segments), grips]), "trim"),
        "cranks": (cranks(shape, light), "chrome"),
        "left_pedal": (pedal(shape, 1.0, light), "trim"),
        "right_pedal": (pedal(shape, -1.0, light), "trim"),
    }
    for name, place in (("front", shape.front), ("rear", shape.rear)):
        tyre, rim = (part.moved(place) for part in wheel(shape, light))
        parts |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    rear = (shape.rear[0] - 0.137, 0.0, 2.0 * shape.wheel_radius + 0.045)
    if light:  # no rack: below the saddle
        rear = tuple(shape.seat_tube(0.54) - [0.022, 0.0, 0.0])
    glass = (
        box((0.05, 0.056, 0.056), lamp)
        if light
        else ellipsoid(tuple(lamp), (0.032, 0.032, 0.032), rows=10, segments=16)
    )
    parts["lamp_front"] = (glass, "headlamp")
    parts["lamp_rear"] = (box((0.02, 0.07, 0.035), rear), "taillamp")
    if not light:
        guard = shape.wheel_radius + 0.025
        parts["mudguards"] = (
            merge(
                [
                    mudguard(shape.front, guard, 35.0, 165.0, 0.026, 18),
                    mudguard(shape.rear, guard, 20.0, 190.0, 0.026, 22),
                ]
            ),
            "trim",
        )
        parts["rack"] = (_rack(shape), "trim")
        parts["chain"] = (_chain(shape), "rim")
    return parts
