"""A volume of scatterers as a lattice of Gaussian cells: one point a cell of range, direction and radial velocity.

A point whose amplitude is circular normal makes every signal that it takes part in normal. What is left of the spread
of a cell's mean comes from where points stand, and a lattice as fine as the resolution has none: the squared Dirichlet
kernels of a lattice add up to a constant (Parseval), whatever the window.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from scarl_sionna.core.specs.radar.spec import RadarSpec

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.intp]

FINE = 4
"""Bins of the velocity spectrum in a cell: between them it is linear."""
TAIL = 6.0
"""Standard deviations of the turbulence that the spectrum reaches; 2e-9 of the power is beyond."""
MOST_PARTS = 8
"""Of a velocity cell, where the frame is so short that turbulence spreads less than two of them."""
CANDIDATES = 8
"""Directions out of which one is drawn that goes with a cell's velocity."""
ROWS_PER_OCTAVE = 8
"""Rows of the lattice in a doubling of the range at least, near the radar, where the mean falls within a cell."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """What fills the air, seen along directions.

    Attributes
    ----------
    direction : ndarray of float64, shape (num_directions, 3)
        Unit vectors [radar frame].
    weight : ndarray of float64, shape (num_directions,)
        Two-way gain times solid angle [sr].
    free : ndarray of float64, shape (num_directions,)
        Distance to the first surface [m].
    velocity : ndarray of float64, shape (num_directions, num_classes)
        Mean radial velocity of each class of drops, opening positive [m/s].
    share : ndarray of float64, shape (num_classes,)
        Of the reflectivity, by class; they sum to 1.
    spread : float
        Standard deviation of the radial velocity about these means [m/s].
    """

    direction: Array
    weight: Array
    free: Array
    velocity: Array
    share: Array
    spread: float


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the lattice over range.

    Attributes
    ----------
    distance : ndarray of float64, shape (num_rows,)
        Rising [m].
    strength : ndarray of float64, shape (num_rows,)
        Mean power a steradian [W/sr].
    """

    distance: Array
    strength: Array

    def select(self, chosen: Index) -> Rows:
        """Return some of the rows."""
        return Rows(self.distance[chosen], self.strength[chosen])


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of a lattice that were kept, arrays over cells.

    Attributes
    ----------
    distance, velocity : ndarray of float64, shape (num_cells,)
        [m]; radial, opening positive [m/s].
    direction : ndarray of float64, shape (num_cells, 3)
        Unit vectors [radar frame].
    power : ndarray of float64, shape (num_cells,)
        Mean, in the unit of the rows' `strength` times sr; raised where only some of the cells of this power are kept.
    """

    distance: Array
    velocity: Array
    direction: Array
    power: Array


def range_rows(step: float, nearest: float, reach: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the distances of the lattice's rows [m], rising, and how much of the range each stands for [m].

    A row a range bin; near the radar more, `ROWS_PER_OCTAVE` of them. The lattice is shifted at random, so that the
    mean over shifts of any sum over rows is the integral.
    """
    edges: list[float] = [reach]
    while edges[-1] > nearest:
        zone = ROWS_PER_OCTAVE * step / 2.0 ** (len(edges) - 1)
        edges.append(max(nearest, min(edges[-1], zone)))
    rows: list[Array] = []
    widths: list[Array] = []
    for level in range(len(edges) - 1):
        fine = step / 2.0**level
        first = np.ceil(edges[level + 1] / fine - (shift := rng.random()))
        middle = fine * (np.arange(first, np.ceil(edges[level] / fine - shift)) + shift)
        rows.append(np.asarray(middle[::-1], dtype=np.float64))
        widths.append(np.full(len(middle), fine, dtype=np.float64))
    return np.concatenate(rows)[::-1].copy(), np.concatenate(widths)[::-1].copy()


def direction_steps(radar: RadarSpec) -> tuple[float, float]:
    """Return how far apart directions of the lattice are, in the direction's y and z component; inf: not resolved.

    By definition the wavelength over the length of the virtual array: its extent and half a wavelength more, so that a
    uniform line at half a wavelength has as many directions as elements.
    """
    virtual = (radar.tx_array[:, None] + radar.rx_array[None]).reshape(-1, 3)
    extent = np.ptp(virtual, axis=0)
    y, z = (radar.wavelength / (size + radar.wavelength / 2.0) if size > 0.0 else np.inf for size in extent[1:])
    return float(y), float(z)


def gaussian_cells(
    scatter: Scatter, radar: RadarSpec, rows: Rows, weakest: float, most: int, rng: np.random.Generator
) -> Cells:
    """Return the cells of a volume, each with its mean power.

    Parameters
    ----------
    scatter : Scatter
    radar : RadarSpec
        Its resolutions are the cells.
    rows : Rows
    weakest : float
        Cells weaker than this [W] are drawn with the probability of their power over it, and get this power: the mean
        stays exact.
    most : int
        About so many cells at most; more are thinned in the same way, the weakest first.
    rng : numpy.random.Generator

    Notes
    -----
    Lattices of every other row are shifted by half a cell against each other over directions, those over velocity at
    random for each row and direction: the power of a cell stays even, and the correlation over antennas and chirps is
    right up to the whole array and frame.
    """
    steps = direction_steps(radar)
    parts = min(np.ceil(radar.velocity_resolution / max(2.0 * scatter.spread, 1e-9)), MOST_PARTS)
    step = radar.velocity_resolution / max(parts, 1.0)
    found: list[tuple[npt.NDArray[Any], ...]] = []
    offset = rng.random(2)
    for parity in (0, 1):
        lattice = np.array(offset + 0.5 * parity)
        cell = np.stack(
            [
                np.floor(scatter.direction[:, axis + 1] / steps[axis] - lattice[axis])
                if np.isfinite(steps[axis])
                else np.zeros(len(scatter.weight))
                for axis in (0, 1)
            ]
            + [scatter.direction[:, 0] < 0.0],
            axis=1,
        )
        chosen = np.arange(parity, len(rows.distance), 2)
        order = np.lexsort(cell.T)
        changes = np.flatnonzero(np.any(np.diff(cell[order], axis=0) != 0, axis=1)) + 1
        for members in np.split(order, changes) if len(chosen) and len(order) else []:
            row, member, velocity, power = _one_direction(scatter, members, rows.select(chosen), step, weakest, rng)
            middle = [(cell[members[0], axis] + lattice[axis] + 0.5) * steps[axis] for axis in (0, 1)]
            found.append((chosen[row], member, velocity, power, *(np.full(len(row), value) for value in middle)))
    if not found:
        return Cells(np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    row, member, velocity, power, y, z = (np.concatenate(column) for column in zip(*found, strict=True))
    kept, power = thinned(power, most, rng)
    direction = _on_lattice(scatter.direction[member[kept]], y[kept], z[kept])
    return Cells(rows.distance[row[kept]], velocity[kept], direction, power)


def _one_direction(
    scatter: Scatter, members: Index, rows: Rows, step: float, weakest: float, rng: np.random.Generator
) -> tuple[Index, Index, Array, Array]:
    """Return row, one of the `members` [direction], velocity and power of the cells of one direction that are kept."""
    count = len(rows.distance)
    seen = np.searchsorted(rows.distance, scatter.free[members])  # rows before the first surface
    order = np.argsort(-seen, kind="stable")
    members, seen = members[order], seen[order]
    number = np.searchsorted(-seen, -np.arange(count), side="left")  # members that are free at each row
    weight = np.concatenate([[0.0], np.cumsum(scatter.weight[members])])
    cumulated, lowest = _spectra(scatter, members, seen, count, step / FINE)
    shift = rng.random(count) * FINE
    last = cumulated.shape[1] - 1
    middle = shift[:, None] + FINE * (np.arange(last // FINE + 3) - 0.5)
    half = FINE / 2.0 if scatter.spread < step / 2.0 else 0.5  # a narrow spectrum would fall between the points
    mean = _at(cumulated, middle + half) - _at(cumulated, middle - half)
    mean *= rows.strength[:, None] * (FINE / (2.0 * half))
    chance = np.minimum(mean / weakest, 1.0)
    row, column = np.nonzero(rng.random(mean.shape) < chance)
    velocity = lowest + step / FINE * middle[row, column]
    free = _Free(members, weight, number)
    return row, _drawn(scatter, free, row, velocity, step, rng), velocity, mean[row, column] / chance[row, column]


@dataclass(frozen=True, eq=False)
class _Free:
    """Directions from that which is free farthest on, their cumulated weights, how many are free at each row."""

    members: Index
    weight: Array
    number: Index


def _drawn(scatter: Scatter, free: _Free, row: Index, velocity: Array, step: float, rng: np.random.Generator) -> Index:
    """Return a direction for each cell, free there, drawn by its weight and how well it goes with the velocity."""
    shots = rng.random((len(row), CANDIDATES)) * free.weight[free.number[row]][:, None]
    member = np.searchsorted(free.weight, shots, side="right") - 1
    member = free.members[np.minimum(member, free.number[row][:, None] - 1)]
    kind = np.searchsorted(np.cumsum(scatter.share)[:-1], rng.random(member.shape), side="right")
    apart = (velocity[:, None] - scatter.velocity[member, kind]) / max(scatter.spread, step / 2.0)
    apart = apart**2
    fit = np.cumsum(np.exp(-0.5 * (apart - apart.min(axis=1, keepdims=True, initial=np.inf))), axis=1)
    one = np.sum(fit < rng.random((len(row), 1)) * fit[:, -1:], axis=1)
    return np.asarray(member[np.arange(len(row)), one], dtype=np.intp)


def _at(cumulated: Array, place: Array) -> Array:
    """Return cumulated spectra at places between their edges, linear; a row of places each, or the same spectrum."""
    last = cumulated.shape[1] - 1
    place = np.clip(place, 0.0, last)
    low = np.minimum(place.astype(np.intp), last - 1)
    line = np.minimum(np.arange(len(place)), len(cumulated) - 1)[:, None]
    start = cumulated[line, low]
    return np.asarray(start + (place - low) * (cumulated[line, low + 1] - start))


def _spectra(scatter: Scatter, members: Index, seen: Index, num_rows: int, step: float) -> tuple[Array, float]:
    """Return the weight [sr] below each edge of a velocity grid, and the first edge [m/s].

    Shape (num_rows, num_edges), or (1, num_edges) where nothing hides any member from any row.
    """
    values = scatter.velocity[members]
    share = scatter.weight[members][:, None] * scatter.share
    lowest = float(values.min())
    width = int((float(values.max()) - lowest) / step) + 1
    column = np.minimum(((values - lowest) / step).astype(np.intp), width - 1)
    hides = bool(np.any(seen < num_rows))
    line = (seen - 1 if hides else np.zeros_like(seen))[:, None]
    size = num_rows if hides else 1
    flat = (line * width + column)[line[:, 0] >= 0]
    spectrum = np.bincount(flat.ravel(), share[line[:, 0] >= 0].ravel(), size * width).reshape(size, width)
    spectrum = np.cumsum(spectrum[::-1], axis=0)[::-1]
    reach = int(np.ceil(TAIL * scatter.spread / step))
    if reach:
        edges = np.arange(width + 2 * reach + 1) - reach
        below = ndtr((edges[None] - np.arange(width)[:, None] - 0.5) * step / scatter.spread)
        return spectrum @ below, lowest - reach * step
    return np.concatenate([np.zeros((size, 1)), np.cumsum(spectrum, axis=1)], axis=1), lowest


def thinned(power: Array, most: int, rng: np.random.Generator) -> tuple[Index, Array]:
    """Return which cells are kept, about `most` of them, and their powers, raised so that the mean is exact.

    A cell is kept with the probability min(1, P / P_0); where it is weaker than P_0 it then has this power.
    """
    if len(power) <= most:
        return np.arange(len(power)), power
    level, step = float(power.max()), 0.5
    for _ in range(50):  # bisection of the logarithm of the threshold, from above: the sum falls as it rises
        lower = level * 2.0**-step if step >= 1e-3 else level
        level, step = (lower, step * 2.0) if np.minimum(power / lower, 1.0).sum() <= most else (level, step / 4.0)
    chance = np.minimum(power / level, 1.0)
    kept = np.flatnonzero(rng.random(len(power)) < chance)
    return kept, power[kept] / chance[kept]


def even_draws(number: int, axes: int, rng: np.random.Generator) -> Array:
    """Return points that fill the unit cube evenly, shifted at random, so that each is uniform; shape (number, axes).

    Powers of the root of x^(axes + 1) = x + 1, in (0, 1) and without an end of the interval.

    References
    ----------
    .. [1] H. Niederreiter, *Random Number Generation and Quasi-Monte Carlo Methods*, 1992, chapter 3 (sequences of
       multiples of irrational numbers).
    """
    root = 1.5
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (axes + 1))
    draws = (np.arange(1, number + 1)[:, None] * root ** -np.arange(1.0, axes + 1.0) + rng.random(axes)) % 1.0
    return np.asarray(np.clip(draws, 1e-12, 1.0 - 1e-12))


def _on_lattice(direction: Array, y: Array, z: Array) -> Array:
    """Return directions moved to the lattice's y and z, each where it is finite, on the same side of the radar."""
    up = np.where(np.isfinite(z), np.clip(z, -0.999, 0.999), direction[:, 2])
    most = 0.999 * np.sqrt(1.0 - np.minimum(up**2, 0.999))
    left = np.where(np.isfinite(y), np.clip(y, -most, most), np.clip(direction[:, 1], -most, most))
    ahead = np.sqrt(np.maximum(1.0 - left**2 - up**2, 1e-12))
    moved = np.stack([np.where(direction[:, 0] < 0.0, -ahead, ahead), left, up], axis=1)
    return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))
