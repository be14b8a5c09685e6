"""Processing gain, ambiguity function and Doppler tolerance of each waveform against theory, within 0.2 dB."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.signal.noise import sample_noise_power

CHIRPS, SAMPLES, BAND = 32, 128, 150e6
RAMP = {"num_chirps": CHIRPS, "num_samples": SAMPLES, "bandwidth": BAND}
OFDM = {"num_subcarriers": SAMPLES, "subcarrier_spacing": BAND / SAMPLES, "num_chirps": CHIRPS}
CODE = {"chip_rate": BAND, "num_chirps": CHIRPS, "repetitions": 8}
WAVEFORMS = {
    "ramps": ss.Fmcw(**RAMP),
    "falling ramps": ss.Fmcw(**RAMP, direction="down"),
    "stepped ramps": ss.SteppedFmcw(**RAMP | {"bandwidth": BAND / 2.0}, num_steps=2),
    "ramps with a code": ss.PcFmcw(**RAMP, code_length=15),
    "ofdm": ss.Ofdm(**OFDM),
    "ofdm, comb": ss.Ofdm(**OFDM, comb=2),
    "m-sequence": ss.Pmcw(**CODE, code_length=127),
    "gold": ss.Pmcw(**CODE, code="gold", code_length=127, code_index=3),
    "zadoff-chu": ss.Pmcw(**CODE, code="zadoff_chu", code_length=127),
    "golay": ss.Pmcw(**CODE, code="golay", code_length=128, prefix_chips=128),
}
ONE = ss.AntennaArray(tx_positions=((0.0, 0.0, 0.0),), rx_positions=((0.0, 0.0, 0.0),), pattern=IsotropicPattern())


def radar_of(name) -> ss.RadarSpec:
    return ss.RadarSpec(waveform=WAVEFORMS[name], array=ONE)


def repeats(radar) -> int:
    return getattr(radar.waveform, "repetitions", 1)


def seen(radar, distance, speed, fine=1, rng=None, rcs=1.0, **options):
    """The map without windows of a point, and the power received of it [W]."""
    paths = ss.point_targets([[distance, 0.0, 0.0]], [[speed, 0.0, 0.0]], rcs, radar, ss.Pose())
    cube = ss.virtual_cube(ss.synthesize(paths, radar, rng), radar)
    bins = {"num_range_bins": fine * radar.num_range_bins, "num_doppler_bins": fine * radar.num_doppler_bins}
    power = abs(paths.a[0, 0, 0]) ** 2 * 1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10.0)
    return ss.range_doppler(cube, radar, "rect", **bins, **options), power


@pytest.mark.parametrize("name", WAVEFORMS)
def test_gain_is_the_number_of_samples(name) -> None:
    """Signal over noise in the map over that of a converter's sample; the mean of 4 x 4096 cells has 0.04 dB."""
    radar, rng = radar_of(name), np.random.default_rng(1)
    rd, power = seen(radar, 20.0 * radar.range_resolution, 0.0)
    noise = np.mean([np.mean(seen(radar, 20.0, 0.0, rng=rng, rcs=0.0)[0].power) for _ in range(4)])
    gain = rd.power.max() / noise / (power / (sample_noise_power(radar) * repeats(radar)))
    sent = radar.num_samples * radar.num_chirps * repeats(radar)
    assert 10.0 * np.log10(gain / sent) == pytest.approx(0.0, abs=0.2)


def dirichlet(place, count):
    """|sum exp(2j pi n place / count)| / count."""
    return np.abs(np.exp(2j * np.pi * np.multiply.outer(place, np.arange(count)) / count).mean(axis=-1))


def over_range(radar, lag):
    """The response at lags [bins] of a point at rest."""
    wave, count = radar.waveform, radar.num_range_bins
    if wave.kind == "pmcw":
        lines = np.mean([np.abs(np.fft.fft(code)) ** 2 for code in wave.chips], axis=0)
        order = np.fft.fftfreq(count, 1.0 / count)
        return np.abs(np.exp(2j * np.pi * np.multiply.outer(lag, order) / count) @ lines) / lines.sum()
    if wave.kind == "pc_fmcw":  # ramps weighted with the power of their code, dispersed by the receiver
        order = np.fft.fftfreq(wave.code_length, 1.0 / wave.code_length)
        lines = np.fft.fft(wave.chips) * np.exp(-1j * np.pi * (order / wave.ramp_time) ** 2 / wave.chirp_slope)
        weight = np.abs(np.exp(2j * np.pi * np.multiply.outer(np.arange(count) / count, order)) @ lines) ** 2
        return np.abs(np.exp(2j * np.pi * np.multiply.outer(lag, np.arange(count)) / count) @ weight) / weight.sum()
    return dirichlet(lag, count)


@pytest.mark.parametrize("name", [name for name in WAVEFORMS if name != "golay"])  # its sidelobes turn: see below
def test_the_map_of_a_point_at_rest_is_the_ambiguity_function(name) -> None:
    """All cells above -45 dB, four bins a resolution; of ramps with a code, whose filter takes the end of a window off
    an echo, those above -16 dB, and all within 1 % of the peak."""
    radar, fine = radar_of(name), 4
    rd, power = seen(radar, 20.0 * radar.range_resolution, 0.0, fine, compensate_motion=False)
    lag = np.arange(fine * radar.num_range_bins) / fine - 20.0
    doppler = np.arange(fine * radar.num_doppler_bins) / fine - radar.num_doppler_bins / 2.0
    theory = np.multiply.outer(dirichlet(doppler, radar.num_doppler_bins), over_range(radar, lag)) ** 2
    found = rd.power / power
    high = theory > (10.0**-1.6 if name == "ramps with a code" else 10.0**-4.5)
    assert high.sum() > 100
    assert np.abs(10.0 * np.log10(found[high] / theory[high])).max() < 0.2
    assert np.abs(np.sqrt(found) - np.sqrt(theory)).max() < 0.01


@pytest.mark.parametrize("name", ["m-sequence", "zadoff-chu", "gold"])
def test_a_code_loses_its_correlation_by_doppler_as_theory_says(name) -> None:
    """chi(k, nu): the code, turned by the Doppler frequency over all its repetitions, against itself k chips late."""
    radar, start = radar_of(name), 20
    speed = 0.9 * radar.unambiguous_velocity
    speed = np.round(speed / radar.velocity_resolution) * radar.velocity_resolution
    rd, power = seen(radar, start * radar.range_resolution, speed)
    chips, count, number = radar.waveform.chips[0], radar.num_samples, 8
    turn = np.exp(2j * np.pi * (-2.0 * speed / radar.wavelength) * np.arange(count * number) / BAND)
    late = np.roll(np.tile(chips, number), start) * turn
    theory = [np.abs(np.vdot(np.roll(np.tile(chips, number), lag), late)) / (count * number) for lag in range(count)]
    theory, row = np.array(theory) ** 2, int(rd.power.max(axis=1).argmax())
    high = theory > 10.0**-4.0
    assert high.sum() > {"gold": 50}.get(name, 5)
    assert np.abs(10.0 * np.log10(rd.power[row, high] / power / theory[high])).max() < 0.2


def migrated(radar, speed):
    """Mean of the phasor that range migration leaves, over the frame's frequencies and times."""
    place = (np.arange(400) + 0.5) / 400 - 0.5
    turns = 2.0 * speed / SPEED_OF_LIGHT * radar.sampled_bandwidth * radar.slow_interval * radar.num_doppler_bins
    return np.abs(np.exp(2j * np.pi * turns * np.outer(place, place)).mean())


@pytest.mark.parametrize("share", [0.3, -0.85])
@pytest.mark.parametrize("name", WAVEFORMS)
def test_tolerance_of_doppler(name, share) -> None:
    """A moving point keeps sinc(nu T) of its amplitude within a symbol, and what migration leaves."""
    radar = radar_of(name)
    speed = share * radar.unambiguous_velocity
    rd, power = seen(radar, 40.0 * radar.range_resolution, speed, fine=8)
    coded = radar.waveform.kind in ("ofdm", "pmcw")
    seconds = repeats(radar) * radar.num_samples / radar.sample_rate if coded else 0.0
    kept = np.sinc(2.0 * speed / radar.wavelength * seconds) * migrated(radar, speed)
    assert 10.0 * np.log10(rd.power.max() / power) == pytest.approx(20.0 * np.log10(abs(kept)), abs=0.2)
