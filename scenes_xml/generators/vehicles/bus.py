"""Buses: a city bus of 12 m with a low floor, three double doors and large panes, and a coach with a high floor."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..geometry import decal
from ..geometry.decal import strips
from ..geometry.mesh import Mesh, box, merge, outward, revolve
from .body_loft import BodyShape, loft, side_panel
from .bus_inside import Opening, Saloon, inside, opened
from .cars.interior import Seat
from .number_plates import NumberPlates
from .vehicle_parts import bar, prism, tray
from .wheels import WheelShape, wheel_parts

Span = tuple[float, float]
SLOPE = 0.3
"""Of the sides of what hangs underneath: upright ones would make corners."""


@dataclass(frozen=True)
class BusShape:
    """Measures of a bus [m].

    Attributes
    ----------
    length, width, height : float
    front_axle, rear_axle : float
        x of the axles.
    wheel : WheelShape
        Of the front axle; the rear one has twin tyres.
    body, light_body : BodyShape
        At both levels; the light one keeps the upright end walls of the wheel houses.
    doors : tuple of (rear x, front x)
        On the right side.
    panes : tuple of (rear x, front x)
        Of the sides.
    windows, door_windows : (z, z)
        From and to which height panes and the panes of doors reach.
    screen, back : (half width, z, z)
        Wind screen and rear window.
    display : (z, z)
        Of the destination sign at the front.
    beside_door : ((x, x), (z, z)) or None
        Sign beside the first door.
    roof : tuple of (rear x, front x)
        Covers of what stands on the roof.
    lines : tuple of float
        x of the gaps between the flaps below the windows.
    stripe : ((x, x), ...), (z, z)
        Coloured bands of the sides.
    tail : (z, z)
        Of the tail lamps.
    back_rows : int
        Points along the height of the rear window: 2 where it is flat.
    saloon : Saloon
        The inside.
    lamp_rise : float
        How far lamps stand out of the body.
    """

    length: float
    width: float
    height: float
    front_axle: float
    rear_axle: float
    wheel: WheelShape
    body: BodyShape
    light_body: BodyShape
    doors: tuple[Span, ...]
    panes: tuple[Span, ...]
    windows: Span
    door_windows: Span
    screen: tuple[float, float, float]
    back: tuple[float, float, float]
    display: Span
    beside_door: tuple[Span, Span] | None
    roof: tuple[Span, ...]
    lines: tuple[float, ...]
    stripe: tuple[tuple[Span, ...], Span]
    tail: Span
    saloon: Saloon
    back_rows: int = 2
    lamp_rise: float = 0.012

    @property
    def openings(self) -> list[Opening]:
        """What the panes stand before."""
        (half, low, high), (back, back_low, back_high) = self.screen, self.back
        found = [
            Opening(rectangle((-half, half), (low, high)), "x", 1.0),
            Opening(rectangle((-back, back), (back_low, back_high)), "x", -1.0),
        ]
        for pane in self.panes:
            found.append(Opening(rectangle(pane, self.windows), "y", 1.0))
            if _door_of(self, pane) is None:
                found.append(Opening(rectangle(pane, self.windows), "y", -1.0))
        found += [Opening(rectangle(span, self.door_windows), "y", -1.0) for span in _door_panes(self)]
        return found

    @property
    def outer(self) -> float:
        """abs(y) of the outer walls of the tyres [m]."""
        return self.width / 2 - 0.04

    @property
    def wheels(self) -> dict[str, tuple[float, bool]]:
        """Name of each wheel -> x of its axle [m], and whether it is on the left."""
        axles = {"front": self.front_axle, "rear": self.rear_axle}
        return {f"{name}_{side}": (x, side == "left") for name, x in axles.items() for side in ("left", "right")}

    @property
    def rear_wheel(self) -> WheelShape:
        """Wheel of the rear axle."""
        return replace(self.wheel, twin=0.32)


def _light(body: BodyShape, *stations: float) -> BodyShape:
    walls = (x + sign * (radius + 0.004) for x, _, radius in body.arches for sign in (-1.0, 1.0))
    return replace(body, more_stations=(*stations, *walls))


_WHEEL = WheelShape(radius=0.478, rim_radius=0.29, tyre_width=0.275, bolts=8, segments=16)
_CITY_BODY = BodyShape(
    front=5.97, rear=-5.97, width=2.526, floor=0.30,
    top=((-6.0, 2.90), (-5.6, 2.90), (5.3, 2.90), (6.0, 2.88)),
    arches=((3.28, 0.478, 0.56), (-2.62, 0.478, 0.56)), tunnel=0.55, edge=0.12,
    lean=((0.0, 1.0), (1.2, 1.0), (2.9, 0.975)),
    front_shift=((0.0, 0.05), (0.45, 0.0), (1.0, 0.01), (2.9, 0.20)), rear_shift=((0.0, 0.10), (0.5, 0.0), (1.6, 0.0),
    (2.9, 0.06)),
    front_bow=0.22, rear_bow=0.07, bow_power=4.0, bow_reach=0.75, end_radius=0.07,
    more_stations=(5.8, 5.65, 5.5, 5.35, -5.8, -5.6, -5.4),
)  # fmt: skip # a table
_COACH_BODY = BodyShape(
    front=6.07, rear=-6.07, width=2.526, floor=0.32,
    top=((-6.1, 3.50), (-5.6, 3.56), (4.6, 3.56), (5.6, 3.52), (6.1, 3.44)),
    arches=((3.35, 0.505, 0.59), (-2.85, 0.505, 0.59)), tunnel=0.55, edge=0.17,
    lean=((0.0, 0.985), (0.8, 1.0), (1.7, 1.0), (3.5, 0.955)),
    front_shift=((0.0, 0.08), (0.5, 0.0), (1.1, 0.02), (2.2, 0.16), (3.5, 0.52)), rear_shift=((0.0, 0.10), (0.5, 0.0),
    (1.9, 0.02), (3.5, 0.20)),
    front_bow=0.30, rear_bow=0.10, bow_power=3.2, bow_reach=0.95, end_radius=0.09,
    more_stations=(5.9, 5.75, 5.6, 5.4, 5.25, -5.9, -5.7, -5.4),
)  # fmt: skip # a table
CITY = BusShape(
    length=12.0, width=2.55, height=3.12, front_axle=3.28, rear_axle=-2.62, wheel=_WHEEL,
    body=_CITY_BODY, light_body=_light(_CITY_BODY, 5.3, -5.4),
    doors=((4.22, 5.46), (-0.35, 0.95), (-4.62, -3.36)),
    panes=((-5.45, -4.66), (-4.58, -3.40), (-3.32, -1.92), (-1.84, -0.40), (-0.32, 0.92), (1.0, 2.42), (2.50, 4.14),
    (4.22, 5.44)),
    windows=(1.22, 2.42), door_windows=(0.50, 2.40), screen=(1.14, 1.02, 2.44), back=(0.98, 1.62, 2.40),
    display=(2.54, 2.74), beside_door=((2.60, 3.60), (2.20, 2.36)), roof=((2.2, 4.6), (-4.9, -1.2)),
    lines=(-5.0, -3.35, -1.7, -0.4, 1.0, 2.3, 4.2), stripe=(((-5.3, -3.24), (-2.0, 2.66)), (0.62, 0.74)),
    tail=(0.80, 1.36),
    saloon=Saloon(
        0.42, Seat(4.72, 0.62, 1.02), (-4.9, 3.4), 0.83, ((4.22, 5.46), (-0.35, 0.95), (-4.62, -3.36)), 1.18, False,
        ((-3.18, -2.06), (2.72, 3.84)),
    ),
)  # fmt: skip # a table
COACH = BusShape(
    length=12.2, width=2.55, height=3.58, front_axle=3.35, rear_axle=-2.85,
    wheel=WheelShape(radius=0.505, rim_radius=0.295, tyre_width=0.295, bolts=8, segments=16),
    body=_COACH_BODY, light_body=_light(_COACH_BODY, 5.3, -5.4),
    doors=((4.16, 5.06), (-1.55, -0.75)),
    panes=((-5.50, -4.05), (-3.97, -2.52), (-2.44, -0.99), (-0.91, 0.54), (0.62, 2.07), (2.15, 3.60), (3.68, 5.02)),
    windows=(1.86, 3.02), door_windows=(0.78, 1.72), screen=(1.12, 1.14, 2.86), back=(0.94, 2.00, 2.94),
    display=(3.02, 3.16), beside_door=None, roof=((-2.6, -0.4),),
    lines=(-5.3, -4.4, -3.5, -2.2, -1.6, -0.7, 0.7, 1.9, 2.75, 4.05),
    stripe=(((-5.4, -3.55), (-2.2, 2.7)), (1.32, 1.62)),
    tail=(1.10, 1.62), back_rows=6,
    saloon=Saloon(1.28, Seat(4.78, 0.62, 1.22), (-5.0, 3.7), 0.9, ((-1.55, -0.75),), 1.17, True),
)  # fmt: skip # a table
panel = partial(decal.panel, reach=7.0)
FRONT, REAR = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


def _door_of(shape: BusShape, pane: Span) -> Span | None:
    """Return the door whose upper part is a pane, or None."""
    if shape.door_windows[1] < shape.windows[0]:
        return None
    return next((door for door in shape.doors if door[0] - 0.1 < 0.5 * (pane[0] + pane[1]) < door[1] + 0.1), None)


def rectangle(a: Span, z: Span) -> tuple[Span, ...]:
    """Return the corners of a rectangle, as panels take them."""
    return ((a[0], z[0]), (a[1], z[0]), (a[1], z[1]), (a[0], z[1]))


def glass(shape: BusShape, body: Mesh, fine: bool) -> Mesh:
    """Return wind screen, rear window and panes of the sides and doors."""
    many = (9, 15) if fine else (3, 9)
    rise = 0.008 if fine else 0.035 if shape.back_rows == 2 else 0.07
    (half, low, high), (back, back_low, back_high), (sill, top) = shape.screen, shape.back, shape.windows
    parts = [
        panel(body, rectangle((-half, half), (low, high)), FRONT, 1.0, rise, cells=many),
        panel(body, rectangle((-back, back), (back_low, back_high)), REAR, 1.0, rise, cells=(shape.back_rows, 7)),
    ]
    if not fine:
        whole = rectangle((shape.panes[0][0], shape.panes[-1][1]), (sill, top + 0.04))
        return merge([*parts, side_panel(body, whole, 0.011, (4, 2))])
    for pane in shape.panes:
        if _door_of(shape, pane) is not None:
            parts.append(side_panel(body, rectangle(pane, (sill, top)), 0.010, (6, 2), "left"))
        else:
            parts.append(side_panel(body, rectangle(pane, (sill, top)), 0.010, (6, 2)))
    parts += [
        side_panel(body, rectangle(span, shape.door_windows), 0.012, (7, 2), "right") for span in _door_panes(shape)
    ]
    return merge(parts)


def _door_panes(shape: BusShape) -> list[Span]:
    """Return x of the panes of the doors, from and to: two of a double one, whose leaves meet in the middle."""
    if shape.door_windows[1] < shape.windows[0]:
        return [(low + 0.07, high - 0.07) for low, high in shape.doors]
    found: list[Span] = []
    for low, high in shape.panes:
        if _door_of(shape, (low, high)) is not None:
            middle = 0.5 * (low + high)
            found += [(low + 0.05, middle - 0.04), (middle + 0.04, high - 0.05)]
    return found


def lamps(shape: BusShape, body: Mesh, fine: bool) -> dict[str, tuple[Mesh, str]]:
    """Return head and tail lamps."""
    cells = (3, 5) if fine else (2, 3)
    rise = shape.lamp_rise if fine else 0.02
    heads = [panel(body, rectangle((0.74, 1.12), (0.56, 0.78)), FRONT, s, rise, cells=cells) for s in (1.0, -1.0)]
    tails = [panel(body, rectangle((1.0, 1.14), shape.tail), REAR, s, rise, cells=cells) for s in (1.0, -1.0)]
    return {"headlamps": (merge(heads), "headlamp"), "taillamps": (merge(tails), "taillamp")}


def trim(shape: BusShape, body: Mesh) -> Mesh:
    """Return the black band of the windows, door frames, bumper edge, grille of the engine, wipers and gaps."""
    (half, low, _), (back, back_low, back_high), (sill, top) = shape.screen, shape.back, shape.windows
    band = rectangle((shape.panes[0][0] - 0.07, shape.panes[-1][1] + 0.06), (sill - 0.06, top + 0.08))
    front = rectangle((-half - 0.05, half + 0.05), (low - 0.08, shape.display[1] + 0.06))
    rear = rectangle((-back - 0.06, back + 0.06), (back_low - 0.06, back_high + 0.06))
    bands = [
        side_panel(body, band, 0.005, (6, 12)),
        panel(body, front, FRONT, 1.0, 0.004, cells=(11, 17)),
        panel(body, rear, REAR, 1.0, 0.0075, cells=(shape.back_rows + 2, 13)),
    ]
    parts = [
        opened(merge(bands), shape.openings, shape.width / 2, shape.length / 2),
        panel(body, rectangle((-1.18, 1.18), (0.36, 0.46)), FRONT, 1.0, 0.006, cells=(2, 13)),
        *(
            panel(body, rectangle((-0.70, 0.70), (z, z + 0.045)), REAR, 1.0, 0.006, cells=(2, 5))
            for z in np.arange(0.92, 1.36, 0.075)
        ),
        *(panel(body, rectangle((0.70, 1.15), (0.52, 0.82)), FRONT, s, 0.006, cells=(3, 5)) for s in (1.0, -1.0)),
        *(
            panel(
                body,
                rectangle((0.97, 1.17), (shape.tail[0] - 0.04, shape.tail[1] + 0.24)),
                REAR,
                s,
                0.006,
                cells=(3, 4),
            )
            for s in (1.0, -1.0)
        ),
    ]
    doors = [
        side_panel(body, rectangle((a, b), (0.34, max(1.18, sill - 0.08))), 0.009, (4, 2), "right")
        for a, b in shape.doors
    ]
    parts.append(opened(merge(doors), shape.openings, shape.width / 2, shape.length / 2))
    lines = [np.array([(x, 0.36), (x, sill - 0.08)]) for x in shape.lines]
    parts.append(strips(body, lines, 0.008, 0.002))
    wipers = ((0.12, 0.75), (-0.95, -0.32))
    reach = shape.length / 2
    parts += [bar((reach - 0.015, y0, low - 0.02), (reach - 0.10, y1, low + 0.73), 0.014, 5) for y0, y1 in wipers]
    return merge(parts)


def sign(shape: BusShape, body: Mesh) -> Mesh:
    """Return the lit destination signs at the front and above the first door."""
    digits = [
        panel(body, rectangle(a, shape.display), FRONT, 1.0, 0.009, cells=(3, 5))
        for a in ((-0.95, -0.62), (-0.50, 0.95))
    ]
    if shape.beside_door is not None:
        digits.append(side_panel(body, rectangle(*shape.beside_door), 0.014, (2, 2), "right"))
    return merge(digits)


def _mirrors(shape: BusShape) -> tuple[Mesh, Mesh]:
    """Return both mirrors on arms beside the wind screen, not ahead of the front, and their glass."""
    x, z = shape.length / 2 - 0.11, shape.screen[2] - 0.42
    profile = np.array([(0.0, -0.22), (0.07, -0.22), (0.10, -0.17), (0.10, 0.17), (0.07, 0.22), (0.0, 0.22)])
    housing = outward(revolve(profile, 10, "z")).moved((x, 1.36, z))
    arm = [
        bar((x - 0.25, 1.10, z + 0.60), (x, 1.30, z + 0.56), 0.028),
        bar((x, 1.30, z + 0.56), (x, 1.36, z + 0.20), 0.028),
    ]
    left = merge([housing, *arm])
    glass = box((0.01, 0.17, 0.36), (x - 0.102, 1.36, z))
    return merge([left, left.mirrored_y()]), merge([glass, glass.mirrored_y()])


def roof_units(shape: BusShape, fine: bool) -> Mesh:
    """Return the covers of air conditioning and batteries; they reach the outer height."""
    parts, top = [], shape.height
    for x0, x1 in shape.roof:
        outline = (
            (x0, top - 0.26), (x1, top - 0.26), (x1, top - 0.14), (x1 - 0.16, top), (x0 + 0.16, top), (x0, top - 0.14),
        )  # fmt: skip # a table
        parts.append(prism(outline, -0.86, 0.86))
    if fine:
        parts.append(box((0.8, 0.8, 0.06), (0.4, 0.0, top - 0.20)))
    return merge(parts)


def underbody(shape: BusShape, fine: bool) -> Mesh:
    """Return floor plate, axles, gearbox and frame of the bus; at the light level without differential and drive shaft.

    The axles stay at the light level: with the inner walls of the wheel houses they are corners that carry most of a
    bus's echo.
    """
    floor = tray((9.0, 1.06, 0.03), (0.3, 0.0, 0.278), SLOPE)
    parts = [
        floor,
        tray((1.4, 1.6, 0.10), (-4.6, 0.0, 0.255), SLOPE),
        tray((1.0, 0.9, 0.12), (-3.9, 0.0, 0.245), SLOPE),
    ]
    for x in (shape.front_axle, shape.rear_axle):
        parts.append(bar((x, -0.86, 0.40), (x, 0.86, 0.40), 0.09, 10))
    if not fine:
        return merge(parts)
    ball = np.array([(0.0, -0.20), (0.14, -0.16), (0.20, 0.0), (0.14, 0.16), (0.0, 0.20)])
    parts.append(outward(revolve(ball, 12, "y")).moved((shape.rear_axle, 0.15, 0.42)))
    parts.append(bar((shape.rear_axle - 0.15, 0.15, 0.40), (-3.5, 0.0, 0.36), 0.05, 8))
    return merge(parts)


def wheels(shape: BusShape, light: bool = False) -> dict[str, tuple[Mesh, str]]:
    """Return the shapes of the wheels; twin tyres at the rear."""
    return wheel_parts(shape.wheels, shape.wheel, shape.rear_wheel, shape.outer, light, light_role="tyre")


def build(shape: BusShape, fine: bool = True) -> dict[str, tuple[Mesh, str]]:
    """Return the parts of a bus: name -> (mesh, role)."""
    painted, floor = loft(shape.body if fine else shape.light_body, fine)
    body = merge([painted, floor])
    parts: dict[str, tuple[Mesh, str]] = {
        "body": (opened(painted, shape.openings, shape.width / 2, shape.length / 2) if fine else painted, "paint"),
        "glass": (glass(shape, body, fine), "pane" if fine else "glass"),
        "roof_units": (roof_units(shape, fine), "roof_cover"),
        **lamps(shape, body, fine),
        **NumberPlates(shape.length / 2, 0.55, 0.66, 0.06, 7).parts(fine),
        "underbody": (merge([floor, underbody(shape, fine)]), "underbody"),
    }
    if not fine:
        return parts | wheels(shape, True)
    mirrors, mirror_glass = _mirrors(shape)
    markers = [side_panel(body, rectangle((x0, x0 + 0.10), (0.88, 0.92)), 0.010) for x0 in (-4.3, -1.6, 1.2, 4.0)]
    above = (shape.tail[1] + 0.04, shape.tail[1] + 0.20)
    ends = [panel(body, rectangle((1.0, 1.14), above), REAR, s, 0.010, cells=(2, 3)) for s in (1.0, -1.0)]
    stripe = [side_panel(body, rectangle(a, shape.stripe[1]), 0.006, (2, 3)) for a in shape.stripe[0]]
    return parts | {
        "trim": (trim(shape, body), "trim"),
        "indicators": (merge([*markers, *ends]), "indicator"),
        "signs": (sign(shape, body), "led_sign"),
        "stripe": (merge(stripe), "stripe_paint"),
        "mirrors": (mirrors, "trim"),
        "mirror_glass": (mirror_glass, "mirror_glass"),
        **inside(shape.saloon),
        **wheels(shape),
    }
