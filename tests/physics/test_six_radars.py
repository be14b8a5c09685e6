"""Radars as they are on the desk, with all their antennas: raw data against the exact retarded signal, points back.

Several points at once: near and far, 70 m/s either way, two speeds in one cell.
"""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.radar.synthesis.coded.passing import CHANGE
from tests.oracles.waveforms import chip_train, dechirped, factors_in_turn, received, retarded, symbol_train

PRESET, FREE = ss.RadarSpec.preset, {"pattern": IsotropicPattern()}
RADARS = {
    "awr1843boost_3d": PRESET("awr1843boost_3d").with_(**FREE, num_chirps=8),
    "awr2243_cascade": PRESET("awr2243_cascade").with_(**FREE, num_chirps=3, phase_noise=None),
    "radial_hd": PRESET("radial_hd").with_(**FREE, num_chirps=16),
    "pmcw_79ghz": PRESET("pmcw_79ghz").with_(**FREE, num_chirps=4, code_length=63, repetitions=48),
    "ofdm": ss.RadarSpec(waveform=ss.Ofdm(num_subcarriers=192, num_chirps=4), multiplexing="fdm").with_(**FREE),
    "coded ramps": ss.RadarSpec(waveform=ss.PcFmcw(num_chirps=8), multiplexing="bpm").with_(**FREE),
    "steps": ss.RadarSpec(
        waveform=ss.SteppedFmcw(bandwidth=75e6, num_steps=4, num_chirps=16, num_samples=256), multiplexing="tdm"
    ).with_(**FREE),
}
POINTS = np.array([[3.0, 0.4, 0.1], [60.0, -8.0, 1.0], [59.9, -8.7, 1.0], [95.0, 20.0, 0.0], [198.0, -20.0, 3.0]])
SPEEDS = np.array([0.0, 70.0, -40.0, -70.0, 70.0])


def scene(radar):
    """Points within the range, of equal amplitudes, that move along the line of sight."""
    inside = np.linalg.norm(POINTS, axis=1) < 0.95 * radar.max_range if radar.waveform.kind != "pmcw" else slice(None)
    points, speeds = POINTS[inside], SPEEDS[inside]
    distance = np.linalg.norm(points, axis=1)
    velocity = points / distance[:, None] * speeds[:, None]
    paths = ss.point_targets(points, velocity, 1e-3 * distance**4, radar, ss.Pose())
    amplitude = np.abs(paths.a[:, 0, 0]) * np.sqrt(1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10))
    return paths, list(zip(points, velocity, amplitude, strict=True))


def of_pair(radar, tx, antennas, points):
    """What one transmitter sends, without its code, as a receiver has it: the specification's numbers, written out."""
    wave, chirps = radar.waveform, np.arange(radar.num_chirps)
    turn = radar.num_tx if radar.multiplexing.kind == "tdm" else 1
    starts = (chirps * turn + (tx if turn > 1 else 0)) * wave.chirp_interval
    if wave.kind in ("ofdm", "pmcw"):
        return sum(a * _symbols(radar, tx, starts, p, v, antennas) for p, v, a in points)
    ts, slope = np.arange(wave.num_samples) / wave.sample_rate, wave.bandwidth / wave.ramp_time
    carriers = np.full(len(chirps), wave.start_frequency)
    if wave.kind == "stepped_fmcw":
        carriers = carriers + chirps % wave.num_steps * wave.bandwidth
    total = np.zeros((len(chirps), len(ts)), complex)
    for p, v, a in points:
        beat = a * dechirped(p, v, starts, ts, carriers, slope, antennas)
        if wave.kind == "pc_fmcw":
            delay, _ = retarded(p, v, starts[:, None] + ts, antennas)
            beat = beat * np.conj(chip_train(wave.chips, wave.code_length / wave.ramp_time, ts - delay))
        total += beat
    return total


def _symbols(radar, tx, starts, point, velocity, antennas):
    wave = radar.waveform
    prefix, repeats = (wave.cyclic_prefix, 1) if wave.kind == "ofdm" else (0.0, wave.repetitions)
    times = starts[:, None] + prefix + np.arange(repeats * wave.num_samples) / wave.sample_rate
    if wave.kind == "ofdm":
        tones = (np.arange(192) - 96)[tx :: radar.num_tx] * wave.subcarrier_spacing
        own = radar.waveform_of(tx).spectrum
        train = (own, tones, wave.chirp_interval, prefix, 1.0 / wave.subcarrier_spacing)
        return received(point, velocity, times, 77e9, lambda time: symbol_train(*train, time), antennas)
    codes, change = radar.multiplexing.codes(radar.num_chirps, radar.num_tx)[:, tx], CHANGE / wave.chip_rate

    def sent(time):
        factor = factors_in_turn(codes, wave.chirp_interval, change, time)
        return factor * chip_train(wave.chips[0], wave.chip_rate, time)

    samples = received(point, velocity, times, wave.carrier_frequency, sent, antennas)
    return samples.reshape(len(starts), repeats, -1).mean(axis=1)


@pytest.mark.parametrize("name", RADARS)
def test_raw_data_are_the_exact_retarded_signal(name) -> None:
    """Below -60 dB rms in every row of the first and the last receiver, at the default tolerances."""
    radar = RADARS[name]
    paths, points = scene(radar)
    adc = ss.synthesize(paths, radar)
    codes = radar.multiplexing.codes(radar.num_chirps, radar.num_tx)
    for rx in (0, radar.num_rx - 1):
        each = [of_pair(radar, tx, (radar.tx_array[tx], radar.rx_array[rx]), points) for tx in range(radar.num_tx)]
        if not radar.multiplexing.is_coded:
            wanted = np.stack(each, axis=1).reshape(adc[rx].shape)
        elif radar.waveform.kind in ("ofdm", "pmcw"):
            wanted = sum(each)
        else:
            wanted = np.einsum("mi,imn->mn", codes, np.stack(each))
        error = np.linalg.norm(adc[rx] - wanted, axis=1) / np.sqrt(np.mean(np.sum(np.abs(wanted) ** 2, axis=1)))
        assert error.max() < 1e-3


FEWER = {
    "awr2243_cascade": {"num_chirps": 16, "num_samples": 128},
    "radial_hd": {"num_chirps": 128, "num_samples": 64, "bandwidth": 180e6},
    "pmcw_79ghz": {"num_chirps": 64, "code_length": 511, "repetitions": 20},
    "ofdm": {"num_chirps": 64},
}


SLOW = {"radial_hd"}
"""192 channels and 16 bands of Doppler take long."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n in SLOW else ()) for n in RADARS])
def test_points_come_back_within_a_twentieth_of_a_bin(name) -> None:
    """Range, velocity (as far as it is told apart) and the sine of the azimuth, at 40 dB and more."""
    radar = RADARS[name].with_(**FEWER.get(name, {"num_chirps": 64}))
    sight = np.array([np.cos(0.22), np.sin(0.22), 0.0])
    distance, speed = 0.43 * min(radar.max_range, 80.0), -0.8 * min(radar.unfolded_velocity, 80.0)
    paths = ss.point_targets([distance * sight], [speed * sight], 1e5, radar, ss.Pose())
    adc = ss.synthesize(paths, radar, np.random.default_rng(3))
    points = ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar))
    best = points.power.argmax()
    virtual = (radar.tx_array[:, None] + radar.rx_array[None])[..., 1]
    assert points.snr_db[best] > 40.0
    assert points.range[best] == pytest.approx(distance, abs=0.05 * radar.range_resolution)
    assert points.radial_velocity[best] == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
    assert np.sin(points.azimuth[best]) == pytest.approx(sight[1], abs=0.05 * radar.wavelength / np.ptp(virtual))
