"""The polar grid that networks answer on: road users as heat maps with offsets, and back.

References
----------
.. [1] X. Zhou, D. Wang, P. Krähenbühl, "Objects as Points", 2019: heat maps of centres, offsets, peaks as detections.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.dataset.statistics.groups import GROUP_NAMES

Array = npt.NDArray[np.float32]

CLASSES = GROUP_NAMES
"""Classes by number: car, large vehicle, two-wheeler, pedestrian."""
HEAT_RADIUS = 0.8
"""Standard deviation of an object's heat around its centre [m], about half the width of a car."""


@dataclass(frozen=True)
class PolarGrid:
    """Cells of equal range and equal sine of azimuth, as a radar with a line of antennas sees them.

    Parameters
    ----------
    num_range, num_sine : int
    range_step : float
        [m]; the first cell begins at the radar.
    max_sine : float
        Of azimuth; the first cell begins at its negative (right), the last one ends at it (left).
    """

    num_range: int = 80
    num_sine: int = 48
    range_step: float = 0.8
    max_sine: float = 0.75

    @property
    def shape(self) -> tuple[int, int]:
        """Cells along range and along the sine of azimuth."""
        return self.num_range, self.num_sine

    @property
    def max_range(self) -> float:
        """Where the last cell ends [m]."""
        return self.num_range * self.range_step

    @property
    def sine_step(self) -> float:
        """Width of a cell in the sine of azimuth."""
        return 2.0 * self.max_sine / self.num_sine

    def coarser(self, factor: int) -> PolarGrid:
        """Return the grid over the same area with cells that are wider by a factor."""
        return PolarGrid(self.num_range // factor, self.num_sine // factor, self.range_step * factor, self.max_sine)

    def coordinates(self, places: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return where points (N, 2) [m, x forward and y left] lie, in cells along range and sine, shape (N, 2)."""
        x, y = np.asarray(places, np.float64).reshape(-1, 2).T
        distance = np.hypot(x, y)
        sine = y / np.maximum(distance, 1e-9)
        return np.stack([distance / self.range_step, (sine + self.max_sine) / self.sine_step], axis=1)

    def places(self, coordinates: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Return the points (N, 2) [m] in front of the radar that have the coordinates (N, 2)."""
        along, across = np.asarray(coordinates, np.float64).reshape(-1, 2).T
        distance, sine = along * self.range_step, np.clip(across * self.sine_step - self.max_sine, -1.0, 1.0)
        return np.stack([distance * np.sqrt(1.0 - sine**2), distance * sine], axis=1)

    def inside(self, places: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which points (N, 2) [m] lie in a cell."""
        x = np.asarray(places, np.float64).reshape(-1, 2)[:, 0]
        along, across = self.coordinates(places).T
        return (x > 0) & (along < self.num_range) & (across >= 0) & (across < self.num_sine)

    def centers(self) -> npt.NDArray[np.float64]:
        """Return the middle of every cell [m], shape (num_range, num_sine, 2)."""
        along, across = np.meshgrid(np.arange(self.num_range) + 0.5, np.arange(self.num_sine) + 0.5, indexing="ij")
        return self.places(np.stack([along.ravel(), across.ravel()], axis=1)).reshape(*self.shape, 2)


@dataclass(frozen=True, eq=False)
class Objects:
    """Road users, or detections of them.

    Attributes
    ----------
    places : ndarray of float64, shape (N, 2)
        Centres, x forward and y left of the radar [m].
    kinds : ndarray of int64, shape (N,)
        Index into `CLASSES`.
    scores : ndarray of float64, shape (N,)
        0 to 1; 1 for what is there.
    """

    places: npt.NDArray[np.float64]
    kinds: npt.NDArray[np.int64]
    scores: npt.NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.kinds)

    def chosen(self, which: npt.NDArray[np.bool_]) -> Objects:
        """Return some of them."""
        return Objects(self.places[which], self.kinds[which], self.scores[which])

    @property
    def distance(self) -> npt.NDArray[np.float64]:
        """From the radar [m]."""
        return np.hypot(*self.places.T)


def encode(grid: PolarGrid, objects: Objects) -> tuple[Array, Array, Array]:
    """Return what a network is to answer for a frame.

    Parameters
    ----------
    grid : PolarGrid
    objects : Objects
        All inside of the grid; of two with their centres in one cell the later one gives the offset.

    Returns
    -------
    heat : ndarray of float32, shape (num_range, num_sine, num_classes)
        1 in the cell of a centre; around it a Gaussian of the distance [m] between the cell's middle and the centre.
    offset : ndarray of float32, shape (num_range, num_sine, 2)
        Where in its cell a centre lies, 0 to 1 along range and sine; 0 elsewhere.
    holds : ndarray of float32, shape (num_range, num_sine)
        1 where a cell holds a centre.
    """
    heat = np.zeros((*grid.shape, len(CLASSES)), np.float32)
    offset, holds = np.zeros((*grid.shape, 2), np.float32), np.zeros(grid.shape, np.float32)
    centers = grid.centers()
    for place, kind, where in zip(objects.places, objects.kinds, grid.coordinates(objects.places), strict=True):
        away = np.sum((centers - place) ** 2, axis=-1)
        heat[..., kind] = np.maximum(heat[..., kind], np.exp(-away / (2.0 * HEAT_RADIUS**2)))
        row, column = np.floor(where).astype(int)
        heat[row, column, kind], holds[row, column] = 1.0, 1.0
        offset[row, column] = where - (row, column)
    return heat, offset, holds


def decode(grid: PolarGrid, heat: Array, offset: Array, most: int = 40, least_score: float = 0.02) -> Objects:
    """Return the detections of a heat map: cells that none of their eight neighbours exceeds, best first.

    Parameters
    ----------
    grid : PolarGrid
    heat, offset : ndarray of float32
        As in :func:`encode`.
    most : int
        At most so many.
    least_score : float
        Below it a peak is no detection.
    """
    rows, columns = grid.shape
    padded = np.pad(heat, ((1, 1), (1, 1), (0, 0)), constant_values=-np.inf)
    around = np.max(
        [padded[row : row + rows, column : column + columns] for row in range(3) for column in range(3)], axis=0
    )
    found = np.argwhere((heat >= around) & (heat >= least_score))
    scores = heat[tuple(found.T)].astype(np.float64)
    best = np.argsort(-scores, kind="stable")[:most]
    row, column, kind = found[best].T
    where = np.stack([row, column], axis=1) + np.clip(offset[row, column], 0.0, 1.0)
    return Objects(grid.places(where), kind, scores[best])
