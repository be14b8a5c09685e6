"""Spray behind vehicles as a lidar meets it: what it takes from echoes, and what it sends back itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincc, gammainccinv

from scarl_sionna.core.specs.lidar import LidarSpec
from scarl_sionna.core.specs.lidar_receiver import HeterodyneReceiver
from scarl_sionna.engine.spray import SprayCloud

from .detection import detection_probability, threshold
from .heterodyne import NO_ECHO, Detections, estimate, keep_strongest
from .link import mean_cnr
from .returns import Echoes, join, take

Array = npt.NDArray[np.float64]

WATER_DENSITY = 1e6
"""[g/m3]."""
MOST_CELLS = 400
"""Range cells of a cloud that are looked at along a shot."""


def extinction_of(cloud: SprayCloud) -> float:
    r"""Return the one-way power extinction coefficient at the densest place of a cloud [1/m].

    .. math:: \alpha = 3.67 \, M / (\rho_w D_0)

    Drops far larger than the wavelength take twice their own area; of an exponential distribution with the median
    volume diameter :math:`D_0` and the water content M that is the above.
    """
    return 3.67 * cloud.water_content / (WATER_DENSITY * cloud.drop_diameter)


def dim_echoes(echoes: Echoes, clouds: Sequence[SprayCloud], origins: Array, directions: Array) -> Echoes:
    """Return echoes that have passed the clouds twice.

    Parameters
    ----------
    echoes : Echoes
    clouds : sequence of SprayCloud
    origins : ndarray of float64, shape (3,) or (num_shots, 3)
        [m, world].
    directions : ndarray of float64, shape (num_shots, 3)
        Unit vectors of the beams' axes [world].

    Notes
    -----
    Beer and Lambert's law over the way through each cloud, there and back, by definition of the extinction
    coefficient.
    """
    if not clouds or echoes.number == 0:
        return echoes
    start = origins if origins.ndim == 1 else origins[echoes.shot]
    depth = _optical_depth(clouds, start, directions[echoes.shot], echoes.distance)
    return replace(echoes, intensity=echoes.intensity * np.exp(-2.0 * depth))


def _optical_depth(clouds: Sequence[SprayCloud], origins: Array, directions: Array, distance: Array) -> Array:
    depth = np.zeros(len(directions))
    for cloud in clouds:
        enter, leave = cloud.chord(origins, directions, distance)
        mean = cloud.mean_density(origins, directions, enter, leave)
        depth += extinction_of(cloud) * (leave - enter) * mean
    return depth


@dataclass(frozen=True, eq=False)
class FreePaths:
    """The air that each shot passes, up to the first surface.

    Attributes
    ----------
    origins : ndarray of float64, shape (3,) or (num_shots, 3)
        [m, world].
    directions : ndarray of float64, shape (num_shots, 3)
        Unit vectors of the beams' axes [world].
    air_velocity : ndarray of float64, shape (num_shots,)
        Radial velocity of the air along each shot [m/s].
    nearest : ndarray of float64, shape (num_shots,)
        Distance of the first surface [m].
    """

    origins: Array
    directions: Array
    air_velocity: Array
    nearest: Array


def add_spray(
    spec: LidarSpec,
    found: Detections,
    clouds: Sequence[SprayCloud],
    paths: FreePaths,
    rng: np.random.Generator,
) -> Detections:
    """Return detections with those of spray among them: in each shot and cloud the first range cell that is detected.

    Parameters
    ----------
    spec : LidarSpec
        With a heterodyne receiver; the cells are of its range resolution, the spray's backscatter is its extinction
        over ``spec.atmosphere.lidar_ratio``.
    found : Detections
    clouds : sequence of SprayCloud
    paths : FreePaths
    rng : numpy.random.Generator
    """
    receiver = spec.receiver
    if not clouds or not isinstance(receiver, HeterodyneReceiver) or not (receiver.backscatter and receiver.noise):
        return found
    rows = [_of_cloud(spec, cloud, paths, rng) for cloud in clouds]
    return keep_strongest(join([found, *rows]), spec.max_returns)


def _of_cloud(spec: LidarSpec, cloud: SprayCloud, paths: FreePaths, rng: np.random.Generator) -> Detections:
    receiver, origins, directions = spec.receiver, paths.origins, paths.directions
    assert isinstance(receiver, HeterodyneReceiver)
    draws = rng.random((3, len(directions)))
    enter, leave = cloud.chord(origins, directions, np.minimum(paths.nearest, spec.max_distance))
    shot = np.flatnonzero(leave - enter > spec.range_resolution)
    start = origins if origins.ndim == 1 else origins[shot]
    direction, enter, leave = directions[shot], enter[shot], leave[shot]
    count = min(int(np.max((leave - enter) / spec.range_resolution, initial=0.0)), MOST_CELLS)
    distance = enter[:, None] + (np.arange(count) + 0.5) * spec.range_resolution
    x = np.broadcast_to(cloud.world_from_cloud.inverse().apply(start), direction.shape)[:, :1]
    fade = np.exp((x + (direction @ cloud.world_from_cloud.rotation)[:, :1] * distance) / cloud.decay_length)
    fade = np.where(distance < leave[:, None], np.minimum(fade, 1.0), 0.0)
    step, extinction = spec.range_resolution, extinction_of(cloud)
    depth = np.cumsum(extinction * fade * step, axis=1) - extinction * fade * step / 2.0
    lost = np.exp(-2.0 * (depth + spec.extinction * distance))
    intensity = np.pi * extinction * fade / spec.atmosphere.lidar_ratio * step * lost / np.maximum(distance, 1e-3) ** 2
    cnr = mean_cnr(spec, intensity, distance)
    looks, level = float(receiver.num_looks), threshold(spec)
    chirps = 2 if receiver.chirps == "up_down" else 1
    grid = np.geomspace(1e-3, max(float(cnr.max(initial=0.0)), 1e-2), 200)
    alone = gammaincc(looks, level) ** chirps
    chance = np.interp(cnr, grid, detection_probability(grid, level, receiver.num_looks, True, chirps), left=alone)
    before = -np.expm1(np.cumsum(np.log1p(-np.clip(chance - alone, 0.0, 1.0 - 1e-12)), axis=1))
    hit = np.flatnonzero(before[:, -1] > draws[0, shot]) if count else np.zeros(0, dtype=np.int64)
    cell = (before[hit] <= draws[0, shot[hit], None]).sum(axis=1)
    place = distance[hit, cell] + (draws[1, shot[hit]] - 0.5) * step
    strength = 1.0 + cnr[hit, cell]
    peak = strength * gammainccinv(looks, draws[2, shot[hit]] * gammaincc(looks, level / strength))
    own = cloud.speed * fade[hit, cell] * (direction[hit] @ cloud.world_from_cloud.rotation[:, 0])
    errors = np.zeros((chirps, hit.size))
    measured, velocity, valid = estimate(spec, place, paths.air_velocity[shot[hit]] + own, errors)
    unit = mean_cnr(spec, 1.0 / np.maximum(measured, 1e-3) ** 2, measured)
    strong = peak / looks - 1.0
    rows = Detections(
        shot[hit],
        np.full(hit.size, NO_ECHO),
        measured,
        velocity,
        strong,
        strong / unit / np.maximum(measured, 1e-3) ** 2,
    )
    return take(rows, np.flatnonzero(valid))
