"""A frame of arbitrary arrays of the right types, and equality of frames bit for bit."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset.codec import decode_depth
from scarl_sionna.fusion import Rig, SensorMount

CAMERA = CameraSpec(width=24, height=16)
LIDAR = LidarSpec(num_azimuth=5, num_elevation=3)
RADAR = RadarSpec().with_(num_chirps=4, num_samples=8)
RIG = Rig(
    "small",
    (
        SensorMount("front/camera", "camera", CAMERA, Pose([2.0, 0.1, 1.3])),
        SensorMount("front/depth", "camera", CAMERA.with_(images=("depth",)), Pose([2.0, 0.1, 1.3])),
        SensorMount("front/lidar", "lidar", LIDAR, Pose([2.0, 0.0, 0.7])),
        SensorMount("radar", "radar", RADAR, Pose([2.3, 0.0, 0.5], [0.9, 0.1, -0.2, 0.3])),
    ),
)


def make_frame(index: int = 0) -> Frame:
    """Return a frame of arbitrary arrays with every optional field.

    Depth and normals are on the steps of their codes.
    """
    rng = np.random.default_rng(index)
    pose = Pose(rng.normal(size=3), rng.normal(size=4))
    shape = (CAMERA.height, CAMERA.width)
    depth = decode_depth(rng.integers(0, 2**16, shape).astype(np.uint16), CAMERA.max_distance)
    images = ImageFrame(
        CAMERA,
        pose,
        rng.integers(0, 256, (*shape, 3)).astype(np.uint8),
        depth,
        rng.integers(0, 29, shape).astype(np.uint8),
        rng.integers(0, 2**16, shape).astype(np.uint16),
        normal=rng.normal(size=(*shape, 3)).astype(np.float16).astype(np.float32),
        flow=rng.normal(size=(*shape, 2)).astype(np.float32),
        object_pixels=np.arange(index % 3, dtype=np.int32),
        object_box=rng.normal(size=(index % 3, 4)).astype(np.float32),
        object_visible_box=np.full((index % 3, 4), np.nan, np.float32),
        object_occlusion=rng.random(index % 3).astype(np.float32),
        object_truncation=rng.random(index % 3).astype(np.float32),
    )
    count = int(rng.integers(0, 15))
    vectors = rng.normal(size=(2, count, 3)).astype(np.float32)
    scalars = rng.normal(size=(7, count)).astype(np.float32)
    signal = rng.normal(size=(LIDAR.num_shots, 2, 4)) + 1j * rng.normal(size=(LIDAR.num_shots, 2, 4))
    lidar = LidarScan(
        LIDAR,
        pose,
        np.arange(count, dtype=np.int32),
        vectors[0],
        *scalars[:4],
        vectors[1],
        np.full(count, 14, np.uint8),
        np.full(count, 60000, np.uint16),
        time=scalars[4],
        return_index=np.arange(count, dtype=np.uint8),
        reflectance=scalars[5],
        cnr=scalars[6],
        beat_signal=signal.astype(np.complex64),
        object_points=np.arange(index % 3, dtype=np.int32),
    )
    adc = rng.integers(-(2**15), 2**15, (RADAR.num_rx, RADAR.num_chirps_total, RADAR.num_samples, 2)).astype(np.int16)
    radar = RadarFrame(
        RADAR, pose, adc, 1.0 / 3.0e7, 2, 77, {"method": "raycast", "num_rays": 5}, *cells(rng, index % 3)
    )
    car = ObjectState("car", 7, 14, pose, np.array([4.5, 1.8, 1.5]), Twist([1 / 3, 0, 0], [0, 0, 0.1]), True, 3, 4)
    man = ObjectState(
        "man", 8, 4, pose, np.array([1, 0.6, 1.7]), Twist(), True, 0, 1, np.array([0.1, 0, 0.02]), np.full(3, 0.5)
    )
    return Frame(
        index,
        1_000_000_007 + index,
        2**70,
        pose,
        Twist([30.1, 0, 0]),
        {
            "front/camera": images,
            "front/depth": ImageFrame(CAMERA.with_(images=("depth",)), pose, depth=depth),
            "front/lidar": lidar,
            "radar": radar,
        },
        (car, man)[: index % 3],
        {"camera": 1.0},
    )


def cells(rng: np.random.Generator, num_objects: int) -> tuple[np.ndarray, ...]:
    """Return the ground truth of a radar's cells and objects."""
    shape = (RADAR.num_chirps, RADAR.num_samples)
    return (
        rng.integers(0, 2**16, shape).astype(np.uint16),
        *(rng.integers(0, 256, shape).astype(np.uint8) for _ in range(2)),
        rng.random(shape).astype(np.float32),
        rng.random(num_objects),
        rng.random(num_objects),
    )


def assert_same(a, b, where="frame") -> None:
    """Assert that two values are equal bit for bit, dataclasses field by field."""
    assert type(a) is type(b), where
    if is_dataclass(a):
        for item in fields(a):
            if item.name != "timings":
                assert_same(getattr(a, item.name), getattr(b, item.name), f"{where}.{item.name}")
    elif isinstance(a, dict):
        assert list(a) == list(b), where
        for key in a:
            assert_same(a[key], b[key], f"{where}[{key}]")
    elif isinstance(a, tuple):
        for index, pair in enumerate(zip(a, b, strict=True)):
            assert_same(*pair, f"{where}[{index}]")
    elif isinstance(a, np.ndarray):
        assert (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()), where
    else:
        assert a == b, where
