"""The camera at night: no light is lost or spread, and many lamps are sampled without bias."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar.camera import render, render_radiance
from camera_lidar.camera.energy import keep_energy
from camera_lidar.camera.shining import lamp_light
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine import variant
from scarl_sionna.engine.light import lamp_table as lamp_table_module
from scarl_sionna.engine.light.haze import Haze
from scarl_sionna.engine.light.lamp_table import SURFACE, lamp_table
from scarl_sionna.engine.light.sky import UNIT_LUMINANCE
from scarl_sionna.engine.light.windows import LitWindows
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World, WorldState
from tests.scenes import Material, Thing, box, plane, write_scene

pytestmark = pytest.mark.own_process  # a shared process held other worlds, and kernels hold how many there are

SPEC = CameraSpec(width=64, height=36, horizontal_fov_deg=60.0, samples_per_pixel=16, denoise=False, images=("rgb",))
NIGHT = Lighting(sun_elevation_deg=-40.0, night_sky_luminance=0.01, street_lamps=True, headlamps=True)
POSE = Pose([0.0, 0.0, 1.6])


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> WorldState:
    """Return a street at night: 14 lamps on both sides, a car with its beams, boxes that throw shadows."""
    folder = tmp_path_factory.mktemp("night")
    road = Thing("road", plane(400.0, 60.0, (100.0, 0.0, 0.0)), "Roads", is_object=False)
    lamps = [
        Thing(f"lamp{number}", plane(0.5, 0.3, (-40.0 + 15.0 * number, side, 7.0), (0.0, 0.0, -1.0)), "Pole", "lens")
        for number, side in ((k, 8.0 if k % 2 else -8.0) for k in range(14))
    ]
    things = [Thing(f"box{k}", box((3.0, 2.0, 2.0), (12.0 + 9.0 * k, -4.0 + 4.0 * k, 1.0)), "Car") for k in range(3)]
    front = box((0.02, 0.2, 0.1), (-1.0, 0.6, 0.7)) + box((0.02, 0.2, 0.1), (-1.0, -0.6, 0.7))
    beams = Thing("beams", front, "Car", "head")
    black = Material((0.0, 0.0, 0.0))
    path = write_scene(folder, [road, *lamps, *things, beams], materials={"lens": black, "head": black})
    toml = folder / "scene.toml"
    text = toml.read_text().replace("[materials.lens]", '[materials.lens]\nlamp = "street_lamp"')
    toml.write_text(text.replace("[materials.head]", '[materials.head]\nlamp = "headlamp"'))
    return load_scene(path).with_lighting(NIGHT).at(0.0)


def block_means(image: np.ndarray) -> np.ndarray:
    return image.reshape(4, 9, 8, 8, 3).mean(axis=(1, 3))


def shots(state: WorldState, samples: int, seeds: range) -> np.ndarray:
    """Return images without what shines itself, shape (seeds, height, width, 3)."""
    views = [render._View(SPEC, POSE, seed, samples) for seed in seeds]
    return np.array([render._trace(state, view) - render._shining(state, view, 1.0)[0] for view in views])


def assert_one_mean(ours: np.ndarray, theirs: np.ndarray) -> None:
    mean, error = [], []
    for images in (ours, theirs):
        blocks = np.array([block_means(image) for image in images])
        mean.append(blocks.mean(axis=0))
        error.append(blocks.var(axis=0, ddof=1) / len(blocks))
    # errors from four images each: Student's t with 6 degrees of freedom over 96 blocks, 1e-6 each
    spread = np.sqrt(error[0] + error[1]) + 1e-3 * mean[1].mean()  # and rounding where there is only sky
    assert (np.abs(mean[0] - mean[1]) < 16.0 * spread).all()
    assert mean[0].mean() == pytest.approx(mean[1].mean(), rel=0.01)  # five times the difference's standard error


def noise(images: np.ndarray) -> float:
    """Return the median of pixels' relative standard deviations."""
    return float(np.median(images.std(axis=0, ddof=1) / images.mean(axis=0).clip(1e-9)))


def test_lamps_chosen_by_their_light_are_unbiased(street: WorldState, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = shots(street, 64, range(4))
    monkeypatch.setattr(render, "many_lamps_integrator", lambda *_: None)
    theirs = shots(street, 128, range(10, 14))
    assert_one_mean(ours, theirs)
    assert noise(ours) < 0.6 * noise(theirs)  # with half the samples


def hall(folder: Path, lamp: str) -> Path:
    """Write a hall whose ceiling has tubes of unlike size in one mesh, as car park and tunnel have them."""
    things = [
        Thing("floor", plane(80.0, 10.0, (35.0, 0.0, 0.0)), "Roads", is_object=False),
        Thing("ceiling", plane(80.0, 10.0, (35.0, 0.0, 3.0), (0.0, 0.0, -1.0)), "Building", is_object=False),
        Thing("tubes", sum(TUBES[1:], TUBES[0]), "Pole", "lens"),
        Thing("box", box((3.0, 2.0, 2.0), (12.0, -2.0, 1.0)), "Car"),
    ]
    path = write_scene(folder, things, materials={"lens": Material((0.0, 0.0, 0.0))})
    toml = folder / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.lens]", f'[materials.lens]\nlamp = "{lamp}"'))
    return path


TUBES = [plane(0.3 + 0.1 * (k % 3), 1.2, (6.0 * k, -2.0 + (k % 4), 2.8), (0.0, 0.0, -1.0)) for k in range(12)]


def test_pieces_of_one_mesh_are_lamps_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    state = load_scene(hall(tmp_path, "street_lamp")).with_lighting(NIGHT).at(0.0)
    with variant.optical() as mi:
        table = lamp_table(mi, state.optical_scene())
    assert table is not None
    rows = np.flatnonzero(table.kind == SURFACE)
    assert len(rows) == 12 and len(set(table.emitter[rows])) == 1
    np.testing.assert_allclose(table.center[rows], [np.ptp(t.vertices, 0) / 2 + t.vertices.min(0) for t in TUBES])
    np.testing.assert_allclose(table.first_share[rows], np.cumsum(table.share[rows]) - table.share[rows], atol=1e-12)
    ours = shots(state, 64, range(4))
    monkeypatch.setattr(lamp_table_module, "APART", np.inf)
    theirs = shots(state, 64, range(10, 14))
    assert_one_mean(ours, theirs)
    assert noise(ours) < 0.6 * noise(theirs)


@pytest.mark.slow
def test_rooms_seldom_ask_for_daylight_and_keep_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the car park by day: with the chance of open country nearly all samples end at its ceiling."""
    world = load_scene("parking_garage", detail="light").with_lighting("day")
    state = world.at(2.5)
    pose = state.actor_pose("ego").compose(Pose([0.3, 0.0, 1.62]))
    views = [render._View(SPEC, pose, seed, 64) for seed in range(4)]
    images = []
    for share in (render.DAYLIGHT_INDOORS, 1.0):
        monkeypatch.setattr(render, "DAYLIGHT_INDOORS", share)
        images.append(np.array([render._trace(state, v) - render._shining(state, v, 1.0)[0] for v in views]))
    ours, theirs = images
    means = [shots.mean(axis=(1, 2, 3)) for shots in images]
    spread = np.sqrt(sum(mean.var(ddof=1) / len(mean) for mean in means))
    assert abs(means[0].mean() - means[1].mean()) < 5.0 * spread  # 1 % of the mean each
    assert noise(ours) < 0.5 * noise(theirs)


def test_a_lamp_smaller_than_a_pixel_has_its_light(tmp_path: Path) -> None:
    """The sum over the image is luminance times the lamp's area in pixels; haze dims it by its distance."""
    size, distance = 0.11, 80.0
    lamp = Thing("lamp", plane(size, size, (distance, 1.3, 2.0), (-1.0, 0.0, 0.0)), "Pole", "lens")
    path = write_scene(tmp_path, [lamp], materials={"lens": Material((0.0, 0.0, 0.0))})
    toml = tmp_path / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.lens]", '[materials.lens]\nlamp = "street_lamp"'))
    state = load_scene(path).with_lighting(NIGHT.with_(night_sky_luminance=0.0)).at(0.0)
    area = (SPEC.intrinsics[0, 0] * size / distance) ** 2
    assert area < 0.01  # 16 samples a pixel miss it in most images
    expected = 9000.0 / (np.pi * size * size) / UNIT_LUMINANCE * area
    image = render_radiance(state, SPEC.with_(denoise=True), POSE, np.random.default_rng(0)).astype(float)
    shown = (image @ [0.2126, 0.7152, 0.0722]).sum()
    # 4 or 5 of the 64 rows and columns of rays meet a lamp of 0.076 px: (4 / 4.88)^2 at worst
    assert shown == pytest.approx(expected, rel=0.35)
    with variant.optical() as mi:
        scene = state.optical_scene()
        clear, hazy = (lamp_light(mi, scene, SPEC, POSE, haze) for haze in (None, Haze.of(240.0, np.zeros(3))))
    assert clear is not None and hazy is not None and clear.pixels.sum() <= 9
    np.testing.assert_allclose(hazy.radiance, clear.radiance * np.exp(-3.0 * 80.0 / 240.0), rtol=2e-3)


def test_a_biased_filter_gets_its_energy_back_by_place_and_brightness() -> None:
    """Skewed noise through a mean of logarithms: half of the light is gone, and a bright half spills over the dark."""
    rng = np.random.default_rng(5)
    truth = np.where(np.arange(160) < 80, 1.0, 30.0)[None, :, None] * np.ones((96, 1, 3))
    traced = truth * rng.gamma(0.5, 2.0, (96, 160, 1))
    filtered = truth * 0.5 + 0.3
    repaired = keep_energy(filtered, traced)
    # gamma of shape 0.5 has variance 2: 7680 pixels, 5 sigma is 8 %; both halves within their own noise, 2 % apart
    for half in (np.s_[:, :80], np.s_[:, 80:]):
        assert repaired[half].sum() == pytest.approx(traced[half].sum(), rel=0.01)
    assert keep_energy(np.zeros((4, 4, 3)), np.ones((4, 4, 3))).max() == 0.0
    np.testing.assert_allclose(keep_energy(truth, truth), truth, rtol=1e-12)


def test_the_denoised_night_keeps_its_light_and_its_dark(street: WorldState) -> None:
    """16 samples denoised against 512: it lost a third of all light and doubled the dark parts before."""
    many = render_radiance(street, SPEC.with_(samples_per_pixel=512), POSE, np.random.default_rng(0)).astype(float)
    few = np.mean(
        [
            render_radiance(street, SPEC.with_(denoise=True), POSE, np.random.default_rng(seed)).astype(float)
            for seed in (1, 2, 3)
        ],
        axis=0,
    )
    assert few.mean() == pytest.approx(many.mean(), rel=0.03)
    luminance = many.mean(axis=-1)
    dark = luminance <= np.median(luminance)
    assert few[dark].mean() == pytest.approx(many[dark].mean(), rel=0.10)


def test_dark_leaves_between_lit_ones_stay_dark(tmp_path: Path) -> None:
    """Before a dark hill the darkest quarter is 6 % too bright, and 12 % where the filter runs once."""
    rng = np.random.default_rng(7)
    normals = rng.normal(size=(300, 3))
    places = np.column_stack([rng.uniform(8, 16, 300), rng.uniform(-9, 9, 300), rng.uniform(0.2, 3.0, 300)])
    leaves = [plane(0.6, 0.6, tuple(p), tuple(n / np.linalg.norm(n))) for p, n in zip(places, normals, strict=True)]
    lens = [Thing(f"lamp{k}", plane(0.5, 0.3, (20 * k - 10, 8, 7), (0, 0, -1)), "Pole", "lens") for k in (0, 1)]
    things = [
        Thing("ground", plane(600.0, 600.0, (100.0, 0.0, 0.0)), "Roads", is_object=False),
        Thing("hill", box((4.0, 200.0, 16.0), (120.0, 0.0, 8.0)), "Building"),
        Thing("hedge", sum(leaves[1:], leaves[0]), "Vegetation"),
        *lens,
        Thing("beams", box((0.02, 0.2, 0.1), (-1, 0.6, 0.7)) + box((0.02, 0.2, 0.1), (-1, -0.6, 0.7)), "Car", "head"),
    ]
    black = Material((0.0, 0.0, 0.0))
    path = write_scene(tmp_path, things, materials={"lens": black, "head": black})
    toml = tmp_path / "scene.toml"
    text = toml.read_text().replace("[materials.lens]", '[materials.lens]\nlamp = "street_lamp"')
    toml.write_text(text.replace("[materials.head]", '[materials.head]\nlamp = "headlamp"'))
    state = load_scene(path).with_lighting(NIGHT).at(0.0)
    many, few = (
        np.mean([render_radiance(state, spec, POSE, np.random.default_rng(seed)).astype(float) for seed in seeds], 0)
        for spec, seeds in ((SPEC.with_(samples_per_pixel=512), (0,)), (SPEC.with_(denoise=True), (1, 2, 3)))
    )
    assert few.mean() == pytest.approx(many.mean(), rel=0.03)
    dark = many.mean(axis=-1) <= np.quantile(many.mean(axis=-1), 0.25)
    assert few[dark].mean() == pytest.approx(many[dark].mean(), rel=0.10)


GLASS = {"pane": Material((0.0, 0.0, 0.0), "glass", 0.05), "lens": Material((0.0, 0.0, 0.0))}


def lit(world: World, share: float) -> LitWindows:
    meshes = {name: world.mesh(part) for part, name in enumerate(world.parts.name)}
    return LitWindows.of(world.parts, meshes, share)


def test_a_lit_window_shines_with_its_room(tmp_path: Path) -> None:
    """Its light over the image is the room's radiance over the pane's area in pixels, less what curtains take."""
    wide, high, distance = 1.2, 1.4, 12.0
    pane = Thing("house", plane(high, wide, (distance, 0.4, 2.0), (-1.0, 0.0, 0.0)), "Building", "pane")
    lamp = Thing("lamp", plane(0.3, 0.3, (-300.0, 0.0, 5.0), (-1.0, 0.0, 0.0)), "Pole", "lens")
    path = write_scene(tmp_path, [pane, lamp], materials=GLASS)
    toml = tmp_path / "scene.toml"
    toml.write_text(toml.read_text().replace("[materials.lens]", '[materials.lens]\nlamp = "street_lamp"'))
    world = load_scene(path)
    night = NIGHT.with_(night_sky_luminance=0.0, lit_windows=1.0)
    image, dark = (
        render_radiance(world.with_lighting(each).at(0.0), SPEC.with_(denoise=True), POSE, np.random.default_rng(0))
        for each in (night, night.with_(lit_windows=0.0))
    )
    assert dark.max() == 0.0
    ((*radiance, curtain),) = lit(world, 1.0).rooms
    sides = np.ptp(pane.mesh.vertices, axis=0)[1:]
    area = SPEC.intrinsics[0, 0] ** 2 * sides.prod() / distance**2
    expected = np.array(radiance) * area * (1.0 - 0.65 * curtain)
    np.testing.assert_allclose(image.astype(float).sum(axis=(0, 1)), expected, rtol=0.05)  # 16 samples at its edges


def test_rooms_are_lit_by_their_place(tmp_path: Path) -> None:
    windows = [plane(1.4, 1.2, (20.0, 3.0 * k, 2.0), (-1.0, 0.0, 0.0)) for k in range(400)]
    front = plane(7.0, 10.0, (20.0, -50.0, 4.0), (-1.0, 0.0, 0.0))
    if np.ptp(front.vertices[:, 2]) > 8.0:
        front = plane(10.0, 7.0, (20.0, -50.0, 4.0), (-1.0, 0.0, 0.0))
    things = [
        Thing("house", sum(windows[1:], windows[0]), "Building", "pane"),
        Thing("front", front, "Building", "pane"),
        Thing("roof", plane(3.0, 3.0, (0.0, 0.0, 8.0)), "Building", "pane"),
        Thing("shelter", plane(3.0, 3.0, (0.0, 9.0, 2.0), (1.0, 0.0, 0.0)), "Static", "pane"),
    ]
    world = load_scene(write_scene(tmp_path, things, materials=GLASS))
    all_lit, some, none = (lit(world, share) for share in (0.6, 0.3, 0.0))
    assert len(none.rooms) == 0 and len(some.panes) == 401
    assert len(some.rooms) == 400 + 4 * 2  # 10 x 7 m of glass over rooms of 2.6 x 3.4 m
    shines = [table.rooms[:400, 0] > 0.0 for table in (all_lit, some)]
    assert shines[0][shines[1]].all()  # a larger share adds some
    for share, chosen in zip((0.6, 0.3), shines, strict=True):
        assert chosen.mean() == pytest.approx(share, abs=5.0 * np.sqrt(share * (1.0 - share) / 400.0))
    luminance = some.rooms[:400][shines[1], :3] @ [0.2126, 0.7152, 0.0722] * UNIT_LUMINANCE
    assert np.median(luminance) == pytest.approx(4.0, rel=0.5) and luminance.max() < 30.1
    np.testing.assert_array_equal(lit(world, 0.3).rooms, some.rooms)
