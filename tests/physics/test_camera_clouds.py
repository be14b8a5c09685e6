"""Light through clouds: Kasten and Czeplak's laws, no cliff before the overcast sky, a sunset that is not black."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar.camera import render_radiance
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.light import sky
from scarl_sionna.engine.light.clouds import through_clouds
from scarl_sionna.engine.load import load_scene
from tests.scenes import Thing, plane, write_scene

pytestmark = pytest.mark.own_process  # a shared process held other worlds, and kernels hold how many there are

COVERS = np.linspace(0.0, 1.0, 101)


@pytest.fixture
def small_sky(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sky, "SKY_SIZE", (96, 192))


def ground_light(lighting: Lighting) -> tuple[float, float]:
    """Return the illuminance of level ground by the sky's map and by the sun [lx]."""
    with variant.optical() as mi:
        clear, sun = sky.clear_sky(mi, lighting)
    image = sky.sky_image(lighting, clear, sun).astype(float)
    share = sky.clouded_light(lighting, clear, sun).sun_share
    normal = float(sky.LUMINANCE_WEIGHTS @ sun) * sky.UNIT_LUMINANCE
    return sky.level_illuminance(image), share * normal * sky.sun_direction(lighting)[2]


def test_the_laws_of_kasten_and_czeplak() -> None:
    """With their own clear and overcast sky: G = 1 - 0.75 N^3.4, D / G = 0.3 + 0.7 N^2 (Solar Energy 24, 1980)."""
    for cover in COVERS.tolist():
        light = through_clouds(cover, sky=300.0, sun=700.0, overcast=250.0)
        total = 1000.0 * (1.0 - 0.75 * cover**3.4)
        diffuse = total * (0.3 + 0.7 * cover**2)
        assert light.sky == pytest.approx(diffuse, rel=1e-12)
        assert light.sun_share == pytest.approx((total - diffuse) / 700.0, abs=1e-12)


@pytest.mark.parametrize("elevation", [55.0, 0.5, -4.0])
@pytest.mark.usefixtures("small_sky")
def test_more_clouds_mean_less_light_and_no_cliff(elevation: float) -> None:
    base = Lighting(sun_elevation_deg=elevation, night_sky_luminance=0.0)
    lights = np.array([ground_light(base.with_(cloud_cover=float(cover))) for cover in COVERS[::5]])
    fine = np.array([ground_light(base.with_(cloud_cover=float(cover))) for cover in COVERS[90:]])
    for steps in (lights, fine):
        assert (np.diff(steps.sum(axis=1)) < 0.0).all() and (np.diff(steps[:, 1]) <= 0.0).all()
    # the law's own slope at its end, 3.4 (G0 / G1 - 1), is 0.63 dB a step for the sun 55 deg high; it was 7.5 dB
    assert np.abs(np.diff(10.0 * np.log10(fine.sum(axis=1)))).max() < 0.7
    assert lights[-1, 1] == pytest.approx(0.0, abs=1e-6)
    assert lights[-1, 0] == pytest.approx(sky.overcast_illuminance(base.with_(cloud_cover=1.0)), rel=1e-2)


@pytest.mark.usefixtures("small_sky")
def test_the_look_of_the_sky_closes_evenly() -> None:
    """The last gap closes without a jump: the map at 0.999 is that of the overcast sky, but for its brightness."""
    base = Lighting(sun_elevation_deg=38.0, night_sky_luminance=0.0)
    with variant.optical() as mi:
        clear, sun = sky.clear_sky(mi, base)
    almost, full = (sky.sky_image(base.with_(cloud_cover=cover), clear, sun)[:48, :, 1] for cover in (0.999, 1.0))
    # a share of 0.005 of the map is still that of broken clouds, at the horizon up to ten times as bright
    np.testing.assert_allclose(almost / almost.mean(), full / full.mean(), rtol=0.06)


@pytest.mark.usefixtures("small_sky")
def test_the_clear_sky_of_sunset_is_not_black() -> None:
    heights = np.array([1.5, 1.0, 0.75, 0.5, 0.25, 0.1, 0.0, -0.1, -0.4, -0.8])
    light = np.array(
        [sum(ground_light(Lighting(sun_elevation_deg=float(h), night_sky_luminance=0.0))) for h in heights]
    )
    assert light[heights == 0.0] == pytest.approx(700.0, rel=1e-6)  # Explanatory Supplement, 9.3
    assert light[-1] == pytest.approx(450.0, rel=1e-6)
    fall = -10.0 * np.diff(np.log10(light)) / -np.diff(heights)  # [dB / deg]
    assert (fall > 0.0).all() and (fall < 12.0).all()


def test_a_card_under_broken_clouds_has_the_light_that_they_let_through(tmp_path: Path) -> None:
    path = write_scene(tmp_path, [Thing("card", plane(4000.0, 4000.0), "Roads", "grey")])
    lighting = Lighting(cloud_cover=0.7, night_sky_luminance=0.0)
    spec = CameraSpec(width=32, height=18, horizontal_fov_deg=60.0, samples_per_pixel=256, denoise=False)
    down = Pose.from_euler([0, 0, 2.0], pitch=np.pi / 2)
    state = load_scene(path).with_lighting(lighting).at(0.0)
    image = render_radiance(state, spec, down, np.random.default_rng(1)).astype(float)
    seen = image.mean(axis=(0, 1)) @ sky.LUMINANCE_WEIGHTS * sky.UNIT_LUMINANCE
    with variant.optical() as mi:
        clear, sun = sky.clear_sky(mi, lighting)
    share = sky.clouded_light(lighting, clear, sun)
    assert 0.3 < share.sun_share < 0.5
    # 150,000 paths, 0.3 % at 5 sigma; the look-up in the map 0.3 %
    assert seen == pytest.approx(sum(ground_light(lighting)) * 0.5 / np.pi, rel=6e-3)
