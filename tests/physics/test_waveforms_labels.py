"""Labels follow the waveform: cells of a map and detections against the synthesis of each instance alone."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.radar.labels import labels as labels_module
from scarl_sionna.radar.labels.labels import label_cells, label_points
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.processing import range_doppler, virtual_cube

RAMP = {"num_chirps": 32, "num_samples": 64}
WAVEFORMS = {
    "down": ss.Fmcw(**RAMP, direction="down"),
    "late": ss.Fmcw(**RAMP, adc_start_time=5e-6),
    "jitter": ss.Fmcw(**RAMP, chirp_jitter=4e-6),
    "step": ss.Fmcw(**RAMP, frequency_step=1e6),
    "bursts": ss.SteppedFmcw(num_chirps=128, num_samples=64, num_steps=4, bandwidth=75e6),
    "code across": ss.PcFmcw(**RAMP, coding="across"),
    "code within": ss.PcFmcw(**RAMP, code="zadoff_chu", code_length=16),
    "ofdm": ss.Ofdm(num_chirps=32, num_subcarriers=64),
    "comb": ss.Ofdm(num_chirps=32, num_subcarriers=128, comb=2, pilot_spacing=1),
    "pmcw": ss.Pmcw(num_chirps=32, code_length=127, chip_rate=150e6, repetitions=4),
}


def radar_of(name: str) -> ss.RadarSpec:
    return ss.RadarSpec(waveform=WAVEFORMS[name]).with_(pattern=IsotropicPattern())


def three(radar: ss.RadarSpec, count: int, seed: int):
    """Points of three instances over the map."""
    rng = np.random.default_rng(seed)
    distance, azimuth = rng.uniform(2.0, 0.9 * radar.max_range, count), rng.uniform(-0.9, 0.9, count)
    points = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    speed = rng.uniform(-0.9, 0.9, count) * min(radar.unambiguous_velocity, 60.0)
    velocity = speed[:, None] * points / distance[:, None]
    paths = point_targets(points, velocity, distance**4, radar, Pose())
    paths.instance[:] = 1 + np.arange(count)[:, None] % 3
    return paths


@pytest.mark.some(4)
@pytest.mark.parametrize("name", WAVEFORMS)
def test_cells_have_the_power_of_their_instance(name) -> None:
    radar = radar_of(name)
    paths = three(radar, 1, seed=3)
    rd = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar)
    found, expected = label_cells(rd, paths), label_cells(rd, paths, method="synthesis")
    inside = found.power > 0.0
    assert inside.sum() >= 9
    assert found.power.argmax() == expected.power.argmax()
    # migration over the frame, 0.1 bins, and a jitter of a tenth of the interval change the lobe by that
    # a row off by one of 32 bursts shears the lobe over range by a 32nd of a bin, of a slope of at most 1.3 a bin
    bound = 5e-3 + (2 * 1.3 / 32 / 4 if name == "bursts" else 0.0)
    bound += 5e-3 * (name == "code within")  # the filter of coded ramps takes a delay off the end of the window
    assert np.abs(found.power - expected.power)[inside].max() < bound * expected.power.max()


@pytest.mark.some(4)
@pytest.mark.parametrize("name", WAVEFORMS)
def test_detections_have_the_label_of_what_made_them(name) -> None:
    radar = radar_of(name)
    paths = three(radar, 3, seed=6)
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(0)), radar), radar)
    points = detect(rda, radar)
    labels = label_points(points, paths, radar)
    assert set(labels.instance[labels.explained > 0.5]) == {1, 2, 3}
    strongest = np.argsort(-points.power)[:3]
    assert np.all(np.abs(labels.explained[strongest] - 1.0) < 0.2)


@pytest.mark.parametrize("window", ["hann", "taylor"])
@pytest.mark.parametrize("name", ["down", "ofdm", "pmcw"])
def test_sidelobes_over_weak_objects_have_their_owner(name, window) -> None:
    """A strong point beside weak ones: of cells 10 dB above the noise few belong to another than with synthesis."""
    radar = radar_of(name)
    paths = three(radar, 12, seed=2)
    paths.a[:] *= np.where(np.arange(12) == 0, 1.0, 0.01)[:, None, None]
    rd = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar, window)
    exact = label_cells(rd, paths, method="synthesis")
    shown = exact.power > 10.0 * rd.noise_power
    wrong = {}
    for method in ("spread", "sidelobes"):
        found = label_cells(rd, paths, method=method)
        wrong[method] = (found.instance != exact.instance)[shown].mean()
    error = np.abs(found.share - exact.share)[shown & (exact.share > 0.9)]
    assert wrong["sidelobes"] < 0.1 and wrong["sidelobes"] < 0.5 * wrong["spread"]
    assert np.median(error) < 0.01


@pytest.mark.parametrize("speed", [-5.9, 20.0, 31.0])
@pytest.mark.parametrize("name", ["bursts", "jitter"])
def test_cells_of_fast_points_are_labelled(name, speed) -> None:
    """Beyond what velocities a burst tells apart, and where staggered chirps spread a point over Doppler."""
    waveform = {"bursts": ss.SteppedFmcw(num_chirps=128, num_samples=64), "jitter": ss.Fmcw(**RAMP, chirp_jitter=7e-6)}
    radar = ss.RadarSpec(waveform=waveform[name])
    ray = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    paths = point_targets([20.13 * ray], [speed * ray], 100.0, radar, Pose())
    paths.instance[:] = 7
    rd = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar)
    found = label_cells(rd, paths, method="sidelobes")
    assert found.power.argmax() == rd.power.argmax()
    assert found.power.max() == pytest.approx(float(rd.power.max()), rel=0.02)
    shown = rd.power > 10.0 * rd.noise_power
    assert shown.sum() >= 9 and (found.instance[shown] == 7).all()
    if name == "bursts":  # its main lobe is elsewhere, too
        assert label_cells(rd, paths).power.argmax() == rd.power.argmax()


def test_only_what_lobes_do_not_hold_is_synthesized(monkeypatch) -> None:
    radar, made = ss.RadarSpec(waveform=ss.SteppedFmcw(num_chirps=128, num_samples=64)), []
    place, speed = [[20.0, 0.0, 0.0], [30.0, 5.0, 0.0]], [[1.0, 0.0, 0.0], [20.0, 0.0, 0.0]]
    paths = point_targets(place, speed, 10.0, radar, Pose())
    paths.instance[:] = [[1], [2]]
    cube = virtual_cube(synthesize(paths, radar), radar)
    rd = range_doppler(cube, radar)
    plain = labels_module._synthesized
    monkeypatch.setattr(labels_module, "_synthesized", lambda rd, some: made.append(some.num_paths) or plain(rd, some))
    found = label_cells(rd, paths)
    with pytest.warns(ss.ScarlWarning, match="1 of 2 paths are faster than bursts tell apart, 6.35 m/s"):
        label_points(detect(range_doppler_angle(cube, radar)), paths, radar)
    assert made == [1] and set(np.unique(found.instance)) >= {1, 2}
