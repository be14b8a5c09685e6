"""Which paths are transformed together, and by which method: the choice that the measured costs make cheapest."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from . import chirpz, nufft
from .phase import FrameGrid

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

MAX_CHUNK_PATHS = 200_000
"""Paths transformed at once by the series: bounds the memory."""
MAX_CHIRPZ_PATHS = 2_000_000
"""Likewise by the chirp-z method, which has no more than some columns of them in memory."""
MAX_BINS = 16
"""Most velocity bins tried."""
_FINEST = 720720
"""Intervals of the velocities of which every number of bins up to `MAX_BINS` is made."""
MAX_TERMS = 24
"""Longest series; a group of paths that needs more is split. Bounds the memory: a term's screen has the frame's
size."""
SPREAD_COST, FFT_COST, DIRECT_COST = 110e-9, 4.0e-8, 4.0e-8
"""Measured seconds: a path of one transform, a sample of one transform, a sample of a path of the plain sum. Only their
ratios matter."""
CHIRPZ_SPREAD_COST, CHIRPZ_FFT_COST = 280e-9, 1.2e-8
"""Measured seconds of the chirp-z method: a path of one term, a value of one term's FFTs in float32."""


class Method(Protocol):
    """A transform that makes the signal of the paths of one group."""

    def signals(
        self, amplitudes: npt.NDArray[np.complex128], length: Array, rate: Array, tx: int
    ) -> Iterator[npt.NDArray[np.complexfloating]]:
        """Yield the signal for each row of amplitudes, shape (num_rows, num_paths), of the same straight paths."""
        ...

    def order(self, length: Array, rate: Array) -> Index:
        """Return the order in which paths are summed fastest, by lengths and rates between the array centres."""
        ...

    def signal(
        self, amplitude: npt.NDArray[np.complex128], length: Array, rate: Array, acceleration: Array, tx: int
    ) -> npt.NDArray[np.complexfloating]:
        """Return the noise-free beat signal of one pair [sqrt(W)], shape (num_chirps, num_samples)."""
        ...


def partition(
    radar: RadarSpec, length: Array, rate: Array, acceleration: Array, tolerance: float
) -> list[tuple[Index, Method | None]]:
    """Return groups of paths, each with its transform, or None where the plain sum is cheaper.

    `length` is that between the array centres [m]. Straight paths go to the chirp-z method where it holds the tolerance
    and is cheaper than the series; paths that bend (their length has a second derivative) go to the series.
    """
    straight = chirpz.is_straight(radar, acceleration, tolerance)
    groups: list[tuple[Index, Method | None]] = []
    for index, bends in ((np.flatnonzero(straight), False), (np.flatnonzero(~straight), True)):
        if not len(index):
            continue
        boxes, cost = _series(radar, rate[index], acceleration[index], tolerance)
        layout = None
        if not bends:
            layout = chirpz.Layout.of(radar, length[index], rate[index], tolerance)
        if layout is not None and _chirpz_cost(radar, layout, len(index), tolerance) < cost:
            transform = chirpz.Transform(radar, layout, tolerance)
            for chunk in np.array_split(index, -(-len(index) // MAX_CHIRPZ_PATHS)):
                groups.append((chunk[transform.order(length[chunk], rate[chunk])], transform))
        else:
            groups += [
                (index[inner], None if box is None else nufft.Transform(radar, box, tolerance)) for inner, box in boxes
            ]
    return groups


def straight(radar: RadarSpec, length: Array, rate: Array, count: int, tolerance: float) -> Method | None:
    """Return the cheapest transform for some straight paths, or None where only the plain sum holds the tolerance.

    Parameters
    ----------
    radar : RadarSpec
    length, rate : ndarray of float64, shape (num_corners,)
        Corners of the box in which lengths [m] and rates [m/s] of the paths are.
    count : int
        Number of paths.
    tolerance : float
        Largest error over the peak.
    """
    layout = chirpz.Layout.of(radar, length, rate, tolerance)
    box = nufft.Box.of(radar, rate, np.zeros_like(rate), tolerance)
    terms = box.num_terms[0]
    series = terms * (count * SPREAD_COST + radar.num_samples * radar.num_chirps * FFT_COST)
    if layout is not None and (_chirpz_cost(radar, layout, count, tolerance) < series or terms > MAX_TERMS):
        return chirpz.Transform(radar, layout, tolerance)
    return nufft.Transform(radar, box, tolerance) if terms <= MAX_TERMS else None


def _chirpz_cost(radar: RadarSpec, layout: chirpz.Layout, count: int, tolerance: float) -> float:
    """Return the seconds of one pair."""
    rows, columns = layout.strips.rows, layout.strips.columns
    values = rows * columns + 2 * radar.num_samples * (columns + radar.num_chirps)
    wide = 1.0 if chirpz.single_precision(tolerance) else 2.0
    return layout.num_terms * (count * CHIRPZ_SPREAD_COST + wide * values * CHIRPZ_FFT_COST)


def _series(
    radar: RadarSpec, rate: Array, acceleration: Array, tolerance: float
) -> tuple[list[tuple[Index, nufft.Box | None]], float]:
    """Return the paths in groups of similar motion for the series or (None) the plain sum, and the seconds of one pair.

    A narrow group needs few terms, and every group needs transforms of its own. Paths that bend are split until their
    series is short.
    """
    samples = radar.num_samples * radar.num_chirps
    waiting = _velocity_bins(radar, rate, tolerance)
    groups: list[tuple[Index, nufft.Box | None]] = []
    total = 0.0
    while waiting:
        index = waiting.pop(0)
        if len(index) > MAX_CHUNK_PATHS:
            waiting[:0] = np.array_split(index, -(-len(index) // MAX_CHUNK_PATHS))
            continue
        box = nufft.Box.of(radar, rate[index], acceleration[index], tolerance)
        terms = box.num_terms[0] * box.num_terms[1]
        plain, series = len(index) * samples * DIRECT_COST, terms * (len(index) * SPREAD_COST + samples * FFT_COST)
        if plain <= series:
            groups.append((index, None))
            total += plain
            continue
        by_phase = [rate[index], acceleration[index]][:: 1 if box.phases[0] >= box.phases[1] else -1]
        values = by_phase[0] if np.ptp(by_phase[0]) > 0 else by_phase[1]
        if terms <= MAX_TERMS or np.ptp(values) == 0:
            groups.append((index, box))
            total += series
        else:
            upper = values > 0.5 * (values.min() + values.max())
            waiting[:0] = [index[~upper], index[upper]]
    return groups, total


def _velocity_bins(radar: RadarSpec, rate: Array, tolerance: float) -> list[Index]:
    """Return the paths in equal intervals of their length rate, as many as make the transforms cheapest."""
    low, span = float(rate.min()), float(np.ptp(rate))
    half_phase = np.pi * np.abs(FrameGrid(radar).residual_cycles(span / SPEED_OF_LIGHT, 0.0, True)).max()
    fft = radar.num_samples * radar.num_chirps * FFT_COST
    occupied = np.zeros(_FINEST, dtype=np.bool_)
    fine = ((rate - low) * (_FINEST / span if span > 0 else 0.0)).astype(np.intp)
    occupied[np.minimum(fine, _FINEST - 1)] = True
    best_cost, best = np.inf, 1
    for count in range(1, MAX_BINS + 1):
        used = np.count_nonzero(occupied.reshape(count, -1).any(axis=1))
        terms = nufft.num_nodes(half_phase / count, nufft.SERIES_SHARE * tolerance)
        cost = terms * (len(rate) * SPREAD_COST + used * fft)
        if cost < best_cost:
            best_cost, best = cost, count
        if terms <= 2:
            break
    index = np.minimum(fine // (_FINEST // best), best - 1).astype(np.uint16)  # sorted by counting
    order = np.argsort(index, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(index[order])) + 1)
