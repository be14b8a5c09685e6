"""Detection in beams: a weak target beside a strong one of another direction, and nothing else than that."""

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
from scarl_sionna.signal.processing import virtual_cube

RADAR = RadarSpec().with_(num_chirps=32, num_samples=64)
HALF = 0.5 * RADAR.wavelength


def mapped(radar: RadarSpec, azimuth_deg: list[float], distance: list[float], rcs: list[float]) -> RangeDopplerAngle:
    """Return the map of targets at rest; distances in range bins."""
    azimuth, away = np.radians(azimuth_deg), np.array(distance) * radar.range_resolution
    places = away[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(len(away))], axis=1)
    paths = point_targets(places, np.zeros_like(places), rcs, radar, Pose())
    return range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(2)), radar), radar)


def row_of(points: RadarPoints, radar: RadarSpec, azimuth_deg: float, distance: float) -> np.ndarray:
    near = np.abs(points.range / radar.range_resolution - distance) < 0.3
    return np.flatnonzero(near & (np.abs(np.degrees(points.azimuth) - azimuth_deg) < 1.5))


@pytest.mark.parametrize("kind", ["ca", "os"])
def test_a_weak_target_beside_a_strong_one_of_another_direction_is_found_in_its_beam(kind: str) -> None:
    """20 dB weaker, two cells further: on the flank of the strong one in the sum over channels."""
    rda = mapped(RADAR, [-20.0, 17.0], [20.3, 22.3], [100.0, 1.0])
    assert not len(row_of(detect(rda, kind=kind, most_directions=1), RADAR, 17.0, 22.3))
    points = detect(rda, pfa=1e-8, per_beam=True, kind=kind)
    mine = row_of(points, RADAR, 17.0, 22.3)
    assert len(mine) == 1 and points.num_points == 2
    assert points.rcs[mine[0]] == pytest.approx(1.0, rel=0.3)
    assert points.rcs[0] == pytest.approx(100.0, rel=0.05)
    every = detect(rda, pfa=1e-8, per_beam=True, peaks_only=False, kind=kind)
    assert every.num_points > 2 and len(row_of(every, RADAR, 17.0, 22.3))


def test_the_sidelobes_of_a_lone_target_are_no_points() -> None:
    """They stand 13 to 25 dB under it in other beams, far over the noise."""
    points = detect(mapped(RADAR, [8.0], [20.3], [100.0]), pfa=1e-8, per_beam=True)
    assert points.num_points == 1
    assert np.degrees(points.azimuth[0]) == pytest.approx(8.0, abs=0.05)


def test_a_near_target_is_not_seen_at_the_largest_ranges() -> None:
    """Its rows beside leak over the end of the range axis as well, without a maximum of a beam of their own."""
    radar = RadarSpec().with_(num_chirps=64)
    paths = point_targets([[1.0, 0.05, 0.0]], np.zeros((1, 3)), 1.0, radar, Pose())
    adc = synthesize(paths, radar, rng=np.random.default_rng(0))
    points = detect(range_doppler_angle(virtual_cube(adc, radar), radar), pfa=1e-8, per_beam=True)
    assert points.range[0] == pytest.approx(np.hypot(1.0, 0.05), abs=0.02)
    assert points.range.max() < 0.5 * radar.max_range


@pytest.mark.parametrize(
    "radar",
    [
        RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),)),
        RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=tuple((0, 0, HALF * i) for i in range(4))),
        RADAR.with_(tx_positions=((0, 0, 0), (0, 0, HALF)), rx_positions=tuple((0, HALF * i, 0) for i in range(4))),
    ],
    ids=["one element", "a column", "two rows"],
)
def test_arrays_of_any_extent_have_beams(radar: RadarSpec) -> None:
    rda = mapped(radar, [0.0], [20.3], [100.0])
    summed, beams = detect(rda, pfa=1e-8), detect(rda, pfa=1e-8, per_beam=True)
    assert beams.num_points == summed.num_points == 1
    assert beams.position[0] == pytest.approx(summed.position[0], abs=0.02)


def test_targets_beyond_the_unambiguous_velocity_stay() -> None:
    """Their beams fall apart in the map, so that the direction is not that of a beam."""
    radar = RADAR.with_(multiplexing=Tdm())
    place = np.array([[20.3 * radar.range_resolution, 2.0, 0.0]])
    velocity = np.array([[1.6 * radar.unambiguous_velocity, 0.0, 0.0]])
    paths = point_targets(place, velocity, 100.0, radar, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(2)), radar), radar)
    summed, beams = detect(rda, pfa=1e-8), detect(rda, pfa=1e-8, per_beam=True)
    assert beams.position[0] == pytest.approx(summed.position[0], abs=0.02)
    assert beams.radial_velocity[0] == pytest.approx(summed.radial_velocity[0], abs=0.01)
