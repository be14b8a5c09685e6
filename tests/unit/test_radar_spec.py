"""RadarSpec: Table 1 of SCaRL, derived quantities, antenna patterns, refused values."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, SpecError, UnknownNameError
from scarl_sionna.core.specs.radar.pattern import CosinePattern, IsotropicPattern, TablePattern, Tr38901Pattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT as C


def test_table_1_of_scarl() -> None:
    radar = RadarSpec.preset("awr1843boost")
    ramp = radar.waveform
    assert (ramp.start_frequency, ramp.bandwidth, ramp.ramp_time, ramp.idle_time) == (77e9, 300e6, 30e-6, 8e-6)
    assert (radar.num_chirps, radar.num_samples) == (256, 512)
    assert (radar.num_tx, radar.num_rx, radar.num_virtual, radar.multiplexing.kind) == (3, 4, 12, "ideal")
    # azimuth resolution: lambda / (N d) = 2 / 12 rad
    virtual = np.sort((radar.tx_array[:, None, 1] + radar.rx_array[None, :, 1]).ravel())
    np.testing.assert_allclose(np.diff(virtual), radar.wavelength / 2, rtol=1e-12)
    assert np.degrees(radar.wavelength / (12 * np.diff(virtual)[0])) == pytest.approx(9.549, abs=5e-4)
    for side in (-45, 45):
        loss = radar.array.pattern.gain_db(np.radians(side), 0.0) - radar.array.pattern.gain_db(0.0, 0.0)
        assert loss == pytest.approx(10 * np.log10(0.5))


def test_derived_quantities() -> None:
    radar = RadarSpec()
    assert radar.range_resolution == pytest.approx(C / (2 * 300e6))
    assert radar.max_range == pytest.approx(512 * C / (2 * 300e6))
    assert radar.chirp_interval == pytest.approx(38e-6)
    assert radar.unambiguous_velocity == pytest.approx(C / radar.center_frequency / (4 * 38e-6))
    assert radar.with_(multiplexing="tdm").unambiguous_velocity == pytest.approx(radar.unambiguous_velocity / 3)
    half_sampled = radar.with_(sampling_frequency=512 / 15e-6)
    assert half_sampled.range_resolution == pytest.approx(C / (2 * 150e6))


def test_board_layout_reaches_elevation() -> None:
    board = RadarSpec.preset("awr1843boost_3d")
    virtual = board.tx_array[:, None] + board.rx_array[None]
    assert board.multiplexing.kind == "tdm" and np.ptp(virtual[..., 2]) == pytest.approx(board.wavelength / 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bandwidth": -1.0}, "RadarSpec.waveform.bandwidth = -1.0"),
        ({"num_samples": 0}, "num_samples"),
        ({"noise_figure_db": -1.0}, "noise_figure_db"),
        ({"tx_positions": ()}, "tx_positions"),
        ({"tx_positions": ((0.0, 5.0, 0.0),)}, r"tx_positions\[0\] = \(0.0, 5.0, 0.0\) m within 1.0 m"),
        ({"sampling_frequency": 1e6}, "512 us, the ramp 30 us"),
        ({"multiplexing": "pdm"}, "'ideal' or 'tdm'"),
        ({"carrier": 77e9}, "carrier"),
        ({"pattern": {"kind": "yagi"}}, "pattern"),
    ],
)
def test_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        RadarSpec().with_(**change)


def test_unknown_preset() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'awr1843boost'"):
        RadarSpec.preset("awr1843")


def test_spec_survives_json() -> None:
    radar = RadarSpec.preset("awr1843boost_3d").with_(pattern=Tr38901Pattern())
    again = RadarSpec(**RadarSpec.model_validate_json(radar.model_dump_json()).model_dump())
    assert again == radar


def test_patterns() -> None:
    assert IsotropicPattern(gain_dbi=3.0).gain_db(np.zeros((2, 3)), 0.0).tolist() == [[3.0] * 3] * 2
    cosine = CosinePattern(peak_gain_dbi=10.0, half_power_azimuth_deg=45.0, half_power_elevation_deg=15.0)
    assert cosine.gain_db(0.0, 0.0) == pytest.approx(10.0)
    assert cosine.gain_db(0.0, np.radians(15)) == pytest.approx(10 + 10 * np.log10(0.5))
    assert cosine.gain_db(np.pi, 0.0) < -300  # nothing behind
    element = Tr38901Pattern()
    # 3GPP TR 38.901 Table 7.3-1: -3 dB at 32.5 deg, 8 dBi peak, floor 30 dB below
    assert element.gain_db(np.radians(32.5), 0.0) == pytest.approx(5.0)
    assert element.gain_db(np.pi, 0.0) == pytest.approx(-22.0)
    table = TablePattern(
        azimuth_deg=(-90, 0, 90),
        azimuth_gain_dbi=(-10, 9, -10),
        elevation_deg=(-30, 0, 30),
        elevation_gain_dbi=(0, 9, 0),
    )
    assert table.gain_db(np.radians(45), np.radians(15)) == pytest.approx(-0.5 + 4.5 - 9)
    assert table.gain_db(np.radians(120), 0.0) == pytest.approx(-10)
    with pytest.raises(ParameterRangeError, match="rising"):
        TablePattern(azimuth_deg=(0, 0), azimuth_gain_dbi=(1, 1), elevation_deg=(0, 1), elevation_gain_dbi=(1, 1))


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(45.0, 15.0), (10.0, 10.0), (60.0, 30.0), (80.0, 5.0)])
def test_the_radiated_share_of_a_cosine_pattern_is_its_integral(azimuth_deg: float, elevation_deg: float) -> None:
    pattern = CosinePattern(
        peak_gain_dbi=3.0, half_power_azimuth_deg=azimuth_deg, half_power_elevation_deg=elevation_deg
    )
    step = np.pi / 2000
    angle = (np.arange(2000) + 0.5) * step - np.pi / 2.0
    gain = 10.0 ** (pattern.gain_db(angle[:, None], angle[None, :]) / 10.0)
    integral = (gain * np.cos(angle)).sum() * step**2 / (4.0 * np.pi)  # midpoints; nothing is radiated behind
    assert pattern.radiated_share == pytest.approx(integral, rel=1e-4)


def test_an_antenna_that_radiates_more_than_its_power_is_refused() -> None:
    with pytest.raises(SpecError, match=r"at most 7\.\d dBi.*10 dBi the antenna would radiate 1\d\d % of its power"):
        CosinePattern(half_power_elevation_deg=45.0)
    assert CosinePattern().radiated_share < 1.0
