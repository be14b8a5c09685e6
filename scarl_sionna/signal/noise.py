"""Thermal noise of the receiver, of a sample and of a cell; added to a beat signal [sqrt(W)].

Left out (`rng=None`) it changes nothing.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincinv

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import thermal_noise_power

from .receivers import noise_share
from .windows import noise_bandwidth


def sample_noise_power(radar: RadarSpec) -> float:
    """Return the thermal noise power of one complex sample, referred to the receiver's input [W].

    By definition, :func:`~scarl_sionna.core.units.thermal_noise_power` in the band of a sample.
    """
    return thermal_noise_power(
        radar.waveform.noise_bandwidth, radar.front_end.noise_figure_db, radar.front_end.source_temperature
    )


def cell_noise_power(
    radar: RadarSpec, window: str | None = "hann", doppler_window: str | None = None, num_channels: int = 1
) -> float:
    """Return the mean thermal noise power of a cell of a range-Doppler map, or of a range-Doppler-angle cube [W].

    Parameters
    ----------
    radar : RadarSpec
    window, doppler_window : str or None
        Of the range and of the Doppler transform; None is ``"rect"`` for the first, and the same as the first for the
        second.
    num_channels : int
        Channels whose mean a cell is: 1 in a map of one channel, ``radar.num_virtual`` in a beam of the whole array
        without taper.

    Returns
    -------
    float
        ``k T B F * ENBW_range * ENBW_doppler / (num_samples * num_chirps * num_channels)``: the processing gain less
        the windows' loss [W]. A receiver of symbols has its own noise over range, see
        :func:`scarl_sionna.signal.receivers.noise_share`.

    References
    ----------
    .. [1] F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
       IEEE 66(1), 1978.
    """
    radar = (
        radar.separated.one_sided
    )  # real samples have noise of both signs; in a random order of time division a channel has silent rows
    doppler_window = window if doppler_window is None else doppler_window
    slow = noise_bandwidth(doppler_window, radar.num_doppler_bins) / (radar.num_doppler_bins * num_channels)
    return sample_noise_power(radar) * noise_share(radar, window) * slow


def floor_of(power: npt.NDArray[np.floating], num_channels: int, least: float, part: float = 0.5) -> float:
    """Return the noise of a cell of one channel [W]: by the power below which a part of a map's cells is.

    Parameters
    ----------
    power : ndarray of float, any shape
        Mean power over the channels of the map's cells [W].
    num_channels : int
    least : float
        The noise is not below it: thermal noise [W].
    part : float
        From 0 to 1; 0.5 is the median. The smaller, the more of the map may hold targets.

    Returns
    -------
    float
        [W]. By definition: of noise alone the mean over channels has a gamma distribution.
    """
    seen = float(np.quantile(power, part)) * num_channels / float(gammaincinv(num_channels, part))
    return max(least, seen)


def angle_cell_noise_power(radar: RadarSpec) -> float:
    """Return the mean thermal noise power of a cell of the range-Doppler-angle cube, without windows [W].

    The lowest there is.

    By definition, :func:`cell_noise_power` without windows, over all channels.
    """
    return cell_noise_power(radar, "rect", num_channels=radar.num_virtual)


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

    References
    ----------
    .. [1] H. T. Friis, "Noise Figures of Radio Receivers", Proc. IRE 32(7), 1944.
    """
    if rng is None:
        return np.asarray(adc, dtype=np.complex64)
    scale = np.float32(np.sqrt(0.5 * sample_noise_power(radar)))
    noise = rng.standard_normal((*adc.shape, 2), dtype=np.float32)
    noise *= scale
    return np.asarray(adc, dtype=np.complex64) + noise.view(np.complex64)[..., 0]
