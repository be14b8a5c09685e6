"""Velocities beyond the interval of a map, by chirps that do not start at equal times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec

from ..direction.manifold import Manifold
from ..peaks import parabola_offset
from ..processing import RangeDoppler, bins_a_hertz, uncompensated
from ..uneven import chirp_times, doppler_matrix, middle_time
from ..windows import window_values
from .ambiguity import is_clear, is_told
from .cells import Cells, beat_place, transmit_delays
from .subbin import ToneAxis

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_REACH = 3
"""Range bins on each side from which a target that was found is taken off."""
_BENDS = 3
"""Terms of its strength over the frame, which range migration changes."""
_LEFT = 0.1
"""Part of a cell's power that must be left when stronger targets are taken off; else it is their image."""
_RIDGE = 1e-9
"""Of the largest eigenvalue of a map's rows: keeps noise small where they say little."""
_STEPS = np.linspace(-0.6, 0.6, 13)
"""Places around a hypothesis at which its tone is looked for [bins]."""
_BESIDE = 2
"""Range bins on each side of a target's way over a frame that tell its place."""
_PLACES = (8, 64)
"""Steps a range bin in which that is looked for, first and then about the best."""
_FINE = 64
"""Steps a range bin in which a tone's lobe is known; its error is below 1e-4."""


def is_staggered(radar: RadarSpec) -> bool:
    """Return whether chirps of one carrier start at uneven times.

    By definition of the waveform.
    """
    return radar.waveform.chirp_delays is not None and radar.waveform.chirp_frequencies is None


def resolved(cells: Cells, manifold: Manifold, noise_power: float) -> Cells:
    r"""Return the targets in cells of a map of staggered chirps, with their intervals, images left out.

    Parameters
    ----------
    cells : Cells
    manifold : Manifold
    noise_power : float
        Of a cell after beamforming [W].

    Returns
    -------
    Cells
        With `fold`, `own` and `told` set.

    Notes
    -----
    A tone beyond the interval of the regular grid shows in a map at several rows, weaker. The slow-time samples z of a
    range follow from its column of the map, :math:`x = D z`, by least squares; in them each hypothesis, the row plus a
    multiple of the interval, is a tone at the chirps' true times, and the strongest beam of all is taken if it is
    clear. From the strongest cell on, each target's tone (times a parabola over the frame, for range migration) is
    taken off its range and those beside; a cell of which less than a tenth is left then was an image. The range is that
    of the tone which migrates through the bins as its velocity says and fits them best: in a row of the map a fast
    target may stand with some of the frame's chirps only, and with their range.

    References
    ----------
    .. [1] S. Mallat, Z. Zhang, "Matching pursuits with time-frequency dictionaries", IEEE Trans. Signal Process.
       41(12), 1993.
    """
    if not len(cells.row):
        return cells
    frame = SlowTime.of(cells.rd, manifold)
    column = np.rint(beat_place(cells)).astype(np.int64) % cells.rd.data.shape[2]
    base = replace(cells, fold=np.zeros_like(cells.fold)).doppler
    at = list(zip(column, base, cells.distance, strict=True))
    alone = np.array([frame.hypotheses(frame.samples(place), *seen)[1].max() for place, *seen in at])
    found: list[_Found] = []
    for row in np.argsort(-alone, kind="stable"):
        near = [item.doppler for item in found if abs(column[item.number] - column[row]) <= _REACH]
        samples = frame.without(frame.samples(column[row]), near)
        folds, power = frame.hypotheses(samples, base[row], cells.distance[row])
        best, here = int(power.argmax()), int(np.flatnonzero(folds == 0)[0])
        if near and power[best] < _LEFT * alone[row]:
            continue
        if not is_clear(power[best], power[here], noise_power):
            best = here
        doppler = frame.refined(samples, base[row] + folds[best] / frame.interval, cells.distance[row])
        start, values = frame.placed(int(column[row]), doppler, near, cells.distance[row])
        told = frame.span * frame.interval if len(power) > 1 and is_told(power, noise_power) else 1.0
        found.append(_Found(int(row), int(folds[best]), doppler, start, values, told))
    return _moved(cells, found)


class _Found(NamedTuple):
    """A target: which cell, its interval, Doppler frequency [Hz], range at the frame's start [bins], values, period."""

    number: int
    fold: int
    doppler: float
    start: float
    values: Complex
    told: float


def _moved(cells: Cells, found: list[_Found]) -> Cells:
    """Return the cells that were found, in their first order."""
    found = sorted(found, key=lambda item: item.number)
    kept = cells.select(np.array([item.number for item in found]))
    fold, doppler, start, told = (
        np.array([getattr(item, name) for item in found]) for name in ("fold", "doppler", "start", "told")
    )
    rows, columns = len(cells.rd.radial_velocity), cells.rd.data.shape[2]
    offset = (doppler * cells.rd.radar.slow_interval - fold) * rows - (kept.row - rows // 2)
    moved = replace(kept, fold=np.zeros_like(fold), offset=(offset, kept.offset[1]))
    shift = bins_a_hertz(cells.rd.radar, columns)
    place = start + shift * fold / cells.rd.radar.slow_interval - kept.column
    if not cells.rd.is_compensated:
        place = place + shift * moved.doppler
    place = np.mod(place + 0.5 * columns, columns) - 0.5 * columns
    own = np.stack([item.values for item in found])
    return replace(moved, fold=fold, offset=(offset, place), own=own, told=told)


@dataclass(frozen=True, eq=False)
class SlowTime:
    """Samples over slow time of the range bins of a map, before the compensation of motion.

    Attributes
    ----------
    manifold : Manifold
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        The map without compensation [sqrt(W)].
    inverse : ndarray of complex128, shape (num_chirps, num_doppler_bins)
        Makes windowed samples of a column.
    window : ndarray of float64, shape (num_chirps,)
        Sum 1.
    times : ndarray of float64, shape (num_chirps,)
        Of the first transmitter's chirps [s].
    delays : ndarray of float64, shape (num_virtual,)
        Of the channels' chirps after the first transmitter's [s].
    interval : float
        From row to row of the regular grid [s].
    span : float
        Width of the interval of Doppler frequencies that are told apart [Hz].
    axis : RangeLobe
    rising : ndarray of float64, shape (num_chirps,)
        By how many range bins a target stands higher in each chirp than at the frame's start, for each Hz of its
        Doppler frequency.
    """

    manifold: Manifold
    data: npt.NDArray[np.complex64]
    inverse: Complex
    window: Array
    times: Array
    delays: Array
    interval: float
    span: float
    axis: RangeLobe
    rising: Array

    @classmethod
    def of(cls, rd: RangeDoppler, manifold: Manifold) -> SlowTime:
        """Return the samples of a map."""
        radar = rd.radar
        window = window_values(rd.window[1], radar.num_chirps)
        matrix = doppler_matrix(radar, window.astype(np.float32), rd.data.shape[1]).astype(np.complex128)
        square = matrix @ matrix.conj().T
        square += _RIDGE * float(np.linalg.norm(square, 2)) * np.eye(len(square))
        inverse = window[:, None] * matrix.conj().T @ np.linalg.inv(square)
        tried = max(radar.unfolded_velocity / radar.unambiguous_velocity, float(radar.num_turns))
        span = tried / radar.slow_interval
        delays, times = transmit_delays(radar), chirp_times(radar)
        middle, sweep = (radar.num_chirps - 1) / 2.0 * radar.doppler_interval, radar.waveform.sweep
        later = times - middle + middle_time(radar) + delays.mean()
        rising = (1.0 + sweep.slope * later / radar.center_frequency) * rd.data.shape[2] / radar.sample_rate
        rising = rising if sweep.slope > 0.0 else -rising
        farthest = float(np.ptp(rising)) * 0.5 * (span + 2.0 / radar.slow_interval)
        axis = RangeLobe.of(rd, 3.0 * farthest + 3.0 * _BESIDE * max(1, rd.data.shape[2] // radar.num_range_bins))
        data, interval = uncompensated(rd), radar.slow_interval
        return cls(manifold, data, inverse, window, times, delays, interval, span, axis, rising)

    def samples(self, column: int) -> Complex:
        """Return the windowed samples of a range bin, shape (num_virtual, num_chirps) [sqrt(W)]."""
        return np.asarray(self.data[:, :, column].astype(np.complex128) @ self.inverse.T)

    def without(self, samples: Complex, dopplers: list[float]) -> Complex:
        """Return samples without tones [Hz] whose strengths are parabolas over the frame, by least squares."""
        if not dopplers:
            return samples
        place = self.times / self.times[-1] - 0.5
        bends = np.stack([self.window * place**power for power in range(_BENDS)])
        tones = np.exp(2j * np.pi * np.multiply.outer(dopplers, self.times))
        basis, _ = np.linalg.qr((tones[:, None] * bends).reshape(-1, len(self.times)).T)
        return np.asarray(samples - (samples @ basis.conj()) @ basis.T)

    def beam_values(self, samples: Complex, doppler: Array) -> Complex:
        """Return the channels' values at Doppler frequencies (n,) [Hz], motion between them undone.

        Shape (n, num_virtual) [sqrt(W)].
        """
        tones = np.exp(-2j * np.pi * np.multiply.outer(doppler, self.times))
        return np.asarray((tones @ samples.T) * np.exp(-2j * np.pi * np.multiply.outer(doppler, self.delays)))

    def power(self, samples: Complex, doppler: Array, distance: float) -> Array:
        """Return the power of the strongest beam at Doppler frequencies [Hz], shape (n,) [W]."""
        values = self.beam_values(samples, doppler)
        return self.manifold.peak(values, np.full(len(doppler), distance))[1]

    def hypotheses(self, samples: Complex, doppler: float, distance: float) -> tuple[npt.NDArray[np.int64], Array]:
        """Return the intervals that a Doppler frequency [Hz] may be off, and the power of each [W]; both (n,)."""
        most = int(np.ceil(0.5 * self.span * self.interval)) + 1
        folds = np.arange(-most, most + 1)
        asked = doppler + folds / self.interval
        inside = (np.abs(asked) <= 0.5 * self.span) | (folds == 0)
        return folds[inside], self.power(samples, asked[inside], distance)

    def refined(self, samples: Complex, doppler: float, distance: float) -> float:
        """Return the Doppler frequency with the most power near another [Hz]."""
        step = (_STEPS[1] - _STEPS[0]) / (len(self.times) * self.interval)
        asked = doppler + _STEPS / (len(self.times) * self.interval)
        level = np.log(np.maximum(self.power(samples, asked, distance), 1e-300))
        best = int(np.clip(level.argmax(), 1, len(level) - 2))
        return float(asked[best] + step * parabola_offset(*level[best - 1 : best + 2]))

    def placed(self, column: int, doppler: float, near: list[float], distance: float) -> tuple[float, Complex]:
        """Return the range at the frame's start [bins] of a target about a column, and its channels' values [sqrt(W)].

        Those of the tone that migrates by its Doppler frequency [Hz] and holds most of the power of the bins that it
        passes. `near` are the Doppler frequencies of stronger targets there.
        """
        rises, total = self.rising * doppler, self.data.shape[2]
        middle, half = float(self.window @ rises), 0.5 * float(np.ptp(rises))
        stride = self.axis.stride
        reach = int(np.ceil(2.0 * half)) + _BESIDE * stride
        beside = np.arange(-reach, reach + 1)
        values = np.stack([self.without(self.samples(int(place)), near) for place in (column + beside) % total])
        values *= np.exp(-2j * np.pi * doppler * (self.times + self.delays[:, None]))
        beam = self._beam(values, distance, reach) * self.axis.turned(beside, np.sign(self.rising[0]))
        place = 0.0
        for steps, far in zip(_PLACES, (stride + half, 2.0 * stride / _PLACES[0]), strict=True):
            places = place + np.arange(-np.ceil(far * steps), np.ceil(far * steps) + 1.0) / steps
            shape = self.axis.lobe(beside - (places[:, None] + rises - middle)[..., None])
            power = np.abs(np.einsum("nmk,mk->n", shape, beam)) ** 2 / np.einsum("nmk,m->n", shape**2, self.window)
            best = int(np.clip(power.argmax(), 1, len(places) - 2))
            place = float(places[best] + parabola_offset(*power[best - 1 : best + 2]) / steps)
        shape = self.axis.lobe(-(place + rises - middle))
        own = values[reach] @ shape / (self.window @ shape**2)
        return float((column + place - middle) % total), np.asarray(own)

    def _beam(self, values: Complex, distance: float, strongest: int) -> Complex:
        """Return values (num_bins, num_virtual, num_chirps) in the beam of one bin, shape (num_chirps, num_bins)."""
        place = np.array([distance])
        sines = self.manifold.strongest(values[strongest].sum(axis=-1)[None], place)
        return np.asarray(np.einsum("c,kcm->mk", np.conj(self.manifold.phasors(sines, place)[0]), values))


@dataclass(frozen=True, eq=False)
class RangeLobe:
    """A tone in the range bins of a map, by its distance from them.

    Attributes
    ----------
    level : ndarray of float64, shape (num_steps,)
        At steps of 1 / `_FINE` bins from 0 on; the same on the other side.
    count, total : int
        Values that are transformed, into so many bins.
    """

    level: Array
    count: int
    total: int

    @classmethod
    def of(cls, rd: RangeDoppler, far: float) -> RangeLobe:
        """Return the lobe up to so many bins from a tone."""
        weights, total = ToneAxis.of(rd)[1].weights, rd.data.shape[2]
        position = np.arange(len(weights)) - (len(weights) - 1) / 2.0
        steps = np.arange(np.ceil(far * _FINE) + 2.0) / _FINE
        return cls(np.cos(2.0 * np.pi / total * np.multiply.outer(steps, position)) @ weights, len(weights), total)

    @property
    def stride(self) -> int:
        """Bins of a resolution."""
        return max(self.total // self.count, 1)

    def lobe(self, apart: Array) -> Array:
        """Return the level at distances from a tone [bins], same shape."""
        return np.interp(np.abs(apart), np.arange(len(self.level)) / _FINE, self.level)

    def turned(self, bins: npt.NDArray[np.integer], sign: float) -> Complex:
        """Return what refers the phases of bins to the middle of the values, same shape."""
        return np.asarray(np.exp(2j * np.pi * sign * bins / self.total * (self.count - 1) / 2.0))
