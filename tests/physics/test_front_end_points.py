"""Points and labels behind a front end that is not ideal: a target's RCS, its SNR, and what explains it."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.signal.front_end.echoes import echo_transfer, noise_left

FILTERS = ss.IfFilter(high_pass=(175e3, 350e3), low_pass=10e6)
BOARD = ss.RadarSpec.preset("iwr1843boost").with_(num_chirps=32, phase_noise=None)
FALLING = BOARD.with_(direction="down")
PMCW = ss.RadarSpec.preset("pmcw_79ghz").with_(num_chirps=32, repetitions=8, filters=ss.IfFilter(low_pass=500e6))


def strongest(radar, distance, velocity=0.0, **changes):
    """The strongest point of a target of 1 m2, and its labels."""
    paths = ss.point_targets([[distance, 0.3, 0.0]], [[velocity, 0.0, 0.0]], 1.0, radar, Pose())
    radar = radar.with_(**changes)
    adc = ss.synthesize(paths, radar, np.random.default_rng(0))
    points = ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar))
    labels = ss.label_points(points, paths, radar)
    row = int(np.argmax(points.power * (np.abs(points.range - distance) < 1.0)))
    return points.rcs[row], labels.explained[row], points.snr_db[row]


@pytest.mark.parametrize(
    ("radar", "distance", "velocity"),
    [
        *((BOARD, distance, 0.0) for distance in (1.5, 2.0, 5.0, 12.0)),
        (BOARD, 4.0, 6.0),
        (BOARD, 0.93 * BOARD.max_range, 0.0),  # where frequencies go over into those below 0 Hz
        (FALLING, 2.0, 0.0),
        (BOARD.with_(sampling="real"), 2.0, 0.0),
        (PMCW, 12.0, 0.0),
    ],
)
def test_rcs_and_labels_know_the_filters(radar, distance, velocity):
    """13 dB of the high passes at 2 m; symbols lose 2 dB, and come 0.8 ns (1.7 bins) later."""
    rcs, explained, _ = strongest(radar, distance, velocity, tx_power_dbm=40.0)
    assert 10.0 * np.log10(rcs) == pytest.approx(0.0, abs=0.5)
    assert explained == pytest.approx(1.0, abs=0.1)


def test_the_ratio_to_the_noise_is_what_it_is_without_filters():
    """They weaken the thermal noise beside an echo as they weaken it."""
    assert strongest(BOARD, 3.0)[2] == pytest.approx(strongest(BOARD, 3.0, filters=None)[2], abs=0.5)


@pytest.mark.parametrize("radar", [PMCW, ss.RadarSpec.preset("pmcw_79ghz").with_(filters=ss.IfFilter(low_pass=300e6))])
def test_symbols_lose_more_of_an_echo_than_of_the_noise(radar):
    """An echo adds its tones up, the noise their powers; against the floor of a map without a target."""
    radar = radar.with_(num_chirps=32)
    paths = ss.point_targets([[12.0, 0.3, 0.0]], [[0.0, 0.0, 0.0]], 1e-12, radar, Pose())
    floor = []
    for one in (radar, radar.with_(filters=None)):
        cube = ss.virtual_cube(ss.synthesize(paths, one, np.random.default_rng(0)), one)
        floor.append(float(ss.range_doppler(cube, one).power.mean()))
    beat = np.zeros(1)
    assert noise_left(radar, beat)[0] == pytest.approx(floor[0] / floor[1], rel=0.05)
    echo = np.abs(echo_transfer(radar, beat)[0]) ** 2
    assert echo < 0.95 * noise_left(radar, beat)[0]
    change = 10.0 * np.log10(echo / noise_left(radar, beat)[0])
    assert strongest(radar, 12.0)[2] - strongest(radar, 12.0, filters=None)[2] == pytest.approx(change, abs=0.5)


def test_labels_know_the_channels_and_rcs_does_not():
    """Their errors are what a radar does not know of itself."""
    channels = ss.ChannelErrors(
        rx_gain_db=(3.0, 3.0, 2.0, 4.0),
        tx_phase_deg=(0.0, 20.0, -20.0),
        rx_coupling=tuple(tuple((1.0, 0.0) if i == k else (0.05, 0.1) for k in range(4)) for i in range(4)),
    )
    rcs, explained, _ = strongest(BOARD, 5.0, channels=channels)
    assert rcs > 1.5
    assert explained == pytest.approx(1.0, abs=0.05)


def test_nothing_is_told_where_the_filters_leave_nothing():
    radar = BOARD.with_(filters=ss.IfFilter(low_pass=0.2e6, low_pass_order=8))
    assert np.isnan(strongest(radar, 8.0, tx_power_dbm=140.0, noise_figure_db=0.0, amplifier=None)[0])
