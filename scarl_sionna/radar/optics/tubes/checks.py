"""Whether tubes were cut right: single points of their pieces are asked anew, wherever no probe of the cutting stood.

Cutting sees what is as wide as the distance of its probes. Of what is narrower, a gap between palings, no probe tells;
points that follow nothing but the area that is seen do, whatever stands in the way.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..faces.panes import DARK
from .cutting import Seen
from .together import Question
from .tube_shape import COUNTS, OFFSETS, middle, spread

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

NUM_POINTS = 128
"""Points of what is cut of a body at once: one of them wrong is 0.07 dB of a body that is seen whole, 0.3 dB of one of
which a quarter is seen."""


@dataclass(frozen=True, eq=False)
class Points(Question):
    """Single points `place_of` (n, 3) [m], of which the answer is what `target` labels them."""

    place: tuple[int, ...]
    place_of: Array
    target: Seen

    def __len__(self) -> int:
        return len(self.place_of)

    @property
    def key(self) -> Hashable:
        """What is asked together: by one probe."""
        return Points, self.target.key

    @classmethod
    def answered(cls, questions: Sequence[Points]) -> list[Index]:
        """Return the labels of each question."""
        points = np.concatenate([one.place_of for one in questions])
        count, first = (np.full(len(points), table[0]) for table in (COUNTS, OFFSETS))
        probe = Seen.probe([one.target for one in questions])
        labels = probe.within(np.repeat(points[:, None], 3, axis=1), np.arange(len(points)), count, first)
        return np.split(labels, np.cumsum([len(one) for one in questions])[:-1])


class Wrong(NamedTuple):
    """What of a body is not lit as its tubes are."""

    share: float
    """Of the solid angle that is lit, by the tubes or by the points, whichever is less."""
    points: int
    """That found it."""
    missed: float = 0.0
    """Solid angle that is lit though no tube is [sr]."""


@dataclass(eq=False)
class Lit:
    """What was found to be lit of bodies, and what of that is wrong, by instance: solid angles [sr], and points."""

    tables: dict[int, Array] = field(default_factory=dict)
    """Lit by the tubes, lit though these say it is not, not lit though they say so [sr]; points that are wrong."""

    @classmethod
    def of(cls, parts: Iterable[Lit]) -> Lit:
        """Return what several have found together."""
        whole = cls()
        for part in parts:
            for number, row in part.tables.items():
                whole.tables[number] = whole.tables.get(number, 0.0) + row
        return whole

    def add(self, owner: Index, share: Array, said: Index, found: Index) -> None:
        """Add points of instances, `owner`, each for a solid angle: what its piece was said to be, and what it is."""
        numbers, place = np.unique(owner, return_inverse=True)
        is_lit, was_lit = found != DARK, said != DARK
        missed, shaded = is_lit & ~was_lit, was_lit & ~is_lit
        columns = [np.bincount(place, share * some, len(numbers)) for some in (was_lit, missed, shaded)]
        columns.append(np.bincount(place, missed | shaded, len(numbers)))
        for number, row in zip(numbers.tolist(), np.stack(columns, axis=1), strict=True):
            self.tables[number] = self.tables.get(number, 0.0) + row

    def wrong(self) -> dict[int, Wrong]:
        """Return what is wrong, of instances of which anything is."""
        found = {}
        for number, (lit, missed, shaded, points) in sorted(self.tables.items()):
            if points > 0.0:
                least = min(lit, lit + missed - shaded)
                found[number] = Wrong((missed + shaded) / least if least > 0.0 else np.inf, int(points), float(missed))
        return found


def spread_points(corners: Array, source: Array, owner: Index) -> tuple[Index, Array, Array]:
    """Return points of triangles, :data:`NUM_POINTS` a body, evenly over what could be seen of it, if anything.

    Parameters
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        [m].
    source : ndarray of float64, shape (3,)
        From where they are seen [m].
    owner : ndarray of int64, shape (n,)
        Body of each.

    Returns
    -------
    rows : ndarray of int64, shape (m,)
        The triangle of each point.
    points : ndarray of float64, shape (m, 3)
    share : ndarray of float64, shape (m,)
        Solid angle for which each stands [sr].
    """
    ray = middle(corners) - source
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = np.abs(np.einsum("ij,ij->i", cross, ray)) / np.maximum(np.einsum("ij,ij->i", ray, ray), 1e-12) ** 1.5 / 2.0
    order = np.argsort(owner, kind="stable")
    place = np.cumsum(seen[order])
    last = np.flatnonzero(np.diff(owner[order], append=-1))
    ends = place[last]
    starts = np.concatenate([[0.0], ends[:-1]])
    has_area = ends > starts
    last, starts, ends = last[has_area], starts[has_area], ends[has_area]
    step, first, second = spread(NUM_POINTS)
    wanted = starts[:, None] + step * (ends - starts)[:, None]
    found = np.minimum(np.searchsorted(place, wanted), last[:, None])
    rows = order[found.ravel()]
    a, b, c = np.moveaxis(corners[rows], 1, 0)
    first, second = (np.tile(one, len(last))[:, None] for one in (first, second))
    share = np.repeat((ends - starts) / NUM_POINTS, NUM_POINTS)
    return rows, a + first * (b - a) + second * (c - a), share
