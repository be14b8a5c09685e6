"""Cars: a lofted body with wheel arches, a glazed cabin, wheels, lamps and trim, from a handful of measures.

Local frame: origin on the ground below the middle of the car, x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..geometry.decal import panel, strips
from ..geometry.mesh import Array, Mesh, box, grid, merge, outward, revolve, weld
from .body_loft import DRAFT

SIDE_PROFILE = PchipInterpolator(
    [0.10, 0.20, 0.30, 0.45, 0.60, 0.72, 0.85, 1.00, 1.20], [0.90, 0.935, 0.965, 0.988, 0.998, 1.0, 0.982, 0.955, 0.90]
)
"""Half width over its maximum as a function of the height over 1.46/height [m]."""

CROWN = 0.5
"""Radius of bumpers in side view, below their middle [m]."""


@dataclass(frozen=True)
class CarShape:
    """Measures of a car [m].

    Attributes
    ----------
    length, width, height : float
        Outer measures without mirrors.
    front_axle, rear_axle : float
        x of the axles.
    deck : tuple of (x, z)
        Side line of the lower body, from the tail to the nose: boot, belt, bonnet.
    cabin_base, cabin_top : (rear x, front x)
        Where the windows begin (at the belt) and end (at the roof).
    cabin_base_width, cabin_top_width : float
        Half widths.
    glazing : tuple of (start, stop)
        Side windows along the cabin, 0 = front to 1 = rear.
    cladding : bool
        True if the sills, the rims of the wheel arches and the lower bumpers are black plastic.
    """

    length: float
    width: float
    height: float
    front_axle: float
    rear_axle: float
    deck: tuple[tuple[float, float], ...]
    cabin_base: tuple[float, float]
    cabin_top: tuple[float, float]
    cabin_base_width: float
    cabin_top_width: float
    glazing: tuple[tuple[float, float], ...] = ((0.06, 0.43), (0.47, 0.80))
    wheel_radius: float = 0.325
    floor: float = 0.19
    front_bow: float = 0.24
    rear_bow: float = 0.13
    tail_slope: float = 0.05
    nose_slope: float = 0.13
    spokes: int = 5
    cladding: bool = False
    lamp_height: float = 0.66
    tail_lamp: tuple[float, float] = (0.76, 0.93)
    extra: dict[str, float] = field(default_factory=dict)

    @property
    def half_length(self) -> float:
        """Half length of the body shell [m]: number plates stand 5 mm out."""
        return self.length / 2 - 0.005


def _smoothstep(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x * x * (3 - 2 * x))


def _crown(z: Array, middle: float, above: float) -> Array:
    """Return how far a bumper stands back [m] at a height, round by `CROWN` below its middle and by `above` over it."""
    radius = np.where(z < middle, CROWN, above)
    past = np.clip(np.abs(z - middle) / radius, 0.0, 0.7)
    return np.asarray(radius * (1.0 - np.sqrt(1.0 - past**2)))


def deform(shape: CarShape, p: Array) -> Array:
    """Return points with the nose and tail bowed in plan and sloped in side view.

    x = +-half length stays on the axis.
    """
    x, y, z = p[..., 0], p[..., 1] / (shape.width / 2), p[..., 2]
    front = _smoothstep((x - (shape.front_axle + 0.30)) / (shape.half_length - shape.front_axle - 0.30))
    rear = _smoothstep((shape.rear_axle - 0.38 - x) / (shape.half_length + shape.rear_axle - 0.38))
    bow = y**2
    nose = shape.nose_slope * np.clip((z - 0.52) / 0.25, 0, 2) ** 1.5 + _crown(z, 0.475, CROWN)
    tail = shape.tail_slope * np.clip((z - 0.62) / 0.3, 0, 2) ** 1.5 + _crown(
        z, shape.extra.get("plate_z", 0.56), 2 * CROWN
    )
    shifted = x - front * (shape.front_bow * bow + nose) + rear * (shape.rear_bow * bow + tail)
    return np.stack([shifted, p[..., 1], z], -1)


def _stations(shape: CarShape) -> tuple[Array, Array]:
    """Return the x of the cross-sections [m] and the inset of each [m], front to rear."""
    arch = shape.wheel_radius + 0.055
    theta = np.radians([0.0, 12.0, 26.0, 42.0, 58.0, 74.0])
    around = np.concatenate([-np.cos(theta), [0.0], np.cos(theta)]) * arch
    edges = np.array([-arch - 0.003, arch + 0.003])
    wheels = np.concatenate([[axle + d for d in (*around, *edges)] for axle in (shape.front_axle, shape.rear_axle)])
    h = shape.half_length
    middle = np.linspace(shape.rear_axle + arch + 0.12, shape.front_axle - arch - 0.12, 9)
    r = 0.12
    bend = np.radians([90.0, 72.0, 52.0, 30.0, 0.0])
    round_front = h - r + r * np.sin(bend)
    nose = np.linspace(shape.front_axle + arch + 0.06, h - r - 0.05, 4)
    tail = np.linspace(-h + r + 0.05, shape.rear_axle - arch - 0.06, 5)
    x = np.unique(np.round(np.concatenate([wheels, middle, round_front, -round_front, nose, tail]), 6))[::-1]
    past = np.clip((np.abs(x) - (h - r)) / r, 0.0, 1.0)
    inset = r * (1.0 - np.sqrt(1.0 - past**2))
    return x, inset


def shell_ring(shape: CarShape, x: float, inset: float, deck: PchipInterpolator) -> Array:
    """Return one closed cross-section, shape (n, 3): bottom middle, left side, top middle, right side."""
    arch_radius = shape.wheel_radius + 0.055
    low = shape.floor + 0.45 * inset + 0.05 * _smoothstep(np.array((abs(x) - 1.7) / 0.6))
    arch = low
    for axle in (shape.front_axle, shape.rear_axle):
        if abs(x - axle) <= arch_radius + 1e-9:
            rise = np.sqrt(max(arch_radius**2 - (x - axle) ** 2, 0.0))
            arch = max(arch, shape.wheel_radius + rise)
    top = float(deck(x)) - 0.8 * inset
    plan = 1.0 - 0.035 * _smoothstep(np.array((abs(x) - 0.8) / 1.4))
    half = shape.width / 2 * plan - 1.2 * inset
    shoulder = top - 0.055
    z = arch + (shoulder - arch) * np.array([0.0, 0.05, 0.18, 0.34, 0.5, 0.66, 0.82, 0.93, 1.0])
    y = half * SIDE_PROFILE(z * 1.46 / max(shape.height, 1.46))
    y[0] -= 0.012
    edge = y[-1]
    turn = np.radians([30.0, 60.0, 90.0])
    y_top = edge - 0.055 + 0.055 * np.cos(turn)
    z_top = shoulder + 0.055 * np.sin(turn)
    inner = y_top[-1] * np.array([0.9, 0.72, 0.48, 0.24, 0.0])
    crown = 0.045 * (1.0 - (inner / y_top[-1]) ** 2)
    tunnel = 0.56 * shape.width / 2
    half_ring = np.concatenate(
        [
            [
                [0.0, low],
                [tunnel * 0.5, low],
                [tunnel, low],
                [tunnel - DRAFT * (arch - low), arch + 0.1 * (arch - low)],
            ],
            np.column_stack([y, z]),
            np.column_stack([y_top, z_top]),
            np.column_stack([inner, z_top[-1] + crown]),
        ]
    )
    ring = np.concatenate([half_ring, half_ring[-2:0:-1] * [-1.0, 1.0]])
    return np.column_stack([np.full(len(ring), x), ring])


def shell(shape: CarShape) -> tuple[Mesh, Mesh]:
    """Return the painted and the black part of the lower body with its wheel arches; together they are closed."""
    xs, insets = _stations(shape)
    z = np.array(shape.deck)
    deck = PchipInterpolator(z[:, 0], z[:, 1])
    rings = np.stack([shell_ring(shape, float(x), float(i), deck) for x, i in zip(xs, insets, strict=True)])
    parts = [grid(deform(shape, rings), close_columns=True)]
    columns = rings.shape[1]
    column = np.repeat(np.tile(np.arange(columns), len(rings) - 1), 2)
    black = [np.minimum(column, columns - 1 - column) < (6 if shape.cladding else 3)]
    for ring, flip in ((rings[0], False), (rings[-1], True)):
        centre = np.array([ring[0, 0], 0.0, 0.5 * (ring[:, 2].min() + ring[:, 2].max())])
        levels = [centre + (ring - centre) * t for t in (1.0, 0.86, 0.66, 0.42, 0.2, 0.0)]
        cap = grid(deform(shape, np.stack(levels)), close_columns=True)
        black.append(np.zeros(len(cap.faces), bool))
        parts.append(cap if flip else cap.flipped())
    whole, is_black = outward(merge(parts)), np.concatenate(black)
    painted, dark = (weld(Mesh(whole.vertices, whole.faces[chosen])) for chosen in (~is_black, is_black))
    return painted, dark


def _roof(shape: CarShape, x: Array, y: Array) -> Array:
    """Return the height of the roof surface [m]."""
    rear, front = shape.cabin_top
    middle, reach = 0.5 * (rear + front), 0.5 * (front - rear)
    sag = shape.extra.get("roof_sag", 0.055)
    return shape.height - sag * ((x - middle) / reach) ** 2 - 0.055 * (y / shape.cabin_top_width) ** 2


def _cabin_outline(base: tuple[float, float], half: float, bow: float, breaks: Array, taper: float) -> Array:
    """Return half an outline (y >= 0) of the cabin, from the front middle to the rear middle, shape (n, 2)."""
    rear, front = base
    across = np.array([0.0, 0.3, 0.6, 0.86])
    front_x = front - bow * across**2
    corner = 0.17 * (front - rear) / 2.6
    x_side = front - bow - corner + breaks * (rear + 0.6 * bow + 0.7 * corner - (front - bow - corner))
    y_side = half * (
        1.0 - taper * np.clip((breaks - 0.35) / 0.65, 0, 1) ** 2 - 0.02 * np.clip(0.2 - breaks, 0, 1) / 0.2
    )
    rear_across = np.array([0.84, 0.58, 0.3, 0.0])
    rear_x = rear + 0.6 * bow * rear_across**2
    x = np.concatenate([front_x, x_side, rear_x])
    y = np.concatenate([half * across, y_side, half * (1.0 - taper) * rear_across])
    return np.column_stack([x, y])


def cabin_breaks(shape: CarShape) -> Array:
    """Return where the columns of the cabin's side stand, 0 = front to 1 = rear."""
    inner = [v for pair in shape.glazing for v in pair]
    fill = [0.5 * (a + b) for a, b in shape.glazing]
    return np.unique(np.round([0.0, *inner, *fill, 1.0], 6))


def cabin_points(shape: CarShape) -> tuple[Array, Array, int]:
    """Return the grid of the cabin (rows, columns, 3) [m], the kind of each cell, and the columns of its left half.

    Kinds are those of `_cabin_kinds`.
    """
    breaks = cabin_breaks(shape)
    low = _cabin_outline(shape.cabin_base, shape.cabin_base_width, 0.20, breaks, 0.10)
    high = _cabin_outline(shape.cabin_top, shape.cabin_top_width, 0.10, breaks, 0.06)
    z = np.array(shape.deck)
    deck = PchipInterpolator(z[:, 0], z[:, 1])
    low_z = deck(low[:, 0]) + 0.045 * (1 - (low[:, 1] / (0.9 * shape.width / 2)) ** 2) - 0.03
    high_z = _roof(shape, high[:, 0], high[:, 1]) - 0.015
    levels = np.array([0.0, 0.09, 0.13, 0.3, 0.5, 0.7, 0.86, 0.93, 1.0])
    v = levels[:, None]
    bulge = 4.0 * v * (1.0 - v)
    x = low[:, 0] + (high[:, 0] - low[:, 0]) * v
    y = (low[:, 1] + (high[:, 1] - low[:, 1]) * v) * (1.0 + 0.035 * bulge)
    centre_x = 0.5 * (shape.cabin_top[0] + shape.cabin_top[1])
    x = x + bulge * 0.045 * np.sign(x - centre_x) * np.abs((x - centre_x) / 1.2) ** 2
    walls = np.stack([x, y, low_z + (high_z - low_z) * v], -1)
    spine = np.clip(high[:, 0], shape.cabin_top[0] + 0.25, shape.cabin_top[1] - 0.25)
    roof = []
    for t in (0.035, 0.09, 0.2, 0.4, 0.65, 0.85, 1.0):
        rx, ry = high[:, 0] + (spine - high[:, 0]) * t, high[:, 1] * (1.0 - t)
        drop = 0.015 * (1.0 - np.clip(t / 0.09, 0, 1)) ** 2
        roof.append(np.stack([rx, ry, _roof(shape, rx, ry) - drop], -1))
    half = np.concatenate([walls, np.stack(roof)])
    full = np.concatenate([half, half[:, -2:0:-1] * [1.0, -1.0, 1.0]], axis=1)
    kind = _cabin_kinds(shape, breaks, len(half), half.shape[1], full.shape[1])
    return full, kind, half.shape[1]


def cabin(shape: CarShape) -> tuple[Mesh, Mesh, Mesh]:
    """Return the painted, the glazed and the black part of the cabin.

    Together a closed surface with the shell below.
    """
    full, kind, _ = cabin_points(shape)
    centre_x = 0.5 * (shape.cabin_top[0] + shape.cabin_top[1])
    surface = grid(full, close_columns=True)
    flip = (
        np.einsum(
            "i,i->",
            surface.vertices[surface.faces[0]].mean(0) - [centre_x, 0, 1.0],
            np.cross(*(surface.vertices[surface.faces[0]][1:] - surface.vertices[surface.faces[0]][0])),
        )
        < 0
    )
    surface = surface.flipped() if flip else surface
    pieces = [weld(Mesh(surface.vertices, surface.faces[np.repeat(kind.ravel() == k, 2)])) for k in range(3)]
    return pieces[0], pieces[1], pieces[2]


def _cabin_kinds(shape: CarShape, breaks: Array, rows: int, half: int, columns: int) -> Array:
    """Return the kind of each cell of the cabin grid, shape (rows - 1, columns): 0 paint, 1 glass, 2 black trim."""
    kind = np.zeros((rows - 1, columns), int)
    along = np.full(half - 1, -1.0)
    along[4 : 4 + len(breaks) - 1] = 0.5 * (breaks[1:] + breaks[:-1])
    is_glass = np.array([any(a < s < b for a, b in shape.glazing) for s in along])
    is_black = (along > shape.glazing[0][0]) & (along < shape.glazing[-1][1]) & ~is_glass
    is_glass[:3] = True
    is_glass[-3:] = True
    for j in range(half - 1):
        for column in (j, columns - 1 - j):
            if is_glass[j]:
                kind[2:6, column] = 1
                kind[1, column] = kind[6, column] = 2
            elif is_black[j]:
                kind[1:7, column] = 2
    return kind


def wheel(shape: CarShape, x: float, left: bool) -> tuple[Mesh, Mesh, Mesh]:
    """Return tyre, bright rim and dark wheel well of one wheel (left: outer side at +y)."""
    r, half = shape.wheel_radius, 0.105
    rim = r - 0.095
    tyre = np.array(
        [
            (rim, -half * 0.82),
            (0.5 * (rim + r), -half),
            (r - 0.03, -half * 0.95),
            (r - 0.008, -half * 0.82),
            (r, -half * 0.6),
            (r, half * 0.6),
            (r - 0.008, half * 0.82),
            (r - 0.03, half * 0.95),
            (0.5 * (rim + r), half),
            (rim, half * 0.82),
        ]
    )
    dark = np.array([(0.0005, -0.03), (rim, -0.078), (rim, 0.0), (0.0005, 0.035)])
    lip = np.array(
        [(rim - 0.022, 0.06), (rim - 0.006, 0.099), (rim + 0.006, 0.099), (rim + 0.004, 0.085), (rim - 0.022, 0.03)]
    )
    bright = [revolve(np.vstack([lip, lip[:1]])[::-1], 18, "y")]
    bright.append(
        revolve(np.array([(0.0005, 0.02), (0.055, 0.03), (0.055, 0.075), (0.035, 0.088), (0.0005, 0.09)]), 12, "y")
    )
    for k in range(shape.spokes):
        spoke = box((rim - 0.03, 0.03, 0.052), ((rim - 0.03) / 2 + 0.018, 0.068, 0.0))
        taper = np.where(spoke.vertices[:, 0] > 0.15, 0.72, 1.25)
        vertices = spoke.vertices * np.column_stack([np.ones_like(taper), np.ones_like(taper), taper])
        angle = 2 * np.pi * k / shape.spokes + 0.31
        c, s = np.cos(angle), np.sin(angle)
        turned = np.column_stack(
            [c * vertices[:, 0] - s * vertices[:, 2], vertices[:, 1], s * vertices[:, 0] + c * vertices[:, 2]]
        )
        bright.append(outward(Mesh(turned, spoke.faces)))
    bright = [outward(m) for m in bright]
    parts = [outward(revolve(np.vstack([tyre, tyre[:1]]), 24, "y")), merge(bright), outward(revolve(dark, 16, "y"))]
    y = shape.width / 2 - 0.022 - half
    placed = []
    for part in parts:
        part = Mesh(part.vertices, part.faces)
        part = part if left else part.mirrored_y()
        placed.append(part.moved((x, y if left else -y, r)))
    return placed[0], placed[1], placed[2]


def _mirror(shape: CarShape) -> Mesh:
    """Return the left outside mirror: a rounded housing on a short foot."""
    x, z = shape.cabin_base[1] - 0.42, shape.extra.get("mirror_z", 1.0)
    angle = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    rings = []
    limit = 0.95
    inner = shape.cabin_base_width - 0.02
    ys = np.linspace(inner, limit, 7)
    size = np.array([0.05, 0.35, 0.85, 1.0, 0.97, 0.75, 0.02])
    for y, k in zip(ys, size, strict=True):
        rings.append(np.column_stack([x + 0.055 * k * np.cos(angle), np.full(16, y), z + 0.075 * k * np.sin(angle)]))
    rings[0][:, 0] = x + 0.06 * np.cos(angle)
    rings[0][:, 2] = z - 0.05 + 0.03 * np.sin(angle)
    return outward(weld(grid(np.stack(rings), close_columns=True)))


WHEELS = {
    "front_left": (True, True),
    "front_right": (True, False),
    "rear_left": (False, True),
    "rear_right": (False, False),
}
"""Name of each wheel -> whether it is in front, and on the left."""


def wheel_centre(shape: CarShape, name: str) -> tuple[float, float, float]:
    """Return the middle of a wheel [m]."""
    front, left = WHEELS[name]
    return (
        shape.front_axle if front else shape.rear_axle,
        0.44 * shape.width * (1 if left else -1),
        shape.wheel_radius,
    )


def build(shape: CarShape, turning_wheels: bool = False, mirrors_apart: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of a car: name -> (mesh, role); the role names the kind of material.

    Roles: ``paint``, ``glass``, ``trim``, ``tyre``, ``rim``, ``headlamp``, ``taillamp``, ``chrome``, ``plate``. With
    `turning_wheels` each tyre and rim is a part of its own (``wheel_front_left_tyre``), about the centre of
    `wheel_centre`; else all tyres are one part and all rims another. With `mirrors_apart` the outside mirrors are a
    part of their own, not of the body.
    """
    lower, dark = shell(shape)
    painted, glazed, black = cabin(shape)
    body = merge([lower, painted])
    whole = merge([lower, dark, painted, glazed, black])
    wheels = {
        name: wheel(shape, shape.front_axle if front else shape.rear_axle, left)
        for name, (front, left) in WHEELS.items()
    }
    tyres, rims, wells = (merge([w[k] for w in wheels.values()]) for k in range(3))
    mirror = _mirror(shape)
    mirrors = [Mesh(mirror.vertices, mirror.faces), Mesh(mirror.vertices, mirror.faces).mirrored_y()]
    w, lamp = shape.width / 2, shape.lamp_height
    front, rear = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    heads, tails, trims, chromes, plates = [], [], [], [], []
    lo, hi = shape.tail_lamp
    for side in (1.0, -1.0):
        outline = [
            (0.52 * w, lamp - 0.035),
            (0.93 * w, lamp - 0.005),
            (0.95 * w, lamp + 0.075),
            (0.55 * w, lamp + 0.03),
        ]
        heads.append(panel(whole, outline, front, side, rise=0.006, with_uv=True))
        inner = shape.extra.get("tail_lamp_inner", 0.58)
        outline = [(inner * w, lo), (0.92 * w, lo + 0.01), (0.915 * w, hi), ((inner - 0.03) * w, hi - 0.03)]
        tails.append(panel(whole, outline, rear, side, rise=0.006, with_uv=True))
        trims.append(
            panel(
                whole, [(0.62 * w, 0.31), (0.88 * w, 0.33), (0.89 * w, 0.42), (0.66 * w, 0.40)], front, side, rise=0.004
            )
        )
    trims.append(
        panel(
            whole,
            [(-0.46 * w, lamp - 0.10), (0.46 * w, lamp - 0.10), (0.50 * w, lamp + 0.015), (-0.50 * w, lamp + 0.015)],
            front,
            1.0,
            0.004,
        )
    )
    trims.append(
        panel(whole, [(-0.50 * w, 0.27), (0.50 * w, 0.27), (0.56 * w, 0.40), (-0.56 * w, 0.40)], front, 1.0, rise=0.004)
    )
    top, reach = (0.46, 0.80) if shape.cladding else (0.40, 0.72)
    trims.append(
        panel(
            whole, [(-reach * w, 0.335), (reach * w, 0.335), (reach * w, top), (-reach * w, top)], rear, 1.0, rise=0.008
        )
    )
    chromes.append(
        panel(
            whole,
            [(-0.07, lamp - 0.06), (0.07, lamp - 0.06), (0.07, lamp - 0.02), (-0.07, lamp - 0.02)],
            front,
            1.0,
            rise=0.010,
        )
    )
    for direction, z in ((front, 0.475), (rear, shape.extra.get("plate_z", 0.56))):
        plates.append(
            panel(
                whole,
                [(-0.26, z - 0.055), (0.26, z - 0.055), (0.26, z + 0.055), (-0.26, z + 0.055)],
                direction,
                1.0,
                rise=0.005,
                with_uv=True,
            )
        )
    for z in (0.49, hi + 0.012):
        trims.append(
            panel(
                whole, [(-0.72 * w, z), (0.72 * w, z), (0.72 * w, z + 0.008), (-0.72 * w, z + 0.008)], rear, 1.0, 0.002
            )
        )
    trims.append(strips(whole, _shut_lines(shape), 0.007, 0.0015))
    chromes.append(strips(whole, _handles(shape), 0.026, 0.016))
    parts = {
        "body": (merge([body, *mirrors]), "paint"),
        "glass": (glazed, "glass"),
        "trim": (merge([dark, black, wells, *trims]), "trim"),
        "tyres": (tyres, "tyre"),
        "rims": (rims, "rim"),
        "headlamps": (merge(heads), "headlamp"),
        "taillamps": (merge(tails), "taillamp"),
        "chrome": (merge(chromes), "chrome"),
        "plates": (merge(plates), "plate"),
    }
    if mirrors_apart:
        parts |= {"body": (body, "paint"), "mirrors": (merge(mirrors), "paint")}
    if turning_wheels:
        del parts["tyres"], parts["rims"]
        for name, (tyre, rim, _) in wheels.items():
            parts |= {f"wheel_{name}_tyre": (tyre, "tyre"), f"wheel_{name}_rim": (rim, "rim")}
    return parts


def _shut_lines(shape: CarShape) -> list[Array]:
    """Return the door gaps on the left side as lines in x-z, shape (n, 2) each [m]."""
    arch = shape.wheel_radius + 0.055
    rear, front = shape.cabin_base
    (a0, _), (b0, b1) = shape.glazing[0], shape.glazing[1]
    belt = float(PchipInterpolator(*np.array(shape.deck).T)(0.5 * (rear + front))) - 0.02
    length = front - 0.37 - rear
    b_pillar = front - 0.37 - length * 0.5 * (shape.glazing[0][1] + b0)
    c_pillar = max(front - 0.37 - length * b1, shape.rear_axle + 0.25)
    a_pillar = min(front - 0.40 - length * a0, shape.front_axle - arch - 0.08)
    sill = 0.27
    lines = [np.array([(x, sill), (x, 0.5), (x - 0.01, belt)]) for x in (a_pillar, b_pillar)]
    top_rear = np.array(
        [
            (c_pillar + 0.16, sill),
            (c_pillar + 0.15, 0.45),
            (c_pillar, shape.wheel_radius + arch + 0.02),
            (c_pillar - 0.02, belt),
        ]
    )
    return [*lines, top_rear, np.array([(a_pillar, sill), (b_pillar, sill), (c_pillar + 0.16, sill)])]


def _handles(shape: CarShape) -> list[Array]:
    rear, front = shape.cabin_base
    length = front - 0.37 - rear
    z = shape.extra.get("handle_z", 0.80)
    b = front - 0.37 - length * 0.5 * (shape.glazing[0][1] + shape.glazing[1][0])
    c = max(front - 0.37 - length * shape.glazing[1][1], shape.rear_axle + 0.25)
    return [np.array([(x, z), (x + 0.18, z)]) for x in (b + 0.06, c + 0.10)]
