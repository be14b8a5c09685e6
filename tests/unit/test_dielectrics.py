"""Models behind the material table against published values and independent formulas."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scene.materials.dielectrics import (
    CELSIUS,
    ice_permittivity,
    refractive_mixture,
    skin_permittivity,
    snow_permittivity,
    water_permittivity,
)


def meissner_wentz(frequency: float, celsius: float) -> complex:
    """Fresh water by T. Meissner and F. Wentz, IEEE Trans. Geosci. Remote Sens. 42(9), 2004, a fit to other data."""
    static = (3.70886e4 - 82.168 * celsius) / (421.854 + celsius)
    middle = 5.7230 + 2.2379e-2 * celsius - 7.1237e-4 * celsius**2
    first = (45.0 + celsius) / (5.0478 - 7.0315e-2 * celsius + 6.0059e-4 * celsius**2)
    high = 3.6143 + 2.8841e-2 * celsius
    second = (45.0 + celsius) / (0.13652 + 1.4825e-3 * celsius + 2.4166e-4 * celsius**2)
    ghz = frequency / 1e9
    return (static - middle) / (1 + 1j * ghz / first) + (middle - high) / (1 + 1j * ghz / second) + high


@pytest.mark.parametrize("celsius", [0.0, 10.0, 20.0, 30.0])
@pytest.mark.parametrize("frequency", [24e9, 77e9, 94e9])
def test_water_agrees_with_another_fit(frequency: float, celsius: float) -> None:
    found, expected = water_permittivity(frequency, CELSIUS + celsius), meissner_wentz(frequency, celsius)
    assert abs(found - expected) < 0.03 * abs(expected)  # the fits' own spread at these frequencies
    assert found.imag < 0.0


def test_skin_has_its_published_value_at_60_ghz() -> None:
    # 7.98 - 10.90j, as quoted of the same fit by M. Zhadobov et al., Int. J. Microwave Wireless Tech. 3, 2011, Table 2
    assert skin_permittivity(60e9) == pytest.approx(7.98 - 10.90j, abs=0.02)


def test_ice_is_nearly_transparent_and_flat() -> None:
    cold, warm = ice_permittivity(77e9, 243.15), ice_permittivity(77e9, CELSIUS)
    assert warm.real == pytest.approx(3.188, abs=1e-3) and cold.real < warm.real
    assert 2e-3 < -cold.imag < -warm.imag < 1e-2
    # at millimetre waves the loss is the wing of the infrared band: proportional to the frequency
    assert ice_permittivity(154e9).imag / ice_permittivity(77e9).imag == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize("density", [100.0, 250.0, 400.0])
def test_dry_snow_agrees_with_another_fit(density: float) -> None:
    grams = density / 1000.0
    other = 1.0 + 1.7 * grams + 0.7 * grams**2  # Tiuri et al., 1984: the fits differ by 3 %
    assert snow_permittivity(77e9, density).real == pytest.approx(other, rel=0.04)
    assert snow_permittivity(77e9, 0.0) == 1.0


def test_water_in_snow_raises_both_parts() -> None:
    values = [snow_permittivity(77e9, 300.0, wetness) for wetness in (0.0, 0.02, 0.05, 0.12)]
    for less, more in pairwise(values):
        assert more.real > less.real and more.imag < less.imag


def test_mixtures_have_their_limits() -> None:
    water = water_permittivity(77e9)
    assert refractive_mixture([(1.0, water)]) == pytest.approx(water, rel=1e-12)
    assert refractive_mixture([]) == 1.0
    assert refractive_mixture([(0.5, 4.0)]) == pytest.approx(((2.0 + 1.0) / 2.0) ** 2)
    assert math.isclose(refractive_mixture([(0.3, 4.0), (0.7, 9.0)]).real, (0.6 + 2.1) ** 2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: water_permittivity(5e8), "frequency = 5e.08 Hz"),
        (lambda: water_permittivity(77e9, 20.0), "temperature = 20 K .*250 to 330 K"),
        (lambda: ice_permittivity(77e9, 280.0), "temperature"),
        (lambda: snow_permittivity(77e9, 900.0), "density"),
        (lambda: snow_permittivity(77e9, 300.0, 0.5), "wetness"),
        (lambda: skin_permittivity(200e9), "frequency"),
        (lambda: refractive_mixture([(0.8, 2.0), (0.4, 3.0)]), "shares"),
        (lambda: refractive_mixture([(-0.1, 2.0)]), "shares"),
    ],
)
def test_out_of_range_is_refused(call, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        call()
