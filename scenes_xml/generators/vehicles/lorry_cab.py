"""The cab of lorries and tractors: panels with open windows, panes, seats and a driver, mirrors, roof deflector.

Frame: that of the three-axle lorry, origin on the ground below its middle; `build` moves it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ..geometry import decal
from ..geometry.decal import strips
from ..geometry.holes import cut_out, shrunk
from ..geometry.mesh import Mesh, box, merge, outward, revolve
from .body_loft import BodyShape, loft, side_panel
from .cars.interior import Seat
from .driving_place import Parts, driving_place
from .vehicle_parts import bar, deflector, prism

FRONT_AXLE, NOSE = 3.42, 4.80
"""x of the axle and of the foremost point [m]."""
SHAPE = BodyShape(
    front=NOSE - 0.03, rear=2.62, width=2.48, floor=0.62,
    top=((2.6, 2.98), (3.2, 3.0), (4.0, 2.98), (4.8, 2.92)),
    arches=((FRONT_AXLE, 0.525, 0.62),), tunnel=0.80, edge=0.12,
    lean=((0.6, 0.99), (1.2, 1.0), (1.6, 1.0), (3.0, 0.945)),
    front_shift=((0.0, 0.03), (0.9, 0.0), (1.7, 0.03), (3.0, 0.26)), rear_shift=((0.0, 0.0), (3.2, 0.0)),
    front_bow=0.22, rear_bow=0.0, bow_power=4.0, bow_reach=0.7, end_radius=0.06,
    more_stations=(4.6, 4.45, 4.3, 4.15),
)  # fmt: skip # a table
LIGHT_STATIONS = (4.2,)
SCREEN = ((-1.12, 1.66), (1.12, 1.66), (1.07, 2.66), (-1.07, 2.66))
DOOR_WINDOW = ((3.30, 1.66), (4.46, 1.62), (4.28, 2.58), (3.30, 2.58))
BORDER = 0.02
"""How far panes reach over the edges of their openings [m]."""
DRIVER = Seat(3.52, 0.62, 1.72)
panel = partial(decal.panel, reach=7.0)
FRONT = np.array([-1.0, 0.0, 0.0])


def both(part: Mesh) -> Mesh:
    """Return a part and its mirror image."""
    return merge([part, part.mirrored_y()])


def rectangle(a: tuple[float, float], z: tuple[float, float]) -> tuple[tuple[float, float], ...]:
    """Return the corners of a rectangle, as panels take them."""
    return ((a[0], z[0]), (a[1], z[0]), (a[1], z[1]), (a[0], z[1]))


def _opened(mesh: Mesh) -> Mesh:
    """Return a part of the cab without what the panes stand before."""
    opened = cut_out(mesh, shrunk(SCREEN, BORDER), "x", 1.0, 4.1)
    for side in (1.0, -1.0):
        opened = cut_out(opened, shrunk(DOOR_WINDOW, BORDER), "y", side, 0.9)
    return opened


def _deflector(top: float) -> Mesh:
    """Return the roof deflector: a wedge from the cab's roof to a height [m]."""
    rise = (top - 2.96) / 0.70
    outline = [(2.72, 2.96), (4.22, 2.96)]
    outline += [(x, 2.96 + rise * z) for x, z in ((4.16, 0.12), (3.75, 0.40), (3.25, 0.62), (2.72, 0.70))]
    return deflector(outline, 0.98)


def _glass(body: Mesh, fine: bool) -> Mesh:
    many = (8, 13) if fine else (3, 5)
    screen = panel(body, SCREEN, FRONT, 1.0, 0.010 if fine else 0.025, cells=many)
    return merge([screen, side_panel(body, DOOR_WINDOW, 0.008 if fine else 0.015, (5, 5) if fine else (3, 2))])


def _trim(body: Mesh) -> Mesh:
    """Return grille, bumper, sun visor, steps, door gaps, wipers and handles of the cab."""
    rows = np.arange(0.98, 1.50, 0.13)
    visor = np.array([(4.72, 2.80), (4.86, 2.74), (4.86, 2.77), (4.72, 2.84)])
    steps = [box((0.34, 0.10, 0.12), (4.23, 1.17, 0.50)), box((0.34, 0.06, 0.04), (4.23, 1.205, 0.82))]
    frame = panel(body, ((-1.16, 1.60), (1.16, 1.60), (1.11, 2.72), (-1.11, 2.72)), FRONT, 1.0, 0.004, cells=(9, 15))
    return merge(
        [
            *(panel(body, rectangle((-0.80, 0.80), (z, z + 0.09)), FRONT, 1.0, 0.012, cells=(2, 9)) for z in rows),
            panel(body, rectangle((-1.20, 1.20), (0.66, 0.72)), FRONT, 1.0, 0.014, cells=(2, 15)),
            _opened(frame),
            *(panel(body, rectangle((0.74, 1.17), (0.76, 1.02)), FRONT, s, 0.006, cells=(3, 6)) for s in (1.0, -1.0)),
            prism([(float(x), float(z)) for x, z in visor - [0.14, 0.0]], -1.0, 1.0),
            *(both(step) for step in steps),
            strips(
                body,
                [np.array([(3.22, 1.20), (3.22, 2.66), (4.30, 2.66), (4.54, 1.60), (4.56, 1.00), (4.10, 1.00)])],
                0.014,
                0.003,
            ),
            strips(body, [np.array([(3.30, 1.46), (3.50, 1.46)])], 0.045, 0.03),
            *(bar((4.76, y0, 1.62), (4.71, y1, 2.05), 0.012, 5) for y0, y1 in ((0.1, 0.62), (-0.7, -0.18), (0.9, 1.0))),
            box((0.10, 2.2, 1.9), (2.58, 0.0, 2.05)),
        ]
    )


def _mirrors() -> tuple[Mesh, Mesh]:
    """Return the mirrors with their arms, and the glass."""
    profile = np.array([(0.0, -0.42), (0.10, -0.42), (0.13, -0.34), (0.13, 0.34), (0.10, 0.42), (0.0, 0.42)])
    housing = outward(revolve(profile, 10, "z")).moved((4.46, 1.42, 2.12))
    left = merge([housing, *(bar((4.42, 1.16, z), (4.46, 1.40, z), 0.025) for z in (1.86, 2.44))])
    glass = [box((0.01, 0.19, size)).moved((4.334, 1.42, z), yaw=0.17) for size, z in ((0.42, 2.22), (0.22, 1.85))]
    return both(left), both(merge(glass))


def _inside() -> Parts:
    """Return dashboard, bunk, two seats and the driver."""
    bunk = box((0.55, 2.1, 0.22), (2.98, 0.0, 1.50))
    return driving_place(DRIVER, 1.05, 1.70, [bunk])


def head_lamps(body: Mesh, fine: bool) -> Mesh:
    """Return both head lamps, on the cab's front."""
    cells, rise = ((3, 6), 0.012) if fine else ((2, 3), 0.025)
    outline = rectangle((0.78, 1.14), (0.79, 0.99))
    return merge([panel(body, outline, FRONT, s, rise, cells=cells) for s in (1.0, -1.0)])


def build(fine: bool, deflector: float, shift: float = 0.0) -> tuple[Parts, Mesh]:
    """Return the parts of the cab, and its floor.

    Parameters
    ----------
    fine : bool
    deflector : float
        Height of the roof deflector [m].
    shift : float
        How far ahead it stands of that of the three-axle lorry [m].
    """
    painted, floor = loft(SHAPE if fine else replace(SHAPE, more_stations=LIGHT_STATIONS), fine)
    body = merge([painted, floor])
    parts: Parts = {
        "cab": (merge([_opened(painted) if fine else painted, _deflector(deflector)]), "paint"),
        "glass": (_glass(body, fine), "pane" if fine else "glass"),
        "headlamps": (head_lamps(body, fine), "headlamp"),
    }
    if fine:
        mirrors, mirror_glass = _mirrors()
        parts |= {"trim": (_trim(body), "trim"), "mirrors": (mirrors, "trim"), **_inside()}
        parts["mirror_glass"] = (mirror_glass, "mirror_glass")
    ahead = (shift, 0.0, 0.0)
    return {name: (mesh.moved(ahead), role) for name, (mesh, role) in parts.items()}, floor.moved(ahead)
