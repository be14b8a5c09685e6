"""Statistics of the heterodyne receiver against closed forms; five to six sigma with fixed seeds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest

from camera_lidar.lidar import (
    Detections,
    detection_probability,
    frequency_deviation,
    mean_cnr,
    range_deviation,
    velocity_deviation,
)
from camera_lidar.lidar.heterodyne import receive_heterodyne
from camera_lidar.lidar.heterodyne.air import air_profile
from camera_lidar.lidar.heterodyne.beat import estimate_beats, synthesize_beats
from camera_lidar.lidar.heterodyne.detection import threshold
from camera_lidar.lidar.returns import Echoes
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.lidar.receiver import HeterodyneReceiver
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from tests.oracles.coherent_lidar import fisher_frequency_deviation, joint_detection, marcum_tail

NUM = 100_000
SIGMAS = 5.5
RECEIVER = HeterodyneReceiver(saturation_power=None)
SPEC = LidarSpec(num_azimuth=NUM, num_elevation=1, receiver=RECEIVER)
DISTANCE, VELOCITY = 60.3, 7.1
RAW = LidarSpec(
    num_azimuth=3000,
    num_elevation=1,
    chirp_time=1e-6,
    bandwidth=1.5e8,
    max_distance=120.0,
    receiver=HeterodyneReceiver(
        raw_signal=True, speckle=False, saturation_power=None, sampling_frequency=250e6, max_velocity=20.0
    ),
)


def returns(spec: LidarSpec, cnr: float, number: int | None = None) -> Echoes:
    """Return one return a shot with a mean carrier-to-noise ratio."""
    number = spec.num_shots if number is None else number
    one = np.ones(number)
    intensity = float(cnr / mean_cnr(spec, 1.0, DISTANCE))
    return Echoes(
        np.arange(number),
        DISTANCE * one,
        VELOCITY * one,
        intensity * one,
        one,
        np.zeros((number, 3)),
        np.zeros(number, dtype=np.int64),
    )


def with_receiver(spec: LidarSpec, **changes: object) -> LidarSpec:
    return spec.with_(receiver=spec.receiver.with_(**changes))


def detected(found: Detections, number: int = NUM) -> float:
    """Return the share of shots whose return was detected."""
    return np.count_nonzero(found.echo >= 0) / number


def binomial_sigma(probability: float, number: int) -> float:
    return float(np.sqrt(probability * (1.0 - probability) / number))


@pytest.mark.parametrize("looks", [1, 4, 25])
def test_speckle_contrast_is_one_over_the_root_of_the_looks(looks: int) -> None:
    spec = with_receiver(SPEC, num_looks=looks, noise=False)
    found = receive_heterodyne(spec, returns(spec, 1e3), np.zeros(NUM), np.random.default_rng(1))
    contrast = found.intensity.std() / found.intensity.mean()
    # variance of the contrast of a gamma variable of shape M, delta method: (1 + 1 / M) / (2 N) relative
    assert abs(contrast * np.sqrt(looks) - 1.0) < SIGMAS * np.sqrt((1.0 + 3.0 / looks) / NUM)
    assert abs(found.cnr.mean() / 1e3 - 1.0) < SIGMAS / np.sqrt(looks * NUM)
    assert kstest(found.cnr / 1e3 * looks, "gamma", args=(looks,)).pvalue > 1e-4
    still = with_receiver(spec, speckle=False)
    ideal = receive_heterodyne(still, returns(spec, 1e3), np.zeros(NUM), np.random.default_rng(1))
    assert np.allclose(ideal.cnr, 1e3, rtol=1e-12)


@pytest.mark.parametrize("looks", [1, 3])
@pytest.mark.parametrize("cnr", [3.0, 20.0, 200.0])
def test_detection_probability_with_speckle(looks: int, cnr: float) -> None:
    one = with_receiver(SPEC, num_looks=looks, chirps="up")
    level = threshold(one)
    # Swerling's second case; for one look P_fa^(1 / (1 + C))
    expected = detection_probability(cnr, level, looks, True, 1)
    if looks == 1:
        assert np.isclose(expected, np.exp(-level) ** (1.0 / (1.0 + cnr)), rtol=1e-12)
    found = receive_heterodyne(one, returns(one, cnr), np.zeros(NUM), np.random.default_rng(2))
    assert abs(detected(found) - expected) < SIGMAS * binomial_sigma(float(expected), NUM)

    both = with_receiver(SPEC, num_looks=looks)
    expected = detection_probability(cnr, threshold(both), looks, True, 2)
    assert np.isclose(expected, joint_detection(cnr, threshold(both), looks), atol=1e-6)  # two quadratures
    found = receive_heterodyne(both, returns(both, cnr), np.zeros(NUM), np.random.default_rng(3))
    # a false alarm takes the place of a return only where it is the stronger one: at most in one of 10^4 shots
    assert abs(detected(found) - expected) < SIGMAS * binomial_sigma(float(expected), NUM) + 1e-4


def test_detection_probability_without_speckle_is_marcums() -> None:
    spec = with_receiver(SPEC, speckle=False, num_looks=2)
    level = threshold(spec)
    for cnr in (2.0, 6.0, 12.0):
        expected = detection_probability(cnr, level, 2, False, 2)
        assert np.isclose(expected, marcum_tail(2, 2.0 * cnr, level) ** 2, atol=1e-7)
        found = receive_heterodyne(spec, returns(spec, cnr), np.zeros(NUM), np.random.default_rng(4))
        assert abs(detected(found) - expected) < SIGMAS * binomial_sigma(float(expected), NUM) + 1e-4


@pytest.mark.parametrize("chirps", ["up_down", "up"])
@pytest.mark.parametrize("probability", [1e-3, 0.05])
def test_false_alarm_rate(chirps: str, probability: float) -> None:
    spec = with_receiver(SPEC, chirps=chirps, false_alarm_probability=probability)
    found = receive_heterodyne(spec, returns(spec, 1.0, 0), np.zeros(NUM), np.random.default_rng(5))
    assert abs(len(found.shot) / NUM - probability) < SIGMAS * binomial_sigma(probability, NUM)
    assert (found.echo == -1).all() and kstest(found.distance / 200.0, "uniform").pvalue > 1e-4
    assert (found.cnr > threshold(spec) - 1.0 - 1e-9).all()


def test_raw_noise_has_the_stated_false_alarm_rate() -> None:
    spec = with_receiver(RAW, false_alarm_probability=0.02)
    total = 0
    for seed in range(3):
        signal = synthesize_beats(spec, returns(spec, 1.0, 0), np.zeros(3000), np.random.default_rng(seed))
        total += len(estimate_beats(spec, signal, returns(spec, 1.0, 0)).shot)
    # Rice's formula counts upward crossings: off by less than 5 % of a rate of 0.2 a chirp
    assert abs(total / 9000 - 0.02) < SIGMAS * binomial_sigma(0.02, 9000) + 0.001


def test_cramer_rao_bound_is_that_of_the_fisher_matrix() -> None:
    for number, snr in ((16, 1.0), (250, 0.3)):
        bound = fisher_frequency_deviation(snr, 2e-9, number)
        assert np.isclose(frequency_deviation(snr * number, number * 2e-9, number), bound, rtol=1e-8)


@pytest.mark.parametrize("cnr_db", [15.0, 25.0, 40.0])
def test_statistical_estimates_lie_at_the_bound(cnr_db: float) -> None:
    cnr = 10.0 ** (cnr_db / 10.0)
    spec = with_receiver(SPEC, speckle=False)
    found = receive_heterodyne(spec, returns(spec, cnr), np.zeros(NUM), np.random.default_rng(6))
    kept = found.echo >= 0
    for error, bound in (
        (found.distance[kept] - DISTANCE, range_deviation(spec, cnr)),
        (found.radial_velocity[kept] - VELOCITY, velocity_deviation(spec, cnr)),
    ):
        number = error.size
        assert abs(error.mean()) < SIGMAS * bound / np.sqrt(number)
        assert abs(error.std() / bound - 1.0) < SIGMAS / np.sqrt(2.0 * number)
    assert abs(np.corrcoef(found.distance[kept], found.radial_velocity[kept])[0, 1]) < SIGMAS / np.sqrt(kept.sum())


@pytest.mark.some(1)
@pytest.mark.parametrize("cnr_db", [18.0, 25.0, 35.0])
def test_estimates_from_raw_beats_reach_the_bound_within_10_percent(cnr_db: float) -> None:
    cnr = 10.0 ** (cnr_db / 10.0)
    true = returns(RAW, cnr)
    # at random places between the lines of the transform
    spread = np.random.default_rng(7).uniform(-2.0, 2.0, true.number)
    distance = DISTANCE + spread
    true = Echoes(**{**vars(true), "distance": distance, "intensity": cnr / mean_cnr(RAW, 1.0, distance)})
    signal = synthesize_beats(RAW, true, np.zeros(3000), np.random.default_rng(8))
    found = estimate_beats(RAW, signal, true)
    assert len(found.shot) == 3000 and (found.echo >= 0).all()
    for error, bound in (
        (found.distance - distance, range_deviation(RAW, cnr)),
        (found.radial_velocity - VELOCITY, velocity_deviation(RAW, cnr)),
    ):
        ratio = error.std() / bound
        # the statistical error of a deviation of 3000 values is 1.3 %, two of it
        assert 1.0 - 0.026 < ratio < 1.10 + 0.026, ratio
        assert abs(error.mean()) < SIGMAS * bound / np.sqrt(3000)


def test_raw_and_statistical_receivers_detect_alike() -> None:
    for cnr, tolerance in ((10.0, 0.06), (20.0, 0.03)):
        # the highest point of the spectrum near a return is a little above its own place: more detections at the
        # threshold
        expected = float(detection_probability(cnr, threshold(RAW), 1, False, 2))
        signal = synthesize_beats(RAW, returns(RAW, cnr), np.zeros(3000), np.random.default_rng(9))
        found = estimate_beats(RAW, signal, returns(RAW, cnr))
        excess = detected(found, 3000) - expected
        assert -SIGMAS * binomial_sigma(expected, 3000) < excess < SIGMAS * binomial_sigma(expected, 3000) + tolerance


def test_raw_speckle_is_shared_by_the_chirps() -> None:
    spec = with_receiver(RAW, speckle=True)
    signal = synthesize_beats(spec, returns(spec, 1e4), np.zeros(3000), np.random.default_rng(10))
    power = np.mean(np.abs(signal) ** 2, axis=-1)
    assert np.corrcoef(power[:, 0], power[:, 1])[0, 1] > 0.99
    scaled = power[:, 0] / (1e4 / spec.num_samples)
    assert kstest(scaled - 1.0 / (1e4 / spec.num_samples), "expon").pvalue > 1e-4


@pytest.mark.parametrize("looks", [1, 3])
def test_fog_peaks_where_the_profile_says(looks: int) -> None:
    spec = with_receiver(SPEC, chirps="up", num_looks=looks, false_alarm_probability=1e-6)
    spec = spec.with_(atmosphere=Atmosphere(visibility=300.0), max_returns=16)
    profile = air_profile(spec)
    found = receive_heterodyne(spec, returns(spec, 1.0, 0), np.zeros(NUM), np.random.default_rng(11))
    total = profile.peaks[-1]
    assert 0.01 < total < 3.0
    # Poisson's law; few cells, so that the peaks of one shot are independent
    assert abs(len(found.shot) / NUM - total) < SIGMAS * np.sqrt(total / NUM)
    some = -np.expm1(-total)
    assert abs(len(np.unique(found.shot)) / NUM - some) < SIGMAS * binomial_sigma(some, NUM)
    half = int(np.searchsorted(profile.peaks, total / 2.0))
    nearer = np.count_nonzero(found.distance <= (half + 1) * spec.range_resolution) / NUM
    assert abs(nearer - profile.peaks[half]) < SIGMAS * np.sqrt(total / NUM)
    wall = returns(spec, 0.0)
    wall = Echoes(**{**vars(wall), "distance": np.full(NUM, 5.0)})
    close = receive_heterodyne(spec, wall, np.zeros(NUM), np.random.default_rng(11))
    assert (close.distance <= 5.0 + spec.range_resolution).mean() > 0.999  # nothing comes from behind a surface


def test_raw_fog_has_the_power_and_the_velocity_of_the_profile() -> None:
    number, receiver = 400, HeterodyneReceiver(raw_signal=True, saturation_power=None)
    spec = LidarSpec(
        num_azimuth=number,
        num_elevation=1,
        receiver=receiver,
        max_distance=100.0,
        atmosphere=Atmosphere(visibility=60.0),
    )
    nothing, profile = returns(spec, 1.0, 0), air_profile(spec)
    signal = synthesize_beats(spec, nothing, np.full(number, -15.0), np.random.default_rng(12))
    power = np.mean(np.abs(signal.astype(np.complex128)) ** 2, axis=-1)
    expected = 1.0 + profile.cnr.sum() / spec.num_samples
    # exponential powers of the cells: variance sum C^2 / N^2 a shot, shared by both chirps; the noise has 1 / N
    sigma = np.sqrt((np.sum(profile.cnr**2) / spec.num_samples**2 + 1.0 / spec.num_samples) / number)
    assert np.abs(power.mean(axis=0) - expected).max() < SIGMAS * sigma and expected > 1.0 + 50.0 * sigma
    found = estimate_beats(spec, signal, nothing)
    assert len(found.shot) > 0.5 * number and (found.echo == -1).all()
    right = np.abs(found.radial_velocity + 15.0) < 3.0 * spec.velocity_resolution
    # neighbouring cells merge into one peak, and the strongest of the up and of the down chirp may be different cells
    assert right.mean() > 0.6 and np.median(found.distance[right]) < 30.0
    wall = Echoes(**{**vars(returns(spec, 1.0)), "distance": np.full(number, 4.0), "intensity": np.zeros(number)})
    behind = synthesize_beats(spec, wall, np.full(number, 0.0), np.random.default_rng(13))
    left = np.mean(np.abs(behind.astype(np.complex128)) ** 2) - 1.0
    near = profile.cnr[: int(4.0 / spec.range_resolution)].sum() / spec.num_samples
    assert abs(left / near - 1.0) < 0.15  # 27 cells in front of the wall, 400 shots


def test_same_seed_same_bytes_and_one_shot_does_not_change_another() -> None:
    spec = SPEC.with_(num_azimuth=2000)
    true = returns(spec, 30.0)
    first, same, other = (
        receive_heterodyne(spec, true, np.zeros(2000), np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    assert all(a.tobytes() == b.tobytes() for a, b in zip(vars(first).values(), vars(same).values(), strict=True))
    assert not np.array_equal(first.shot, other.shot)
    dark = Echoes(**{**vars(true), "intensity": np.where(np.arange(2000) % 2, true.intensity, 0.0)})
    half = receive_heterodyne(spec, dark, np.zeros(2000), np.random.default_rng(1))
    odd = first.shot % 2 == 1
    assert np.isin(first.shot[odd], half.shot).all()
    rows = np.searchsorted(half.shot, first.shot[odd])
    assert np.array_equal(half.distance[rows], first.distance[odd])
