"""Radio materials at the carriers of radio links: values against their sources, and what has no data."""

from __future__ import annotations

import cmath
import re
from pathlib import Path

import pytest

import scenes_xml
from scarl_sionna.core.errors import MaterialRangeError
from scarl_sionna.scene.materials.carrier import at_carrier, bands_of, nearest_to_carrier
from scarl_sionna.scene.materials.dielectrics import refractive_mixture, skin_permittivity, water_permittivity
from scarl_sionna.scene.materials.table import RadioMaterial, builtin_materials

SCENES = Path(scenes_xml.__file__).parent
TABLE = builtin_materials()
NAMES_OF_ITU = {"asphalt": "asphalt_concrete", "car_paint": "metal"}
SHARE_OF_WATER = {"soil": 0.1, "foliage": 0.5, "grass": 0.05}


def _bands(source: str) -> list[RadioMaterial]:
    return [band for entry in TABLE.values() for band in bands_of(entry)[1:] if source in band.source]


def test_every_value_of_the_recommendation_is_that_of_sionnas_own_table() -> None:
    from scarl_sionna.engine import variant

    with variant.radio():
        from sionna.rt.radio_materials.itu import ITU_MATERIALS_PROPERTIES

    bands = _bands("P.2040-3, Table 3")
    assert len(bands) == 11
    for band in bands:
        ranges = ITU_MATERIALS_PROPERTIES[NAMES_OF_ITU.get(band.name, band.name)]
        low, high = band.frequency_range
        values = (band.relative_permittivity, band.permittivity_exponent, band.conductivity, band.conductivity_exponent)
        assert ranges[low / 1e9, high / 1e9] == values, band.name
        assert band.reference_frequency == 1e9


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_models_and_mixtures_are_met_over_their_bands(share) -> None:
    def asphalt(frequency: float) -> complex:
        return at_carrier(TABLE["asphalt_concrete"], frequency).at(frequency)

    def with_water_of(name: str, frequency: float) -> complex:
        change = cmath.sqrt(water_permittivity(frequency)) - cmath.sqrt(water_permittivity(77e9))
        return (cmath.sqrt(TABLE[name].at(77e9)) + SHARE_OF_WATER[name] * change) ** 2

    count = 0
    for name in ("water", "skin", "clothed_skin", "asphalt_wet", *SHARE_OF_WATER):
        for band in bands_of(TABLE[name])[1:]:
            frequency = band.frequency_range[0] * (1 - share) + band.frequency_range[1] * share
            if name in SHARE_OF_WATER:
                exact = with_water_of(name, frequency)
            elif name == "asphalt_wet":
                exact = refractive_mixture([(0.95, asphalt(frequency)), (0.05, water_permittivity(frequency))])
            else:
                exact = water_permittivity(frequency) if name == "water" else skin_permittivity(frequency)
            assert abs(band.at(frequency) / exact - 1.0) < 0.008, (name, frequency)
            count += 1
    assert count == 14


def test_estimates_that_keep_the_main_entry_meet_it_at_77_ghz() -> None:
    kept = _bands("of the entry for 76-81 GHz kept")
    assert len(kept) == 6
    for band in kept:
        carried = band.with_(frequency_range=(1e9, 78e9)).at(77e9)
        assert carried == pytest.approx(TABLE[band.name].at(77e9), rel=1e-12)


@pytest.mark.parametrize("frequency", [5.9e9, 28e9, 77e9])
def test_all_materials_of_the_scenes_that_come_with_the_package_have_data(frequency) -> None:
    used = {name for file in SCENES.rglob("*.toml") for name in re.findall(r'radio = "(\w+)"', file.read_text())}
    assert len(used) > 12
    for name in used:
        assert at_carrier(TABLE[name], frequency).covers(frequency)


def test_the_main_entry_is_taken_as_it_is_in_its_own_band() -> None:
    assert at_carrier(TABLE["asphalt"], 77e9) is TABLE["asphalt"]


def test_a_wet_material_has_the_bands_of_what_is_under_the_water() -> None:
    wet = TABLE["asphalt"].with_(name="asphalt, 0.50 mm of water", water_film=5e-4)
    assert at_carrier(wet, 5.9e9).at(5.9e9) == at_carrier(TABLE["asphalt"], 5.9e9).at(5.9e9)


def test_without_data_there_is_an_error_or_the_nearest_value_on_request() -> None:
    with pytest.raises(MaterialRangeError, match=r"'brick' has no data at 60 GHz \(valid: 76-81 GHz\)") as error:
        at_carrier(TABLE["brick"], 60e9)
    assert "concrete" in error.value.alternatives and "brick" not in error.value.alternatives
    material, near = nearest_to_carrier(TABLE["brick"], 60e9)
    assert near == 76e9 and material.at(60e9) == pytest.approx(TABLE["brick"].at(76e9), rel=1e-12)
    material, near = nearest_to_carrier(TABLE["brick"], 45e9)
    assert near == 40e9 and material.at(45e9) == pytest.approx(at_carrier(TABLE["brick"], 40e9).at(40e9), rel=1e-12)
    assert nearest_to_carrier(TABLE["brick"], 5.9e9)[1] == 5.9e9
