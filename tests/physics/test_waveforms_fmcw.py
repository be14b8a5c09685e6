"""Kinds of FMCW frames against the transmitted ramp times what arrives, followed back in time; maps back at the point.

Falling ramps, a late ADC start, carriers that change from chirp to chirp, staggered and jittered starts, one chirp.
"""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.synthesis.blocks import later, synthesize_blocks
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.oracles.waveforms import chip_train, dechirped, retarded

ONE = ((0.0, 0.0, 0.0),)
RAMP = {"bandwidth": 150e6, "ramp_time": 30e-6, "idle_time": 10e-6, "num_samples": 256, "num_chirps": 64}
WAVEFORMS = {
    "up": ss.Fmcw(**RAMP),
    "down": ss.Fmcw(**RAMP, direction="down"),
    "late start": ss.Fmcw(**RAMP, adc_start_time=4e-6, sampling_frequency=10e6),
    "carrier step": ss.Fmcw(**RAMP, frequency_step=2e6),
    "falling carriers": ss.Fmcw(**RAMP, frequency_step=-1e6, direction="down"),
    "hops": ss.Fmcw(**RAMP, frequency_offsets=tuple((np.arange(64) * 37 % 64 * 1.5e6).tolist())),
    "stagger": ss.Fmcw(**RAMP, chirp_offsets=tuple((np.arange(64) % 3 * 4e-6).tolist())),
    "jitter": ss.Fmcw(**RAMP, chirp_jitter=8e-6, jitter_seed=3),
    "stepped": ss.SteppedFmcw(**RAMP, num_steps=4),
    "overlapping steps": ss.SteppedFmcw(**RAMP, num_steps=4, frequency_step=110e6, adc_start_time=1e-6),
    "falling steps": ss.SteppedFmcw(**RAMP, num_steps=2, direction="down"),
    "code across": ss.PcFmcw(**RAMP, coding="across", code_length=63),
    "code within": ss.PcFmcw(**RAMP, code_length=31),
    "Zadoff-Chu within": ss.PcFmcw(**RAMP, code="zadoff_chu", code_length=64, direction="down", adc_start_time=1e-6),
    "all": ss.Fmcw(**RAMP, direction="down", adc_start_time=2e-6, frequency_step=1e6, chirp_jitter=8e-6),
}
BOUND = Accuracy().synthesis_tolerance + Accuracy().motion_tolerance
"""What the settings promise of one point over its amplitude: -59 dB; the bar is -60 dB rms."""


def radar_of(waveform) -> ss.RadarSpec:
    return ss.RadarSpec(
        waveform=waveform, array=ss.AntennaArray(tx_positions=ONE, rx_positions=ONE, pattern=IsotropicPattern())
    )


def exact(radar, point, velocity, amplitude):
    """The oracle's signal for the specification's numbers, which are written out here."""
    wave = radar.waveform
    late = np.zeros(wave.num_chirps)
    if wave.chirp_offsets is not None:
        late = np.asarray(wave.chirp_offsets)
    if wave.chirp_jitter:
        late = np.random.default_rng(wave.jitter_seed).uniform(0.0, wave.chirp_jitter, wave.num_chirps)
    carriers = wave.start_frequency + wave.frequency_step * np.arange(wave.num_chirps)
    if wave.frequency_offsets is not None:
        carriers = wave.start_frequency + np.asarray(wave.frequency_offsets)
    if wave.kind == "stepped_fmcw":
        sampled = wave.bandwidth * (wave.ramp_time - wave.adc_start_time) / wave.ramp_time
        sign = {"up": 1.0, "down": -1.0}[wave.direction]
        order = np.arange(wave.num_chirps) % wave.num_steps
        carriers = wave.start_frequency + sign * (wave.frequency_step or sampled) * order
    starts = np.arange(wave.num_chirps) * (wave.ramp_time + wave.idle_time) + late
    rate = wave.sampling_frequency or wave.num_samples / (wave.ramp_time - wave.adc_start_time)
    ts = wave.adc_start_time + np.arange(wave.num_samples) / rate
    slope = {"up": 1.0, "down": -1.0}[wave.direction] * wave.bandwidth / wave.ramp_time
    beat = amplitude * dechirped(point, velocity, starts, ts, carriers, slope)
    if wave.kind != "pc_fmcw":
        return beat
    if wave.coding == "across":
        return beat * np.conj(wave.chips[np.arange(wave.num_chirps) % wave.code_length])[:, None]
    delay, _ = retarded(point, velocity, starts[:, None] + ts)
    return beat * np.conj(chip_train(wave.chips, wave.code_length / wave.ramp_time, ts - delay))


def amplitude_of(paths, radar):
    return abs(paths.a[0, 0, 0]) * np.sqrt(1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10))


def on_a_ray(distance, speed):
    """A point on a ray off boresight, and its velocity along the ray."""
    ray = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    return distance * ray, speed * ray


def between(axis, power, index):
    """Return where a parabola through the logarithms about a maximum has its own."""
    low, here, high = np.log(power[index - 1 : index + 2].astype(float))
    return axis[index] + 0.5 * (low - high) / (low - 2.0 * here + high) * (axis[1] - axis[0])


@pytest.mark.some(8)
@pytest.mark.usefixtures("ways")
@pytest.mark.parametrize("name", WAVEFORMS)
def test_a_point_is_the_exact_retarded_signal(name) -> None:
    radar = radar_of(WAVEFORMS[name])
    for distance, speed in ((3.0, 0.0), (3.0, -5.0), (40.0, 70.0), (120.0, -70.0), (200.0, 20.0)):
        if distance > radar.max_range:
            continue
        point, velocity = on_a_ray(distance, speed)
        paths = point_targets([point], [velocity], 1.0, radar, Pose())
        wanted = exact(radar, point, velocity, amplitude_of(paths, radar))
        error = np.abs(synthesize(paths, radar)[0] - wanted) / np.abs(wanted).max()
        assert error.max() < BOUND, (distance, speed)
        assert np.sqrt(np.mean(error**2)) < 1e-3, (distance, speed)


@pytest.mark.some(3)
@pytest.mark.parametrize("name", WAVEFORMS)
def test_many_paths_are_the_direct_sum(name) -> None:
    """Both ways that motion is given: rates of the centre alone, and velocities of end points."""
    is_slow = name.endswith("within")  # the plain sum is over the lines of the code, too
    waveform = WAVEFORMS[name].with_(num_chirps=16) if is_slow else WAVEFORMS[name]
    radar, rng, count = radar_of(waveform), np.random.default_rng(5), 60 if is_slow else 300
    distance, azimuth = rng.uniform(3.0, 0.9 * radar.max_range, count), rng.uniform(-1.0, 1.0, count)
    points = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    paths = point_targets(points, rng.normal(0.0, 15.0, (count, 3)), 1e-3 * distance**4, radar, Pose())
    for tolerance in (None, 1e-3):
        accuracy = Accuracy(motion_tolerance=tolerance)
        fast, plain = (synthesize(paths, radar, accuracy=accuracy, method=how) for how in ("nufft", "direct"))
        error = np.abs(fast - plain).max() / np.abs(plain).max()
        assert error < accuracy.synthesis_tolerance + (tolerance or 0.0)


@pytest.mark.some(2)
@pytest.mark.parametrize("window", ["hann", "rect"])
@pytest.mark.parametrize("name", WAVEFORMS)
def test_the_map_has_its_peak_at_the_point(name, window) -> None:
    """Range at the start and velocity within 0.05 bins, received power within 0.25 dB (migration and the grid)."""
    radar = radar_of(WAVEFORMS[name])
    vmax, step = radar.unambiguous_velocity, radar.range_resolution
    for distance, speed in ((20.3 * step, 0.0), (40.6 * step, 0.31 * vmax), (80.5 * step, -0.7 * vmax)):
        point, velocity = on_a_ray(distance, speed)
        paths = point_targets([point], [velocity], 1.0, radar, Pose())
        cube = virtual_cube(synthesize(paths, radar, method="direct"), radar)
        rd = range_doppler(cube, radar, window, num_range_bins=16 * radar.num_range_bins, num_doppler_bins=8 * 64)
        row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
        found = between(rd.range, rd.power[row], column), between(rd.radial_velocity, rd.power[:, column], row)
        assert found[0] == pytest.approx(distance, abs=0.05 * step)
        assert found[1] == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
        assert 10.0 * np.log10(rd.power[row, column] / amplitude_of(paths, radar) ** 2) == pytest.approx(0.0, abs=0.25)


def test_two_speeds_in_one_range_cell_are_told_apart_by_hops_and_jitter() -> None:
    for name in ("hops", "jitter", "down"):
        radar = radar_of(WAVEFORMS[name])
        speeds = np.array([-0.4, 0.25]) * radar.unambiguous_velocity
        places = [on_a_ray(30.0, speed) for speed in speeds]
        paths = point_targets([p for p, _ in places], [v for _, v in places], 1.0, radar, Pose())
        rd = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar)
        column = int(np.argmin(np.abs(rd.range - 30.0)))
        for speed in speeds:
            row = int(np.argmin(np.abs(rd.radial_velocity - speed)))
            near = rd.power[row - 2 : row + 3, column].max()
            assert near > 0.3 * amplitude_of(paths, radar) ** 2
        quiet = int(np.argmin(np.abs(rd.radial_velocity - 0.9 * radar.unambiguous_velocity)))
        assert rd.power[quiet, column] < 1e-2 * rd.power.max()


def test_one_chirp_makes_a_range_profile() -> None:
    radar = radar_of(ss.Fmcw(**{**RAMP, "num_chirps": 1}))
    point, velocity = on_a_ray(50.0, 10.0)
    paths = point_targets([point], [velocity], 1.0, radar, Pose())
    wanted = exact(radar, point, velocity, amplitude_of(paths, radar))
    adc = synthesize(paths, radar)
    assert np.abs(adc[0] - wanted).max() < BOUND * np.abs(wanted).max()
    rd = range_doppler(virtual_cube(adc, radar), radar, num_range_bins=16 * 256)
    # one chirp cannot know the Doppler frequency: range-Doppler coupling stays, 77 GHz * 10 m/s over the slope
    coupled = 10.0 * radar.center_frequency / radar.waveform.chirp_slope + 10.0 * 15e-6
    assert rd.range[rd.power[0].argmax()] == pytest.approx(50.0 + coupled, abs=0.05 * radar.range_resolution + 0.04)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"adc_start_time": 31e-6}, "adc_start_time"),
        ({"adc_start_time": 10e-6, "sampling_frequency": 10e6}, "num_samples / sampling_frequency"),
        ({"chirp_offsets": (0.0,)}, "one a chirp, 64"),
        ({"frequency_offsets": (0.0,)}, "one a chirp, 64"),
        ({"chirp_jitter": 11e-6}, "idle_time"),
        ({"frequency_step": 1e6, "frequency_offsets": (0.0,) * 64}, "give one of both"),
        ({"frequency_step": -2e9}, "1 MHz"),
    ],
)
def test_what_no_frame_can_be_is_refused(fields, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ss.Fmcw(**{**RAMP, **fields})


@pytest.mark.some(5)
@pytest.mark.parametrize("name", [*WAVEFORMS, "ofdm", "pmcw", "golay"])
def test_blocks_of_chirps_make_the_whole_frame(name) -> None:
    """What each chirp has of its own stays with it: carriers, starts, chips, data, turns of a pair of codes."""
    others = {
        "ofdm": ss.Ofdm(num_subcarriers=64, num_chirps=32),
        "pmcw": ss.Pmcw(code_length=63, num_chirps=32),
        "golay": ss.Pmcw(code="golay", code_length=64, prefix_chips=64, num_chirps=32, chip_rate=150e6),
    }
    radar = radar_of((WAVEFORMS | others)[name])
    point, velocity = on_a_ray(30.0, 4.0)
    paths = point_targets([point], [velocity], 1.0, radar, Pose())
    whole = synthesize(paths, radar)
    blocks = synthesize_blocks(lambda time: later(paths, time), radar, 8)
    assert np.abs(blocks - whole).max() < 2.0 * BOUND * np.abs(whole).max()
