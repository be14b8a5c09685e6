"""How small a patch must be for its phase to be linear, for all antennas and the whole band; cutting to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_max, row_min
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.device import device
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.engine.types import DeviceArray

from .faces.oblique import STEADY, Ends, is_oblique, steady_slope

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_FILL = 0.8
"""Bands are this part of the length allowed, so that the diagonals of their pieces are not too long as well. What is
too long is cut again, so this decides the number of cuts, not the accuracy."""

FINEST = 4.0 / np.pi
"""1 over half of the phase over a quarter of a wavelength [1/rad]: the pattern of smaller patches hardly changes."""
MOST_ACROSS = 1.0 / 3.0
"""A patch reaches no farther across the end of a mirror [Fresnel units], or than `edge_share`, 1 at most, where edges
are cut more coarsely: it has the weight of its middle. docs/accuracy.md, ends of mirrors."""
_SPLIT_AGAIN = 1.3
"""Pieces of pieces that are too long after the second cut; mean over triangles of all shapes. Only for the count
beforehand."""


@dataclass(frozen=True)
class PatchSize:
    """Largest patches.

    Attributes
    ----------
    wavenumber : float
        At the middle of the band [rad/m].
    half_band : float
        Wavenumber from the middle of the band to its end [rad/m].
    aperture : float
        Distance of the outermost antenna from the array's centre [m].
    max_phase, max_ramp : float
        [rad].
    longest : float
        Side that no patch exceeds [m].
    max_turn : float or None
        [rad]; None: patches do not follow from motion.
    duration : float
        Of a frame [s].
    passed : tuple of ndarray of float64, shape (num_rows, 3), optional
        Ways over a frame past the source and past the receiver, for each row of :meth:`excess` [m].
    wide_arm : float
        `aperture` of an array so wide that antennas see edges of other strength [m]; 0 of others.
    """

    wavenumber: float
    half_band: float
    aperture: float
    max_phase: float
    max_ramp: float
    longest: float = np.inf
    max_turn: float | None = None
    duration: float = 0.0
    passed: tuple[Array, Array] | None = None
    wide_arm: float = 0.0

    @classmethod
    def of(cls, radar: RadarSpec, settings: SbrSettings, wide_arm: float = np.inf) -> PatchSize:
        """Return the limits for a radar; `wide_arm` [m] is the aperture above which an array is wide."""
        arms = np.concatenate([radar.tx_array, radar.rx_array])
        aperture = float(np.linalg.norm(arms, axis=1).max())
        return cls(
            2.0 * np.pi * radar.center_frequency / SPEED_OF_LIGHT,
            np.pi * radar.sampled_bandwidth / SPEED_OF_LIGHT,
            aperture,
            settings.max_phase,
            settings.max_ramp,
            max_turn=settings.max_turn,
            duration=radar.frame_time,
            wide_arm=aperture if aperture > wide_arm else 0.0,
        )

    def length(self, distance: Array) -> Array:
        """Return the side that `max_phase` allows across the line of sight, there and back over a distance [m]."""
        return np.minimum(np.sqrt(4.0 * self.max_phase * distance / self.wavenumber), self.longest)

    def excess(self, corners: Array, source: Array, rows: Index, receiver: Array) -> Array:
        """Return by how much each side is too long, shape (num_patches, 3); 1 is as long as allowed.

        With e the part of a side across a leg of length R, the quadratic phase at its half is k e^2 / (8 R); an antenna
        at a distance D from the centre turns the phase there by k e D / (2 R); at the end of the band it is turned by
        the difference of wavenumbers times half the difference of path length along the side. What moves by u over a
        frame turns it by k side . u / (2 R), u without its part along the leg, both legs together: the square root
        of its square and of its double product with the phase that is there anyway, 1 rad at most. A quarter of a
        wavelength is never too long for that. The band does not matter where a patch is represented by its
        edges (:mod:`.oblique`).

        Parameters
        ----------
        corners : ndarray of float64, shape (num_patches, 3, 3)
        source : ndarray of float64, shape (num_rows, 3)
        rows : ndarray of int64, shape (num_patches,)
            Row of `source` of each patch.
        receiver : ndarray of float64, shape (3,) or (num_rows, 3)
        """
        if not len(rows):
            return np.zeros((0, 3))
        with device() as on:
            dr, Real, Vector = on.dr, on.Real, on.Vector
            corner = on.corners(corners)
            center = (corner[0] + corner[1] + corner[2]) / 3.0
            row = on.index(rows)
            image = dr.gather(Vector, on.reals(source), row)
            own = receiver.ndim == 2
            home = dr.gather(Vector, on.reals(receiver), row) if own else on.vector(receiver)
            legs, slopes, passing, still = [], [], [], on.vector(np.zeros(3))
            for number, end in enumerate((image, home)):
                leg = center - end
                distance = dr.norm(leg)
                legs.append((leg / distance, distance))
                way, ray = still, legs[-1][0]
                if self.passed is not None:
                    way = dr.gather(Vector, on.reals(self.passed[number]), row)
                    slopes.append((way - dr.dot(way, ray) * ray) / distance)
                passing.append((way, ray, distance))
            longest = dr.opaque(Real, self.longest)
            steady = steady_slope(dr, self.wavenumber, passing, self.max_turn or STEADY, self.wide_arm)
            ends = Ends(corner, image, home, self.wavenumber, steady)
            by_area = dr.select(is_oblique(dr, ends), 0.0, Real(1.0))
            sides = [corner[(k + 1) % 3] - corner[k] for k in range(3)]
            found = [self._excess(dr, side, legs, longest, by_area * self.half_band) for side in sides]
            if slopes and self.max_turn is not None:
                rays = legs[0][0] + legs[1][0]
                turned = [self._turned(dr, side, slopes[0] + slopes[1], rays) for side in sides]
                found = [dr.maximum(one, other) for one, other in zip(found, turned, strict=True)]
            with many_threads(len(rows)):
                dr.eval(*found)
                return np.stack([side.numpy() for side in found], axis=1)

    def _turned(self, dr: ModuleType, side: DeviceArray, slope: DeviceArray, rays: DeviceArray) -> DeviceArray:
        """Return by how much a side is too long for what motion turns there."""
        half = 0.5 * self.wavenumber
        turn, own = dr.abs(half * dr.dot(side, slope)), dr.minimum(dr.abs(half * dr.dot(side, rays)), 1.0)
        # the pattern sinc(own + turn) departs from sinc(own) by (turn^2 + 2 own turn) / 6
        return dr.minimum(dr.sqrt(turn**2 + 2.0 * own * turn) / self.max_turn, FINEST * half * dr.norm(side))

    def pieces(self, corners: Array, source: Array, receiver: Array) -> Array:
        """Return about how many patches :func:`split` makes of each triangle: within a factor of 1.5 over many."""
        return self.pieces_of(self.excess(corners, source[None], np.zeros(len(corners), dtype=np.int64), receiver))

    def pieces_of(self, excess: Array) -> Array:
        """Return the same from by how much the sides of each triangle are too long."""
        longest, least = row_max(excess), np.maximum(np.ceil(row_min(excess) / _FILL), 1.0)
        return np.where(longest <= 1.0, 1.0, _SPLIT_AGAIN * (2.0 * np.ceil(longest / _FILL) - 1.0) * least)

    def _excess(
        self,
        dr: ModuleType,
        side: DeviceArray,
        legs: list[tuple[DeviceArray, DeviceArray]],
        longest: DeviceArray,
        half_band: DeviceArray,
    ) -> DeviceArray:
        curvature, turn, along = 0.0, 0.0, 0.0
        square = dr.squared_norm(side)
        for ray, distance in legs:
            radial = dr.dot(side, ray)
            across = dr.maximum(square - radial**2, 0.0)
            curvature += across / distance
            turn += dr.sqrt(across) / distance
            along += radial
        phase = dr.sqrt(self.wavenumber * curvature / 8.0 / self.max_phase)
        ramp = dr.maximum(self.wavenumber * self.aperture * turn, half_band * dr.abs(along)) / 2.0 / self.max_ramp
        return dr.maximum(dr.maximum(phase, ramp), dr.sqrt(square) / longest)


@dataclass(frozen=True, eq=False)
class EvenSize:
    """How large patches may be that are seen over mirrors which end near there.

    Attributes
    ----------
    across_ends : sequence of callable
        As of :class:`.tubes.screens.Window`.
    edge_share : float
        As in SbrSettings.
    """

    across_ends: Sequence[Callable[[Array], Array]]
    edge_share: float
    passed: None = None

    def excess(self, corners: Array, source: Array, rows: Index, receiver: Array) -> Array:
        """Return by how much each side is too long, shape (num_patches, 3); see :meth:`PatchSize.excess`."""
        allowed = max(MOST_ACROSS, min(self.edge_share, 1.0))
        return np.asarray(np.maximum.reduce([one(corners) for one in self.across_ends]) / allowed)


def split(
    corners: Array,
    source: Array,
    receiver: Array,
    size: PatchSize | EvenSize,
    max_patches: int,
    allowed: float = 1.0,
) -> tuple[Array, Index]:
    """Cut triangles until no side is too long.

    A triangle is sliced into bands parallel to its least side, so a sliver gives about twice as many pieces as its
    length needs; halving would give that number to the power 1.6.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_triangles, 3, 3)
    source : ndarray of float64, shape (num_triangles, 3) or (1, 3)
        Where the wave comes from (the transmitter or an image of it) [m, world]; one row is that of all.
    receiver : ndarray of float64, shape (3,) or (num_triangles, 3)
    size : PatchSize or EvenSize
    max_patches : int
    allowed : float
        Pieces may be so many times as long as `size` says.

    Returns
    -------
    corners : ndarray of float64, shape (num_patches, 3, 3)
    rows : ndarray of int64, shape (num_patches,)
        The triangle that each patch is part of, rising.

    Raises
    ------
    ParameterRangeError
        If there are more than `max_patches` pieces.
    """
    rows = np.arange(len(corners))
    one_source = len(source) == 1 and size.passed is None
    done: list[tuple[Array, Index]] = [(corners[:0], rows[:0])]
    count = 0
    while len(rows):
        number = np.zeros_like(rows) if one_source else rows
        excess = size.excess(corners, source, number, receiver) / allowed
        longest = row_max(excess)
        small = longest <= 1.0
        if small.all():
            done.append((corners, rows))
            break
        done.append((corners[small], rows[small]))
        corners, rows, excess = corners[~small], rows[~small], excess[~small]
        bands = np.ceil(longest[~small] / _FILL)
        count += int(small.sum())
        if count + 2.0 * bands.sum() > max_patches:
            too_many_patches(max_patches)
        corners, piece_of = _bands(corners, excess, bands.astype(np.int64))
        rows = rows[piece_of]
    corners, rows = (np.concatenate(column) for column in zip(*done, strict=True)) if len(done) > 2 else done[-1]
    if np.all(rows[1:] >= rows[:-1]):
        return corners, rows
    order = np.argsort(rows, kind="stable")
    return corners[order], rows[order]


def too_many_patches(limit: int) -> NoReturn:
    """Raise the error of a scene that needs more patches than allowed."""
    raise ParameterRangeError(
        "number of patches",
        f"above {limit}",
        f"<= {limit}",
        "choose fewer `instances`, a larger `max_phase` or a larger `max_patches`",
    )


def _bands(corners: Array, excess: Array, bands: Index) -> tuple[Array, Index]:
    """Return triangles cut into bands parallel to their least side, and which triangle each piece is of."""
    apex = (excess.argmin(axis=1) + 2) % 3  # side i runs from corner i to i + 1
    pieces = 2 * bands - 1
    owner = np.repeat(np.arange(len(bands)), pieces)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    with device() as on:
        dr, mi, Real, Vector = on.dr, on.mi, on.Real, on.Vector
        which, piece = on.index(owner), on.index(number)
        flat, first = on.reals(corners), dr.gather(mi.UInt32, on.index(apex), which)
        a, b, c = (dr.gather(Vector, flat, 3 * which + (first + k) % 3) for k in range(3))
        count = dr.gather(Real, on.reals(bands), which)
        band = (piece + 1) // 2  # the first band is one triangle, each other one two
        lower = piece % 2 == 1
        low, high = Real(band) / count, Real(band + 1) / count
        b, c = b - a, c - a
        cut = dr.empty(Real, 9 * len(owner))
        place = 3 * dr.arange(mi.UInt32, len(owner))
        for k, point in enumerate(
            (a + low * b, a + high * dr.select(lower, c, b), a + dr.select(lower, low, high) * c)
        ):
            dr.scatter(cut, point, place + k)
        return cut.numpy().reshape(-1, 3, 3), owner
