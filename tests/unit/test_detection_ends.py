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
from scarl_sionna.signal.detection.beams import is_peak
from scarl_sionna.signal.detection.leakage import leaked_over_the_ends
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


@pytest.mark.parametrize("per_beam", [False, True])
def test_rain_nearby_is_not_seen_at_the_largest_ranges_and_a_target_there_is(per_beam: bool) -> None:
    """Drops and the ground fill the first bins evenly: they pass no threshold, but leak over the end of the axis.

    Their strongest cells have 36 dB of one channel over the noise. The target at 250 m (of 255.8 m) has 20 dB after
    beamforming, and of 26 points there it is the one that stays.
    """
    radar, rng = RadarSpec().with_(num_chirps=64), np.random.default_rng(1)
    away = rng.uniform(0.1, 9.0, 8000)
    azimuth = rng.uniform(-1.0, 1.0, 8000)
    drops = away[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(8000)], axis=1)
    motion = np.outer(rng.uniform(-1.0, 1.0, 8000) * radar.unambiguous_velocity, [1.0, 0.0, 0.0])
    places, velocities = np.vstack([drops, [[250.0, 0.0, 0.0]]]), np.vstack([motion, [[3.0, 0.0, 0.0]]])
    strengths = [*(1e-7 * away**4 * rng.exponential(size=8000)), 300.0]  # the same power from everywhere
    paths = point_targets(places, velocities, strengths, radar, Pose())
    adc = synthesize(paths, radar, rng=rng)
    rda = range_doppler_angle(virtual_cube(adc, radar), radar)
    points = detect(rda, per_beam=per_beam)
    far = points.range > 20.0
    assert (points.range > 251.0).sum() == 0
    assert far.sum() <= (2 if per_beam else 1)  # noise of 36 beams passes now and then
    assert points.range[far][0] == pytest.approx(250.0, abs=0.1)
    assert points.snr_db[far][0] == pytest.approx(21.0, abs=2.0)
    drops_db = 10.0 * np.log10(rda.range_doppler.power[:, :4].max() / rda.noise_power)
    assert 35.0 < drops_db < 38.0
    assert detect(rda, peaks_only=False).range.max() > 255.0  # the leakage passes the threshold


@pytest.mark.parametrize(("channels", "most"), [(1, 0.005), (12, 0.0)])
def test_the_rate_in_noise_is_that_of_the_threshold(channels: int, most: float) -> None:
    """Cells of noise are not taken for each other's sidelobes: of one channel in 600 maps 2 of 2219, of 12 none."""
    radar = RADAR if channels == 12 else RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    rng, peaks, lost = np.random.default_rng(5), 0, 0
    for _ in range(100):
        cube = (rng.normal(size=(channels, 32, 64)) + 1j * rng.normal(size=(channels, 32, 64))).astype(np.complex64)
        rd = range_doppler(cube, radar)
        row, column = np.nonzero(cfar(rd, 3e-3) & is_peak(rd.power, range(2)))
        peaks, lost = peaks + len(row), lost + int(leaked_over_the_ends(rd, row, column).sum())
    assert peaks > 300 and lost <= most * peaks


def test_ranges_are_not_negative() -> None:
    rng = np.random.default_rng(3)
    cube = rng.normal(size=(12, 32, 64)) + 1j * rng.normal(size=(12, 32, 64))
    points = detect(range_doppler_angle(cube.astype(np.complex64), RADAR), pfa=0.2, peaks_only=False)
    assert points.num_points > 200 and points.range.min() >= 0.0
    known = np.isfinite(points.rcs)
    aside = np.abs(np.degrees(points.azimuth)) > 89.0
    assert (aside | (points.range == 0.0))[~known].all() and known.mean() > 0.9


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
