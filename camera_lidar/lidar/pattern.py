"""Directions and times of a scan's shots, shared by all lidars of one specification.

Azimuth is positive to the left, elevation positive upwards, both in the sensor frame (x forward, y left, z up).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.spec import LidarSpec

Array = npt.NDArray[np.float64]


@lru_cache(maxsize=4)
def shot_directions(spec: LidarSpec) -> Array:
    """Return the unit direction of every shot in the sensor frame at its own time, in the order of shot numbers.

    Parameters
    ----------
    spec : LidarSpec

    Returns
    -------
    ndarray of float64, shape (num_shots, 3)
        Read-only: lidars of one kind share it.
    """
    azimuth, elevation = spec.scan.angles()
    horizontal = np.cos(elevation)
    directions = np.stack([horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), np.sin(elevation)], axis=-1)
    directions.setflags(write=False)
    return directions


@lru_cache(maxsize=4)
def shot_times(spec: LidarSpec) -> Array:
    """Return the time of every shot after the frame's timestamp [s], float64, shape (num_shots,); read-only."""
    times = spec.scan.times()
    times.setflags(write=False)
    return times
