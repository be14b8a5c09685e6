"""Rows of patches that are seen obliquely: one for each corner and edge, those of neighbours joined."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.optics.near_field import NearField
from scarl_sionna.radar.optics.spherical_waves import ImageTubes

from .senses import Kind

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Columns = dict[str, npt.NDArray[Any]]

CANCELLED = 1e-6
"""What is left of a point after patches that share it are joined is dropped below this part of what they bring: it is
rounding. What patches differ by from one to the next is not, since it adds up over a face."""
_SAME_POINT = 1e-6
"""Points this near to each other are one [m]."""
_MIX = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0xD6E8FEB86659FD93], dtype=np.uint64)
"""Odd multipliers of a hash of places: change no result."""


def with_edges(columns: Columns, tubes: ImageTubes, near: NearField, planes: tuple[Array, Array]) -> Columns:
    """Return the columns with rows of corners and edges in place of those of oblique patches.

    Parameters
    ----------
    columns : dict
        Of :func:`.near_field.radiated`, with instances and the rest of a row, one row a patch. ``oblique`` and
        ``edges`` are taken out.
    tubes : ImageTubes
        The patches.
    near : NearField
    planes : tuple of ndarray of float64, shape (num_faces, 3) and (num_faces,)
        Normals and offsets of all faces.
    """
    oblique, edges = columns.pop("oblique", None), columns.pop("edges", None)
    if oblique is None or edges is None or not oblique.any():
        return columns
    patch, slot = np.nonzero((edges != 0.0) & oblique[:, None])
    corners = tubes.corners
    places = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2.0], axis=1)
    point = places[patch, slot]
    a = columns["a"][patch] * edges[patch, slot][:, None, None]
    order, first = _groups(point, tubes.image[:, -1], columns["instance"], patch)
    total = np.add.reduceat(a[order], first) if len(first) else a
    brought = np.add.reduceat(_size(a)[order], first) if len(first) else _size(a)
    kept = _size(total) > CANCELLED * brought
    row = order[first][kept]
    made = _moved(columns, tubes, near, planes, patch[row], point[row])
    made["a"] = total[kept]
    for name in ("tx_slope", "rx_slope"):
        if name in columns:
            slope = columns[name][patch] * edges[patch, slot][:, None, None, None]
            made[name] = np.add.reduceat(slope[order], first)[kept]
    whole = ~oblique
    return {name: np.concatenate([column[whole], made[name]]) for name, column in columns.items()}


def _size(a: npt.NDArray[np.complex128]) -> Array:
    return np.asarray(np.sqrt(np.einsum("nij,nij->n", a, a.conj()).real))


def _groups(point: Array, image: Array, instance: npt.NDArray[Any], patch: Index) -> tuple[Index, Index]:
    """Return an order of the points in which those of one place stand together, and where each place begins.

    One place is what has the same image of the transmitter and the same instances in its chain, too.
    """
    chain = np.concatenate([np.round(image / _SAME_POINT).astype(np.int64), instance.astype(np.int64)], axis=1)
    key = _hash(_hash_rows(chain)[patch], np.round(point / _SAME_POINT).astype(np.int64))
    order = np.argsort(key, kind="stable")
    return order, np.flatnonzero(np.concatenate([[True], key[order][1:] != key[order][:-1]])[: len(order)])


def _hash_rows(rows: Index) -> npt.NDArray[np.uint64]:
    return _hash(np.zeros(len(rows), dtype=np.uint64), rows)


def _hash(key: npt.NDArray[np.uint64], rows: Index) -> npt.NDArray[np.uint64]:
    for number, column in enumerate(rows.T):
        key = (key ^ column.astype(np.uint64)) * _MIX[number % len(_MIX)]
        key ^= key >> np.uint64(29)
    return key


def _moved(
    columns: Columns, tubes: ImageTubes, near: NearField, planes: tuple[Array, Array], patch: Index, point: Array
) -> Columns:
    """Return the columns of patches at other points of theirs."""
    made = {name: column[patch] for name, column in columns.items() if name != "a"}
    face, image = tubes.face[patch], tubes.image[patch]
    velocity = near.surfaces.velocity_on_host(face[:, -1], point)
    made["rx_point"], made["rx_velocity"] = point, velocity - near.rx.velocity
    seen, moved, here = point, velocity, point
    for k in range(face.shape[1] - 2, -1, -1):  # back along the chain: where it reflects, and what it shows
        normal, offset = planes[0][face[:, k]], planes[1][face[:, k]]
        ray = here - image[:, k + 1]
        share = (offset - _dot(normal, image[:, k + 1])) / _dot(normal, ray)
        here = image[:, k + 1] + share[:, None] * ray
        seen = seen - 2.0 * (_dot(normal, seen) - offset)[:, None] * normal
        mirror = near.surfaces.velocity_on_host(face[:, k], here)
        moved = moved - 2.0 * _dot(normal, moved - mirror)[:, None] * normal
    made["tx_point"], made["tx_velocity"] = seen, moved - near.tx.velocity
    same = made["kind"] == Kind.SAME_WAY
    for name in ("point", "velocity"):
        made[f"rx_{name}"][same] = made[f"tx_{name}"][same]
    length, rate = np.zeros(len(patch)), np.zeros(len(patch))
    for name, station in (("tx", near.tx), ("rx", near.rx)):
        ray = made[f"{name}_point"] - station.pose.position
        distance = np.sqrt(_dot(ray, ray))
        length += distance
        rate += _dot(ray, made[f"{name}_velocity"]) / distance
    made["length"], made["length_rate"] = length, rate
    return made


def _dot(first: Array, second: Array) -> Array:
    return np.asarray(np.einsum("ij,ij->i", first, second))
