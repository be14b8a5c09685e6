"""Intersection of rays with a scene in double precision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine import variant
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.threads import many_threads
from scarl_sionna.scene.tables import RayHits

from .geometry import Triangles, refine_distance
from .nearby import EngineScene

Array = npt.NDArray[np.float64]

RAYS_PER_BATCH = 1 << 20
"""Rays that are worked on at once: about 200 MB of temporary arrays. Changes no result."""


class Target(NamedTuple):
    """What rays are cast at."""

    scene: EngineScene
    """Finds which triangle a ray hits, in single precision."""
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
    ray, row, rough = _engine_hits(target.scene, origins, directions, max_distance)
    part = triangles.part[row].astype(np.int32)
    start = origins if origins.ndim == 1 else origins[ray]
    direction = directions[ray]
    normal = triangles.normal[row]
    distance, cosine = refine_distance(start, direction, normal, triangles.offset[row], rough)
    normal *= -np.sign(cosine)[:, None]
    point = start + distance[:, None] * direction
    velocity = target.velocity(part, point, row)
    return RayHits(ray + first, distance, point, normal, np.minimum(np.abs(cosine), 1.0), part, velocity, row)


def _engine_hits(
    scene: EngineScene, origins: Array, directions: Array, max_distance: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """Return number, row of the triangle and the engine's distance [m] of each ray that hits, in their order."""
    import drjit as dr

    with variant.use(scene.kind) as mi:
        on = Device(mi)
        origin = np.broadcast_to(origins if scene.origin is None else origins - scene.origin, directions.shape)
        ray = mi.Ray3f(mi.Point3f(on.single_vectors(origin)), mi.Vector3f(on.single_vectors(directions)))
        if np.isfinite(max_distance):
            ray.maxt = mi.Float(float(max_distance))
        with many_threads(len(directions)):
            found = scene.mi_scene.ray_intersect_preliminary(ray, coherent=True)
            distance, face = found.t, scene.faces(found)
            dr.eval(distance, face)
            distance, face = distance.numpy(), face.numpy()
    hit = np.flatnonzero(np.isfinite(distance) & (face >= 0))
    return hit, face[hit].astype(np.int64), distance[hit]
