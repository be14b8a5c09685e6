"""A sensor's result as files, and back: PNG for images, NPZ for lidar and radar. All but depth is kept bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.errors import OutputError
from scarl_sionna.core.lidar_spec import LidarSpec
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.radar_spec import RadarSpec
from scarl_sionna.core.results import ImageFrame, LidarScan, RadarFrame, SensorResult
from scarl_sionna.core.semantics import SEMANTIC_COLORS
from scarl_sionna.core.spec import Spec

IMAGE_NAMES = ("rgb", "depth", "semantic", "instance")
LIDAR_NAMES = tuple(item.name for item in fields(LidarScan) if item.name not in ("spec", "world_from_sensor"))

NOT_DATA = ("seconds",)
"""Diagnostics that are left out, so that the same seed gives the same bytes."""

DEPTH_RATIO = 20_000.0
"""Largest over smallest depth of the 16-bit code; half a step is ln(DEPTH_RATIO) / 65534 / 2 = 7.6e-5 of the depth."""
DEPTH_FORMULA = (
    "code 0: nothing hit (infinite); code 1 to 65535: "
    f"depth [m] = max_distance * {DEPTH_RATIO:g} ** ((code - 65535) / 65534), max_distance from the sensor's spec"
)
_LAST_CODE = 65535


def encode_depth(depth: npt.NDArray[np.float32], max_distance: float) -> npt.NDArray[np.uint16]:
    """Return depth [m] as a logarithmic 16-bit code.

    Parameters
    ----------
    depth : ndarray of float32, any shape
        [m]; inf where nothing is hit.
    max_distance : float
        Depth of the last code [m]. Smaller depths than ``max_distance / DEPTH_RATIO`` become that depth.

    Notes
    -----
    *Error*: at most 7.6e-5 of the depth (7.6 mm at 100 m).
    """
    values = np.asarray(depth, dtype=np.float64)
    hit = np.isfinite(values)
    ratio = np.where(hit, np.maximum(values, max_distance / DEPTH_RATIO), max_distance) / max_distance
    code = _LAST_CODE + np.log(ratio) / np.log(DEPTH_RATIO) * (_LAST_CODE - 1)
    return np.where(hit, np.clip(np.rint(code), 1, _LAST_CODE), 0).astype(np.uint16)


def decode_depth(code: npt.NDArray[np.uint16], max_distance: float) -> npt.NDArray[np.float32]:
    """Return the depth [m] of a 16-bit code; inf for code 0."""
    exponent = (code.astype(np.float64) - _LAST_CODE) / (_LAST_CODE - 1)
    return np.where(code == 0, np.inf, max_distance * DEPTH_RATIO**exponent).astype(np.float32)


def write_result(result: SensorResult, folder: Path) -> dict[str, Any]:
    """Write a result's arrays into an existing folder and return the rest of it as plain data."""
    if isinstance(result, ImageFrame):
        return _write_images(result, folder)
    if isinstance(result, LidarScan):
        np.savez_compressed(folder / "points.npz", **_lidar_arrays(result))
        return {"type": "lidar", "files": {"points": "points.npz"}, "num_points": result.num_points}
    if isinstance(result, RadarFrame):
        np.savez_compressed(folder / "adc.npz", adc_int=result.adc_int, adc_scale=np.float64(result.adc_scale))
        return {
            "type": "radar",
            "files": {"adc": "adc.npz"},
            "adc_scale": float(result.adc_scale),
            "num_saturated": int(result.num_saturated),
            "num_paths": int(result.num_paths),
            "diagnostics": plain({key: value for key, value in result.diagnostics.items() if key not in NOT_DATA}),
        }
    raise OutputError(
        f"cannot write a result of type {type(result).__name__}; a sensor must return an ImageFrame, LidarScan or RadarFrame"
    )


def _lidar_arrays(scan: LidarScan) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a scan that are there."""
    return {name: getattr(scan, name) for name in LIDAR_NAMES if getattr(scan, name) is not None}


def read_result(data: Mapping[str, Any], spec: Spec, folder: Path) -> SensorResult:
    """Return the result of :func:`write_result`."""
    pose = read_pose(data["world_from_sensor"])
    if data["type"] == "image":
        assert isinstance(spec, CameraSpec)
        images = {name: _read_image(name, folder / file, spec) for name, file in data["files"].items()}
        return ImageFrame(spec, pose, **images)
    if data["type"] == "lidar":
        assert isinstance(spec, LidarSpec)
        with np.load(folder / data["files"]["points"]) as arrays:
            return LidarScan(spec, pose, **{name: arrays[name] for name in LIDAR_NAMES if name in arrays})
    assert isinstance(spec, RadarSpec)
    with np.load(folder / data["files"]["adc"]) as arrays:
        adc_int, adc_scale = arrays["adc_int"], float(arrays["adc_scale"])
    return RadarFrame(
        spec, pose, adc_int, adc_scale, data["num_saturated"], data["num_paths"], dict(data["diagnostics"])
    )


def _write_images(result: ImageFrame, folder: Path) -> dict[str, Any]:
    files = {}
    for name in IMAGE_NAMES:
        pixels = getattr(result, name)
        if pixels is None:
            continue
        if name == "depth":
            pixels = encode_depth(pixels, result.spec.max_distance)
        image = Image.fromarray(pixels)
        if name == "semantic":  # ids with a palette: viewers show the classes' colours
            image = Image.frombytes("P", image.size, pixels.tobytes())
            image.putpalette(SEMANTIC_COLORS.tobytes())
        files[name] = f"{name}.png"
        image.save(folder / files[name])
    return {"type": "image", "files": files}


def _read_image(name: str, path: Path, spec: CameraSpec) -> npt.NDArray[Any]:
    with Image.open(path) as image:
        pixels = np.array(image)
    if name == "depth":
        return decode_depth(pixels.astype(np.uint16), spec.max_distance)
    return pixels.astype(np.uint16) if name == "instance" else pixels


def read_pose(data: Mapping[str, Any]) -> Pose:
    """Return the pose of :meth:`Pose.to_dict`."""
    return Pose(np.array(data["position"]), np.array(data["quaternion"]))


def plain(value: Any) -> Any:
    """Return a value as data that JSON can hold: mappings, lists, numbers, texts."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in (sorted(value) if isinstance(value, set | frozenset) else value)]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return str(value)
