"""A frame as compressed chunks and PNG files, and back.

The names of the arrays are relative to the scene: ``front_left/radar/adc``, ``objects/size``, ``timestamp_ns``.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from PIL import Image

from scarl_sionna.core.channels import RadioChannels
from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.registry import SETTINGS_TYPES, SPEC_TYPES, lifted, sensor_class, spec_type
from scarl_sionna.core.results import ClosedRadarFrame, Frame, ImageFrame, LidarScan, RadarFrame, SensorResult
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.semantics import SEMANTIC_COLORS
from scarl_sionna.core.spec import FieldValue, Spec

from . import schema
from .codec import encode_depth, plain
from .schema import Field
from .store.forms import MOST_SHARD_FRAMES
from .store.shards import ArrayInfo, encode_chunk

NOT_DATA = frozenset({"seconds"})
"""Diagnostics that are left out, so that the same seed gives the same bytes."""
FREE_SHARD_FRAMES = (3, 8)
"""Fewest and most frames in a shard, of datasets that ask for no number."""
_MOST_PIXELS = 100_000_000
PNG_LEVEL = {"semantic": 6, "instance": 6}
"""zlib level of the PNG files, 3 where not named: level 6 takes twice the time for 0 to 12 % of the bytes of a
picture."""


@dataclass(frozen=True)
class StoreOptions:
    """How frames are stored.

    Attributes
    ----------
    shard_frames : int
        Frames in one shard, the unit of work; 0 leaves it to :meth:`for_frames`.
    radar_format : {"int16", "complex64"}
        I/Q codes with their scale (3 to 4 times smaller), or the beat signal itself.
    object_capacity : int
        Length of the axis ``object``: no frame may hold more objects.
    layout : {"packed", "files"}
        A finished shard is two files, its record and a ZIP of all images and arrays, or a file for each of them.
    """

    shard_frames: int = 0
    radar_format: Literal["int16", "complex64"] = "int16"
    object_capacity: int = 1024
    layout: Literal["packed", "files"] = "packed"

    def __post_init__(self) -> None:
        if not 0 <= self.shard_frames <= MOST_SHARD_FRAMES:
            raise ParameterRangeError(
                "shard_frames", self.shard_frames, f"1 to {MOST_SHARD_FRAMES}, or 0: by the dataset"
            )
        if self.layout not in ("packed", "files"):
            raise ParameterRangeError("layout", repr(self.layout), "'packed' or 'files'")

    def for_frames(self, num_frames: int) -> StoreOptions:
        """Return these options with frames a shard: where none are asked for, a quarter of a dataset, but 3 to 8.

        So a few workers share a small dataset, and how it is stored depends on its frames, not on who makes them.
        """
        if self.shard_frames:
            return self
        fewest, most = FREE_SHARD_FRAMES
        return replace(self, shard_frames=min(max(num_frames // 4, fewest), most))

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for a manifest; the layout "files" is not named there: it is older than its name."""
        data = asdict(self)
        return data if self.layout != "files" else {name: item for name, item in data.items() if name != "layout"}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> StoreOptions:
        """Return the options of :meth:`to_dict`."""
        return cls(**{"layout": "files", "shard_frames": FREE_SHARD_FRAMES[1], **data})


@dataclass(frozen=True)
class EncodedFrame:
    """A frame as bytes: chunks and PNG files by name, the arrays that the chunks belong to, and what stands in JSON."""

    index: int
    arrays: Mapping[str, ArrayInfo]
    chunks: Mapping[str, bytes]
    files: Mapping[str, bytes]
    meta: Mapping[str, Any]

    @property
    def num_bytes(self) -> int:
        """Size on disk [bytes]."""
        return sum(map(len, self.chunks.values())) + sum(map(len, self.files.values()))


def encode_frame(frame: Frame, options: StoreOptions, pool: Executor) -> EncodedFrame:
    """Return a frame as bytes; they depend on the frame and the options only.

    Parameters
    ----------
    frame : Frame
    options : StoreOptions
    pool : Executor
        Threads that compress; the codecs release the interpreter's lock.

    Raises
    ------
    OutputError
        If a result has a type or a field that the schema does not know, or more entries than its capacity.
    """
    arrays: dict[str, ArrayInfo] = {}
    values: dict[str, npt.NDArray[Any]] = {}
    images: dict[str, tuple[str, npt.NDArray[Any]]] = {}
    meta: dict[str, Any] = {"index": int(frame.index), "seed": int(frame.seed), "sensors": {}}
    schema.check_fields(type(frame), schema.FRAME)

    def put(group: str, item: Field, data: FieldValue) -> None:
        name = f"{group}/{item.name}" if group else item.name
        if item.storage == "png":
            images[f"{name}/{frame.index:06d}.png"] = (item.name, data)
            return
        value = np.asarray(data)
        if schema.OBJECT in item.axes[:1] and group != "objects":
            value = pad(value, options.object_capacity)
        arrays[name] = ArrayInfo(item.dtype, value.shape, item.axes, schema.attributes(item))
        values[name] = value

    by_name = {item.name: item for item in schema.FRAME}
    put("", by_name["timestamp_ns"], frame.timestamp_ns)
    put("", by_name["world_from_vehicle"], pose_row(frame.world_from_vehicle))
    put("", by_name["vehicle_twist"], twist_row(frame.vehicle_twist))
    meta["objects"] = [item.name for item in frame.objects]
    for item, data in _object_columns(frame, options.object_capacity):
        put("objects", item, data)
    for name, result in frame.results.items():
        table, columns, extra = _sensor_columns(name, result, options)
        meta["sensors"][name] = {"type": table, **extra}
        for item, data in columns:
            put(name, item, data)
    chunks = {name: pool.submit(encode_chunk, value, arrays[name]) for name, value in values.items()}
    files = {path: pool.submit(encode_png, kind, pixels) for path, (kind, pixels) in images.items()}
    return EncodedFrame(
        frame.index,
        arrays,
        {name: future.result() for name, future in chunks.items()},
        {path: future.result() for path, future in files.items()},
        json.loads(json.dumps(plain(meta))),
    )


def pose_row(pose: Pose) -> npt.NDArray[np.float64]:
    """Return x, y, z, qw, qx, qy, qz."""
    return np.concatenate([pose.position, pose.quaternion])


def twist_row(twist: Twist) -> npt.NDArray[np.float64]:
    """Return linear and angular velocity in one row."""
    return np.concatenate([twist.linear, twist.angular])


def _object_columns(frame: Frame, capacity: int) -> Iterator[tuple[Field, Any]]:
    count = len(frame.objects)
    if count > capacity:
        raise OutputError(
            f"frame {frame.index} holds {count} objects, the dataset has room for {capacity}; raise object_capacity"
        )
    for kind in {type(item) for item in frame.objects}:
        schema.check_fields(kind, schema.OBJECTS)
    for item in schema.OBJECTS:
        if item.name == "num_objects":
            yield item, count
        elif item.storage == "array":
            column = [_row(getattr(entry, item.name)) for entry in frame.objects]
            tail = {"pose": (7,), "twist": (6,), "xyz": (3,)}.get(item.axes[-1], ())
            yield item, pad(np.array(column, dtype=item.dtype).reshape(count, *tail), capacity)


def _row(value: object) -> object:
    if isinstance(value, Pose):
        return pose_row(value)
    return twist_row(value) if isinstance(value, Twist) else value


def _sensor_columns(
    name: str, result: SensorResult, options: StoreOptions
) -> tuple[str, list[tuple[Field, Any]], dict[str, Any]]:
    """Return the table's name, the fields with their values, and what goes to JSON."""
    table = schema.RESULT_TYPES.get(type(result))
    if table is None:
        return _foreign_columns(name, result)
    known = schema.TABLES[table]
    schema.check_fields(type(result), known)
    columns: list[tuple[Field, Any]] = [(schema.POSE, pose_row(result.world_from_sensor))]
    extra: dict[str, Any] = {}
    if isinstance(result, RadarFrame | RadarScan | RadioChannels | ClosedRadarFrame):
        columns += _radar_columns(result, options) if isinstance(result, RadarFrame) else _arrays(result, known)
        extra["diagnostics"] = {key: value for key, value in result.diagnostics.items() if key not in NOT_DATA}
    elif isinstance(result, LidarScan):
        columns += _lidar_columns(name, result)
    elif isinstance(result, ImageFrame):
        for item in schema.camera_table(result.spec):
            pixels = getattr(result, item.name)
            if item is not schema.POSE and pixels is not None:
                is_code = item.name == "depth" and item is not schema.DEPTH_EXACT
                columns.append((item, encode_depth(pixels, result.spec.max_distance) if is_code else pixels))
    return table, columns, extra


def _radar_columns(result: RadarFrame, options: StoreOptions) -> Iterator[tuple[Field, Any]]:
    for item in schema.RADAR:
        if item.name == "adc":
            as_complex = options.radar_format == "complex64"
            yield (schema.ADC_COMPLEX, result.adc) if as_complex else (item, result.adc_int)
        elif item is not schema.POSE and item.storage == "array" and getattr(result, item.name) is not None:
            yield item, getattr(result, item.name)


def _arrays(
    result: RadioChannels | RadarScan | ClosedRadarFrame, table: tuple[Field, ...]
) -> Iterator[tuple[Field, Any]]:
    for item in table:
        if item is not schema.POSE and item.storage == "array" and getattr(result, item.name) is not None:
            yield item, getattr(result, item.name)


def _lidar_columns(name: str, result: LidarScan) -> Iterator[tuple[Field, Any]]:
    capacity = schema.lidar_capacity(result.spec)
    if result.num_points > capacity:
        raise OutputError(
            f"sensor '{name}' gave {result.num_points} returns, its specification allows {capacity}; this is a bug"
        )
    for item in schema.LIDAR:
        if item is schema.POSE:
            continue
        value = getattr(result, item.name)
        if value is not None:
            yield item, pad(value, capacity) if schema.POINT in item.axes else value


def _foreign_columns(name: str, result: SensorResult) -> tuple[str, list[tuple[Field, Any]], dict[str, Any]]:
    """Return the columns of a result whose sensor class declares them."""
    kind = getattr(result, "kind", None)
    table = foreign_fields(kind) if isinstance(kind, str) else None
    if table is None:
        raise OutputError(
            f"cannot store the result of sensor '{name}' of type {type(result).__name__}; "
            "return an ImageFrame, LidarScan, "
            "RadarFrame, RadarScan, ClosedRadarFrame or RadioChannels, or a dataclass with `kind`, "
            "and declare `stored_fields` and `result_type` on the sensor's class "
            "(see docs/dataset.md)"
        )
    assert isinstance(kind, str)
    known = {schema.POSE.name, "kind", *(item.name for item in table)}
    unknown = [item.name for item in fields(result) if item.name not in known and item.name != "spec"]
    if unknown:
        raise OutputError(f"`stored_fields` of the sensor kind '{kind}' does not name {', '.join(unknown)}")
    columns = [(schema.POSE, pose_row(result.world_from_sensor))]
    columns += [(item, getattr(result, item.name)) for item in table if getattr(result, item.name) is not None]
    return kind, columns, {}


def foreign_fields(kind: str) -> tuple[Field, ...] | None:
    """Return the fields that the class of a sensor kind declares to be stored, or None if it declares none."""
    declared = getattr(sensor_class(kind), "stored_fields", None)
    return None if declared is None else tuple(declared)


def pad(values: npt.NDArray[Any], capacity: int) -> npt.NDArray[Any]:
    """Return an array whose first axis is filled with zeros up to a capacity."""
    out = np.zeros((capacity, *values.shape[1:]), dtype=values.dtype)
    out[: len(values)] = values
    return out


def encode_png(kind: str, pixels: npt.NDArray[Any]) -> bytes:
    """Return an image as a PNG file; semantic ids get a palette with the colours of the classes."""
    image = Image.fromarray(pixels)
    if kind == "semantic":
        image = Image.frombytes("P", image.size, pixels.tobytes())
        image.putpalette(SEMANTIC_COLORS.tobytes())
    buffer = io.BytesIO()
    image.save(buffer, format="png", compress_level=PNG_LEVEL.get(kind, 3))
    return buffer.getvalue()


def decode_png(kind: str, data: bytes, where: str = "") -> npt.NDArray[Any]:
    """Return the pixels of :func:`encode_png`; `where` is what an error names.

    Raises
    ------
    DatasetError
        If they cannot be decoded, which checksums do not rule out where somebody else wrote them, or are too many.
    """
    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise ValueError(f"{image.width} x {image.height} pixels, at most {_MOST_PIXELS} are read")
            pixels = np.array(image)
    except Exception as error:  # a decoder of damaged data has errors of any kind
        raise DatasetError(f"an image cannot be decoded ({error!s:.200})", where or None) from error
    return pixels.astype(np.uint16, copy=False) if kind in ("instance", "depth") else pixels


def spec_of(mount: Mapping[str, Any]) -> Spec:
    """Return the specification in a rig's entry of a sensor."""
    return spec_type(mount["kind"])(**lifted(mount["kind"], mount["spec"])[0])


def mount_today(mount: Mapping[str, Any]) -> dict[str, Any]:
    """Return a rig's entry of a sensor, of any schema version, as `SensorMount.to_dict` writes it today."""
    kind = mount["kind"]
    if kind not in SETTINGS_TYPES:
        return dict(mount)
    spec, settings = lifted(kind, mount["spec"], mount.get("settings"))
    return {
        **mount,
        "spec": SPEC_TYPES[kind](**spec).model_dump(mode="json"),
        "settings": SETTINGS_TYPES[kind](**(settings or {})).model_dump(mode="json"),
    }
