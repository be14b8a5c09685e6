"""Lidar ratios of fog, rain and spray against the Mie series."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.lidar.spray import MEDIAN_VOLUME, backscatter_of, extinction_of
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.atmosphere import Atmosphere, fog_extinction, rain_extinction, snow_extinction
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.lidar_ratio import (
    FOG_LIDAR_RATIO,
    SNOW_LIDAR_RATIO,
    drops_lidar_ratio,
    rain_lidar_ratio,
    water_index,
)
from scarl_sionna.engine.spray import SprayCloud
from scarl_sionna.radar.weather.mie import mie_efficiencies
from tests.oracles.mie_drops import mie_drops

WAVELENGTH = 1550e-9


def mie_lidar_ratio(wavelength: float, scale_diameter: float, number: int) -> tuple[float, float]:
    """Return the ratio of drops whose sizes fall off as exp(-D / scale), and its relative standard deviation."""
    rng = np.random.default_rng(0)
    diameter = np.sort(np.maximum(rng.gamma(3.0, scale_diameter, number), 2e-6))  # by the drops' areas
    refraction, absorption = water_index(wavelength)
    extinction, back = mie_drops(refraction + 1j * absorption, np.pi * diameter / wavelength)
    return 4.0 * np.pi * extinction.sum() / back.sum(), float(back.std() / back.mean() / np.sqrt(number))


def test_the_two_mie_series_agree() -> None:
    size = np.array([0.3, 2.0, 17.3, 60.1, 150.0])
    extinction, back = mie_drops(1.318 + 1.34e-4j, size)
    expected = mie_efficiencies((1.318 - 1.34e-4j) ** 2, size)
    np.testing.assert_allclose(extinction, expected[0], rtol=1e-5)  # they stop at different orders
    np.testing.assert_allclose(back, expected[2], rtol=2e-3)


@pytest.mark.parametrize("wavelength", [1310e-9, 1550e-9])
@pytest.mark.parametrize("scale", [8.2e-5, 3.4e-4])  # spray of 0.3 mm; rain of 5 mm/h
def test_lidar_ratio_is_that_of_the_mie_series(wavelength: float, scale: float) -> None:
    expected, spread = mie_lidar_ratio(wavelength, scale, 500)
    assert abs(np.log(drops_lidar_ratio(wavelength, scale) / expected)) < np.log(1.3) + 3.0 * spread


@pytest.mark.slow
@pytest.mark.parametrize("wavelength", [1310e-9, 1535e-9, 1550e-9, 1600e-9])
def test_lidar_ratio_of_rain_and_spray_within_30_percent(wavelength: float) -> None:
    for scale in (4.1e-5, 8.2e-5, *(rate**0.21 / 4.1e3 for rate in (1.0, 5.0, 25.0, 100.0))):
        expected, _ = mie_lidar_ratio(wavelength, scale, 3000)
        assert abs(np.log(drops_lidar_ratio(wavelength, scale) / expected)) < np.log(1.32), (wavelength, scale)


def test_limits() -> None:
    refraction, _ = water_index(WAVELENGTH)
    front = ((refraction - 1.0) / (refraction + 1.0)) ** 2
    assert drops_lidar_ratio(WAVELENGTH, 0.0) == pytest.approx(FOG_LIDAR_RATIO)
    # all that enters an opaque sphere is lost: its front alone, a mirror with Fresnel's reflectance
    assert drops_lidar_ratio(WAVELENGTH, 1.0) == pytest.approx(8.0 * np.pi / front, rel=1e-3)
    assert rain_lidar_ratio(10.0, 905e-9) == pytest.approx(FOG_LIDAR_RATIO, rel=0.15)
    assert rain_lidar_ratio(100.0, WAVELENGTH) > rain_lidar_ratio(5.0, WAVELENGTH) > 300.0
    for call in (
        lambda: rain_lidar_ratio(-1.0, WAVELENGTH),
        lambda: drops_lidar_ratio(10e-6, 1e-3),
        lambda: drops_lidar_ratio(WAVELENGTH, -1.0),
    ):
        with pytest.raises(ParameterRangeError):
            call()


def test_each_kind_of_drop_has_its_own_ratio() -> None:
    air = Atmosphere(visibility=300.0, rain_rate=10.0, snow_rate=1.0)
    fog, rain, snow = fog_extinction(300.0, WAVELENGTH), rain_extinction(10.0), snow_extinction(1.0, WAVELENGTH)
    expected = fog / FOG_LIDAR_RATIO + rain / rain_lidar_ratio(10.0, WAVELENGTH) + snow / SNOW_LIDAR_RATIO
    assert air.weather_backscatter(WAVELENGTH) == pytest.approx(expected, rel=1e-12)
    one = air.with_(lidar_ratio=25.0)
    assert one.weather_backscatter(WAVELENGTH) == pytest.approx((fog + rain + snow) / 25.0, rel=1e-12)
    assert Atmosphere().weather_backscatter(WAVELENGTH) == 0.0


def test_spray_has_the_ratio_of_its_drops() -> None:
    cloud = SprayCloud("car", 1, Pose([0.0, 0.0, 0.0]), 5.0, 2.0, 2.0, 1.0, 3e-4, 20.0)
    spec = LidarSpec()
    ratio = drops_lidar_ratio(spec.wavelength, 3e-4 / MEDIAN_VOLUME)
    assert backscatter_of(cloud, spec) == pytest.approx(extinction_of(cloud) / ratio, rel=1e-12)
    fixed = spec.with_(atmosphere=Atmosphere(lidar_ratio=20.0))
    assert backscatter_of(cloud, fixed) == pytest.approx(extinction_of(cloud) / 20.0, rel=1e-12)
