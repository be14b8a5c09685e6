"""Effects of the front end against closed form; statistical tests are seeded."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.units import SPEED_OF_LIGHT, dbm_to_watt
from scarl_sionna.signal.converter import step_size
from scarl_sionna.signal.front_end.amplifier import compress
from scarl_sionna.signal.front_end.filters import apply_filters
from scarl_sionna.signal.front_end.mixer import unbalance

RADAR = ss.RadarSpec().with_(num_chirps=128, noise_figure_db=0.0)
ONE = RADAR.with_(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),))
MASK = ((1e5, -80.0), (1e6, -95.0), (1e7, -115.0))


def raw(radar, distance=50.0, rcs=1e12, seed=1):
    """Raw data of a point that stands straight ahead."""
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[0.0, 0.0, 0.0]], rcs, radar, Pose())
    return ss.synthesize(paths, radar, None if seed is None else np.random.default_rng(seed), method="direct")


def phase_density(radar, adc, clean):
    """Offsets [Hz] and density [rad2/Hz] of the phase within the chirps, by averaged periodograms."""
    phase = np.angle(adc * clean.conj())[0].astype(np.float64)
    phase -= phase.mean()
    window = np.hanning(radar.num_samples)
    power = np.abs(np.fft.rfft(phase * window, axis=1)) ** 2 / (window**2).sum() / radar.sample_rate
    return np.fft.rfftfreq(radar.num_samples, 1.0 / radar.sample_rate), power.mean(axis=0)


@pytest.mark.parametrize(("distance", "apart"), [(50.0, False), (15.0, False), (50.0, True)])
def test_phase_noise_follows_its_mask_and_range_correlation(distance, apart):
    """A strong target: S(f) 4 sin^2(pi f tau) of one oscillator, 2 S(f) of two, within 1 dB a third of an octave."""
    noise = ss.PhaseNoise(mask=MASK, tx_oscillator=(1,) if apart else (), rx_oscillator=(0,) if apart else ())
    radar = ONE.with_(num_chirps=2048, phase_noise=noise)
    frequency, density = phase_density(
        radar, raw(radar, distance), raw(ONE.with_(num_chirps=2048), distance, seed=None)
    )
    level = 10.0 ** (np.interp(np.log10(np.maximum(frequency, 1.0)), [5, 6, 7], [-80, -95, -115]) / 10.0)
    factor = 2.0 if apart else 4.0 * np.sin(np.pi * frequency * 2.0 * distance / SPEED_OF_LIGHT) ** 2
    edges = 1.5e5 * 2.0 ** (np.arange(14) / 3.0)  # to 3 MHz, where the echo from 50 m has its first null
    for low, high in pairwise(edges):
        band = (frequency >= low) & (frequency < high)
        if band.any():
            apart_db = 10.0 * np.log10(density[band].sum() / (level * factor)[band].sum())
            assert abs(apart_db) < 1.0, (low, high, apart_db)


@pytest.mark.parametrize("distance", [2.0, 50.0, 200.0])
def test_power_of_phase_noise_has_the_closed_form_of_a_flat_mask(distance):
    """A flat mask S: variance 2 S f_s (1 - sinc(f_s tau)), in the whole band, and nothing near the radar."""
    radar = ONE.with_(num_chirps=512, phase_noise=ss.PhaseNoise(mask=((1e6, -105.0),)))
    adc, clean = raw(radar, distance), raw(ONE.with_(num_chirps=512), distance, seed=None)
    found = np.angle(adc * clean.conj()).var()
    band, delay = radar.sample_rate, 2.0 * distance / SPEED_OF_LIGHT
    expected = 10.0**-10.5 * band * 2.0 * (1.0 - np.sinc(band * delay))
    assert found == pytest.approx(expected, rel=0.03)


def test_groups_of_delays_stand_for_every_path():
    """Many paths: the noise power in the map is that of each path with its own delay, added up."""
    radar = ONE.with_(num_chirps=256, phase_noise=ss.PhaseNoise(mask=((1e6, -90.0),)))
    distance = np.array([5.0, 5.2, 12.0, 31.0, 33.0, 80.0])
    places = np.stack([distance, 0 * distance, 0 * distance], axis=1)
    paths = ss.point_targets(places, 0.0 * places, 1e3 * distance**4 / 5.0**4, radar, Pose())
    clean = ss.synthesize(paths, radar.with_(front_end=radar.front_end.ideal()), method="direct")
    noise = ss.synthesize(paths, radar, np.random.default_rng(3), method="direct") - clean
    each = np.mean(np.abs(clean) ** 2) / len(distance)  # equal powers
    band, delay = radar.sample_rate, 2.0 * distance / SPEED_OF_LIGHT
    expected = each * (10.0**-9.0 * band * 2.0 * (1.0 - np.sinc(band * delay))).sum()
    assert np.mean(np.abs(noise) ** 2) / expected == pytest.approx(1.0, rel=0.12)  # beats between the paths


def test_jitter_of_starts_turns_the_phase_of_a_chirp():
    """By 2 pi times the beat frequency times the delay: 1.1 ns are 0.4 deg a MHz (Texas Instruments, SPRACV2)."""
    radar = ONE.with_(num_chirps=1024, chirp_errors=ss.ChirpErrors(start_jitter=1.1e-9))
    beat = radar.waveform.chirp_slope * 100.0 / SPEED_OF_LIGHT
    phase = np.angle(raw(radar) * raw(ONE.with_(num_chirps=1024), seed=None).conj())[0].mean(axis=1)
    assert phase.std() == pytest.approx(2.0 * np.pi * beat * 1.1e-9, rel=0.08)


def test_ripple_of_ramps_makes_paired_echoes():
    """A sinusoidal error of frequency: side lobes J1 of the phase that is left, at the ripple's frequency."""
    radar = ONE.with_(num_chirps=1, chirp_errors=ss.ChirpErrors(ripple_frequency_error=50e3, ripple_periods=20.0))
    wave, delay = radar.waveform, 100.0 / SPEED_OF_LIGHT
    rate = 20.0 * radar.sample_rate / 512
    index = 2.0 * 50e3 / rate * np.sin(np.pi * rate * delay)  # peak phase of theta(t) - theta(t - tau)
    at_bin = round(wave.chirp_slope * delay / radar.sample_rate * 512) * radar.range_resolution
    spectrum = np.abs(np.fft.fft(raw(radar, at_bin, seed=None)[0, 0]))
    peak = int(spectrum.argmax())
    for side in (-20, 20):
        assert spectrum[peak + side] / spectrum[peak] == pytest.approx(index / 2.0, rel=0.02)


def test_leakage_stands_where_it_is_with_its_level():
    radar = RADAR.with_(num_chirps=4, leakage=(ss.Leakage(length=20.0, level_db=-40.0),))
    none = ss.point_targets([[50.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1e-20, radar, Pose())
    rd = ss.range_doppler(ss.virtual_cube(ss.synthesize(none, radar), radar), radar, num_range_bins=8192)
    column = rd.power[2].argmax()
    assert rd.range[column] == pytest.approx(10.0, abs=0.05)
    assert 10 * np.log10(rd.power[2, column] * 1e3) == pytest.approx(12.0 - 40.0, abs=0.01)


def test_level_of_the_image():
    gain, phase = 10 ** (0.3 / 20), np.radians(2.0)
    tone = np.exp(2j * np.pi * 20 * np.arange(512) / 512).astype(np.complex64)
    spectrum = np.fft.fft(unbalance(tone, ss.Mixer(iq_gain_db=0.3, iq_phase_deg=2.0))) / 512
    expected = (1 + gain**2 - 2 * gain * np.cos(phase)) / (1 + gain**2 + 2 * gain * np.cos(phase))
    assert abs(spectrum[-20] / spectrum[20]) ** 2 == pytest.approx(expected, rel=1e-4)


def test_compression_and_third_order_intercept():
    amplifier = ss.Amplifier(p1db_dbm=-10.0)
    peak = np.sqrt(dbm_to_watt(-10.0))
    assert 20 * np.log10(abs(compress(np.array([peak]), amplifier)[0]) / peak) == pytest.approx(-1.0, abs=1e-5)
    n = np.arange(512)
    one, two = (np.exp(2j * np.pi * k * n / 512) for k in (50, 60))
    small = np.sqrt(dbm_to_watt(-40.0))
    out = 20 * np.log10(np.abs(np.fft.fft(compress(small * (one + two), amplifier).astype(complex))) / 512 / small)
    intercept = -40.0 - (out[40] - out[50]) / 2.0
    assert intercept == pytest.approx(-10.0 + 9.64, abs=0.05)  # 10 log10(1 / (1 - 10^(-1/20)))
    levels = np.abs(compress(np.sqrt(1e-3 * 10 ** (np.linspace(-30, 30, 61) / 10)), amplifier))
    assert (np.diff(levels) >= -1e-9).all()  # no output falls where the input grows


@pytest.mark.parametrize("low_pass", [None, 6e6])
def test_filters_have_their_transfer_function(low_pass):
    radar = ONE.with_(num_chirps=1, filters=ss.IfFilter(high_pass=(175e3, 350e3), low_pass=low_pass))
    n, window = np.arange(512), np.hanning(512)
    for cycles in (4, 8, 20, 60, 150, 230):
        tone = np.exp(2j * np.pi * cycles * n / 512).astype(np.complex64)[None, None]
        got = np.fft.fft(apply_filters(tone, radar)[0, 0] * window)[cycles] / window.sum()
        f = cycles / 512 * radar.sample_rate
        expected = 1.0 / np.sqrt((1 + (175e3 / f) ** 2) * (1 + (350e3 / f) ** 2))
        if low_pass:
            expected /= np.sqrt(1 + (f / low_pass) ** 8)
        assert 20 * np.log10(abs(got) / expected) == pytest.approx(0.0, abs=0.1), f
    constant = apply_filters(np.ones((1, 1, 512), dtype=np.complex64), radar)
    assert np.abs(constant).max() < 1e-6  # settled before the first sample


@pytest.mark.parametrize(("bits", "enob"), [(12, None), (12, 10.5), (16, 11.2), (8, 9.0)])
def test_noise_of_the_converter(bits, enob):
    radar = RADAR.with_(bits=bits, enob=enob)
    peak = np.sqrt(dbm_to_watt(radar.adc.full_scale_dbm)) * 0.98
    n = np.arange(200_000)
    tone = (peak * np.exp(2j * np.pi * 0.1234567 * n)).astype(np.complex64)
    codes, scale, _ = ss.quantize(tone, radar, np.random.default_rng(0))
    error = codes[:, 0] * scale - tone.real + 1j * (codes[:, 1] * scale - tone.imag)
    full_scale = dbm_to_watt(radar.adc.full_scale_dbm)
    expected = 6.02 * min(bits, enob or bits) + 1.76
    assert 10 * np.log10(full_scale / np.mean(np.abs(error) ** 2)) == pytest.approx(expected, abs=0.15)


RESPONSE = ((0.0, 0.0), (0.25, -1.5), (0.7, 0.5), (0.8, -12.0), (0.9, -6.0))


def test_response_of_the_converter_weakens_tones_as_stated():
    """Shares of the points, and 0.525: linear in decibels between them, -2.5 dB and 0.5 dB to 0.25 and 0.7."""
    radar = RADAR.with_(response=RESPONSE)
    n, amplitude = np.arange(400), np.sqrt(0.1 * dbm_to_watt(radar.adc.full_scale_dbm))
    for share, gain_db in (*RESPONSE, (0.475, -0.5), (0.95, -3.0)):
        tone = (amplitude * np.exp(2j * np.pi * share * n)).astype(np.complex64)
        codes, scale, _ = ss.quantize(np.stack([tone, 2.0 * tone]), radar)
        left = scale * (codes[..., 0] + 1j * codes[..., 1])
        level = 20 * np.log10(np.abs((left * np.exp(-2j * np.pi * share * n)).mean(axis=1)) / amplitude)
        assert level == pytest.approx([gain_db, gain_db + 20 * np.log10(2.0)], abs=0.01), share


def test_response_of_the_converter_shapes_its_own_noise():
    """Noise of `enob` arises before the decimation: 5 sigma of 4000 rows, a bin each."""
    radar = RADAR.with_(response=RESPONSE, enob=9.0)
    codes, scale, _ = ss.quantize(np.zeros((4000, 100), np.complex64), radar, np.random.default_rng(3))
    power = (np.abs(np.fft.fft(scale * (codes[..., 0] + 1j * codes[..., 1]), axis=1)) ** 2).mean(axis=0) / 100
    white = dbm_to_watt(radar.adc.full_scale_dbm) / (1.5 * 4.0**9)
    for share, gain_db in RESPONSE:
        assert power[round(100 * share)] == pytest.approx(white * 10 ** (gain_db / 10), rel=5.0 / np.sqrt(4000)), share


@pytest.mark.parametrize("response", [((0.2, 0.0), (0.2, 1.0)), ((-0.1, 0.0),), ((0.0, 0.0), (1.0, 0.0))])
def test_responses_that_are_none_are_refused(response):
    with pytest.raises(ParameterRangeError, match="response"):
        RADAR.with_(response=response)


def test_third_harmonic_of_the_converter():
    radar = RADAR.with_(inl_lsb=8.0, bits=12)
    peak = 2047 * step_size(radar)
    n = np.arange(4096)
    codes, _, _ = ss.quantize((peak * np.cos(2 * np.pi * 101 * n / 4096)).astype(np.complex64), radar)
    spectrum = np.abs(np.fft.rfft(codes[:, 0])) / 2048
    assert spectrum[303] == pytest.approx(8.0 * 1.5 * np.sqrt(3.0) / 4.0, abs=0.05)


@pytest.mark.parametrize("multiplexing", ["ideal", "ddm"])
def test_channel_errors_are_those_of_every_pair(multiplexing):
    coupled = (((1.0, 0.0), (0.1, 0.05), (0.0, 0.0)), ((0.1, 0.05), (1.0, 0.0), (0.0, 0.0)), ((0, 0), (0, 0), (1, 0)))
    errors = ss.ChannelErrors(
        tx_gain_db=(0.0, 1.0, -1.0), rx_phase_deg=(0.0, 30.0, -60.0, 90.0), tx_coupling=coupled, rx_gain_db=(2, 0, 0, 0)
    )
    radar = RADAR.with_(num_chirps=16, multiplexing=multiplexing)
    ideal = ss.virtual_cube(raw(radar, seed=None), radar)
    cube = ss.virtual_cube(raw(radar.with_(channels=errors), seed=None), radar)
    mixing = np.array(coupled)[..., 0] + 1j * np.array(coupled)[..., 1]
    sent = mixing * 10 ** (np.array([0.0, 1.0, -1.0]) / 20)
    heard = np.exp(1j * np.radians([0.0, 30.0, -60.0, 90.0])) * 10 ** (np.array([2, 0, 0, 0]) / 20)
    kept = np.fft.fft(ideal.reshape(3, 4, 16, -1), axis=2)[:, :, 0]
    got = np.fft.fft(cube.reshape(3, 4, 16, -1), axis=2)[:, :, 0]
    expected = np.einsum("irn,ik,r->krn", kept, sent.conj(), heard.conj())
    assert np.linalg.norm(got - expected) < 1e-5 * np.linalg.norm(expected)


NEUTRAL = {
    "channels": ss.ChannelErrors(tx_gain_db=(0, 0, 0), rx_phase_deg=(0, 0, 0, 0)),
    "chirp_errors": ss.ChirpErrors(),
    "mixer": ss.Mixer(),
    "filters": ss.IfFilter(),
}


@pytest.mark.parametrize("name", list(NEUTRAL))
def test_effects_of_no_size_change_no_byte(name):
    radar = RADAR.with_(num_chirps=8)
    assert raw(radar).tobytes() == raw(radar.with_(**{name: NEUTRAL[name]})).tobytes()
    assert radar.front_end.model_dump() == {"tx_power_dbm": 12, "noise_figure_db": 0, "source_temperature": 290}
    changed = radar.with_(**{name: NEUTRAL[name]})
    assert ss.RadarSpec(**changed.model_dump(mode="json")) == changed


def test_what_does_not_fit_is_refused():
    with pytest.raises(ParameterRangeError, match=r"channels.tx_gain_db = 2 values .*3 values"):
        RADAR.with_(channels=ss.ChannelErrors(tx_gain_db=(0.0, 1.0)))
    with pytest.raises(ParameterRangeError, match=r"phase_noise.rx_oscillator = 1 values"):
        RADAR.with_(phase_noise=ss.PhaseNoise(mask=MASK, rx_oscillator=(0,)))
    with pytest.raises(ParameterRangeError, match="mask"):
        ss.PhaseNoise(mask=((1e6, -90.0), (1e5, -80.0)))
    radar = RADAR.with_(mixer=ss.Mixer(iq_gain_db=1.0))
    with pytest.raises(ParameterRangeError, match="chirps_per_block = 8 .*front end"):
        ss.synthesize_blocks(lambda time: None, radar, 8)
