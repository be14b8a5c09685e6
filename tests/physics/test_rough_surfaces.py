"""One law of rough surfaces: `raycast`, `sbr` and `sionna` give its sigma0, V, H and cross-polar, dry and wet."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.channel.multipath.images import material_coefficients
from scarl_sionna.radar.optics.body.parts import surface_of
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.rough import (
    coherent_share,
    coherent_transmission,
    diffuse_albedo,
    directional_albedo,
    escape,
    scattered_part,
    sigma0,
)
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.scenes import Material, Thing, plane, write_scene

RADAR = RadarSpec(azimuth_fov_deg=160.0, elevation_fov_deg=160.0)
FREQUENCY = RADAR.center_frequency
TABLE = builtin_materials()
HEIGHT = 4.0
BANDS = ((20.0, 40.0), (52.0, 70.0))
"""Angles of incidence [deg]; the second holds Brewster's angle of dry asphalt, 61 deg."""
CHANNELS = {"VV": (0, 0), "HH": (1, 1), "HV": (1, 0), "VH": (0, 1)}
SETTINGS = {
    "raycast": {"num_rays": 400_000, "hits_per_cell": None},
    "sbr": {"settings": SbrSettings(floor_db=None, max_depth=1, max_phase=1.0)},
    "sionna": {"diffuse": True, "max_depth": 1, "num_samples": 500_000},
}


def ground(folder, radio: str):
    """Return the path of a scene of one ground below the radar."""
    flat = Thing("ground", plane(24.0, 24.0, (HEIGHT, 0, 0), (-1, 0, 0)), "Roads", "own")
    return write_scene(folder, [flat], materials={"own": Material(radio=radio)})


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    path = ground(tmp_path_factory.mktemp("rough"), "asphalt")
    toml = path.with_name("scene.toml")
    toml.write_text(toml.read_text().replace('radio = "asphalt"', 'radio = "asphalt"\nwets = 1.0'))
    return load_scene(path)


@cache
def scattered(world, method: str):
    """Return angles of incidence and from the radar's z axis [deg], and powers of the transfer, of what is rough."""
    paths = solve_paths(world.at(0.0), RADAR, Pose(), method, **SETTINGS[method])
    kind = np.flatnonzero(paths.interaction[:, 0] == 2)
    x, y, z = paths.rx_point[kind].T
    theta = np.degrees(np.arctan2(np.hypot(y, z), x))
    side = np.degrees(np.arctan2(np.abs(y), np.abs(z)))
    return theta, side, np.abs(paths.a[kind]) ** 2


def found_and_expected(world, method: str, band: tuple[float, float], sector_deg: float):
    """Return powers in the entries of the transfer, from a sector about the radar's z axis, and those of the law.

    There V is TM and H is TE within the sector. Third: the relative error of a sum of so many random paths.
    """
    theta, side, power = scattered(world, method)
    power = power[(theta > band[0]) & (theta < band[1]) & (side < sector_deg / 2.0)]
    scale = RADAR.wavelength**2 / ((4.0 * np.pi) ** 3 * HEIGHT**2) * 2.0 * np.radians(sector_deg)
    material = next(item for name, item in world.materials.items() if name in set(world.parts.material))

    def law(channel: str) -> float:
        value = quad(
            lambda t: float(sigma0(material, FREQUENCY, np.pi / 2 - t, channel)) * np.cos(t) * np.sin(t),
            *np.radians(band),
        )
        return scale * value[0]

    expected = {channel: law(channel) for channel in CHANNELS}
    total = power.sum(axis=(1, 2))
    error = np.sqrt(np.mean(total**2)) / np.mean(total) / np.sqrt(len(total))
    return power.sum(axis=0), expected, error


@pytest.mark.some(3)
@pytest.mark.parametrize("band", BANDS)
@pytest.mark.parametrize("method", SETTINGS)
def test_every_solver_has_the_laws_sigma0(world, method, band) -> None:
    power, expected, error = found_and_expected(world, method, band, 60.0)
    tolerance = 5.0 * error if method == "sionna" else 0.03  # cells across the edges of the band: 1 in 60
    assert tolerance < 0.2
    for channel, entry in CHANNELS.items():
        assert power[entry] / expected[channel] == pytest.approx(1.0, abs=tolerance), channel


@pytest.mark.parametrize("method", SETTINGS)
def test_a_deep_layer_has_the_laws_sigma0_in_every_solver(tmp_path, method) -> None:
    """Grass; in the two bands Lambert's pattern would lie 2 dB apart from it."""
    state = load_scene(ground(tmp_path, "grass"))
    for band in BANDS:
        power, expected, error = found_and_expected(state, method, band, 60.0)
        tolerance = 5.0 * error if method == "sionna" else 0.03
        assert tolerance < 0.2
        for channel, entry in CHANNELS.items():
            assert power[entry] / expected[channel] == pytest.approx(1.0, abs=tolerance), channel


@pytest.mark.parametrize(
    "fields",
    [{"diffuse_albedo": 0.2}, {"roughness_rms": 0.6e-3}, {"volume_albedo": 0.5}],
    ids=lambda one: next(iter(one)),
)
def test_sionna_scatters_by_whatever_field_says_so(tmp_path, fields) -> None:
    """The engine scatters by a scattering coefficient only; these have none, and have none afterwards."""
    own = TABLE["vinyl_tile"].with_(name="own", xpd_coefficient=0.2, **fields)
    state = load_scene(ground(tmp_path, "own"), MaterialTable([*TABLE.values(), own]))
    assert own.scattering_coefficient == 0.0
    power, expected, error = found_and_expected(state, "sionna", BANDS[1], 60.0)
    for channel, entry in CHANNELS.items():
        assert power[entry] / expected[channel] == pytest.approx(1.0, abs=5.0 * error), channel
    assert error < 0.03
    engine = state.at(0.0).radio_scene().radio_materials["radio-own"]
    assert float(engine.scattering_coefficient[0]) == 0.0


@pytest.mark.parametrize("method", SETTINGS)
def test_water_reaches_every_solver(world, method) -> None:
    """The echo of the road rises as its reflectance along the normal does under the film, 7 dB."""
    wet = world.with_weather(Weather(wetness=1.0))
    dry_power, _, error = found_and_expected(world, method, BANDS[0], 60.0)
    wet_power, expected, _ = found_and_expected(wet, method, BANDS[0], 60.0)
    tolerance = 5.0 * error if method == "sionna" else 0.03
    assert wet_power[0, 0] / expected["VV"] == pytest.approx(1.0, abs=tolerance)
    assert wet_power[0, 0] / dry_power[0, 0] == pytest.approx(5.0, abs=0.6)


def test_sigma0_is_measured_where_it_was_measured() -> None:
    """Of 94 to 95 GHz: dry asphalt -12 dB at 20 deg grazing, grass and rough bare soil within -8 to -3 dB."""

    def level(name: str, grazing_deg: float) -> float:
        return float(10.0 * np.log10(sigma0(TABLE[name], FREQUENCY, np.radians(grazing_deg), "VV")))

    assert level("asphalt", 20.0) == pytest.approx(-12.0, abs=0.1)
    assert -8.0 < level("grass", 20.0) < level("grass", 25.0) < level("grass", 28.0) < -3.0
    assert all(-8.0 < level("soil", angle) < -3.0 for angle in (40.0, 60.0, 80.0))


@pytest.mark.parametrize("albedo", [0.3, 0.6, 0.81, 0.95])
def test_a_deep_layer_scatters_as_radiative_transfer_says(albedo) -> None:
    """Chandrasekhar's integral equation of H, solved by iteration, and the energy 1 - sqrt(1 - w) H(mu) sent back."""
    node, weight = np.polynomial.legendre.leggauss(200)
    node, weight = (node + 1.0) / 2.0, weight / 2.0
    exact, kernel = np.ones(200), weight * node / (node[:, None] + node)
    for _ in range(400):
        exact = 1.0 / (np.sqrt(1.0 - albedo) + albedo / 2.0 * kernel @ exact)
    assert np.abs(escape(albedo, node) / exact - 1.0).max() < 0.041
    grass = TABLE["grass"].with_(volume_albedo=albedo)
    back = directional_albedo(grass, FREQUENCY, node[:, None], node)
    sent = 2.0 * (back * node) @ weight  # over the hemisphere, of what arrives at each angle
    assert sent == pytest.approx(1.0 - np.sqrt(1.0 - albedo) * exact, abs=0.05)
    level = sigma0(grass, FREQUENCY, np.arcsin(node), "VV") / 0.7
    assert level == pytest.approx(albedo / 2.0 * node * exact**2, rel=0.083)
    assert level[0] / node[0] == pytest.approx(albedo / 2.0, rel=0.02)  # single scattering near grazing: water cloud


def test_grass_stays_below_what_any_terrain_was_measured_at() -> None:
    """All terrains at 94 to 95 GHz lie below 0 dB; Lambert's pattern through grass's level at 20 deg does not."""
    levels = sigma0(TABLE["grass"], FREQUENCY, np.radians([20.0, 89.0]), "VV")
    assert levels[1] < 1.0 < levels[0] / np.sin(np.radians(20.0)) ** 2


def test_there_is_no_brewster_null_and_the_law_is_monotonic() -> None:
    grazing = np.radians(np.linspace(0.5, 90.0, 180))
    for name in ("asphalt", "concrete", "grass", "gravel"):
        levels = [sigma0(TABLE[name], FREQUENCY, grazing, channel) for channel in ("VV", "HH", "HV")]
        assert np.all(np.diff(levels, axis=1) > 0.0)
        assert np.array_equal(levels[0], levels[1])
        crossed = TABLE[name].xpd_coefficient
        assert levels[2] / levels[0] == pytest.approx(crossed / (1.0 - crossed))


@pytest.mark.parametrize("grazing_deg", [5.0, 20.0, 60.0, 90.0])
def test_heights_take_from_the_mirror_what_random_phases_cancel(grazing_deg) -> None:
    """Mean over drawn heights of the phase 2 k h sin(grazing) that each turns the reflected wave by, in two solvers."""
    height, sine = 0.4e-3, np.sin(np.radians(grazing_deg))
    rough = TABLE["asphalt"].with_(roughness_rms=height, scattering_coefficient=0.0)
    drawn = np.random.default_rng(5).normal(scale=height, size=400_000)
    phase = 4.0 * np.pi * FREQUENCY / 299_792_458.0 * sine * drawn
    mean, error = np.cos(phase).mean(), np.cos(phase).std() / np.sqrt(len(drawn))
    assert error < 1.2e-3
    smooth = rough.with_(roughness_rms=0.0)
    field, direction = np.array([[[0.0], [1.0], [0.0]]], complex), np.array([[np.sqrt(1.0 - sine**2), 0.0, -sine]])
    up = np.array([[0.0, 0.0, 1.0]])
    kept = [surface_of(m, FREQUENCY, True).reflect(field, direction, up)[0][0, 1, 0] for m in (rough, smooth)]
    assert abs(kept[0] / kept[1] - mean) < 5.0 * error
    index, cosine = np.zeros((1, 1), np.int64), np.array([sine])
    images = [material_coefficients([m], index, FREQUENCY)(0, cosine) for m in (rough, smooth)]
    assert np.abs(np.ravel(images[0][:2]) / np.ravel(images[1][:2]) - mean).max() < 5.0 * error


def test_what_the_mirror_lacks_is_scattered() -> None:
    for name in ("brick", "wood", "rubber", "road_paint"):
        material = TABLE[name]
        reflectance = power_reflectance(material, FREQUENCY, 1.0)[0]
        mirror = float(coherent_share(material, FREQUENCY, 1.0)) ** 2 * reflectance
        assert mirror + diffuse_albedo(material, FREQUENCY) == pytest.approx(reflectance, rel=1e-12)


@pytest.mark.parametrize("film", [0.0, 1e-4, 5e-4])
def test_no_angle_sends_out_more_than_arrives(film) -> None:
    """Mirror, both ways of scattering over the hemisphere, and what passes; 1.56 for wet asphalt at 88 deg without."""
    node, weight = np.polynomial.legendre.leggauss(64)
    node, weight = 0.5 * (node + 1.0), 0.5 * weight
    cosine = np.cos(np.radians([0.0, 30.0, 60.0, 70.0, 80.0, 85.0, 88.0, 89.7]))
    for name in TABLE:
        material = TABLE[name].with_(water_film=film)
        frequency = FREQUENCY if material.covers(FREQUENCY) else material.frequency_range[0]
        strayed = 2.0 * (directional_albedo(material, frequency, cosine[:, None], node) * node) @ weight
        mirror = coherent_share(material, frequency, cosine) ** 2
        passed = coherent_transmission(material, frequency, cosine)
        for reflected, through in zip(power_reflectance(material, frequency, cosine), passed, strict=True):
            assert np.max(mirror * reflected + np.abs(through) ** 2 + strayed) < 1.0 + 1e-9, name
        both = directional_albedo(material, frequency, node[:, None], node)
        assert both == pytest.approx(both.T)


def test_what_was_measured_is_not_bounded() -> None:
    for name, lowest in (("asphalt", 1.0), ("grass", 1.0), ("soil", 1.0), ("gravel", 1.0), ("concrete", 1.0)):
        assert np.all(scattered_part(TABLE[name], FREQUENCY, np.sin(np.radians([lowest, 20.0, 90.0]))) == 1.0), name


@pytest.mark.parametrize("method", SETTINGS)
def test_the_bound_is_in_every_solver(tmp_path, method) -> None:
    """An albedo above what the mirror leaves: the law's level is bounded, not Lambert's."""
    own = TABLE["water"].with_(name="own", diffuse_albedo=0.9, scattering_coefficient=0.3, xpd_coefficient=0.2)
    state = load_scene(ground(tmp_path, "own"), MaterialTable([*TABLE.values(), own]))
    assert np.all(scattered_part(own, FREQUENCY, np.cos(np.radians(BANDS[1]))) < 0.6)
    power, expected, error = found_and_expected(state, method, BANDS[1], 60.0)
    for channel, entry in CHANNELS.items():
        assert power[entry] / expected[channel] == pytest.approx(1.0, abs=max(0.03, 5.0 * error)), channel


def test_albedo_of_a_material_without_measurement() -> None:
    concrete = TABLE["concrete"]
    reflectance = abs((1 - np.sqrt(5.24 - 0.3224j)) / (1 + np.sqrt(5.24 - 0.3224j))) ** 2
    # S = 0.3, h = 0.3 mm, k = 2 pi / 3.8934 mm: what the mirror lacks, 1 - 0.91 exp(-4 (k h)^2)
    assert diffuse_albedo(concrete, 77e9) == pytest.approx((1.0 - 0.91 * 0.391579) * reflectance, rel=1e-3)
    flat = concrete.with_(roughness_rms=0.0)
    assert diffuse_albedo(flat, 77e9) == pytest.approx(0.09 * reflectance, rel=1e-3)
    assert diffuse_albedo(TABLE["metal"], 77e9) == 0.0
    film = TABLE["asphalt"].with_(water_film=5e-4)
    ratio = power_reflectance(film, 77e9, 1.0)[0] / power_reflectance(TABLE["asphalt"], 77e9, 1.0)[0]
    assert diffuse_albedo(film, 77e9) == pytest.approx(0.15 * ratio, rel=1e-12)
    assert diffuse_albedo(film.with_(diffuse_albedo=0.9), 77e9) == 1.0
    with pytest.raises(ParameterRangeError, match="channel"):
        sigma0(concrete, 77e9, 0.1, "XX")  # type: ignore[arg-type]
