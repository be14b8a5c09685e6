"""How the transfer of patches changes with the places of its stations: over a frame, and over a wide array.

What moves past a station sees it from elsewhere later on, as a patch sees another antenna from elsewhere. The field of
the same patches is computed anew from there: directions, currents, coefficients and the pattern of a patch follow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_norm

from .near_field import Elsewhere, NearField, radiated_elsewhere
from .spherical_waves import ImageTubes

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Columns = dict[str, npt.NDArray[Any]]

LEAST_TURN = 0.01
"""What both ends of a patch turn by over a frame together, above which its transfer follows [rad]. A smooth face at
45 deg changes by half of it: -46 dB."""
LEAST_WIDTH = 0.01
"""Part of a patch's distance by which an antenna of a wide array is off the centre, above which the transfer follows:
50 m for one 1 m wide."""
MOST = 10.0
"""Largest change over a frame against the transfer at its start: more is that of a patch in a null of its own."""


def with_changes(
    near: Sequence[NearField], tubes: Sequence[ImageTubes], fields: Sequence[Columns], normal: Array, same_way: bool
) -> None:
    """Add to the columns of patches how their transfers change, where that counts.

    ``over_time`` is as in :class:`RadarPaths`, ``tx_slope`` and ``rx_slope`` likewise.

    Parameters
    ----------
    near, tubes, same_way
        As of :func:`.near_field.radiated`.
    fields : sequence of dict
        Its result.
    normal : ndarray of float64, shape (num_faces, 3)
        Of all faces.
    """
    _over_time(near, tubes, fields, normal, same_way)
    _over_arrays(near, tubes, fields, normal, same_way)


@dataclass(frozen=True, eq=False)
class _Patches:
    """Patches of several fields at whose stations elsewhere is looked.

    Attributes
    ----------
    near : sequence of NearField
    tubes : ImageTubes
    pair : ndarray of int64, shape (n,)
        Of which field each is.
    columns : dict
        Their points, velocities, transfers and ``oblique``.
    normal : ndarray of float64, shape (num_faces, 3)
    same_way : bool
    """

    near: Sequence[NearField]
    tubes: ImageTubes
    pair: Index
    columns: Columns
    normal: Array
    same_way: bool

    @classmethod
    def of(
        cls,
        near: Sequence[NearField],
        tubes: Sequence[ImageTubes],
        fields: Sequence[Columns],
        rows: Sequence[Index],
        rest: tuple[Array, bool],
    ) -> _Patches:
        """Return some rows of each field."""
        names = [name for name in (*_ENDS, "a", "oblique") if name in fields[0]]
        columns = {
            name: np.concatenate([field[name][some] for field, some in zip(fields, rows, strict=True)])
            for name in names
        }
        chosen = [one.take(some) for one, some in zip(tubes, rows, strict=True)]
        pair = np.repeat(np.arange(len(near)), [len(some) for some in rows])
        return cls(near, chosen[0].joined(chosen), pair, columns, *rest)

    def vectors(self, end: str) -> Array:
        """Return the vectors from the stations to the points that they see [m]."""
        station = np.array([getattr(one, end).pose.position for one in self.near])
        return np.asarray(self.columns[f"{end}_point"] - station[self.pair])

    def transfer(self, tx: Array, rx: Array) -> Complex:
        """Return the transfer with the stations shifted, shape (n, 3) [m], at equal spreading."""
        images = np.empty_like(self.tubes.image)
        images[:, 0] = shift = tx
        for number, face in enumerate(self.tubes.face.T[:-1], start=1):
            normal = self.normal[face]
            shift = shift - 2.0 * np.einsum("ij,ij->i", shift, normal)[:, None] * normal
            images[:, number] = shift
        oblique = self.columns.get("oblique", np.zeros(len(self.pair), dtype=np.bool_))
        found = radiated_elsewhere(self.near, self.tubes, self.pair, self.same_way, Elsewhere(tx, rx, images, oblique))
        farther = np.ones(len(self.pair))
        for end, moved in (("tx", tx), ("rx", tx if self.same_way else rx)):
            away = self.vectors(end)
            farther *= row_norm(away - moved) / row_norm(away)
        return np.asarray(found * farther[:, None, None])


_ENDS = ("tx_point", "rx_point", "tx_velocity", "rx_velocity")


def _over_time(
    near: Sequence[NearField], tubes: Sequence[ImageTubes], fields: Sequence[Columns], normal: Array, same_way: bool
) -> None:
    """Add ``over_time`` to the fields of which a patch turns: exact in the middle and at the end of the frame."""
    rows = [_turning(one, field) for one, field in zip(near, fields, strict=True)]
    if not any(map(len, rows)):
        return
    patches = _Patches.of(near, tubes, fields, rows, (normal, same_way))
    start, duration = patches.columns["a"], near[0].duration
    size = np.einsum("nij,nij->n", start, start.conj()).real
    changes = []
    for time in (0.5 * duration, duration):
        moved = [-time * patches.columns[f"{end}_velocity"] for end in ("tx", "rx")]
        along = np.einsum("nij,nij->n", start.conj(), patches.transfer(moved[0], moved[1]))
        change = np.divide(along, size, out=np.ones_like(along), where=size > 0.0) - 1.0
        changes.append(change / np.maximum(np.abs(change) / MOST, 1.0))
    middle, end = changes
    terms = np.stack([(4.0 * middle - end) / duration, (2.0 * end - 4.0 * middle) / duration**2], axis=1)
    _put("over_time", terms, fields, rows, patches.pair)


def _turning(near: NearField, field: Columns) -> Index:
    """Return the patches that turn over a frame as seen from the stations."""
    turn = np.zeros(len(field["a"]))
    for end, station in (("tx", near.tx), ("rx", near.rx)):
        away, velocity = field[f"{end}_point"] - station.pose.position, field[f"{end}_velocity"]
        distance = row_norm(away)
        along = np.einsum("ij,ij->i", away, velocity) / distance
        across = np.maximum(np.einsum("ij,ij->i", velocity, velocity) - along**2, 0.0)
        turn += near.duration * np.sqrt(across) / distance
    return np.flatnonzero(turn > LEAST_TURN)


def _over_arrays(
    near: Sequence[NearField], tubes: Sequence[ImageTubes], fields: Sequence[Columns], normal: Array, same_way: bool
) -> None:
    """Add ``tx_slope`` and ``rx_slope`` to the fields of which a patch is near to a wide array: differences over it."""
    rows = [_beside(one, field) for one, field in zip(near, fields, strict=True)]
    if not any(map(len, rows)):
        return
    patches = _Patches.of(near, tubes, fields, rows, (normal, same_way))
    still = np.zeros((len(patches.pair), 3))
    slopes = []
    for end in ("tx",) if same_way else ("tx", "rx"):
        slope = np.empty((len(patches.pair), 3, 2, 2), dtype=np.complex128)
        arm = 0.5 * near[0].arm
        for axis in range(3):
            step = np.array([arm * getattr(one, end).pose.rotation[:, axis] for one in near])[patches.pair]
            ends = [((shift, still) if end == "tx" else (still, shift)) for shift in (step, -step)]
            slope[:, axis] = (patches.transfer(*ends[0]) - patches.transfer(*ends[1])) / (2.0 * arm)
        slopes.append(slope)
    if same_way:  # both ends were moved at once: reciprocity has half of it for each
        slopes = [0.5 * slopes[0], 0.5 * slopes[0]]
    for name, slope in zip(("tx_slope", "rx_slope"), slopes, strict=True):
        _put(name, slope, fields, rows, patches.pair)


def _put(name: str, values: Complex, fields: Sequence[Columns], rows: Sequence[Index], pair: Index) -> None:
    """Add a column to the fields of pairs of stations: the values of their rows, 0 in all others."""
    for number, (field, some) in enumerate(zip(fields, rows, strict=True)):
        field[name] = np.zeros((len(field["a"]), *values.shape[1:]), dtype=np.complex128)
        field[name][some] = values[pair == number]


def _beside(near: NearField, field: Columns) -> Index:
    """Return the patches that are near to a wide array."""
    if near.arm <= 0.0:
        return np.zeros(0, dtype=np.int64)
    distance = [row_norm(field[f"{end}_point"] - getattr(near, end).pose.position) for end in ("tx", "rx")]
    return np.flatnonzero(np.minimum(*distance) < near.arm / LEAST_WIDTH)
