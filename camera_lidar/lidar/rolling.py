"""Ray casting where every ray has its own time.

Static geometry is hit by the rays as they are. For a moving body (an actor, a wheel, a limb), a ray is carried into the
body's frame at the ray's own time, where the body stands still. So both are exact, whatever moves during the scan, and
the engine's scene is moved once and not for every block of time; bodies that bend are moved for slices of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.apart import Apart, stand_apart
from scarl_sionna.engine.world import WorldState
from scarl_sionna.scene.tables import RayHits

from .bent import SLICE, BentSlice
from .motion import Motion, knots

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_PAIRS_AT_ONCE = 1 << 23
"""Pairs of ray and body that are tested at once: 32 MB."""


class RollingCaster:
    """Casts rays with times of their own.

    Parameters
    ----------
    state : WorldState
        At the timestamp.
    duration : float
        Longest time of a ray after the timestamp [s].
    sensor : Motion, optional
        Of the sensor that the rays leave from, at the knots of the same duration: to rule rays out that pass by a body
        around the sensor, such as the car that carries it.
    """

    def __init__(self, state: WorldState, duration: float, sensor: Motion | None = None) -> None:
        self._sensor = sensor
        self._apart = stand_apart(state.world)
        self._radius = np.array([body.radius for body in self._apart.bodies])
        self._motions = _motions(self._apart, state.time, duration)
        self._swept = _swept(self._motions, self._radius)
        self._start, self._duration = state.time, duration
        self._slices: dict[int, BentSlice] = {}

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
            The origins lie within what the sensor moves during the scan, so that most rays can be ruled out by their
            direction.

        Returns
        -------
        RayHits
        """
        if not self._apart.bends:
            return self._cast(None, (origins, directions, times), max_distance, from_sensor)
        found = []
        number = np.clip((times / SLICE).astype(np.int64), 0, max(int(np.ceil(self._duration / SLICE)) - 1, 0))
        for one in np.unique(number).tolist():
            if one not in self._slices:
                start = self._start + one * SLICE
                self._slices[one] = BentSlice(self._apart, start, start + SLICE)
            rows = np.flatnonzero(number == one)
            some = origins if origins.ndim == 1 else origins[rows]
            hits = self._cast(self._slices[one], (some, directions[rows], times[rows]), max_distance, from_sensor)
            found.append(replace(hits, ray=rows[hits.ray]))
        columns = [np.concatenate(column) for column in zip(*(vars(hits).values() for hits in found), strict=True)]
        order = np.argsort(columns[0], kind="stable")
        return RayHits(*(column[order] for column in columns))

    def _cast(
        self,
        bent: BentSlice | None,
        lines: tuple[Array, Array, Array],
        max_distance: float,
        from_sensor: bool,
    ) -> RayHits:
        """Return the hits of rays (origins, directions, times) within one slice, if a body bends, else of all."""
        origins, directions, times = lines
        state = self._apart.state if bent is None else bent.state
        hits = state.cast(origins, directions, max_distance)
        static = self._apart.body_of_part[hits.part] < 0
        if not static.all():  # a body below the scene
            hits = RayHits(*(column[static] for column in vars(hits).values()))
        if not self._motions:
            return hits
        rays, bodies = self._candidates(origins, directions, max_distance, from_sensor)
        if rays.size == 0:
            return hits
        start = np.broadcast_to(origins, directions.shape)[rays]
        moving = self._cast_carried(bent, rays, bodies, (start, directions[rays], times[rays]), max_distance)
        return _nearest(hits, moving)

    def _candidates(
        self, origins: Array, directions: Array, max_distance: float, from_sensor: bool
    ) -> tuple[Index, Index]:
        """Return pairs of ray and actor that may meet, by spheres around all that an actor sweeps during the scan."""
        centre, reach = self._swept
        pairs: list[tuple[Index, Index]] = []
        if not from_sensor:  # rays that go on behind a pane: few, each from its own place
            for body in range(len(self._motions)):
                along = np.einsum("ij,ij->i", centre[body] - origins, directions)
                beside = np.linalg.norm(centre[body] - origins - along[:, None] * directions, axis=1)
                rays = np.flatnonzero((beside <= reach[body]) & (along > -reach[body]))
                pairs.append((rays, np.full(rays.size, body)))
        else:
            lower, upper = np.atleast_2d(origins).min(axis=0), np.atleast_2d(origins).max(axis=0)
            away = centre - (lower + upper) / 2.0
            distance = np.linalg.norm(away, axis=1)
            reach = reach + np.linalg.norm(upper - lower) / 2.0
            near = np.flatnonzero(distance - reach <= max_distance)
            away, distance, reach = away[near], np.maximum(distance[near], 1e-9), reach[near]
            unit = (away / distance[:, None]).astype(np.float32)
            sine = np.minimum(reach / distance, 1.0)
            # float32 is off by 1e-7 in a cosine; the margin is on the safe side
            around = distance <= reach
            for body in near[around]:
                rays = self._past_box(int(body), directions)
                pairs.append((rays, np.full(rays.size, body)))
            near, unit, sine = near[~around], unit[~around], sine[~around]
            cosine = (np.sqrt(1.0 - sine * sine) - 1e-5).astype(np.float32)
            step = max(_PAIRS_AT_ONCE // max(len(near), 1), 1)
            for first in range(0, len(directions), step):
                block = directions[first : first + step].astype(np.float32) @ unit.T
                rays, which = np.nonzero(block >= cosine)
                pairs.append((rays + first, near[which]))
        return np.concatenate([rays for rays, _ in pairs]), np.concatenate([body for _, body in pairs])

    def _past_box(self, body: int, directions: Array) -> Index:
        """Return the rays from the sensor that may meet a body's box, whatever both do during the scan."""
        motion, sensor = self._motions[body], self._sensor
        if sensor is None:
            return np.arange(len(directions))
        places = np.einsum("kji,kj->ki", motion.rotation, sensor.position - motion.position)
        middle = places.mean(axis=0)
        half = self._apart.bodies[body].half_size
        rotation = motion.rotation[len(motion.times) // 2]
        turned = np.linalg.norm(motion.rotation - rotation, axis=(1, 2)).max()  # at least the chord of the angle
        margin = np.linalg.norm(places - middle, axis=1).max() + turned * np.linalg.norm(np.abs(middle) + half) + 1e-2
        enter, leave = np.zeros(len(directions), np.float32), np.full(len(directions), np.inf, np.float32)
        for axis in range(3):
            along = (directions @ rotation[:, axis]).astype(np.float32)
            reach = half[axis] + margin
            with np.errstate(divide="ignore", invalid="ignore"):
                low, high = (np.float32(side * reach - middle[axis]) / along for side in (-1.0, 1.0))
            np.fmax(enter, np.fmin(low, high), out=enter)
            np.fmin(leave, np.fmax(low, high), out=leave)
        return np.flatnonzero(leave >= enter)

    def _cast_carried(
        self,
        bent: BentSlice | None,
        rays: Index,
        bodies: Index,
        lines: tuple[Array, Array, Array],
        max_distance: float,
    ) -> RayHits:
        """Return the hits of rays (origins, directions, times) on the one body each, in no order."""
        apart, (origins, directions, times) = self._apart, lines
        start, direction = np.empty_like(origins), np.empty_like(directions)
        ahead = np.full(len(rays), np.inf)
        for body in np.unique(bodies):
            row = np.flatnonzero(bodies == body)
            motion, time = self._motions[body], times[row]
            local = motion.rotate_back(time, origins[row] - motion.position_at(time))
            along = motion.rotate_back(time, directions[row])
            entry = _sphere_entry(local, along, self._radius[body])
            ahead[row], direction[row] = entry, along
            start[row] = local + np.where(np.isfinite(entry), entry, 0.0)[:, None] * along + apart.centre[body]
        met = np.flatnonzero(ahead <= max_distance)
        state = apart.state if bent is None else bent.state
        hits = state.cast(start[met], direction[met], max_distance=2.0 * float(self._radius.max()) * (1.0 + 1e-6))
        pair = met[hits.ray]
        if bent is None:
            own = hits.distance, hits.normal, np.zeros_like(hits.point)
        else:
            own = bent.placed(start[pair], direction[pair], self._start + times[pair], hits)
        distance = ahead[pair] + own[0]
        good = np.flatnonzero((apart.body_of_part[hits.part] == bodies[pair]) & (distance <= max_distance))
        pair, distance = pair[good], distance[good]
        point = origins[pair] + distance[:, None] * directions[pair]
        normal, velocity = np.empty_like(point), np.empty_like(point)
        for body in np.unique(bodies[pair]):
            row = np.flatnonzero(bodies[pair] == body)
            motion, time = self._motions[body], times[pair[row]]
            normal[row] = motion.rotate(time, own[1][good[row]])
            lever = point[row] - motion.position_at(time)
            velocity[row] = motion.linear_at(time) + np.cross(motion.angular_at(time), lever)
            if bent is not None:
                velocity[row] += motion.rotate(time, own[2][good[row]])
        cosine = hits.cos_incidence[good]
        if bent is not None:
            cosine = np.minimum(np.abs(np.einsum("ni,ni->n", direction[pair], own[1][good])), 1.0)
        seen = cosine, hits.part[good]
        return RayHits(rays[pair], distance, point, normal, *seen, velocity, hits.face[good])


def _motions(apart: Apart, timestamp: float, duration: float) -> list[Motion]:
    times = knots(duration)
    at_times = [apart.motions(timestamp + float(time)) for time in times]
    return [
        Motion.through(times, [(moved.pose, moved.twist) for moved in body]) for body in zip(*at_times, strict=True)
    ]


def _swept(motions: list[Motion], radius: Array) -> tuple[Array, Array]:
    """Return centre and radius of a sphere around all that each body sweeps."""
    ways = [motion.position for motion in motions]
    middle = np.array([(way.min(axis=0) + way.max(axis=0)) / 2.0 for way in ways]).reshape(-1, 3)
    reach = [np.linalg.norm(way - centre, axis=1).max() for way, centre in zip(ways, middle, strict=True)]
    return middle, radius + np.array(reach) + 1e-3  # between two knots a way bends by far less than 1 mm


def _sphere_entry(from_centre: Array, direction: Array, radius: float) -> Array:
    """Return the distance at which rays enter a sphere around the origin, 0 from inside, inf where they miss it."""
    along = np.einsum("ij,ij->i", from_centre, direction)
    discriminant = along * along - np.einsum("ij,ij->i", from_centre, from_centre) + radius * radius
    root = np.sqrt(np.maximum(discriminant, 0.0))
    return np.where((discriminant > 0.0) & (root - along > 0.0), np.maximum(-along - root, 0.0), np.inf)


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
