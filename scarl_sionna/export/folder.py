"""Frames as a folder of readable files: one subfolder a frame, a JSON with calibration and poses.

A frame is written under a temporary name and renamed when it is whole, so that a frame folder is complete or not there.
"""

from __future__ import annotations

import errno
import json
import re
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.lidar_spec import LidarSpec
from scarl_sionna.core.pose import Twist
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.registry import spec_type
from scarl_sionna.core.results import Frame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES, SEMANTIC_COLORS
from scarl_sionna.core.spec import Spec

from .atomic import PARTIAL, partial_path, whole_file
from .codec import DEPTH_FORMULA, plain, read_pose, read_result, write_result

FORMAT = "scarl-frame-folder"
FORMAT_VERSION = 1
_FRAME_FOLDER = re.compile(r"frame_(\d{6,})")

_RADAR_NUMBERS = (
    "num_tx", "num_rx", "num_virtual", "num_chirps_total", "num_samples", "chirp_slope", "sample_rate",
    "doppler_interval", "center_frequency", "range_resolution", "max_range", "velocity_resolution",
    "unambiguous_velocity",
)  # fmt: skip

CONVENTIONS = {
    "units": "SI: metres, seconds, radians, watts; another unit stands as suffix of the name",
    "poses": "world_from_sensor maps points of the sensor frame into the world; quaternion [w, x, y, z]",
    "vehicle, sensor frames": "x forward (boresight, optical axis), y left, z up; vehicle origin on the ground",
    "camera_optical frame": "x right, y down, z forward; pixel ~ intrinsics @ point; centre of the first pixel (0.5, 0.5)",
    "radial_velocity": "positive when the distance opens",
    "twist": "linear velocity of the frame's origin and angular velocity, world axes",
    "depth": f"distance along the optical axis; {DEPTH_FORMULA}",
    "semantic": "8-bit ids, index into semantic_classes; the PNG palette holds semantic_colors",
    "instance": "16-bit ids, 0 where nothing is hit",
    "adc": "adc_int * adc_scale = beat signal [sqrt(W)], axes receiver, chirp * num_tx + transmitter, sample, I/Q",
}


class FrameFolderWriter:
    """Writes frames into a folder.

    Parameters
    ----------
    out : path
        Made if it is not there.
    configuration : mapping
        Plain data: all that decides a frame's bytes; ``configuration["rig"]`` is `Rig.to_dict()`. Frames of the same
        configuration that are there are kept.
    overwrite : bool
        Remove the frames that are there.

    Raises
    ------
    OutputError
        If the folder cannot be written, or holds frames of another configuration.
    """

    def __init__(self, out: str | Path, configuration: Mapping[str, Any], overwrite: bool = False) -> None:
        self.out = Path(out)
        self.configuration = json.loads(json.dumps(plain(configuration)))
        self._mounts = {item["name"]: item for item in self.configuration["rig"]["sensors"]}
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            for stale in self.out.glob(f"{PARTIAL}*"):  # what a killed run left
                if stale.is_dir():
                    shutil.rmtree(stale)
                else:
                    stale.unlink()
            if overwrite:
                (self.out / "dataset.json").unlink(missing_ok=True)
                for folder in frame_folders(self.out):
                    shutil.rmtree(folder)
            self._check_same_configuration()
            _write_json(self.out / "dataset.json", self._dataset())
        except OutputError:
            raise
        except OSError as error:
            raise _output_error(self.out, error) from error

    def folder(self, index: int) -> Path:
        """Return the folder of a frame."""
        return self.out / f"frame_{index:06d}"

    def complete(self) -> set[int]:
        """Return the indices of the frames that are there."""
        return {int(folder.name.removeprefix("frame_")) for folder in frame_folders(self.out)}

    def write(self, frame: Frame) -> Path:
        """Write a frame as a whole and return its folder.

        Raises
        ------
        OutputError
            If the frame is there, or cannot be written (no permission, disk full); nothing is left of it then.
        """
        target = self.folder(frame.index)
        partial = partial_path(target)
        try:
            partial.mkdir()
            _write_json(partial / "frame.json", self._frame(frame, partial))
            partial.rename(target)
        except BaseException as error:
            shutil.rmtree(partial, ignore_errors=True)
            if not isinstance(error, OSError) or isinstance(error, OutputError):
                raise
            if target.exists():
                raise OutputError(f"{target} is there; choose another folder or overwrite") from error
            raise _output_error(target, error) from error
        return target

    def _check_same_configuration(self) -> None:
        path = self.out / "dataset.json"
        if not path.exists():
            if self.complete():
                raise OutputError(f"{self.out} holds frames without a dataset.json; choose another folder or overwrite")
            return
        try:
            there = json.loads(path.read_text(encoding="utf-8"))["configuration"]
        except (ValueError, KeyError, TypeError) as error:
            raise OutputError(f"{path} is not a dataset of this program; choose another folder or overwrite") from error
        changes = _differences(there, self.configuration)
        if changes and self.complete():
            shown = "; ".join(changes[:5]) + (f"; and {len(changes) - 5} more" if len(changes) > 5 else "")
            raise OutputError(
                f"{self.out} holds frames of another configuration ({shown}); choose another folder or overwrite"
            )

    def _dataset(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "format_version": FORMAT_VERSION,
            "configuration": self.configuration,
            "calibration": {
                name: {
                    "kind": mount["kind"],
                    "vehicle_from_sensor": mount["vehicle_from_sensor"],
                    **_derived(_spec(mount)),
                }
                for name, mount in self._mounts.items()
            },
            "conventions": CONVENTIONS,
            "semantic_classes": list(SEMANTIC_CLASSES),
            "semantic_colors": SEMANTIC_COLORS.tolist(),
        }

    def _frame(self, frame: Frame, folder: Path) -> dict[str, Any]:
        """Write the arrays of all sensors and return the frame's plain data."""
        sensors = {}
        for name, result in frame.results.items():
            mount = self._mounts[name]
            place = folder / name
            place.mkdir(parents=True)
            sensors[name] = {
                "kind": mount["kind"],
                "vehicle_from_sensor": mount["vehicle_from_sensor"],
                "world_from_sensor": result.world_from_sensor.to_dict(),
                **write_result(result, place),
            }
        return {
            "format_version": FORMAT_VERSION,
            "index": frame.index,
            "timestamp_ns": frame.timestamp_ns,
            "seed": frame.seed,
            "world_from_vehicle": frame.world_from_vehicle.to_dict(),
            "vehicle_twist": _twist_data(frame.vehicle_twist),
            "sensors": sensors,
            "objects": [_object_data(item) for item in frame.objects],
        }


def frame_folders(out: str | Path) -> list[Path]:
    """Return the complete frames of a folder, by index."""
    folders = [path for path in Path(out).iterdir() if _FRAME_FOLDER.fullmatch(path.name) and path.is_dir()]
    return sorted(folders, key=lambda path: int(path.name.removeprefix("frame_")))


def read_frame(folder: str | Path) -> Frame:
    """Return the frame of a folder that :class:`FrameFolderWriter` wrote.

    All is as it was written, but depth, which is within 7.6e-5 of its value (see `codec.encode_depth`), and
    the times that something took (`timings`, the solver's ``seconds``), which are not stored.

    Raises
    ------
    ParameterRangeError
        If the folder is not such a frame, or was written by a newer format.
    """
    folder = Path(folder)
    try:
        dataset = json.loads((folder.parent / "dataset.json").read_text(encoding="utf-8"))
        data = json.loads((folder / "frame.json").read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ParameterRangeError(
            "frame folder", folder, "a folder frame_000000, frame_000001, ... beside its dataset.json", str(error)
        ) from error
    if dataset.get("format") != FORMAT or dataset.get("format_version", 0) > FORMAT_VERSION:
        found = f"{dataset.get('format')} {dataset.get('format_version')}"
        raise ParameterRangeError("format", found, f"{FORMAT} up to version {FORMAT_VERSION}", "update scarl-sionna")
    specs = {item["name"]: _spec(item) for item in dataset["configuration"]["rig"]["sensors"]}
    return Frame(
        index=data["index"],
        timestamp_ns=data["timestamp_ns"],
        seed=data["seed"],
        world_from_vehicle=read_pose(data["world_from_vehicle"]),
        vehicle_twist=_read_twist(data["vehicle_twist"]),
        results={name: read_result(item, specs[name], folder / name) for name, item in data["sensors"].items()},
        objects=tuple(_read_object(item) for item in data["objects"]),
    )


def _spec(mount: Mapping[str, Any]) -> Spec:
    """Return the specification in a rig file's entry of a sensor."""
    return spec_type(mount["kind"])(**mount["spec"])


def _derived(spec: Spec) -> dict[str, Any]:
    """Return the numbers of a specification that a reader would have to compute."""
    if isinstance(spec, CameraSpec):
        return {"width": spec.width, "height": spec.height, "intrinsics": spec.intrinsics.tolist()}
    if isinstance(spec, LidarSpec):
        return {"num_azimuth": spec.num_azimuth, "num_elevation": spec.num_elevation}
    if isinstance(spec, RadarSpec):
        return {name: getattr(spec, name) for name in _RADAR_NUMBERS}
    return {}


def _twist_data(twist: Twist) -> dict[str, list[float]]:
    return {"linear": twist.linear.tolist(), "angular": twist.angular.tolist()}


def _read_twist(data: Mapping[str, Any]) -> Twist:
    return Twist(np.array(data["linear"]), np.array(data["angular"]))


def _object_data(item: ObjectState) -> dict[str, Any]:
    return {
        "name": item.name,
        "instance": int(item.instance),
        "semantic": int(item.semantic),
        "semantic_class": SEMANTIC_CLASSES[item.semantic],
        "is_actor": bool(item.is_actor),
        "world_from_box": item.world_from_box.to_dict(),
        "size": np.asarray(item.size, dtype=np.float64).tolist(),
        "twist": _twist_data(item.twist),
        "num_pixels": item.num_pixels,
        "num_lidar_points": item.num_lidar_points,
    }


def _read_object(data: Mapping[str, Any]) -> ObjectState:
    keep = ("name", "instance", "semantic", "is_actor", "num_pixels", "num_lidar_points")
    return ObjectState(
        **{name: data[name] for name in keep},
        world_from_box=read_pose(data["world_from_box"]),
        size=np.array(data["size"], dtype=np.float64),
        twist=_read_twist(data["twist"]),
    )


def _write_json(path: Path, data: Any) -> None:
    """Write JSON, whole or not at all; numbers are written so that they read back exactly."""
    with whole_file(path) as partial:
        partial.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _differences(old: Any, new: Any, name: str = "") -> list[str]:
    """Return the entries in which two plain values differ, as texts."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [*old, *(key for key in new if key not in old)]
        return [text for key in keys for text in _differences(old.get(key), new.get(key), f"{name}.{key}".lstrip("."))]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = enumerate(zip(old, new, strict=True))
        return [text for index, (a, b) in pairs for text in _differences(a, b, f"{name}[{index}]")]
    if isinstance(old, list) and isinstance(new, list):
        return [f"{name}: {len(old)} entries there, {len(new)} asked for"]
    return [] if old == new else [f"{name}: {old!r:.60} there, {new!r:.60} asked for"]


def _output_error(path: Path, error: OSError) -> OutputError:
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    remedy = "free some space" if full else "choose a folder that you may write to"
    return OutputError(f"cannot write {path}: {error.strerror or error}; {remedy}")
