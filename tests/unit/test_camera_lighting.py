"""Lighting as a specification, and what it changes in the optical twin and what not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar.camera import render_radiance
from scarl_sionna.core.errors import MaterialError, ParameterRangeError, SceneError, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import LIGHTING_PRESETS, Lighting
from scarl_sionna.engine.light.lamps import low_beam
from scarl_sionna.engine.light.sky import twilight_factor
from scarl_sionna.engine.load import load_scene
from tests.scenes import Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # what it leaves behind would stay in the worker

SPEC = CameraSpec(width=32, height=18, horizontal_fov_deg=60.0, samples_per_pixel=64, denoise=False)
PRINCIPLED = (
    '<bsdf type="twosided" id="grey"><bsdf type="principled"><rgb name="base_color" value="0.4 0.4 0.4"/>'
    '<float name="roughness" value="0.9"/><float name="specular" value="0.2"/></bsdf></bsdf>'
)


@pytest.fixture
def road(tmp_path: Path) -> Path:
    """Return a scene of a principled, wettable road and a car."""
    car = Thing("car", box((4.0, 1.8, 1.5), (12.0, 0.0, 0.75)), "Car", "steel")
    path = write_scene(tmp_path, [Thing("road", plane(200.0, 200.0), "Roads"), car])
    text = path.read_text()
    start = text.index('<bsdf type="twosided" id="grey">')
    stop = text.index("</bsdf></bsdf>", start) + len("</bsdf></bsdf>")
    path.write_text(text[:start] + PRINCIPLED + text[stop:])
    toml = tmp_path / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.grey]", "[materials.grey]\nwets = 1.0"))
    return path


@pytest.mark.parametrize("name", LIGHTING_PRESETS)
def test_presets_are_valid_and_go_through_a_file(name: str) -> None:
    lighting = Lighting.preset(name)
    assert Lighting(**lighting.model_dump(mode="json")) == lighting


def test_an_unknown_preset_is_refused(road: Path) -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'night'"):
        load_scene(road).with_lighting("nigth")


@pytest.mark.parametrize(
    "bad",
    [
        {"turbidity": 0.5},
        {"cloud_cover": 1.2},
        {"wetness": -0.1},
        {"visibility": 0.0},
        {"sun_elevation_deg": 95.0},
        {"exposure": 0.0},
        {"moon": True},
    ],
)
def test_bad_lightings_are_refused(bad: dict) -> None:
    with pytest.raises(ParameterRangeError, match=next(iter(bad))):
        Lighting(**bad)


def test_the_geometry_is_the_same_under_every_light(road: Path) -> None:
    world = load_scene(road)
    rain = world.with_lighting("rain")
    assert world.lighting is None and rain.lighting == Lighting.preset("rain")
    rays = np.random.default_rng(0).normal(size=(500, 3)) * [1.0, 1.0, 0.2]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    dry_hits, wet_hits = (w.at(0.0).cast([0.0, 0.0, 1.0], rays) for w in (world, rain))
    assert np.array_equal(dry_hits.distance, wet_hits.distance) and np.array_equal(dry_hits.part, wet_hits.part)
    assert rain.parts is world.parts and rain.instances is world.instances


def test_a_scene_states_its_own_lighting(road: Path) -> None:
    toml = road.parent / "scene.toml"
    toml.write_text(toml.read_text() + '\n[lighting]\npreset = "dusk"\nturbidity = 5.0\n')
    assert load_scene(road).lighting == Lighting.preset("dusk").with_(turbidity=5.0)
    toml.write_text(toml.read_text().replace("turbidity = 5.0", "turbidity = 50.0"))
    with pytest.raises(ParameterRangeError, match="turbidity"):
        load_scene(road)


def render(world, pose: Pose) -> np.ndarray:
    return render_radiance(world.at(0.0), SPEC, pose, np.random.default_rng(0)).astype(float)


def test_water_darkens_from_above_and_mirrors_at_grazing(road: Path) -> None:
    light = Lighting(cloud_cover=1.0)
    dry, wet = (load_scene(road).with_lighting(light.with_(wetness=amount)) for amount in (0.0, 1.0))
    down = Pose.from_euler([-20.0, 30.0, 3.0], pitch=np.pi / 2)
    ratio = render(wet, down).mean() / render(dry, down).mean()
    # Lekner and Dorf: half the diffuse light; the film's own reflection (2 % of the sky's zenith) and the dry sheen
    # differ
    assert 0.48 < ratio < 0.62
    grazing = Pose.from_euler([-20.0, 30.0, 0.5], yaw=np.pi / 2)
    lower = slice(10, 12)  # 2 to 6 deg below the horizon
    share_dry, share_wet = (render(w, grazing)[lower].mean() / render(w, down).mean() for w in (dry, wet))
    assert share_wet > 1.3 * share_dry


def test_half_the_wetness_is_between(road: Path) -> None:
    light = Lighting(cloud_cover=1.0)
    down = Pose.from_euler([-20.0, 30.0, 3.0], pitch=np.pi / 2)
    values = [render(load_scene(road).with_lighting(light.with_(wetness=w)), down).mean() for w in (0.0, 0.5, 1.0)]
    assert values[0] > values[1] > values[2]


def test_wrong_tables_of_materials_are_refused(road: Path) -> None:
    toml = road.parent / "scene.toml"
    good = toml.read_text()
    for line, error, message in (
        ("wets = 2.0", MaterialError, "wets = 2.0"),
        ('lamp = "torch"', UnknownNameError, "torch"),
        ('puddles = "none.png"', SceneError, "none.png"),
    ):
        toml.write_text(good.replace("wets = 1.0", line))
        with pytest.raises(error, match=message):
            load_scene(road)


def test_twilight_falls_monotonically_to_nothing() -> None:
    heights = np.linspace(5.0, -20.0, 200)
    factors = np.array([twilight_factor(float(h)) for h in heights])
    assert (np.diff(factors) <= 0.0).all() and factors[0] == 1.0 and factors[-1] == 0.0
    assert twilight_factor(-6.0) == pytest.approx(3.4 / 700.0)  # end of civil twilight: 3.4 lx


def test_a_low_beam_keeps_the_limits_of_its_regulation() -> None:
    """UN Regulation 112, class B: B50L at most 350 cd, 75R at least 10,100 cd, 50L at most 13,200 cd, at 25 m."""

    def at(h: float, v: float) -> float:
        return float(low_beam(np.array(h), np.array(v)))

    assert at(-3.43, 0.57) < 350.0
    assert at(1.15, -0.57) > 10_100.0
    assert at(-3.43, -0.86) < 13_200.0


def test_night_is_dark_without_lamps(road: Path) -> None:
    night = load_scene(road).with_lighting(Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.0))
    assert render(night, Pose([0.0, 0.0, 1.5])).max() == 0.0
