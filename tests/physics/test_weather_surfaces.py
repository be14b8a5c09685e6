"""Wet surfaces: the film's coefficients against a transfer matrix, and what a wet world changes."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.specs.weather import FULL_FILM, Weather
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.scene.materials.dielectrics import water_permittivity
from scarl_sionna.scene.materials.fresnel import (
    film_coefficients,
    halfspace_reflection,
    layer_reflection,
    reflection,
    transmission,
)
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.scenes import Material, Thing, plane, write_scene

FREQUENCY = 77e9
WATER = water_permittivity(FREQUENCY, 283.15)
COSINE = np.cos(np.radians([0.0, 20.0, 45.0, 70.0, 85.0, 89.0]))


def transfer_matrix(media, depths, cosine, magnetic):
    """Reflection and transmission of layers by characteristic matrices (Abeles; Born and Wolf, 1.6.3).

    From media[0] into media[-1].
    """
    wave = 2.0 * np.pi * FREQUENCY / SPEED_OF_LIGHT
    root = [np.sqrt(medium - (1.0 - cosine**2) + 0j) for medium in media]
    p = [q / medium if magnetic else q for q, medium in zip(root, media, strict=True)]
    matrix = np.eye(2, dtype=complex)
    for q, admittance, depth in zip(root[1:-1], p[1:-1], depths, strict=True):
        phase = wave * depth * q
        matrix = matrix @ np.array(
            [[np.cos(phase), 1j * np.sin(phase) / admittance], [1j * admittance * np.sin(phase), np.cos(phase)]]
        )
    (m11, m12), (m21, m22) = matrix
    first, second = (m11 + m12 * p[-1]) * p[0], m21 + m22 * p[-1]
    return (first - second) / (first + second), 2.0 * p[0] / (first + second)


@pytest.mark.parametrize("depth", [0.02e-3, 0.1e-3, 0.5e-3, 3e-3])
@pytest.mark.parametrize("below", [(3.18 - 0.1j, None), (6.3 - 0.3j, 4e-3), (1.0 - 2e5j, None)])
def test_film_against_transfer_matrices(depth, below) -> None:
    permittivity, thickness = below
    media = [1.0, WATER, permittivity, *([] if thickness is None else [1.0])]
    depths = [depth, *([] if thickness is None else [thickness])]
    reflected, passed = film_coefficients(WATER, depth, permittivity, thickness, COSINE, FREQUENCY)
    for magnetic in (False, True):
        for index, cosine in enumerate(COSINE):
            r, t = transfer_matrix(media, depths, cosine, magnetic)
            assert reflected[magnetic][index] == pytest.approx(r, abs=1e-9)
            assert passed[magnetic][index] == pytest.approx(0.0 if thickness is None else t, abs=1e-9)


def test_limits_of_a_film() -> None:
    """No depth: what lies below. Deep: water. The same medium as below: a thicker layer."""
    assert np.allclose(
        film_coefficients(WATER, 0.0, 3.2 - 0.1j, None, COSINE, FREQUENCY)[0], halfspace_reflection(3.2 - 0.1j, COSINE)
    )
    assert np.allclose(
        film_coefficients(WATER, 0.1, 3.2 - 0.1j, None, COSINE, FREQUENCY)[0], halfspace_reflection(WATER, COSINE)
    )
    both = film_coefficients(3.0 - 0.1j, 1e-3, 3.0 - 0.1j, 2e-3, COSINE, FREQUENCY)[0]
    assert np.allclose(both, layer_reflection(3.0 - 0.1j, COSINE, 3e-3, FREQUENCY))


def test_material_with_a_film_reflects_and_lets_through_as_stated() -> None:
    glass = builtin_materials()["glass"]
    thin = glass.with_(water_film=1e-12)
    assert np.allclose(reflection(glass, FREQUENCY, COSINE), reflection(thin, FREQUENCY, COSINE), atol=1e-7)
    assert np.allclose(transmission(glass, FREQUENCY, COSINE), transmission(thin, FREQUENCY, COSINE), atol=1e-7)
    wet = glass.with_(water_film=0.3e-3)
    te, tm = transmission(wet, FREQUENCY, COSINE)
    for through, back in zip((te, tm), reflection(wet, FREQUENCY, COSINE), strict=True):
        assert np.all(np.abs(through) ** 2 + np.abs(back) ** 2 < 1.0)


def test_wet_asphalt_at_normal_and_grazing_incidence() -> None:
    """0.5 mm of water at 10 degrees C: 7.5 dB more at normal incidence.

    At 2 degrees elevation H (TE) changes by less than 1 dB.
    """
    asphalt = builtin_materials()["asphalt"]
    wet = asphalt.with_(water_film=FULL_FILM)
    angles = np.sin(np.radians([90.0, 2.0]))
    gain = [
        20.0 * np.log10(np.abs(after) / np.abs(before))
        for before, after in zip(
            reflection(asphalt, FREQUENCY, angles), reflection(wet, FREQUENCY, angles), strict=True
        )
    ]
    assert gain[0][0] == pytest.approx(gain[1][0])  # no polarisation at normal incidence
    assert 6.0 < gain[0][0] < 9.0
    assert 0.0 < gain[0][1] < 1.0
    assert abs(gain[1][1]) < 3.0


def test_a_film_on_metal_takes_power() -> None:
    metal = builtin_materials()["metal"]
    loss = [
        -20.0 * np.log10(abs(reflection(metal.with_(water_film=depth), FREQUENCY, 1.0)[0]))
        for depth in (1e-6, 0.1e-3, 0.3e-3)
    ]
    assert loss[0] < 0.1 < loss[1] < loss[2]


@pytest.fixture(scope="module")
def world():
    return load_scene("highway_guardrail")


def test_films_differ_by_name_and_rain_leaves_a_thicker_one(tmp_path) -> None:
    """Shares of the wetness 2 um of water apart, and an entry under 0.3 mm of water already."""
    things = [
        Thing(name, plane(4.0, 4.0, (0.0, 5.0 * k, 0.0)), "Roads", name)
        for k, name in enumerate(("one", "two", "pool"))
    ]
    radio = {"one": "asphalt", "two": "asphalt", "pool": "pool"}
    path = write_scene(tmp_path, things, materials={name: Material(radio=known) for name, known in radio.items()})
    toml = path.with_name("scene.toml")
    text = toml.read_text()
    for name, share in (("one", 0.2), ("two", 0.204), ("pool", 1.0)):
        text = text.replace(f"[materials.{name}]\n", f"[materials.{name}]\nwets = {share}\n")
    toml.write_text(text)
    pool = builtin_materials()["asphalt"].with_(name="pool", water_film=0.3e-3, water_temperature=300.0)
    dry = load_scene(path, MaterialTable([*builtin_materials().values(), pool]))

    def films(wetness: float) -> list[float]:
        wet = dry.with_weather(Weather(wetness=wetness))
        return [wet.materials[name].water_film for name in wet.parts.material]

    assert films(1.0) == pytest.approx([0.1e-3, 0.102e-3, 0.5e-3])
    assert films(0.2) == pytest.approx([0.02e-3, 0.0204e-3, 0.3e-3])


def test_wet_world_changes_wet_surfaces_only_and_clear_goes_back(world) -> None:
    wet = world.with_weather(Weather(wetness=1.0))
    before = dict(zip(world.parts.name, world.parts.material, strict=True))
    after = dict(zip(wet.parts.name, wet.parts.material, strict=True))
    changed = {before[name] for name in before if before[name] != after[name]}
    assert "asphalt" in changed
    assert not changed & {"metal", "car_paint", "car_glass", "rubber"}
    road = [name for name in before if before[name] == "asphalt"]
    assert {wet.materials[after[name]].water_film for name in road} == {FULL_FILM}
    darker = wet.parts.lidar_reflectance / world.parts.lidar_reflectance
    assert darker.min() < 0.3
    assert darker.max() == 1.0
    again = wet.with_weather("clear")
    assert again.parts.material == world.parts.material
    assert np.array_equal(again.parts.lidar_reflectance, world.parts.lidar_reflectance)
    assert again.materials is world.materials
    assert again.lighting == world.lighting
    assert again.twin("radio") is world.twin("radio") if "radio" in world._twins else True


def test_lighting_and_weather_add_up_in_either_order(world) -> None:
    first = world.with_lighting("dusk").with_weather("rain").lighting
    second = world.with_weather("rain").with_lighting("dusk").lighting
    assert first == second
    assert first is not None
    assert first.cloud_cover == 1.0
    assert first.visibility is not None
    assert first.visibility < 3000.0


def test_rain_wets_more_the_more_it_rains() -> None:
    wetness = [Weather(rain_rate=rate).surface_wetness for rate in (0.0, 1.0, 5.0, 50.0)]
    assert wetness[0] == 0.0
    assert wetness == sorted(wetness)
    assert wetness[-1] == pytest.approx(1.0, abs=1e-6)
    assert Weather(rain_rate=50.0, wetness=0.2).surface_wetness == 0.2
