"""Writes true boxes, calibration and colour images as ASAM OpenLABEL files, one a scene.

References
----------
.. [1] ASAM OpenLABEL 1.0.0, concept paper and JSON schema, 2021.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from scarl_sionna.core.errors import DatasetError, ScarlWarning
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame, ImageFrame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lens import KannalaBrandt
from scarl_sionna.dataset.derived.boxes import other_objects
from scarl_sionna.dataset.formats.output import whole_folder
from scarl_sionna.dataset.formats.pictures import centred_intrinsics, encode_image
from scarl_sionna.dataset.formats.source import (
    Convertible,
    FrameSource,
    OnProgress,
    SceneFrames,
    as_source,
    no_progress,
)

from .coco import check_image_format
from .objects import ImageObject, image_objects

FORMAT = "openlabel"
SCHEMA_VERSION = "1.0.0"
WORLD = "odom"
"""Coordinate system of the scene: x, y, z as in the dataset, z up [m]."""
VEHICLE = "vehicle-iso8855"
"""That of the vehicle: x forward, y left, z up, origin as in the rig [m]."""
STREAMS = {"camera": "camera", "lidar": "lidar", "radar": "radar", "closed_radar": "radar", "scanning_radar": "radar"}
"""OpenLABEL's kind of a stream by the kind of a sensor; all others are ``"other"``."""
OPTICAL = Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR.T)


def export_openlabel(
    data: Convertible,
    out: str | Path,
    *,
    image_format: Literal["jpg", "png"] = "jpg",
    images: bool = True,
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write a file a scene: objects with cuboids and rectangles, coordinate systems, and the sensors as streams.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        Folder to make: ``SCENE.json``, and ``images/SCENE/...``.
    image_format : str
        ``"jpg"`` or, without loss, ``"png"``.
    images : bool
        Whether colour images are written beside the labels.
    overwrite : bool
    on_progress : callable

    Raises
    ------
    ParameterRangeError
        If a parameter is out of range, or there are no frames.
    OutputError
        If the folder is there or cannot be written.

    Warns
    -----
    ScarlWarning
        If there is no instance image with the view of a colour camera: it has no rectangles then. With the sensors
        other than cameras: their places are written, what they measured is not.
    """
    check_image_format(image_format)
    source = as_source(data, "OpenLABEL", ("camera",))
    source.not_empty()
    done = 0
    unknown: set[str] = set()
    with whole_folder(out, {"format": FORMAT, "scenes": [scene.name for scene in source.scenes]}, overwrite) as folder:
        for scene in source.scenes:
            file = _SceneFile(source, scene)
            for number, frame in enumerate(scene):
                pictures = {name: image for name, image in frame.images.items() if image.rgb is not None}
                uris = {}
                for name, image in pictures.items() if images else ():
                    uris[name] = f"images/{scene.name}/{name.replace('/', '_')}/{frame.index:06d}.{image_format}"
                    place = folder / uris[name]
                    place.parent.mkdir(parents=True, exist_ok=True)
                    assert image.rgb is not None
                    place.write_bytes(encode_image(image.rgb, image_format))
                shown = _shown(frame, pictures, unknown)
                file.add(number, frame, shown, uris)
                done += 1
                on_progress(done, source.num_frames)
            text = json.dumps({"openlabel": file.content()}, separators=(",", ":"))
            (folder / f"{scene.name}.json").write_text(text + "\n", encoding="utf-8")
    if unknown:
        warnings.warn(
            f"no instance image has the view of {', '.join(sorted(unknown))}: rectangles in it are left out; give the "
            "rig a camera with 'instance' at the same place",
            ScarlWarning,
            stacklevel=2,
        )
    return Path(out)


def _shown(frame: Frame, cameras: Iterable[str], unknown: set[str]) -> dict[int, dict[str, ImageObject]]:
    """Return what images show by instance and camera; cameras for which that is not known are added to `unknown`."""
    found: dict[int, dict[str, ImageObject]] = {}
    for name in cameras:
        try:
            items = image_objects(frame, name)
        except DatasetError:
            unknown.add(name)
            continue
        for item in items:
            found.setdefault(item.item.instance, {})[name] = item
    return found


class _SceneFile:
    """The content of a scene's file, frame by frame. Boxes of what never moves are written once, with the object."""

    def __init__(self, source: FrameSource, scene: SceneFrames) -> None:
        self.source, self.scene = source, scene
        self.frames: dict[str, Any] = {}
        self.present: dict[int, list[int]] = {}
        self.names: dict[int, tuple[str, str]] = {}
        self.cuboids: dict[int, list[tuple[int, dict[str, Any]]]] = {}
        self.cameras: dict[str, ImageFrame] = {}

    def add(self, number: int, frame: Frame, shown: dict[int, dict[str, ImageObject]], uris: dict[str, str]) -> None:
        """Add a frame: `shown` is what images show by instance and camera, `uris` the files of the images."""
        time = frame.timestamp_ns * 1e-9
        streams = {name: {"uri": uri, "stream_properties": {"sync": {"timestamp": time}}} for name, uri in uris.items()}
        move = {"src": VEHICLE, "dst": WORLD, "transform_src_to_dst": _transform(frame.world_from_vehicle)}
        properties: dict[str, Any] = {"timestamp": time, "transforms": {f"{VEHICLE}_to_{WORLD}": move}}
        objects: dict[str, Any] = {}
        for item in other_objects(frame):
            key = item.instance
            self.names.setdefault(key, (item.name, SEMANTIC_CLASSES[item.semantic]))
            self.present.setdefault(key, []).append(number)
            self.cuboids.setdefault(key, []).append((number, _cuboid(item)))
            boxes = [_rectangle(camera, seen) for camera, seen in shown.get(key, {}).items()]
            objects[str(key)] = {"object_data": {"bbox": boxes, "num": _numbers(frame, item)}}
            if not boxes:
                del objects[str(key)]["object_data"]["bbox"]
        self.frames[str(number)] = {
            "objects": objects,
            "frame_properties": {**properties, **({"streams": streams} if streams else {})},
        }
        for name, image in frame.images.items():
            self.cameras.setdefault(name, image)

    def content(self) -> dict[str, Any]:
        """Return what stands under ``openlabel``."""
        objects: dict[str, Any] = {}
        for key, (name, kind) in self.names.items():
            cuboids = self.cuboids[key]
            entry: dict[str, Any] = {"name": name, "type": kind, "frame_intervals": _intervals(self.present[key])}
            if all(box == cuboids[0][1] for _, box in cuboids):
                entry["object_data"] = {"cuboid": [cuboids[0][1]]}
            else:
                for number, box in cuboids:
                    self.frames[str(number)]["objects"][str(key)]["object_data"]["cuboid"] = [box]
            objects[str(key)] = entry
        return {
            "metadata": {
                "schema_version": SCHEMA_VERSION,
                "annotator": "scarl-sionna",
                "name": self.scene.name,
                "comment": f"ground truth of a simulation, rig {self.source.rig['name']}",
            },
            "coordinate_systems": self._systems(),
            "streams": {name: self._stream(name, mount["kind"]) for name, mount in self.source.mounts.items()},
            "objects": objects,
            "frames": self.frames,
            "frame_intervals": [{"frame_start": 0, "frame_end": len(self.frames) - 1}],
        }

    def _systems(self) -> dict[str, Any]:
        """Return world, vehicle and sensors, cameras with x right, y down, z forward."""
        systems: dict[str, Any] = {
            WORLD: {"type": "scene_cs", "parent": "", "children": [VEHICLE]},
            VEHICLE: {"type": "local_cs", "parent": WORLD, "children": list(self.source.mounts)},
        }
        for name, mount in self.source.mounts.items():
            pose = self.source.vehicle_from_sensor(name)
            pose = pose.compose(OPTICAL) if mount["kind"] == "camera" else pose
            systems[name] = {
                "type": "sensor_cs",
                "parent": VEHICLE,
                "children": [],
                "pose_wrt_parent": _transform(pose),
            }
        return systems

    def _stream(self, name: str, kind: str) -> dict[str, Any]:
        stream: dict[str, Any] = {"type": STREAMS.get(kind, "other"), "description": kind}
        if name in self.cameras:
            stream["stream_properties"] = _intrinsics(self.cameras[name])
        return stream


def _transform(pose: Pose) -> dict[str, Any]:
    w, x, y, z = pose.quaternion.tolist()
    return {"quaternion": [x, y, z, w], "translation": pose.position.tolist()}


def _cuboid(item: ObjectState) -> dict[str, Any]:
    """Return a box in the world, with the velocity of its centre [m/s]."""
    w, x, y, z = item.world_from_box.quaternion.tolist()
    return {
        "name": "box",
        "coordinate_system": WORLD,
        "val": [*item.world_from_box.position.tolist(), x, y, z, w, *item.size.tolist()],
        "attributes": {"vec": [{"name": "velocity", "val": item.twist.linear.tolist()}]},
    }


def _rectangle(camera: str, seen: ImageObject) -> dict[str, Any]:
    """Return what an image shows of an object: middle, width, height [px], in the pixels of the camera's matrix."""
    left, top, right, bottom = seen.box.tolist()
    shares = {"occlusion": seen.occlusion, "truncation": seen.truncation, "num_pixels": seen.num_pixels}
    return {
        "name": f"{camera}/box",
        "coordinate_system": camera,
        "val": [(left + right - 1.0) / 2.0, (top + bottom - 1.0) / 2.0, right - left, bottom - top],
        "attributes": {"num": [{"name": key, "val": val} for key, val in shares.items() if not math.isnan(val)]},
    }


def _numbers(frame: Frame, item: ObjectState) -> list[dict[str, Any]]:
    """Return what sensors that make no image got of an object."""
    out: list[dict[str, Any]] = [{"name": "num_lidar_points", "val": int(item.num_lidar_points)}]
    number = frame.objects.index(item)
    for name, radar in frame.radars.items():
        if radar.object_power is not None:
            power = float(radar.object_power[number])
            out.append({"name": f"{name}/power", "coordinate_system": name, "val": power})
    return out


def _intrinsics(image: ImageFrame) -> dict[str, Any]:
    """Return matrix and lens; pixels count from the centre of the first one."""
    spec: CameraSpec = image.spec
    matrix = centred_intrinsics(image)
    size = {"width_px": spec.width, "height_px": spec.height}
    if isinstance(spec.lens, KannalaBrandt):
        (fx, _, cu), (_, fy, cv), _ = matrix.tolist()
        fisheye = {**size, "focal_length_x": fx, "focal_length_y": fy, "center_x_px": cu, "center_y_px": cv}
        return {"intrinsics_fisheye": {**fisheye, "lens_coeffs": list(spec.distortion_coefficients)}}
    rows = np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist()
    coefficients = list(spec.distortion_coefficients) or [0.0] * 5
    return {"intrinsics_pinhole": {**size, "camera_matrix": rows, "distortion_coeffs": coefficients}}


def _intervals(numbers: list[int]) -> list[dict[str, int]]:
    """Return runs of consecutive frames."""
    breaks = [0, *(k for k in range(1, len(numbers)) if numbers[k] != numbers[k - 1] + 1), len(numbers)]
    runs = pairwise(breaks)
    return [{"frame_start": numbers[first], "frame_end": numbers[last - 1]} for first, last in runs]
