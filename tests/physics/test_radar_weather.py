"""Weather at 77 GHz against values of the recommendations and Rayleigh's law."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.atmosphere import Atmosphere
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather, saturation_density
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.radar.weather.attenuation import (
    attenuate_paths,
    fog_attenuation,
    gas_attenuation,
    liquid_water,
    rain_attenuation,
    specific_attenuation,
    weather_attenuation,
)
from scarl_sionna.radar.weather.hydrometeors import rain
from scarl_sionna.radar.weather.mean_clutter import falling
from scarl_sionna.scene.materials.dielectrics import water_permittivity
from scarl_sionna.signal.processing import range_doppler, virtual_cube

FREQUENCY = 77e9
# computed with another implementation (itur): P.838-3, horizontal path; P.676 line by line, 15 degrees C, 1013 hPa, 7.5
# g/m3
GAS = 0.3480435
RAIN = {("H", 5.0): 3.5931193, ("H", 25.0): 11.405363, ("V", 5.0): 3.5199798, ("V", 25.0): 10.987983}
TWO_WAY_25MMH_200M = 4.5621452
FOG_COEFFICIENT = {265.15: 3.69417, 273.15: 3.53735, 283.15: 3.14726, 293.15: 2.71299}
"""K_l of P.840-8 at 77 GHz [(dB/km)/(g/m3)], by the same, at temperatures in kelvin."""


def test_gases() -> None:
    assert gas_attenuation(FREQUENCY) == pytest.approx(GAS, rel=1e-3)  # the bar is 2 %


AIR = {
    (77e9, 303.15, 27.43): 1.180656,
    (79e9, 313.15, 46.2): 2.228322,
    (81e9, 263.15, 1.42): 0.150133,
    (76e9, 283.15, 0.0): 0.114644,
}
"""Gases [dB/km] at other temperatures [K] and vapour densities [g/m3], 1013 hPa, by the same implementation."""
SATURATED = {0.0: 4.868165, 10.0: 9.434833, 30.0: 30.481871, 40.0: 51.337210}
"""Density of saturated vapour [g/m3] from the pressures of P.453 by the same implementation."""


@pytest.mark.parametrize("air", AIR)
def test_gases_follow_temperature_and_humidity(air) -> None:
    assert gas_attenuation(*air) == pytest.approx(AIR[air], rel=1e-5)


@pytest.mark.parametrize("celsius", SATURATED)
def test_vapour_of_saturated_air(celsius) -> None:
    assert saturation_density(celsius) == pytest.approx(SATURATED[celsius], rel=1e-4)


def test_hot_and_humid_air_takes_six_times_as_much() -> None:
    """And so a weather does: 0.8 dB more at 200 m, there and back, than in the air of P.676's table."""
    tropical = Weather(temperature_celsius=40.0, humidity=0.9, gases=True)
    found = weather_attenuation(tropical, FREQUENCY, "V")
    assert found == gas_attenuation(FREQUENCY, 313.15, tropical.vapour_density)
    assert found > 6.0 * GAS
    assert weather_attenuation(tropical.with_(gases=False), FREQUENCY, "V") == 0.0


@pytest.mark.parametrize("rate", [0.5, 5.0, 25.0, 100.0])
def test_one_distribution_of_drops_takes_and_sends_back(rate) -> None:
    """The default attenuates as P.838 says; each other one by the extinction of the drops that make its echo."""
    drops = rain(rate, FREQUENCY, 283.15, "p838")
    means = 0.5 * (rain_attenuation(rate, FREQUENCY, "V") + rain_attenuation(rate, FREQUENCY, "H"))
    assert drops.attenuation_db_per_km == pytest.approx(means, rel=1e-9)
    for sizes in ("p838", "marshall_palmer", "thunderstorm"):
        weather = Weather(rain_rate=rate, drop_sizes=sizes)
        v, h = (weather_attenuation(weather, FREQUENCY, name) for name in ("V", "H"))
        (own,) = falling(weather, FREQUENCY)
        assert 0.5 * (v + h) == pytest.approx(own.attenuation_db_per_km, rel=1e-9)
        exact = rain_attenuation(rate, FREQUENCY, "H") / rain_attenuation(rate, FREQUENCY, "V")
        assert h / v == pytest.approx(exact, rel=1e-9)
    palmer = rain(rate, FREQUENCY, 283.15, "marshall_palmer")
    assert drops.reflectivity / palmer.reflectivity == pytest.approx(drops.extinction / palmer.extinction, rel=1e-9)


@pytest.mark.parametrize(("polarization", "rate"), RAIN)
def test_rain(polarization, rate) -> None:
    assert rain_attenuation(rate, FREQUENCY, polarization) == pytest.approx(RAIN[polarization, rate], rel=1e-6)


@pytest.mark.parametrize("temperature", FOG_COEFFICIENT)
def test_fog(temperature) -> None:
    assert fog_attenuation(1.0, FREQUENCY, temperature) == pytest.approx(FOG_COEFFICIENT[temperature], rel=2e-3)


def test_fog_is_rayleighs_absorption() -> None:
    """Power lost in small spheres of a volume fraction v.

    6 pi / wavelength v Im((eps - 1) / (eps + 2)), water 1e6 g/m3.
    """
    for frequency in (10e9, 24e9, 77e9, 150e9):
        eps = water_permittivity(frequency, 283.15)
        absorbed = 6.0 * np.pi * frequency / SPEED_OF_LIGHT * 1e-6 * -((eps - 1.0) / (eps + 2.0)).imag
        assert fog_attenuation(1.0, frequency) == pytest.approx(1e3 * 10.0 / np.log(10.0) * absorbed, rel=2e-3)


def test_water_of_fog_is_the_recommendations_within_a_third() -> None:
    for visibility, water in ((300.0, 0.05), (50.0, 0.5)):  # P.840, Annex 1, note on medium and thick fog
        assert liquid_water(visibility) == pytest.approx(water, rel=1 / 3)


def test_rain_lowers_a_target_by_the_two_way_loss() -> None:
    radar = RadarSpec().with_(
        num_chirps=8, num_samples=512, pattern=IsotropicPattern(), polarization="H", start_frequency=76.85e9
    )
    paths = point_targets([[200.0, 0.0, 0.0]], np.zeros((1, 3)), 1.0, radar, Pose())
    wet = attenuate_paths(paths, radar, Atmosphere(rain_rate=25.0), gases=False)
    power = [range_doppler(virtual_cube(synthesize(p, radar), radar), radar).power.max() for p in (paths, wet)]
    assert radar.center_frequency == pytest.approx(FREQUENCY, rel=1e-4)
    assert 10.0 * np.log10(power[0] / power[1]) == pytest.approx(TWO_WAY_25MMH_200M, rel=1e-3)  # the bar is 2 %
    np.testing.assert_array_equal(wet.tx_point, paths.tx_point)
    assert wet.diagnostics["attenuation_db_per_km"]["H"] == pytest.approx(RAIN["H", 25.0], rel=1e-3)


def test_each_path_loses_by_its_own_length_and_polarisation() -> None:
    radar = RadarSpec()
    paths = point_targets([[50.0, 0.0, 0.0], [0.0, 120.0, 0.0]], np.zeros((2, 3)), 1.0, radar, Pose())
    paths.a[:] = 1.0 + 1.0j
    air = Atmosphere(rain_rate=10.0, visibility=80.0)
    found = attenuate_paths(paths, radar, air)
    assert (paths.a == 1.0 + 1.0j).all()
    gamma = {name: specific_attenuation(air, radar.center_frequency, name) for name in "VH"}
    for row, distance in enumerate((50.0, 120.0)):
        for i, received in enumerate("VH"):
            for j, sent in enumerate("VH"):
                loss = 1e-3 * distance * (gamma[received] + gamma[sent])  # one way each
                assert abs(found.a[row, i, j] / paths.a[row, i, j]) == pytest.approx(10.0 ** (-loss / 20.0), rel=1e-12)
    assert np.ptp(np.angle(found.a)) < 1e-12


def test_clear_air_has_gases_only_and_nothing_without_them() -> None:
    assert specific_attenuation(Atmosphere(), FREQUENCY, "V") == gas_attenuation(FREQUENCY)
    radar = RadarSpec()
    paths = point_targets([[50.0, 0.0, 0.0]], np.zeros((1, 3)), 1.0, radar, Pose())
    np.testing.assert_array_equal(attenuate_paths(paths, radar, Atmosphere(), gases=False).a, paths.a)


@pytest.mark.parametrize(
    "call",
    [
        lambda: gas_attenuation(24e9),
        lambda: gas_attenuation(FREQUENCY, 15.0),
        lambda: gas_attenuation(FREQUENCY, 288.15, -1.0),
        lambda: rain_attenuation(-1.0, FREQUENCY, "V"),
        lambda: rain_attenuation(5.0, FREQUENCY, "X"),
        lambda: rain_attenuation(5.0, 77.0, "V"),
        lambda: fog_attenuation(-0.1, FREQUENCY),
        lambda: fog_attenuation(0.1, FREQUENCY, 10.0),
        lambda: fog_attenuation(0.1, 400e9),
        lambda: liquid_water(0.0),
    ],
)
def test_what_the_models_do_not_cover_is_an_error(call) -> None:
    with pytest.raises(ParameterRangeError):
        call()
