"""Noise behind the filters of the beat signal: as strong at the start of a chirp as in its middle, and as stated."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.calibration.device.filtering import noise_matrix
from scarl_sionna.signal.front_end.filters import noise_share_left
from scarl_sionna.signal.noise import sample_noise_power

RADAR = ss.RadarSpec().with_(num_chirps=1024, num_samples=128, sampling_frequency=17e6)
FILTERS = {
    "band": ss.IfFilter(high_pass=(175e3,), low_pass=3e6),
    "high": ss.IfFilter(high_pass=(175e3, 350e3)),
    "low": ss.IfFilter(low_pass=3e6),
    "slow": ss.IfFilter(high_pass=(2e3,)),
}


def noise(radar: ss.RadarSpec, seed: int = 0):
    return ss.synthesize(ss.RadarPaths.empty(ss.Pose()), radar, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("sampling", ["complex", "real"])
@pytest.mark.parametrize("name", FILTERS)
def test_it_is_stationary(name: str, sampling: str) -> None:
    """The first samples had 0 to 4 times the power of the others."""
    radar = RADAR.with_(filters=FILTERS[name], sampling=sampling)
    power = np.mean(np.abs(noise(radar)) ** 2, axis=(0, 1))
    share = 0.5 if sampling == "real" else 1.0
    expected = share * sample_noise_power(radar) * noise_share_left(radar)
    looks = 4 * 3 * 1024 * 2 * share  # normal values a sample
    assert power == pytest.approx(np.full(128, expected), rel=4.5 * np.sqrt(2.0 / looks))


@pytest.mark.parametrize("name", FILTERS)
def test_its_covariance_is_that_which_device_twins_take(name: str) -> None:
    radar = RADAR.with_(filters=FILTERS[name])
    rows = noise(radar).reshape(-1, 128) / np.sqrt(sample_noise_power(radar))
    matrix = noise_matrix(radar)
    assert matrix is not None
    measured, stated = (rows.conj().T @ rows / len(rows), matrix.conj().T @ matrix)
    assert np.abs(measured - stated).max() < 5.5 * stated[0, 0].real / np.sqrt(len(rows))


def test_a_compressed_constant_is_held_before_a_chirp() -> None:
    """Leakage near compression: noise goes on about what the amplifier makes of it."""
    radar = RADAR.with_(
        filters=FILTERS["high"],
        amplifier=ss.Amplifier(p1db_dbm=-30.0),
        leakage=(ss.Leakage(length=0.0, level_db=-44.0),),
        mixer=ss.Mixer(iq_gain_db=0.5),
    )
    power = np.mean(np.abs(noise(radar)) ** 2, axis=(0, 1))
    assert power[:8] == pytest.approx(np.full(8, power[40:].mean()), rel=0.06)


def test_what_the_noise_is_added_to_does_not_change() -> None:
    """The same noise within the chirps as before filters, and none without a generator."""
    paths = ss.point_targets([[20.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 10.0, RADAR, ss.Pose())
    radar = RADAR.with_(filters=FILTERS["band"], num_chirps=16)
    clean = ss.synthesize(paths, radar)
    both = ss.synthesize(paths, radar, rng=np.random.default_rng(3))
    assert np.abs(both - clean - noise(radar, 3)).max() < 1e-5 * np.abs(both).max()
