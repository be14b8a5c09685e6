"""Spray behind vehicles as the heterodyne receiver meets it: peaks of the chirps over the clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camera_lidar.lidar.spray import FreePaths, cloud_cells
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.engine.spray import SprayCloud

from .air import AirPeaks, excess_peaks
from .link import mean_cnr


def spray_peaks(
    spec: LidarSpec, clouds: Sequence[SprayCloud], paths: FreePaths, rng: np.random.Generator
) -> list[AirPeaks]:
    """Return the peaks of the chirps over clouds of spray: of each cloud those of the up chirp, then of the down chirp.

    Parameters
    ----------
    spec : LidarSpec
        With a heterodyne receiver; the cells are of its range resolution.
    clouds : sequence of SprayCloud
    paths : FreePaths
    rng : numpy.random.Generator

    Notes
    -----
    As for fog, see :func:`.air.weather_peaks`, with the density of the cloud in each cell. The drops right behind the
    vehicle move with it and slow down as the cloud thins.
    """
    receiver = spec.receiver
    if not isinstance(receiver, HeterodyneReceiver) or not (receiver.backscatter and receiver.noise):
        return []
    chirps = 2 if receiver.chirps == "up_down" else 1
    return [_of_cloud(spec, cloud, paths, rng) for cloud in clouds for _ in range(chirps)]


def _of_cloud(spec: LidarSpec, cloud: SprayCloud, paths: FreePaths, rng: np.random.Generator) -> AirPeaks:
    step = spec.range_resolution
    cells = cloud_cells(spec, cloud, paths, step)
    cnr = mean_cnr(spec, cells.intensity, cells.distance)
    row, cell = np.nonzero(rng.poisson(excess_peaks(spec, cnr)))
    place = cells.distance[row, cell] + (rng.random(row.size) - 0.5) * step
    shot = cells.shot[row]
    own = cloud.speed * cells.density[row, cell] * (paths.directions[shot] @ cloud.world_from_cloud.rotation[:, 0])
    return AirPeaks(shot, place, paths.air_velocity[shot] + own, cnr[row, cell])
