"""Openings of buses and trams behind their panes, and what is seen through them: floor, benches, driver, passengers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.holes import cut_out, shrunk
from ..geometry.mesh import Mesh, box, merge
from .cars.interior import Seat, chair, head_rest, merged, person
from .driving_place import SEAT, Parts, dashboard

Span = tuple[float, float]
BORDER = 0.025
"""How far panes reach over the edges of their openings [m]."""


class Opening(NamedTuple):
    """A pane's outline, the axis that looks through it, and the side on which it lies."""

    outline: tuple[Span, ...]
    axis: str
    side: float


class Saloon(NamedTuple):
    """Measures of the inside [m].

    `floor`: height of the passengers' floor, lower ones being that of the body itself; `driver`: his hips; `rows`: x of
    the first and the last bench, `pitch` apart; `free`: where there are none on the right, before the doors; `houses`:
    where there are none, over the wheels.
    """

    floor: float
    driver: Seat
    rows: Span
    pitch: float
    free: tuple[Span, ...]
    half: float
    plate: bool = False
    houses: tuple[Span, ...] = ()


def opened(mesh: Mesh, openings: list[Opening], half: float, reach: float) -> Mesh:
    """Return a mesh without what the panes stand before.

    Sides are cut beyond 0.7 of the half width, ends beyond 0.8 of the reach [m].
    """
    for opening in openings:
        beyond = 0.7 * half if opening.axis == "y" else 0.8 * reach
        mesh = cut_out(mesh, shrunk(opening.outline, BORDER), opening.axis, opening.side, beyond)
    return mesh


def _bench(x: float, y: float, floor: float) -> list[Mesh]:
    """Return a bench for two: cushion, foot and back, which leans."""
    back = box((0.07, 0.84, 0.62), (0.0, 0.0, 0.0))
    lean = back.vertices.copy()
    lean[:, 0] -= 0.18 * (lean[:, 2] + 0.31)
    back = Mesh(lean, back.faces).moved((x - 0.20, y, floor + 0.78))
    return [box((0.42, 0.84, 0.09), (x + 0.02, y, floor + 0.42)), box((0.16, 0.5, 0.38), (x, y, floor + 0.19)), back]


def inside(saloon: Saloon) -> Parts:
    """Return floor, dashboard, benches, driver and a passenger by shape."""
    trim = [dashboard(saloon.driver, saloon.half - 0.25, saloon.driver.z + 0.12)]
    wall = box((0.04, 0.9, 0.75), (saloon.driver.x - 0.62, saloon.half - 0.55, saloon.driver.z + 0.25))
    trim.append(wall)
    if saloon.plate:
        length = saloon.driver.x - 0.65 - saloon.rows[0] + 0.6
        trim.append(
            box((length, 2.0 * saloon.half - 0.1, 0.04), (saloon.rows[0] - 0.6 + length / 2, 0.0, saloon.floor))
        )
    seats = [*chair(saloon.driver, SEAT), head_rest(saloon.driver)]
    places: list[Seat] = []
    for x in np.arange(saloon.rows[0], saloon.rows[1] + 1e-6, saloon.pitch).tolist():
        for side in (1.0, -1.0):
            if any(low - 0.35 < x < high + 0.35 for low, high in saloon.houses + (saloon.free if side < 0.0 else ())):
                continue
            seats += _bench(x, side * (saloon.half - 0.52), saloon.floor)
            places.append(Seat(x - 0.02, side * (saloon.half - 0.32), saloon.floor + 0.56))
    passenger = person(places[2 * len(places) // 3 + 1], drives=False)
    people = merged([person(saloon.driver, drives=True), passenger])
    return {
        "interior": (merge(trim), "interior"),
        "seats": (merge(seats), "seat"),
        **{f"people_{kind}": (mesh, kind) for kind, mesh in people.items()},
    }
