"""OFDM and phase codes against what was sent a delay earlier, followed back in time; receivers back at the point."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import detect
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.oracles.waveforms import chip_train, received, symbol_train

ONE = ((0.0, 0.0, 0.0),)
OFDM = {"num_subcarriers": 256, "subcarrier_spacing": 600e3, "num_chirps": 16, "idle_time": 20e-6}
CODE = {"chip_rate": 300e6, "num_chirps": 16, "repetitions": 3}
WAVEFORMS = {
    "ofdm": ss.Ofdm(**OFDM),
    "comb": ss.Ofdm(**OFDM, comb=2, comb_offset=1),
    "pilots": ss.Ofdm(**OFDM, pilot_spacing=2),
    "own data": ss.Ofdm(**OFDM, data_phases_deg=(tuple(np.linspace(0.0, 9e3, 256).tolist()),)),
    "m-sequence": ss.Pmcw(**CODE, code_length=511),
    "apas": ss.Pmcw(**CODE, code="apas", code_length=456),
    "gold": ss.Pmcw(**CODE, code="gold", code_length=511, code_index=5),
    "zadoff-chu": ss.Pmcw(**CODE, code="zadoff_chu", code_length=503, code_index=7),
    "golay": ss.Pmcw(**CODE, code="golay", code_length=512, prefix_chips=440),
    "own code": ss.Pmcw(**CODE, code="own", code_length=4, code_phases_deg=(0.0, 90.0, 0.0, 180.0)),
}
BOUND = Accuracy().synthesis_tolerance + Accuracy().motion_tolerance


def radar_of(waveform) -> ss.RadarSpec:
    return ss.RadarSpec(
        waveform=waveform, array=ss.AntennaArray(tx_positions=ONE, rx_positions=ONE, pattern=IsotropicPattern())
    )


def power_of(paths, radar):
    return abs(paths.a[0, 0, 0]) ** 2 * 1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10)


def on_a_ray(distance, speed):
    ray = np.array([np.cos(0.2), np.sin(0.2), 0.0])
    return distance * ray, speed * ray


def exact(radar, point, velocity):
    """The oracle's signal of a unit point, for the specification's numbers."""
    wave = radar.waveform
    if wave.kind == "ofdm":
        interval, period = (
            wave.cyclic_prefix + 1.0 / wave.subcarrier_spacing + wave.idle_time,
            1.0 / wave.subcarrier_spacing,
        )
        tones = (np.arange(wave.num_subcarriers) - wave.num_subcarriers // 2)[wave.comb_offset :: wave.comb]
        data = np.broadcast_to(wave.spectrum, (wave.num_chirps, len(tones)))
        rate, prefix, repeats = wave.num_subcarriers * wave.subcarrier_spacing, wave.cyclic_prefix, 1
        count = wave.num_subcarriers

        def sent(time):
            return symbol_train(data, tones * wave.subcarrier_spacing, interval, prefix, period, time)
    else:
        rate, count, repeats = wave.chip_rate, wave.code_length, wave.repetitions
        prefix = wave.prefix_chips / rate
        interval = prefix + repeats * count / rate
        chips = wave.chips

        def sent(time):
            if len(chips) == 1:
                return chip_train(chips[0], rate, time - prefix)
            turn = np.floor(time / interval).astype(int) % 2  # nothing is sent between them
            both = [chip_train(code, rate, np.mod(time, interval) - prefix) for code in chips]
            return np.where(turn == 0, *both) * (time >= 0.0)

    start = np.arange(wave.num_chirps)[:, None] * interval + prefix
    times = start + np.arange(repeats * count) / rate
    samples = received(point, velocity, times, wave.carrier_frequency, sent)
    return samples.reshape(wave.num_chirps, repeats, count).mean(axis=1)


@pytest.mark.some(3)
@pytest.mark.usefixtures("ways")
@pytest.mark.parametrize("name", WAVEFORMS)
def test_a_point_is_what_was_sent_a_delay_earlier(name) -> None:
    radar = radar_of(WAVEFORMS[name])
    for distance, speed in ((3.0, 0.0), (40.0, 70.0), (120.0, -70.0), (200.0, 20.0)):
        point, velocity = on_a_ray(distance, speed)
        paths = point_targets([point], [velocity], 1.0, radar, Pose())
        wanted = np.sqrt(power_of(paths, radar)) * exact(radar, point, velocity)
        error = np.abs(synthesize(paths, radar)[0] - wanted)
        assert error.max() < BOUND * np.abs(wanted).max(), (distance, speed)
        assert np.linalg.norm(error) < 1e-3 * np.linalg.norm(wanted), (distance, speed)


@pytest.mark.parametrize("name", ["ofdm", "m-sequence", "golay"])
def test_the_direct_sum_is_the_oracle(name) -> None:
    radar = radar_of(WAVEFORMS[name].with_(num_chirps=4))
    point, velocity = on_a_ray(60.0, 50.0)
    paths = point_targets([point], [velocity], 1.0, radar, Pose())
    wanted = np.sqrt(power_of(paths, radar)) * exact(radar, point, velocity)
    found = synthesize(paths, radar, accuracy=Accuracy(motion_tolerance=1e-9), method="direct")[0]
    assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()  # results are of complex64


@pytest.mark.some(1)
@pytest.mark.parametrize("name", ["ofdm", "golay"])
def test_an_echo_after_the_prefix_brings_the_symbol_before(name) -> None:
    short = {"ofdm": {"cyclic_prefix": 0.2e-6, "idle_time": 0.0}, "golay": {"prefix_chips": 60}}[name]
    radar = radar_of(WAVEFORMS[name].with_(num_chirps=4, **short))
    for distance in (100.0, 200.0):
        point, velocity = on_a_ray(distance, 30.0)
        paths = point_targets([point], [velocity], 1.0, radar, Pose())
        with pytest.warns(ScarlWarning, match="longer than the prefix"):
            found = synthesize(paths, radar)[0]
        wanted = np.sqrt(power_of(paths, radar)) * exact(radar, point, velocity)
        assert np.abs(found - wanted).max() < 2e-5 * np.abs(wanted).max()
        if name == "ofdm":  # nothing came before the frame
            assert not found[0, : int(40.0 / SPEED_OF_LIGHT * radar.sample_rate)].any()


def test_a_code_sent_all_the_time_wraps_around() -> None:
    radar = radar_of(ss.Pmcw(code_length=63, chip_rate=300e6, num_chirps=8, repetitions=30))
    point, velocity = on_a_ray(100.0, 0.0)  # 31.5 m are unambiguous
    paths = point_targets([point], [velocity], 1.0, radar, Pose())
    rd = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar, "rect", num_range_bins=63 * 16)
    assert rd.range[rd.power[4].argmax()] == pytest.approx(100.0 - 3 * radar.max_range, abs=0.04)
    with pytest.raises(ParameterRangeError, match="take turns"):
        synthesize(paths, radar.with_(multiplexing="tdm", tx_positions=((0.0, 0.0, 0.0), (0.0, 0.1, 0.0))))


@pytest.mark.some(3)
@pytest.mark.parametrize("name", ["ofdm", "comb", "m-sequence", "golay"])
@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
def test_many_moving_paths_are_the_direct_sum(name, multiplexing) -> None:
    """A radar that moves and turns, points that cross: the end points' own motion, by transforms."""
    if multiplexing == "tdm" and name == "m-sequence":
        pytest.skip("a code without a prefix cannot take turns")
    small = {"num_chirps": 16} | (
        {"num_subcarriers": 64} if "num_subcarriers" in WAVEFORMS[name].model_fields_set else {}
    )
    if name == "golay":
        small |= {"code_length": 64, "prefix_chips": 200 // 4, "repetitions": 1, "chip_rate": 75e6}
    if name == "m-sequence":
        small |= {"code_length": 63, "chip_rate": 75e6, "repetitions": 1}
    waveform = type(WAVEFORMS[name])(**{**WAVEFORMS[name].model_dump(exclude_unset=True), **small})
    ends = {"tx_positions": ((0.0, -0.0078, 0.0), (0.0, 0.0078, 0.0)), "rx_positions": ((0.0, -0.003, 0.0),)}
    radar, rng, count = radar_of(waveform).with_(multiplexing=multiplexing, **ends), np.random.default_rng(5), 40
    distance, azimuth = rng.uniform(3.0, 90.0, count), rng.uniform(-1.0, 1.0, count)
    points = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    mount = Mount(Pose(), Twist([10.0, 1.0, 0.0], [0.02, -0.03, 0.6]))
    paths = point_targets(points, rng.normal(0.0, 15.0, (count, 3)), 1e-3 * distance**4, radar, mount)
    for tolerance in (None, 1e-3):
        accuracy = Accuracy(motion_tolerance=tolerance)
        fast, plain = (synthesize(paths, radar, accuracy=accuracy, method=how) for how in ("nufft", "direct"))
        error = np.abs(fast - plain).max() / np.abs(plain).max()
        assert error < accuracy.synthesis_tolerance + (tolerance or 0.0)


def between(axis, power, index):
    low, here, high = np.log(power[index - 1 : index + 2].astype(float))
    return axis[index] + 0.5 * (low - high) / (low - 2.0 * here + high) * (axis[1] - axis[0])


@pytest.mark.some(5)
@pytest.mark.parametrize("window", ["hann", "rect"])
@pytest.mark.parametrize("name", [name for name in WAVEFORMS if name != "own code"])
def test_the_map_has_its_peak_at_the_point(name, window) -> None:
    """Range and velocity within 0.05 bins; power as received, less Doppler within a window, within 0.1 dB."""
    radar = radar_of(WAVEFORMS[name].with_(num_chirps=64))
    wave, step = radar.waveform, radar.range_resolution
    for distance, speed in ((20.3 * step, 0.0), (50.6 * step, 0.4 * radar.unambiguous_velocity), (90.2 * step, -60.0)):
        if abs(speed) > radar.unambiguous_velocity:
            speed = -0.7 * radar.unambiguous_velocity
        point, velocity = on_a_ray(distance, speed)
        paths = point_targets([point], [velocity], 1.0, radar, Pose())
        cube = virtual_cube(synthesize(paths, radar), radar)
        rd = range_doppler(cube, radar, window, num_range_bins=16 * radar.num_range_bins, num_doppler_bins=8 * 64)
        row, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
        assert between(rd.range, rd.power[row], column) == pytest.approx(distance, abs=0.05 * step)
        found = between(rd.radial_velocity, rd.power[:, column], row)
        assert found == pytest.approx(speed, abs=0.05 * radar.velocity_resolution)
        seconds = wave.num_samples * wave.repetitions / radar.sample_rate
        lost = 20.0 * np.log10(np.sinc(2.0 * speed / radar.wavelength * seconds))
        gain = 10.0 * np.log10(rd.power[row, column] / power_of(paths, radar))
        assert gain == pytest.approx(lost, abs=0.1)


@pytest.mark.some(1)
@pytest.mark.parametrize("name", ["ofdm", "m-sequence"])
def test_two_speeds_in_one_range_cell_and_an_angle(name) -> None:
    radar = ss.RadarSpec(waveform=WAVEFORMS[name].with_(num_chirps=64)).with_(pattern=IsotropicPattern())
    speeds, azimuth = np.array([-0.4, 0.25]) * radar.unambiguous_velocity, np.array([0.3, -0.2])
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(2)], axis=1)
    paths = point_targets(40.0 * rays, speeds[:, None] * rays, 1e3, radar, Pose())
    rda = range_doppler_angle(virtual_cube(synthesize(paths, radar, np.random.default_rng(0)), radar), radar)
    points = detect(rda, radar)
    strongest = np.argsort(-points.power)[:2]
    order = strongest[np.argsort(points.radial_velocity[strongest])]
    assert np.abs(points.radial_velocity[order] - speeds).max() < 0.05 * radar.velocity_resolution
    assert np.abs(points.range[order] - 40.0).max() < 0.05 * radar.range_resolution
    # a bin of the angle is 2 / 12 in the sine
    assert np.abs(np.sin(points.azimuth[order]) - np.sin(azimuth)).max() < 0.05 * 2.0 / 12


@pytest.mark.parametrize("window", ["hann", "rect"])
@pytest.mark.parametrize(
    "name", ["ofdm", "comb", "pilots", "m-sequence", "apas", "golay", "gold", "bursts", "overlap", "coded"]
)
def test_noise_in_a_cell_is_what_the_map_says(name, window) -> None:
    """The processing gain: mean of 64 x N cells of noise alone, five standard errors."""
    ramps = {"bandwidth": 150e6, "num_samples": 64, "num_steps": 4}
    others = {"bursts": ss.SteppedFmcw(**ramps), "overlap": ss.SteppedFmcw(**ramps, frequency_step=100e6)}
    others["coded"] = ss.PcFmcw(num_samples=256)
    radar = radar_of((WAVEFORMS | others)[name].with_(num_chirps=64))
    nothing = point_targets([[30.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 0.0, radar, Pose())
    rng = np.random.default_rng(1)
    maps = [range_doppler(virtual_cube(synthesize(nothing, radar, rng), radar), radar, window) for _ in range(4)]
    cells = np.concatenate([rd.power.ravel() for rd in maps])
    alike = (
        1.0 if window == "rect" else 3.7
    )  # neighbouring cells of a Hann window share their noise, in both directions
    assert cells.mean() / maps[0].noise_power == pytest.approx(1.0, abs=5.0 * np.sqrt(alike / len(cells)))


@pytest.mark.parametrize(
    ("name", "level"),
    [("m-sequence", 20 * np.log10(1 / 511)), ("gold", 20 * np.log10(33 / 511)), ("golay", -100), ("zadoff-chu", -100)],
)
def test_range_sidelobes_of_a_code_are_those_of_its_autocorrelation(name, level) -> None:
    radar = radar_of(WAVEFORMS[name])
    point = [32 * radar.range_resolution, 0.0, 0.0]
    paths = point_targets([point], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    power = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar, "rect").power[8]
    beside = np.delete(power, power.argmax())
    found = 10.0 * np.log10(beside.max() / power.max())
    assert found == pytest.approx(level, abs=0.2) if level > -99 else found < -75.0


def test_an_almost_perfect_code_has_one_sidelobe_at_half_its_length() -> None:
    radar = radar_of(WAVEFORMS["apas"])
    paths = point_targets([[32 * radar.range_resolution, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, radar, Pose())
    power = range_doppler(virtual_cube(synthesize(paths, radar), radar), radar, "rect").power[8]
    quiet = np.delete(power, [32, 32 + 228])
    assert 10 * np.log10(power[32 + 228] / power[32]) == pytest.approx(20 * np.log10(452 / 456), abs=0.02)
    assert 10 * np.log10(quiet.max() / power[32]) < -75.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ss.Ofdm(comb=2, comb_offset=2), "comb_offset < comb"),
        (lambda: ss.Ofdm(num_subcarriers=100, comb=3), "multiple of comb"),
        (lambda: ss.Ofdm(data_phases_deg=((0.0,),)), "of 512 phases"),
        (lambda: ss.Pmcw(code_length=500), "2\\*\\*n - 1"),
        (lambda: ss.Pmcw(code="apas", code_length=18), "odd prime"),
        (lambda: ss.Pmcw(code="gold", code_length=255), "not a multiple of 4"),
        (lambda: ss.Pmcw(code="golay", code_length=256), "prefix_chips"),
        (lambda: ss.Pmcw(code="zadoff_chu", code_length=512, code_index=2), "coprime"),
        (lambda: ss.Pmcw(code="own"), "code_phases_deg"),
        (lambda: ss.Pmcw(chip_rate=3e9), "less than or equal to 2000000000"),
    ],
)
def test_what_no_symbol_can_be_is_refused(make, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        make()
