"""One end of a radar link in a scene."""

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
