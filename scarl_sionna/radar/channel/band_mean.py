"""The mean power over the band of what paths sum up to, in groups."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]

NUM_FREQUENCIES = 16
"""At which the field of an object is summed over the band: its power is their mean, whatever range cells it fills."""


def mean_over_band(
    field: npt.NDArray[np.complex128],
    length: Array,
    place: npt.NDArray[np.int64],
    radar: RadarSpec,
    num_frequencies: int = NUM_FREQUENCIES,
) -> Array:
    """Return the mean over the band of the power |sum field|^2 of groups of paths, shape (num_groups,).

    Parameters
    ----------
    field : ndarray of complex128, shape (n,)
        Of each path, without the carrier's phase over its length.
    length : ndarray of float64, shape (n,)
        [m].
    place : ndarray of int64, shape (n,)
        Group of each; the last group has at least one path.
    radar : RadarSpec
    num_frequencies : int
        Over the sampled band, weighted by a Hann window.
    """
    share = (np.arange(num_frequencies) + 0.5) / num_frequencies
    weight = np.sin(np.pi * share) ** 2
    weight = weight**2 / np.sum(weight**2)
    wave = 2.0 * np.pi / SPEED_OF_LIGHT * length
    start = radar.center_frequency + (share[0] - 0.5) * radar.sampled_bandwidth
    field = field * np.exp(-1j * wave * start)
    step = np.exp(-1j * wave * (radar.sampled_bandwidth / num_frequencies))
    count = int(place.max(initial=-1)) + 1
    power = np.zeros(count)
    for one in weight:
        power += one * (np.bincount(place, field.real, count) ** 2 + np.bincount(place, field.imag, count) ** 2)
        field = field * step
    return power
