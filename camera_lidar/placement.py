"""One check for both sensors: an optical sensor inside a closed mesh would see nothing but the inside of it."""

from __future__ import annotations

from typing import Any

from scarl_sionna.core.errors import PlacementError
from scarl_sionna.core.pose import Pose


def require_free_view(state: Any, world_from_sensor: Pose, sensor: str) -> None:
    """Raise when a sensor stands inside a closed mesh of the scene.

    Parameters
    ----------
    state : scarl_sionna.world.WorldState
    world_from_sensor : Pose
    sensor : str
        What stands there, for the message: ``"camera"`` or ``"lidar"``.

    Raises
    ------
    PlacementError
        With the position and the name of the instance that encloses it.
    """
    inside = state.inside(world_from_sensor.position)
    if inside is not None:
        x, y, z = world_from_sensor.position
        raise PlacementError(
            f"{sensor} at ({x:.3f}, {y:.3f}, {z:.3f}) m in the world is inside the mesh of '{inside}' at {state.time:.3f} s; "
            "move it outside of the mesh (for a sensor on a vehicle: in front of the body)"
        )
