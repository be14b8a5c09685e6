"""One converter a receiver: half the range bins, the image, 3 dB more noise, and beat frequencies that fold."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.dataset.formats.dca1000 import decode_real, encode_real
from scarl_sionna.radar.gradients import PathModel
from scarl_sionna.signal.noise import cell_noise_power

BOTH = ss.RadarSpec().with_(num_chirps=32, num_samples=128, bandwidth=150e6, pattern={"kind": "isotropic"})
REAL = BOTH.with_(sampling="real")


def paths_at(distance, velocity=0.0, rcs=100.0, radar=BOTH):
    return ss.point_targets([[distance, 0.0, 0.0]], [[velocity, 0.0, 0.0]], rcs, radar, Pose())


def maps(radar, paths, rng=None, **options):
    return ss.range_doppler(ss.virtual_cube(ss.synthesize(paths, radar, rng), radar), radar, **options)


@pytest.mark.parametrize("multiplexing", ["ideal", "tdm", "ddm"])
def test_samples_are_i_alone(multiplexing):
    """A cosine: I of what complex sampling gives, noise included, with or without codes."""
    paths = paths_at(20.0, 8.0)
    both, real = (
        ss.synthesize(paths, r.with_(multiplexing=multiplexing), np.random.default_rng(1)) for r in (BOTH, REAL)
    )
    assert np.array_equal(real.real, both.real) and not real.imag.any() and real.dtype == np.complex64
    codes = [ss.quantize(adc, r)[0] for adc, r in ((both, BOTH), (real, REAL))]
    assert np.array_equal(codes[0][..., 0], codes[1][..., 0]) and not codes[1][..., 1].any()


def test_half_as_many_bins_of_the_same_width():
    assert REAL.num_range_bins == 64 and REAL.max_range == pytest.approx(BOTH.max_range / 2.0)
    assert REAL.range_resolution == BOTH.range_resolution
    one = REAL.one_sided
    assert one.sample_rate == BOTH.sample_rate / 2 and one.max_range == REAL.max_range and one.one_sided is one
    assert "sampling" not in BOTH.adc.model_dump_json() and '"sampling":"real"' in REAL.adc.model_dump_json()
    rd = maps(REAL, paths_at(20.0))
    assert rd.data.shape[2] == 64 and np.array_equal(rd.range, maps(BOTH, paths_at(20.0)).range[:64])


@pytest.mark.parametrize(("distance", "velocity"), [(18.3, 0.0), (30.0, -12.0), (50.2, 20.0)])
@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_tone_has_its_place_and_power(distance, velocity, direction):
    """The map is that of complex sampling, up to the image's sidelobes: 5 bins off and more, Blackman-Harris -92 dB."""
    paths = paths_at(distance, velocity)
    full, half = (maps(r.with_(direction=direction), paths, window="blackmanharris") for r in (BOTH, REAL))
    near = np.abs(full.data[:, :, :64] - half.data).max() / np.abs(full.data).max()
    assert near < 10.0 ** (-80.0 / 20.0)


def test_the_noise_is_3_db_higher_and_that_of_the_map_is_stated():
    """Noise alone: power of cells, within 5 sigma; twice that of complex sampling, whatever the source temperature."""
    nothing = paths_at(20.0, rcs=0.0)
    for temperature in (290.0, 40.0):
        both, real = (r.with_(source_temperature=temperature) for r in (BOTH, REAL))
        rd = maps(real, nothing, np.random.default_rng(2), window="rect")
        assert rd.noise_power == pytest.approx(2.0 * cell_noise_power(both, "rect"), rel=1e-12)
        assert cell_noise_power(real, "rect") == pytest.approx(rd.noise_power, rel=1e-12)
        inner = rd.data[:, :, 1:]  # the first bin's own image is in it
        power = np.mean(np.abs(inner) ** 2) / rd.noise_power
        assert power == pytest.approx(1.0, abs=5.0 / np.sqrt(inner.size))


def test_a_frequency_below_zero_stands_at_its_image():
    """A near target that closes fast: its beat is below 0 Hz; real samples put it at the opposite frequency."""
    radar = REAL.with_(num_chirps=1, num_samples=4096, ramp_time=2e-3, bandwidth=5e6)
    paths = paths_at(1.0, -40.0)
    doppler = 2.0 * 40.0 * radar.carrier_frequency / SPEED_OF_LIGHT
    slope = radar.waveform.chirp_slope
    beat = slope * 2.0 * 1.0 / SPEED_OF_LIGHT - doppler
    assert beat < -15e3
    adc = ss.synthesize(paths, radar)[0, 0].real
    spectrum = np.abs(np.fft.rfft(adc * np.hanning(4096)))
    found = np.fft.rfftfreq(4096, 1.0 / radar.sample_rate)[spectrum.argmax()]
    assert found == pytest.approx(-beat, abs=1.2 * radar.sample_rate / 4096)


def test_what_a_stated_filter_lets_through_folds_at_half_of_the_rate():
    """A beat at 0.7 of the rate stands at 0.3, weakened by the Butterworth; without a stated filter it is left out."""
    distance = 0.7 * BOTH.max_range
    with pytest.warns(ScarlWarning, match="real samples"):
        assert not ss.synthesize(paths_at(distance), REAL).any()
    corner = 0.4 * REAL.sample_rate
    filtered = REAL.with_(filters=ss.IfFilter(low_pass=corner, low_pass_order=4))
    rd = maps(filtered, paths_at(distance, rcs=1e6), window="blackmanharris", compensate_motion=False)
    _, column = np.unravel_index(rd.power.argmax(), rd.power.shape)
    assert rd.range[column] == pytest.approx(0.3 * BOTH.max_range, abs=BOTH.range_resolution)
    loss = 1.0 / (1.0 + (0.7 * REAL.sample_rate / corner) ** 8)
    alone = paths_at(distance, rcs=1e6)
    expected = np.abs(maps(BOTH, alone, window="blackmanharris").data).max() ** 2 * loss
    assert 10.0 * np.log10(rd.power.max() / expected) == pytest.approx(0.0, abs=0.3)  # within one bin's scalloping


def test_points_and_labels_are_right():
    """Two points: range, velocity, direction, RCS and owner."""
    place = [[22.0, 5.0, 0.0], [40.0, -9.0, 0.0]]
    paths = ss.point_targets(place, [[6.0, 0.0, 0.0], [-11.0, 0.0, 0.0]], [3.0, 30.0], REAL, Pose())
    radar = REAL.with_(tx_power_dbm=30.0)
    adc = ss.synthesize(paths, radar, np.random.default_rng(3))
    rda = ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar)
    points = ss.detect(rda, radar)
    owners = ss.label_points(points, paths, radar)
    cells = ss.label_cells(rda.range_doppler, paths)
    for number, (x, y, _) in enumerate(place):
        row = int(np.argmin(np.abs(points.range - np.hypot(x, y))))
        assert points.range[row] == pytest.approx(np.hypot(x, y), abs=0.1 * radar.range_resolution)
        assert np.degrees(points.azimuth[row] - np.arctan2(y, x)) == pytest.approx(0.0, abs=0.2)
        assert 10.0 * np.log10(points.rcs[row] / (3.0, 30.0)[number]) == pytest.approx(0.0, abs=0.3)
        assert owners.instance[row] == number + 1
        doppler, distance = divmod(int(points.cell[row]), len(rda.range))
        assert cells.instance[doppler, distance] == number + 1
    assert cells.instance.shape == (32, 64)


def test_captures_hold_i_alone():
    adc = np.random.default_rng(4).integers(-2000, 2000, (4, 6, 8, 2)).astype(np.int16)
    adc[..., 1] = 0
    raw = encode_real(adc)
    assert raw.shape == (4 * 6 * 8,) and np.array_equal(raw[8:16], adc[1, 0, :, 0])  # receiver after receiver
    assert np.array_equal(decode_real(raw, 4, 6, 8), adc)
    with pytest.raises(ParameterRangeError, match="even number"):
        encode_real(adc[:, :, :7])
    with pytest.raises(ParameterRangeError, match="one frame of real samples"):
        decode_real(raw[:-1], 4, 6, 8)


def test_what_needs_a_q_says_so():
    with pytest.raises(ParameterRangeError, match=r"ramps \('fmcw'\)"):
        ss.RadarSpec(waveform=ss.Ofdm(), adc=ss.Adc(sampling="real"))
    with pytest.raises(ParameterRangeError, match="an even number where samples are real"):
        REAL.with_(num_samples=127)
    with pytest.raises(ParameterRangeError, match="real part of its raw data"):
        PathModel(REAL, paths_at(20.0))


def test_blocks_of_chirps_are_i_of_those_of_complex_sampling():
    one, other = (ss.synthesize_blocks(lambda t: paths_at(20.0), r, 8) for r in (BOTH, REAL))
    assert np.array_equal(other.real, one.real) and not other.imag.any()


def test_another_radar_crosses_twice_as_wide_a_band_at_half_the_power():
    """Without a Q beats of both signs are heard: as long a burst over two-sided bands of one rate, mean power 1/2."""
    sender = BOTH.with_(bandwidth=450e6, start_frequency=76.85e9)
    paths = ss.one_way_paths(sender, ss.Pose([40.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]), Pose())
    delay, rate = 40.0 / SPEED_OF_LIGHT, REAL.sample_rate
    slope, own = sender.waveform.chirp_slope, REAL.waveform.chirp_slope
    middle = (77e9 - 76.85e9 + slope * delay) / (slope - own)  # where the beat is 0 Hz
    power = np.abs(ss.synthesize_interference(paths, sender, REAL)[0]) ** 2
    level = np.abs(paths.a[0, 0, 0]) ** 2 * 1e-3 * 10 ** (sender.front_end.tx_power_dbm / 10)
    time, length = np.arange(128) / rate, rate / (slope - own)
    assert 4e-6 < middle < 26e-6
    assert power[1:].sum(axis=1).mean() / rate == pytest.approx(0.5 * level * length, rel=0.03)
    hit = power[3] > 0.05 * level
    assert np.mean(time[hit]) == pytest.approx(middle, abs=0.5 / rate)
    filtered = REAL.with_(filters=ss.IfFilter(low_pass=0.3 * rate, low_pass_order=2))
    both, real = (ss.synthesize_interference(paths, sender, r) for r in (filtered.with_(sampling="complex"), filtered))
    assert np.array_equal(real.real, both.real) and not real.imag.any() and real.any()


def test_images_of_a_network_are_those_of_complex_sampling():
    """Up to the sidelobes of the image below 0 Hz, twice the beat frequency away: Dirichlet's kernel there."""
    images = []
    for radar in (BOTH, REAL):
        network = ss.RadarNetwork(radar.with_(num_chirps=4), (Pose(), Pose([0.0, 0.5, 0.0])))
        points = np.array([[47.3, 1.0, 0.0]]), np.zeros((1, 3)), np.ones(1)
        frame = ss.synthesize_network(ss.network_paths(network, points=points), network)
        grid = np.stack([np.full(41, 47.3), np.linspace(-1.0, 3.0, 41), np.zeros(41)], axis=1)
        images.append(ss.back_project(frame, grid))
    assert np.abs(images[1] - images[0]).max() < np.abs(images[0]).max() / (128 * np.sin(np.pi * 2 * 47.3 / 128))
