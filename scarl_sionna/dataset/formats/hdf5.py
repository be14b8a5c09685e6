"""Writes frames as one HDF5 file: every field of the schema as an array over the frames of a scene."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, ParameterRangeError
from scarl_sionna.core.packages import require
from scarl_sionna.core.results import Frame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset import schema
from scarl_sionna.dataset.codec import plain
from scarl_sionna.dataset.readers.samples import kind_of
from scarl_sionna.dataset.schema import Field

from .output import whole_output_file
from .source import Convertible, FrameSource, OnProgress, as_source, no_progress

if TYPE_CHECKING:
    import h5py

FORMAT, FORMAT_VERSION = "scarl-hdf5", 2
"""Version 1 counted the objects of cameras and radars in ``offsets``, and those of lidars nowhere."""
DEPTH = Field(
    "depth",
    "float32",
    ("row", "column"),
    "m",
    "depth along the optical axis, inf where nothing is hit; negative behind the camera's plane (fisheyes)",
)
"""Depth as it is written here: decoded."""
_OBJECTS = "objects"
_COUNTS = ("num_points", "num_objects")


def export_hdf5(
    data: Convertible,
    out: str | Path,
    *,
    compression: Literal["gzip", "lzf"] | None = "gzip",
    overwrite: bool = False,
    on_progress: OnProgress = no_progress,
) -> Path:
    """Write frames as one HDF5 file.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`.
    out : path
        File to write.
    compression : str, optional
        ``"gzip"`` (level 1 after a byte shuffle, any HDF5 reads it), ``"lzf"`` (faster, h5py reads it) or None.
    overwrite : bool
    on_progress : callable

    Returns
    -------
    Path
        `out`: ``/scene/sensor/field`` with the frame as first axis. Fields of different length in each frame are
        written one frame after the other: those of frame k are rows ``offsets[k]`` to ``offsets[k + 1]`` of what a
        lidar has for each return and of ``objects``, and rows ``object_offsets[k]`` to ``object_offsets[k + 1]`` of
        what a sensor has for each object.

    Raises
    ------
    MissingPackageError
        If h5py is not installed.
    ParameterRangeError
        If there are no frames.
    DatasetError
        If a frame lacks a sensor or a field that the first frame of its scene has.
    OutputError
        If the file is there or cannot be written.
    """
    h5py = require("h5py", "hdf5")
    if compression not in ("gzip", "lzf", None):
        raise ParameterRangeError("compression", repr(compression), "'gzip', 'lzf' or None")
    source = as_source(data).not_empty()
    done = 0
    with whole_output_file(out, overwrite, is_ours) as partial, _Sink(partial) as sink:
        with h5py.File(sink, "w") as file:
            _describe(file, source)
            for scene in source.scenes:
                writer = _SceneWriter(h5py, file.create_group(scene.name), compression)
                for frame in scene:
                    writer.add(frame)
                    file.flush()
                    sink.check()
                    done += 1
                    on_progress(done, source.num_frames)
                writer.finish()
        sink.check()
    return Path(out)


def is_ours(path: Path) -> bool:
    """Return whether a file is one that `export_hdf5` wrote."""
    h5py = require("h5py", "hdf5")
    try:
        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("format") == FORMAT)
    except OSError:
        return False


class _Sink:
    """A file for the HDF5 library that keeps a failed write to itself until `check`.

    The library cannot close a file whose last writes failed (full disk): it leaves it open and crashes at the end of
    the process. So they are reported as done, and the export ends with the first error after the frame.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.error: OSError | None = None

    def __enter__(self) -> _Sink:
        self.file = self.path.open("w+b", buffering=0)
        return self

    def __exit__(self, *error: object) -> None:
        self.file.close()

    def check(self) -> None:
        """Raise the first error of a write."""
        if self.error is not None:
            raise self.error

    def write(self, data: bytes | memoryview) -> int:
        """Write all bytes."""
        view = memoryview(data).cast("B")
        done = 0
        try:
            while done < len(view):
                done += self.file.write(view[done:]) or 0
        except OSError as error:
            self.error = self.error or error
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file."""
        try:
            return self.file.truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0

    def readinto(self, buffer: bytearray | memoryview) -> int:
        """Read into a buffer."""
        return self.file.readinto(buffer) or 0

    def read(self, size: int = -1) -> bytes:
        """Read bytes."""
        return self.file.read(size) or b""

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move to a place."""
        return self.file.seek(offset, whence)

    def tell(self) -> int:
        """Return the place."""
        return self.file.tell()

    def flush(self) -> None:
        """Do nothing: there is no buffer."""


def _describe(file: h5py.File, source: FrameSource) -> None:
    file.attrs["format"], file.attrs["format_version"] = FORMAT, FORMAT_VERSION
    file.attrs["schema_version"] = schema.SCHEMA_VERSION
    file.attrs["rig"] = json.dumps(plain(source.rig))
    file.attrs["semantic_classes"] = list(SEMANTIC_CLASSES)


class _SceneWriter:
    """Appends frames to the arrays of one scene."""

    def __init__(self, h5py: ModuleType, group: h5py.Group, compression: str | None) -> None:
        self.h5py, self.group, self.compression = h5py, group, compression
        self.length = 0
        self.fields: dict[str, Field] | None = None

    def add(self, frame: Frame) -> None:
        """Append a frame to all arrays."""
        rows = dict(_frame_rows(frame))
        if self.fields is None:
            self.fields = {path: item for path, (item, _) in rows.items()}
        if rows.keys() != self.fields.keys():
            missing, new = sorted(self.fields.keys() - rows.keys()), sorted(rows.keys() - self.fields.keys())
            what = f"lacks {missing[0]}" if missing else f"has {new[0]}, which the first frame lacks"
            raise DatasetError(
                f"frame {frame.index} of {self.group.name.strip('/')} {what}", None, "convert a part of the rig"
            )
        for path, (item, value) in rows.items():
            self._append(path, item, value)
        self.length += 1

    def finish(self) -> None:
        """Attach the time of the frames to every array's first axis."""
        if not self.length:
            return
        time = self.group.create_dataset("time", data=self.group["timestamp_ns"][:] * 1e-9)
        time.attrs["units"] = "s"
        time.make_scale("frame")
        for path, item in (self.fields or {}).items():
            array = self.group[path]
            if _offsets_of(path, item) is None:
                array.dims[0].label = "frame"
                array.dims[0].attach_scale(time)

    def _append(self, path: str, item: Field, value: npt.NDArray[Any]) -> None:
        offsets = _offsets_of(path, item)
        ragged = offsets is not None
        if path not in self.group:
            self._create(path, item, value)
        array = self.group[path]
        start, count = array.shape[0], len(value) if ragged else 1
        array.resize(start + count, axis=0)
        array[start:] = value if ragged else value[None]
        if offsets is not None:
            self._offset(offsets, start + count)

    def _offset(self, path: str, end: int) -> None:
        offsets = self.group[path]
        if len(offsets) == self.length + 1:
            offsets.resize(self.length + 2, axis=0)
            offsets[-1] = end

    def _create(self, path: str, item: Field, value: npt.NDArray[Any]) -> None:
        rows = _offsets_of(path, item)
        ragged = rows is not None
        shape = value.shape[1:] if ragged else value.shape
        chunk = (4096 if ragged else 1, *shape)
        is_text = value.dtype.kind in "OU"
        pack = self.compression if value.nbytes > 1024 and not is_text else None
        options = {"compression_opts": 1} if pack == "gzip" else {}
        array = self.group.create_dataset(
            path,
            (0, *shape),
            self.h5py.string_dtype() if is_text else value.dtype,
            maxshape=(None, *shape),
            chunks=chunk,
            compression=pack,
            shuffle=pack is not None,
            **options,
        )
        axes = item.axes if ragged else ("frame", *item.axes)
        for dimension, name in zip(array.dims, axes, strict=False):
            dimension.label = name
        array.attrs.update(schema.attributes(item))
        if rows is None:
            return
        name = rows.rpartition("/")[2]
        array.attrs["offsets"] = name
        if rows not in self.group:
            offsets = self.group.create_dataset(rows, data=[0], maxshape=(None,), chunks=(1024,))
            of = "objects" if item.axes[0] == schema.OBJECT else "returns"
            offsets.attrs["long_name"] = f"{of} of frame k: rows {name}[k] to {name}[k + 1]"


def _offsets_of(path: str, item: Field) -> str | None:
    """Return the path of what tells the rows of a frame, or None for a field with one row a frame."""
    folder = path.rpartition("/")[0]
    axis = item.axes[0] if item.axes else ""
    if axis == schema.OBJECT and folder != _OBJECTS:
        return f"{folder}/object_offsets"
    return f"{folder}/offsets" if axis in (schema.POINT, schema.OBJECT) else None


def _frame_rows(frame: Frame) -> Iterable[tuple[str, tuple[Field, npt.NDArray[Any]]]]:
    """Yield path, field and value of all that a frame holds."""
    for item in schema.FRAME:
        yield item.name, (item, _value(frame, item))
    for item in schema.OBJECTS:
        if item.name not in _COUNTS:
            yield f"{_OBJECTS}/{item.name}", (item, _object_column(frame.objects, item))
    for name, result in frame.results.items():
        kind = kind_of(result)
        if not kind:
            raise DatasetError(
                f"sensor '{name}' is of a kind that HDF5 files do not hold", None, "convert a part of the rig"
            )
        for item in schema.TABLES[kind]:
            if item.name in _COUNTS:
                continue
            value = _value(result, item)
            if value.shape or value.dtype != object or value.item() is not None:
                yield f"{name}/{item.name}", (DEPTH if item.name == DEPTH.name else item, value)


def _value(holder: object, item: Field) -> npt.NDArray[Any]:
    """Return a field as an array; an object array of None where it was not made."""
    value = getattr(holder, "adc_int" if item.name == "adc" else item.name)
    if item.axes == schema.POSE_AXES:
        return np.concatenate([value.position, value.quaternion])
    if item.axes == schema.TWIST_AXES:
        return np.concatenate([value.linear, value.angular])
    if item.name == "diagnostics":
        return np.array(json.dumps(plain({k: v for k, v in value.items() if k != "seconds"})), dtype=object)
    return np.asarray(value)


def _object_column(objects: tuple[ObjectState, ...], item: Field) -> npt.NDArray[Any]:
    if item.name == "name":
        return np.array([entry.name for entry in objects], dtype=object)
    width = {"pose": 7, "twist": 6, "xyz": 3}.get(item.axes[-1])
    rows = [_object_value(entry, item.name) for entry in objects]
    return np.array(rows, dtype=item.dtype).reshape((-1, width) if width else (-1,))


def _object_value(entry: ObjectState, name: str) -> object:
    value = getattr(entry, name)
    if name == "world_from_box":
        return [*value.position, *value.quaternion]
    return [*value.linear, *value.angular] if name == "twist" else value
