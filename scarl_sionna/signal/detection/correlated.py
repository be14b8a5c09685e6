"""Thresholds over few training cells whose noise is linked by a window."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy.special
from scipy.optimize import brentq

from .statistics import order_of

Array = npt.NDArray[np.float64]
Covariance = npt.NDArray[np.complex128]

MOST_CELLS = 64
"""Training cells up to which their links count, whatever the looks; of more, the number of independent ones says enough
(15 % at 1e-6), but where cells and looks together are few."""
MOST_VALUES = 1024
"""Training cells times looks up to which the links count."""
_SCALES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)
"""Amplitudes of the noise that nodes are drawn with, of _FREEDOM values: quiet training cells make the rare alarms."""
_FREEDOM = 16
_NODES_A_SCALE = 12_000
_LEAST_NODES = 3_000
_LARGEST, _LARGEST_ON_MEAN = 60.0, 709.0
"""Logarithm of the largest factor: of levels that are averaged over nodes, and of the mean."""


class Links:
    """Covariances of training cells, of one half or two, which are taken as independent of each other.

    Parameters
    ----------
    covariances : ndarray of complex128, shape (num_cells, num_cells)
        Of the complex noise of each half's cells, of variance 1.
    """

    def __init__(self, *covariances: Covariance) -> None:
        self.covariances = covariances
        self._key = tuple(item.tobytes() for item in covariances)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Links) and self._key == other._key


@lru_cache(maxsize=128)
def factor_of_links(kind: str, pfa: float, num_looks: int, links: Links, rank: float) -> float:
    r"""Return the factor on the level of linked training cells that a cell exceeds at a rate.

    Parameters
    ----------
    kind : {"ca", "go", "so", "os", "osgo"}
    pfa : float
        Probability of false alarm.
    num_looks : int
        Independent exponential powers whose mean a cell is; training cells are linked within a look only.
    links : Links
    rank : float
        Of the ordered statistic.

    Returns
    -------
    float
        Dimensionless; within 3 % of the rate (standard deviation of the nodes) for the ordered statistic at 1e-6.

    Notes
    -----
    A cell of L looks is gamma-distributed and independent of what is beyond its guard, so with the level Z and the
    regularized upper incomplete gamma function

    .. math:: P_{fa}(T) = E[Q(L, L T Z)], \quad E[e^{-T Z}] \text{ for one look}

    For the mean of cells of a covariance with eigenvalues :math:`\lambda_i`, L T Z is a sum of gamma variables, and the
    rate is that of so many negative binomial ones together staying below L: a sum of L Taylor coefficients of
    :math:`\prod (1 + a_i - a_i u)^{-L}`, :math:`a_i = T \lambda_i / n`, exactly. The other levels are averaged over
    fixed nodes: complex Gaussian cells, drawn at several amplitudes and weighted by the mixture of these (balance
    heuristic), since what counts at small rates are the rare quiet ones.

    References
    ----------
    .. [1] G. L. Turin, "The characteristic function of Hermitian quadratic forms in complex normal variables",
       Biometrika 47(1/2), 1960.
    .. [2] E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995.
    """
    if kind == "ca":
        part = np.linalg.eigvalsh(links.covariances[0]) / len(links.covariances[0])
        part = np.maximum(part, 0.0)
        return _solved(lambda factor: _log_rate_of_mean(factor * part, num_looks), pfa, _LARGEST_ON_MEAN)
    level, log_weight = _levels(kind, num_looks, links, rank)
    whole = _log_mean(log_weight)  # 0 but for the nodes' scatter
    return _solved(lambda factor: _log_mean(log_weight + _log_tail(num_looks, factor * level)) - whole, pfa, _LARGEST)


def _log_rate_of_mean(part: Array, num_looks: int) -> float:
    """Return the logarithm of the rate at which a cell exceeds a mean, of eigenvalues times factor over cells."""
    powers = np.cumsum(np.log(np.tile(part / (1.0 + part), (num_looks, 1)) + 1e-300), axis=0)
    sums = scipy.special.logsumexp(powers, axis=1) + np.log(num_looks)  # of powers 1 .. num_looks of all p_i
    terms = np.zeros(num_looks)  # logarithms of the Taylor coefficients
    for order in range(1, num_looks):
        terms[order] = scipy.special.logsumexp(sums[:order] + terms[:order][::-1]) - np.log(order)
    return float(scipy.special.logsumexp(terms) - num_looks * np.log1p(part).sum())


def _log_tail(num_looks: int, level: Array) -> Array:
    """Return the logarithm of the probability that a cell of noise of power 1 exceeds levels."""
    scaled = num_looks * level
    if num_looks == 1:
        return -scaled
    # e^-x sum x^k / k!, from its largest terms: the gamma function itself underflows
    order = np.arange(num_looks)
    with np.errstate(divide="ignore"):
        terms = order * np.log(scaled)[:, None] - scipy.special.gammaln(order + 1.0)
    return np.asarray(scipy.special.logsumexp(terms, axis=1) - scaled)


def _solved(log_rate: Callable[[float], float], pfa: float, largest: float) -> float:
    """Return the factor at which the logarithm of a rate, falling with the factor, is that of `pfa`."""
    goal = np.log(pfa)
    return float(np.exp(brentq(lambda value: log_rate(float(np.exp(value))) - goal, -largest, largest, xtol=1e-8)))


def _log_mean(exponent: Array) -> float:
    """Return the logarithm of the mean of exponentials."""
    return float(scipy.special.logsumexp(exponent) - np.log(len(exponent)))


@lru_cache(maxsize=16)
def _levels(kind: str, num_looks: int, links: Links, rank: float) -> tuple[Array, Array]:
    """Return levels of training cells in noise of power 1, (n,), and the logarithms of the nodes' weights."""
    halves, values = len(links.covariances), num_looks * sum(len(item) for item in links.covariances)
    quiet = np.array(_SCALES) ** min(1.0, _FREEDOM / values)
    each = max(_LEAST_NODES, _NODES_A_SCALE * _FREEDOM // values)
    drawn: list[tuple[float, ...]]
    if kind == "so":  # one quiet half is enough
        drawn = [(1.0, 1.0), *((scale, 1.0) for scale in quiet[1:]), *((1.0, scale) for scale in quiet[1:])]
    else:
        drawn = [(scale,) * halves for scale in quiet]
    rng = np.random.default_rng(0)
    energy, level = [], []
    for covariance, scales in zip(links.covariances, zip(*drawn, strict=True), strict=True):
        part, vectors = np.linalg.eigh(covariance)
        mixing = (vectors * np.sqrt(np.maximum(part, 0.0) / num_looks)).T
        own_energy, own_level = [], []
        for scale in scales:
            power, total = np.zeros((each, len(covariance))), np.zeros(each)
            for _ in range(num_looks):
                nodes = np.sqrt(0.5) * scale * (rng.normal(size=power.shape) + 1j * rng.normal(size=power.shape))
                power += np.abs(nodes @ mixing) ** 2
                total += np.sum(np.abs(nodes) ** 2, axis=1)
            own_energy.append(total)
            own_level.append(_level_of(kind, power, rank))
        energy.append(np.concatenate(own_energy))
        level.append(np.concatenate(own_level))
    density = np.zeros((len(drawn), len(energy[0])))
    for row, scales in enumerate(drawn):
        for scale, own, covariance in zip(scales, energy, links.covariances, strict=True):
            density[row] -= own * (scale**-2 - 1.0) + 2.0 * num_looks * len(covariance) * np.log(scale)
    log_weight = -scipy.special.logsumexp(density - np.log(len(drawn)), axis=0)
    return (np.minimum if kind == "so" else np.maximum).reduce(level), log_weight


def _level_of(kind: str, power: Array, rank: float) -> Array:
    """Return what the training cells (n, num_cells) of a half are summed up to."""
    if kind in ("go", "so"):
        return np.asarray(power.mean(axis=1))
    place = order_of(power.shape[1], rank) - 1
    return np.asarray(np.partition(power, place, axis=1)[:, place])
