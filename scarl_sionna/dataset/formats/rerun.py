"""Shows frames in the Rerun viewer, or writes them as an ``.rrd`` file that it opens."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.boxes import other_objects
from scarl_sionna.dataset.derived.lidar_points import world_points
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .output import whole_output_file
from .source import Convertible, OnProgress, SceneFrames, as_source, no_progress

if TYPE_CHECKING:
    from rerun import RecordingStream

APPLICATION = "scarl-sionna"


def export_rerun(
    data: Convertible,
    out: str | Path,
    *,
    pfa: float = 1e-6,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as an ``.rrd`` file; ``rerun FILE`` opens it.

    Raises
    ------
    MissingPackageError
        If rerun-sdk is not installed.
    OutputError
        If the file is there or cannot be written.
    """
    rr = require("rerun", "viewer")
    source = as_source(data, "Rerun", ("camera", "lidar", "radar")).not_empty()
    with whole_output_file(out, overwrite, is_ours) as partial:
        recording = rr.RecordingStream(APPLICATION, recording_id=Path(out).stem)
        recording.save(str(partial))
        log_frames(recording, source, pfa=pfa, on_progress=on_progress)
        recording.flush()
        recording.disconnect()
    return Path(out)


def is_ours(path: Path) -> bool:
    """Return whether a file is a recording of this application: it stands in the first message."""
    with open(path, "rb") as file:
        head = file.read(4096)
    return head.startswith(b"RRF") and APPLICATION.encode() in head


def view_rerun(data: Convertible, *, pfa: float = 1e-6, on_progress: OnProgress = no_progress) -> None:
    """Open the viewer and show frames in it while they are read.

    Raises
    ------
    MissingPackageError
        If rerun-sdk is not installed.
    """
    rr = require("rerun", "viewer")
    recording = rr.RecordingStream(APPLICATION)
    recording.spawn()
    log_frames(recording, as_source(data, "Rerun", ("camera", "lidar", "radar")), pfa=pfa, on_progress=on_progress)
    recording.flush()


def log_frames(
    recording: RecordingStream, data: Convertible, *, pfa: float = 1e-6, on_progress: OnProgress = no_progress
) -> None:
    """Log all frames to a recording: one root a scene, timelines ``time`` and ``frame``."""
    rr = require("rerun", "viewer")
    source = as_source(data).not_empty()
    done = 0
    for scene in source.scenes:
        classes = [(k, name, tuple(SEMANTIC_COLORS[k].tolist())) for k, name in enumerate(SEMANTIC_CLASSES)]
        recording.log(scene.name, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        recording.log(scene.name, rr.AnnotationContext(classes), static=True)
        for name in source.mounts:
            _log_pose(rr, recording, f"{scene.name}/vehicle/{name}", source.vehicle_from_sensor(name), static=True)
        for position, frame in enumerate(scene):
            if position == 0:
                for name, image in frame.images.items():
                    _log_camera(rr, recording, f"{scene.name}/vehicle/{name}/optical", image)
            recording.set_time("time", duration=frame.timestamp_ns * 1e-9)
            recording.set_time("frame", sequence=frame.index)
            _log_frame(rr, recording, scene, frame, pfa)
            done += 1
            on_progress(done, source.num_frames)


def _log_frame(rr: ModuleType, recording: RecordingStream, scene: SceneFrames, frame: Frame, pfa: float) -> None:
    root = f"{scene.name}/vehicle"
    _log_pose(rr, recording, root, frame.world_from_vehicle)
    objects = other_objects(frame)
    recording.log(
        f"{scene.name}/objects",
        rr.Boxes3D(
            centers=[item.world_from_box.position for item in objects],
            half_sizes=[item.size / 2.0 for item in objects],
            quaternions=[rr.Quaternion(xyzw=np.roll(item.world_from_box.quaternion, -1)) for item in objects],
            labels=[item.name for item in objects],
            class_ids=[item.semantic for item in objects],
        ),
    )
    for name, image in frame.images.items():
        _log_image(rr, recording, f"{root}/{name}", image)
    for name, scan in frame.lidars.items():
        _log_lidar(rr, recording, f"{root}/{name}", frame, scan)
    for name, radar in frame.radars.items():
        _log_detections(rr, recording, f"{root}/{name}", frame, radar, pfa)
        _log_map(rr, recording, f"{scene.name}/maps/{name}", radar)


def _log_camera(rr: ModuleType, recording: RecordingStream, path: str, image: ImageFrame) -> None:
    """Log once where a camera looks."""
    spec = image.spec
    _log_pose(rr, recording, path, Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR.T), static=True)
    if spec.lens.model == "pinhole":  # the viewer knows no lens: a distorted image is shown without a place in space
        recording.log(
            path,
            rr.Pinhole(
                image_from_camera=spec.intrinsics,
                resolution=[spec.width, spec.height],
                camera_xyz=rr.ViewCoordinates.RDF,
            ),
            static=True,
        )


def _log_image(rr: ModuleType, recording: RecordingStream, path: str, image: ImageFrame) -> None:
    optical = f"{path}/optical"
    if image.rgb is not None:
        recording.log(f"{optical}/rgb", rr.Image(image.rgb).compress(jpeg_quality=90))
    if image.depth is not None:
        is_ahead = np.isfinite(image.depth) & (image.depth > 0.0)
        recording.log(f"{optical}/depth", rr.DepthImage(np.where(is_ahead, image.depth, 0.0), meter=1.0))
    if image.semantic is not None:
        recording.log(f"{optical}/semantic", rr.SegmentationImage(image.semantic))


def _log_lidar(rr: ModuleType, recording: RecordingStream, path: str, frame: Frame, scan: LidarScan) -> None:
    place = scan.world_from_sensor.inverse().apply(world_points(frame, scan))
    recording.log(f"{path}/points", rr.Points3D(place, class_ids=scan.semantic, radii=0.03))


def _log_detections(
    rr: ModuleType, recording: RecordingStream, path: str, frame: Frame, radar: RadarFrame, pfa: float
) -> None:
    sensed = sensed_points(frame, radar, pfa)
    points = sensed.points
    recording.log(f"{path}/detections", rr.Points3D(points.position, colors=(255, 80, 0), radii=0.15))
    recording.log(
        f"{path}/velocities",
        rr.Arrows3D(origins=points.position, vectors=sensed.direction * sensed.compensated_velocity[:, None] * 0.2),
    )


def _log_map(rr: ModuleType, recording: RecordingStream, path: str, radar: RadarFrame) -> None:
    rd = range_doppler(virtual_cube(radar.adc, radar.spec), radar.spec)
    level = power_to_db(rd.power / rd.noise_power).astype(np.float32)
    recording.log(path, rr.Tensor(level.T[::-1], dim_names=("range", "radial_velocity")))


def _log_pose(rr: ModuleType, recording: RecordingStream, path: str, pose: Pose, static: bool = False) -> None:
    rotation = rr.Quaternion(xyzw=np.roll(pose.quaternion, -1))
    recording.log(path, rr.Transform3D(translation=pose.position, quaternion=rotation), static=static)
