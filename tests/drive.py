"""A short drive made without the ray tracer: boxes on a road, seen by a camera, a lidar and a radar a suite.

source = drive(num_frames=3)          # FrameSource with the true boxes, images, returns and raw radar data
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose, Twist
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_COLORS, semantic_id
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.fusion import Rig, SensorMount, count_labels
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.converter import quantize

CAMERA = CameraSpec(width=160, height=90)
LIDAR = LidarSpec(num_azimuth=121, num_elevation=32)
RADAR = RadarSpec().with_(num_chirps=64, num_samples=128)
EGO_TWIST = Twist([8.0, 2.0, 0.0], [0.0, 0.0, 0.1])
FRAME_INTERVAL = 0.1
_BACK = (0.0, 0.0, 0.0, 1.0)
_SIZES = {"Car": (4.2, 1.8, 1.5), "Pedestrian": (0.6, 0.6, 1.7), "Building": (12.0, 8.0, 9.0)}


def rig(ends: Sequence[str] = ("front", "back")) -> Rig:
    """Return a rig of one suite at each end of the car."""
    mounts = []
    for end in ends:
        pose = Pose([2.36 if end == "front" else -2.36, 0.0, 0.8], (1.0, 0.0, 0.0, 0.0) if end == "front" else _BACK)
        for name, kind, spec in (("camera", "camera", CAMERA), ("lidar", "lidar", LIDAR), ("radar", "radar", RADAR)):
            mounts.append(SensorMount(f"{end}_center/{name}", kind, spec, pose))
    return Rig("drive", tuple(mounts))


def drive(
    num_frames: int = 3, ends: Sequence[str] = ("front", "back"), scenes: Sequence[str] = ("street",)
) -> FrameSource:
    """Return scenes of frames that are made when they are asked for."""
    chosen = rig(ends)
    frames = [SceneFrames(name, _Frames(chosen, num_frames, seed)) for seed, name in enumerate(scenes)]
    return FrameSource(chosen.to_dict(), frames, {"train": list(scenes)})


class _Frames:
    def __init__(self, chosen: Rig, count: int, seed: int) -> None:
        self.rig, self.count, self.seed = chosen, count, seed
        self._made: dict[int, Frame] = {}

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, index: int) -> Frame:
        if not 0 <= index < self.count:
            raise IndexError(index)
        if index not in self._made:
            self._made[index] = make_frame(self.rig, index, self.seed)
        return self._made[index]


OBJECT_LABELS = tuple(item.name for item in fields(ImageFrame) if item.name.startswith("object_"))


def with_labels(frame: Frame) -> Frame:
    """Return a frame whose cameras have a label of each object: boxes and shares of zeros."""
    count, results = len(frame.objects), dict(frame.results)
    for name, image in frame.images.items():
        labels = {key: np.zeros((count, 4) if key.endswith("box") else count, np.float32) for key in OBJECT_LABELS}
        labels["object_pixels"] = labels["object_pixels"].astype(np.int32)
        results[name] = replace(image, **labels)
    return replace(frame, results=results)


class AllFrames(Sequence[Frame]):
    """The frames of all scenes, one after the other, made when they are asked for: not while tests are collected."""

    def __init__(self, source: FrameSource) -> None:
        self._source = source

    def __len__(self) -> int:
        return sum(map(len, self._source.scenes))

    def __getitem__(self, index: Any) -> Any:
        return [frame for scene in self._source.scenes for frame in scene][index]


def objects_at(time: float) -> tuple[ObjectState, ...]:
    """Return the car with the sensors, a car ahead, a pedestrian half behind it, and a house."""
    ego = Pose.from_euler([-20.0, 5.0, 0.0], yaw=0.25 + 0.1 * time)
    start = Pose(ego.position + EGO_TWIST.linear * time, ego.quaternion)
    out = []
    for instance, (name, place, yaw, velocity) in enumerate(
        (
            ("Car", start.position, start.yaw, EGO_TWIST.linear),
            ("Car", (-6.0, 9.0, 0.0), 0.6, (6.0, 4.0, 0.0)),
            ("Pedestrian", (-2.5, 11.8, 0.0), 0.0, (0.0, -1.0, 0.0)),
            ("Building", (-60.0, -15.0, 0.0), 0.2, (0.0, 0.0, 0.0)),
        ),
        1,
    ):
        size = np.array(_SIZES[name])
        moved = np.asarray(place) + (0.0 if instance == 1 else time) * np.asarray(velocity) + [0.0, 0.0, size[2] / 2]
        pose = Pose.from_euler(moved, yaw=yaw)
        out.append(
            ObjectState(f"{name}_{instance}", instance, semantic_id(name), pose, size, Twist(velocity), instance < 4)
        )
    return tuple(out)


def make_frame(chosen: Rig, index: int, seed: int = 0) -> Frame:
    """Return a frame of all sensors of a rig."""
    time = index * FRAME_INTERVAL
    objects = objects_at(time)
    ego = Pose.from_euler([*objects[0].world_from_box.position[:2], 0.0], yaw=objects[0].world_from_box.yaw)
    results = {}
    for mount in chosen.sensors:
        pose = ego.compose(mount.vehicle_from_sensor)
        if mount.kind == "camera":
            results[mount.name] = _image(mount.spec, pose, objects[1:])
        elif mount.kind == "lidar":
            results[mount.name] = _scan(mount.spec, pose, objects[1:])
        else:
            results[mount.name] = _radar(mount.spec, ego, pose, objects[1:], np.random.default_rng([seed, index]))
    counted = count_labels(objects, results)
    return Frame(index, round(time * 1e9), seed, ego, EGO_TWIST, results, counted)


def cast(
    origin: npt.NDArray[np.float64], rays: npt.NDArray[np.float64], objects: Sequence[ObjectState]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return for rays (N, 3) from a point where they end, in ray lengths, and at what.

    -2 nothing, -1 ground, else the object.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(rays[:, 2] < 0, -origin[2] / rays[:, 2], np.inf)
        best, what = ground, np.where(np.isfinite(ground), -1, -2)
        for number, item in enumerate(objects):
            inverse = item.world_from_box.inverse()
            start, way = inverse.apply(origin), inverse.rotate(rays)
            a, b = (-item.size / 2 - start) / way, (item.size / 2 - start) / way
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            hit = (enter <= leave) & (enter > 0) & (enter < best)
            best, what = np.where(hit, enter, best), np.where(hit, number, what)
    return best, what


def _labels(what: npt.NDArray[np.int64], objects: Sequence[ObjectState]) -> tuple[npt.NDArray, npt.NDArray]:
    semantic = np.array([*(item.semantic for item in objects), semantic_id("Sky"), semantic_id("Roads")], np.uint8)
    instance = np.array([*(item.instance for item in objects), 0, 60_000], np.uint16)
    return semantic[what], instance[what]  # -1 and -2 count from the end


def _image(spec: CameraSpec, pose: Pose, objects: Sequence[ObjectState]) -> ImageFrame:
    v, u = np.mgrid[: spec.height, : spec.width] + 0.5
    optical = np.stack([u.ravel(), v.ravel(), np.ones(u.size)]).T @ np.linalg.inv(spec.intrinsics).T
    depth, what = cast(pose.position, pose.rotate(optical @ CAMERA_OPTICAL_FROM_SENSOR), objects)
    semantic, instance = _labels(what, objects)
    shape = (spec.height, spec.width)
    depth = np.where(depth <= spec.max_distance, depth, np.inf).astype(np.float32).reshape(shape)
    return ImageFrame(
        spec,
        pose,
        SEMANTIC_COLORS[semantic].reshape(*shape, 3),
        depth,
        semantic.reshape(shape),
        instance.reshape(shape),
    )


def _scan(spec: LidarSpec, pose: Pose, objects: Sequence[ObjectState]) -> LidarScan:
    a, e = spec.scan.angles()
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    distance, what = cast(pose.position, pose.rotate(rays), objects)
    kept = np.flatnonzero(distance < spec.max_distance)
    semantic, instance = _labels(what[kept], objects)
    distance, rays = distance[kept].astype(np.float32), rays[kept]
    ones = np.ones(len(kept), np.float32)
    return LidarScan(
        spec,
        pose,
        kept.astype(np.int32),
        (rays * distance[:, None]).astype(np.float32),
        distance,
        0 * ones,
        (0.5 / distance**2).astype(np.float32),
        ones,
        (-rays).astype(np.float32),
        semantic,
        instance,
        time=0 * ones,
        return_index=np.zeros(len(kept), np.uint8),
        reflectance=0.5 * ones,
        cnr=np.nan * ones,
    )


def _radar(
    spec: RadarSpec, ego: Pose, pose: Pose, objects: Sequence[ObjectState], rng: np.random.Generator
) -> RadarFrame:
    """Return the signal of one point inside each object, and receiver noise."""
    own = Twist(EGO_TWIST.velocity_at(pose.position - ego.position), EGO_TWIST.angular)
    places = np.array([item.world_from_box.position for item in objects])
    motion = np.array([item.twist.linear for item in objects])
    ahead = pose.inverse().apply(places)[:, 0] > 1.0
    paths = point_targets(places[ahead], motion[ahead], 10.0, spec, Mount(pose, own))
    codes, scale, saturated = quantize(synthesize(paths, spec, rng=rng), spec)
    return RadarFrame(spec, pose, codes, scale, saturated, paths.num_paths, {"method": "points"})
