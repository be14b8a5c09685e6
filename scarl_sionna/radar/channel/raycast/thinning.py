"""Fewer hits where a radar cannot tell them apart: the mean power of every resolution cell stays.

Rough hits have independent phases, so what a radar measures of many of them in one cell is speckle: a complex Gaussian
number whose variance is the sum of their powers. A few dozen of them make the same speckle as thousands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.raycast import RaycastSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec

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
        y_width, z_width = self.cosine_widths
        velocity = np.floor(radial_velocity / self.velocity_width).astype(np.int64) % _VELOCITY_CELLS
        columns = (
            (np.floor(distance / self.range_width).astype(np.int64), None),
            (velocity, _VELOCITY_CELLS),
            (np.floor((y + 1.0) / y_width).astype(np.int64), int(2.0 / y_width) + 2),
            (np.floor((z + 1.0) / z_width).astype(np.int64), int(2.0 / z_width) + 2),
            (instance.astype(np.int64), int(instance.max(initial=0)) + 1),
        )
        number = columns[0][0]
        for column, count in columns[1:]:
            number = number * count + column
        return number


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
    order = np.argsort(cell, kind="stable")
    ordered = power[order]
    starts = np.flatnonzero(np.diff(cell[order], prepend=cell[order[:1]] - 1))
    counts = np.diff(np.append(starts, len(order)))
    totals = np.add.reduceat(ordered, starts) if len(starts) else np.zeros(0)
    owner = np.repeat(np.arange(len(starts)), counts)
    running = np.cumsum(ordered / totals[owner])  # grows by 1 a cell, so each cell's share is its fractional part
    before = running - ordered / totals[owner]
    base = np.arange(len(starts))[owner]
    shares = _points_below(running - base, hits_per_cell) - _points_below(before - base, hits_per_cell)
    last = starts + counts - 1
    if len(starts):  # rounding of the running sum must not lose or add a share at a cell's ends
        shares[last] += hits_per_cell - np.add.reduceat(shares, starts)
    full = counts[owner] > hits_per_cell
    growth = np.where(full, shares * totals[owner] / (hits_per_cell * ordered), 1.0)
    stays = np.flatnonzero(growth > 0.0)
    kept = order[stays]
    rising = np.argsort(kept)
    return kept[rising], growth[stays][rising]


def _points_below(share: Array, count: int) -> Index:
    """Return how many of the points (k + 1/2) / count lie below a share of the whole."""
    return np.clip(np.floor(share * count + 0.5), 0, count).astype(np.int64)
