"""Direction of a point closer than the Fraunhofer distance of its array."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.processing import virtual_cube

BASE = RadarSpec()
WIDE = BASE.with_(
    num_chirps=16,
    num_samples=64,
    tx_positions=((0, 0, 0),),
    rx_positions=tuple((0, y, 0) for y in (0, *np.sort(np.random.default_rng(2).uniform(0, 0.37, 22)).tolist(), 0.37)),
)


@pytest.mark.parametrize("degrees", [-15.0, 0.0, 10.0])
def test_a_point_two_metres_from_a_wide_array_keeps_its_direction(degrees: float) -> None:
    """An array of 0.37 m, off centre: plane waves are degrees off. The direction is that of the planted place."""
    angle = np.radians(degrees)
    place = 2.0 * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    paths = point_targets(place, np.zeros((1, 3)), [1.0], WIDE, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, WIDE, rng=np.random.default_rng(1)), WIDE), WIDE)
    points = detect(rda)
    assert np.degrees(points.azimuth[0]) == pytest.approx(degrees, abs=0.3)
