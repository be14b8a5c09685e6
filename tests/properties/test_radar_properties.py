"""Properties of synthesis that hold for every scene."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize

RADAR = RadarSpec().with_(num_chirps=8, num_samples=32, sampling_frequency=20e6)
FINE = Accuracy(synthesis_tolerance=1e-5)
coordinate = st.floats(-20.0, 20.0)
point = st.tuples(st.floats(5.0, 60.0), coordinate, coordinate)
velocity = st.tuples(st.floats(-70.0, 70.0), coordinate, coordinate)


@settings(max_examples=30, deadline=None)
@given(point, velocity, st.floats(-3.0, 3.0), st.tuples(coordinate, coordinate, coordinate))
def test_signal_does_not_depend_on_the_world_frame(position, speed, yaw, shift):
    pose = Pose.from_euler(shift, yaw=yaw, pitch=0.2, roll=-0.1)
    here = synthesize(point_targets([position], [speed], 1.0, RADAR, Pose()), RADAR, accuracy=FINE)
    there = synthesize(
        point_targets([pose.apply(position)], [pose.rotate(speed)], 1.0, RADAR, pose), RADAR, accuracy=FINE
    )
    # positions of 60 m rounded to 1e-14 m are 1e-11 rad; the NUFFT is within 1e-5 of either
    assert np.abs(here - there).max() <= 3e-5 * np.abs(here).max()


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(point, velocity), min_size=1, max_size=5), st.randoms())
def test_signal_is_the_sum_over_targets_in_any_order(targets, random):
    positions, speeds = np.array([t[0] for t in targets]), np.array([t[1] for t in targets])
    order = list(range(len(targets)))
    random.shuffle(order)
    together = synthesize(point_targets(positions[order], speeds[order], 1.0, RADAR, Pose()), RADAR, accuracy=FINE)
    parts = [
        synthesize(point_targets([p], [v], 1.0, RADAR, Pose()), RADAR, accuracy=FINE)
        for p, v in zip(positions, speeds, strict=True)
    ]
    # 1e-5 for the whole and 1e-5 for the parts, each of its peak, and the rounding of complex64
    bound = sum(np.abs(part).max() for part in parts)
    assert np.abs(together - np.sum(parts, axis=0)).max() <= 3e-5 * bound


@settings(max_examples=30, deadline=None)
@given(point, velocity, st.floats(1e-3, 1e3))
def test_power_is_proportional_to_rcs(position, speed, rcs):
    unit = synthesize(point_targets([position], [speed], 1.0, RADAR, Pose()), RADAR)
    scaled = synthesize(point_targets([position], [speed], rcs, RADAR, Pose()), RADAR)
    assert np.allclose(scaled, unit * np.sqrt(rcs), rtol=1e-5, atol=0.0)
