"""The scattered part of rough surfaces: one path a patch, with a random phase that belongs to the surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.seeds import uniform_hash
from scarl_sionna.radar.optics.spherical_waves import ImageTubes

from .senses import Kind

Columns = dict[str, npt.NDArray[Any]]

_OF_THE_MIDDLE = ("tx_point", "rx_point", "tx_velocity", "rx_velocity", "length_rate", "length", "cosine", "scattered")
"""Columns of which a patch takes the mean over its pieces."""


def rough_pieces(columns: Columns, tubes: ImageTubes) -> Columns:
    """Return the columns of pieces of rough patches with `origin`, `face` and `area`.

    By these :func:`scattered_rows` joins them.

    Parameters
    ----------
    columns : dict
        Those of :func:`scarl_sionna.radar.optics.near_field.radiated` for pieces on rough faces, ``scattered`` among
        them.
    tubes : ImageTubes
        The pieces.
    """
    side = tubes.corners[:, 1:] - tubes.corners[:, :1]
    area = np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1) / 2.0
    return {**columns, "origin": tubes.origin, "face": tubes.face, "area": area}


def scattered_rows(pieces: Columns, seed: int) -> Columns:
    """Return the columns of what patches scatter diffusely.

    The pieces into which visibility has cut a patch become one path of their whole area, so that the power does not
    depend on how it was cut.

    Parameters
    ----------
    pieces : dict
        Columns of :func:`rough_pieces`, of all pieces of one depth.
    seed : int
        Of the phases: the same seed gives each patch the same phase in all frames.
    """
    columns = dict(pieces)
    keys = np.column_stack([columns.pop("origin"), columns.pop("face")])
    order = np.lexsort(keys.T)
    keys = keys[order]
    first = np.flatnonzero(np.concatenate([[True], np.any(keys[1:] != keys[:-1], axis=1)]))
    area = columns.pop("area")[order]
    total = np.add.reduceat(area, first)
    share = area / np.repeat(total, np.diff(first, append=len(order)))
    result = {}
    for name, column in columns.items():
        rows = column[order]
        if name in _OF_THE_MIDDLE:
            result[name] = np.add.reduceat(rows * share.reshape(-1, *[1] * (rows.ndim - 1)), first, axis=0)
        else:
            result[name] = rows[first]
    turn = np.exp(2j * np.pi * uniform_hash(keys[first], seed))
    result["a"] = result.pop("scattered") * (np.sqrt(total) * turn)[:, None, None]
    result["kind"] = np.full(len(first), Kind.ROUGH, dtype=np.int8)
    return result
