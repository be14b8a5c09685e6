"""Writes samples of one camera, the lidars and the radars in the layout of KITTI's object data, which OpenPCDet reads.

References
----------
.. [1] A. Geiger, P. Lenz, R. Urtasun, "Are we ready for autonomous driving? The KITTI vision benchmark suite", CVPR
   2012; its object development kit.
.. [2] A. Palffy et al., "Multi-class road user detection with 3+1D radar in the View-of-Delft dataset", IEEE RA-L
   2022: seven numbers of a radar point.
"""

from __future__ import annotations

import json
import math
import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats.nuscenes_parts.files import lidar_rows
from scarl_sionna.dataset.formats.output import whole_folder
from scarl_sionna.dataset.formats.pictures import centred_intrinsics, encode_image
from scarl_sionna.dataset.formats.source import Convertible, FrameSource, OnProgress, as_source, no_progress

from .objects import UNSPLIT, ImageObject, check_images, image_objects

FORMAT = "kitti"
CLASSES = {
    "Car": "Car", "Truck": "Truck", "Bus": "Misc", "Train": "Tram", "Motorcycle": "Misc", "Bicycle": "Cyclist",
    "Rider": "Cyclist", "Pedestrian": "Pedestrian",
}  # fmt: skip # a table
"""KITTI's type of our semantic classes."""
MIN_PIXELS = 16
"""Objects of which the image shows fewer are left out."""
OCCLUDED = (0.1, 0.5)
"""Hidden shares up to which an object is fully visible (0) and partly occluded (1); beyond it is largely so (2)."""
UNKNOWN_OCCLUSION = 3
MOST_TILT_DEG = 1.0
"""A camera tilted more than this against an object gives a warning: KITTI's boxes are upright in the camera's frame."""
DIGITS = 4


def export_kitti(
    data: Convertible,
    out: str | Path,
    *,
    camera: str | None = None,
    pfa: float = 1e-6,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write a sample a frame: image, labels, calibration, lidar points, radar points.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make: ``training/image_2``, ``label_2``, ``calib``, ``velodyne``, ``radar``, ``ImageSets``, and
        ``samples.json``, which tells scene, frame, time and pose of each sample.
    camera : str, optional
        Pinhole camera whose images are taken; default: the first with colour images. The dataset has an instance image
        of the same view.
    pfa : float
        Probability of false alarm of the radar points.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    ParameterRangeError
        If there are no frames or colour images, or `pfa` is out of range.
    UnknownNameError
        If there is no such camera.
    DatasetError
        If the lens distorts, or there is no instance image of the same view.
    OutputError
        If the folder is there or cannot be written.

    Warns
    -----
    ScarlWarning
        If the camera is tilted against objects, whose boxes are upright in the camera's frame then.
    """
    source = as_source(data, "KITTI", ("camera", "lidar", "radar"))
    check_images(source)
    name = _camera(source, camera)
    mark = {"format": FORMAT, "camera": name, "scenes": [scene.name for scene in source.scenes]}
    samples: list[dict[str, Any]] = []
    sets: dict[str, list[str]] = defaultdict(list)
    tilt = 0.0
    with whole_folder(out, mark, overwrite) as folder:
        for scene in source.scenes:
            split = source.split_of(scene.name) or UNSPLIT
            for frame in scene:
                sample = _Sample(source, frame, name)
                stem = f"{len(samples):06d}"
                for kind, (suffix, content) in sample.files(pfa).items():
                    place = folder / "training" / kind / f"{stem}.{suffix}"
                    place.parent.mkdir(parents=True, exist_ok=True)
                    place.write_bytes(content)
                tilt = max(tilt, sample.tilt_deg)
                sets["train" if split == UNSPLIT else split].append(stem)
                samples.append({"sample": stem, "scene": scene.name, "frame": frame.index, **sample.about()})
                on_progress(len(samples), source.num_frames)
        (folder / "ImageSets").mkdir()
        sets["trainval"] = sorted([*sets.get("train", []), *sets.get("val", [])])
        for split, stems in sets.items():
            (folder / "ImageSets" / f"{split}.txt").write_text("".join(f"{stem}\n" for stem in stems))
        (folder / "samples.json").write_text(json.dumps(samples, indent=1) + "\n", encoding="utf-8")
    if tilt > MOST_TILT_DEG:
        warnings.warn(
            f"camera {name} is tilted by up to {tilt:.1f} deg against objects: KITTI's boxes are upright in the "
            "camera's frame, so they lean by that; the lidar's frame and samples.json are exact",
            ScarlWarning,
            stacklevel=2,
        )
    return Path(out)


def _camera(source: FrameSource, asked: str | None) -> str:
    """Return the name of the camera that is meant."""
    first = next(scene for scene in source.scenes if len(scene)).frames[0]
    known = [name for name, image in first.images.items() if image.rgb is not None]
    if asked is None:
        return known[0]
    if asked not in known:
        raise UnknownNameError("camera with colour images", asked, known)
    return asked


class _Sample:
    """One frame in KITTI's frames: camera x right, y down, z forward; velodyne x forward, y left, z up."""

    def __init__(self, source: FrameSource, frame: Frame, camera: str) -> None:
        image = frame.images.get(camera)
        if image is None or image.rgb is None:
            raise DatasetError(f"frame {frame.index} has no image of '{camera}'", None, "leave the frame out")
        if image.spec.lens.model != "pinhole":
            raise DatasetError(
                f"the lens of {camera} distorts", None, "KITTI knows pinhole cameras; choose another one"
            )
        self.frame, self.image, self.camera = frame, image, camera
        places = [source.vehicle_from_sensor(name).position for name in frame.lidars]
        middle = np.mean(places, axis=0) if places else np.zeros(3)
        self.world_from_velodyne = frame.world_from_vehicle.compose(Pose(middle))
        optical = Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR.T)
        self.camera_from_world = image.world_from_sensor.compose(optical).inverse()
        self.tilt_deg = 0.0

    def files(self, pfa: float) -> dict[str, tuple[str, bytes]]:
        """Return suffix and content of the sample's files by folder."""
        assert self.image.rgb is not None
        scans = list(self.frame.lidars.values())
        points = np.zeros((0, 4), np.float32)
        if scans:
            rows, _, _ = lidar_rows(self.frame, scans, self.world_from_velodyne)
            points = np.column_stack([rows[:, :3], rows[:, 3] / 255.0])
        seen = (item for item in image_objects(self.frame, self.camera) if item.semantic_class in CLASSES)
        labels = "".join(self._label(item) for item in seen if item.num_pixels >= MIN_PIXELS)
        return {
            "image_2": ("png", encode_image(self.image.rgb, "png")),
            "label_2": ("txt", labels.encode()),
            "calib": ("txt", self._calibration().encode()),
            "velodyne": ("bin", points.astype("<f4").tobytes()),
            "radar": ("bin", self._radar_rows(pfa).astype("<f4").tobytes()),
        }

    def about(self) -> dict[str, Any]:
        """Return time and pose as plain data."""
        pose = self.world_from_velodyne
        return {
            "timestamp_ns": self.frame.timestamp_ns,
            "world_from_velodyne": {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()},
        }

    def _calibration(self) -> str:
        """Return the lines of a calibration file; all four cameras of KITTI are this one."""
        matrix = np.hstack([centred_intrinsics(self.image), np.zeros((3, 1))])
        camera_from_velodyne = self.camera_from_world.compose(self.world_from_velodyne)
        velodyne = np.column_stack([camera_from_velodyne.rotation, camera_from_velodyne.position])
        rows = {f"P{number}": matrix for number in range(4)}
        rows |= {"R0_rect": np.eye(3), "Tr_velo_to_cam": velodyne, "Tr_imu_to_velo": np.eye(3, 4)}
        return "".join(f"{name}: {' '.join(f'{value:.12e}' for value in row.ravel())}\n" for name, row in rows.items())

    def _label(self, item: ImageObject) -> str:
        """Return an object's line."""
        pose = self.camera_from_world.compose(item.item.world_from_box)
        length, width, height = item.item.size
        forward, up = pose.rotate([1.0, 0.0, 0.0]), pose.rotate([0.0, 0.0, 1.0])
        self.tilt_deg = max(self.tilt_deg, math.degrees(math.acos(min(1.0, max(-1.0, -up[1])))))
        turn = -math.atan2(forward[2], forward[0])
        x, y, z = pose.position + [0.0, height / 2.0, 0.0]  # the middle of the lower face, y points down
        alpha = math.remainder(turn - math.atan2(x, z), 2.0 * math.pi)
        left, top, right, bottom = item.box - [0.0, 0.0, 1.0, 1.0]  # first and last pixel
        truncated = -1.0 if math.isnan(item.truncation) else item.truncation
        numbers = (alpha, left, top, right, bottom, height, width, length, x, y, z, turn)
        text = " ".join(f"{value:.{DIGITS}f}" for value in numbers)
        return f"{CLASSES[item.semantic_class]} {truncated:.2f} {_occluded(item.occlusion)} {text}\n"

    def _radar_rows(self, pfa: float) -> npt.NDArray[np.float64]:
        """Return the points of all radars, a row each.

        x, y, z [m, velodyne], RCS [dBsm], radial velocity, the same over ground [m/s], time [s].
        """
        rows = [np.zeros((0, 7))]
        for radar in self.frame.radars.values():
            sensed = sensed_points(self.frame, radar, pfa)
            points = sensed.points
            place = self.world_from_velodyne.inverse().compose(radar.world_from_sensor).apply(points.position)
            velocity = (points.radial_velocity, sensed.compensated_velocity)
            rows.append(np.column_stack([place, power_to_db(points.rcs), *velocity, np.zeros(points.num_points)]))
        return np.concatenate(rows)


def _occluded(share: float) -> int:
    """Return KITTI's number of a hidden share."""
    return UNKNOWN_OCCLUSION if math.isnan(share) else sum(share > limit for limit in OCCLUDED)
