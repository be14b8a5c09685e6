"""What the tracers of plane and of spherical waves share.

Tables of tubes, landing on planes, and the order of the bounces.

A tube is a triangular footprint on a face. Reflected, it goes on to what it meets next and is cut there
(:mod:`.refine`); where it lands is the projection of the triangle: parallel for a plane wave, central for a spherical
one, exact for both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from .tube_shape import sides_and_height

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

GRAZING = 1e-6
"""Cosine of incidence below which a face is not lit: its flux is 60 dB below that of a face turned by 0.06 deg."""
_BEHIND = 1e-6
"""A tube may land this part of its length before its footprint: the rounding of faces that touch."""
_OVERRUN = 0.05
"""The same as a part of the tube's size: cuts at the edge of a face that the next one touches reach over it by up to
their own accuracy and the inset of the probes, of tubes that were larger before they were cut."""

TableT = TypeVar("TableT", bound="Tubes")
BounceT = TypeVar("BounceT")


@dataclass(frozen=True, eq=False)
class Tubes:
    """Footprints of ray tubes; what else is known of each stands in the columns of the subclasses, one row a tube.

    Attributes
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        [m].
    """

    corners: Array

    def __len__(self) -> int:
        return len(self.corners)

    def take(
        self: TableT, rows: npt.NDArray[np.integer] | npt.NDArray[np.bool_] | slice, corners: Array | None = None
    ) -> TableT:
        """Return some rows (numbers or a slice), with other footprints if given."""
        values = [getattr(self, field.name)[rows] for field in fields(self)[1:]]
        return type(self)(self.corners[rows] if corners is None else corners, *values)

    def batches(self: TableT, size: int) -> list[TableT]:
        """Return them in batches."""
        return [self.take(slice(first, first + size)) for first in range(0, len(self), size)]

    @classmethod
    def joined(cls: type[TableT], pieces: list[TableT]) -> TableT:
        """Return the rows of at least one table."""
        if len(pieces) == 1:
            return pieces[0]
        return cls(*(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in fields(cls)))


def gathered(pieces: Iterable[TableT], limit: int) -> Iterator[TableT]:
    """Join pieces into batches of at least `limit` tubes: many small ones cost more time than they have work."""
    held: list[TableT] = []
    count = 0
    for piece in pieces:
        if not len(piece):
            continue
        held.append(piece)
        count += len(piece)
        if count >= limit:
            yield held[0].joined(held)
            held, count = [], 0
    if held:
        yield held[0].joined(held)


def depth_first(
    starts: Iterable[TableT],
    arrive: Callable[[int, TableT], Iterable[BounceT]],
    go_on: Callable[[BounceT], Iterable[TableT]],
    max_depth: int,
) -> Iterator[BounceT]:
    """Yield the bounces of tubes, the last batch that was found first, so that few wait at a time.

    Parameters
    ----------
    starts : iterable of Tubes
        On the faces that the wave lights.
    arrive : callable
        From the number of the bounce, 1 for the first, and the tubes that arrive to what they are there.
    go_on : callable
        From what they are to the tubes of the next bounce, in batches.
    max_depth : int
        The last bounce.
    """
    for start in starts:
        stack = [(1, start)]
        while stack:
            depth, tubes = stack.pop()
            for bounce in arrive(depth, tubes):
                yield bounce
                if depth < max_depth:
                    stack += [(depth + 1, following) for following in go_on(bounce)]


def face_of_plane(plane: Index) -> Index:
    """Return the first face of each plane, by the plane's number."""
    result = np.zeros(int(plane.max(initial=0)) + 1, dtype=np.int64)
    result[plane[::-1]] = np.arange(len(plane))[::-1]  # of several, the one written last stays
    return result


def landing(corners: Array, ray: Array, normal: Array, offset: Array) -> tuple[Array, Array]:
    """Return how far along their rays points land on planes.

    Parameters
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        Three points of each tube [m].
    ray : ndarray of float64, shape (n, 3, 3) or (n, 1, 3)
        Directions in which they go on, of any length.
    normal, offset : ndarray of float64, shape (n, 3) and (n,)
        Planes: unit normals and normal . point [m].

    Returns
    -------
    share : ndarray of float64, shape (n, 3)
        The points land at ``corners + share * ray``; not finite for a ray in its plane.
    slope : ndarray of float64, shape (n, 3) or (n, 1)
        normal . ray.
    """
    slope = np.einsum("nij,nj->ni", ray, normal)
    height = offset[:, None] - np.einsum("nij,nj->ni", corners, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        return height / slope, slope


def lands_ahead(corners: Array, length: Array, share: Array, slope: Array) -> Mask:
    """Return which tubes land on a plane that lies ahead of their footprints, and not along it, shape (n,).

    Parameters
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        Of their footprints [m].
    length : ndarray of float64, shape (n, 3)
        Of the rays from where they seem to come to the corners [m].
    share, slope : ndarray of float64, shape (n, 3)
        As :func:`landing` returns them for these rays.
    """
    slack = _BEHIND * length + _OVERRUN * sides_and_height(corners)[0][:, None]
    with np.errstate(invalid="ignore"):
        return np.asarray(((share * length >= -slack) & (np.abs(slope) > GRAZING * length)).all(axis=1))
