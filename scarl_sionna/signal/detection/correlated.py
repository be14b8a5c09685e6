"""Thresholds over few training cells whose noise is linked by a window, for cells of a single look."""

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
"""Training cells up to which their links count; of more, the number of independent ones says enough (2 % at 1e-6)."""
_SCALES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)
"""Amplitudes of the noise that nodes are drawn with: quiet training cells make the rare alarms."""
_NODES_A_SCALE = 12_000
_LARGEST = 60.0


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
def factor_of_links(kind: str, pfa: float, links: Links, rank: float) -> float:
    r"""Return the factor on the level of linked training cells that a cell of one look exceeds at a rate.

    Parameters
    ----------
    kind : {"ca", "go", "so", "os", "osgo"}
    pfa : float
        Probability of false alarm.
    links : Links
    rank : float
        Of the ordered statistic.

    Returns
    -------
    float
        Dimensionless; within 3 % of the rate (standard deviation of the nodes) for the ordered statistic at 1e-6.

    Notes
    -----
    A cell of one look is exponential and independent of what is beyond its guard, so with the level Z

    .. math:: P_{fa}(T) = E[e^{-T Z}]

    For the mean of cells of a covariance with eigenvalues :math:`\lambda_i` this is
    :math:`\prod (1 + T \lambda_i / n)^{-1}`, exactly. The other levels are averaged over fixed nodes: complex Gaussian
    cells, drawn at several amplitudes and weighted by the mixture of these (balance heuristic), since what counts at
    small rates are the rare quiet ones.

    References
    ----------
    .. [1] G. L. Turin, "The characteristic function of Hermitian quadratic forms in complex normal variables",
       Biometrika 47(1/2), 1960.
    .. [2] E. Veach, L. J. Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995.
    """
    if kind == "ca":
        part = np.linalg.eigvalsh(links.covariances[0]) / len(links.covariances[0])
        return _solved(lambda factor: -float(np.log1p(factor * part).sum()), pfa)
    level, log_weight = _levels(kind, links, rank)
    whole = _log_mean(log_weight)  # 0 but for the nodes' scatter
    return _solved(lambda factor: _log_mean(log_weight - factor * level) - whole, pfa)


def _solved(log_rate: Callable[[float], float], pfa: float) -> float:
    """Return the factor at which the logarithm of a rate, falling with the factor, is that of `pfa`."""
    goal = np.log(pfa)
    return float(np.exp(brentq(lambda value: log_rate(float(np.exp(value))) - goal, -_LARGEST, _LARGEST, xtol=1e-8)))


def _log_mean(exponent: Array) -> float:
    """Return the logarithm of the mean of exponentials."""
    return float(scipy.special.logsumexp(exponent) - np.log(len(exponent)))


def _levels(kind: str, links: Links, rank: float) -> tuple[Array, Array]:
    """Return levels of training cells in noise of power 1, (n,), and the logarithms of the nodes' weights."""
    halves, quiet = len(links.covariances), _SCALES
    drawn: list[tuple[float, ...]]
    if kind == "so":  # one quiet half is enough
        drawn = [(1.0, 1.0), *((scale, 1.0) for scale in quiet[1:]), *((1.0, scale) for scale in quiet[1:])]
    else:
        drawn = [(scale,) * halves for scale in quiet]
    rng = np.random.default_rng(0)
    energy, level = [], []
    for covariance, scales in zip(links.covariances, zip(*drawn, strict=True), strict=True):
        shape = (len(drawn) * _NODES_A_SCALE, len(covariance))
        nodes = np.sqrt(0.5) * (rng.normal(size=shape) + 1j * rng.normal(size=shape))
        nodes *= np.repeat(scales, _NODES_A_SCALE)[:, None]
        values, vectors = np.linalg.eigh(covariance)
        power = np.abs(nodes @ (vectors * np.sqrt(np.maximum(values, 0.0))).T) ** 2
        energy.append(np.sum(np.abs(nodes) ** 2, axis=1))
        level.append(_level_of(kind, power, rank))
    density = np.zeros((len(drawn), len(energy[0])))
    for row, scales in enumerate(drawn):
        for scale, own, covariance in zip(scales, energy, links.covariances, strict=True):
            density[row] -= own * (scale**-2 - 1.0) + 2.0 * len(covariance) * np.log(scale)
    log_weight = -scipy.special.logsumexp(density - np.log(len(drawn)), axis=0)
    return (np.minimum if kind == "so" else np.maximum).reduce(level), log_weight


def _level_of(kind: str, power: Array, rank: float) -> Array:
    """Return what the training cells (n, num_cells) of a half are summed up to."""
    if kind in ("go", "so"):
        return np.asarray(power.mean(axis=1))
    place = order_of(power.shape[1], rank) - 1
    return np.asarray(np.partition(power, place, axis=1)[:, place])
