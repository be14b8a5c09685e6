"""Lying snow: which shapes it covers, and that every sensor sees them as a scene that was built of snow."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from camera_lidar import Camera, Lidar
from scarl_sionna.core.errors import SpecError
from scarl_sionna.scene.materials.lying_snow import ALBEDO
from scarl_sionna.scene.materials.table import load_materials
from tests.scenes import Material, Thing, plane, write_scene

SNOW = ss.Weather(lying_snow="everywhere", temperature_celsius=-3.0)


def box(size, at) -> trimesh.Trimesh:
    return trimesh.creation.box(size).apply_translation(at)


def roof(x: float) -> trimesh.Trimesh:
    """A gable roof of two sheets with their undersides, eaves at 4 m and ridge at 7 m."""
    slopes = []
    for z in (0.0, -0.1):
        ridge, eaves = [(x - 5.0, 10.0, 7.0 + z), (x + 5.0, 10.0, 7.0 + z)], 4.0 + z
        for y in (6.0, 14.0):
            corners = [*ridge, (x + 5.0, y, eaves), (x - 5.0, y, eaves)]
            slopes.append(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False))
    return trimesh.util.concatenate(slopes)


def street(folder: Path, materials=None, ground: str = "grey") -> ss.World:
    """A road in a field, a house, a hall of slab and floor, a wall, and a car that stands."""
    things = [
        Thing("field", plane(120.0, 120.0).apply_translation([0.0, 0.0, -0.05]), "Terrain", ground),
        Thing("road", plane(120.0, 8.0), "Roads", ground),
        Thing("walls", box((10.0, 8.0, 4.0), (30.0, 10.0, 2.0)), "Building"),
        Thing("roof", roof(30.0), "Building", ground),
        Thing("hall_floor", plane(20.0, 20.0).apply_translation([0.0, 40.0, 0.0]), "Ground"),
        Thing("hall_roof", box((24.0, 24.0, 0.3), (0.0, 40.0, 5.0)), "Building", ground),
        Thing("tree", trimesh.creation.icosphere(2, 2.0).apply_translation([15.0, 9.0, 3.0]), "Vegetation"),
    ]
    car = Thing(
        "car", box((4.5, 1.8, 0.2), (0.0, 0.0, 0.6)), "Car", trajectory={"kind": "static", "position": [20, 0, 0]}
    )
    return ss.load_scene(write_scene(folder, things, [car], materials))


def covered(world: ss.World) -> set[str]:
    return {
        name.removeprefix("shape-")
        for name, material in zip(world.parts.name, world.parts.material, strict=True)
        if material.startswith("snow")
    }


def test_snow_lies_on_ground_and_roofs_under_the_sky(tmp_path):
    world = street(tmp_path / "a")
    assert covered(world) == set()
    assert covered(world.with_weather(SNOW)) == {"field", "road", "roof", "hall_roof"}
    cleared = world.with_weather(SNOW.with_(lying_snow="beside_roads"))
    assert covered(cleared) == {"field", "roof", "hall_roof"}
    assert covered(cleared.with_weather("clear")) == set()
    wet = world.with_weather(SNOW.with_(snow="wet"))
    assert set(wet.parts.material) >= {"snow_wet"} and not wet.weather.is_clear


def test_what_lies_flush_in_a_road_is_cleared_with_it(tmp_path):
    """A cover of 4 mm in the road is; one beside the road, and a slab of 0.2 m on it, are not."""
    things = [
        Thing("field", plane(120.0, 120.0, (0.0, 0.0, -0.01)), "Terrain"),
        Thing("road", plane(120.0, 8.0), "Roads"),
        Thing("cover", plane(0.6, 0.6, (5.0, 1.0, 0.004)), "Static"),
        Thing("hatch", plane(0.6, 0.6, (5.0, 9.0, 0.004)), "Static"),
        Thing("slab", plane(0.6, 0.6, (9.0, 1.0, 0.2)), "Static"),
    ]
    world = ss.load_scene(write_scene(tmp_path, things))
    assert covered(world.with_weather(SNOW)) == {"field", "road", "cover", "hatch", "slab"}
    assert covered(world.with_weather(SNOW.with_(lying_snow="beside_roads"))) == {"field", "hatch", "slab"}


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A world under snow, and one whose ground and roofs were built of snow."""
    folder = tmp_path_factory.mktemp("snow")
    reflectance = load_materials()["snow_dry"].lidar_reflectance
    look = {"snow": Material(ALBEDO["dry"], "snow_dry", reflectance)}
    return street(folder / "a").with_weather(SNOW), street(folder / "b", look, "snow")


def test_the_camera_sees_it_white(pair):
    spec = ss.CameraSpec(
        width=48, height=27, samples_per_pixel=8, denoise=False, exposure=0.3, images=("rgb", "semantic")
    )
    images = [
        Camera(spec).observe(world.at(0.0), ss.Pose((0.0, 0.0, 1.6)), np.random.default_rng(1)).rgb for world in pair
    ]
    assert np.array_equal(*images)
    bare = pair[0].with_weather("clear")
    dark = Camera(spec).observe(bare.at(0.0), ss.Pose((0.0, 0.0, 1.6)), np.random.default_rng(1)).rgb
    assert images[0][-5:].mean() > dark[-5:].mean() + 25.0


def test_the_lidar_has_its_reflectance(pair):
    scans = [
        Lidar(ss.LidarSpec(num_azimuth=180, num_elevation=16)).observe(
            world.at(0.0), ss.Pose((0.0, 0.0, 1.6)), np.random.default_rng(1)
        )
        for world in pair
    ]
    assert np.array_equal(scans[0].distance, scans[1].distance) and len(scans[0].distance) > 100
    assert np.array_equal(scans[0].reflectance, scans[1].reflectance)


def test_the_radar_has_its_echo(pair):
    spec, settings = ss.RadarSpec(), {"num_rays": 20_000}
    found = [
        ss.solve_paths(world.at(0.0), spec, ss.Pose((0.0, 0.0, 0.6)), method="raycast", raycast=settings)
        for world in pair
    ]
    assert len(found[0].length) == len(found[1].length) > 100
    np.testing.assert_allclose(np.abs(found[0].a), np.abs(found[1].a), rtol=1e-6)
    bare = ss.solve_paths(
        pair[0].with_weather("clear").at(0.0), spec, ss.Pose((0.0, 0.0, 0.6)), method="raycast", raycast=settings
    )
    assert np.abs(bare.a).sum() != pytest.approx(np.abs(found[0].a).sum(), rel=0.05)


def test_snow_does_not_lie_in_warm_air():
    with pytest.raises(SpecError, match="lying snow at 5 degrees Celsius or below, not at 8"):
        ss.Weather(lying_snow="everywhere", temperature_celsius=8.0)
