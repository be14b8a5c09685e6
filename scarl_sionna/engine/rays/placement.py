"""Refuses sensors that stand inside a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import PlacementError

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


def check_placement(state: WorldState, point: npt.ArrayLike, what: str) -> None:
    """Raise unless a point stands free of every closed mesh.

    Parameters
    ----------
    state : WorldState
    point : array_like of float, shape (3,)
        [m, world].
    what : str
        What stands there, for the message: ``"radar"``, ``"camera"``, ``"tx antenna 2"``.

    Raises
    ------
    PlacementError
        If the point is not finite, or a mesh encloses it.
    """
    position = np.asarray(point, dtype=np.float64)
    where = "(" + ", ".join(f"{value:.3f}" for value in np.ravel(position)) + ") m"
    if position.shape != (3,) or not np.isfinite(position).all():
        raise PlacementError(f"{what} at {where}: a position of three finite coordinates [m] is needed")
    name = state.inside(position)
    if name is not None:
        raise PlacementError(
            f"{what} at {where} (world frame) is inside '{name}', where it sees nothing but the mesh around it; "
            "move it outside, for a sensor on a car at least a few centimetres in front of the body"
        )
