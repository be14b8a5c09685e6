"""Detection of a target on the flank of a stronger one: a range bin or a Doppler bin apart, in another direction."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.multiplexing import Tdm
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import RangeDopplerAngle, range_doppler_angle
from scarl_sionna.signal.detection import RadarPoints, detect
from scarl_sionna.signal.direction.several import Directions
from scarl_sionna.signal.processing import virtual_cube

RADAR = RadarSpec().with_(num_chirps=64, num_samples=128)
TDM = RADAR.with_(multiplexing=Tdm())
RANGE, VELOCITY = RADAR.range_resolution, RADAR.velocity_resolution


def mapped(
    radar: RadarSpec, azimuth_deg: list[float], distance: list[float], velocity: list[float], rcs_dbsm: list[float]
) -> RangeDopplerAngle:
    azimuth = np.radians(azimuth_deg)
    away = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(azimuth))], axis=1)
    places, speeds = np.array(distance)[:, None] * away, np.array(velocity)[:, None] * away
    paths = point_targets(places, speeds, list(10.0 ** (np.array(rcs_dbsm) / 10.0)), radar, Pose())
    return range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(2)), radar), radar)


def is_second_right(points: RadarPoints, distance: float, velocity: float, rcs_dbsm: float) -> bool:
    mine = np.flatnonzero(np.abs(np.degrees(points.azimuth) - 24.0) < 3.0)
    return (
        len(mine) == 1
        and abs(points.range[mine[0]] - distance) < 0.3 * RANGE
        and abs(points.radial_velocity[mine[0]] - velocity) < 0.3 * VELOCITY
        and abs(10.0 * np.log10(points.rcs[mine[0]]) - rcs_dbsm) < 1.0
    )


@pytest.mark.parametrize("bins", [(1.0, 0.0), (1.1, 0.0), (1.6, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, 1.5), (1.0, -1.0)])
@pytest.mark.parametrize(("radar", "second"), [(RADAR, 10.0), (RADAR, 4.8), (RADAR, -8.0), (TDM, 4.8), (TDM, -8.0)])
def test_a_target_a_bin_beside_a_stronger_one_has_its_place_and_power(
    radar: RadarSpec, second: float, bins: tuple[float, float]
) -> None:
    """It has no maximum of the summed power, and the tone of the stronger one has a null on its cell."""
    places = 34.3 * RANGE, 34.3 * RANGE + bins[0] * RANGE
    speeds = 1.2 * VELOCITY, 1.2 * VELOCITY + bins[1] * radar.velocity_resolution
    points = detect(mapped(radar, [2.0, 24.0], list(places), list(speeds), [10.0, second]))
    assert is_second_right(points, places[1], speeds[1], second)
    assert points.num_points == 2
    assert np.degrees(points.azimuth[np.abs(np.degrees(points.azimuth)) < 6.0]) == pytest.approx([2.0], abs=0.2)


@pytest.mark.parametrize("azimuth_deg", [0.0, 20.0, 60.0])
@pytest.mark.parametrize("radar", [RADAR, TDM], ids=["ideal", "tdm"])
def test_the_flank_of_a_lone_target_is_none(radar: RadarSpec, azimuth_deg: float) -> None:
    for place in np.linspace(20.0, 21.0, 6):
        for rcs_dbsm in (0.0, 20.0, 35.0):
            rda = mapped(radar, [azimuth_deg], [place * RANGE], [3.3 * VELOCITY], [rcs_dbsm])
            assert detect(rda).num_points == detect(rda, most_directions=1).num_points


def test_one_direction_of_each_cell_leaves_the_flank_alone() -> None:
    rda = mapped(RADAR, [2.0, 24.0], [34.3 * RANGE, 35.3 * RANGE], [0.0, 0.0], [10.0, 4.8])
    assert detect(rda, most_directions=1).num_points == 1


def test_powers_measured_anew_keep_to_the_dynamic_range() -> None:
    cell = np.array([0, 0, 1, 1, 1])
    found = Directions(cell, np.zeros((5, 2)), np.ones(5, dtype=np.complex128), np.ones((5, 4), dtype=np.complex128))
    kept = found.is_within_range(np.array([1.0, 1.0e-5, 1.0e-6, 2.0e-3, 1.0]))
    assert kept.tolist() == [True, False, True, True, True]
