"""What is seen through the wind screen of a van, a lorry or a bus: dashboard, wheel, seats and the driver."""

from __future__ import annotations

from collections.abc import Sequence

from ..geometry.mesh import Mesh, box, merge
from .cars.interior import Seat, chair, head_rest, merged, person, steering_wheel
from .vehicle_parts import prism

Parts = dict[str, tuple[Mesh, str]]
SEAT = (0.25, 0.235)
"""Half widths of the cushion and of the back of a seat [m]."""


def dashboard(driver: Seat, half: float, top: float) -> Mesh:
    """Return the dashboard before a driver, `half` as wide and up to a height [m], and the steering wheel."""
    x = driver.x + 0.62
    outline = [
        (x - 0.02, top - 0.14), (x + 0.05, top), (x + 0.22, top - 0.005), (x + 0.34, top - 0.06),
        (x + 0.34, top - 0.45), (x + 0.05, top - 0.45),
    ]  # fmt: skip # a table
    hood = box((0.12, 0.34, 0.05), (x + 0.08, driver.y, top + 0.02))
    return merge([prism(outline, -half, half), hood, steering_wheel(driver)])


def driving_place(
    driver: Seat, half: float, top: float, more: Sequence[Mesh] = (), beside: Sequence[Seat] | None = None
) -> Parts:
    """Return dashboard, seats and driver by shape.

    Parameters
    ----------
    driver : Seat
        His hips [m].
    half, top : float
        Half width and upper edge of the dashboard [m].
    more : sequence of Mesh
        Further parts of the inside.
    beside : sequence of Seat, optional
        Empty seats; None: one on the other side.
    """
    empty = [Seat(driver.x, -driver.y, driver.z)] if beside is None else beside
    seats = [part for seat in (driver, *empty) for part in (*chair(seat, SEAT), head_rest(seat))]
    people = merged([person(driver, drives=True)])
    return {
        "interior": (merge([dashboard(driver, half, top), *more]), "interior"),
        "seats": (merge(seats), "seat"),
        **{f"people_{kind}": (mesh, kind) for kind, mesh in people.items()},
    }
