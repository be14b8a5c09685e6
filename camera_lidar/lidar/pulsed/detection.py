"""Detection of pulses in the filtered waveform: noise, threshold, probability, and the precision of distances.

The waveform is in photoelectrons of the pulse's peak: a return of N photoelectrons from a plane across the beam has a
peak of N in it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincinv, ndtr

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from .link import (
    background_rate,
    excess_noise_factor,
    full_scale,
    noise_density,
    photoelectrons,
    pulsed,
    speckle_cells,
)

Array = npt.NDArray[np.float64]

EDGE = 0.25
"""Share of full scale at which the edges of a clipped pulse are timed."""
_SPECKLE_NODES = 128


@dataclass(frozen=True, eq=False)
class Peaks:
    """Filtered pulses without noise, and what the noise does to them.

    Attributes
    ----------
    height : ndarray of float64, shape (num_pulses,)
        Photoelectrons, before full scale.
    width : ndarray of float64, shape (num_pulses,)
        Standard deviation in time [s].
    noise : ndarray of float64, shape (num_pulses,)
        Standard deviation of the waveform at the peak, the pulse's own shot noise included.
    slope_noise : ndarray of float64, shape (num_pulses,)
        Of the waveform's derivative at the peak [1/s].
    floor : ndarray of float64, shape (num_pulses,)
        Standard deviation of the waveform beside the pulse.
    """

    height: Array
    width: Array
    noise: Array
    slope_noise: Array
    floor: Array


def noise_deviation(spec: LidarSpec, density: npt.ArrayLike) -> Array:
    r"""Return the standard deviation of the waveform where no pulse is [photoelectrons].

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    density : array_like of float, any shape
        See :func:`~camera_lidar.lidar.pulsed.link.noise_density`.

    Notes
    -----
    .. math:: \sigma_w^2 = \frac{\sqrt\pi \, (\sigma_p^2 + \sigma_f^2)}{P \, \sigma_f} S

    white noise through a Gaussian filter of the standard deviation sigma_f, averaged over P pulses; least where the
    filter is matched to the pulse (J. G. Proakis, *Digital Communications*).
    """
    receiver = pulsed(spec)
    total = receiver.pulse_deviation**2 + receiver.filter_deviation**2
    scale = math.sqrt(math.pi) * total / (receiver.filter_deviation * receiver.num_pulses)
    return np.sqrt(scale * np.asarray(density, dtype=np.float64))


def filtered(spec: LidarSpec, electrons: Array, spread: Array, density: Array) -> Peaks:
    r"""Return the filtered pulses of returns.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    electrons : ndarray of float64, shape (num_pulses,)
        Photoelectrons of each.
    spread : ndarray of float64, shape (num_pulses,)
        Standard deviation of each in time, before the filter [s].
    density : ndarray of float64, shape (num_pulses,) or ()
        Of the noise, see :func:`~camera_lidar.lidar.pulsed.link.noise_density`.

    Notes
    -----
    All are Gaussian: the pulse n(t), the filter h(t) and its square. The pulse's own shot noise at the peak is
    :math:`F \int n h^2 dt`, that of the slope :math:`F \int n h'^2 dt`.
    """
    receiver = pulsed(spec)
    own, before = receiver.filter_deviation, receiver.pulse_deviation
    width = np.hypot(spread, own)
    unit = math.hypot(before, own)
    height = electrons * unit / width
    total = 2.0 * math.pi * unit**2 / receiver.num_pulses
    white = total * density / (2.0 * math.sqrt(math.pi) * own)
    narrow = spread**2 + own**2 / 2.0  # pulse times the filter's square
    shot = excess_noise_factor(receiver) * electrons * total
    shot = shot / (2.0 * math.sqrt(math.pi) * own * np.sqrt(2.0 * math.pi * narrow))
    inside = spread**2 * own**2 / 2.0 / narrow
    slope = white / (2.0 * own**2) + shot * inside / own**4
    floor = np.broadcast_to(np.sqrt(white), height.shape)
    return Peaks(height, width, np.sqrt(white + shot), np.sqrt(slope), floor)


def threshold_ratio(spec: LidarSpec) -> float:
    r"""Return the threshold on the waveform over the noise's standard deviation.

    Notes
    -----
    Noise through a Gaussian filter passes the level u sigma upwards

    .. math:: \mu = \frac{2 R_\max / c}{2 \sqrt2 \, \pi \, \sigma_f} e^{-u^2 / 2}

    times a shot (Rice); a shot of noise alone has a false alarm with :math:`1 - e^{-\mu}`.

    Raises
    ------
    ParameterRangeError
        If the noise alone passes any level that often.

    References
    ----------
    .. [1] S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 24(1), 1945, part III.
    """
    receiver = pulsed(spec)
    duration = 2.0 * spec.max_distance / SPEED_OF_LIGHT
    rate = duration / (2.0 * math.sqrt(2.0) * math.pi * receiver.filter_deviation)
    wanted = -math.log1p(-receiver.false_alarm_probability)
    if rate <= wanted * math.e:
        raise ParameterRangeError(
            "false_alarm_probability",
            receiver.false_alarm_probability,
            f"below {-math.expm1(-rate / math.e):.2g}, what noise alone gives at its own level",
            "choose a smaller one",
        )
    return math.sqrt(2.0 * math.log(rate / wanted))


def level_of(spec: LidarSpec, density: npt.ArrayLike) -> Array:
    """Return the threshold on the waveform [photoelectrons of one pulse] for densities of the noise, any shape, kept.

    :func:`threshold_ratio` times the noise, and at least one photoelectron over all pulses, for a receiver without
    noise of its own.
    """
    least = 1.0 / pulsed(spec).num_pulses
    return np.maximum(threshold_ratio(spec) * noise_deviation(spec, density), least)


def detection_probability(
    spec: LidarSpec, reflectance: npt.ArrayLike, distance: npt.ArrayLike, num_nodes: int = _SPECKLE_NODES
) -> Array:
    """Return the probability that a diffuser across the beam is detected, 0 to 1.

    Parameters
    ----------
    spec : LidarSpec
        With a pulsed receiver.
    reflectance : array_like of float, any shape
        Of a diffuser that holds the whole beam and fills the field of view, 0 to 1.
    distance : array_like of float, of a shape that broadcasts
        [m].
    num_nodes : int
        Of the average over speckle.

    Returns
    -------
    ndarray of float64, of the broadcast shape

    Notes
    -----
    The peak is normal about its mean, which speckle varies by a Gamma distribution of
    :func:`~camera_lidar.lidar.pulsed.link.speckle_cells` (J. W. Goodman, Proc. IEEE 53(11), 1965).
    """
    reflectance, distance = np.broadcast_arrays(
        np.asarray(reflectance, dtype=np.float64), np.asarray(distance, dtype=np.float64)
    )
    intensity = reflectance * np.exp(-2.0 * spec.extinction * distance) / distance**2
    density = noise_density(spec, background_rate(spec, reflectance, distance))
    mean = photoelectrons(spec, intensity, distance)
    level = level_of(spec, density)
    gain = np.ones((1, *mean.shape))
    if pulsed(spec).speckle:
        cells = speckle_cells(spec, distance)
        node = (np.arange(num_nodes) + 0.5) / num_nodes
        gain = gammaincinv(cells, node.reshape(-1, *(1,) * cells.ndim)) / cells
    peaks = filtered(spec, mean * gain, np.full(1, pulsed(spec).pulse_deviation), density)
    return np.mean(ndtr((peaks.height - level) / peaks.noise), axis=0)


def range_deviation(spec: LidarSpec, peaks: Peaks) -> Array:
    r"""Return the standard deviation of measured distances [m], shape (num_pulses,).

    Notes
    -----
    The peak moves by the noise of the slope over the curvature of the pulse:

    .. math:: \sigma_R = \frac{c}{2} \frac{\sigma_{\dot w} \sigma^2}{\hat w}

    which for white noise and a matched filter is the Cramer-Rao bound :math:`\sqrt2 \, \sigma_p / \text{SNR}` of a
    Gaussian pulse's delay. Of a pulse that is clipped the middle of its two passages of a quarter of full scale is
    taken, with the noise over their slope. The trigger's jitter is added.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, on the accuracy of time measurements.
    """
    receiver = pulsed(spec)
    height = np.maximum(peaks.height, 1e-300)
    error = peaks.slope_noise * peaks.width**2 / height
    clipped = peaks.height > full_scale(spec)
    if clipped.any():
        level, top, width = full_scale(spec) * EDGE, height[clipped], peaks.width[clipped]
        away = np.sqrt(2.0 * np.log(top / level))
        floor = peaks.floor[clipped] ** 2
        narrow = width**2 - receiver.filter_deviation**2 / 2.0
        shot = (peaks.noise[clipped] ** 2 - floor) * (level / top) ** (width**2 / narrow)
        error[clipped] = np.sqrt(floor + shot) * width / (level * away * math.sqrt(2.0))
    return SPEED_OF_LIGHT / 2.0 * np.hypot(error, receiver.timing_jitter / math.sqrt(receiver.num_pulses))
