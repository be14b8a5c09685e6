"""What is around a point: whether it is inside an instance, on a moving one (a sensor is to ride on it), below one."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import ObjectState
from scarl_sionna.scene.tables import InstanceInfo, RayHits

from .geometry import Triangles, encloses, even_directions

Array = npt.NDArray[np.float64]

_SPHERE = even_directions(256)
"""Rays that look for a way out of an actor."""
_WALLED_IN = 0.75
"""Share of them that hit something from within a closed mesh; not so above layers of open ground."""
SLOWEST = 0.1
"""A slower actor [m/s] stands still for a sensor on it: far below a Doppler bin."""
CARRIED_WITHIN = 0.5
"""A sensor this near to a moving actor's box [m] is most likely meant to ride on it: depth of a bumper or of a roof
rack."""


def enclosing(
    point: Array,
    instances: Sequence[InstanceInfo],
    bounds: tuple[Array, Array],
    triangles: Triangles,
    cast: Callable[[Array, Array], RayHits],
    rays_first: bool,
) -> str | None:
    """Return the name of the first instance that encloses a point, or None; rooms do not count.

    Parameters
    ----------
    point : ndarray of float64, shape (3,)
        [m, world].
    instances : sequence of InstanceInfo
    bounds : tuple of ndarray of float64, shape (num_instances, 3)
        Lower and upper corners of the instances' boxes [m, world].
    triangles, cast
        As of :func:`is_enclosed`.
    rays_first : bool
        Whether to look first if so many rays get away that no instance can enclose the point: it takes a third of a
        millisecond where the rays' scene is loaded, where the solid angles of a terrain take five.
    """
    lower, upper = bounds
    for number in np.flatnonzero(((point >= lower) & (point <= upper)).all(axis=1)).tolist():
        info = instances[number]
        if info.is_room:
            continue
        if rays_first and cast(point, _SPHERE).num_hits < _WALLED_IN * len(_SPHERE):
            return None
        if is_enclosed(point, info, triangles, cast):
            return info.name
    return None


def is_enclosed(
    point: Array, instance: InstanceInfo, triangles: Triangles, cast: Callable[[Array, Array], RayHits]
) -> bool:
    """Return whether the mesh of an instance encloses a point.

    An actor made of several shells (a cabin behind separate panes) encloses a point from which no ray gets out.

    Parameters
    ----------
    point : ndarray of float64, shape (3,)
        [m, world].
    instance : InstanceInfo
    triangles : Triangles
        Of all parts [m, world].
    cast : callable
        Of an origin and directions, as :meth:`scarl_sionna.WorldState.cast`.
    """
    if encloses(point, triangles.of_parts(instance.parts)) and cast(point, _SPHERE).num_hits >= _WALLED_IN * len(
        _SPHERE
    ):
        return True
    if instance.actor is None:
        return False
    return bool(np.isin(cast(point, _SPHERE).part, list(instance.parts)).sum() == len(_SPHERE))


def is_left_behind(pose: Pose, box: ObjectState) -> bool:
    """Return whether a sensor at rest at a pose [world] is in or near (`CARRIED_WITHIN`) an object that moves."""
    offset = np.abs(box.world_from_box.inverse().apply(pose.position)) - box.size / 2.0
    return float(np.linalg.norm(box.twist.linear)) > SLOWEST and float(offset.max()) <= CARRIED_WITHIN


def hits_above(cast: Callable[..., RayHits], points: npt.ArrayLike, reach: float) -> RayHits:
    """Return what is first straight above places, shape (num_points, 3) [m, world], up to `reach` [m] higher.

    `cast` is :meth:`scarl_sionna.WorldState.cast`.
    """
    place = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    return cast(place, np.broadcast_to([0.0, 0.0, 1.0], place.shape), max_distance=reach)
