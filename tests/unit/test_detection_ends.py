"""What a radar cannot measure is not invented: ranges at the ends of the axis, directions, velocities of one chirp."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import RadarPoints, cfar, detect
from scarl_sionna.signal.processing import range_doppler, virtual_cube

RADAR = RadarSpec().with_(num_chirps=32, num_samples=64)


def seen(radar: RadarSpec, position: object, velocity: object = (0.0, 0.0, 0.0), **options: object) -> RadarPoints:
    paths = point_targets([position], [velocity], 1.0, radar, Pose())
    adc = synthesize(paths, radar, rng=np.random.default_rng(0))
    return detect(range_doppler_angle(virtual_cube(adc, radar), radar), radar, **options)


@pytest.mark.parametrize("distance", [0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize("window", ["hann", "rect"])
def test_a_near_target_is_not_seen_at_the_largest_ranges(distance: float, window: str) -> None:
    radar = RadarSpec()
    paths = point_targets([[distance, 0.05, 0.0]], np.zeros((1, 3)), 1.0, radar, Pose())
    adc = synthesize(paths, radar, rng=np.random.default_rng(0))
    points = detect(range_doppler_angle(virtual_cube(adc, radar), radar, window), radar)
    assert points.range.max() < 0.51 * radar.max_range
    assert points.rcs[0] == pytest.approx(1.0, rel=0.05)
    if window == "hann":  # without a window sidelobes of -50 dB stand at a hundred metres, as giants
        assert points.rcs.max() == pytest.approx(1.0, rel=0.05)
    assert points.range[0] == pytest.approx(np.hypot(distance, 0.05), abs=0.02)


def test_ranges_are_not_negative() -> None:
    rng = np.random.default_rng(3)
    cube = rng.normal(size=(12, 32, 64)) + 1j * rng.normal(size=(12, 32, 64))
    points = detect(range_doppler_angle(cube.astype(np.complex64), RADAR), pfa=0.2, peaks_only=False)
    assert points.num_points > 200 and points.range.min() >= 0.0 and np.isfinite(points.rcs).all()


def test_an_array_of_one_column_reports_no_azimuth_and_one_element_no_direction() -> None:
    half = 0.5 * RADAR.wavelength
    column = RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=tuple((0, 0, half * (i - 1.5)) for i in range(4)))
    points = seen(column, [14.0, 8.0, 2.0])
    assert points.azimuth[0] == 0.0
    assert points.elevation[0] == pytest.approx(np.arcsin(2.0 / np.sqrt(264.0)), abs=0.01)
    one = RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    points = seen(one, [14.0, 0.0, 0.0])
    assert points.azimuth[0] == points.elevation[0] == 0.0
    assert points.position[0] == pytest.approx([14.0, 0.0, 0.0], abs=0.02)


def test_a_frame_of_one_chirp_has_points_without_velocity() -> None:
    points = seen(RADAR.with_(num_chirps=1), [14.3, 3.0, 0.0], pfa=1e-4)
    assert points.range[0] == pytest.approx(np.hypot(14.3, 3.0), abs=0.05 * RADAR.range_resolution)
    assert points.azimuth[0] == pytest.approx(np.arctan2(3.0, 14.3), abs=0.01)
    assert (points.radial_velocity == 0.0).all()


@pytest.mark.parametrize(("num_chirps", "num_samples"), [(2, 5), (2, 64), (64, 2)])
def test_an_axis_of_two_bins_has_no_training_cells(num_chirps: int, num_samples: int) -> None:
    """The default window was larger than such a map, and refused itself."""
    radar = RADAR.with_(num_chirps=num_chirps, num_samples=num_samples)
    noise = np.random.default_rng(5).normal(size=(2, 12, num_chirps, num_samples))
    cube = (1e-9 * (noise[0] + 1j * noise[1])).astype(np.complex64)
    rda = range_doppler_angle(cube, radar)
    assert detect(rda, radar).num_points == 0
    assert detect(rda, radar, pfa=0.5, peaks_only=False).num_points > 0


def test_a_map_of_one_cell_has_no_threshold() -> None:
    radar = RADAR.with_(num_chirps=1, num_samples=1)
    cube = np.ones((12, 1, 1), np.complex64)
    with pytest.raises(ParameterRangeError, match="3 bins or more"):
        detect(range_doppler_angle(cube, radar), radar)


def test_settings_of_the_threshold_are_checked() -> None:
    rd = range_doppler_angle(np.ones((12, 32, 64), np.complex64), RADAR).range_doppler
    for name, value in (("kind", "median"), ("along", "angle"), ("rank", 0.0), ("rank", 1.1)):
        with pytest.raises(ParameterRangeError, match=name):
            cfar(rd, **{"kind": "os", name: value})


@pytest.mark.parametrize("pfa", [1e-300, 1e-17, 1e-12, 0.9, 0.999])
@pytest.mark.parametrize("along", ["either", "both", "range", "doppler"])
def test_any_rate_has_a_threshold(pfa: float, along: str) -> None:
    """From none of the cells of noise to nearly all of them."""
    rng = np.random.default_rng(4)
    radar = RadarSpec().with_(num_chirps=32, num_samples=64)
    cube = (rng.normal(size=(12, 32, 64)) + 1j * rng.normal(size=(12, 32, 64))).astype(np.complex64)
    share = cfar(range_doppler(cube, radar), pfa, along=along).mean()
    assert share == pytest.approx(pfa, abs=0.05)
    with pytest.raises(ParameterRangeError, match="pfa"):
        cfar(range_doppler(cube, radar), 1e-19, kind="os", along=along)
