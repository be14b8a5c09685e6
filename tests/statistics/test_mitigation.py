"""Zeroing and linear prediction: the noise floor and the peak of a weak target, against theory."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.units import db_to_power
from scarl_sionna.radar.interference.heard import Interference
from scarl_sionna.signal.noise import sample_noise_power

ARRAY = ss.AntennaArray(
    tx_positions=((0.0, 0.0, 0.0),),
    rx_positions=tuple((0.0, 0.002 * k, 0.0) for k in range(4)),
    pattern={"kind": "isotropic"},
)
RADAR = ss.RadarSpec(waveform=ss.Fmcw(num_chirps=64), array=ARRAY).with_(tx_power_dbm=30.0)
PLACES = [[30.0, 0.0, 0.0], [80.0, 5.0, 0.0]]
VELOCITIES = [[0.0, 0.0, 0.0], [-5.0, 0.0, 0.0]]
RCS = [1e3, 300.0]


@pytest.fixture(scope="module")
def frame():
    """Return echoes of a strong and a weak target, noise, and another radar 30 dB above it in a sample."""
    echoes = ss.synthesize(ss.point_targets(PLACES, VELOCITIES, RCS, RADAR, ss.Pose()), RADAR)
    noise = ss.synthesize(ss.RadarPaths.empty(ss.Pose()), RADAR, rng=np.random.default_rng(1))
    sender = RADAR.with_(bandwidth=360e6, start_frequency=76.97e9, idle_time=8.31e-6, tx_power_dbm=30.0)
    paths = ss.one_way_paths(sender, ss.Pose([30.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), ss.Pose())
    other = ss.synthesize_interference(paths, sender, RADAR, start_time=1e-6)
    hit = np.mean(np.abs(other) ** 2, axis=0) > 0.01 * sample_noise_power(RADAR)
    return echoes, noise, other, hit


def floor(adc) -> float:
    """Mean noise power of cells far from all echoes [W]."""
    rd = ss.range_doppler(ss.virtual_cube(adc, RADAR), RADAR, "rect")
    return float(np.mean(np.abs(rd.data[:, 4:20, 300:]) ** 2))


def peak(adc, index: int) -> float:
    """Power of a target by its own matched sum, over what it is alone."""
    some = slice(index, index + 1)
    alone = ss.point_targets(PLACES[some], VELOCITIES[some], RCS[some], RADAR, ss.Pose())
    own = ss.synthesize(alone, RADAR)
    found, best = (np.einsum("jmn,jmn->j", values, own.conj()) for values in (adc, own))
    return float(np.mean(np.abs(found) ** 2) / np.mean(np.abs(best) ** 2))


def test_another_radar_raises_the_floor_by_its_energy(frame) -> None:
    _, noise, other, hit = frame
    assert 0.03 < hit.mean() < 0.5
    rd = ss.range_doppler(ss.virtual_cube(other, RADAR), RADAR, "rect")
    mean = np.mean(np.abs(rd.data) ** 2)
    assert mean == pytest.approx(np.sum(np.abs(other) ** 2) / other.size / other[0].size, rel=1e-3)  # Parseval
    assert 10.0 * np.log10(floor(noise + other) / floor(noise)) > 6.0


def test_zeros_take_their_share_of_noise_and_peak(frame) -> None:
    echoes, noise, other, hit = frame
    clean = ss.mitigate(echoes + noise + other, hit)
    share = hit.mean()
    cells = 4 * 16 * 212  # the mean of so many exponential values, five standard errors
    assert floor(ss.mitigate(noise + other, hit)) == pytest.approx((1.0 - share) * floor(noise), rel=5.0 / cells**0.5)
    for index in range(2):
        assert peak(clean, index) == pytest.approx((1.0 - share) ** 2, rel=db_to_power(0.3) - 1.0)


def test_prediction_goes_on_through_the_gap(frame) -> None:
    echoes, noise, other, hit = frame
    clean = ss.mitigate(echoes + noise + other, hit, "predict")
    zero = ss.mitigate(echoes + noise + other, hit)
    assert peak(clean, 0) == pytest.approx(1.0, rel=db_to_power(0.2) - 1.0)  # the strong one
    lost = [10.0 * np.log10(peak(adc, 1)) for adc in (zero, clean)]
    assert lost[0] < lost[1] < 0.3
    # noise that is not predicted is not there: between the share that is left and all of it
    rest = floor(clean) / floor(noise)
    assert 1.0 - 1.3 * hit.mean() < rest < 1.02
    # without noise the gap is filled as it was
    gap = ss.mitigate(echoes + 1e-3 * noise, hit, "predict")
    error = np.sum(np.abs(gap - echoes)[:, hit] ** 2) / np.sum(np.abs(echoes[:, hit]) ** 2)
    assert error < 1e-3


def test_hits_are_found_as_labels_have_them(frame) -> None:
    echoes, noise, other, _ = frame
    label = np.mean(np.abs(other) ** 2, axis=0) > sample_noise_power(RADAR)
    found = ss.find_hits(echoes + noise + other)
    assert found[label].mean() > 0.85  # echoes 10 dB above the noise hide the ends of bursts
    assert ss.find_hits(noise + other)[label].mean() > 0.97
    assert (found & ~label).mean() < 0.1
    alone = ss.find_hits(noise, pfa=1e-2, guard=0)
    assert alone.mean() == pytest.approx(1e-2, abs=5.0 * (1e-2 / alone.size) ** 0.5 + 5e-4)  # the median is of 512
    assert ss.find_hits(noise, pfa=1e-2, guard=1).mean() > 2.0 * alone.mean()


@pytest.mark.parametrize("filters", [None, ss.IfFilter(high_pass=(175e3,), low_pass=3e6)])
@pytest.mark.parametrize("sampling", ["complex", "real"])
@pytest.mark.parametrize("count", [1, 4])
def test_noise_is_found_as_often_as_stated(filters, sampling: str, count: int) -> None:
    """Of real samples and behind filters, too."""
    radar = RADAR.with_(num_chirps=256, filters=filters, sampling=sampling)
    adc = ss.synthesize(ss.RadarPaths.empty(ss.Pose()), radar, rng=np.random.default_rng(2))[:count]
    found = ss.find_hits(adc, pfa=1e-3, guard=0)
    assert found.mean() == pytest.approx(1e-3, abs=4.0 * (1e-3 * 3.0 / found.size) ** 0.5)  # neighbours are correlated


@pytest.mark.parametrize("sampling", ["complex", "real"])
def test_labels_of_hits_compare_with_the_noise_that_filters_leave(sampling: str) -> None:
    """Behind 2 MHz the white noise is 7 dB more."""
    radar = RADAR.with_(filters=ss.IfFilter(low_pass=2e6), sampling=sampling)
    noise = ss.synthesize(ss.RadarPaths.empty(ss.Pose()), radar, rng=np.random.default_rng(2))
    level = np.sqrt(np.mean(np.abs(noise) ** 2))
    for factor in (0.95, 1.05):
        other = np.full((4, radar.num_chirps_total, radar.num_samples), factor * level, dtype=np.complex64)
        assert Interference(other, radar, ()).hit_samples.all() == (factor > 1.0)


def test_what_is_refused_says_so() -> None:
    adc = np.ones((2, 3, 64), dtype=np.complex64)
    hit = np.zeros((3, 64), dtype=bool)
    assert np.array_equal(ss.mitigate(adc, hit, "predict"), adc)
    with pytest.raises(ParameterRangeError, match="clean stretches"):
        ss.mitigate(adc, ~hit, "predict")
    with pytest.raises(ParameterRangeError, match="'zero' or 'predict'"):
        ss.mitigate(adc, hit, "other")
    with pytest.raises(ParameterRangeError, match="num_samples"):
        ss.mitigate(adc, hit[:2])
    with pytest.raises(ParameterRangeError, match="pfa"):
        ss.find_hits(adc, pfa=2.0)
