"""Retroreflecting sheets and markings in the lidar, against what their standards define."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Lidar
from camera_lidar.lidar import return_intensity
from scarl_sionna.core.errors import MaterialError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.engine.load import load_scene
from scarl_sionna.scene.materials.wet import WET_BEADS, WET_DARKENING
from tests.scenes import Material, Thing, plane, write_scene

WHITE = 1.0 / np.pi
"""Luminance of a white diffuser for one lux across the beam, hit normally [cd/(lx m2)]."""


def luminance(cosine: float, **surface: float) -> float:
    """Return the luminance of a surface that fills the beam for one lux across the beam [cd/(lx m2)]."""
    return WHITE * float(return_intensity(surface.pop("reflectance", 0.0), cosine, 1.0, 0.0, **surface))


@pytest.mark.parametrize(("entrance_deg", "coefficient"), [(5.0, 250.0), (30.0, 150.0), (40.0, 110.0)])
def test_a_sheet_falls_off_as_its_class_does(entrance_deg: float, coefficient: float) -> None:
    """EN 12899-1, class RA2, white, 0.2 deg: intensity a lux and square metre is luminance times cosine."""
    cosine = np.cos(np.radians(entrance_deg))
    found = luminance(cosine, retroreflection=250.0) * cosine
    assert found == pytest.approx(coefficient, rel=0.1)


def test_a_marking_has_its_luminance_at_30_metres() -> None:
    """EN 1436 at 88.76 deg: R_L is the luminance itself; paint of the same whiteness alone has a tenth of it."""
    cosine = np.cos(np.radians(88.76))
    assert luminance(cosine, retroreflected_luminance=0.15) == pytest.approx(0.15, rel=1e-12)
    assert luminance(cosine, reflectance=0.55) == pytest.approx(0.55 * cosine / np.pi)
    assert luminance(cosine, reflectance=0.55) < 0.015


def street(tmp_path: Path, sheet: str = "250.0", beads: str = "0.15") -> Path:
    things = [
        Thing("sign", plane(2.0, 2.0, (20.0, 0.0, 2.0), (-1.0, 0.0, 0.0)), "TrafficSign", "sheet"),
        Thing("wall", plane(40.0, 40.0, (40.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "Wall", "plain"),
        Thing("line", plane(60.0, 60.0, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "RoadLine", "beads"),
    ]
    materials = {name: Material(lidar_reflectance=0.5) for name in ("sheet", "plain", "beads")}
    path = write_scene(tmp_path, things, materials=materials)
    toml = path.parent / "scene.toml"
    text = toml.read_text()
    text = text.replace("[materials.sheet]", f"[materials.sheet]\nretroreflection = {sheet}")
    text = text.replace("[materials.beads]", f"[materials.beads]\nretroreflected_luminance = {beads}\nwets = 1.0")
    toml.write_text(text)
    return path


def test_a_scan_sees_sheets_and_beads(tmp_path: Path) -> None:
    world = load_scene(street(tmp_path))
    spec = LidarSpec(num_azimuth=101, num_elevation=64, atmospheric_attenuation=0.0)
    pose = Pose([0.0, 0.0, 2.0])
    scan = Lidar(spec).observe(world.at(0.0), pose, np.random.default_rng(0))
    strength = scan.intensity * scan.distance**2
    instances = {entry.name: number for number, entry in world.instances.items()}
    wanted = {
        "sign": 0.5 * scan.cos_incidence + np.pi * 250.0 * scan.cos_incidence**2,
        "wall": 0.5 * scan.cos_incidence,
        "line": 0.5 * scan.cos_incidence + np.pi * 0.15,
    }
    for name, expected in wanted.items():
        rows = scan.instance == instances[name]
        assert rows.sum() > 20
        np.testing.assert_allclose(strength[rows], expected[rows], rtol=1e-4)
    wet = Lidar(spec).observe(world.with_weather(Weather(wetness=1.0)).at(0.0), pose, np.random.default_rng(0))
    rows = wet.instance == instances["line"]
    left = (wet.intensity * wet.distance**2)[rows] - np.pi * 0.15 * WET_BEADS
    assert (left > 0.0).all() and (left < 0.5 * WET_DARKENING * wet.cos_incidence[rows] * 1.001).all()
    rows = wet.instance == instances["sign"]
    np.testing.assert_allclose((wet.intensity * wet.distance**2)[rows], wanted["sign"][rows], rtol=1e-4)


def test_plates_of_the_ready_scenes_are_brighter_than_their_cars() -> None:
    parts = load_scene("highway_guardrail").parts
    plates = np.array(["plate" in name and "letter" not in name for name in parts.name])
    assert plates.any() and (parts.retroreflection[plates] == 45.0).all()
    assert (parts.retroreflected_luminance[[name.startswith("marking") for name in parts.name]] == 0.15).all()
    assert (parts.retroreflection > 0.0).sum() < 0.2 * len(parts.name)


@pytest.mark.parametrize(("sheet", "beads"), [("-1.0", "0.1"), ("250.0", "6e3")])
def test_wrong_values_are_named_with_their_unit(tmp_path: Path, sheet: str, beads: str) -> None:
    with pytest.raises(MaterialError, match=r"retroreflect.* cd/\(lx m2\) is not within 0 to 5000"):
        load_scene(street(tmp_path, sheet, beads))
