"""The kernels of the raycast solver against the same model in NumPy, and how many of them there are."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.raycast import RaycastSettings
from tests.kernels import kernels
from tests.oracles import raycast as oracle
from tests.scenes import Material, Thing, box, plane, write_scene

MATERIALS = {name: Material(radio=name) for name in ("concrete", "asphalt", "metal", "glass", "plastic")}
MATERIALS["steel"] = MATERIALS.pop("metal")
TURNING = {"kind": "constant_twist", "position": [18, 4, 1], "velocity": [6, -2, 0], "angular_velocity_z": 0.7}
THINGS = (
    Thing("road", plane(200.0, 60.0, (60, 0, -1)), "Roads", "asphalt"),
    Thing("wall", plane(40.0, 12.0, (60, 0, 3), (-1, 0.2, 0)), "Wall", "concrete"),
    Thing("window", plane(8.0, 4.0, (30, -8, 1), (-1, 0.5, 0.1)), "Building", "glass"),
    Thing("post", box((0.4, 0.4, 4), (15, -3, 1)), "Pole", "plastic"),
)
ACTORS = (Thing("van", box((5, 2, 2)), "Car", "steel", TURNING),)
MOUNT = Mount(Pose.from_euler([0.3, -0.2, 0.1], yaw=0.05, pitch=-0.02, roll=0.3), Twist(linear=[11.0, 0.5, 0.0]))


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    scene = write_scene(tmp_path_factory.mktemp("kernel"), THINGS, ACTORS, MATERIALS)
    toml, rows = scene.with_name("scene.toml"), ""
    for line in toml.read_text().splitlines():  # a half space and a layer take films of water in the rain
        rows += line + ("\nwets = 1.0\n" if line in ('radio = "concrete"', 'radio = "plastic"') else "\n")
    toml.write_text(rows)
    return ss.load_scene(scene)


LITERAL = {"rcs_model": "per_hit", "rough_ground": False, "grid": "regular"}


@pytest.mark.parametrize(
    ("weather", "knobs", "heard"), [("clear", LITERAL, "V"), ("heavy_rain", {}, "V"), ("clear", {}, "H")]
)
def test_every_column_is_that_of_plain_numpy(world, weather: str, knobs: dict, heard: str) -> None:
    state = world.with_weather(weather).at(0.4)
    films = sum(material.water_film > 0.0 for material in state.world.materials.values())
    assert films == (2 if weather == "heavy_rain" else 0)
    radar = ss.RadarSpec.preset("awr1843boost")
    if heard != radar.array.polarization:
        radar = radar.with_(rx_elements=(ss.AntennaElement(polarization=heard),))
    settings = RaycastSettings(num_rays=40_000, hits_per_cell=None, hit_phase="geometric", **knobs)
    paths = ss.solve_paths(state, radar, MOUNT, settings=ss.RadarSettings.of("raycast", raycast=settings))
    exact = oracle.columns(state, radar, MOUNT, settings, radar.max_range)
    assert len(set(exact["instance"])) == 5 and paths.num_paths == len(exact["ray"]) > 10_000
    assert np.array_equal(paths.instance[:, 0], exact["instance"])
    # Float64 and float64: points of 60 m and velocities of 20 m/s in a few operations.
    assert np.abs(paths.tx_point - exact["point"]).max() < 1e-9
    assert np.abs(paths.tx_velocity - exact["velocity"]).max() < 1e-10
    assert np.abs(paths.length_rate - exact["length_rate"]).max() < 1e-10
    for name, entry in (("vv", (0, 0)), ("hh", (1, 1)), ("vh", (0, 1)), ("vh", (1, 0))):
        found = np.abs(paths.a[:, entry[0], entry[1]])  # phases of rough hits: tests/physics/test_depolarization.py
        assert found == pytest.approx(exact[name], rel=1e-9, abs=1e-9 * exact["vv"].max() * 1e-6), name
    smooth = exact["vh"] == 0.0
    assert not paths.a[smooth].imag.any() and (paths.a[:, 0, 0].real > 0.0).all() == (exact["vv"] > 0.0).all()


def test_kept_hits_hold_the_power_of_all_in_each_cell_of_instance_and_range(world) -> None:
    state, radar = world.at(0.4), ss.RadarSpec.preset("awr1843boost")
    everything, kept = (
        ss.solve_paths(state, radar, MOUNT, "raycast", num_rays=40_000, hits_per_cell=count) for count in (None, 4)
    )
    cells = {}
    for paths in (everything, kept):
        distance = np.linalg.norm(paths.tx_point - MOUNT.pose.position, axis=1)
        # Cells are half a range bin deep: sixty of them are thirty bins.
        key = paths.instance[:, 0] * 1000 + (distance / (30.0 * radar.range_resolution)).astype(int)
        local = MOUNT.pose.inverse().apply(paths.tx_point) / distance[:, None]
        gain_db = radar.array.pattern.gain_db(np.arctan2(local[:, 1], local[:, 0]), np.arcsin(local[:, 2]))
        received = np.abs(paths.a[:, 0, 0]) ** 2 * 10.0 ** (gain_db / 5.0)
        cells[paths is kept] = np.bincount(key, received, minlength=6000)
    assert kept.num_paths < 0.8 * everything.num_paths
    # The received power of every cell is kept to the rounding of sums of some thousand terms.
    assert cells[True] == pytest.approx(cells[False], rel=1e-10)


def test_kernels_stay_the_same_for_other_radars_states_and_numbers_of_rays(world) -> None:
    first = ss.RadarSpec.preset("awr1843boost")
    other = first.with_(start_frequency=78e9, azimuth_fov_deg=60.0, elevation_fov_deg=10.0)
    ss.solve_paths(world.at(0.0), first, MOUNT, "raycast", num_rays=5_000)
    with kernels() as found:
        ss.solve_paths(world.at(0.0), first, MOUNT, "raycast", num_rays=5_000)
        known = found(30)
        ss.solve_paths(world.at(0.3), other, Pose([1.0, 0.0, 0.0]), "raycast", num_rays=7_001, rcs_model="per_hit")
        ss.solve_paths(world.at(0.2), first, MOUNT, "raycast", num_rays=999, hits_per_cell=None, max_distance=40.0)
        assert found(30) == known and len(known) >= 2
