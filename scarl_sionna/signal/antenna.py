"""Antennas of a radar: gains towards directions, and the virtual elements."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.pattern import AntennaPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec

Array = npt.NDArray[np.float64]


def azimuth_elevation(vectors: npt.ArrayLike) -> tuple[Array, Array]:
    """Return azimuth (left positive) and elevation [rad] of vectors (..., 3) in the radar frame.

    Exact geometry.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def field_gain(pattern: AntennaPattern, vectors: npt.ArrayLike) -> Array:
    """Return the square root of the power gain towards vectors (..., 3) in the radar frame.

    By definition of the pattern, dimensionless.
    """
    azimuth, elevation = azimuth_elevation(vectors)
    return 10.0 ** (pattern.gain_db(azimuth, elevation) / 20.0)


def field_gain_slope(pattern: AntennaPattern, vectors: npt.ArrayLike) -> Array:
    """Return the derivative of the logarithm of :func:`field_gain` to the vectors (..., 3) [1/m].

    By definition of the pattern.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    over_azimuth, over_elevation = pattern.slopes_db(*azimuth_elevation(vectors))
    flat = np.maximum(np.hypot(x, y), 1e-12)  # straight up the azimuth has no derivative
    squared = np.maximum(x**2 + y**2 + z**2, 1e-24)
    azimuth = np.stack([-y, x, np.zeros_like(x)], axis=-1) / flat[..., None] ** 2
    elevation = np.stack([-x * z / flat, -y * z / flat, flat], axis=-1) / squared[..., None]
    slope = over_azimuth[..., None] * azimuth + over_elevation[..., None] * elevation
    return np.asarray(np.log(10.0) / 20.0 * slope)


def virtual_positions(radar: RadarSpec) -> Array:
    """Return tx + rx position of every channel ``i * num_rx + j``, shape (num_virtual, 3) [m, radar frame].

    In the far field the length of channel c towards the unit vector n is ``2 R - virtual_positions[c] @ n``.

    References
    ----------
    .. [1] J. Li, P. Stoica, "MIMO radar with colocated antennas", IEEE Signal Process. Mag. 24(5), 2007.
    """
    return (radar.tx_array[:, None, :] + radar.rx_array[None, :, :]).reshape(-1, 3)
