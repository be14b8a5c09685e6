"""Columns of :class:`~scarl_sionna.radar.paths.RadarPaths` from legs of mirrors, and blocks of columns in one table."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.signal.link import spreading

from .legs import Legs
from .station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Columns = dict[str, npt.NDArray[Any]]
"""One array a field of the paths, and their `total` length [m]."""


def mirror_columns(state: WorldState, legs: Legs, tx: Station, rx: Station, wavelength: float) -> Columns:
    """Return the columns of paths from a transmitter over mirrors, panes and edges to a receiver."""
    parts = state.world.parts
    depth, count = legs.depth, len(legs.length)
    if legs.kind.shape[1]:
        row = np.arange(count)
        first, last = legs.point[:, 0], legs.point[row, np.maximum(depth - 1, 0)]
        last_part = legs.part[row, np.maximum(depth - 1, 0)]
    else:
        first = last = np.broadcast_to(rx.position, (count, 3))
        last_part = np.full(count, -1, dtype=np.int64)
    middle = np.broadcast_to((tx.position + rx.position) / 2.0, (count, 3))  # of a line of sight
    first, last = (np.where(depth[:, None] > 0, point, middle) for point in (first, last))
    bent = np.isfinite(legs.edge_length)
    first, last = (np.where(bent[:, None], point, other) for point, other in ((legs.front, first), (legs.rear, last)))
    ends = np.linalg.norm(first - tx.position, axis=1) + np.linalg.norm(last - rx.position, axis=1)
    by_edge = np.isnan(legs.isometry[:, :1, 0])
    return {
        "tx_point": first,
        "rx_point": last,
        "inner_length": np.maximum(legs.length - ends, 0.0),
        "a": legs.transfer * (scale := spreading(wavelength, legs.length))[:, None, None],
        "tx_slope": legs.slope * scale[:, None, None, None],
        "rx_slope": legs.end_slope * scale[:, None, None, None],
        "length_rate": legs.rate,
        "length_acceleration": legs.acceleration,
        "instance": np.where(legs.part >= 0, parts.instance[legs.part], -1),
        "interaction": np.where(legs.part >= 0, legs.kind, -1),
        "depth": depth,
        "semantic": np.where(last_part >= 0, parts.semantic[last_part], 0),
        "rx_image": legs.isometry,
        "tx_velocity": np.where(by_edge, legs.front_velocity, 0.0),
        "rx_velocity": np.where(by_edge, legs.rear_velocity, legs.velocity),
        "total": legs.length,
    }


_TYPES = {"instance": np.int32, "interaction": np.int32, "depth": np.int32, "semantic": np.uint8}


def joined_columns(blocks: list[Columns]) -> Columns:
    """Return the columns of all blocks, labels padded with -1 to the longest path.

    Slopes over the array are 0 where a block has none, and not there where all are 0.
    """
    for name in ("tx_slope", "rx_slope"):
        known = any(np.any(block.get(name, 0.0)) for block in blocks)
        for block in blocks:
            if not known:
                block.pop(name, None)
            elif name not in block:
                block[name] = np.zeros((len(block["total"]), 3, 2, 2), dtype=np.complex128)
    width = max([1, *(block["instance"].shape[1] for block in blocks)])
    for block in blocks:
        for name in ("instance", "interaction"):
            block[name] = np.pad(block[name], [(0, 0), (0, width - block[name].shape[1])], constant_values=-1)
    if not blocks:
        blocks = [_no_columns(width)]
    return {
        name: np.ascontiguousarray(np.concatenate([block[name] for block in blocks])).astype(
            _TYPES.get(name, blocks[0][name].dtype)
        )
        for name in blocks[0]
    }


def _no_columns(width: int) -> Columns:
    none = {name: np.zeros(0) for name in ("inner_length", "length_rate", "length_acceleration", "total")}
    none |= {name: np.zeros((0, 3)) for name in ("tx_point", "rx_point", "tx_velocity", "rx_velocity")}
    none |= {name: np.zeros((0, width), np.int32) for name in ("instance", "interaction")}
    return {
        **none,
        "a": np.zeros((0, 2, 2), np.complex128),
        "depth": np.zeros(0),
        "semantic": np.zeros(0),
        "rx_image": np.zeros((0, 3, 4)),
    }
