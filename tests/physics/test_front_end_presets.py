"""Presets of real devices: the shapes that were measured on an AWR1642, and the cascade's layout."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.signal.angle import uniform_line
from scarl_sionna.signal.converter import decimation


@pytest.fixture(scope="module")
def capture() -> tuple[ss.RadarSpec, np.ndarray]:
    """256 chirps of one transmitter, a reflector of 2.5 m2 2 m away, as converted."""
    radar = ss.RadarSpec.preset("awr1642").with_(num_chirps=256, tx_positions=((0.0, 0.0, 0.0),))
    paths = ss.point_targets([[2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 2.5, radar, Pose())
    rng = np.random.default_rng(11)
    codes, scale, saturated = ss.quantize(ss.synthesize(paths, radar, rng), radar, rng)
    assert saturated == 0
    return radar, scale * (codes[..., 0] + 1j * codes[..., 1])


def profile(adc: np.ndarray) -> np.ndarray:
    """Range spectra under a Hann window, shape (num_rx, num_chirps, num_samples)."""
    window = np.hanning(adc.shape[-1])
    return np.fft.fft(adc * window / window.sum(), axis=-1)


def test_shape_of_the_noise_floor(capture) -> None:
    """Three captures, medians: bin 20 is 7.5 dB over bin 0 and 2.1 over bin 120, bin 60 is 1.3 over bin 200.

    Bin 200 is 7.1 dB over the notch at bin 240. Four sigma of 256 chirps of 4 channels, three bins each, are 0.4 dB.
    """
    spectra = profile(capture[1])
    moving = spectra - spectra.mean(axis=1, keepdims=True)
    floor = 10 * np.log10((np.abs(moving) ** 2).mean(axis=(0, 1)))
    floor = np.convolve(np.pad(floor, 1, "wrap"), np.ones(3) / 3, "valid")
    assert floor[20] - floor[0] == pytest.approx(7.5, abs=0.4)
    assert floor[20] - floor[120] == pytest.approx(2.1, abs=0.4)
    assert floor[60] - floor[200] == pytest.approx(1.3, abs=0.4)
    assert floor[200] - floor[240] == pytest.approx(7.1, abs=0.4)


def test_leakage_and_constant_in_the_first_bins(capture) -> None:
    """Measured: 15 to 16 dB under the target, in bins 0 to 3."""
    power = (np.abs(profile(capture[1]).mean(axis=1)) ** 2).mean(axis=0)
    target = round(2.0 / capture[0].range_resolution)
    assert power[5:].argmax() + 5 == target
    assert 10 * np.log10(power[:4].max() / power[target]) == pytest.approx(-15.5, abs=1.5)


def test_levels_of_the_channels_and_image(capture) -> None:
    """Measured: 0.8 to 2.7 dB peak to peak; image at most -40 to -54 dB."""
    spectra = np.abs(profile(capture[1]).mean(axis=1)) ** 2
    target = round(2.0 / capture[0].range_resolution)
    levels = 10 * np.log10(spectra[:, target])
    assert 0.8 < np.ptp(levels) < 2.7
    assert 10 * np.log10(spectra[:, -target].mean() / spectra[:, target].mean()) < -40.0
    assert 10 * np.log10(spectra[:, target + 6 : -4].max() / spectra[:, target].mean()) < -40.0  # nor anything else


def test_no_phase_noise_skirt_at_two_metres(capture) -> None:
    """Measured: the phase from chirp to chirp is that of the noise alone, 1.9 to 3.1 mrad against 2.0 to 3.2."""
    radar, adc = capture
    target = round(2.0 / radar.range_resolution)
    beat = target * radar.sample_rate / radar.num_samples
    passed = 1.0 / (  # of the thermal noise, by the filters
        (1.0 + (175e3 / beat) ** 2) * (1.0 + (350e3 / beat) ** 2) * (1.0 + (beat / 9.4e6) ** 2)
    )
    thermal = 1e-3 * 10.0 ** ((-173.98 + 15.0) / 10.0) * radar.sample_rate
    converter = 1e-3 * 10.0 ** ((-23.1 - 6.02 * 11.4 - 1.76) / 10.0)
    left = decimation(radar, target / radar.num_samples) ** 2
    noise = (thermal * passed + converter) * left * 1.5 / radar.num_samples  # 1.5 bins wide: the window
    for channel in profile(adc)[:, :, target]:
        predicted = np.sqrt(0.5 * noise) / np.abs(channel.mean())
        assert np.angle(channel / channel.mean()).std() == pytest.approx(predicted, rel=0.12)
        assert 1.5e-3 < predicted < 4e-3  # the measured levels


def test_noise_in_steps_of_the_converter() -> None:
    """Measured: 18.5 LSB rms, at a full scale of about -24 dBm and a noise figure of 15 dB."""
    radar = ss.RadarSpec.preset("awr1642").with_(leakage=(), dc_offset_dbm=None)
    none = ss.point_targets([[2.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]], 1e-20, radar, Pose())
    rng = np.random.default_rng(1)
    codes, _, _ = ss.quantize(ss.synthesize(none, radar, rng), radar, rng)
    assert np.sqrt((codes.astype(float) ** 2).sum(axis=-1).mean()) == pytest.approx(18.5, rel=0.15)


def test_layout_of_the_cascade() -> None:
    """TI, SWRU553: 192 channels, 86 places half a wavelength apart in azimuth, elevations of 0, 1, 4 and 6."""
    radar = ss.RadarSpec.preset("awr2243_cascade")
    assert (radar.num_tx, radar.num_rx, radar.num_virtual) == (12, 16, 192)
    half = 299792458.0 / 76.8e9 / 2.0
    tx, rx = radar.tx_array / half, radar.rx_array / half
    flat = tx[np.isclose(tx[:, 2], 0.0)]
    places = np.unique(np.rint(flat[:, None, 1] + rx[None, :, 1] + 42.5))
    assert len(places) == 86 and (np.diff(places) == 1).all()
    assert np.allclose(np.unique(np.rint(tx[:, 2])), [0, 1, 4, 6])
    assert uniform_line(radar) is None


def test_presets_are_made_and_read_again() -> None:
    for name in ("iwr1843boost", "awr1642", "awr2243_cascade", "radial_hd", "pmcw_79ghz"):
        radar = ss.RadarSpec.preset(name)
        assert radar.front_end.is_ideal == (name in ("radial_hd", "pmcw_79ghz"))  # nothing found says their front ends
        assert ss.RadarSpec(**radar.model_dump(mode="json")) == radar


def test_the_imaging_radar_is_that_of_the_radial_dataset() -> None:
    """Their tables and processing: 192 channels, 103 m in bins of 0.2 m, 0.1 m/s, 16 bands, four of them empty."""
    radar = ss.RadarSpec.preset("radial_hd")
    assert (radar.num_virtual, radar.num_chirps_total, radar.num_samples) == (192, 256, 512)
    assert radar.max_range == pytest.approx(103.0)
    assert radar.range_resolution == pytest.approx(0.2, abs=0.005)
    assert 2.0 * radar.unambiguous_velocity / 256 == pytest.approx(0.1, abs=0.005)
    assert radar.multiplexing.code_period(12) == 16
    assert radar.multiplexing.unused_codes(12).shape == (16, 4)


def test_the_chip_of_phase_codes_has_its_published_resolution_and_finds_a_target() -> None:
    """7.5 cm at 79 GHz with 2 x 2 antennas."""
    radar = ss.RadarSpec.preset("pmcw_79ghz").with_(num_chirps=32)
    assert radar.range_resolution == pytest.approx(0.075)
    assert (radar.num_tx, radar.num_rx) == (2, 2)
    assert radar.center_frequency == pytest.approx(79e9)
    place = [[12.0 * np.cos(0.3), 12.0 * np.sin(0.3), 0.0]]
    paths = ss.point_targets(place, [[3.0, 0.0, 0.0]], 10.0, radar, Pose())
    adc = ss.synthesize(paths, radar, rng=np.random.default_rng(0))
    points = ss.detect(ss.range_doppler_angle(ss.virtual_cube(adc, radar), radar))
    assert points.range[0] == pytest.approx(12.0, abs=0.02)
    assert points.azimuth[0] == pytest.approx(0.3, abs=0.02)
    assert points.radial_velocity[0] == pytest.approx(3.0 * np.cos(0.3), abs=0.1)
