"""Effects of the front end with waveforms other than equal ramps, against closed form; statistical tests are seeded."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.signal.front_end.filters import transfer
from scarl_sionna.signal.receivers import channel_of

SLOW = 20e6
"""Samples a second, at which phase noise is resolved."""
ONE = {"tx_positions": ((0.0, 0.0, 0.0),), "rx_positions": ((0.0, 0.0, 0.0),), "noise_figure_db": 0.0}
LATE = tuple((np.arange(256) % 3 * 2e-6).tolist())
WAVEFORMS = {
    "staggered ramps": ss.Fmcw(num_chirps=256, chirp_offsets=LATE),
    "stepped ramps": ss.SteppedFmcw(bandwidth=75e6, num_steps=4, num_chirps=256, num_samples=256),
    "code within ramps": ss.PcFmcw(num_chirps=256),
    "code across ramps": ss.PcFmcw(num_chirps=256, coding="across"),
    "ofdm": ss.Ofdm(num_subcarriers=512, subcarrier_spacing=SLOW / 512, num_chirps=256),
    "pmcw": ss.Pmcw(code_length=511, chip_rate=SLOW, repetitions=1, num_chirps=256),
}
MASK = ((1e5, -80.0), (1e6, -95.0), (1e7, -115.0))


def radar_of(name, **fields) -> ss.RadarSpec:
    return ss.RadarSpec(waveform=WAVEFORMS[name]).with_(**ONE, **fields)


def raw(radar, distance=50.0, rcs=1e12, seed=None):
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[0.0, 0.0, 0.0]], rcs, radar, ss.Pose())
    return ss.synthesize(paths, radar, None if seed is None else np.random.default_rng(seed))


@pytest.mark.parametrize("name", WAVEFORMS)
def test_phase_noise_follows_its_mask_and_range_correlation(name) -> None:
    """A strong target at 50 m: S(f) 4 sin^2(pi f tau), within 1 dB a half octave (256 chirps, 5 sigma are 0.9 dB)."""
    radar = radar_of(name, phase_noise=ss.PhaseNoise(mask=MASK))
    clean = raw(radar_of(name))[0]
    phase = np.angle(raw(radar, seed=1)[0] * clean.conj()).astype(np.float64)
    phase[np.abs(clean) < 0.02 * np.abs(clean).max()] = 0.0  # few samples, of thermal noise alone
    window = np.hanning(radar.num_samples)
    power = np.abs(np.fft.rfft((phase - phase.mean()) * window, axis=1)) ** 2
    density = power.mean(axis=0) / (window**2).sum() / radar.sample_rate
    frequency = np.fft.rfftfreq(radar.num_samples, 1.0 / radar.sample_rate)
    level = 10.0 ** (np.interp(np.log10(np.maximum(frequency, 1.0)), [5, 6, 7], [-80, -95, -115]) / 10.0)
    level *= 4.0 * np.sin(np.pi * frequency * 100.0 / SPEED_OF_LIGHT) ** 2
    for low, high in pairwise(2e5 * 2.0 ** (np.arange(8) / 2.0)):
        band = (frequency >= low) & (frequency < high)
        if band.any():
            assert abs(10.0 * np.log10(density[band].sum() / level[band].sum())) < 1.0, (low, high)


def test_periods_that_are_averaged_average_the_noise() -> None:
    """A flat mask S: the variance of the mean of R periods is 2 S f_s (1 - sinc(f_s tau)) / R."""
    found = {}
    for repetitions in (1, 8):
        radar = radar_of("pmcw", phase_noise=ss.PhaseNoise(mask=((1e6, -105.0),)), repetitions=repetitions)
        radar = radar.with_(num_chirps=64)
        clean = raw(radar.with_(phase_noise=None))
        found[repetitions] = np.angle(raw(radar, seed=2) * clean.conj()).var()
        expected = 10.0**-10.5 * SLOW * 2.0 * (1.0 - np.sinc(SLOW * 100.0 / SPEED_OF_LIGHT)) / repetitions
        assert found[repetitions] == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("name", WAVEFORMS)
def test_leakage_stands_where_it_is_with_its_level(name) -> None:
    """It is the echo of a point target at rest as far away, with the power that its level says."""
    fields = {"num_chirps": 16} if name != "staggered ramps" else {"num_chirps": 16, "chirp_offsets": LATE[:16]}
    plain = radar_of(name).with_(**fields)
    paths = ss.point_targets([[20.3, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1e3, plain, ss.Pose())
    echo = ss.synthesize(paths, plain, method="direct")
    way = ss.Leakage(length=40.6, level_db=0.0)
    nothing = paths.select(np.zeros(1, dtype=bool))
    found = ss.synthesize(nothing, plain.with_(leakage=(way,)))
    ratio = np.vdot(found, echo) / np.vdot(found, found)
    assert np.linalg.norm(echo - ratio * found) < 1e-4 * np.linalg.norm(echo)  # all but its level and phase
    assert np.mean(np.abs(found) ** 2) == pytest.approx(1e-3 * 10.0**1.2, rel=0.02)


@pytest.mark.parametrize("name", ["ofdm", "pmcw"])
def test_filters_of_symbols_have_their_transfer_function(name) -> None:
    """At each tone, on both sides of the carrier; a constant is gone."""
    filters = ss.IfFilter(high_pass=(175e3, 350e3), low_pass=6e6)
    radar = radar_of(name).with_(num_chirps=4)
    clean, seen = (channel_of(raw(r)[0], r) for r in (radar, radar.with_(filters=filters)))
    tones = (np.arange(radar.num_samples) - radar.num_samples // 2) * SLOW / radar.num_samples
    inner = tones != 0.0
    ratio = (seen[0] / np.where(clean[0] == 0.0, 1.0, clean[0]))[inner]
    assert ratio == pytest.approx(np.conj(transfer(filters, tones[inner])), abs=2e-3)
    assert np.abs(seen[0][~inner]) < 1e-4 * np.abs(clean[0][~inner])


@pytest.mark.parametrize("name", ["code within ramps", "ofdm", "pmcw"])
def test_channel_errors_turn_the_map_as_of_ramps(name) -> None:
    """Gains and phases of the receivers, and a coupling with an imaginary part."""
    coupled = (((1.0, 0.0), (0.1, 0.2)), ((0.0, -0.1), (1.0, 0.0)))
    errors = ss.ChannelErrors(rx_gain_db=(0.0, -2.0), rx_phase_deg=(0.0, 50.0), rx_coupling=coupled)
    two = {**ONE, "rx_positions": ((0.0, 0.0, 0.0), (0.0, 0.0019, 0.0))}
    ratio = []
    for waveform in (ss.Fmcw(num_chirps=4), WAVEFORMS[name].with_(num_chirps=4)):
        radar = ss.RadarSpec(waveform=waveform).with_(**two)
        peaks = []
        for each in (radar, radar.with_(channels=errors)):
            rd = ss.range_doppler(ss.virtual_cube(raw(each, 30.0), each), each)
            peaks.append(rd.data[(slice(None), *np.unravel_index(rd.power.argmax(), rd.power.shape))])
        ratio.append(peaks[1] / peaks[0])
    assert ratio[1] == pytest.approx(ratio[0], abs=2e-3)
    assert np.angle(ratio[0][1], deg=True) < -40.0


def test_errors_of_ramps_need_ramps() -> None:
    for name in ("ofdm", "pmcw", "code within ramps"):
        with pytest.raises(ParameterRangeError, match="chirp_errors"):
            radar_of(name, chirp_errors=ss.ChirpErrors(start_jitter=1e-9))
    stepped = radar_of("stepped ramps", chirp_errors=ss.ChirpErrors(start_jitter=1.1e-9))
    phase = np.angle(raw(stepped, seed=3) * raw(radar_of("stepped ramps")).conj())[0].mean(axis=1)
    beat = stepped.waveform.chirp_slope * 100.0 / SPEED_OF_LIGHT
    assert phase.std() == pytest.approx(2.0 * np.pi * beat * 1.1e-9, rel=0.15)


@pytest.mark.parametrize("name", ["code within ramps", "ofdm", "pmcw", "stepped ramps"])
def test_the_echo_of_a_radome_is_there(name) -> None:
    """Its power is that of ramps."""
    skin = ss.RadomeLayer(thickness=3e-3, relative_permittivity=2.35)
    power = []
    for waveform in (ss.Fmcw(num_chirps=4), WAVEFORMS[name].with_(num_chirps=4)):
        radar = ss.RadarSpec(waveform=waveform).with_(radome=ss.Radome(layers=(skin,), distance=0.03))
        nothing = ss.point_targets([[50.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 0.0, radar, ss.Pose())
        power.append(np.mean(np.abs(ss.synthesize(nothing, radar)) ** 2))
    assert power[1] / power[0] == pytest.approx(1.0, rel=0.02)
