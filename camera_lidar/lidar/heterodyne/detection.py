"""Detection of a beat in noise, and how well its frequency can be estimated: closed forms.

A chirp's spectrum is averaged in power over `num_looks` chirps. In a resolution cell of noise the sum of the looks, in
units of the mean noise, is Gamma(num_looks); a return adds its carrier-to-noise ratio times the speckle of each look.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import gammaincc

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

Array = npt.NDArray[np.float64]

UNIFORM_CELL_CNR = 18.0 / math.pi**2
"""Carrier-to-noise ratio at which the Cramer-Rao bound of a frequency is the deviation of a uniform place in the
resolution cell."""
_PANELS = 41
"""Edges of the panels of the average over speckle: error below 1e-7 of a probability for carrier-to-noise ratios up to
1e5."""


def beat_limits(spec: LidarSpec) -> tuple[float, float]:
    """Return the lowest and the highest beat frequency [Hz] of an up chirp that the receiver searches.

    From ``-2 max_velocity / wavelength`` to ``2 chirp_slope max_distance / c + 2 max_velocity / wavelength``; of a down
    chirp the negative.

    By definition of the beat, see :func:`~camera_lidar.lidar.heterodyne.tones.from_beats`.
    """
    assert isinstance(spec.receiver, HeterodyneReceiver)
    shift = 2.0 * spec.receiver.max_velocity / spec.wavelength
    return -shift, 2.0 * spec.chirp_slope * spec.max_distance / SPEED_OF_LIGHT + shift


def num_cells(spec: LidarSpec) -> float:
    """Return the width of the band of beats that is searched, in resolution cells of a chirp's spectrum.

    Dimensionless. By definition: bandwidth times the duration of a chirp, at most the number of samples.
    """
    low, high = beat_limits(spec)
    return min((high - low) * spec.chirp_time, float(spec.num_samples))


def unambiguous_distance(spec: LidarSpec) -> float:
    """Return the distance up to which no beat is folded by the sampling, at any velocity that is searched [m].

    By definition: where the beat of a target at the largest velocity reaches the edge of the sampled band.
    """
    assert isinstance(spec.receiver, HeterodyneReceiver)
    left = spec.receiver.sampling_frequency - 4.0 * spec.receiver.max_velocity / spec.wavelength
    return max(left, 0.0) * SPEED_OF_LIGHT / (2.0 * spec.chirp_slope)


def peaks_per_cell(level: npt.ArrayLike, num_looks: int = 1) -> Array:
    r"""Return the mean number of peaks above a level in a resolution cell of the spectrum of circular normal noise.

    Parameters
    ----------
    level : array_like of float, any shape
        On the sum of the looks in units of their mean power, > 0.
    num_looks : int
        >= 1.

    Returns
    -------
    ndarray of float64, shape of `level`
        Dimensionless.

    Notes
    -----
    .. math:: \sqrt{\frac{\pi \gamma}{3}} \, \frac{\gamma^{M-1} e^{-\gamma}}{\Gamma(M)}

    is how often the spectrum passes a level upwards (Rice's formula, with the second moment :math:`\pi^2 / 3` of a
    rectangular window). Below its highest value, at M - 1/2, that value holds: every peak is above such a level.

    References
    ----------
    .. [1] S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 24(1), 1945, section 3.6.
    """
    height = np.maximum(np.asarray(level, dtype=np.float64), num_looks - 0.5)
    return np.sqrt(math.pi / 3.0) * np.exp((num_looks - 0.5) * np.log(height) - height - math.lgamma(num_looks))


@lru_cache(maxsize=64)
def threshold(spec: LidarSpec) -> float:
    r"""Return the level of the summed looks above which a peak is a detection.

    It gives the receiver's `false_alarm_probability` for an empty shot.

    Raises
    ------
    ParameterRangeError
        If the probability cannot be reached by a level above the mean noise.

    Notes
    -----
    A peak is searched between the lines of the transform too, so that no return is lost for its place. The spectrum of
    noise passes a level :math:`\gamma` upwards on the mean

    .. math:: \mu(\gamma) = N_c \sqrt{\frac{\pi \gamma}{3}} \, \frac{\gamma^{M-1} e^{-\gamma}}{\Gamma(M)}

    times in :math:`N_c` resolution cells (Rice's formula, with the second moment :math:`\pi^2 / 3` of a rectangular
    window), and a chirp has a false peak with :math:`p = 1 - e^{-\mu}`. With an up and a down chirp both must have one,
    and the distance and the velocity that they give must be among those that are searched, which the share
    :math:`g = 2 W_R W_v / (W_R + W_v)^2` of all pairs is (W: widths of the band of beats over distance and over
    velocity): :math:`P_{fa} = g p^2`.

    References
    ----------
    .. [1] S. O. Rice, "Mathematical analysis of random noise", Bell Syst. Tech. J. 24(1), 1945, section 3.6.
    """
    receiver = spec.receiver
    assert isinstance(receiver, HeterodyneReceiver)
    over_velocity = 4.0 * receiver.max_velocity / spec.wavelength
    over_distance = 2.0 * spec.chirp_slope * spec.max_distance / SPEED_OF_LIGHT
    total, wanted = over_distance + over_velocity, receiver.false_alarm_probability
    share = 2.0 * over_distance * over_velocity / total**2
    of_chirp = math.sqrt(wanted / share) if receiver.chirps == "up_down" else wanted * total / over_distance
    looks = receiver.num_looks

    def excess(level: float) -> float:
        crossings = math.log(num_cells(spec)) + 0.5 * math.log(math.pi * level / 3.0)
        return crossings + (looks - 1) * math.log(level) - level - math.lgamma(looks) - math.log(-math.log1p(-of_chirp))

    if not of_chirp < 0.5 or excess(float(looks)) <= 0.0:
        raise ParameterRangeError(
            "false_alarm_probability", wanted, "a level above the mean noise must reach it", "choose a smaller one"
        )
    return float(brentq(excess, float(looks), 20.0 * looks + 200.0, xtol=1e-10))


def detection_probability(
    cnr: npt.ArrayLike, level: float, num_looks: int = 1, speckle: bool = True, num_chirps: int = 2
) -> Array:
    r"""Return the probability that the peaks of all chirps of a return pass a level.

    Parameters
    ----------
    cnr : array_like of float, any shape
        Carrier-to-noise ratio of one look, in the mean over speckle, linear.
    level : float
        Threshold on the sum of the looks in units of the mean noise.
    num_looks : int
        Looks with independent speckle, >= 1.
    speckle : bool
        Fully developed speckle, the same in the up and the down chirp of a look.
    num_chirps : int
        1 or 2 chirps that must pass, with independent noise.

    Returns
    -------
    ndarray of float64, shape of `cnr`
        Probability, 0 to 1.

    Notes
    -----
    One chirp with speckle is Swerling's second case:

    .. math:: P_d = Q_\Gamma\!\left(M, \frac{\gamma}{1 + C}\right), \quad M = 1:\; P_d = P_{fa}^{1/(1+C)}

    Without speckle it is the tail of a noncentral chi-square with 2 M degrees of freedom and noncentrality 2 M C
    (Marcum). Two chirps share the speckle s, of density Gamma(M): the square of that tail is averaged over s by
    quadrature.

    References
    ----------
    .. [1] P. Swerling, "Probability of detection for fluctuating targets", IRE Trans. Inf. Theory 6(2), 1960.
    .. [2] J. W. Goodman, "Some effects of target-induced scintillation on optical radar performance", Proc. IEEE
       53(11), 1965.
    """
    cnr = np.asarray(cnr, dtype=np.float64)
    if speckle and num_chirps == 1:
        return gammaincc(num_looks, level / (1.0 + cnr))
    if not speckle:
        return _tail(level, num_looks, cnr * num_looks) ** num_chirps
    node, weight = _speckle_rule(num_looks)
    return _tail(level, num_looks, cnr[..., None] * node) ** num_chirps @ weight


@lru_cache(maxsize=16)
def _speckle_rule(num_looks: int) -> tuple[Array, Array]:
    """Return nodes and weights of an average over speckle, of density Gamma(num_looks).

    Gauss rules on geometric panels.
    """
    edges = np.concatenate([[0.0], np.geomspace(1e-6, 40.0 + 8.0 * num_looks, _PANELS)])
    place, share = np.polynomial.legendre.leggauss(8)
    half, middle = np.diff(edges) / 2.0, (edges[1:] + edges[:-1]) / 2.0
    node = (middle[:, None] + half[:, None] * place).reshape(-1)
    density = np.exp((num_looks - 1) * np.log(node) - node - math.lgamma(num_looks))
    return node, density * (half[:, None] * share).reshape(-1)


def _tail(level: float, num_looks: int, noncentrality: Array) -> Array:
    from scipy.stats import ncx2  # 0.5 s, which other lidars need not wait for

    return ncx2.sf(2.0 * level, 2 * num_looks, 2.0 * np.maximum(noncentrality, 1e-300))


def frequency_deviation(cnr: npt.ArrayLike, chirp_time: float, num_samples: int) -> Array:
    r"""Return the Cramer-Rao bound of the standard deviation of a tone's frequency [Hz], amplitude and phase unknown.

    Parameters
    ----------
    cnr : array_like of float, any shape
        Carrier-to-noise ratio after the transform: number of samples times that of a sample.
    chirp_time : float
        Duration of the samples [s].
    num_samples : int
        Complex samples.

    Returns
    -------
    ndarray of float64, shape of `cnr`
        [Hz].

    Notes
    -----
    .. math:: \sigma_f^2 = \frac{6}{(2\pi)^2 \, C \, T_s^2 (N^2 - 1)} \approx \frac{3}{2 \pi^2 \, C \, T^2}

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE Trans.
       Inf. Theory 20(5), 1974, Eq. (19).
    """
    interval = chirp_time / num_samples
    return np.sqrt(6.0 / (np.asarray(cnr, dtype=np.float64) * (num_samples**2 - 1))) / (2.0 * math.pi * interval)


def range_deviation(spec: LidarSpec, cnr: npt.ArrayLike) -> Array:
    """Return the Cramer-Rao bound of the distance from an up and a down chirp [m]: c / (4 slope) sqrt(2) sigma_f.

    Parameters
    ----------
    spec : LidarSpec
    cnr : array_like of float, any shape
        Carrier-to-noise ratio after the transform, linear.

    Returns
    -------
    ndarray of float64, shape of `cnr`
        [m].

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE
       Trans. Inf. Theory 20(5), 1974.
    """
    bound = frequency_deviation(cnr, spec.chirp_time, spec.num_samples)
    return SPEED_OF_LIGHT / (4.0 * spec.chirp_slope) * math.sqrt(2.0) * bound


def velocity_deviation(spec: LidarSpec, cnr: npt.ArrayLike) -> Array:
    """Return the Cramer-Rao bound of the radial velocity from an up and a down chirp [m/s].

    It is wavelength / 4 sqrt(2) sigma_f.

    Parameters
    ----------
    spec : LidarSpec
    cnr : array_like of float, any shape
        Carrier-to-noise ratio after the transform, linear.

    Returns
    -------
    ndarray of float64, shape of `cnr`
        [m/s].

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE
       Trans. Inf. Theory 20(5), 1974.
    """
    return spec.wavelength / 4.0 * math.sqrt(2.0) * frequency_deviation(cnr, spec.chirp_time, spec.num_samples)
