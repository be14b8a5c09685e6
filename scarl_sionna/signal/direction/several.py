"""Several directions in one cell, from a single snapshot: as many as an information criterion asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec

from . import subspace
from .bartlett import bartlett_sines
from .manifold import Manifold

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]

Method = Literal["relax", "omp", "bartlett", "music", "esprit"]
METHODS: tuple[str, ...] = get_args(Method)

FALSE_DIRECTION = 1e-3
"""Probability that noise makes one more direction in a cell."""
DYNAMIC_RANGE_DB = 30.0
"""Directions weaker than this under the strongest of their cell are left out: what an array's errors may make."""
_NEAREST = 0.25
"""Directions nearer than this part of a beamwidth are one target, split."""
_SWEEPS = 24
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Directions:
    """Directions in cells, those of one cell one after another, strongest first.

    Attributes
    ----------
    cell : ndarray of int64, shape (num_directions,)
        Which snapshot each is of, rising.
    sines : ndarray of float64, shape (num_directions, 2)
        Of azimuth and elevation.
    amplitude : ndarray of complex128, shape (num_directions,)
        In one channel [sqrt(W)].
    weights : ndarray of complex128, shape (num_directions, num_virtual)
        Of the channels: 1 towards the own direction, 0 towards the others of the cell.
    """

    cell: npt.NDArray[np.int64]
    sines: Array
    amplitude: Phasors
    weights: Phasors

    def select(self, index: npt.NDArray[np.integer] | npt.NDArray[np.bool_]) -> Directions:
        """Return some of the directions."""
        return Directions(self.cell[index], self.sines[index], self.amplitude[index], self.weights[index])

    @classmethod
    def joined(cls, parts: list[Directions]) -> Directions:
        """Return the directions of all parts in the order of their cells."""
        cell = np.concatenate([part.cell for part in parts])
        order = np.argsort(cell, kind="stable")
        sines, amplitude, weights = (
            np.concatenate([getattr(part, name) for part in parts])[order] for name in ("sines", "amplitude", "weights")
        )
        return cls(cell[order], sines, amplitude, weights)

    @property
    def is_first(self) -> npt.NDArray[np.bool_]:
        """Which directions are the strongest of their cell, shape (num_directions,)."""
        return np.asarray(np.diff(self.cell, prepend=-1) > 0)

    def is_within_range(self, power: Array) -> npt.NDArray[np.bool_]:
        """Return which directions of powers (num_directions,) are the first or not too far under their cell's largest.

        Too far is :data:`DYNAMIC_RANGE_DB`, by the powers given, which may be measured anew [W].
        """
        largest = np.zeros(int(self.cell.max(initial=-1)) + 1)
        np.maximum.at(largest, self.cell, power)
        return np.asarray(self.is_first | (power > 10.0 ** (-DYNAMIC_RANGE_DB / 10.0) * largest[self.cell]))


def check_method(method: str, radar: RadarSpec) -> None:
    """Raise if there is no such method, or not for the virtual array of a radar.

    Raises
    ------
    ParameterRangeError
        If so.
    """
    if method not in METHODS:
        raise ParameterRangeError("direction", repr(method), " or ".join(map(repr, METHODS)))
    if method in subspace.KINDS:
        subspace.line_of(radar, method)


def pursue(
    manifold: Manifold,
    snapshot: Phasors,
    distance: Array,
    noise_power: float | Array,
    most: int,
    method: Method = "relax",
) -> Directions:
    r"""Return the directions that explain snapshots down to the noise; the strongest one of each always.

    Parameters
    ----------
    manifold : Manifold
    snapshot : ndarray of complex128, shape (num_cells, num_virtual)
        [sqrt(W)].
    distance : ndarray of float64, shape (num_cells,)
        [m].
    noise_power : float or ndarray of float64, shape (num_cells,)
        Of one channel's value [W].
    most : int
        Largest number of directions of a cell, dimensionless.
    method : {"relax", "omp", "bartlett", "music", "esprit"}
        How a given number of directions is found.

    Returns
    -------
    Directions

    Raises
    ------
    ParameterRangeError
        If there is no such method for the array.

    Notes
    -----
    Orthogonal matching pursuit on the grid, every direction then refined in turn on what the others leave until nothing
    moves (RELAX), which for white noise climbs the likelihood. One more direction is taken while it explains
    more than noise would: :math:`\Delta > \ln(N / p)` of the noise power, N channels, p = 1e-3. This is an information
    criterion with known noise, whose penalty is set by a probability. It holds for any array, uniform or sparse. A
    further direction at an end of the angles (sine of 1) is none: what is left of more targets than directions is best
    explained beyond the real angles, and for a line of half a wavelength both ends are one.

    The other methods find directions differently and are asked for one more by the same criterion: ``"omp"`` does not
    refine in turn, ``"bartlett"`` takes the beamformer's largest maxima
    (:mod:`~scarl_sionna.signal.direction.bartlett`), ``"music"`` and ``"esprit"`` are of uniform lines
    (:mod:`~scarl_sionna.signal.direction.subspace`).

    References
    ----------
    .. [1] J. Li, P. Stoica, "Efficient mixed-spectrum estimation with applications to target feature extraction", IEEE
       Trans. Signal Process. 44(2), 1996.
    .. [2] J. A. Tropp, A. C. Gilbert, "Signal recovery from random measurements via orthogonal matching pursuit", IEEE
       Trans. Inf. Theory 53(12), 2007.
    """
    check_method(method, manifold.radar)
    sines = _of_whole(manifold, snapshot, distance, 1, method)
    parts = [_part(manifold, snapshot, distance, np.arange(len(snapshot)), sines)]
    penalty = np.log(manifold.radar.num_virtual / FALSE_DIRECTION) * np.broadcast_to(noise_power, len(snapshot))
    rows = np.arange(len(snapshot))
    limit = manifold.radar.num_virtual - 1
    if method in subspace.KINDS:
        limit = subspace.most_directions(manifold.radar.num_virtual)
    for number in range(1, min(most, limit) if manifold.axes else 0):
        rest = _rest(manifold, snapshot[rows], distance[rows], sines)
        next_one = manifold.strongest(rest, distance[rows])
        promising = manifold.power(rest, next_one, distance[rows]) > 0.25 * penalty[rows] / manifold.radar.num_virtual
        rows, sines, rest = rows[promising], sines[promising], rest[promising]
        if not len(rows):
            break
        if method in ("relax", "omp"):
            more = np.concatenate([sines, next_one[promising, None, :]], axis=1)
            if method == "relax":
                more = _relaxed(manifold, snapshot[rows], more, distance[rows])
        else:
            more = _of_whole(manifold, snapshot[rows], distance[rows], number + 1, method)
        amplitude, beams = _least_squares(manifold, snapshot[rows], more, distance[rows])
        left = snapshot[rows] - np.einsum("pk,pkc->pc", amplitude, beams)
        gained = _energy(rest) - _energy(left)
        size = np.abs(amplitude)
        better = (gained > penalty[rows]) & (size.min(axis=1) > 10.0 ** (-DYNAMIC_RANGE_DB / 20.0) * size.max(axis=1))
        better &= ~_too_near(manifold, more) & (np.abs(more) < 1.0).all(axis=(1, 2))
        rows, sines = rows[better], more[better]
        parts.append(_part(manifold, snapshot, distance, rows, sines))
    return _joined(parts, len(snapshot))


def _of_whole(manifold: Manifold, snapshot: Phasors, distance: Array, count: int, method: Method) -> Array:
    """Return the sines (n, count, 2) that a method finds at once; the beamformer's maximum for those that go on."""
    if method in subspace.KINDS and len(snapshot):
        return subspace.subspace_sines(manifold.radar, snapshot, count, method)
    if method == "bartlett" and count > 1:
        return bartlett_sines(manifold, snapshot, distance, count)
    return manifold.strongest(snapshot, distance)[:, None, :]


def resolution(manifold: Manifold) -> Array:
    """Return the beamwidth between the first zeros' halves, wavelength over extent, as sines, shape (2,).

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 2.
    """
    extent = np.array([np.ptp(manifold.positions[:, axis]) for axis in (1, 2)])
    with np.errstate(divide="ignore"):
        return np.where(extent > 0.0, manifold.radar.wavelength / extent, np.inf)


def _energy(snapshot: Phasors) -> Array:
    """Return the power summed over the channels [W], shape (n,)."""
    return np.asarray(np.sum(np.abs(snapshot) ** 2, axis=1))


def _too_near(manifold: Manifold, sines: Array) -> npt.NDArray[np.bool_]:
    """Return of which cells two directions are one target, split; sines (n, k, 2)."""
    apart = np.abs(sines[:, :, None, :] - sines[:, None, :, :]) / resolution(manifold)
    first, second = np.triu_indices(sines.shape[1], 1)
    return np.asarray((apart.max(axis=-1)[:, first, second] < _NEAREST).any(axis=1))


def _least_squares(manifold: Manifold, snapshot: Phasors, sines: Array, distance: Array) -> tuple[Phasors, Phasors]:
    """Return amplitudes (n, k) of directions (n, k, 2) and their phasors (n, k, num_virtual)."""
    beams = manifold.phasors(sines, np.broadcast_to(distance[:, None], sines.shape[:2]))
    return np.asarray(np.einsum("pkc,pc->pk", separating_weights(beams), snapshot)), beams


def separating_weights(beams: Phasors) -> Phasors:
    """Return weights (n, k, num_virtual) that are 1 on the own phasors and 0 on the others of (n, k, num_virtual).

    Dimensionless; least squares, by definition.
    """
    gram = np.einsum("pkc,plc->pkl", np.conj(beams), beams)
    gram += _RIDGE * beams.shape[2] * np.eye(beams.shape[1])
    return np.asarray(np.linalg.solve(gram, np.conj(beams)))


def _rest(manifold: Manifold, snapshot: Phasors, distance: Array, sines: Array) -> Phasors:
    """Return what directions (n, k, 2) leave of snapshots."""
    amplitude, beams = _least_squares(manifold, snapshot, sines, distance)
    return np.asarray(snapshot - np.einsum("pk,pkc->pc", amplitude, beams))


def _relaxed(manifold: Manifold, snapshot: Phasors, sines: Array, distance: Array) -> Array:
    """Return directions (n, k, 2) refined in turn, each on what the others leave."""
    sines = sines.copy()
    moving = np.arange(len(sines))
    for sweep in range(_SWEEPS):
        before = sines[moving].copy()
        place = distance[moving]
        for index in range(sines.shape[1]):
            amplitude, beams = _least_squares(manifold, snapshot[moving], sines[moving], place)
            amplitude[:, index] = 0.0
            alone = snapshot[moving] - np.einsum("pk,pkc->pc", amplitude, beams)
            sines[moving, index] = manifold.refine(alone, sines[moving, index], place, 6, 0.5 if sweep else 1.0)
        moving = moving[np.abs(sines[moving] - before).max(axis=(1, 2)) > 1e-4]
        if not len(moving):
            break
    return sines


def _part(
    manifold: Manifold, snapshot: Phasors, distance: Array, rows: npt.NDArray[np.int64], sines: Array
) -> Directions:
    """Return the directions (n, k, 2) of some snapshots, strongest first."""
    amplitude, beams = _least_squares(manifold, snapshot[rows], sines, distance[rows])
    order = np.argsort(-np.abs(amplitude), axis=1)
    each = np.arange(len(rows))[:, None]
    return Directions(
        np.repeat(rows, sines.shape[1]),
        sines[each, order].reshape(-1, 2),
        amplitude[each, order].reshape(-1),
        separating_weights(beams)[each, order].reshape(-1, snapshot.shape[1]),
    )


def _joined(parts: list[Directions], count: int) -> Directions:
    """Return the last part's directions of every cell, in the order of the cells."""
    last = np.zeros(count, dtype=np.int64)
    for number, part in enumerate(parts):
        last[part.cell] = number
    return Directions.joined([part.select(last[part.cell] == number) for number, part in enumerate(parts)])
