"""Which sense of a chain of bounces between bodies counts: that in which the narrower face scatters.

A tube that goes on from a face carries a beam as wide as its footprint, as a mirror would send it on. That is right for
faces that are large against the Fresnel zone. A small face, or one of many that stand for a curve, spreads the wave,
which a tube has at its last bounce only, by physical optics. A monostatic radar hears the reverse of a chain of bounces
as loud and at the same distance (reciprocity), so of two senses that which ends at the narrower face is taken twice.
Where the narrow face is in the middle, there and back over the same wide ones, the radar hears it over these: as
backscatter to its own image.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_norm

Array = npt.NDArray[np.float64]
Columns = dict[str, npt.NDArray[Any]]

WIDER = 2.0
"""Faces whose widths differ by less than this factor are alike: each sense is taken as it was traced. docs/sbr.md,
bounces between bodies."""


class Kind(IntEnum):
    """Of a row: how it was made; rows are sorted by it, what is coherent first."""

    TRACED = 0
    REVERSED = 1
    """The other sense of a traced row."""
    SAME_WAY = 2
    """Of the last face of a chain, heard over the others: in place of traced rows there and back over the same."""
    ROUGH = 3
    """What a rough surface scatters, with a random phase."""
    ROUGH_REVERSED = 4
    ROUGH_SAME_WAY = 5
    LEFT_OUT = 6
    """Traced, but it ends at a face that is wider than the first: the reverse of what tubes on that face find stands
    for it."""


ROUGH_KINDS = Kind.ROUGH, Kind.ROUGH_REVERSED, Kind.ROUGH_SAME_WAY
"""Those with a random phase."""


def flat_widths(corners: Array, plane: npt.NDArray[np.int64]) -> Array:
    """Return the width of the flat region to which each face belongs, shape (num_faces,) [m].

    Its area over its largest extent: the narrow side of a rectangle.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        [m].
    plane : ndarray of int64, shape (num_faces,)
        One number for a region; faces that stand for a curve have a plane each.
    """
    _, group = np.unique(plane, return_inverse=True)
    side = corners[:, 1:] - corners[:, :1]
    area = np.bincount(group, row_norm(np.cross(side[:, 0], side[:, 1])) / 2.0)
    count = np.bincount(group).astype(np.float64)
    middle = np.stack([np.bincount(group, axis) for axis in corners.mean(axis=1).T], axis=1) / count[:, None]
    extent = np.zeros(len(count))
    np.maximum.at(extent, group, row_norm(corners - middle[group, None]).max(axis=1))
    return np.asarray((area / np.maximum(2.0 * extent, 1e-9))[group])


def kinds_of(first: Array, last: Array, instance: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.int8]:
    """Return the kind of traced rows: `REVERSED` for those whose reverse is taken from them, too.

    Parameters
    ----------
    first, last : ndarray of float64, shape (n,)
        Width of the first and of the last face [m].
    instance : ndarray of int, shape (n, depth)
        Of the bounces. Within one body both senses stay.
    """
    between = instance[:, 0] != instance[:, -1]
    found = np.full(len(first), Kind.TRACED, dtype=np.int8)
    found[between & (first > WIDER * last)] = Kind.REVERSED
    found[between & (last > WIDER * first)] = Kind.LEFT_OUT
    return found


def heard_the_same_way(mirror: Array, width: Array, instance: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.bool_]:
    """Return the chains whose last face is heard over the others, which are flat and wider, shape (n,).

    Parameters
    ----------
    mirror : ndarray of float64, shape (n, depth)
        Width of each face as a mirror [m]: that of its flat region, 0 if it stands for a curve.
    width : ndarray of float64, shape (n,)
        Of the last face [m].
    instance : ndarray of int, shape (n, depth)
        Of the bounces. The last one is another body than those before.
    """
    is_apart = (instance[:, :-1] != instance[:, -1:]).all(axis=1)
    return np.asarray(is_apart & (mirror[:, :-1].min(axis=1, initial=np.inf) > WIDER * width) & (instance.shape[1] > 1))


def reversed_rows(columns: Columns, semantic: npt.NDArray[np.uint8], kind: Kind) -> Columns:
    """Return the reversed paths of a monostatic radar: first what was met last.

    Parameters
    ----------
    columns : dict
        Of paths with a mirror before what scatters.
    semantic : ndarray of uint8
        Class of the first mirror, which is met last.
    kind : Kind
        Of the result.
    """
    ends = (("tx_slope", "rx_slope"), ("rx_slope", "tx_slope"))
    slopes = {one: columns[other].transpose(0, 1, 3, 2) for one, other in ends if other in columns}
    return {
        **columns,
        **slopes,
        "tx_point": columns["rx_point"],
        "rx_point": columns["tx_point"],
        "tx_velocity": columns["rx_velocity"],
        "rx_velocity": columns["tx_velocity"],
        "a": columns["a"].transpose(0, 2, 1),
        "instance": columns["instance"][:, ::-1],
        "semantic": semantic,
        "kind": np.full(len(semantic), kind, dtype=np.int8),
    }


def mirrored_back(columns: Columns, kind: Kind) -> Columns:
    """Return rows of what is heard the same way, with the mirrors once more behind the face that scatters.

    `kind` is that of the result.
    """
    chain = columns["instance"]
    return {
        **columns,
        "instance": np.concatenate([chain, chain[:, -2::-1]], axis=1),
        "depth": 2 * columns["depth"] - 1,
        "semantic": columns["first_semantic"],
        "kind": np.full(len(chain), kind, dtype=np.int8),
    }


def scattering_bounce(columns: Columns) -> npt.NDArray[np.int64]:
    """Return the number of the bounce of each row that scatters, shape (n,); the others are mirrors."""
    kind, depth = columns["kind"], columns["depth"].astype(np.int64)
    is_reversed = np.isin(kind, (Kind.REVERSED, Kind.ROUGH_REVERSED))
    in_the_middle = np.isin(kind, (Kind.SAME_WAY, Kind.ROUGH_SAME_WAY))
    return np.select([is_reversed, in_the_middle], [0, depth // 2], depth - 1)
