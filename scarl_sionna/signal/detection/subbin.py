"""Range and Doppler between bins: the tone that fits the cells around a peak best, given how noise links them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.tones import seen_by
from scarl_sionna.core.specs.radar.waveforms.phase_coded import PcFmcw

from ..peaks import parabola_offset
from ..processing import RangeDoppler
from ..receivers import noise_weights, response_weights
from ..windows import window_values

Array = npt.NDArray[np.float64]
Patch = npt.NDArray[np.complex128]

REACH = (4, 12)
"""Least and most cells on each side of a peak that take part."""
LOSS = 1.1
"""Standard deviation over the least possible one that makes do without more cells; a tone in the middle of its bin."""
UNEXPLAINED, UNEXPLAINED_BY_CODE = 0.1, 0.25
"""Part of the power around a peak beyond which a single tone is no model of it; a code within a ramp has sidelobes of a
tenth of its own."""
_GRID_STEPS = 128
_VALUES_A_BLOCK = 4_000_000
_ROUNDS = 4
_LEAST_EIGENVALUE = 1e-9
"""Of the cells' covariance: a map with more bins than values has cells that say nothing new."""


@dataclass(frozen=True, eq=False)
class ToneAxis:
    """One axis of a map: the transform of weighted values into `num_bins` bins.

    Attributes
    ----------
    weights : ndarray of float64, shape (num_values,)
        Of a tone's values in a bin, sum 1.
    num_bins : int
    offset : ndarray of int64, shape (num_cells,)
        Cells around a peak, in bins of the map; without zero padding every one, else those one resolution apart.
    turn : ndarray of complex128, shape (num_cells,)
        Refers their phases to the middle of the values.
    whiten : ndarray of float64, shape (num_cells, num_cells)
        Makes the noise of the cells independent, of the variance of one cell.
    grid : ndarray of float64, shape (num_steps,)
        Offsets of a tone from the peak's bin [bins of the map].
    tones : ndarray of float64, shape (num_steps, num_cells)
        A tone of those offsets in the whitened cells, of length 1.
    unexplained : float
        Part of the power around a peak that a single tone may leave.
    """

    weights: Array
    num_bins: int
    offset: npt.NDArray[np.int64]
    turn: Patch
    whiten: Array
    grid: Array
    tones: Array
    unexplained: float = UNEXPLAINED

    @classmethod
    def of(cls, rd: RangeDoppler) -> tuple[ToneAxis, ToneAxis]:
        """Return the axes of a map over Doppler and range."""
        radar = rd.radar
        slow = window_values(rd.window[1], radar.num_doppler_bins)
        fast, noise = response_weights(radar, rd.window[0]), noise_weights(radar, rd.window[0])
        sign = 1 if seen_by(radar).waveform.sweep.slope > 0.0 else -1
        doppler = _axis(_key(slow), _key(slow**2), rd.data.shape[1], 1)
        distance = _axis(_key(fast), _key(noise), rd.data.shape[2], sign)
        waveform = radar.waveform
        if isinstance(waveform, PcFmcw) and waveform.coding == "within":
            distance = replace(distance, unexplained=UNEXPLAINED_BY_CODE)
        return doppler, distance

    def response(self, offset: Array) -> Array:
        """Return a tone of amplitude 1 in the cells, shape (n, num_cells), for offsets (n,) [bins of the map]."""
        return _response(self.weights, self.num_bins, offset, self.offset)

    def fit(self, values: Patch) -> tuple[Array, Array]:
        """Return the offsets (n,) whose tones hold most of whitened values (n, num_cells), and that power (n,)."""
        score = (values.real @ self.tones.T) ** 2 + (values.imag @ self.tones.T) ** 2
        best = score.argmax(axis=1)
        inner = np.clip(best, 1, len(self.grid) - 2)
        row = np.arange(len(values))
        three = [score[row, inner + step] for step in (-1, 0, 1)]
        offset = self.grid[inner] + parabola_offset(*three) * (self.grid[1] - self.grid[0])
        return np.where(best == inner, offset, self.grid[best]), score[row, best]


def _key(values: Array) -> tuple[float, ...]:
    """Return weights as what a cache can hold."""
    return tuple(values.tolist())


def _positions(count: int) -> Array:
    """Return the places of values from their middle."""
    return np.asarray(np.arange(count) - (count - 1) / 2.0, dtype=np.float64)


def _response(weights: Array, num_bins: int, tone: npt.NDArray[np.number], cell: npt.NDArray[np.number]) -> Array:
    """Return the transform of tones (n,) in cells (m,), both in bins, shape (n, m), block by block of the weights."""
    out = np.zeros((len(tone), len(cell)))
    turn = 2.0 * np.pi * _positions(len(weights)) / num_bins
    block = max(1, _VALUES_A_BLOCK // (len(tone) + len(cell)))
    for first in range(0, len(turn), block):
        part = slice(first, first + block)
        tones, cells = np.multiply.outer(tone, turn[part]), np.multiply.outer(cell, turn[part])
        out += np.cos(tones) @ (np.cos(cells) * weights[part]).T + np.sin(tones) @ (np.sin(cells) * weights[part]).T
    return out


@lru_cache(maxsize=32)
def _axis(weights: tuple[float, ...], noise: tuple[float, ...], num_bins: int, sign: int) -> ToneAxis:
    """Return the axis with as few cells as its window needs; `noise` is the variance that each value adds."""
    tone, variance = np.array(weights), np.array(noise) / np.sum(noise)
    count, most = len(tone), min(REACH[1], (len(tone) - 1) // 2)
    stride = max(num_bins // count, 1)
    offset = stride * np.arange(-most, most + 1)
    if len(offset) >= count - 1:  # all there are
        offset = stride * np.arange(-(count // 2), count - count // 2)
    grid = stride * np.linspace(-1.0, 1.0, 2 * _GRID_STEPS + 1) * (1.0 if count > 1 else 0.0)
    raw = _response(tone, num_bins, grid, offset)
    covariance = _response(variance, num_bins, offset, offset)
    for reach in range(min(REACH[0], most), most + 1):
        used = np.flatnonzero((np.abs(offset) <= stride * reach) | (reach == most))
        values, vectors = np.linalg.eigh(covariance[np.ix_(used, used)])
        whiten = (vectors / np.sqrt(np.maximum(values, _LEAST_EIGENVALUE * values[-1]))) @ vectors.T
        tones = raw[:, used] @ whiten.T
        tones /= np.linalg.norm(tones, axis=1)[:, None]
        turn = np.exp(2j * np.pi * sign * offset[used] / num_bins * (count - 1) / 2.0)
        axis = ToneAxis(tone, num_bins, offset[used], turn, whiten, grid, tones)
        if reach == most or _loss(axis, variance) <= LOSS:
            break
    return axis


def _loss(axis: ToneAxis, variance: Array) -> float:
    """Return the standard deviation of the frequency of a tone on a bin over the Cramer-Rao bound of all values."""
    middle, count = len(axis.grid) // 2, len(axis.weights)
    step = (axis.grid[1] - axis.grid[0]) * count / axis.num_bins  # in resolutions
    if not step > 0.0:
        return 1.0
    information = np.divide(axis.weights**2, variance, out=np.zeros(count), where=variance > 0.0)
    slope = (axis.tones[middle + 1] - axis.tones[middle - 1]) / (2.0 * step)
    held = np.sum((axis.whiten @ axis.response(np.zeros(1))[0]) ** 2)
    place = _positions(count) / count
    return float(np.sqrt(4.0 * np.pi**2 * (information @ place**2) / (held * (slope @ slope))))


@dataclass(frozen=True, eq=False)
class Tone:
    """Where tones lie in their cells, and the weights that make a cell exactly at them.

    Attributes
    ----------
    doppler_offset, range_offset : ndarray of float64, shape (n,)
        From the peak's bin [bins of the map].
    doppler_weight, range_weight : ndarray of float64, shape (n, num_cells)
        Of the cells around; their sum over a tone of amplitude 1 is 1.
    noise_gain : ndarray of float64, shape (n,)
        Noise power of that cell over that of one of the map.
    """

    doppler_offset: Array
    range_offset: Array
    doppler_weight: Array
    range_weight: Array
    noise_gain: Array


def fit_tones(
    patch: Patch, noise_power: Array, doppler: ToneAxis, distance: ToneAxis, start: tuple[Array, Array]
) -> Tone:
    r"""Return the tones that hold most of the power in patches of a map.

    Parameters
    ----------
    patch : ndarray of complex128, shape (n, num_doppler_cells, num_range_cells)
        Cells around each peak, after beamforming, with phases at the middle of the values [sqrt(W)].
    noise_power : ndarray of float64, shape (n,)
        Of one cell [W].
    doppler, distance : ToneAxis
    start : (ndarray, ndarray) of float64, shape (n,)
        Offsets over Doppler and range that the largest cells alone suggest [bins]. They are kept where a second target
        or clutter takes part.

    Returns
    -------
    Tone

    Notes
    -----
    In white noise the cells of a window are Gaussian with a known covariance C, so the tone g(f) with the largest
    :math:`|g^H C^{-1} x|^2 / (g^H C^{-1} g)` is the maximum-likelihood estimate from these cells; it is searched over
    each axis in turn. Without the covariance a Hann window would lose a factor of 1.53 in the standard deviation.
    What a single tone leaves is compared with the noise: more than 10 % of its power (25 % with a code), and the peak's
    own three cells decide, which the window shields from neighbours.

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation from discrete-time observations", IEEE Trans.
       Inf. Theory 20(5), 1974.
    """
    white = doppler.whiten @ patch @ distance.whiten.T
    offsets = [start[0].copy(), start[1].copy()]
    power = np.zeros(len(patch))
    for _ in range(_ROUNDS):
        for axis, own, other in ((0, doppler, distance), (1, distance, doppler)):
            tone = other.response(offsets[1 - axis]) @ other.whiten.T
            tone /= np.linalg.norm(tone, axis=1, keepdims=True)
            line = np.einsum("nab,nb->na" if axis == 0 else "nab,na->nb", white, tone)
            offsets[axis], power = own.fit(line)
    cells = white.shape[1] * white.shape[2]
    rest = np.sum(np.abs(white) ** 2, axis=(1, 2)) - power
    single = rest < max(doppler.unexplained, distance.unexplained) * power + noise_power * (
        cells + 4.0 * np.sqrt(cells)
    )
    weights, gain = [], np.ones(len(patch))
    for axis, own in ((0, doppler), (1, distance)):
        offsets[axis] = np.where(single, offsets[axis], start[axis])
        tone = own.response(offsets[axis])
        white_tone = tone @ own.whiten.T
        held = np.sum(white_tone**2, axis=1)
        middle = len(own.offset) // 2
        alone = np.zeros_like(tone)
        alone[:, middle] = 1.0 / np.maximum(tone[:, middle], 1e-6)
        weights.append(np.where(single[:, None], (white_tone @ own.whiten) / held[:, None], alone))
        gain *= np.where(single, 1.0 / held, alone[:, middle] ** 2)
    return Tone(offsets[0], offsets[1], weights[0], weights[1], gain)
