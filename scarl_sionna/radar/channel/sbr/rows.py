"""The columns of many patches: joined, sorted, and without what is too weak."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.link import strongest_amplitude
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.signal.noise import angle_cell_noise_power

Array = npt.NDArray[np.float64]
Columns = dict[str, npt.NDArray[Any]]

_LARGEST_KEY = 1 << 62
"""Sort keys above this are numbered anew, so that they stay in 64 bits: changes no order."""

CHANGES = {"over_time": (2,), "tx_slope": (3, 2, 2), "rx_slope": (3, 2, 2)}
"""Columns that only some blocks have, complex; 0 where a block has none."""
OF_SMOOTH = ("oblique", "edges", *CHANGES)
"""Columns that are not of what is scattered diffusely."""


def joined(blocks: list[Columns], max_depth: int) -> Columns:
    """Return the columns of all bounces, instances padded with -1.

    The blocks are emptied column by column, so that no more than one column is in memory twice.
    """
    columns: Columns = {
        "tx_point": np.zeros((0, 3)),
        "rx_point": np.zeros((0, 3)),
        "a": np.zeros((0, 2, 2), np.complex128),
        "length_rate": np.zeros(0),
        "tx_velocity": np.zeros((0, 3)),
        "rx_velocity": np.zeros((0, 3)),
        "length": np.zeros(0),
        "cosine": np.zeros(0),
        "semantic": np.zeros(0, np.uint8),
        "instance": np.zeros((0, max_depth), np.int32),
        "depth": np.zeros(0, np.int32),
        "kind": np.zeros(0, np.int8),
    }
    known = {name: shape for name, shape in CHANGES.items() if any(name in block for block in blocks)}
    columns |= {name: np.zeros((0, *shape), np.complex128) for name, shape in known.items()}
    for block in blocks:
        for name, shape in known.items():
            block.setdefault(name, np.zeros((len(block["length"]), *shape), np.complex128))
        depth = block["instance"].shape[1]
        block["instance"] = np.pad(block["instance"], [(0, 0), (0, max_depth - depth)], constant_values=-1)
    return {name: np.concatenate([column, *(block.pop(name) for block in blocks)]) for name, column in columns.items()}


def taken(columns: Columns, rows: npt.NDArray[Any]) -> Columns:
    """Return some rows (numbers or a mask); `columns` is emptied column by column."""
    return {name: columns.pop(name)[rows] for name in list(columns)}


def in_order(columns: Columns) -> Columns:
    """Return the rows by kind, depth, instances and length; equal ones stay as they were traced.

    `columns` is emptied.
    """
    key = columns["kind"].astype(np.int64)
    for column in (columns["depth"], *columns["instance"].T):
        width = int(column.max(initial=0)) + 2
        if int(key.max(initial=0)) > _LARGEST_KEY // width:
            key = np.unique(key, return_inverse=True)[1]
        key = key * width + (column + 1)
    order = np.lexsort((columns["length"], key))
    return taken(columns, order)


def received(columns: Columns, radar: RadarSpec, tx: Viewpoint, rx: Viewpoint) -> Array:
    """Return the amplitude that one antenna pair receives [sqrt(W)], shape (n,); of images the largest that it may be.

    An image's antennas look along its own axes. Its mirrors have yet to come: they reflect the parts of a field across
    and in the plane of incidence unlike each other and turn a polarisation that is neither, so that any counts which
    the antennas may hear behind them. What mirrors lose is not taken off.
    """
    away = ((columns[f"{end}_point"] - one.pose.position, one) for end, one in (("tx", tx), ("rx", rx)))
    sent, heard = (way @ (one.pose.rotation if one.axes is None else one.axes) for way, one in away)
    return strongest_amplitude(columns["a"], sent, heard, radar, (tx.axes is not None, rx.axes is not None))


def above_floor(
    columns: Columns, amplitude: Array, radar: RadarSpec, floor_db: float | None
) -> tuple[Columns, dict[str, float | None]]:
    """Return the rows without the weakest of each range bin, and what was left out; `columns` is emptied."""
    report: dict[str, float | None] = {
        "floor_db": floor_db,
        "num_dropped": 0,
        "dropped_power": 0.0,
        "in_phase_to_noise_db": None,
    }
    if floor_db is None or not len(columns["length"]):
        return columns, report
    noise = angle_cell_noise_power(radar)
    bins = np.floor(columns["length"] / (2.0 * radar.range_resolution)).astype(np.int64)
    order = np.lexsort((amplitude, bins))
    total = np.cumsum(amplitude[order])
    first = np.flatnonzero(np.diff(bins[order], prepend=-1))
    before = np.repeat(total[first] - amplitude[order][first], np.diff(first, append=len(order)))
    dropped = np.zeros(len(order), dtype=bool)
    dropped[order] = (total - before) ** 2 <= noise * 10.0 ** (floor_db / 10.0)
    if dropped.any():
        report["num_dropped"] = int(dropped.sum())
        report["dropped_power"] = float(np.sum(amplitude[dropped] ** 2))
        worst = float(np.bincount(bins[dropped], amplitude[dropped]).max() ** 2 / noise)
        report["in_phase_to_noise_db"] = 10.0 * float(np.log10(worst)) if worst > 0.0 else None
    return taken(columns, ~dropped), report
