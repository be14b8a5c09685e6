"""Sheets and beads before the camera at night: what their standards define, by the lamp that stands near the eye."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar.camera import render
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.engine import variant
from scarl_sionna.engine.light import many_lamps
from scarl_sionna.engine.light.retroreflectors import beads_law, observation_angle, sheet_law
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from scarl_sionna.scene.materials.wet import WET_BEADS
from tests.scenes import Material, Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process  # a shared process held other worlds, and kernels hold how many there are

SPEC = CameraSpec(width=4, height=4, horizontal_fov_deg=1.0, samples_per_pixel=16, denoise=False, images=("rgb",))
NIGHT = Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.0, street_lamps=True, headlamps=True)
EYE, LAMP, SIGN = np.array([0.0, 0.0, 1.3]), np.array([-0.97, 0.6, 0.7]), np.array([30.0, 0.0, 0.3])
WHITE = (0.8, 0.8, 0.8)


def world(
    folder: Path, entry: str, color: tuple[float, float, float] = WHITE, street_lamps: int = 0, normal: float = -1.0
) -> World:
    """Return two head lamps below a camera, and a wall before them that has `entry` in its material."""
    across = np.array([normal, 0.0, np.sqrt(1.0 - normal**2)])
    things = [
        Thing("sign", plane(3.0, 3.0, SIGN.tolist(), across.tolist()), "TrafficSign", "sheet"),
        *(Thing(f"lamp{y}", box((0.02, 0.1, 0.1), (-1.0, y * 0.6, 0.7)), "Static", "head") for y in (-1, 1)),
        *(
            Thing(f"post{k}", plane(0.5, 0.3, (18.0 + 0.8 * k, 6.0 - k, 7.0), (0.0, 0.0, -1.0)), "Pole", "lens")
            for k in range(street_lamps)
        ),
    ]
    black = Material((0.0, 0.0, 0.0))
    path = write_scene(folder, things, materials={"sheet": Material(color), "head": black, "lens": black})
    toml = folder / "scene.toml"
    text = toml.read_text().replace("[materials.sheet]", f"[materials.sheet]\n{entry}")
    text = text.replace("[materials.head]", '[materials.head]\nlamp = "headlamp"')
    toml.write_text(text.replace("[materials.lens]", '[materials.lens]\nlamp = "street_lamp"'))
    return load_scene(path).with_lighting(NIGHT)


def radiance(of: World, samples: int = 64, seed: int = 1) -> np.ndarray:
    """Return what the camera sees of the middle of the wall, linear RGB."""
    forward = (SIGN - EYE) / np.linalg.norm(SIGN - EYE)
    pitch = Pose.from_euler(EYE, pitch=float(np.arcsin(-forward[2])))
    return render._trace(of.at(0.0), render._View(SPEC, pitch, seed, samples)).mean(axis=(0, 1))


def angle_deg() -> float:
    """Return the angle between a head lamp and the eye, seen from the wall."""
    lamp, eye = LAMP - SIGN, EYE - SIGN
    return float(np.degrees(np.arccos(lamp @ eye / np.linalg.norm(lamp) / np.linalg.norm(eye))))


def test_the_laws_go_through_what_the_standards_state() -> None:
    with variant.optical() as mi:
        sheet = np.array(sheet_law(mi, mi.Float([0.2, 0.33, 2.0])))
        beads = np.array(beads_law(mi, mi.Float([1.05, 0.5, 15.0])))
        away = mi.Vector3f(1.0, 0.0, 0.0), mi.Vector3f(1.0 - 4.5e-6, 3e-3, 0.0)
        small = float(observation_angle(mi, *away)[0])
    np.testing.assert_allclose(sheet * 250.0, [250.0, 180.0, 5.0], rtol=0.01)  # EN 12899-1, class RA2
    assert beads[0] == pytest.approx(1.0, rel=1e-6) and beads[1] == pytest.approx(1.0, abs=0.05) and beads[2] < 2e-4
    assert small == pytest.approx(np.degrees(3e-3), rel=1e-4)


@pytest.mark.parametrize("normal", [-1.0, -0.7])
def test_a_sheet_shines_by_its_coefficient(tmp_path: Path, normal: float) -> None:
    """Beside the same wall without the sheet, whose luminance is albedo / pi times the light across it."""
    plain, sheet = (
        radiance(world(tmp_path / name, entry, normal=normal))
        for name, entry in (("plain", ""), ("sheet", "retroreflection = 250"))
    )
    lamp = (LAMP - SIGN) / np.linalg.norm(LAMP - SIGN)
    cosine = lamp @ [normal, 0.0, np.sqrt(1.0 - normal**2)]
    law = np.exp((0.2**0.88 - angle_deg() ** 0.88) / 0.409)
    np.testing.assert_allclose(sheet / plain, 1.0 + np.pi * 250.0 * law * cosine / 0.8, rtol=0.01)
    assert sheet[0] / plain[0] > 10.0


def test_colours_and_water_take_their_part(tmp_path: Path) -> None:
    plain = radiance(world(tmp_path / "plain", ""))
    red = radiance(world(tmp_path / "red", "retroreflection = 250", (0.4, 0.04, 0.02)))
    white = radiance(world(tmp_path / "white", "retroreflection = 250"))
    np.testing.assert_allclose(red / white, np.array([0.4, 0.04, 0.02]) / 0.8, rtol=0.01)
    beads = world(tmp_path / "beads", "retroreflected_luminance = 0.15\nwets = 0.0")
    law = np.exp((1.05**2 - angle_deg() ** 2) / 25.0)
    cosine = (LAMP - SIGN)[0] / -np.linalg.norm(LAMP - SIGN)
    dry = radiance(beads) / plain - 1.0
    np.testing.assert_allclose(dry, np.pi * 0.15 * law / (0.8 * cosine), rtol=0.02)
    beads = world(tmp_path / "wet", "retroreflected_luminance = 0.15\nwets = 1.0")
    wet = beads.with_weather(Weather(wetness=1.0))
    assert (wet.parts.retroreflected_luminance.max()) == pytest.approx(0.15 * WET_BEADS)


def test_the_choice_of_a_lamp_keeps_the_mean(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Street lamps light the sheet more than the head lamps do; both ways to choose have one mean, ours less noise."""
    street = world(tmp_path, "retroreflection = 250", street_lamps=12)
    ours = np.array([radiance(street, 16, seed) for seed in range(12)])
    with variant.optical() as mi:
        plugin = many_lamps._plugin(mi, mi.variant())
    monkeypatch.setattr(plugin, "_sent_back", lambda self, *_: self._modules[0].Float(1.0))
    theirs = np.array([radiance(street, 16, seed) for seed in range(20, 32)])
    error = np.sqrt((ours.var(axis=0, ddof=1) + theirs.var(axis=0, ddof=1)) / 12)
    assert (np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) < 5.0 * error).all()
    assert (error < 0.03 * ours.mean(axis=0)).all()
    assert (ours.std(axis=0) < 0.6 * theirs.std(axis=0)).all()
