"""Velocities beyond the interval of the regular grid, by chirps at staggered, alternating and jittered intervals."""

from __future__ import annotations

from math import gcd

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.ambiguity import likeness
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.signal.detection import detect

COUNT = 96
SIGHT = np.array([np.cos(0.35), np.sin(0.35), 0.0])


def repeated(*late_us: float) -> dict[str, object]:
    return {"chirp_offsets": tuple(np.resize(np.array(late_us) * 1e-6, COUNT).tolist())}


def two_blocks(longer_us: float) -> dict[str, object]:
    """The second half of the frame at a longer interval."""
    late = np.maximum(np.arange(COUNT) - COUNT // 2 + 1, 0) * longer_us * 1e-6
    return {"chirp_offsets": tuple(late.tolist())}


STARTS = {
    "alternating": repeated(0.0, 8.0),
    "three": repeated(0.0, 3.0, 8.0),
    "blocks": two_blocks(5.0),
    "jitter": {"chirp_jitter": 16e-6, "idle_time": 16e-6},
}


def radar_of(name: str, multiplexing: str = "ideal") -> ss.RadarSpec:
    waveform = ss.Fmcw(num_chirps=COUNT, num_samples=128, **STARTS[name])
    return ss.RadarSpec(waveform=waveform, multiplexing=multiplexing)


def seen(radar, distance, speed, rcs=1e3, **options):
    """Points that are detected of some targets, strongest first, and their paths."""
    distance, speed = np.atleast_1d(distance), np.atleast_1d(speed)
    paths = ss.point_targets(distance[:, None] * SIGHT, speed[:, None] * SIGHT, rcs, radar, ss.Pose())
    adc = ss.synthesize(paths, radar, rng=np.random.default_rng(3))
    return detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar), **options), paths


@pytest.mark.some(4)
@pytest.mark.parametrize("speed", [-70.0, 13.0, 40.0])
@pytest.mark.parametrize(
    ("name", "multiplexing"), [("alternating", "tdm"), ("three", "tdm"), ("blocks", "ideal"), ("jitter", "tdm")]
)
def test_a_point_of_any_velocity_is_found_once(name, multiplexing, speed) -> None:
    radar = radar_of(name, multiplexing)
    assert radar.unfolded_velocity > 3.0 * radar.unambiguous_velocity
    speed = max(speed, -0.95 * radar.unfolded_velocity)
    points, paths = seen(radar, 30.0, speed)
    assert points.num_points == 1
    assert points.radial_velocity[0] == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
    assert points.range[0] == pytest.approx(30.0, abs=0.05 * radar.range_resolution)
    assert np.sin(points.azimuth[0]) == pytest.approx(SIGHT[1], abs=0.05 * 2.0 / 12)
    assert 10.0 * np.log10(points.rcs[0]) == pytest.approx(30.0, abs=0.5)
    assert points.velocity_interval[0] >= 1.999 * radar.unfolded_velocity
    paths.instance[:] = 4
    labels = ss.label_points(points, paths, radar)
    assert labels.instance[0] == 4 and labels.explained[0] == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("options", [{"direction": "down"}, {"adc_start_time": 3e-6, "bandwidth": 150e6}])
def test_range_at_the_frame_s_start_whatever_the_ramp(options) -> None:
    """A target of 70 m/s that passes 2 bins: with none, in the map the range of a part of the frame."""
    radar = radar_of("blocks").with_(num_samples=64, **options)
    for speed, distance in ((-70.0, 30.2), (55.0, 17.0)):
        points, _ = seen(radar, distance, speed)
        strongest = points.power.argmax()
        assert points.radial_velocity[strongest] == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
        assert points.range[strongest] == pytest.approx(distance, abs=0.02 * radar.range_resolution)
        assert 10.0 * np.log10(points.rcs[strongest]) == pytest.approx(30.0, abs=0.3)


def test_without_it_there_are_images() -> None:
    radar = radar_of("alternating", "tdm")
    points, _ = seen(radar, 30.0, 40.0, unfold=False)
    assert points.num_points > 1
    assert np.abs(points.radial_velocity).max() < 1.01 * radar.unambiguous_velocity


def test_targets_beside_strong_ground() -> None:
    """Ground at rest 16 dB above targets of 40 and -60 m/s at the same range, and one nearby."""
    radar = radar_of("three", "tdm")
    points, _ = seen(radar, [30.0, 30.3, 30.1, 42.0], [0.0, 40.0, -60.0, 12.0], np.array([2e4, 5e2, 5e2, 1e3]))
    assert points.num_points == 4
    assert np.sort(points.radial_velocity) == pytest.approx([-60.0, 0.0, 12.0, 40.0], abs=0.1)


def test_alternating_intervals_are_as_ambiguous_as_the_chinese_remainder_says() -> None:
    """The levels are |cos(pi k d / T)| at multiples of 1 / T; the interval is that of the greatest common divisor."""
    interval, late = 40e-6, 8e-6
    starts = np.arange(64) * interval + np.resize([0.0, late], 64)
    folds = np.arange(1, 5)
    level = likeness(starts, folds / interval)
    assert level == pytest.approx(np.abs(np.cos(np.pi * folds * late / interval)), abs=1e-12)
    half = likeness(starts, (folds - 0.5) / interval)
    assert half == pytest.approx(np.abs(np.sin(np.pi * (folds - 0.5) * late / interval)), abs=1e-12)
    divisor = gcd(48, 32) * 1e-6
    waveform = ss.Fmcw(ramp_time=30e-6, idle_time=10e-6, num_chirps=64, chirp_offsets=tuple(np.resize([0, late], 64)))
    radar = ss.RadarSpec(waveform=waveform)
    assert radar.unfolded_velocity == pytest.approx(SPEED_OF_LIGHT / radar.center_frequency / 4.0 / divisor, rel=1e-3)
    assert radar.unambiguous_velocity == pytest.approx(SPEED_OF_LIGHT / radar.center_frequency / 4.0 / interval)


def test_the_map_shows_a_fast_point_at_the_level_that_theory_says() -> None:
    radar = radar_of("alternating")
    row = 20
    doppler = (row - COUNT // 2) / (COUNT * radar.doppler_interval) + 1.0 / radar.doppler_interval  # one interval up
    speed = doppler * radar.wavelength / 2.0 * radar.carrier_frequency / radar.center_frequency
    paths = ss.point_targets([0.2 * SIGHT], [0.0 * SIGHT], 1.0, radar, ss.Pose())
    starts = np.arange(COUNT) * radar.doppler_interval + np.array(radar.waveform.chirp_delays)
    still = ss.synthesize(paths, radar)
    moving = still * np.exp(2j * np.pi * doppler * starts)[:, None].repeat(radar.num_tx, axis=0)
    maps = [ss.range_doppler(ss.virtual_cube(adc, radar), radar, compensate_motion=False) for adc in (still, moving)]
    peak = [rd.power.max(axis=1) for rd in maps]
    ratio = np.sqrt(peak[1][row] / peak[0].max())
    assert speed > radar.unambiguous_velocity
    assert ratio == pytest.approx(abs(np.cos(np.pi * 8.0 / 38.0)), abs=0.01)


def test_what_turns_and_even_starts_tell() -> None:
    even = ss.RadarSpec()
    assert even.num_turns == 1 and even.unfolded_velocity == even.unambiguous_velocity
    turns = even.with_(multiplexing="tdm")
    assert turns.num_turns == 3 and turns.unfolded_velocity == pytest.approx(3.0 * turns.unambiguous_velocity)
    hopping = even.with_(frequency_step=1e6)
    assert hopping.unfolded_velocity == hopping.unambiguous_velocity


def test_cells_of_images_belong_to_their_target() -> None:
    radar = radar_of("alternating")
    paths = ss.point_targets([30.0 * SIGHT], [40.0 * SIGHT], 1e3, radar, ss.Pose())
    paths.instance[:] = 2
    rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar), radar), radar)
    labels = ss.label_cells(rd, paths)
    assert np.allclose(labels.power, rd.power, rtol=1e-3, atol=1e-6 * rd.power.max())
    assert (labels.instance[rd.power > 1e-3 * rd.power.max()] == 2).all()
