"""Frames as flat dictionaries of arrays: what TensorFlow, PyTorch and the record formats are fed with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import DatasetError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.results import Frame
from scarl_sionna.core.spec import FieldValue
from scarl_sionna.core.units import watt_to_dbm
from scarl_sionna.dataset.derived.boxes import EGO_OFFSET
from scarl_sionna.dataset.formats.source import Frames
from scarl_sionna.dataset.schema import (
    CAMERA,
    CLOSED_RADAR,
    LIDAR,
    OBJECT,
    POINT,
    RADIO,
    RESULT_TYPES,
    SCANNING_RADAR,
    TABLES,
)
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import range_doppler, virtual_cube

if TYPE_CHECKING:
    from .reader import Dataset, Scene, StoredFrame

Array = npt.NDArray[Any]
AnyFrame: TypeAlias = "Frame | StoredFrame"
FrameData: TypeAlias = "Dataset | Scene | Frames | str | Path"
"""Frames, or the place of a dataset that holds them."""

FRAME_ITEMS = ("boxes", "box_semantic", "box_instance", "timestamp_ns", "world_from_vehicle")
RADAR_ITEMS = ("adc", "adc_int", "adc_scale", "cube", "range_doppler", "range_azimuth")
IMAGE_ITEMS = tuple(item.name for item in CAMERA if item.name != "world_from_sensor")
LIDAR_ITEMS = ("points", *(item.name for item in LIDAR if item.name not in ("world_from_sensor", "num_points")))
RADIO_ITEMS, SCAN_ITEMS, CLOSED_ITEMS = (
    tuple(item.name for item in table if item.storage == "array" and item.name != "world_from_sensor")
    for table in (RADIO, SCANNING_RADAR, CLOSED_RADAR)
)
ITEMS_OF_KIND = {
    "radar": RADAR_ITEMS,
    "scanning_radar": SCAN_ITEMS,
    "closed_radar": CLOSED_ITEMS,
    "camera": IMAGE_ITEMS,
    "lidar": LIDAR_ITEMS,
    "radio": RADIO_ITEMS,
}
_SHOWN_OF_KIND = {
    "radar": ("adc_int", "adc_scale"),
    "scanning_radar": ("image", "azimuth", "time"),
    "closed_radar": ("power",),
    "lidar": ("points", "semantic", "instance"),
    "radio": ("a", "tau", "doppler", "valid", "cfr"),
}
"""What is read of a sensor where nothing is asked for."""
_BOX_ITEMS = ("boxes", "box_semantic", "box_instance")
_VARYING = {
    ("lidar", "points"),
    *((kind, item.name) for kind, table in TABLES.items() for item in table if item.axes[:1] in ((POINT,), (OBJECT,))),
}
"""Kinds and fields whose first axis differs in length from frame to frame: one row a return or an object."""


@dataclass(frozen=True)
class ItemSpec:
    """Type of an item: dtype, and shape with None for an axis whose length differs from frame to frame."""

    dtype: np.dtype[Any]
    shape: tuple[int | None, ...]


class FrameSamples:
    """Frames as dictionaries of arrays: ``samples[i]`` reads the i-th one, and only the items asked for.

    It has ``__len__`` and ``__getitem__`` and can be sent to other processes, as PyTorch's map-style datasets.

    Parameters
    ----------
    data : dataset of `open_dataset`, scene of it, path or URL of a dataset, or sequence of Frame
    items : sequence of str, or mapping of str to str, optional
        What to read: ``"sensor:field"`` (``"front_left/radar:range_doppler"``), or a field of the frame (``"boxes"``).
        A mapping gives keys of its own: ``{"map": "front_left/radar:range_doppler", "boxes": "boxes"}``. Left out: all
        that is stored.

        =============  =================================================================================================
        radar          ``adc`` complex64 (num_rx, num_chirps_total, num_samples) [sqrt(W)]; ``adc_int`` int16 (..., 2);
                       ``adc_scale`` float64, a code times it is in sqrt(W);
                       ``cube`` complex64 (num_virtual, num_chirps, num_samples) [sqrt(W)];
                       ``range_doppler`` float32 (num_doppler, num_range) [dBm]; ``range_azimuth`` float32
                       (num_range, num_azimuth) [dBm]
        camera         ``rgb`` uint8 (height, width, 3); ``depth`` float32 [m]; ``semantic`` uint8; ``instance`` uint16;
                       ``normal``, ``flow`` float32; ``object_pixels``, ``object_box``, ``object_visible_box``,
                       ``object_occlusion``, ``object_truncation``: one row an object of the frame (`ImageFrame`)
        lidar          ``points`` float32 (N, 5): x, y, z [m, sensor frame], intensity, radial velocity [m/s]; or a
        field of
                       `LidarScan`, one row a return
        scanning_radar a field of `RadarScan`: ``image``, ``azimuth``, ``time`` and the like
        closed_radar   ``power`` float32 (num_velocity, num_range, num_azimuth), or another field of `ClosedRadarFrame`
        radio          a field of `RadioChannels`: ``cfr``, ``a``, ``tau``, ``doppler``, ``valid`` and the like
        frame          ``boxes`` float32 (M, 10): x, y, z, length, width, height [m], yaw [rad], velocity over ground
        [m/s], along the
                       axes of the vehicle frame, without the vehicle itself; ``box_semantic`` uint8; ``box_instance``
                       int32; ``timestamp_ns`` int64; ``world_from_vehicle`` float64 (7,)
        =============  =================================================================================================

    Raises
    ------
    ParameterRangeError
        If there are no frames or no items.
    UnknownNameError
        If a sensor or a field is unknown.
    """

    def __init__(self, data: FrameData, items: Sequence[str] | Mapping[str, str] | None = None) -> None:
        if isinstance(data, str | Path):
            from .reader import open_dataset

            data = open_dataset(data)
        self.frames = data
        if not len(data):
            raise ParameterRangeError("dataset", "without frames", "at least one frame", "export it first")
        first = data[0]
        if items is None:
            items = _all_items(first)
        self.items: dict[str, str] = dict(items) if isinstance(items, Mapping) else {item: item for item in items}
        if not self.items:
            raise ParameterRangeError("items", "()", "at least one item, for instance 'boxes'")
        for item in self.items.values():
            _check_item(first, item)

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> dict[str, Array]:
        frame = self.frames[int(index)]
        cache: dict[str, Any] = {}
        return {key: _read(frame, item, cache) for key, item in self.items.items()}

    def signature(self) -> dict[str, ItemSpec]:
        """Return the type of every item, from the first frame."""
        first = self.frames[0]
        return {key: _spec_of(first, self.items[key], value) for key, value in self[0].items()}


def frame_objects(frame: AnyFrame) -> dict[str, Array]:
    """Return the objects of a frame as columns.

    Instance, semantic, is_actor, world_from_box (N, 7), size (N, 3), twist (N, 6).
    """
    if not isinstance(frame, Frame):
        columns = frame.label_arrays
        return {
            name: np.array(columns[name])
            for name in ("instance", "semantic", "is_actor", "world_from_box", "size", "twist")
        }
    objects = frame.objects
    return {
        "instance": np.array([item.instance for item in objects], np.int32),
        "semantic": np.array([item.semantic for item in objects], np.uint8),
        "is_actor": np.array([item.is_actor for item in objects], np.bool_),
        "world_from_box": np.array(
            [[*item.world_from_box.position, *item.world_from_box.quaternion] for item in objects]
        ).reshape(-1, 7),
        "size": np.array([item.size for item in objects], np.float64).reshape(-1, 3),
        "twist": np.array([[*item.twist.linear, *item.twist.angular] for item in objects]).reshape(-1, 6),
    }


def box_arrays(frame: AnyFrame) -> dict[str, Array]:
    """Return the boxes of a frame's objects in the vehicle frame, without the vehicle itself; see `FrameSamples`."""
    columns = frame_objects(frame)
    vehicle = frame.world_from_vehicle
    rotation = Rotation.from_quat(np.roll(vehicle.quaternion, -1)).inv()
    poses = columns["world_from_box"]
    place = rotation.apply(poses[:, :3] - vehicle.position) if len(poses) else np.zeros((0, 3))
    own = columns["is_actor"] & np.all(np.abs(place[:, :2]) < EGO_OFFSET, axis=1)
    rows = np.zeros((len(poses), 10), np.float32)
    if len(poses):
        forward = (rotation * Rotation.from_quat(np.roll(poses[:, 3:], -1, axis=1))).apply([1.0, 0.0, 0.0])
        rows[:, :3], rows[:, 3:6] = place, columns["size"]
        rows[:, 6] = np.arctan2(forward[:, 1], forward[:, 0])
        rows[:, 7:] = rotation.apply(columns["twist"][:, :3])
    return {
        "boxes": rows[~own],
        "box_semantic": columns["semantic"][~own].astype(np.uint8),
        "box_instance": columns["instance"][~own].astype(np.int32),
    }


def kind_of(result: object) -> str:
    """Return the kind of a sensor's result, stored or in memory; "" for a kind of another package."""
    table = getattr(result, "table", None)
    if table is None:
        return next((kind for known, kind in RESULT_TYPES.items() if isinstance(result, known)), "")
    return next((kind for kind, known in TABLES.items() if known is table), "")


def _all_items(frame: AnyFrame) -> list[str]:
    """Return all that a frame holds: raw radar data, images, lidar points with labels, channels, boxes, time, pose."""
    out = []
    for name, result in frame.results.items():
        kind = kind_of(result)
        if kind == "camera":
            out += [f"{name}:{field}" for field in IMAGE_ITEMS if getattr(result, field) is not None]
        elif kind:
            out += [f"{name}:{field}" for field in _SHOWN_OF_KIND[kind]]
    return [*out, *FRAME_ITEMS]


def _check_item(frame: AnyFrame, item: str) -> None:
    sensor, colon, field = item.rpartition(":")
    if not colon:
        if item not in FRAME_ITEMS:
            raise UnknownNameError("item", item, FRAME_ITEMS, "or 'sensor:field' for what a sensor gives")
        return
    if sensor not in frame.results:
        raise UnknownNameError("sensor", sensor, frame.results)
    known = ITEMS_OF_KIND.get(kind_of(frame.results[sensor]), ())
    if field not in known:
        raise UnknownNameError(f"field of {sensor}", field, known)


def _read(frame: AnyFrame, item: str, cache: dict[str, Any]) -> Array:
    sensor, colon, field = item.rpartition(":")
    if not colon:
        if item in _BOX_ITEMS:
            if "boxes" not in cache:
                cache.update(box_arrays(frame))
            return cache[item]  # type: ignore[no-any-return]
        if item == "timestamp_ns":
            return np.array(frame.timestamp_ns, np.int64)
        pose = frame.world_from_vehicle
        return np.concatenate([pose.position, pose.quaternion])
    try:
        result = frame.results[sensor]
    except KeyError:
        raise DatasetError(f"frame {frame.index} has no sensor '{sensor}'", None, "leave the frame out") from None
    value = _derived(result, field, f"{sensor}:cube", cache)
    if value is None:
        raise DatasetError(f"frame {frame.index} has no '{field}' of '{sensor}'", None, "leave the item out")
    return np.asarray(value)


def _derived(result: FieldValue, field: str, cube_key: str, cache: dict[str, Any]) -> FieldValue:
    """Return a field of a result, or what is computed from its fields."""
    if field in ("cube", "range_doppler", "range_azimuth"):
        if cube_key not in cache:
            cache[cube_key] = virtual_cube(result.adc, result.spec)
        cube = cache[cube_key]
        if field == "cube":
            return cube
        if field == "range_doppler":
            return watt_to_dbm(range_doppler(cube, result.spec).power).astype(np.float32)
        rda = range_doppler_angle(cube, result.spec)
        power = rda.data.max(axis=0)
        return watt_to_dbm(power if rda.elevation is None else power.max(axis=-1)).astype(np.float32)
    if field == "points":
        columns = [result.position, result.intensity[:, None], result.radial_velocity[:, None]]
        return np.concatenate(columns, axis=1, dtype=np.float32)
    return getattr(result, field)


def _spec_of(frame: AnyFrame, item: str, value: Array) -> ItemSpec:
    sensor, colon, field = item.rpartition(":")
    varies = (kind_of(frame.results[sensor]), field) in _VARYING if colon else field in _BOX_ITEMS
    return ItemSpec(value.dtype, (None, *value.shape[1:]) if varies else value.shape)
