"""Targets beside a stronger one: what is a peak once the stronger one's direction is taken away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..direction.manifold import Manifold
from ..direction.several import DYNAMIC_RANGE_DB, Directions, resolution, separating_weights
from ..processing import bins_a_hertz
from .cells import Cells, at_targets, beat_place, patches
from .subbin import ToneAxis

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]

_REACH = 2
"""Resolutions on each side of a peak: half the main lobe of a Hann window, the flank on which no sum has a maximum."""
_CELLS = (2 * _REACH + 1) ** 2 - 1
_NEAREST = 1.0
"""Beamwidths between a peak's direction and that of a target beside it; nearer ones are hardly left."""
_OWN = 0.5
"""Beamwidths within which a direction found between the bins is the one seen in the cell."""
_FALSE_TARGET = 1e-4
"""Probability that noise makes a target beside a peak, by cells and beams that are independent; in fact some ten times
more, since the largest of all angles counts."""
_VALUES_A_BLOCK = 4_000_000


class _Beside(NamedTuple):
    """Cells beside peaks that hold a target in another direction.

    Attributes: which peak each is beside; the cells; the sines (n, 2) of the targets' directions; weights
    (n, num_virtual) of the channels, 1 towards the target and 0 towards the peak's.
    """

    peak: npt.NDArray[np.int64]
    cells: Cells
    sines: Array
    weights: Phasors


def with_those_beside(
    manifold: Manifold,
    found: Directions,
    cells: Cells,
    data: npt.NDArray[np.complex64],
    noise_power: float,
    search: Callable[[Phasors, Array, Array], Directions],
) -> tuple[Directions, Cells]:
    """Return the directions of peaks with those of targets on the peaks' flanks, and the cell of each, peak by peak.

    Parameters
    ----------
    manifold : Manifold
    found : Directions
        Of the peaks.
    cells : Cells
        The peaks of the summed power, of a map of even chirps.
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        From :func:`~scarl_sionna.signal.processing.uncompensated` [sqrt(W)].
    noise_power : float
        Of a cell of one channel [W].
    search : callable
        From snapshots (n, num_virtual) [sqrt(W)], distances (n,) [m] and the noise of their values (n,) [W] to their
        directions, see :func:`~scarl_sionna.signal.direction.several.pursue`.

    Returns
    -------
    found : Directions
        `cell` is the peak, also of those beside it.
    cells : Cells
        One for each direction.

    Notes
    -----
    By definition. The targets beside get their own range and Doppler, where the directions are searched anew; of these
    the one nearest to what was seen in the cell is the target's. If it is the only one, the peak's is kept out of it
    all the same: noise may hide what is left of that. What the peak itself shows of the target, in a sidelobe of its
    tone, is no further direction then.
    """
    flank = _beside(cells, data, manifold, found.sines[found.is_first], noise_power)
    if not len(flank.peak):
        return found, cells.select(found.cell)
    located, snapshot, deviation = at_targets(flank.cells, data, flank.weights, noise_power)
    more = search(snapshot, located.distance, deviation)
    away = _apart(more.sines, flank.sines[more.cell], manifold)
    least = np.full(len(flank.peak), np.inf)
    np.minimum.at(least, more.cell, away)
    own = (away <= _OWN) & (away == least[more.cell])
    alone = own & (np.bincount(more.cell, minlength=len(least)) == 1)[more.cell]
    stronger = found.sines[found.is_first][flank.peak[more.cell]]
    shielded = _away_from(manifold, more.sines, stronger, located.distance[more.cell])
    more = replace(more, weights=np.where(alone[:, None], shielded, more.weights)).select(own)
    again = (_apart(found.sines[:, None], flank.sines[more.cell], manifold) <= _OWN) & (
        found.cell[:, None] == flank.peak[more.cell]
    )
    found = found.select(found.is_first | ~again.any(axis=1))
    cell, located = flank.peak[more.cell], located.select(more.cell)
    order = np.argsort(np.concatenate([found.cell, cell]), kind="stable")
    return Directions.joined([found, replace(more, cell=cell)]), Cells.joined(cells.select(found.cell), located).select(
        order
    )


def _apart(some: Array, others: Array, manifold: Manifold) -> Array:
    """Return by how many beamwidths directions (..., 2) differ, the larger of both axes."""
    return np.asarray(np.max(np.abs(some - others) / resolution(manifold), axis=-1))


def _beside(
    cells: Cells, data: npt.NDArray[np.complex64], manifold: Manifold, sines: Array, noise_power: float
) -> _Beside:
    r"""Return the cells on the flanks of peaks that hold a target in another direction.

    Parameters
    ----------
    cells : Cells
        The peaks of the summed power, of a map of even chirps.
    data : ndarray of complex64, shape (num_virtual, num_doppler_bins, num_range_bins)
        From :func:`~scarl_sionna.signal.processing.uncompensated` [sqrt(W)].
    manifold : Manifold
    sines : ndarray of float64, shape (num_targets, 2)
        Of the peaks' strongest directions.
    noise_power : float
        Of a cell of one channel [W].

    Returns
    -------
    _Beside

    Notes
    -----
    Around a peak every cell of its target has the same phasors a over the channels. These are projected out, and with
    them their derivative (p u) a over the channels' places p towards the target at u, which its range differing from
    channel to channel makes. What is left is a target's where it is a maximum over its neighbours, at most 2
    resolutions from the peak, at least a beamwidth from its direction, no more than 30 dB under it, and larger than
    noise would make it: :math:`\ln(24 N / p)` of the noise power after beamforming, N channels, 24 cells, p = 1e-4.

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 6.7 (null and derivative constraints).
    """
    radar, axes = cells.rd.radar, ToneAxis.of(cells.rd)
    peak, place, rest, level = [], [], [], []
    block = max(1, _VALUES_A_BLOCK // (len(data) * len(axes[0].offset) * len(axes[1].offset)))
    for first in range(0, len(sines), block):
        own = np.arange(first, min(first + block, len(sines)))
        values, base = patches(cells.select(own), data), _constraints(manifold, sines[own], cells.distance[own])
        middle = np.array([len(axis.offset) // 2 for axis in axes])
        whole = np.mean(np.abs(values[:, :, middle[0], middle[1]]) ** 2, axis=0)
        values = np.moveaxis(values, 0, -1)
        values = values - np.einsum("nabk,nkc->nabc", np.einsum("nabc,nkc->nabk", values, np.conj(base)), base)
        row, *where = np.nonzero(_is_inner_peak(np.sum(np.abs(values) ** 2, axis=-1), middle))
        peak.append(own[row])
        place.append(np.stack([axis.offset[index] for axis, index in zip(axes, where, strict=True)], axis=1))
        rest.append(values[row, where[0], where[1]])
        level.append(whole[row])
    if not peak:
        none = np.zeros(0, dtype=np.int64)
        return _Beside(none, cells.select(none), np.zeros((0, 2)), np.zeros((0, len(data)), dtype=np.complex128))
    number, snapshot = np.concatenate(peak), np.concatenate(rest)
    moved = _moved(cells.select(number), np.concatenate(place))
    distance = moved.distance
    towards = manifold.strongest(snapshot, distance)
    power = manifold.power(snapshot, towards, distance)
    noise = noise_power * np.log(_CELLS * radar.num_virtual / _FALSE_TARGET) / radar.num_virtual
    strong = power > np.maximum(noise, 10.0 ** (-DYNAMIC_RANGE_DB / 10.0) * np.concatenate(level))
    apart = _apart(towards, sines[number], manifold) >= _NEAREST
    kept = strong & apart & (np.abs(towards) < 1.0).all(axis=1) & _is_alone(cells, moved, number)
    index = np.flatnonzero(kept)
    index = index[_first_of_neighbours(moved.select(index), power[index])]
    weights = _away_from(manifold, towards[index], sines[number[index]], distance[index])
    return _Beside(number[index], moved.select(index), towards[index], weights)


def _away_from(manifold: Manifold, sines: Array, others: Array, distance: Array) -> Phasors:
    """Return weights (n, num_virtual) that are 1 towards directions (n, 2) and 0 towards others (n, 2)."""
    both = np.stack([sines, others], axis=1)
    beams = manifold.phasors(both, np.broadcast_to(distance[:, None], both.shape[:2]))
    return separating_weights(beams)[:, 0]


def _constraints(manifold: Manifold, sines: Array, distance: Array) -> Phasors:
    """Return an orthonormal base (n, 2, num_virtual) of phasors and their derivative over the channels' ranges."""
    beam = manifold.phasors(sines, distance)
    along = manifold.unit(sines) @ manifold.positions.T
    along = along - along.mean(axis=1, keepdims=True)
    size = np.linalg.norm(along, axis=1, keepdims=True)
    # towards the broadside of a line there is no difference over the channels; the places themselves will do
    flat = manifold.positions[:, 1 if 0 in manifold.axes else 2]
    along = np.where(size > 1e-3 * np.linalg.norm(flat - flat.mean()), along, flat - flat.mean())
    both = np.stack([beam, along * beam], axis=1)
    return np.asarray(both / np.maximum(np.linalg.norm(both, axis=2, keepdims=True), 1e-300))


def _is_inner_peak(power: Array, middle: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which cells within reach of the middle, not itself, are larger than their neighbours, (n, a, b)."""
    wide = np.pad(power, ((0, 0), (1, 1), (1, 1)))
    rows, columns = power.shape[1:]
    out = np.ones(power.shape, dtype=bool)
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                out &= power > wide[:, down : down + rows, right : right + columns]
    away = np.maximum(np.abs(np.arange(rows) - middle[0])[:, None], np.abs(np.arange(columns) - middle[1]))
    return out & (away > 0) & (away <= _REACH)


def _moved(cells: Cells, place: npt.NDArray[np.int64]) -> Cells:
    """Return cells moved by whole bins over Doppler and range as they are before the compensation of motion."""
    rd = cells.rd
    beat: Array = np.rint(beat_place(cells)) + place[:, 1]
    row = cells.row + place[:, 0]
    rows = len(rd.radial_velocity)
    middle = np.zeros(len(row)), np.zeros(len(row))
    here = replace(cells, row=row % rows, fold=cells.fold + row // rows, offset=middle)
    shift = bins_a_hertz(rd.radar, rd.data.shape[2]) if rd.is_compensated else 0.0
    beat = beat - shift * replace(here, fold=np.zeros_like(here.fold)).doppler
    column = np.rint(beat).astype(np.int64)
    return replace(here, column=column, offset=(middle[0], beat - column)).wrapped()


def _is_alone(peaks: Cells, cells: Cells, number: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Return which cells, each beside a peak, lie on the range axis and have no other peak within one resolution."""
    steps = [np.abs(np.diff(axis.offset)).min(initial=1) for axis in ToneAxis.of(cells.rd)]
    near = _near(cells, peaks, steps)
    near[np.arange(len(number)), number] = False
    return np.asarray((cells.column >= 0) & (cells.column < cells.rd.data.shape[2]) & ~near.any(axis=1))


def _near(some: Cells, others: Cells, steps: list[int]) -> npt.NDArray[np.bool_]:
    """Return which cells are within a resolution of which others, shape (len(some), len(others))."""
    rows = len(some.rd.radial_velocity)
    over = np.abs(some.row[:, None] - others.row)
    along = np.abs(some.column[:, None] - others.column)
    return np.asarray((np.minimum(over, rows - over) <= steps[0]) & (along <= steps[1]))


def _first_of_neighbours(cells: Cells, power: Array) -> npt.NDArray[np.int64]:
    """Return the cells that have no stronger one within a resolution: one target beside two peaks is one."""
    steps = [np.abs(np.diff(axis.offset)).min(initial=1) for axis in ToneAxis.of(cells.rd)]
    near = _near(cells, cells, steps)
    order = np.argsort(-power, kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return np.flatnonzero(~(near & (rank < rank[:, None])).any(axis=1))
