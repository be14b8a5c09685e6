"""How finely footprints are probed and halved: by their phase, and finer only where a narrow body may be in the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device

from .narrow import NarrowBodies

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Spacings:
    """Spacings of some footprints.

    Attributes
    ----------
    wide : ndarray of float64, shape (n,)
        Largest distance of the probes [m].
    fine : ndarray of float64, shape (n,)
        Size down to which footprints that straddle an edge are halved [m].
    near : NearBodies, optional
        What makes them finer than they would be.
    """

    wide: Array
    fine: Array
    near: NearBodies | None = None

    @classmethod
    def beside(cls, near: NearBodies, corners: Array, fine: Array) -> Spacings:
        """Return the spacings of footprints, `corners` (n, 3, 3) [m], beside the bodies of the same rows."""
        return cls(near.spacings(corners, np.arange(len(corners))), fine, near)

    @property
    def plain(self) -> Array:
        """Largest distance of the probes if no body were near [m], shape (n,)."""
        return self.wide if self.near is None else self.near.wide

    def take(self, rows: Index) -> Spacings:
        """Return those of some footprints."""
        near = None if self.near is None else self.near.take(rows)
        return Spacings(self.wide[rows], self.fine[rows], near)

    @classmethod
    def joined(cls, parts: Sequence[Spacings]) -> Spacings:
        """Return several as one; all have the same bodies, and look to the same side of their footprints."""
        if len(parts) == 1:
            return parts[0]
        wide, fine = (np.concatenate([getattr(one, name) for one in parts]) for name in ("wide", "fine"))
        near = [one.near for one in parts if one.near is not None]
        return cls(wide, fine, NearBodies.joined(near) if near else None)

    def of_pieces(self, corners: Array, rows: Index, wide: Array) -> Array:
        """Return `wide` of pieces, (m, 3, 3), of the footprints `rows`, which had that of the whole.

        A piece that no narrow body can meet any more has the distance that it would have without.
        """
        some = self.are_near(rows, wide)
        if self.near is None or not len(some):
            return wide
        found = wide.copy()
        found[some] = self.near.spacings(corners[some], rows[some])
        return found

    def are_near(self, rows: Index, wide: Array) -> Index:
        """Return which pieces of the footprints `rows`, probed as finely as `wide`, may meet a narrow body."""
        if self.near is None:
            return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(wide < self.near.wide[rows])


@dataclass(frozen=True, eq=False)
class NearBodies:
    """Narrow bodies that the rays of footprints may meet, one row a footprint.

    Attributes
    ----------
    on : Device
    bodies : NarrowBodies
    is_way_in : bool
        Whether they stand between the sources and the footprints, or behind these: see :meth:`NarrowBodies.spacing`.
    source : ndarray of float64, shape (n, 3)
        Where the rays come from [m].
    wide : ndarray of float64, shape (n,)
        Largest distance of the probes without bodies [m].
    least : ndarray of float64, shape (n,)
        No body makes the distance of the probes less than this [m].
    """

    on: Device
    bodies: NarrowBodies
    is_way_in: bool
    source: Array
    wide: Array
    least: Array

    def spacings(self, corners: Array, rows: Index) -> Array:
        """Return the distance of the probes of pieces, `corners` (m, 3, 3) [m], of the footprints `rows`."""
        wide, least = self.wide[rows], self.least[rows]
        found = self.bodies.spacing(self.on, corners, self.source[rows], (wide, least), self.is_way_in)
        return np.where(found < wide, np.maximum(found, least), wide)

    def take(self, rows: Index) -> NearBodies:
        """Return the rows of some footprints."""
        return self._of_columns(*(column[rows] for column in self._columns))

    @classmethod
    def joined(cls, parts: Sequence[NearBodies]) -> NearBodies:
        """Return the rows of several with the same bodies."""
        columns = zip(*(one._columns for one in parts), strict=True)
        return parts[0]._of_columns(*map(np.concatenate, columns))

    @property
    def _columns(self) -> tuple[Array, ...]:
        return self.source, self.wide, self.least

    def _of_columns(self, *columns: Array) -> NearBodies:
        return NearBodies(self.on, self.bodies, self.is_way_in, *columns)
