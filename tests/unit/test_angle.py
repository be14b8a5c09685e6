"""Power over angle against the sum over the array written out: uniform lines by FFT, other arrays by steering."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.signal.angle import RangeDopplerAngle, has_elevation, range_doppler_angle
from scarl_sionna.signal.antenna import virtual_positions
from scarl_sionna.signal.windows import window_values

LINE = RadarSpec().with_(num_chirps=4, num_samples=8)
BOARD = RadarSpec.preset("awr1843boost_3d").with_(num_chirps=4, num_samples=8)


def random_cube(radar: RadarSpec) -> np.ndarray:
    rng = np.random.default_rng(3)
    shape = (radar.num_virtual, radar.num_chirps, radar.num_samples)
    return (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)


def written_out(rda: RangeDopplerAngle, weights: np.ndarray) -> np.ndarray:
    """Return the power of every cell towards every direction: the weighted sum of the channels, turned into phase."""
    radar = rda.radar
    elevation = np.zeros(1) if rda.elevation is None else rda.elevation
    azimuth, elevation = np.meshgrid(rda.azimuth, elevation, indexing="ij")
    across = np.cos(elevation) * np.sin(azimuth)
    unit = np.stack([np.cos(elevation) * np.cos(azimuth), across, np.sin(elevation)])
    ahead = np.tensordot(virtual_positions(radar), unit, axes=1)  # [m], shape (num_virtual, num_azimuth, num_elevation)
    turn = np.exp(2j * np.pi * radar.center_frequency / SPEED_OF_LIGHT * ahead) * weights[:, None, None]
    power = np.abs(np.tensordot(rda.range_doppler.data.astype(np.complex128), turn, axes=(0, 0))) ** 2
    return power[..., 0] if rda.elevation is None else power


@pytest.mark.parametrize("window", ["rect", "hann", "taylor"])
@pytest.mark.parametrize("num_azimuth", [None, 12, 37])
def test_a_line_by_transform_is_the_sum_over_its_elements(window: str, num_azimuth: int | None) -> None:
    rda = range_doppler_angle(random_cube(LINE), LINE, angle_window=window, num_azimuth=num_azimuth)
    weights = np.empty(LINE.num_virtual)
    weights[np.argsort(virtual_positions(LINE)[:, 1])] = window_values(window, LINE.num_virtual)
    expected = written_out(rda, weights)
    np.testing.assert_allclose(rda.data, expected, rtol=1e-4, atol=1e-5 * expected.max())
    assert rda.noise_power / rda.range_doppler.noise_power == pytest.approx(np.sum(weights**2))


@pytest.mark.parametrize("radar", [BOARD, LINE], ids=["board", "a line with fewer directions than elements"])
def test_any_array_by_steering_is_the_sum_over_its_elements(radar: RadarSpec) -> None:
    rda = range_doppler_angle(random_cube(radar), radar, angle_window="hann", num_azimuth=9, num_elevation=5)
    assert (rda.elevation is not None) == has_elevation(radar) == (radar is BOARD)
    expected = written_out(rda, np.full(radar.num_virtual, 1.0 / radar.num_virtual))
    np.testing.assert_allclose(rda.data, expected, rtol=1e-4, atol=1e-5 * expected.max())
    assert rda.noise_power / rda.range_doppler.noise_power == pytest.approx(1.0 / radar.num_virtual)


@pytest.mark.parametrize(("elements", "directions"), [(2, 16), (4, 16), (5, 32), (8, 32), (9, 64), (16, 64), (17, 128)])
def test_directions_are_uniform_in_their_sine_and_at_least_four_a_beamwidth(elements: int, directions: int) -> None:
    """Elements half a wavelength apart have one beam each over the sine from -1 to 1, and four beams at least."""
    spacing = 0.499 * LINE.wavelength  # so that 8 elements are no more than 8 beams in floating point
    place = tuple((0.0, spacing * number, 0.0) for number in range(elements))
    radar = LINE.with_(tx_positions=(place[0],), rx_positions=place)
    sine = np.sin(range_doppler_angle(random_cube(radar), radar).azimuth)
    np.testing.assert_allclose(
        np.diff(sine), SPEED_OF_LIGHT / radar.center_frequency / (directions * spacing), rtol=1e-9
    )
    assert np.abs(sine).min() < 1e-12 and np.abs(sine).max() <= 1.0 and abs(len(sine) - directions) <= 1
    bent = radar.with_(rx_positions=(*place[:-1], (1e-3, *place[-1][1:])))
    sine = np.sin(range_doppler_angle(random_cube(bent), bent).azimuth)
    np.testing.assert_allclose(sine, (2.0 * np.arange(directions) + 1.0) / directions - 1.0)


@pytest.mark.parametrize(("view_deg", "last_deg"), [(20.0, 20.0), (60.0, 60.0), (89.5, 89.0), (160.0, 89.0)])
def test_elevations_cover_twice_the_view_and_stop_short_of_the_zenith(view_deg: float, last_deg: float) -> None:
    radar = BOARD.with_(elevation_fov_deg=view_deg)
    elevation = range_doppler_angle(random_cube(radar), radar, num_azimuth=4, num_elevation=7).elevation
    assert elevation is not None and elevation[3] == pytest.approx(0.0, abs=1e-12)
    assert np.degrees(elevation[[0, -1]]) == pytest.approx([-last_deg, last_deg])
    np.testing.assert_allclose(np.diff(np.sin(elevation)), np.sin(np.radians(last_deg)) / 3.0)


@pytest.mark.parametrize("view_deg", [10.0, 30.0, 100.0])
@pytest.mark.parametrize("elements", [2, 8, 33])
def test_elevations_are_at_least_four_a_beamwidth(elements: int, view_deg: float) -> None:
    """Elements half a wavelength apart: their beam is 2 / elements wide in the sine."""
    spacing = 0.5 * LINE.wavelength
    place = tuple((0.0, 0.0, spacing * number) for number in range(elements))
    radar = LINE.with_(tx_positions=(place[0],), rx_positions=place, elevation_fov_deg=view_deg)
    elevation = range_doppler_angle(random_cube(radar), radar).elevation
    assert elevation is not None and len(elevation) % 2
    assert np.degrees(elevation[-1]) == pytest.approx(min(view_deg, 89.0))
    a_beamwidth = 2.0 / elements / np.diff(np.sin(elevation)).max()
    assert a_beamwidth > 4.0 - 1e-9 and (len(elevation) == 11 or a_beamwidth < 4.0 * 1.15)


def test_elevations_end_where_the_map_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """The default of a map is bounded; few directions a beamwidth are told."""
    place = tuple((0.0, 0.0, 0.5 * LINE.wavelength * number) for number in range(33))
    radar = LINE.with_(tx_positions=(place[0],), rx_positions=place)
    cube = random_cube(radar)
    one = range_doppler_angle(cube, radar).data[..., 0].nbytes
    monkeypatch.setattr("scarl_sionna.signal.angle.LARGEST_MAP", 40 * one)
    assert range_doppler_angle(cube, radar).data.shape[3] == 39
    monkeypatch.setattr("scarl_sionna.signal.angle.LARGEST_MAP", 20 * one)
    with pytest.warns(ScarlWarning, match="19 elevations, 1.1 a beamwidth"):
        assert range_doppler_angle(cube, radar).data.shape[3] == 19
    assert range_doppler_angle(cube, radar, num_elevation=67).data.shape[3] == 67


def test_too_few_directions_are_refused() -> None:
    cube = random_cube(BOARD)
    assert range_doppler_angle(cube, BOARD, num_azimuth=2, num_elevation=3).data.shape[2:] == (2, 3)
    with pytest.raises(ParameterRangeError, match="num_azimuth"):
        range_doppler_angle(cube, BOARD, num_azimuth=1)
    with pytest.raises(ParameterRangeError, match="num_elevation"):
        range_doppler_angle(cube, BOARD, num_elevation=2)
