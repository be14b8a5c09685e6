"""Fog, rain and snow in both heterodyne receivers against a Monte Carlo of droplets."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ks_2samp

from camera_lidar.lidar import Detections
from camera_lidar.lidar.heterodyne import receive_heterodyne
from camera_lidar.lidar.heterodyne.beat import estimate_beats, synthesize_beats
from camera_lidar.lidar.heterodyne.detection import peaks_per_cell, threshold
from camera_lidar.lidar.heterodyne.link import mean_cnr
from camera_lidar.lidar.heterodyne.tones import Tones, paired
from camera_lidar.lidar.returns import Echoes
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from tests.oracles.foggy_lidar import Chirps, foggy_shots

AIR_SPEED = -10.0
FOG = Atmosphere(visibility=200.0, lidar_ratio=19.0)
WEATHERS = {  # transmitted power [W], air, distance of a black wall [m]
    "fog": (0.5, FOG, 30.0),
    "bright fog": (1.0, FOG, 30.0),
    "fog before a wall": (1.0, FOG, 5.0),
    "dense fog": (1.0, Atmosphere(visibility=40.0, lidar_ratio=19.0), 30.0),
    "rain": (3.0, Atmosphere(rain_rate=20.0, lidar_ratio=19.0), 30.0),
    "snow": (3.0, Atmosphere(snow_rate=2.0, lidar_ratio=32.0), 30.0),
}


def spec_of(name: str, number: int, raw: bool) -> LidarSpec:
    power, air, _ = WEATHERS[name]
    receiver = HeterodyneReceiver(raw_signal=raw, saturation_power=None, max_velocity=30.0)
    return LidarSpec(
        num_azimuth=number,
        num_elevation=1,
        max_distance=30.0,
        chirp_time=1e-6,
        transmit_power=power,
        atmosphere=air,
        receiver=receiver,
    )


def black_walls(number: int, distance: float) -> Echoes:
    """Return a wall that sends nothing back in every shot, or nothing at all beyond the last distance."""
    number = 0 if distance >= 30.0 else number
    one = np.ones(number)
    shot = np.arange(number)
    return Echoes(shot, distance * one, 0.0 * one, 0.0 * one, one, np.zeros((number, 3)), 0 * shot)


def monte_carlo(name: str, number: int, seed: int) -> np.ndarray:
    spec = spec_of(name, number, False)
    chirps = Chirps(
        spec.wavelength, spec.bandwidth, spec.chirp_time, spec.num_samples, spec.max_distance, 30.0, threshold(spec)
    )
    back = np.pi * spec.atmosphere.weather_backscatter(spec.wavelength) * spec.range_resolution

    def cnr(distance: np.ndarray) -> np.ndarray:
        return mean_cnr(spec, back * np.exp(-2.0 * spec.extinction * distance) / distance**2, distance)

    return foggy_shots(chirps, cnr, WEATHERS[name][2], AIR_SPEED, number, np.random.default_rng(seed))


def raw_receiver(name: str, number: int, seed: int) -> Detections:
    spec = spec_of(name, number, True)
    walls = black_walls(number, WEATHERS[name][2])
    signal = synthesize_beats(spec, walls, np.full(number, AIR_SPEED), np.random.default_rng(seed))
    return estimate_beats(spec, signal, black_walls(0, 30.0))


def statistical_receiver(name: str, number: int, seed: int) -> Detections:
    spec = spec_of(name, number, False)
    walls = black_walls(number, WEATHERS[name][2])
    return receive_heterodyne(spec, walls, np.full(number, AIR_SPEED), np.random.default_rng(seed))


def compare(name: str, number: int, margin: float, alike: float) -> None:
    """Check the share of shots with a return, and the distributions of distance and velocity (Kolmogorov)."""
    truth = monte_carlo(name, number, 1)
    truth = truth[np.isfinite(truth[:, 0])]
    expected = len(truth) / number
    for receiver, shots in ((raw_receiver, number), (statistical_receiver, 10 * number)):
        found = receiver(name, shots, 2)
        sigma = np.sqrt(max(expected * (1.0 - expected), 1e-3) * (1.0 / number + 1.0 / shots))
        assert abs(len(found.shot) / shots - expected) < margin + 3.0 * sigma, (receiver.__name__, expected)
        limit = alike + 1.95 * np.sqrt(1.0 / len(truth) + 1.0 / len(found.shot))  # 0.1 % of equal ones are beyond
        assert ks_2samp(found.distance, truth[:, 0]).statistic < limit, receiver.__name__
        assert ks_2samp(found.radial_velocity, truth[:, 1]).statistic < limit, receiver.__name__


@pytest.mark.parametrize("name", ["fog before a wall", "rain"])
def test_receivers_see_the_droplets_of_a_monte_carlo(name: str) -> None:
    compare(name, 400, 0.02, 0.03)


@pytest.mark.slow
@pytest.mark.parametrize("name", WEATHERS)
def test_receivers_see_the_droplets_of_a_monte_carlo_within_2_percent(name: str) -> None:
    compare(name, 4000, 0.02, 0.02)


@pytest.mark.parametrize("what", ["fog", "rays of one cell"])
def test_the_down_chirp_sees_the_same_backwards(what: str) -> None:
    spec = spec_of("fog before a wall", 50, True).with_(chirp_time=5e-6)
    spec = spec.with_(receiver=spec.receiver.with_(noise=False))
    echoes = black_walls(50, 5.0)
    if what == "rays of one cell":
        spec = spec.with_(atmosphere=Atmosphere())
        shot = np.repeat(np.arange(50), 3)
        distance = 4.0 + np.tile([0.0, 0.4, 0.9], 50) * spec.range_resolution
        one = np.ones(150)
        echoes = Echoes(shot, distance, 0.0 * one, 1e-3 * one, one, np.zeros((150, 3)), 0 * shot)
    signal = synthesize_beats(spec, echoes, np.zeros(50), np.random.default_rng(4))
    up, down = np.moveaxis(np.abs(np.fft.fft(signal, 4 * spec.num_samples, axis=-1)) ** 2, 1, 0)
    backwards = down[:, -np.arange(down.shape[1])]
    # all but the share 2 tau / T, at most 1.3 %, of the band is the same
    assert np.corrcoef(up.ravel(), backwards.ravel())[0, 1] > 0.97


@pytest.mark.parametrize("looks", [1, 4])
def test_peaks_per_cell_of_noise(looks: int) -> None:
    number, shots, level = 256, 1500, {1: 4.0, 4: 9.0}[looks]
    random = np.random.default_rng(3)
    passes = 0
    for _ in range(shots // 100):  # a hundred at once: all of them would take 600 MB
        noise = random.standard_normal((2, 100, looks, number)) * np.sqrt(0.5 / number)
        spectrum = np.fft.fft(noise[0] + 1j * noise[1], 16 * number, axis=-1)
        height = np.sum(np.abs(spectrum) ** 2, axis=1)
        passes += np.count_nonzero((height > level) & (np.roll(height, 1, axis=-1) <= level))
    expected = float(peaks_per_cell(level, looks)) * shots * number
    assert abs(passes / expected - 1.0) < 5.5 / np.sqrt(expected) + 0.01  # between lines a sixteenth apart few are lost


def test_tones_are_paired_by_strength_and_a_pair_of_two_surfaces_is_none() -> None:
    spec = LidarSpec(num_azimuth=3, num_elevation=1, max_returns=2, receiver=HeterodyneReceiver())
    slope = 2.0 * spec.chirp_slope / 299_792_458.0
    near, far = 20.0 * slope, 30.0 * slope

    def tones(rows: list[tuple[int, float, float, int]]) -> Tones:
        shot, beat, height, echo = zip(*rows, strict=True)
        return Tones(np.array(shot), np.array(beat), np.array(height), np.array(echo))

    up = tones([(0, near, 50.0, 0), (0, far, 40.0, 1), (1, near, 50.0, 2), (1, far, 45.0, 3), (2, near, 30.0, 4)])
    down = tones([(0, far, 41.0, 1), (0, near, 52.0, 0), (1, far, 51.0, 3), (1, near, 44.0, 2)])
    found = paired(spec, up, down)
    order = np.lexsort((found.distance, found.shot))
    assert found.shot[order].tolist() == [0, 0, 1, 1]  # a tone in one chirp alone is no return
    assert found.echo[order].tolist() == [0, 1, -1, -1]
    np.testing.assert_allclose(found.distance[order], [20.0, 30.0, 25.0, 25.0])
    assert np.abs(found.radial_velocity[order[2:]]).min() > 1.0
