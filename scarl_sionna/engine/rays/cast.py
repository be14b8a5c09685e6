"""Intersection of rays with a scene in double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.twins import Twin
from scarl_sionna.scene.tables import RayHits

from .geometry import Triangles, refine_distance

Array = npt.NDArray[np.float64]

RAYS_PER_BATCH = 1 << 20
"""Rays that are worked on at once: about 200 MB of temporary arrays. Changes no result."""


class Target(NamedTuple):
    """What rays are cast at."""

    twin: Twin
    """Finds which triangle a ray hits, in single precision; stands in the state."""
    triangles: Triangles
    """The same triangles [m, world] in double precision."""
    velocity: Callable[[npt.NDArray[Any], Array, npt.NDArray[np.int64]], Array]
    """Velocity [m/s] of points, shape (n, 3), from rows of parts (n,), points [m, world] and faces (n,)."""


def cast_rays(target: Target, origins: Array, directions: Array, max_distance: float) -> RayHits:
    """Intersect rays with a scene; see :meth:`scarl_sionna.WorldState.cast`.

    Parameters
    ----------
    target : Target
    origins : ndarray of float64, shape (3,) or (num_rays, 3)
        [m, world].
    directions : ndarray of float64, shape (num_rays, 3)
        Unit vectors [world].
    max_distance : float
        Nothing is hit beyond [m].

    Returns
    -------
    RayHits
    """
    batches = []
    for first in range(0, max(len(directions), 1), RAYS_PER_BATCH):
        rows = slice(first, min(first + RAYS_PER_BATCH, len(directions)))
        some_origins = origins if origins.ndim == 1 else origins[rows]
        batches.append(_batch(target, some_origins, directions[rows], first, max_distance))
    if len(batches) == 1:
        return batches[0]
    joined = (np.concatenate(column) for column in zip(*(vars(batch).values() for batch in batches), strict=True))
    return RayHits(*joined)


def _batch(target: Target, origins: Array, directions: Array, first: int, max_distance: float) -> RayHits:
    """Return the hits of one batch, whose first ray has the number `first`."""
    if len(directions) == 0:
        return RayHits.none()
    triangles = target.triangles
    ray, part, face, rough = target.twin.intersect(origins, directions, max_distance)
    row = triangles.first[part] + face
    start = origins if origins.ndim == 1 else origins[ray]
    direction = directions[ray]
    normal = triangles.normal[row]
    distance, cosine = refine_distance(start, direction, normal, triangles.offset[row], rough)
    normal *= -np.sign(cosine)[:, None]
    point = start + distance[:, None] * direction
    velocity = target.velocity(part, point, row)
    return RayHits(ray + first, distance, point, normal, np.minimum(np.abs(cosine), 1.0), part, velocity, row)
