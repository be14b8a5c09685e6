"""Light through the camera chain against closed forms: furnaces, sky, haze, lamps, motion blur."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from camera_lidar.camera import render_radiance
from camera_lidar.camera.projection import pixel_rays
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.light.lamps import low_beam
from scarl_sionna.engine.light.sky import UNIT_LUMINANCE, sky_directions, sky_image
from scarl_sionna.engine.load import load_scene
from tests.scenes import Light, Material, Thing, ball, box, plane, write_scene

SPEC = CameraSpec(width=48, height=27, horizontal_fov_deg=60.0, samples_per_pixel=64, denoise=False, images=("rgb",))
FAR = Thing("far", plane(1.0, 1.0, (0.0, 0.0, -300.0)))


def radiance(path: Path, spec: CameraSpec, pose: Pose | None = None, lighting: Lighting | None = None) -> np.ndarray:
    world = load_scene(path)
    world = world.with_lighting(lighting) if lighting else world
    return render_radiance(world.at(0.0), spec, pose or Pose(), np.random.default_rng(1)).astype(float)


def test_white_furnace(tmp_path: Path) -> None:
    """A white diffuse ball under a sky of radiance 1 cannot be told from the sky, whatever the number of bounces."""
    things = [Thing("ball", ball(1.0, (4.0, 0.0, 0.0), 5), material="snow")]
    path = write_scene(tmp_path, things, materials={"snow": Material((1.0, 1.0, 1.0))}, light=Light("constant", 1.0))
    image = radiance(path, SPEC.with_(samples_per_pixel=256))
    # light and BSDF samples, weighted (balance heuristic): a variance below 1 a path; 5 sigma of 256 and of 1296 * 256
    # paths
    assert np.abs(image - 1.0).max() < 5.0 / np.sqrt(256)
    assert abs(image.mean() - 1.0) < 5.0 / np.sqrt(image[..., 0].size * 256)
    assert image.std() > 0.0  # it is a ball, not the sky


@pytest.mark.parametrize("max_depth", [1, 2, 6])
def test_furnace_with_known_reflectance(tmp_path: Path, max_depth: int) -> None:
    """Inside a glowing box of reflectance rho the radiance is the sum of rho^k over the segments of the light path."""
    room = box((6.0, 4.0, 3.0))
    room.invert()  # area lights shine to their front
    rho = np.array([0.5, 0.4, 0.2])
    path = write_scene(
        tmp_path,
        [Thing("room", room, material="half", emission=1.0)],
        materials={"half": Material(tuple(rho.tolist()))},
        light=Light("constant", 0.0),
    )
    image = radiance(path, SPEC.with_(max_depth=max_depth, samples_per_pixel=256))
    expected = sum(rho**k for k in range(max_depth))
    # a bounce's variance stays below its mean squared; 5 sigma of 1296 * 256 paths
    np.testing.assert_allclose(image.mean(axis=(0, 1)), expected, rtol=5.0 / np.sqrt(1296 * 256))


def test_known_reflectances_in_overcast_light(tmp_path: Path) -> None:
    """A level card under the CIE overcast sky sends out reflectance times illuminance over pi."""
    colors = (0.18, 0.5, 0.9)
    path = write_scene(
        tmp_path, [Thing("card", plane(4000.0, 4000.0), "Roads", "card")], materials={"card": Material(colors)}
    )
    lighting = Lighting(cloud_cover=1.0, sun_elevation_deg=40.0, night_sky_luminance=0.0)
    image = radiance(path, SPEC.with_(samples_per_pixel=256), Pose.from_euler([0, 0, 2.0], pitch=np.pi / 2), lighting)
    sky = sky_image(lighting, np.zeros((*sky_directions().shape[:2], 3)), np.zeros(3)).astype(float)
    directions = sky_directions()
    rows, columns = directions.shape[:2]
    polar = (np.arange(rows) + 0.5) / rows * np.pi
    weight = (np.sin(polar) * np.maximum(np.cos(polar), 0.0))[:, None, None] * (np.pi / rows) * (2.0 * np.pi / columns)
    illuminance = (sky * weight).sum(axis=(0, 1))
    # stratified, a pixel of 256 paths scatters by 0.2 %: 5 sigma of 1296 is 0.03 %; the map's look-up 0.1 %
    np.testing.assert_allclose(image.mean(axis=(0, 1)), colors * illuminance / np.pi, rtol=3e-3)
    luminous = illuminance @ [0.2126, 0.7152, 0.0722] * UNIT_LUMINANCE
    assert luminous == pytest.approx(
        300.0 + 21e3 * np.sin(np.radians(40.0)), rel=1e-3
    )  # IES RP-21; sum over 0.23 deg cells


def test_the_environment_map_is_mitsubas_sky_pixel_for_pixel(tmp_path: Path) -> None:
    """Turned about any axis or mirrored, the map would differ: the view is beside the sun, low over the horizon."""
    lighting = Lighting(sun_elevation_deg=25.0, sun_azimuth_deg=70.0, night_sky_luminance=0.0)
    pose = Pose.from_euler([0.0, 0.0, 2.0], yaw=np.radians(100.0), pitch=np.radians(-30.0))
    path = write_scene(tmp_path, [FAR])
    own, mapped = (
        radiance(path, SPEC.with_(horizontal_fov_deg=50.0), pose, lighting.with_(cloud_cover=cover))
        for cover in (0.0, 1e-9)
    )
    assert np.ptp(own[..., 1]) > 0.5 * own[..., 1].mean()
    # bilinear look-up in cells of 0.23 deg: second-order, below 0.1 % of this smooth sky
    np.testing.assert_allclose(mapped, own, rtol=5e-3)


def test_clear_sky_with_and_without_environment_map_agree(tmp_path: Path) -> None:
    """The map and the directional sun stand for Mitsuba's own sun and sky: a grey card is as bright under both."""
    path = write_scene(tmp_path, [Thing("card", plane(4000.0, 4000.0), "Roads", "grey")])
    down = Pose.from_euler([0, 0, 2.0], pitch=np.pi / 2)
    own, mapped = (
        radiance(path, SPEC.with_(samples_per_pixel=64), down, Lighting(cloud_cover=cover, night_sky_luminance=0.0))
        for cover in (0.0, 1e-9)
    )
    # stratified, a pixel of 64 paths scatters by 1 %: 5 sigma of 1296 is 0.14 %; the map's cells, the sun's limb: 1 %
    np.testing.assert_allclose(mapped.mean(axis=(0, 1)), own.mean(axis=(0, 1)), rtol=0.015)


def test_haze_fades_by_its_law(tmp_path: Path) -> None:
    wall = Thing("wall", plane(4000.0, 4000.0, (200.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), emission=3.0, material="black")
    path = write_scene(tmp_path, [wall], materials={"black": Material((0.0, 0.0, 0.0))})
    lighting = Lighting(cloud_cover=1.0, visibility=600.0)
    world = load_scene(path).with_lighting(lighting)
    state = world.at(0.0)
    image = render_radiance(state, SPEC.with_(samples_per_pixel=16), Pose(), np.random.default_rng(0)).astype(float)
    row, column = SPEC.height // 2, SPEC.width // 2
    ray = pixel_rays(SPEC).reshape(SPEC.height, SPEC.width, 3)[row, column]
    kept = np.exp(-3.0 * 200.0 / ray[0] / 600.0)
    expected = kept * 3.0 + (1.0 - kept) * state.airlight
    # the distance changes by 1e-4 over the middle pixel; float32
    np.testing.assert_allclose(image[row, column], expected, rtol=1e-3)
    assert (state.airlight > 0.02).all()
    clear = render_radiance(
        load_scene(path).with_lighting(lighting.with_(visibility=None)).at(0.0), SPEC, Pose(), np.random.default_rng(0)
    )
    np.testing.assert_allclose(clear[row, column], 3.0, rtol=1e-5)


def lamp_scene(folder: Path, kind: str, lamp: Thing, others: list[Thing], **actors: list[Thing]) -> Path:
    path = write_scene(
        folder, [*others, *([] if actors else [lamp])], materials={"lens": Material((0.0, 0.0, 0.0))}, **actors
    )
    toml = folder / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.lens]", f'[materials.lens]\nlamp = "{kind}"'))
    return path


def test_a_wall_in_the_low_beam_has_its_illuminance(tmp_path: Path) -> None:
    """Two lamps 1.2 m apart on a car at 3 m/s: the beams hang on the car, and E = I cos / d^2 adds up."""
    lens = box((0.02, 0.1, 0.1))
    pair = lens.copy()
    pair.apply_translation((0.0, 0.6, 0.7))
    lens.apply_translation((0.0, -0.6, 0.7))
    both = pair + lens
    moving = {"kind": "constant_twist", "position": (-3.0, 0.0, 0.0), "velocity": (3.0, 0.0, 0.0)}
    car = Thing("car", both, "Car", "lens", trajectory=moving)
    wall = Thing("wall", plane(60.0, 30.0, (12.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "Wall")
    path = lamp_scene(tmp_path, "headlamp", car, [wall], actors=[car])
    night = Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.0, headlamps=True)
    state = load_scene(path).with_lighting(night).at(1.0)  # the car's origin is at x = 0 now
    spec = SPEC.with_(width=112, height=42, max_depth=2, samples_per_pixel=256)
    pose = Pose([3.0, 0.0, 0.7])
    image = render_radiance(state, spec, pose, np.random.default_rng(0)).astype(float)
    rays = pixel_rays(spec).reshape(spec.height, spec.width, 3)
    point = pose.position + rays * (9.0 / rays[..., :1])
    expected = np.zeros(point.shape[:2])
    for side in (0.6, -0.6):
        way = point - [0.03, side, 0.7]
        distance = np.linalg.norm(way, axis=-1)
        azimuth, elevation = (
            np.degrees(np.arctan2(-way[..., 1], way[..., 0])),
            np.degrees(np.arcsin(way[..., 2] / distance)),
        )
        glow = 450.0 * way[..., 0] / distance
        expected += (low_beam(azimuth, elevation) + glow) * way[..., 0] / distance**3
    luminance = image @ [0.2126, 0.7152, 0.0722] * UNIT_LUMINANCE
    shown = luminance * np.pi / 0.5
    # the texture's cells are 0.13 deg wide, and the cut-off falls within 0.3 deg: away from it (light above 30 lx) half
    # a cell of the spot's slope is 4 %; the noise of the glowing surfaces (a fifth of the light) at 256 paths adds to
    # that
    bright = expected > 30.0
    assert bright.mean() > 0.1
    assert np.quantile(np.abs(shown[bright] / expected[bright] - 1.0), 0.95) < 0.10
    assert abs(shown[bright].mean() / expected[bright].mean() - 1.0) < 0.06
    above = (point[..., 2] > 0.75) & (point[..., 2] < 0.85)  # 0.2 to 0.7 deg up
    right, left = above & (np.abs(point[..., 1] + 2.2) < 0.5), above & (np.abs(point[..., 1] - 2.2) < 0.5)
    assert shown[right].mean() > 3.0 * shown[left].mean()  # the cut-off rises on the right: right-hand traffic


def test_a_street_lamp_lights_by_its_flux(tmp_path: Path) -> None:
    lamp = Thing("lamp", plane(0.5, 0.5, (0.0, 0.0, 8.0), (0.0, 0.0, -1.0)), "Pole", "lens")
    path = lamp_scene(tmp_path, "street_lamp", lamp, [Thing("road", plane(100.0, 100.0), "Roads")])
    night = Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.0, street_lamps=True)
    spec = SPEC.with_(max_depth=2, horizontal_fov_deg=4.0, samples_per_pixel=64)
    image = radiance(path, spec, Pose.from_euler([0.0, 0.0, 7.0], pitch=np.pi / 2), night)
    luminance = image.mean(axis=(0, 1)) @ [0.2126, 0.7152, 0.0722] * UNIT_LUMINANCE
    # a Lambertian lamp of 9000 lm: I = flux / pi below it, E = I / 64 at its foot; finite size and field: 1 %
    assert luminance == pytest.approx(9000.0 / np.pi / 64.0 * 0.5 / np.pi, rel=0.02)
    dark = radiance(path, spec, Pose.from_euler([0.0, 0.0, 7.0], pitch=np.pi / 2), night.with_(street_lamps=False))
    assert dark.max() == 0.0


def test_length_of_motion_blur(tmp_path: Path) -> None:
    """A shining strip that crosses the view smears over focal length * speed * time / distance pixels."""
    speed, exposure, distance, width = 6.0, 0.05, 10.0, 0.3
    strip = Thing(
        "strip",
        plane(4.0, width, normal=(-1.0, 0.0, 0.0)),
        "Car",
        emission=1.0,
        trajectory={"kind": "constant_twist", "position": (distance, 0.0, 0.0), "velocity": (0.0, speed, 0.0)},
    )
    if np.ptp(strip.mesh.vertices[:, 1]) > 1.0:  # upright
        strip.mesh.apply_transform(np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]]))
    path = write_scene(tmp_path, [FAR], [strip], light=Light("constant", 0.0))
    spec = SPEC.with_(width=320, height=9, horizontal_fov_deg=30.0, num_shutter_times=32, samples_per_pixel=128)
    state = load_scene(path).at(0.0)
    row = {
        time: render_radiance(state, spec.with_(exposure_time=time), Pose(), np.random.default_rng(0))[4, :, 0].astype(
            float
        )
        for time in (0.0, exposure)
    }
    focal = spec.intrinsics[0, 0]
    smear, own = focal * speed * exposure / distance, focal * width / distance
    columns = np.arange(spec.width) + 0.5

    def moments(values: np.ndarray) -> tuple[float, float, float]:
        mean = (values * columns).sum() / values.sum()
        return values.sum(), mean, ((columns - mean) ** 2 * values).sum() / values.sum()

    sharp, blurred = moments(row[0.0]), moments(row[exposure])
    assert sharp[0] == pytest.approx(own, abs=0.1)
    assert blurred[0] == pytest.approx(own, abs=0.1)  # light is only spread
    assert blurred[1] == pytest.approx(160.0, abs=0.1)  # about the frame's time
    # convolution of two boxes; 32 instants: smear^2 (1 - 1/32^2) / 12, a pixel's own width is in both
    assert blurred[2] - sharp[2] == pytest.approx(smear**2 / 12.0 * (1.0 - 1.0 / 32**2), rel=0.01)


def test_blur_of_a_moving_camera(tmp_path: Path) -> None:
    strip = Thing("strip", box((0.01, 0.2, 4.0), (10.0, 0.0, 0.0)), "Car", emission=1.0)
    state = load_scene(write_scene(tmp_path, [FAR, strip], light=Light("constant", 0.0))).at(0.0)
    spec = SPEC.with_(
        width=320, height=9, horizontal_fov_deg=30.0, num_shutter_times=16, exposure_time=0.02, samples_per_pixel=64
    )
    turning = render_radiance(state, spec, Pose(), np.random.default_rng(0), Twist(angular=[0.0, 0.0, 2.0]))[4, :, 0]
    lit = np.flatnonzero(turning > 1e-3)
    focal = spec.intrinsics[0, 0]
    # 2 rad/s * 0.02 s * 15/16 between the first and the last instant, and the strip's own width
    assert lit[-1] - lit[0] + 1 == pytest.approx(focal * (0.04 * 15 / 16 + 0.02), abs=2.0)


def test_blur_and_noise_are_off_by_default() -> None:
    spec = CameraSpec()
    assert spec.exposure_time == 0.0 and spec.sensor is None
    assert Camera(spec).spec is spec
