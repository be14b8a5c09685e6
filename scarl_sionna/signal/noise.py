"""Thermal noise of the receiver: beat signal in, beat signal out [sqrt(W)]. Left out (`rng=None`) it changes nothing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import thermal_noise_power


def sample_noise_power(radar: RadarSpec) -> float:
    """Return the thermal noise power of one complex sample, referred to the receiver's input [W]."""
    return thermal_noise_power(radar.sample_rate, radar.noise_figure_db, radar.source_temperature)


def add_noise(
    adc: npt.NDArray[np.complexfloating], radar: RadarSpec, rng: np.random.Generator | None
) -> npt.NDArray[np.complex64]:
    """Return the signal with thermal noise added.

    Parameters
    ----------
    adc : ndarray of complex, any shape
        Beat signal [sqrt(W)].
    radar : RadarSpec
        Its sample rate, noise figure and source temperature set the power.
    rng : numpy.random.Generator or None
        Source of randomness; None returns the signal unchanged.

    Returns
    -------
    ndarray of complex64, same shape
        Beat signal [sqrt(W)].

    Notes
    -----
    White circular Gaussian noise, independent between samples, chirps and receivers; mean 0, variance
    ``thermal_noise_power(radar.sample_rate, ...)`` in total, half of it in each of I and Q.
    """
    if rng is None:
        return np.asarray(adc, dtype=np.complex64)
    scale = np.float32(np.sqrt(0.5 * sample_noise_power(radar)))
    noise = rng.standard_normal((*adc.shape, 2), dtype=np.float32)
    noise *= scale
    return np.asarray(adc, dtype=np.complex64) + noise.view(np.complex64)[..., 0]
