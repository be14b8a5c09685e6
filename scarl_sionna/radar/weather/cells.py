"""A volume of scatterers as a lattice of Gaussian cells: one point a cell of range, direction and radial velocity.

A point whose amplitude is circular normal makes every signal that it takes part in normal. What is left of the spread
of a cell's mean comes from where points stand, and a lattice as fine as the resolution has none: the squared Dirichlet
kernels of a lattice add up to a constant (Parseval), whatever the window.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

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
BLOCK = 1 << 20
"""Cells and bins of spectra that are computed at once; more where a single direction of the lattice has more."""
LEAST_PART = 512
"""Bins of a spectrum that turbulence is added to at once, at least."""
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
        Two-way gain times solid angle [sr], >= 0; directions of weight 0 have no cells.
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
    parts = min(np.ceil(radar.velocity_resolution / max(2.0 * scatter.spread, 1e-9)), MOST_PARTS)
    step = radar.velocity_resolution / max(parts, 1.0)
    lattice = _lattice(scatter, rows.distance, direction_steps(radar), step, rng)
    found = [_kept(scatter, lattice, levels, rows, weakest, rng) for levels in lattice.blocks()]
    if not found:
        return Cells(np.zeros(0), np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    level, row, velocity, power = (np.concatenate(column) for column in zip(*found, strict=True))
    kept, power = thinned(power, most, rng)
    level, velocity = level[kept], velocity[kept]
    member = _drawn(scatter, lattice, level, velocity, rng)
    direction = _on_lattice(scatter.direction[member], *lattice.middle[lattice.owner[level]].T)
    return Cells(rows.distance[row[kept]], velocity, direction, power)


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Directions sorted by the direction of a lattice that they belong to, in each from the one that is free farthest.

    What is free of one direction of a lattice is the same in several rows, which are a level.

    Attributes
    ----------
    member : ndarray of intp, shape (num_members,)
        Directions, each once in the lattice of even rows and once in that of odd ones.
    share, cumulated : ndarray of float64, shape (num_members,) and (num_members + 1,)
        Of the weight of the direction of the lattice.
    first : ndarray of intp, shape (num_lattice,)
        First member of each direction of the lattices.
    weight : ndarray of float64, shape (num_lattice,)
        Its two-way gain times solid angle [sr].
    middle : ndarray of float64, shape (num_lattice, 2)
        Its y and z component, infinite where they are not resolved.
    parity : ndarray of intp, shape (num_lattice,)
        0 for even rows, 1 for odd ones.
    lowest : ndarray of float64, shape (num_lattice,)
        Lowest mean radial velocity [m/s].
    width : ndarray of intp, shape (num_lattice,)
        Bins of the spectrum without turbulence.
    owner : ndarray of intp, shape (num_levels,)
        Direction of a lattice, by level.
    stop : ndarray of intp, shape (num_levels,)
        Free are its members before this one.
    nearest, farthest : ndarray of intp, shape (num_levels,)
        Rows of the lattice, the last not included.
    step : float
        Cell of velocity [m/s].
    tail : int
        Bins that turbulence adds at each end of a spectrum.
    """

    member: Index
    share: Array
    cumulated: Array
    first: Index
    weight: Array
    middle: Array
    parity: Index
    lowest: Array
    width: Index
    owner: Index
    stop: Index
    nearest: Index
    farthest: Index
    step: float
    tail: int

    def blocks(self) -> list[slice]:
        """Return runs of levels, whole directions of a lattice, of one or of `BLOCK` cells and bins at most.

        Every level of a run takes as many bins as the widest.
        """
        begin = np.append(np.flatnonzero(np.diff(self.owner, prepend=-1)), len(self.owner))
        num_rows = np.diff(np.append(0, np.cumsum(self.farthest - self.nearest))[begin])
        starts, rows, widest = list[int](), 0, 0
        for level, stop, more, width in zip(
            begin, begin[1:], num_rows, self.width[self.owner[begin[:-1]]], strict=False
        ):
            rows, widest = rows + int(more), max(widest, int(width))
            if not starts or self.size(stop - starts[-1], rows, widest) > BLOCK:
                starts, rows, widest = [*starts, int(level)], int(more), int(width)
        return [slice(*ends) for ends in pairwise([*starts, len(self.owner)])]

    def size(self, num_levels: int, num_rows: int, width: int) -> int:
        """Return the cells of rows, and bins of cumulated and other spectra of levels, of the bins of the widest."""
        edges = width + 2 * self.tail + 1
        return num_rows * (edges // FINE + 3) + 2 * num_levels * edges


def _lattice(
    scatter: Scatter, distance: Array, steps: tuple[float, float], step: float, rng: np.random.Generator
) -> _Lattice:
    """Return lattices of directions, `steps` apart at a random place, for rows at a `distance` [m]."""
    place = rng.random(2) + np.array([[0.0], [0.5]])
    is_resolved = np.isfinite(steps)
    both = np.zeros((2, len(scatter.weight), 4))
    both[..., :2] = np.where(is_resolved, np.floor(scatter.direction[:, 1:] / steps - place[:, None]), 0.0)
    both[..., 2] = scatter.direction[:, 0] < 0.0
    both[1, :, 3] = 1.0
    row = np.concatenate([np.searchsorted(distance[parity::2], scatter.free) for parity in (0, 1)])
    cell = both.reshape(-1, 4)
    order = np.lexsort((-row, *cell.T))
    order = order[(row[order] > 0) & (np.tile(scatter.weight, 2)[order] > 0.0)]  # rows before the first surface
    cell, row, member = cell[order], row[order], order % max(len(scatter.weight), 1)
    is_first = np.any(np.diff(cell, axis=0, prepend=np.nan) != 0.0, axis=1)
    first, begin = np.flatnonzero(is_first), np.flatnonzero(is_first | (np.diff(row, prepend=-1) != 0))
    of = np.cumsum(is_first) - 1
    weight = np.add.reduceat(scatter.weight[member], first)
    share = scatter.weight[member] / weight[of]
    values = scatter.velocity[member]
    lowest, highest = np.minimum.reduceat(values.min(axis=1), first), np.maximum.reduceat(values.max(axis=1), first)
    parity = cell[first, 3].astype(np.intp)
    is_last = np.diff(of[begin], append=-1) != 0
    return _Lattice(
        member=member,
        share=share,
        cumulated=np.concatenate([[0.0], np.cumsum(share)]),
        first=first,
        weight=weight,
        middle=(cell[first, :2] + place[parity] + 0.5) * steps,
        parity=parity,
        lowest=lowest,
        width=((highest - lowest) / (step / FINE)).astype(np.intp) + 1,
        owner=of[begin],
        stop=np.append(begin[1:], len(member)),
        nearest=np.where(is_last, 0, np.append(row[begin][1:], 0)),
        farthest=row[begin],
        step=step,
        tail=int(np.ceil(TAIL * scatter.spread / (step / FINE))),
    )


def _kept(
    scatter: Scatter, lattice: _Lattice, levels: slice, rows: Rows, weakest: float, rng: np.random.Generator
) -> tuple[Index, Index, Array, Array]:
    """Return level, row, velocity and power of the cells of some levels that are kept.

    One random number decides of each cell, first by the strongest that any cell of its row may be: few are computed.
    """
    cumulated = _spectra(scatter, lattice, levels)
    last = cumulated.shape[1] - 1
    half = FINE / 2.0 if scatter.spread < lattice.step / 2.0 else 0.5  # a narrow spectrum would fall between the points
    edge = np.arange(last)
    peak = (cumulated[:, np.minimum(edge + round(2.0 * half), last)] - cumulated[:, edge]).max(axis=1)
    owner = lattice.owner[levels]
    counts = lattice.farthest[levels] - lattice.nearest[levels]
    level = np.repeat(np.arange(len(owner)), counts)
    row = np.arange(len(level)) - np.repeat(np.cumsum(counts) - lattice.farthest[levels], counts)
    row = 2 * row + lattice.parity[owner[level]]
    shift = rng.random(len(row)) * FINE
    scale = rows.strength[row] * lattice.weight[owner[level]] * (FINE / (2.0 * half) / weakest)
    draw = rng.random((len(row), last // FINE + 3))
    chosen, column = np.nonzero(draw < (scale * peak[level])[:, None])
    middle = shift[chosen] + FINE * (column - 0.5)
    chance = scale[chosen] * (
        _at(cumulated, level[chosen], middle + half) - _at(cumulated, level[chosen], middle - half)
    )
    kept = draw[chosen, column] < chance
    chosen, middle, chance = chosen[kept], middle[kept], chance[kept]
    level = level[chosen]
    lowest = lattice.lowest[owner[level]] - lattice.tail * (lattice.step / FINE)
    velocity = lowest + lattice.step / FINE * middle
    return level + levels.start, row[chosen], velocity, weakest * np.maximum(chance, 1.0)


def _drawn(scatter: Scatter, lattice: _Lattice, level: Index, velocity: Array, rng: np.random.Generator) -> Index:
    """Return a direction for each cell, free there, drawn by its weight and how well it goes with the velocity."""
    first, stop = lattice.first[lattice.owner[level]][:, None], lattice.stop[level][:, None]
    low, high = lattice.cumulated[first], lattice.cumulated[stop]
    shots = low + rng.random((len(level), CANDIDATES)) * (high - low)
    place = np.searchsorted(lattice.cumulated, shots, side="right") - 1
    member = lattice.member[np.clip(place, first, stop - 1)]
    kind = np.searchsorted(np.cumsum(scatter.share)[:-1], rng.random(member.shape), side="right")
    apart = (velocity[:, None] - scatter.velocity[member, kind]) / max(scatter.spread, lattice.step / 2.0)
    apart = apart**2
    fit = np.cumsum(np.exp(-0.5 * (apart - apart.min(axis=1, keepdims=True, initial=np.inf))), axis=1)
    one = np.sum(fit < rng.random((len(level), 1)) * fit[:, -1:], axis=1)
    return np.asarray(member[np.arange(len(level)), one], dtype=np.intp)


def _at(cumulated: Array, level: Index, place: Array) -> Array:
    """Return cumulated spectra of levels at places between their edges, linear."""
    last = cumulated.shape[1] - 1
    place = np.clip(place, 0.0, last)
    low = np.minimum(place.astype(np.intp), last - 1)
    start = cumulated[level, low]
    return np.asarray(start + (place - low) * (cumulated[level, low + 1] - start))


def _spectra(scatter: Scatter, lattice: _Lattice, levels: slice) -> Array:
    """Return the part of a lattice's direction that is free and below each edge of its velocity grid.

    Shape (num_levels, num_edges); the first edge is `tail` bins below the lowest mean velocity.
    """
    owner, stop, step = lattice.owner[levels], lattice.stop[levels], lattice.step / FINE
    members = slice(lattice.first[owner[0]], stop[-1])
    level = np.searchsorted(stop, np.arange(members.start, members.stop), side="right")
    values = scatter.velocity[lattice.member[members]] - lattice.lowest[owner[level]][:, None]
    width = int(lattice.width[owner].max())
    flat = level[:, None] * width + (values / step).astype(np.intp)
    share = lattice.share[members, None] * scatter.share
    spectrum = np.cumsum(np.bincount(flat.ravel(), share.ravel(), len(stop) * width).reshape(-1, width), axis=0)
    begin = np.searchsorted(owner, owner)  # the first level of the same direction
    spectrum -= np.concatenate([np.zeros((1, width)), spectrum])[begin]
    if lattice.tail:
        return _smeared(np.asarray(spectrum, dtype=np.float64), lattice.tail, step / scatter.spread)
    return np.concatenate([np.zeros((len(stop), 1)), np.cumsum(spectrum, axis=1)], axis=1)


def _smeared(spectrum: Array, tail: int, step: float) -> Array:
    """Return what is below each edge of spectra with turbulence; `step`: a bin in its standard deviations.

    A part of the bins at a time, of which all is below the edges that are `tail` bins and more beyond.
    """
    width, reach = spectrum.shape[1], 2 * tail + 1
    part = min(width, max(reach, LEAST_PART))
    below = ndtr((np.arange(-tail, part + tail + 1)[None] - np.arange(part)[:, None] - 0.5) * step)
    cumulated = np.zeros((len(spectrum), width + reach))
    for start in range(0, width, part):
        bins = spectrum[:, start : start + part]
        end = bins.shape[1] + reach
        cumulated[:, start : start + end] += bins @ below[: bins.shape[1], :end]
        cumulated[:, start + end :] += bins.sum(axis=1, keepdims=True)
    return cumulated


def thinned(power: Array, most: int, rng: np.random.Generator) -> tuple[Index, Array]:
    """Return which cells are kept, about `most` of them, and their powers, raised so that the mean is exact.

    A cell is kept with the probability min(1, P / P_0); where it is weaker than P_0 it then has this power.
    """
    if len(power) <= most:
        return np.arange(len(power)), power
    rising = np.sort(power)
    left = most - np.arange(most)  # besides the strongest, which are kept for certain
    rest = np.cumsum(rising)[::-1][:most] / left
    level = rest[np.argmax(rising[::-1][:most] <= rest)]
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
