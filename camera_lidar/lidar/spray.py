"""Spray behind vehicles as a lidar meets it: what it takes from echoes, and what it sends back itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.lidar_ratio import drops_lidar_ratio
from scarl_sionna.engine.spray import SprayCloud

from .returns import Echoes

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

MEDIAN_VOLUME = 3.67
"""Median volume diameter of an exponential distribution of drops over its scale (Ulbrich, J. Clim. Appl. Meteorol. 22,
1983)."""
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
    return MEDIAN_VOLUME * cloud.water_content / (WATER_DENSITY * cloud.drop_diameter)


def backscatter_of(cloud: SprayCloud, spec: LidarSpec) -> float:
    """Return the backscatter coefficient at the densest place of a cloud [1/(m sr)].

    Extinction over the lidar ratio of drops of an exponential distribution, see
    :func:`~scarl_sionna.core.specs.lidar_ratio.drops_lidar_ratio`, or over ``spec.atmosphere.lidar_ratio``.
    """
    ratio = spec.atmosphere.lidar_ratio
    if ratio is None:
        ratio = drops_lidar_ratio(spec.wavelength, cloud.drop_diameter / MEDIAN_VOLUME)
    return extinction_of(cloud) / ratio


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


@dataclass(frozen=True, eq=False)
class CloudCells:
    """A cloud in range cells along the shots that pass it.

    Attributes
    ----------
    shot : ndarray of int64, shape (num_passing,)
    distance : ndarray of float64, shape (num_passing, num_cells)
        Of the middle of each cell [m].
    density : ndarray of float64, shape (num_passing, num_cells)
        Share of that at the densest place; 0 outside of the cloud.
    intensity : ndarray of float64, shape (num_passing, num_cells)
        What each cell sends back, relative to a white diffuser at 1 m.
    """

    shot: Index
    distance: Array
    density: Array
    intensity: Array


def cloud_cells(spec: LidarSpec, cloud: SprayCloud, paths: FreePaths, step: float) -> CloudCells:
    """Return a cloud in cells of a length `step` [m], up to the first surface of each shot.

    As a homogeneous fog's cell, see :func:`camera_lidar.lidar.heterodyne.air.air_profile`, with the density of the
    cloud in it.
    """
    origins, directions = paths.origins, paths.directions
    enter, leave = cloud.chord(origins, directions, np.minimum(paths.nearest, spec.max_distance))
    shot = np.flatnonzero(leave - enter > step)
    start = origins if origins.ndim == 1 else origins[shot]
    direction, enter, leave = directions[shot], enter[shot], leave[shot]
    count = min(int(np.max((leave - enter) / step, initial=0.0)), MOST_CELLS)
    distance = enter[:, None] + (np.arange(count) + 0.5) * step
    x = np.broadcast_to(cloud.world_from_cloud.inverse().apply(start), direction.shape)[:, :1]
    fade = np.exp((x + (direction @ cloud.world_from_cloud.rotation)[:, :1] * distance) / cloud.decay_length)
    fade = np.where(distance < leave[:, None], np.minimum(fade, 1.0), 0.0)
    extinction = extinction_of(cloud)
    depth = np.cumsum(extinction * fade * step, axis=1) - extinction * fade * step / 2.0
    lost = np.exp(-2.0 * (depth + spec.extinction * distance))
    intensity = np.pi * backscatter_of(cloud, spec) * fade * step * lost / np.maximum(distance, 1e-3) ** 2
    return CloudCells(shot, distance, fade, intensity)
