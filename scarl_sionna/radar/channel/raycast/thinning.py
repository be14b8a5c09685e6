"""Fewer hits where a radar cannot tell them apart: the mean power of every resolution cell stays.

Rough hits have independent phases, so what a radar measures of many of them in one cell is speckle: a complex Gaussian
number whose variance is the sum of their powers. A few dozen of them make the same speckle as thousands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.raycast import RaycastSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.scene.materials.layers import Number

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_VELOCITY_CELLS = 1 << 16
"""Velocities so many cells apart share a number, which only an ambiguous velocity reaches: decides no accuracy."""


@dataclass(frozen=True)
class ResolutionCells:
    """Cells in range, radial velocity and direction, finer than a radar's resolution. Made by :meth:`of`."""

    range_width: float
    velocity_width: float
    cosine_widths: tuple[float, float]

    @classmethod
    def of(cls, radar: RadarSpec, knobs: RaycastSettings | None = None) -> ResolutionCells:
        """Return the cells of a radar, by default half a bin in each dimension."""
        knobs = knobs or RaycastSettings()
        tx, rx = radar.tx_array, radar.rx_array
        aperture = np.ptp(tx, axis=0) + np.ptp(rx, axis=0)
        resolution = radar.wavelength / np.maximum(aperture[1:], 1e-9)
        y_width, z_width = np.minimum(resolution / knobs.cells_per_resolution, knobs.widest_cosine)
        return cls(
            radar.range_resolution / knobs.cells_per_resolution,
            radar.velocity_resolution / knobs.cells_per_resolution,
            (float(y_width), float(z_width)),
        )

    def number(
        self, distance: Array, radial_velocity: Array, y: Array, z: Array, instance: npt.NDArray[np.int32]
    ) -> Index:
        """Return one number for each hit that is the same for hits of one instance in one cell.

        Parameters
        ----------
        distance : ndarray of float64, shape (num_hits,)
            [m].
        radial_velocity : ndarray of float64, shape (num_hits,)
            [m/s].
        y, z : ndarray of float64, shape (num_hits,)
            Direction cosines in the radar frame.
        instance : ndarray of int32, shape (num_hits,)
        """
        counts = *self.cosine_counts, int(instance.max(initial=0)) + 1
        return cell_number(_whole, self.sizes, counts, (distance, radial_velocity, y, z), instance.astype(np.int64))

    @property
    def sizes(self) -> tuple[float, float, float, float]:
        """Of a cell in range [m], radial velocity [m/s] and the cosines y and z."""
        return self.range_width, self.velocity_width, *self.cosine_widths

    @property
    def cosine_counts(self) -> tuple[int, int]:
        """How many cells there are in the cosines y and z."""
        y_width, z_width = self.cosine_widths
        return int(2.0 / y_width) + 2, int(2.0 / z_width) + 2


def cell_number(
    whole: Callable[[Number], Number],
    sizes: Sequence[Number],
    counts: Sequence[Number],
    place: Sequence[Number],
    instance: Number,
) -> Number:
    """Return the numbers of :meth:`ResolutionCells.number` for NumPy's arrays or the engine's.

    Parameters
    ----------
    whole : callable
        From float64 to the whole number at or below it, int64.
    sizes : sequence of four numbers
        `ResolutionCells.sizes`.
    counts : sequence of three whole numbers
        Cells in the cosines y and z, and instances.
    place : sequence of four arrays
        Distance, radial velocity, y and z, as of :meth:`ResolutionCells.number`.
    instance
        As of :meth:`ResolutionCells.number`.
    """
    distance, radial_velocity, y, z = place
    number = whole(distance / sizes[0])
    number = number * _VELOCITY_CELLS + (whole(radial_velocity / sizes[1]) & (_VELOCITY_CELLS - 1))
    number = number * counts[0] + whole((y + 1.0) / sizes[2])
    number = number * counts[1] + whole((z + 1.0) / sizes[3])
    return number * counts[2] + instance


def _whole(value: Array) -> Index:
    return np.floor(value).astype(np.int64)


def thin(cell: Index, power: Array, hits_per_cell: int) -> tuple[Index, Array]:
    """Return which hits stay, and by how much their power grows.

    A cell of at most `hits_per_cell` hits is left as it is. Of a fuller one, as many are taken by systematic sampling
    along the running sum of its power, each with the same share of the cell's power; a hit that holds several shares is
    kept once, with all of them.

    Parameters
    ----------
    cell : ndarray of int64, shape (num_hits,)
    power : ndarray of float64, shape (num_hits,)
        Received power in any unit, > 0.
    hits_per_cell : int
        >= 1.

    Returns
    -------
    kept : ndarray of int64, shape (num_kept,)
        Rising.
    growth : ndarray of float64, shape (num_kept,)
        The sum of ``power[kept] * growth`` over a cell is the sum of `power` over it.
    """
    order, sorted_cell = _sorted(cell)
    ordered = np.take(power, order)
    if not len(order):
        return order, np.ones(0)
    starts = np.append(0, np.flatnonzero(sorted_cell[1:] != sorted_cell[:-1]) + 1)
    counts = np.diff(np.append(starts, len(order)))
    number = np.repeat(np.arange(len(starts)), counts)
    total = np.take(np.add.reduceat(ordered, starts), number)
    running = np.cumsum(ordered / total)  # grows by 1 a cell, so each cell's share is what is over the cells before
    running -= number
    running *= hits_per_cell
    running += 0.5
    points = np.floor(running, out=running)  # of the points (k + 1/2) / hits_per_cell of a cell, those below
    np.clip(points, 0, hits_per_cell, out=points)
    points[starts + counts - 1] = hits_per_cell  # rounding of the running sum must not lose or add a share
    shares = np.diff(points, prepend=0.0)
    shares[starts] = points[starts]
    full = np.take(counts > hits_per_cell, number)
    stays = np.flatnonzero(~full | (shares > 0.0))
    growth = np.where(full[stays], shares[stays] * total[stays] / (hits_per_cell * ordered[stays]), 1.0)
    in_place = np.zeros(len(cell))
    in_place[order[stays]] = growth
    kept = np.flatnonzero(in_place)
    return kept, in_place[kept]


def _sorted(cell: Index) -> tuple[Index, Index]:
    """Return the order of cells, those of one in the order in which they are, and the cells in it.

    With the place below the cell in one number, where both fit: numbers are sorted in a twentieth of the time of
    places.
    """
    bits = len(cell).bit_length()
    lowest, highest = (int(cell.min()), int(cell.max())) if len(cell) else (0, 0)
    if (highest - lowest).bit_length() + bits > 62:
        order = np.argsort(cell, kind="stable")
        return order, cell[order]
    both = np.sort(((cell - lowest) << bits) | np.arange(len(cell)))
    return both & ((1 << bits) - 1), (both >> bits) + lowest
