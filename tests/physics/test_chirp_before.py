"""What the chirp before leaves in the window of a chirp of symbols: with its own code, or of its own transmitter."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.radar.synthesis.coded.passing import CHANGE
from tests.oracles.waveforms import chip_train, factors_in_turn, received, symbol_train

BOUND = Accuracy().synthesis_tolerance + Accuracy().motion_tolerance
TWO = ss.AntennaArray(tx_positions=((0.0, 0.0, 0.0),) * 2, rx_positions=((0.0, 0.0, 0.0),), pattern=IsotropicPattern())
CODE = ss.Pmcw(code_length=127, chip_rate=300e6, repetitions=4, num_chirps=16)
CODES = {"ddm": ss.Ddm(num_empty_bands=2), "bpm": ss.Bpm(), "cdm": ss.Cdm(code_seed=2)}


def radar_of(waveform, multiplexing) -> ss.RadarSpec:
    return ss.RadarSpec(waveform=waveform, array=TWO, multiplexing=multiplexing)


def point(radar, distance, speed, rcs=1.0):
    ray = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    place, velocity = distance * ray, speed * ray
    paths = ss.point_targets([place], [velocity], rcs, radar, Pose())
    return place, velocity, paths, abs(paths.a[0, 0, 0]) * np.sqrt(1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10))


@pytest.mark.some(8)
@pytest.mark.usefixtures("ways")
@pytest.mark.parametrize(("distance", "speed"), [(3.0, 0.0), (60.0, 70.0), (200.0, -30.0)])
@pytest.mark.parametrize("kind", CODES)
def test_a_code_sent_all_the_time_passes_from_factor_to_factor(kind, distance, speed) -> None:
    """Against the code times its factors at the time at which it was sent; 200 m are 400 of 508 chips."""
    radar = radar_of(CODE, CODES[kind])
    place, velocity, paths, amplitude = point(radar, distance, speed)
    factors = radar.multiplexing.codes(16, 2)
    interval, rate = 4 * 127 / 300e6, 300e6
    times = np.arange(16)[:, None] * interval + np.arange(4 * 127) / rate

    def sent(time):
        both = sum(factors_in_turn(factors[:, tx], interval, CHANGE / rate, time) for tx in range(2))
        return both * chip_train(CODE.chips[0], rate, time)

    wanted = amplitude * received(place, velocity, times, 77e9, sent).reshape(16, 4, 127).mean(axis=1)
    error = np.abs(ss.synthesize(paths, radar)[0] - wanted)
    assert error.max() < 2.0 * BOUND * np.abs(wanted).max()  # two transmitters
    assert np.linalg.norm(error) < 1e-3 * np.linalg.norm(wanted)


def test_the_direct_sum_is_the_transform_s() -> None:
    radar, rng = radar_of(CODE.with_(num_chirps=4, code_length=31), ss.Bpm()), np.random.default_rng(1)
    distance = rng.uniform(3.0, 50.0, 12)
    places = np.stack([distance, 0.1 * distance, 0.0 * distance], axis=1)
    paths = ss.point_targets(places, rng.normal(0.0, 15.0, (12, 3)), 1e-3 * distance**4, radar, Pose())
    fast, plain = (ss.synthesize(paths, radar, method=how) for how in ("nufft", "direct"))
    assert np.abs(fast - plain).max() < BOUND * np.abs(plain).max()


@pytest.mark.parametrize(("kind", "turn"), [("ddm", np.exp(-0.5j * np.pi)), ("bpm", 0.0)])
def test_levels_in_the_map(kind, turn) -> None:
    """With q = tau over a chirp's time channels have 1 - q + q times the mean of the factors' turns."""
    wave = CODE.with_(num_chirps=32, code_length=511)
    q = (2.0 * 60.0 / SPEED_OF_LIGHT * 300e6 + 0.5 * CHANGE) / (4 * 511)
    radar = radar_of(wave, CODES[kind])
    *_, paths, _ = point(radar, 60.0, 0.0)
    cube = ss.virtual_cube(ss.synthesize(paths, radar), radar)
    rd = ss.range_doppler(cube, radar, "rect", num_range_bins=511 * 8)
    first, second = rd.data[(slice(None), *np.unravel_index(rd.power.argmax(), rd.power.shape))]
    assert second / first == pytest.approx(1.0 - q + q * np.conj(turn), abs=3e-3)


def test_no_change_without_codes_or_behind_a_prefix() -> None:
    """Behind a prefix each transmitter's signal is that of ideal transmitters, times its code."""
    for waveform, multiplexing in ((CODE, "ideal"), (CODE.with_(prefix_chips=127), "bpm"), (CODE, "bpm")):
        radar = radar_of(waveform, multiplexing)
        *_, paths, _ = point(radar, 50.0, 3.0)
        found = ss.synthesize(paths, radar)
        apart = ss.synthesize(paths, radar.separated).reshape(1, 16, 2, 127)
        if radar.multiplexing.is_coded:
            apart = apart * radar.multiplexing.codes(16, 2)[:, :, None]
            apart = apart.sum(axis=2)
        same = np.abs(found - apart.reshape(found.shape)).max() < 1e-6 * np.abs(found).max()
        assert same != (waveform is CODE and multiplexing == "bpm")


def test_what_is_longer_than_a_chirp_is_told() -> None:
    radar = radar_of(CODE, "bpm")
    *_, paths, _ = point(radar, 300.0, 0.0)
    with pytest.warns(ss.ScarlWarning, match="longer than a chirp"):
        ss.synthesize(paths, radar)


@pytest.mark.parametrize("kind", ["tdm", "bpm"])
@pytest.mark.parametrize("name", ["ofdm", "golay"])
def test_symbols_that_outlast_the_prefix(name, kind) -> None:
    """In turn they are of the other transmitter, at once they have the code before."""
    waveform = {
        "ofdm": ss.Ofdm(num_subcarriers=64, subcarrier_spacing=600e3, cyclic_prefix=0.2e-6, idle_time=0.0),
        "golay": ss.Pmcw(code="golay", code_length=64, chip_rate=60e6, prefix_chips=12, repetitions=2),
    }[name].with_(num_chirps=8)
    radar = radar_of(waveform, kind)
    place, velocity, paths, amplitude = point(radar, 120.0, 20.0)
    with pytest.warns(ss.ScarlWarning, match="longer than the prefix"):
        found = ss.synthesize(paths, radar)[0]
    interval, prefix = waveform.chirp_interval, waveform.prefix_time
    rate, repeats = waveform.sample_rate, waveform.repetitions
    codes = radar.multiplexing.codes(8, 2)
    rows = 16 if kind == "tdm" else 8
    turns = codes.sum(axis=1) if kind == "bpm" else np.ones(rows)
    own = np.repeat(np.arange(8), rows // 8)  # the symbol of a row is that of its transmitter

    def sent(time):
        if name == "ofdm":
            tones = (np.arange(64) - 32) * 600e3
            return symbol_train(turns[:, None] * waveform.spectrum[own], tones, interval, prefix, 1 / 600e3, time)
        number = np.clip(np.floor(time / interval).astype(int), 0, rows - 1)
        both = [chip_train(code, rate, np.mod(time, interval) - prefix) for code in waveform.chips]
        return turns[number] * np.where(own[number] % 2 == 0, *both) * (time >= 0.0)

    times = np.arange(rows)[:, None] * interval + prefix + np.arange(repeats * 64) / rate
    wanted = amplitude * received(place, velocity, times, 77e9, sent).reshape(rows, repeats, 64).mean(axis=1)
    assert np.abs(found - wanted).max() < 2e-5 * np.abs(wanted).max()


@pytest.mark.parametrize("name", ["code", "ofdm", "golay"])
def test_blocks_of_chirps_know_the_chirp_before(name) -> None:
    waveform = {
        "code": CODE,
        "ofdm": ss.Ofdm(num_subcarriers=64, cyclic_prefix=0.2e-6, idle_time=0.0),
        "golay": ss.Pmcw(code="golay", code_length=64, chip_rate=60e6, prefix_chips=12, repetitions=2),
    }[name].with_(num_chirps=16)
    radar = radar_of(waveform, ss.Bpm())
    *_, paths, _ = point(radar, 120.0, 4.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ss.ScarlWarning)
        whole = ss.synthesize(paths, radar)
        blocks = ss.synthesize_blocks(lambda time: later(paths, time), radar, 4)
    assert np.abs(blocks - whole).max() < 2.0 * BOUND * np.abs(whole).max()
