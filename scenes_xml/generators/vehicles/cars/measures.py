"""Measures of a car, and where its wheels are.

Local frame: origin on the ground below the middle of the car, x forward, y left, z up.
"""

from __future__ import annotations

from dataclasses import dataclass, field


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
    rows : int
        Rows of seats.
    bed : tuple of (rear x, front x, floor z), optional
        The open load bed of a pickup, behind the cabin.
    stations : tuple of float
        x of further cross-sections.
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
    rows: int = 2
    bed: tuple[float, float, float] | None = None
    stations: tuple[float, ...] = ()
    cladding: bool = False
    lamp_height: float = 0.66
    tail_lamp: tuple[float, float] = (0.76, 0.93)
    extra: dict[str, float] = field(default_factory=dict)

    @property
    def half_length(self) -> float:
        """Half length of the body shell [m]: number plates stand 5 mm out."""
        return self.length / 2 - 0.005


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
