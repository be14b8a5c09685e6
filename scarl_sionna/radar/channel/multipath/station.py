"""The ends of a radar link in a scene: a radar, and the points that its waves reach."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Station:
    """One end of a radar link: position [m], velocity [m/s], and axes as columns of `rotation`, all in the world.

    `arms`, shape (num_antennas, 3), are the antennas seen from `position` [m].
    """

    position: Array
    velocity: Array
    rotation: Array
    arms: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class EndPoints:
    """Points that legs from a station end at.

    Attributes
    ----------
    position, velocity : ndarray of float64, shape (num_targets, 3)
        [m], [m/s], world.
    rotation : ndarray of float64, shape (3, 3)
        Axes of the frame in which the polarisation at the points is given, as columns.
    is_station : bool
        Whether the points carry a radar's antennas, not point targets.
    """

    position: Array
    velocity: Array
    rotation: Array
    is_station: bool = False
