"""Factors of thresholds: how far a cell of noise must exceed what its training cells say, for a false-alarm rate."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.special
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]

LEAST_PFA = 1e-18
"""Smallest probability that the integrals of :func:`factor` can tell."""
LEAST_PFA_OF_MEAN = 1e-300
"""Smallest probability that :func:`factor_on_mean` can tell."""
_LOGITS = np.linspace(-45.0, 45.0, 721)
"""Nodes of the trapezoidal rule over probabilities: it converges faster than any power for such integrands."""


class Halves(NamedTuple):
    """Training cells before and behind a cell, and independent over all of them; one half if all count alike."""

    before: int
    behind: int
    loss: float


@lru_cache(maxsize=4096)
def factor(kind: str, pfa: float, num_looks: int, halves: Halves, rank: float) -> float:
    r"""Return the factor on the level of the training cells, dimensionless.

    Parameters
    ----------
    kind : {"ca", "go", "so", "os", "osgo"}
    pfa : float
        Probability of false alarm.
    num_looks : int
        Independent exponential powers whose mean a cell is.
    halves : Halves
        Numbers of training cells.
    rank : float
        Of the ordered statistic.

    Returns
    -------
    float

    Notes
    -----
    A cell X of white noise is gamma-distributed, and so are sums of cells; an ordered value has the distribution of
    Beta(k, n - k + 1) in terms of the cells'; greater and smaller of two halves multiply distributions or survivals. So
    the probability is the mean of the level's distribution at X / T, an integral over X alone:

    .. math:: P_{fa}(T) = E_X[F_Z(X / T)]

    References
    ----------
    .. [1] H. Rohling, "Radar CFAR thresholding in clutter and multiple target situations", IEEE Trans. Aerosp.
       Electron. Syst. 19(4), 1983.
    """
    cell, weight = _cells(num_looks)

    def excess(log_factor: float) -> float:
        level = _distribution(kind, cell / np.exp(log_factor), num_looks, halves, rank)
        return float(np.log(max(float(level @ weight), 1e-300)) - np.log(pfa))

    return float(np.exp(brentq(excess, -20.0, 60.0, xtol=1e-10)))


def factor_on_mean(pfa: float, num_looks: int, freedom: Array) -> Array:
    """Return the factor on the mean of independent training cells in closed form, dimensionless.

    Parameters
    ----------
    pfa : float
        Probability of false alarm.
    num_looks : int
        Independent exponential powers whose mean a cell is.
    freedom : ndarray of float64
        Numbers of independent training cells, at least one is counted.

    Returns
    -------
    ndarray of float64, of the shape of `freedom`

    Notes
    -----
    The ratio of two means of gamma variables has an F distribution, whose survival function is a regularized incomplete
    beta function; that one and its complement are inverted, so that neither end of the probabilities is rounded (1e-300
    is met within 2 %).

    References
    ----------
    .. [1] M. Abramowitz, I. A. Stegun, *Handbook of Mathematical Functions*, 1964, 26.6.2.
    """
    behind = num_looks * np.maximum(freedom, 1.0)
    rest = scipy.special.betaincinv(behind, num_looks, pfa)
    return np.asarray(behind * scipy.special.betainccinv(num_looks, behind, pfa) / (num_looks * rest))


@lru_cache(maxsize=256)
def rate_of_each(kind: str, pfa: float, num_looks: int, windows: tuple[Halves, Halves], rank: float) -> float:
    r"""Return the rate of each of two thresholds whose windows share no cell, so that either is exceeded at a rate.

    Parameters
    ----------
    kind, pfa, num_looks, rank
        As for :func:`factor`; `pfa` is the probability that the cell exceeds one threshold or both.
    windows : (Halves, Halves)
        Numbers of training cells of the two.

    Returns
    -------
    float
        Between ``pfa / 2`` and `pfa`, dimensionless.

    Notes
    -----
    Both look at one cell X, their levels are independent:
    :math:`P_{fa} = E_X[1 - (1 - F_1(X / T_1)) (1 - F_2(X / T_2))]`. Rates below 1e-14 are halved, to within 1 %.
    """
    if not 1e-14 < pfa < 0.99:
        return 0.5 * pfa if pfa < 0.5 else pfa
    cell, weight = _cells(num_looks)

    def excess(log_rate: float) -> float:
        kept = [
            1.0
            - _distribution(
                kind, cell / factor(kind, float(np.exp(log_rate)), num_looks, halves, rank), num_looks, halves, rank
            )
            for halves in windows
        ]
        return float(np.log((1.0 - kept[0] * kept[1]) @ weight) - np.log(pfa))

    return float(np.exp(brentq(excess, np.log(0.49 * pfa), np.log(min(1.01 * pfa, 1.0 - 1e-12)), xtol=1e-4)))


def order_of(count: int, rank: float) -> int:
    """Return which of `count` ordered values has a rank, from 1, the smallest; by definition."""
    return int(np.clip(np.ceil(rank * count), 1, count))


def _cells(num_looks: int) -> tuple[Array, Array]:
    """Return powers of a cell of noise of mean 1 and their probabilities, to integrate over."""
    upper = scipy.special.expit(_LOGITS)
    weight = upper * scipy.special.expit(-_LOGITS) * (_LOGITS[1] - _LOGITS[0])
    return scipy.special.gammainccinv(num_looks, upper) / num_looks, weight


def _distribution(kind: str, level: Array, num_looks: int, halves: Halves, rank: float) -> Array:
    """Return the probability that the level of training cells in noise of power 1 is not above values."""
    each = [_half(kind, level, num_looks, count, halves.loss, rank) for count in halves[:2] if count > 0]
    if kind == "so":
        return np.asarray(1.0 - np.prod([1.0 - part for part in each], axis=0))
    return np.asarray(np.prod(each, axis=0))


def _half(kind: str, level: Array, num_looks: int, count: int, loss: float, rank: float) -> Array:
    """Return the distribution of the level of one half."""
    if kind in ("ca", "go", "so"):
        shape = num_looks * max(count * loss, 1.0)
        return np.asarray(scipy.special.gammainc(shape, shape * level))
    order = max(np.ceil(rank * count), 1.0)
    free = max(count * loss, 1.0)
    below = order / (count + 1.0) * (free + 1.0)  # the same mean, and the variance of the independent cells
    return np.asarray(
        scipy.special.betainc(below, free + 1.0 - below, scipy.special.gammainc(num_looks, num_looks * level))
    )
