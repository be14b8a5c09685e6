"""What a camera sees where: the RGB image and the labels share one exact projection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from camera_lidar import Camera
from camera_lidar.camera import project, render_labels, render_radiance
from camera_lidar.camera.projection import camera_optical_from_world, unproject
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from tests.mitsuba_camera import perspective_dict
from tests.scenes import Light, Material, Thing, ball, box, plane, write_scene

POSE = Pose.from_euler([2.0, -1.0, 1.7], yaw=0.4, pitch=0.1, roll=-0.15)


def sphere_image_centre(centre_optical: npt.NDArray, radius: float, intrinsics: npt.NDArray) -> npt.NDArray:
    """Return the centre [px] of the ellipse that a sphere projects to.

    With theta the angle from the optical axis and sin(alpha) = radius / distance, its ends along the radius are
    tan(theta + alpha) and tan(theta - alpha), whose mean is sin(2 theta) / (cos(2 theta) + cos(2 alpha)).
    """
    lateral = centre_optical[:2]
    theta = np.arctan2(np.linalg.norm(lateral), centre_optical[2])
    alpha = np.arcsin(radius / np.linalg.norm(centre_optical))
    tangent = np.sin(2 * theta) / (np.cos(2 * theta) + np.cos(2 * alpha))
    direction = lateral / np.linalg.norm(lateral)
    return project([*(tangent * direction), 1.0], intrinsics)[0]


@pytest.mark.some(2)
@pytest.mark.parametrize(("u", "v"), [(60.0, 50.0), (260.0, 150.0), (400.0, 40.0), (101.3, 220.7)])
def test_a_shining_ball_appears_at_its_projection(tmp_path: Path, u: float, v: float) -> None:
    spec = CameraSpec(width=480, height=270, horizontal_fov_deg=90.0, samples_per_pixel=64, max_depth=1, denoise=False)
    radius = 0.15
    centre_optical = unproject([u, v], 5.0, spec.intrinsics)
    centre_world = camera_optical_from_world(POSE).inverse().apply(centre_optical)
    ground = Thing("ground", plane(1.0, 1.0, (0.0, 0.0, -50.0)))
    scene = write_scene(
        tmp_path, [ground, Thing("ball", ball(radius, centre_world), emission=1.0)], light=Light("constant", 0.0)
    )
    radiance = render_radiance(load_scene(scene).at(0.0), spec, POSE, np.random.default_rng(5))[..., 0].astype(float)
    rows, columns = np.mgrid[0 : spec.height, 0 : spec.width] + 0.5
    centroid = np.array([(radiance * columns).sum(), (radiance * rows).sum()]) / radiance.sum()
    # about 60 border pixels, coverage error <= 0.06 each (64 stratified samples), lever 7 px, area 160 px:
    # sqrt(60) * 0.06 * 7 / 160 = 0.02 px (one sigma, upper bound); a wrong pixel convention is 0.5 px off
    assert np.abs(centroid - sphere_image_centre(centre_optical, radius, spec.intrinsics)).max() < 0.06


def test_mitsubas_own_rays_through_pixel_centres_give_the_depth_image(tmp_path: Path) -> None:
    spec = CameraSpec(width=96, height=54, horizontal_fov_deg=80.0)
    things = [
        Thing("ground", plane(400.0, 400.0), "Roads"),
        Thing("wall", plane(60.0, 30.0, (25.0, 0.0, 5.0), normal=(-1.0, 0.3, 0.1)), "Wall"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    depth = render_labels(state, spec, POSE).depth.ravel()
    rows, columns = np.divmod(np.arange(spec.width * spec.height), spec.width)
    scene = state.optical_scene()
    with variant.optical() as mi:
        sensor = mi.load_dict(perspective_dict(mi, spec, POSE))
        film = mi.Point2f(mi.Float((columns + 0.5) / spec.width), mi.Float((rows + 0.5) / spec.height))
        ray, _ = sensor.sample_ray(time=0.0, sample1=0.0, sample2=film, sample3=mi.Point2f(0.5))
        hit = scene.ray_intersect(ray)
        points = np.array(hit.p, dtype=np.float64).T
        valid = np.array(hit.is_valid(), dtype=bool)
    assert np.array_equal(valid, np.isfinite(depth))
    rendered = (points - POSE.position) @ POSE.rotation[:, 0]
    # float32 geometry: eps 6e-8 * coordinates of 60 m / cosine 0.02 at the far, grazing ground; the contract is 1e-4
    assert np.abs(rendered[valid] / depth[valid] - 1.0).max() < 1e-4
    assert len(np.unique(np.round(depth[valid], 3))) > 1000  # a slanted scene, not one constant


def test_depth_of_a_frontal_plane_agrees_with_the_aov_integrator(tmp_path: Path) -> None:
    spec = CameraSpec(width=64, height=36, horizontal_fov_deg=60.0, samples_per_pixel=4)
    state = load_scene(write_scene(tmp_path, [Thing("wall", plane(60, 60, (12.0, 0, 0), (-1, 0, 0)))])).at(0.0)
    pose = Pose([0.5, 0.0, 0.0])
    depth = render_labels(state, spec, pose).depth
    scene = state.optical_scene()
    with variant.optical() as mi:
        sensor = mi.load_dict(perspective_dict(mi, spec, pose))
        aov = mi.load_dict({"type": "aov", "aovs": "where:position"})
        position = np.array(mi.render(scene, sensor=sensor, integrator=aov, spp=4))
    rendered = position[..., -3] - 0.5  # x of the hit point; the same everywhere in the pixel
    assert np.abs(rendered / depth - 1.0).max() < 1e-6  # float32: a few eps of 6e-8
    assert np.abs(depth / 11.5 - 1.0).max() < 1e-6


def test_instance_mask_holds_exactly_what_is_in_view(tmp_path: Path) -> None:
    spec = CameraSpec(width=320, height=180, horizontal_fov_deg=60.0, images=("instance", "semantic"))
    things = [
        Thing("front", box((1.0, 2.0, 1.0), (10.5, 1.0, 0.3)), "Car"),
        Thing("right", box((1.0, 0.5, 2.0), (8.5, -3.0, -0.2)), "Pedestrian"),
        Thing("hidden", box((0.5, 1.0, 0.5), (15.0, 1.5, 0.4)), "Car"),
        Thing("behind", box((1.0, 1.0, 1.0), (-5.0, 0.0, 0.0)), "Car"),
        Thing("outside", box((1.0, 1.0, 1.0), (5.0, 6.0, 0.0)), "Car"),
    ]
    world = load_scene(write_scene(tmp_path, things))
    frame = Camera(spec).observe(world.at(0.0), Pose(), np.random.default_rng(0))
    names = {world.instances[i].name for i in np.unique(frame.instance) if i > 0}
    assert names == {"front", "right"}
    # the near face of "front", x = 10: pixels whose centre lies within the projected rectangle, none else near it
    corners, _ = project([[-2.0, -0.8, 10.0], [0.0, 0.2, 10.0]], spec.intrinsics)
    (u0, v0), (u1, v1) = corners
    rows, columns = np.mgrid[0 : spec.height, 0 : spec.width] + 0.5
    face = (columns > u0) & (columns < u1) & (rows > v0) & (rows < v1)
    # the far face (x = 11) and the sides lie inside of the silhouette: y and z ranges hold the axis (0 on the border)
    number = next(i for i, info in world.instances.items() if info.name == "front")
    assert np.array_equal(frame.instance == number, face)


def test_an_actor_is_seen_where_its_trajectory_puts_it(tmp_path: Path) -> None:
    spec = CameraSpec(width=320, height=180, horizontal_fov_deg=60.0, images=("instance", "depth"))
    motion = {"kind": "constant_twist", "position": (10.0, -2.0, 0.0), "velocity": (4.0, 2.0, 0.0)}
    car = Thing("car", box((0.02, 1.0, 1.0)), "Car", trajectory=motion)
    ground = Thing("ground", plane(100.0, 100.0, (0.0, 0.0, -1.0)))
    world = load_scene(write_scene(tmp_path, [ground], [car]))
    for time in (0.0, 0.5, 1.0, 0.5):  # back in time too
        frame = Camera(spec).observe(world.at(time), Pose(), np.random.default_rng(0))
        assert frame.instance is not None and frame.depth is not None
        mask = frame.instance == 2
        rows, columns = np.nonzero(mask)
        x, y = 10.0 + 4.0 * time - 0.01, -2.0 + 2.0 * time
        expected, _ = project([-y, 0.0, x], spec.intrinsics)
        # centroid of a mask of whole pixels: within half a pixel at each border
        assert np.abs([columns.mean() + 0.5, rows.mean() + 0.5] - expected).max() < 0.5
        assert abs(np.median(frame.depth[mask]) - x) < 1e-5 * x  # float32


def test_a_grey_plane_under_a_white_sky_renders_its_reflectance(tmp_path: Path) -> None:
    spec = CameraSpec(width=32, height=18, horizontal_fov_deg=40.0, samples_per_pixel=64, denoise=False)
    ground = Thing("ground", plane(4000.0, 4000.0), "Roads", "grey")  # reflectance 0.5
    state = load_scene(write_scene(tmp_path, [ground], light=Light("constant", 1.0))).at(0.0)
    radiance = render_radiance(state, spec, Pose.from_euler([0.0, 0.0, 2.0], pitch=np.pi / 2), np.random.default_rng(1))
    # a plane sees the whole upper half space at radiance 1, so it sends out exactly its reflectance; the estimate is
    # weighted cosine sampling: variance below 0.5**2 a sample, 5 sigma of the mean of 32 * 18 * 64 samples
    assert abs(radiance.mean() - 0.5) < 5 * 0.5 / np.sqrt(32 * 18 * 64)


def test_exposure_one_suits_daylight(tmp_path: Path) -> None:
    spec = CameraSpec(width=16, height=9, horizontal_fov_deg=40.0, samples_per_pixel=256, images=("rgb",))
    grey_card = Material((0.18, 0.18, 0.18))
    ground = Thing("ground", plane(4000.0, 4000.0), "Roads", "card")
    light = Light("sunsky", properties={"turbidity": 3.0}, vectors={"sun_direction": (1.0, 0.0, 1.0)})
    state = load_scene(write_scene(tmp_path, [ground], materials={"card": grey_card}, light=light)).at(0.0)
    down = Pose.from_euler([0.0, 0.0, 2.0], pitch=np.pi / 2)
    image = Camera(spec).observe(state, down, np.random.default_rng(1)).rgb
    assert image is not None
    # documented: linear 0.18 * 0.36 * 4 = 0.26 in luminance, sRGB 0.547 * 255 = 139. The sunlight is warm: red above,
    # blue below; +-10 levels hold that (143, 137, 134)
    assert np.abs(image.mean(axis=(0, 1)) - 139.0).max() < 10.0
