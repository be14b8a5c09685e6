"""Where rain and snow do not fall: below roofs, bridges and ceilings, told by rays straight up."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.semantics import semantic_id

from .enclosure import hits_above

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

HIGHEST = 100.0
"""A surface higher than this above a place does not count: drops drift in below it [m]."""
AROUND = (5.0, 15.0, 30.0)
"""Distances at which places around a sensor are looked at [m]; what is in the air counts most within them."""
DIRECTIONS = 24


def is_sheltered(state: WorldState, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which places no rain or snow reaches, shape (num_points,): those with a surface above them.

    Plants let it through. *Not modelled*: drops that the wind carries in from the side.

    Parameters
    ----------
    state : WorldState
    points : array_like of float, shape (num_points, 3)
        [m, world].
    """
    out = np.zeros(np.asarray(points).size // 3, dtype=np.bool_)
    if len(out):
        hits = hits_above(state.cast, points, HIGHEST)
        out[hits.ray] = state.world.parts.semantic[hits.part] != semantic_id("Vegetation")
    return out


def is_under_cover(state: WorldState, position: npt.ArrayLike) -> bool:
    """Return whether a sensor and most of what is around it are sheltered: in a tunnel, not below a bridge.

    Looked at are the sensor's place and, in 24 directions, the places at its height in `AROUND` that are in sight.

    Parameters
    ----------
    state : WorldState
    position : array_like of float, shape (3,)
        [m, world].
    """
    middle = np.asarray(position, dtype=np.float64)
    if not is_sheltered(state, middle)[0]:
        return False
    angle = np.arange(DIRECTIONS) * 2.0 * np.pi / DIRECTIONS
    direction = np.stack([np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)], axis=1)
    free = np.full(DIRECTIONS, np.inf)
    hits = state.cast(middle, direction, max_distance=AROUND[-1])
    free[hits.ray] = hits.distance
    places = middle + np.array(AROUND)[:, None, None] * direction
    seen = places[np.array(AROUND)[:, None] < free]
    return bool(is_sheltered(state, seen).mean() > 0.5) if len(seen) else True
