"""What multiplies the fields of paths multiplies what they change by over an array, too."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.points import point_targets

RADAR = RadarSpec()


def test_a_factor_of_a_path_is_that_of_every_antenna() -> None:
    """Numbers, a number a path, and a number a pair of polarisations: the signal of each pair of antennas follows."""
    rng = np.random.default_rng(3)
    paths = point_targets([[8.0, 1.0, 0.2], [15.0, -2.0, 0.0]], [[0.0, 0.0, 0.0]] * 2, [1.0, 2.0], RADAR, Pose())
    slope = rng.normal(size=(2, 2, 3, 2, 2)) @ np.array([[1.0, 1.0j], [0.5, -1.0]]) * 1e-3
    paths = replace(paths, tx_slope=slope[0], rx_slope=slope[1])
    before = PathGeometry.of(paths, RADAR)
    for factor, of_path in ((0.5j, [0.5j] * 2), (np.array([2.0, -1.0j]), [2.0, -1.0j])):
        after = PathGeometry.of(paths.scaled(factor), RADAR)
        for tx, rx in ((0, 0), (1, 3), (2, 1)):
            expected = before.pair_amplitude(tx, rx) * np.conj(of_path)  # of the beat
            np.testing.assert_allclose(after.pair_amplitude(tx, rx), expected, rtol=1e-12)
    each = rng.normal(size=(2, 2, 2)) + 0j
    scaled = paths.scaled(each)
    np.testing.assert_array_equal(scaled.a, paths.a * each)
    np.testing.assert_array_equal(scaled.tx_slope, slope[0] * each[:, None])
    assert paths.scaled(1.0).over_time is None
