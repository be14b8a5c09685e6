"""Ray casting where every ray has its own time.

Static geometry is hit by the rays as they are. For an actor, a ray is carried into the actor's frame at the ray's own time, where the
actor stands still: so both are exact, whatever moves during the scan, and the engine's scene is moved once and not for every
block of time. All actors stand apart from the scene and from each other in one state of the world, so that a ray meets only
the one that it was carried to.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.world.scene import RayHits, World, WorldState

from .motion import actor_motion

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_BLOCK = 1 << 18
"""Rays that are tested against all actors at once: 2 MB for each actor."""


@dataclass(frozen=True, eq=False)
class _Apart:
    """A state of a world in which every actor stands alone; spheres that hold the actors, in their own frames."""

    state: WorldState
    centre: Array
    radius: Array
    offset: Array


_apart: WeakKeyDictionary[World, _Apart] = WeakKeyDictionary()


def _stand_apart(world: World) -> _Apart:
    if world not in _apart:
        infos = [world.instances[actor.instance] for actor in world.actors]
        centre = np.array([info.frame_from_box.position for info in infos]).reshape(-1, 3)
        radius = np.array([np.linalg.norm(info.size) / 2.0 for info in infos]) * (1.0 + 1e-6) + 1e-6
        static = [info for info in world.instances.values() if info.actor is None]
        lowest = min((info.frame_from_box.position[2] - info.size[2] / 2.0 for info in static), default=0.0)
        # a carried ray starts on the sphere and runs at most two radii: it stays within three of the centre
        largest = float(radius.max(initial=0.0))
        side = int(np.ceil(np.sqrt(max(len(infos), 1))))
        row, column = np.divmod(np.arange(len(infos)), side)
        cell = np.stack([column - side / 2.0, row - side / 2.0, np.zeros(len(infos))], axis=-1) * 7.0 * largest
        offset = cell + [0.0, 0.0, lowest - 4.0 * largest - 1.0] - centre
        poses = {actor.name: Pose(offset[index]) for index, actor in enumerate(world.actors)}
        twists = {actor.name: Twist() for actor in world.actors}
        _apart[world] = _Apart(WorldState(world, 0.0, poses, twists), centre, radius, offset)
    return _apart[world]


class RollingCaster:
    """Casts rays with times of their own.

    Parameters
    ----------
    state : WorldState
        At the timestamp.
    duration : float
        Longest time of a ray after the timestamp [s].
    """

    def __init__(self, state: WorldState, duration: float) -> None:
        self.world = state.world
        self._scene = _stand_apart(state.world)
        self._motions = [actor_motion(actor.trajectory, state.time, duration) for actor in self.world.actors]

    def cast(self, origins: Array, directions: Array, times: Array, max_distance: float, from_sensor: bool) -> RayHits:
        """Intersect rays with the scene as it stands at each ray's own time.

        Parameters
        ----------
        origins : ndarray, shape (3,) or (num_rays, 3)
            [m, world].
        directions : ndarray, shape (num_rays, 3)
            Unit vectors [world].
        times : ndarray, shape (num_rays,)
            After the timestamp [s].
        max_distance : float
            [m].
        from_sensor : bool
            The origins lie within what the sensor moves during the scan, so that most rays can be ruled out by their direction.

        Returns
        -------
        RayHits
        """
        hits = _only(self._scene.state.cast(origins, directions, max_distance), self.world.parts.actor, static=True)
        if not self._motions:
            return hits
        rays, actors = self._candidates(origins, directions, max_distance, from_sensor)
        if rays.size == 0:
            return hits
        start = np.broadcast_to(origins, directions.shape)[rays]
        moving = self._cast_carried(rays, actors, start, directions[rays], times[rays], max_distance)
        return _nearest(hits, moving)

    def _candidates(
        self, origins: Array, directions: Array, max_distance: float, from_sensor: bool
    ) -> tuple[Index, Index]:
        """Return pairs of ray and actor that may meet, by spheres around all that an actor sweeps during the scan."""
        centre, reach = self._swept
        if not from_sensor or origins.ndim == 1:
            middle, spread = np.zeros(3), 0.0
            if origins.ndim == 1:
                middle = origins
        else:
            lower, upper = origins.min(axis=0), origins.max(axis=0)
            middle, spread = (lower + upper) / 2.0, float(np.linalg.norm(upper - lower)) / 2.0
        pairs: list[tuple[Index, Index]] = []
        if not from_sensor:  # rays that go on behind a pane: few, each from its own place
            for actor in range(len(self._motions)):
                along = np.einsum("ij,ij->i", centre[actor] - origins, directions)
                beside = np.linalg.norm(centre[actor] - origins - along[:, None] * directions, axis=1)
                rays = np.flatnonzero((beside <= reach[actor]) & (along > -reach[actor]))
                pairs.append((rays, np.full(rays.size, actor)))
        else:
            away = centre - middle
            distance = np.linalg.norm(away, axis=1)
            reach = reach + spread
            near = np.flatnonzero(distance - reach <= max_distance)
            inside = distance[near] <= reach[near]
            unit = away[near] / np.maximum(distance[near], 1e-9)[:, None]
            sine = np.minimum(reach[near] / np.maximum(distance[near], 1e-9), 1.0)
            # float32 is off by 1e-7 in a cosine; the margin is on the safe side
            cosine = np.where(inside, -2.0, np.sqrt(1.0 - sine * sine) - 1e-5).astype(np.float32)
            for first in range(0, len(directions), _BLOCK):
                block = directions[first : first + _BLOCK].astype(np.float32) @ unit.T.astype(np.float32)
                rays, which = np.nonzero(block >= cosine)
                pairs.append((rays + first, near[which]))
        return np.concatenate([rays for rays, _ in pairs]), np.concatenate([actor for _, actor in pairs])

    @property
    def _swept(self) -> tuple[Array, Array]:
        """Return centre and radius of a sphere around all that each actor sweeps."""
        scene = self._scene
        paths = [
            motion.position + motion.rotation @ centre
            for motion, centre in zip(self._motions, scene.centre, strict=True)
        ]
        middle = np.array([(path.min(axis=0) + path.max(axis=0)) / 2.0 for path in paths])
        reach = [np.linalg.norm(path - centre, axis=1).max() for path, centre in zip(paths, middle, strict=True)]
        return middle, scene.radius + np.array(reach) + 1e-3  # between two knots the way bends by far less than 1 mm

    def _cast_carried(
        self, rays: Index, actors: Index, origins: Array, directions: Array, times: Array, max_distance: float
    ) -> RayHits:
        """Return the hits of rays on the one actor each, in no order."""
        scene = self._scene
        start, direction = np.empty_like(origins), np.empty_like(directions)
        ahead = np.full(len(rays), np.inf)
        for actor in np.unique(actors):
            row = np.flatnonzero(actors == actor)
            motion, time = self._motions[actor], times[row]
            local = motion.rotate_back(time, origins[row] - motion.position_at(time))
            along = motion.rotate_back(time, directions[row])
            ahead[row] = _sphere_entry(local - scene.centre[actor], along, scene.radius[actor])
            direction[row] = along
            start[row] = (
                local + np.where(np.isfinite(ahead[row]), ahead[row], 0.0)[:, None] * along + scene.offset[actor]
            )
        met = np.flatnonzero(ahead <= max_distance)
        hits = scene.state.cast(start[met], direction[met], max_distance=2.0 * float(scene.radius.max()) * (1.0 + 1e-6))
        pair = met[hits.ray]
        distance = ahead[pair] + hits.distance
        good = np.flatnonzero((self.world.parts.actor[hits.part] == actors[pair]) & (distance <= max_distance))
        pair, distance = pair[good], distance[good]
        point = origins[pair] + distance[:, None] * directions[pair]
        normal, velocity = np.empty_like(point), np.empty_like(point)
        for actor in np.unique(actors[pair]):
            row = np.flatnonzero(actors[pair] == actor)
            motion, time = self._motions[actor], times[pair[row]]
            normal[row] = motion.rotate(time, hits.normal[good[row]])
            lever = point[row] - motion.position_at(time)
            velocity[row] = motion.linear_at(time) + np.cross(motion.angular_at(time), lever)
        return RayHits(rays[pair], distance, point, normal, hits.cos_incidence[good], hits.part[good], velocity)


def _sphere_entry(from_centre: Array, direction: Array, radius: float) -> Array:
    """Return the distance at which rays enter a sphere around the origin, 0 from inside, inf where they miss it."""
    along = np.einsum("ij,ij->i", from_centre, direction)
    discriminant = along * along - np.einsum("ij,ij->i", from_centre, from_centre) + radius * radius
    root = np.sqrt(np.maximum(discriminant, 0.0))
    return np.where((discriminant > 0.0) & (root - along > 0.0), np.maximum(-along - root, 0.0), np.inf)


def _only(hits: RayHits, actor_of_part: npt.NDArray[np.int32], static: bool) -> RayHits:
    """Return the hits on static parts (or on actors)."""
    keep = (actor_of_part[hits.part] < 0) == static
    return hits if keep.all() else RayHits(*(column[keep] for column in vars(hits).values()))


def _nearest(first: RayHits, second: RayHits) -> RayHits:
    """Return the nearest hit of every ray of two sets, in ray order; `first` is in ray order with one hit a ray."""
    order = np.lexsort((second.distance, second.ray))
    order = order[np.flatnonzero(np.diff(second.ray[order], prepend=-1))]
    at = np.searchsorted(first.ray, second.ray[order])
    there = at < first.num_hits
    there[there] = first.ray[at[there]] == second.ray[order[there]]
    nearer = np.ones(order.size, dtype=bool)
    nearer[there] = second.distance[order[there]] < first.distance[at[there]]
    replaced = at[there & nearer]
    keep = np.ones(first.num_hits, dtype=bool)
    keep[replaced] = False
    order = order[nearer]
    ray = np.concatenate([first.ray[keep], second.ray[order]])
    sorting = np.argsort(ray, kind="stable")
    columns = (
        np.concatenate([a[keep], b[order]])[sorting]
        for a, b in zip(vars(first).values(), vars(second).values(), strict=True)
    )
    return RayHits(*columns)
