"""Velocities beyond the interval of a map, by chirps that do not start at equal times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec

from ..direction.manifold import Manifold
from ..peaks import parabola_offset
from ..processing import RangeDoppler, uncompensated
from ..uneven import chirp_times, doppler_matrix
from ..windows import window_values
from .ambiguity import is_clear
from .cells import Cells, beat_place, bins_a_hertz, range_gain, transmit_delays

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
        With `fold` and `own` set.

    Notes
    -----
    A tone beyond the interval of the regular grid shows in a map at several rows, weaker. The slow-time samples z of a
    range follow from its column of the map, :math:`x = D z`, by least squares; in them each hypothesis, the row plus a
    multiple of the interval, is a tone at the chirps' true times, and the strongest beam of all is taken if it is
    clear. From the strongest cell on, each target's tone (times a parabola over the frame, for range migration) is
    taken off its range and those beside; a cell of which less than a tenth is left then was an image.

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
    found: list[tuple[int, int, float, Complex]] = []
    for row in np.argsort(-alone, kind="stable"):
        near = [doppler for other, _, doppler, _ in found if abs(column[other] - column[row]) <= _REACH]
        samples = frame.without(frame.samples(column[row]), near)
        folds, power = frame.hypotheses(samples, base[row], cells.distance[row])
        best, here = int(power.argmax()), int(np.flatnonzero(folds == 0)[0])
        if near and power[best] < _LEFT * alone[row]:
            continue
        if not is_clear(power[best], power[here], noise_power):
            best = here
        doppler = frame.refined(samples, base[row] + folds[best] / frame.interval, cells.distance[row])
        found.append((int(row), int(folds[best]), doppler, frame.beam_values(samples, np.array([doppler]))[0]))
    return _moved(cells, found)


def _moved(cells: Cells, found: list[tuple[int, int, float, Complex]]) -> Cells:
    """Return the cells that were found (row, fold, Doppler frequency, values), in their first order."""
    found = sorted(found, key=lambda item: item[0])
    kept = cells.select(np.array([item[0] for item in found]))
    fold, doppler = np.array([item[1] for item in found]), np.array([item[2] for item in found])
    rows = len(cells.rd.radial_velocity)
    offset = (doppler * cells.rd.radar.slow_interval - fold) * rows - (kept.row - rows // 2)
    own = np.stack([item[3] for item in found]) / np.sqrt(range_gain(kept))[:, None]
    # in the map a row's own Doppler frequency was compensated, which may be some rows off
    seen = replace(kept, fold=np.zeros_like(fold))
    moved = replace(seen, offset=(offset, kept.offset[1]))
    shift = bins_a_hertz(cells.rd) if cells.rd.is_compensated else 0.0
    return replace(moved, fold=fold, offset=(offset, kept.offset[1] - shift * (moved.doppler - seen.doppler)), own=own)


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
    """

    manifold: Manifold
    data: npt.NDArray[np.complex64]
    inverse: Complex
    window: Array
    times: Array
    delays: Array
    interval: float
    span: float

    @classmethod
    def of(cls, rd: RangeDoppler, manifold: Manifold) -> SlowTime:
        """Return the samples of a map."""
        radar = rd.radar
        window = window_values(rd.window[1], radar.num_chirps)
        matrix = doppler_matrix(radar, window.astype(np.float32), rd.data.shape[1]).astype(np.complex128)
        square = matrix @ matrix.conj().T
        square += _RIDGE * float(np.linalg.norm(square, 2)) * np.eye(len(square))
        inverse = window[:, None] * matrix.conj().T @ np.linalg.inv(square)
        span = radar.unfolded_velocity / radar.unambiguous_velocity / radar.slow_interval
        delays = transmit_delays(radar)
        return cls(manifold, uncompensated(rd), inverse, window, chirp_times(radar), delays, radar.slow_interval, span)

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
        return np.asarray(self.manifold.spectrum(values, np.full(len(doppler), distance)).max(axis=1))

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
