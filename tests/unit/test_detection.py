"""Points from maps: direction to the maximum of the beamformer, not to the next direction of the map."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle, steering
from scarl_sionna.signal.detection import cfar, detect
from scarl_sionna.signal.processing import range_doppler, virtual_cube

RADAR = RadarSpec().with_(num_chirps=32, num_samples=64)


@pytest.mark.parametrize("azimuth_deg", [-41.3, -7.7, 0.4, 22.3])
def test_the_azimuth_of_one_point_is_that_of_the_beamformers_maximum(azimuth_deg: float) -> None:
    azimuth = np.radians(azimuth_deg)
    place = 20.0 * RADAR.range_resolution * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    cube = virtual_cube(synthesize(point_targets([place], [np.zeros(3)], 1.0, RADAR, Pose()), RADAR), RADAR)
    rda = range_doppler_angle(cube, RADAR)
    points = detect(rda, RADAR)
    found = float(points.azimuth[points.power.argmax()])
    rd = rda.range_doppler
    cell = np.unravel_index(rd.power.argmax(), rd.power.shape)
    snapshot = rd.data[(slice(None), *cell)].astype(np.complex128)

    def against(angle: float) -> float:
        beam = steering(RADAR, np.array([[np.cos(angle), np.sin(angle), 0.0]]))[0]
        return -(abs(np.vdot(beam, snapshot)) ** 2)

    best = minimize_scalar(against, bounds=(found - 0.1, found + 0.1), method="bounded", options={"xatol": 1e-10}).x
    assert found == pytest.approx(best, abs=2e-6)  # the power is flat there: float64 cannot tell 1e-7 rad apart
    assert best == pytest.approx(azimuth, abs=2e-4)  # a wavefront from 10 m is curved over 2 cm


def test_a_wall_beside_a_cell_does_not_count_as_its_noise() -> None:
    """Guard cells are left out and training cells beyond them count: with the guard at 0 a wide echo hides itself."""
    rng = np.random.default_rng(1)
    cube = 1e-9 * (rng.normal(size=(12, 32, 64)) + 1j * rng.normal(size=(12, 32, 64)))
    place = [[20.0 * RADAR.range_resolution, 0.0, 0.0]]
    cube = cube + virtual_cube(synthesize(point_targets(place, np.zeros((1, 3)), 1.0, RADAR, Pose()), RADAR), RADAR)
    rd = range_doppler(cube.astype(np.complex64), RADAR)
    row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
    with_guard, without = cfar(rd, guard=(3, 3), training=(6, 8)), cfar(rd, guard=(0, 0), training=(1, 1))
    assert with_guard[row, column] and with_guard[row, column + 1]
    assert not without[row, column + 1]
