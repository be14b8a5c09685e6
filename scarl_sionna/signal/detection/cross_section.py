"""Radar cross section of detections by the radar equation, where the antennas hear enough to tell it."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt

from ..angle import directions
from ..antenna import beam_gain, boresights
from ..link import radar_gain

Array = npt.NDArray[np.float64]

DEAF_DB = 60.0
"""Two-way gain under its largest from which on no RCS is told: 30 dB of each antenna.

A cell's further directions are kept to 30 dB under its strongest, what errors of the fit may make: farther down the
antenna such an error would be a giant of 30 dB over the target that it is an error of, and more.
"""

_STEP_DEG = 5.0


def cross_section(radar: RadarSpec, sines: Array, distance: Array, received: Array, left: Array | float = 1.0) -> Array:
    """Return the RCS [m2] of targets by the radar equation; NaN where it is not known.

    It is not known at range 0, where the two-way gain, with what the filters leave, is more than `DEAF_DB` under its
    largest, and at an end of the axis of angles (sine of 1 or beyond), which is no measured direction: the
    beamformer's maximum is outside the real angles, or the two sides of a line of half a wavelength are one.

    Parameters
    ----------
    radar : RadarSpec
    sines : ndarray of float64, shape (num_points, 2)
        Of azimuth and elevation.
    distance : ndarray of float64, shape (num_points,)
        [m].
    received : ndarray of float64, shape (num_points,)
        Power of one channel [W].
    left : ndarray of float64, shape (num_points,), or float
        Part of the power that the receiver's filters leave at that distance.

    Returns
    -------
    ndarray of float64, shape (num_points,)

    References
    ----------
    .. [1] M. A. Richards, *Fundamentals of Radar Signal Processing*, 2nd ed., 2014, ch. 2.2.
    """
    gain = beam_gain(radar.array, directions(*np.arcsin(np.clip(sines, -1.0, 1.0)).T)) * left
    deaf = gain <= 10.0 ** (-DEAF_DB / 10.0) * _largest_gain(radar.array)
    unknown = deaf | (np.abs(sines) >= 1.0).any(axis=1) | (distance <= 0.0)
    of_square_metre = (
        dbm_to_watt(radar.front_end.tx_power_dbm)
        * np.where(unknown, 1.0, gain)
        * radar_gain(radar.wavelength, np.where(unknown, 1.0, distance))
    )
    return np.where(unknown, np.nan, received / of_square_metre)


@lru_cache(maxsize=16)
def _largest_gain(array: AntennaArray) -> float:
    """Return the largest two-way gain of a beam ahead, on a grid of directions and where the antennas point."""
    angle = np.radians(np.arange(-90.0, 90.5, _STEP_DEG))
    azimuth, elevation = (axis.ravel() for axis in np.meshgrid(angle, angle))
    return float(beam_gain(array, np.concatenate([directions(azimuth, elevation), boresights(array)])).max())
