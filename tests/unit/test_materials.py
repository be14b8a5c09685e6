"""The radio material table: values, sources, ranges, user files and errors."""

from __future__ import annotations

import math
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from scarl_sionna.core.errors import MaterialError, MaterialRangeError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.units import VACUUM_PERMITTIVITY
from scarl_sionna.scene.materials.carrier import at_carrier
from scarl_sionna.scene.materials.dielectrics import (
    ice_permittivity,
    skin_permittivity,
    snow_permittivity,
    water_permittivity,
)
from scarl_sionna.scene.materials.table import RadioMaterial, builtin_materials, load_materials

REPO = Path(__file__).resolve().parents[2]

REQUIRED = {
    "asphalt", "asphalt_wet", "concrete", "metal", "car_paint", "car_glass", "glass", "rubber", "plastic", "wood",
    "foliage", "grass", "soil", "brick", "road_paint", "gravel", "water", "ice", "snow_dry", "snow_wet", "skin",
    "clothing",
    "clothed_skin", "acrylic",
}  # fmt: skip # a table

# All names of ITU-R P.2040 that Sionna RT knows; those without data at 77 GHz are estimates of ours.
ITU_NAMES = {
    "vacuum", "concrete", "brick", "plasterboard", "wood", "glass", "clear_acrylic", "ceiling_board", "chipboard",
    "plywood",
    "marble", "floorboard", "vinyl_tile", "carpet_tile", "asphalt_concrete", "metal", "very_dry_ground",
    "medium_dry_ground", "wet_ground",
}  # fmt: skip # a table

# ITU-R P.2040-3, Table 3: eps' = a f_GHz^b, sigma = c f_GHz^d.
ITU_COEFFICIENTS = {
    "concrete": (5.24, 0.0, 0.0462, 0.7822),
    "glass": (6.31, 0.0, 0.0036, 1.3394),
    "wood": (1.99, 0.0, 0.0047, 1.0718),
    "metal": (1.0, 0.0, 1e7, 0.0),
    "plasterboard": (2.73, 0.0, 0.0085, 0.9395),
    "ceiling_board": (1.48, 0.0, 0.0011, 1.075),
    "chipboard": (2.58, 0.0, 0.0217, 0.78),
}


def test_every_material_has_data_over_the_automotive_band() -> None:
    table = load_materials()
    assert set(table) >= REQUIRED | ITU_NAMES
    for name, material in table.items():
        for frequency in (76e9, 77e9, 81e9):
            permittivity = material.at(frequency)
            assert permittivity.real >= 1.0 and permittivity.imag <= 0.0, name
        assert name == "vacuum" or (len(material.source) > 20 and len(material.uncertainty) > 10), name


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("water", water_permittivity),
        ("ice", ice_permittivity),
        ("skin", skin_permittivity),
        ("snow_dry", lambda frequency: snow_permittivity(frequency, 250.0)),
        ("snow_wet", lambda frequency: snow_permittivity(frequency, 350.0, 0.05)),
    ],
)
@pytest.mark.parametrize("frequency", [76e9, 77e9, 79e9, 81e9])
def test_entries_from_models_follow_them(name: str, model, frequency: float) -> None:
    # Digits in the file, 4 of 4.6e-3 S/m at worst, and power laws through 76 and 81 GHz: 3e-3 of the loss.
    expected, found = model(frequency), builtin_materials()[name].at(frequency)
    assert found.real == pytest.approx(expected.real, rel=1e-3)
    assert found.imag == pytest.approx(expected.imag, rel=3e-3)


def test_the_tables_of_the_page_are_up_to_date() -> None:
    script = runpy.run_path(str(REPO / "scripts" / "materials_table.py"))
    page = (REPO / "docs" / "materials.md").read_text()
    assert script["updated"](page) == page, "run: python scripts/materials_table.py"
    assert script["updated"](page.replace("| `asphalt` |", "| `aspalt` |")) == page
    assert all(f"| `{name}` |" in page for name in builtin_materials())


@pytest.mark.parametrize("name", ITU_COEFFICIENTS)
@pytest.mark.parametrize("frequency", [10e9, 76e9, 77e9, 81e9])
def test_itu_materials_follow_the_recommendation(name: str, frequency: float) -> None:
    a, b, c, d = ITU_COEFFICIENTS[name]
    sigma = c * (frequency / 1e9) ** d
    expected = complex(a * (frequency / 1e9) ** b, -sigma / (2 * math.pi * frequency * VACUUM_PERMITTIVITY))
    # The table stores sigma at 77 GHz as a double: the power law agrees to rounding (a few ulp of pow).
    assert load_materials()[name].at(frequency) == pytest.approx(expected, rel=1e-12)


def test_asphalt_is_the_value_of_its_source() -> None:
    # 3.18 - 0.1j; the file gives the conductivity to 5 digits.
    assert load_materials()["asphalt"].at(77e9) == pytest.approx(3.18 - 0.1j, abs=1e-6)


def test_outside_the_range_is_an_error_with_alternatives() -> None:
    with pytest.raises(MaterialRangeError, match=r"'asphalt' has no data at 24 GHz .*concrete") as caught:
        load_materials()["asphalt"].at(24e9)
    assert caught.value.valid == (76e9, 81e9)
    assert "concrete" in caught.value.alternatives


@pytest.mark.parametrize("frequency", [77.0, 77e3])
def test_a_frequency_in_another_unit_is_told_to_be_in_hertz(frequency: float) -> None:
    with pytest.raises(MaterialRangeError, match=rf"no data at {frequency:g} Hz .*in Hz: 77 GHz is 77e9$"):
        load_materials()["asphalt"].at(frequency)


def test_where_no_material_has_data_none_is_named() -> None:
    with pytest.raises(MaterialRangeError, match=r"7.7e\+04 GHz .*; no built-in material has; add a sourced") as caught:
        load_materials()["asphalt"].at(77e12)
    assert caught.value.alternatives == []
    with pytest.raises(MaterialRangeError, match="no built-in material has"):
        at_carrier(load_materials()["asphalt"], 77e12)


def test_unknown_name_is_both_a_material_and_a_name_error() -> None:
    with pytest.raises(MaterialError, match="did you mean 'asphalt'"):
        load_materials()["asphalt_"]
    with pytest.raises(UnknownNameError):
        load_materials()["adamantium"]
    assert load_materials().get("adamantium") is None


def test_a_users_file_adds_and_replaces(tmp_path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        '[slush]\nrelative_permittivity = 1.5\nconductivity = 0.02\nsource = "mine"\nuncertainty = "wide"\n'
        '[glass]\nrelative_permittivity = 7.0\nconductivity = 1.0\nsource = "mine"\nuncertainty = "wide"\n'
    )
    table = load_materials([path])
    assert table["slush"].relative_permittivity == 1.5
    assert table["glass"].relative_permittivity == 7.0 and table["glass"].thickness is None
    assert builtin_materials()["glass"].relative_permittivity == 6.31
    assert "slush" not in builtin_materials()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "[slush]\nrelative_permittivity = 0.5\nconductivity = 0\nsource = 's'\nuncertainty = 'u'\n",
            "relative_permittivity",
        ),
        ("[slush]\nrelative_permittivity = 1.5\nconductivity = -1\nsource = 's'\nuncertainty = 'u'\n", "conductivity"),
        ("[slush]\nrelative_permittivity = 1.5\nconductivity = 0\nuncertainty = 'u'\n", "source"),
        (
            "[slush]\nrelative_permittivity = nan\nconductivity = 0\nsource = 's'\nuncertainty = 'u'\n",
            "relative_permittivity",
        ),
        (
            "[slush]\ncolour = 'white'\nrelative_permittivity = 1\nconductivity = 0\nsource = 's'\nuncertainty = 'u'\n",
            "colour",
        ),
        (
            "[turf]\nrelative_permittivity = 1.3\nconductivity = 1\ndiffuse_albedo = 0.5\nvolume_albedo = 0.8\n"
            "source = 's'\nuncertainty = 'u'\n",
            "not both",
        ),
        ("slush = 3\n", "not a table"),
        ("[slush\n", "TOML"),
    ],
)
def test_a_bad_file_names_the_file_and_the_field(tmp_path, text: str, message: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(MaterialError, match=message) as caught:
        load_materials([path])
    assert "bad.toml" in str(caught.value)


def test_a_missing_file_is_a_material_error(tmp_path) -> None:
    with pytest.raises(MaterialError, match=r"absent\.toml"):
        load_materials([tmp_path / "absent.toml"])


def test_a_material_is_frozen_and_checks_its_range() -> None:
    material = load_materials()["glass"]
    with pytest.raises(Exception, match="frozen"):
        material.thickness = 1.0  # type: ignore[misc]
    with pytest.raises(ParameterRangeError, match="frequency_range"):
        RadioMaterial(
            name="x", relative_permittivity=1, conductivity=0, source="s", uncertainty="u", frequency_range=(2e9, 1e9)
        )


@pytest.mark.parametrize("line", ["reference_frequency = 77", "frequency_range = [76, 81]"])
def test_frequencies_meant_in_ghz_are_refused(tmp_path, line) -> None:
    path = tmp_path / "own.toml"
    values = 'relative_permittivity = 3\nconductivity = 0.1\nsource = "s"\nuncertainty = "u"'
    path.write_text(f"[own]\n{values}\n{line}\n")
    with pytest.raises(MaterialError, match=r"= 7[67] is not allowed \(allowed: .*1000000 \[Hz\]\).*GHz"):
        load_materials([path])


def test_the_table_needs_no_mitsuba() -> None:
    # World's package may load the engine, so the module is loaded from its file alone.
    code = (
        "import importlib.util, sys, pathlib;"
        "path = pathlib.Path('scarl_sionna/scene/materials/table.py').resolve();"
        "spec = importlib.util.spec_from_file_location('materials', path);"
        "module = importlib.util.module_from_spec(spec); sys.modules['materials'] = module; "
        "spec.loader.exec_module(module);"
        "module.load_materials(); assert not {'mitsuba', 'drjit', 'sionna'} & set(sys.modules), 'engine loaded'"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
