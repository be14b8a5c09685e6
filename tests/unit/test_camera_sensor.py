"""The camera as a sensor: contracts, errors, limits, repeatability."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from camera_lidar.camera.labels import cast_pixels
from camera_lidar.camera.ray_sensor import LAUNCHES, launch_samples
from camera_lidar.camera.render import _trace, _View, render_radiance
from scarl_sionna.core.errors import ParameterRangeError, PlacementError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.semantics import SKY, semantic_id
from scarl_sionna.core.specs.camera import CameraSpec, ImageSensor
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import WorldState
from tests.scenes import Thing, box, plane, write_scene

SPEC = CameraSpec(width=48, height=32, samples_per_pixel=4, horizontal_fov_deg=60.0)
POSE = Pose([0.0, 0.0, 1.5])


@pytest.fixture(scope="module")
def state(tmp_path_factory: pytest.TempPathFactory) -> WorldState:
    folder: Path = tmp_path_factory.mktemp("scene")
    ground = Thing("ground", plane(100.0, 100.0), "Roads", is_object=False)
    wall = Thing("wall", box((1.0, 4.0, 3.0), (10.5, 0.0, 1.5)), "Wall", "white")
    return load_scene(write_scene(folder, [ground, wall])).at(0.0)


def test_all_images_have_the_promised_shape_and_type(state: WorldState) -> None:
    frame = Camera(SPEC).observe(state, POSE, np.random.default_rng(0))
    assert frame.spec == SPEC and frame.world_from_sensor is POSE
    for image, dtype, tail in (
        (frame.rgb, np.uint8, (3,)),
        (frame.depth, np.float32, ()),
        (frame.semantic, np.uint8, ()),
        (frame.instance, np.uint16, ()),
    ):
        assert image is not None and image.dtype == dtype and image.shape == (32, 48, *tail)


def test_only_the_images_asked_for_are_made(state: WorldState) -> None:
    frame = Camera(SPEC.with_(images=("instance",))).observe(state, POSE, np.random.default_rng(0))
    assert frame.instance is not None
    assert frame.rgb is None and frame.depth is None and frame.semantic is None
    frame = Camera(SPEC.with_(images=("rgb",))).observe(state, POSE, np.random.default_rng(0))
    assert frame.rgb is not None and frame.depth is None


def test_sky_has_its_class_no_instance_and_no_depth(state: WorldState) -> None:
    frame = Camera(SPEC).observe(state, POSE, np.random.default_rng(0))
    assert frame.depth is not None and frame.semantic is not None and frame.instance is not None
    sky = frame.semantic == SKY
    assert sky[0].all() and not sky[-1].any()
    assert np.array_equal(sky, np.isinf(frame.depth)) and np.array_equal(sky, frame.instance == 0)


def test_depth_ends_at_the_maximum_distance_but_labels_do_not(state: WorldState) -> None:
    frame = Camera(SPEC.with_(max_distance=9.0)).observe(state, POSE, np.random.default_rng(0))
    assert frame.depth is not None and frame.semantic is not None
    wall = frame.semantic == semantic_id("Wall")
    assert wall.any() and np.isinf(frame.depth[wall]).all()


def test_same_seed_gives_the_same_bytes_and_another_seed_other_ones(state: WorldState) -> None:
    spec = SPEC.with_(images=("rgb",))
    images = [Camera(spec).observe(state, POSE, np.random.default_rng(seed)).rgb for seed in (3, 3, 4)]
    assert np.array_equal(images[0], images[1])
    assert not np.array_equal(images[0], images[2])


@pytest.mark.parametrize("change", [{"denoise": False}, {"sensor": ImageSensor()}, {"exposure_time": 0.02}])
def test_same_seed_same_bytes_whatever_is_switched_on(state: WorldState, change: dict) -> None:
    camera = Camera(SPEC.with_(images=("rgb",), **change))
    twist = Twist([8.0, 0.0, 0.0])
    first, again, other = (
        camera.observe(state, Mount(POSE, twist), np.random.default_rng(seed)).rgb for seed in (3, 3, 4)
    )
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_the_denoiser_brings_few_samples_near_to_many(state: WorldState) -> None:
    many = render_radiance(state, SPEC.with_(samples_per_pixel=1024, denoise=False), POSE, np.random.default_rng(0))
    errors = {
        denoise: np.abs(
            render_radiance(state, SPEC.with_(denoise=denoise), POSE, np.random.default_rng(1)) - many
        ).mean()
        for denoise in (False, True)
    }
    assert errors[True] < 0.7 * errors[False]


def test_cameras_of_a_suite_share_their_rays(state: WorldState, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    cast = WorldState.cast
    monkeypatch.setattr(
        WorldState, "cast", lambda self, *args, **kwargs: calls.append(1) or cast(self, *args, **kwargs)
    )
    fresh = state.world.at(0.0)
    semantic, depth = (SPEC.with_(images=images) for images in (("semantic", "instance"), ("depth",)))
    separate = Camera(SPEC).observe(state.world.at(0.0), POSE, np.random.default_rng(0))
    calls.clear()
    first = cast_pixels(fresh, semantic, POSE)
    assert cast_pixels(fresh, depth, POSE) is first and len(calls) == 1
    shared = Camera(depth).observe(fresh, POSE, np.random.default_rng(0))
    assert np.array_equal(shared.depth, separate.depth)
    for other in (POSE.compose(Pose([0.0, 0.1, 0.0])), Pose.from_euler(POSE.position, yaw=0.1)):
        assert cast_pixels(fresh, depth, other) is not first
    assert cast_pixels(fresh, SPEC.with_(horizontal_fov_deg=61.0), POSE) is not first


def test_camera_inside_a_mesh_is_refused(state: WorldState) -> None:
    with pytest.raises(PlacementError, match=r"camera at \(10\.500, 0\.000, 1\.500\) m .*'wall'"):
        Camera(SPEC).observe(state, Pose([10.5, 0.0, 1.5]), np.random.default_rng(0))


def test_a_camera_high_above_two_layers_of_ground_is_outside(tmp_path: Path) -> None:
    """Each layer fills half the view from above; together they wind once around the camera, but the sky is open."""
    near, far = plane(3000.0, 3000.0), plane(9000.0, 9000.0, (0.0, 0.0, -1.0))
    mound = box((1.0, 1.0, 60.0), (40.0, 0.0, 30.0))  # the bounding box reaches above the camera
    terrain = Thing("terrain", near + far + mound, "Terrain", is_object=False)
    world = load_scene(write_scene(tmp_path, [terrain]))
    assert world.at(0.0).inside([0.0, 0.0, 13.0]) is None


@pytest.mark.parametrize("bad", [{"width": 0}, {"horizontal_fov_deg": 180.0}, {"exposure": 0.0}, {"images": ("xray",)}])
def test_bad_specifications_are_refused(bad: dict) -> None:
    with pytest.raises(ParameterRangeError):
        CameraSpec(**bad)


def test_samples_are_taken_in_launches_of_full_grids() -> None:
    for number in range(1, 300):
        counts = launch_samples(number)
        assert sum(counts) == number and set(counts) <= set(LAUNCHES)
        assert all(count % int(count**0.5) == 0 for count in counts)
    assert [launch_samples(n) for n in (8, 16, 64)] == [[8], [16], [64]]
    assert launch_samples(100, most=20) == [16] * 6 + [4]


@pytest.mark.parametrize("samples", [6, 9, 12])
def test_same_bytes_where_a_pixel_would_lie_on_a_seam_of_two_threads(state: WorldState, samples: int) -> None:
    spec = CameraSpec(width=322, height=181, samples_per_pixel=samples, denoise=False, images=("rgb",))
    first = _trace(state, _View(spec, POSE, 7, samples))
    assert all(_trace(state, _View(spec, POSE, 7, samples)).tobytes() == first.tobytes() for _ in range(6))
