"""What sensors see of objects, against plates whose outlines are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.boxes import through_box
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.fusion import Rig, SensorMount
from tests.scenes import Thing, box, plane, write_scene

CAMERA = CameraSpec(width=400, height=200, horizontal_fov_deg=90.0, images=("semantic", "instance", "depth"))
FOCAL = 200.0
"""[px]"""
HERE = ss.Pose([0.0, 0.0, 0.0])
RADAR = RadarSpec().with_(num_chirps=16, num_samples=128)
SETTINGS = RadarSettings(raycast={"num_rays": 40_000}, accuracy={"tube_budget": 4_000})
RIG = Rig(
    "look",
    (
        SensorMount("camera", "camera", CAMERA, HERE),
        SensorMount("lidar", "lidar", LidarSpec(num_azimuth=301, num_elevation=61), HERE),
        SensorMount("radar", "radar", RADAR, HERE, SETTINGS),
    ),
)


def thing(name: str, x: float, y: tuple[float, float], z: tuple[float, float] = (-1.0, 1.0)) -> Thing:
    """Return a thin plate across the view."""
    size = (0.02, y[1] - y[0], z[1] - z[0])
    return Thing(name, box(size, (x, (y[0] + y[1]) / 2, (z[0] + z[1]) / 2)), "Static", "steel")


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> ss.Frame:
    scene = write_scene(
        tmp_path_factory.mktemp("plates"),
        instances=[
            thing("near", 10.0, (-1.0, 1.0)),
            thing("half_hidden", 20.0, (0.0, 4.0)),  # the near plate's shadow ends at y = 2
            thing("hidden", 30.0, (-1.0, 1.0)),
            thing("cut", 10.0, (8.0, 12.0)),  # the image ends at y = 10
            thing("behind", -10.0, (-1.0, 1.0)),
            thing("beside", 5.0, (20.0, 21.0)),
            Thing("ground", plane(200.0, 200.0, (0.0, 0.0, -5.0)), "Roads", is_object=False),
        ],
    )
    return ss.observe(ss.load_scene(str(scene)), RIG, 0.0, vehicle=HERE)


def row(frame: ss.Frame, name: str) -> int:
    return [item.name for item in frame.objects].index(name)


@pytest.mark.parametrize(
    ("name", "occlusion", "truncation"),
    [("near", 0.0, 0.0), ("half_hidden", 0.5, 0.0), ("hidden", 1.0, 0.0), ("cut", 0.0, 0.5)],
)
def test_occlusion_and_truncation(frame: ss.Frame, name: str, occlusion: float, truncation: float) -> None:
    image, index = frame.results["camera"], row(frame, name)
    assert image.object_occlusion[index] == pytest.approx(occlusion, abs=0.04)  # a column of rays of 32
    assert image.object_truncation[index] == pytest.approx(truncation, abs=0.04)


@pytest.mark.parametrize("name", ["behind", "beside"])
def test_out_of_sight(frame: ss.Frame, name: str) -> None:
    image, index = frame.results["camera"], row(frame, name)
    assert image.object_pixels[index] == 0
    assert np.isnan(image.object_box[index]).all() and np.isnan(image.object_visible_box[index]).all()
    assert np.isnan(image.object_occlusion[index])


def test_rectangles_and_pixels(frame: ss.Frame) -> None:
    image, index = frame.results["camera"], row(frame, "near")
    left, right = 200.0 - FOCAL / 9.99, 200.0 + FOCAL / 9.99
    expected = [left, 100.0 - FOCAL / 9.99, right, 100.0 + FOCAL / 9.99]
    np.testing.assert_allclose(image.object_box[index], expected, atol=1.0)
    np.testing.assert_allclose(image.object_visible_box[index], expected, atol=1.0)
    assert image.object_pixels[index] == pytest.approx((right - left) ** 2, rel=0.06)
    half = row(frame, "half_hidden")
    whole, seen = image.object_box[half], image.object_visible_box[half]
    # y from 4 to 0 at 19.99 m, seen from 4 to 2
    np.testing.assert_allclose(whole[[0, 2]], [200.0 - 4.0 * FOCAL / 19.99, 200.0], atol=1.5)
    np.testing.assert_allclose(seen[[0, 2]], [200.0 - 4.0 * FOCAL / 19.99, 200.0 - FOCAL / 9.99], atol=1.5)
    assert np.isnan(image.object_visible_box[row(frame, "hidden")]).all()
    assert np.isfinite(image.object_box[row(frame, "hidden")]).all()


def test_counts_are_those_of_the_data(frame: ss.Frame) -> None:
    scan, image = frame.results["lidar"], frame.results["camera"]
    for index, item in enumerate(frame.objects):
        assert scan.object_points[index] == np.count_nonzero(scan.instance == item.instance) == item.num_lidar_points
        assert image.object_pixels[index] == np.count_nonzero(image.instance == item.instance) == item.num_pixels


def test_radar_cells_and_objects(frame: ss.Frame) -> None:
    radar = frame.results["radar"]
    near, hidden = row(frame, "near"), row(frame, "hidden")
    rd = ss.range_doppler(ss.virtual_cube(radar.adc, RADAR), RADAR)
    bin_ = int(np.abs(rd.range - 10.0).argmin())
    rest = int(np.abs(rd.radial_velocity).argmin())
    assert radar.cell_instance[rest, bin_] == frame.objects[near].instance
    assert radar.cell_share[rest, bin_] > 240 and radar.cell_ghost_share[rest, bin_] < 128
    assert radar.cell_power[rest, bin_] == pytest.approx(rd.power[rest, bin_], rel=0.3)  # with noise, one instance
    assert radar.object_power[near] > 1e3 * radar.object_power[hidden]
    assert radar.object_power[row(frame, "behind")] == 0.0
    total = (radar.object_power + radar.object_ghost_power).sum()
    assert total <= radar.cell_power.sum() * (1.0 + 1e-6)


@pytest.mark.slow
def test_labels_of_cells_can_be_left_out(frame: ss.Frame, tmp_path: Path) -> None:
    from scarl_sionna.radar.sensor import Radar

    scene = write_scene(tmp_path, instances=[thing("near", 10.0, (-1.0, 1.0))])
    state = ss.load_scene(str(scene)).at(0.0)
    result = Radar(RADAR, SETTINGS.with_(cell_labels=False)).observe(state, HERE, np.random.default_rng(0))
    assert result.cell_instance is None and result.object_power is None


def test_what_stands_inside_an_objects_box_hides_a_part_of_it(tmp_path: Path) -> None:
    """A shelf is a back wall and a rail before it; a board between the two covers the half of the wall with y > 0."""
    back, rail = box((0.02, 4.0, 2.0), (14.0, 0.0, 0.0)), box((0.02, 4.0, 0.01), (10.0, 0.0, 0.9))
    shelf = Thing("shelf", trimesh.util.concatenate([back, rail]), "Static", "steel")
    scene = write_scene(tmp_path, instances=[shelf, thing("board", 12.0, (0.0, 4.0), (-2.0, 2.0))])
    frame = ss.observe(
        ss.load_scene(str(scene)),
        Rig("eye", (SensorMount("camera", "camera", CAMERA, HERE),)),
        0.0,
        vehicle=HERE,
    )
    image, index = frame.results["camera"], row(frame, "shelf")
    assert image.object_occlusion[index] == pytest.approx(0.5, abs=0.04)  # a column of rays of 32


def test_the_first_pixels_of_the_image_count_like_the_last(tmp_path: Path) -> None:
    """Plates that each edge of an image of 20 by 20 pixels cuts in half: 2 of their 4 pixels are inside."""
    small = CameraSpec(width=20, height=20, horizontal_fov_deg=90.0, images=("instance",))  # 10 px a unit of tangent
    sides = {"left": (8, 12, -2, 2), "right": (-12, -8, -2, 2), "top": (-2, 2, 8, 12), "bottom": (-2, 2, -12, -8)}
    plates = [thing(name, 10.01, (y[0], y[1]), (y[2], y[3])) for name, y in sides.items()]
    world = ss.load_scene(str(write_scene(tmp_path, instances=plates)))
    frame = ss.observe(world, Rig("eye", (SensorMount("camera", "camera", small, HERE),)), 0.0, vehicle=HERE)
    image = frame.results["camera"]
    # v goes down; an object's box ends where the image does
    boxes = {"left": (0, 8, 2, 12), "right": (18, 8, 20, 12), "top": (8, 0, 12, 2), "bottom": (8, 18, 12, 20)}
    for name, expected in boxes.items():
        index = row(frame, name)
        assert image.object_truncation[index] == pytest.approx(0.5, abs=0.04)  # a column of rays of 32
        assert image.object_occlusion[index] == pytest.approx(0.0, abs=0.04)
        np.testing.assert_allclose(image.object_box[index], expected, atol=0.1)
        np.testing.assert_allclose(image.object_visible_box[index], expected)
        assert image.object_pixels[index] == 8


def test_cameras_of_one_place_and_other_projections_have_silhouettes_of_their_own(tmp_path: Path) -> None:
    """Of 200 by 100 px, the plate of 2 m at 10 m: as wide as a fifth of the focal length."""
    world = ss.load_scene(str(write_scene(tmp_path, instances=[thing("plate", 10.01, (-1.0, 1.0))])))
    common = {"width": 200, "height": 100, "images": ("instance",)}
    specs = {
        "wide": CameraSpec(focal_length_px=100.0, **common),
        "tele": CameraSpec(focal_length_px=200.0, **common),
        "shifted": CameraSpec(focal_length_px=100.0, principal_point=(40.0, 50.0), **common),
    }
    rig = Rig("eyes", tuple(SensorMount(name, "camera", spec, HERE) for name, spec in specs.items()))
    results = ss.observe(world, rig, 0.0, vehicle=HERE).results
    for name, expected in {"wide": (90, 110), "tele": (80, 120), "shifted": (30, 50)}.items():
        np.testing.assert_allclose(results[name].object_box[0, [0, 2]], expected, atol=0.6)


BODIES = {  # position in the world and size [m], yaw [rad]; the camera looks along x from the origin
    "alongside": ((2.0, 4.25, 0.25), (14.0, 2.5, 3.5), 0.0),
    "rail": ((5.0, -3.0, -1.2), (60.0, 0.1, 0.6), 0.0),
    "corner": ((6.0, -5.0, 1.5), (3.0, 3.0, 2.0), 0.7),
    "over": ((3.0, 0.0, 4.0), (12.0, 3.0, 0.5), 0.3),
    "ahead": ((20.0, 2.0, 0.0), (4.5, 1.8, 1.5), 0.4),
    "near": ((2.2, 0.4, -1.4), (1.0, 1.5, 1.2), 1.1),
    "edge": ((9.0, -5.4, 0.3), (1.0, 0.6, 1.7), 0.2),
    "beside": ((-0.8, -6.0, 0.0), (4.0, 1.7, 1.5), 0.1),
}
LENSES = {
    "pinhole": {"horizontal_fov_deg": 60.0},
    "barrel": {"horizontal_fov_deg": 60.0, "lens": ss.BrownConrady(k1=-0.3, k2=0.1)},
    "cushion": {"horizontal_fov_deg": 86.0, "lens": ss.BrownConrady(k1=0.25)},
    "fisheye": {"horizontal_fov_deg": 200.0, "lens": ss.KannalaBrandt(max_angle_deg=105.0)},
}


@pytest.fixture(scope="module")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> ss.Frame:
    instances = []
    for name, (middle, size, yaw) in BODIES.items():
        mesh = box(size)
        mesh.apply_transform(ss.Pose.from_euler(middle, yaw=yaw).matrix)
        instances.append(Thing(name, mesh, "Static", "steel"))
    scene = write_scene(tmp_path_factory.mktemp("bodies"), instances=instances)
    common = {"width": 320, "height": 180, "images": ("depth",)}
    rig = tuple(SensorMount(name, "camera", CameraSpec(**common, **lens), HERE) for name, lens in LENSES.items())
    return ss.observe(ss.load_scene(str(scene)), Rig("lenses", rig), 0.0, vehicle=HERE)


def meets_body(name: str, optical: np.ndarray) -> np.ndarray:
    """Return which rays (..., 3) from the origin meet a body, in closed form."""
    middle, size, yaw = BODIES[name]
    turn = ss.Pose.from_euler(middle, yaw=yaw).inverse()
    rays = turn.rotate(optical.reshape(-1, 3) @ CAMERA_OPTICAL_FROM_SENSOR)
    enter, leave = through_box(turn.position, rays, -np.array(size) / 2.0, np.array(size) / 2.0)
    return ((enter <= leave) & (leave > 0.0)).reshape(optical.shape[:-1])


@pytest.mark.parametrize("lens", LENSES)
def test_silhouettes_of_bodies_that_reach_beside_and_behind_the_camera(bodies: ss.Frame, lens: str) -> None:
    """Against all pixels, and a million rays over the plane up to 76 deg, or over the angles of a fisheye."""
    image = bodies.results[lens]
    spec = image.spec
    centres = np.stack(np.meshgrid(np.arange(320) + 0.5, np.arange(180) + 0.5), axis=-1)
    pixels = spec.rays(centres)
    axis = np.linspace(-1.0, 1.0, 1000)
    flat = np.stack(np.meshgrid(axis, axis), axis=-1)
    if lens == "fisheye":
        flat *= np.pi
        angle = np.linalg.norm(flat, axis=-1)
        whole = np.concatenate([flat * np.sinc(angle / np.pi)[..., None], np.cos(angle)[..., None]], axis=-1)
        whole = whole[angle <= np.pi]
    else:
        whole = np.concatenate([4.0 * flat, np.ones((1000, 1000, 1))], axis=-1).reshape(-1, 3)
    at, _ = spec.project(whole)
    with np.errstate(invalid="ignore"):
        is_inside = ((at >= 0.0) & (at < (320, 180))).all(axis=-1)
    seen = 0
    for index, item in enumerate(bodies.objects):
        rows, columns = np.nonzero(meets_body(item.name, pixels))
        if len(rows) < 10:
            assert not len(rows) and np.isnan(image.object_box[index]).all()
            assert np.isnan(image.object_truncation[index])
            continue
        seen += 1
        expected = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        np.testing.assert_allclose(image.object_box[index], expected, atol=1.6, err_msg=item.name)  # a tip
        met = meets_body(item.name, whole)
        share = 1.0 - np.count_nonzero(met & is_inside) / np.count_nonzero(met)
        assert image.object_truncation[index] == pytest.approx(share, abs=0.02), item.name
    assert seen >= 6


def test_cameras_of_one_suite_have_the_same_silhouettes(tmp_path: Path) -> None:
    """A pole of 1 px that no ray of the grid needs to meet: what the instance image shows, the others know."""
    pole = thing("pole", 30.0, (2.0, 2.14), (-3.0, 3.0))
    whip = Thing(
        "whip", trimesh.util.concatenate([box((1.0, 1.0, 1.0), (12, -2, 0)), box((0.02, 0.06, 2), (12, -2, 1.5))])
    )
    world = ss.load_scene(str(write_scene(tmp_path, instances=[pole, whip])))
    kinds = ("depth", "instance", "rgb")
    specs = {kind: CAMERA.with_(images=(kind,), samples_per_pixel=1) for kind in kinds}
    rig = Rig("suite", tuple(SensorMount(f"front/{kind}", "camera", spec, HERE) for kind, spec in specs.items()))
    results = ss.observe(world, rig, 0.0, vehicle=HERE).results
    for name in ("object_box", "object_occlusion", "object_truncation"):
        first, *others = (getattr(results[f"front/{kind}"], name) for kind in kinds)
        assert np.isfinite(first).all()
        for other in others:
            np.testing.assert_array_equal(first, other)
    seen = results["front/instance"]
    np.testing.assert_allclose(seen.object_box, seen.object_visible_box, atol=0.6)
    assert results["front/depth"].object_pixels is None
