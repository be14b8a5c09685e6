"""Results of sensors as they lie in a dataset: each array is read when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.channels import RadioChannels
from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.registry import sensor_class
from scarl_sionna.core.results import ClosedRadarFrame, ImageFrame, LidarScan, RadarFrame, SensorResult
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.dataset import schema
from scarl_sionna.dataset.codec import decode_depth
from scarl_sionna.dataset.encoding import decode_png, foreign_fields

Result = TypeVar("Result")


class SpecsOfDataset(Protocol):
    """What a stored result asks of its dataset; see :class:`scarl_sionna.dataset.readers.reader.Dataset`."""

    def spec(self, sensor: str) -> Spec:
        """Return the specification of a sensor."""


class SceneInDataset(Protocol):
    """What a stored result asks of its scene; see :class:`scarl_sionna.dataset.readers.reader.Scene`."""

    @property
    def dataset(self) -> SpecsOfDataset:
        """The dataset that the scene belongs to."""
        raise NotImplementedError

    def read_array(self, index: int, name: str) -> npt.NDArray[Any] | None:
        """Return one array of one frame, or None if the frame does not have it."""

    def read_image(self, index: int, sensor: str, image: str) -> bytes | None:
        """Return an image's file, checked, or None if the frame does not have it."""

    def meta(self, index: int) -> dict[str, Any]:
        """Return what of a frame stands in JSON."""


class FrameInDataset(Protocol):
    """What a stored result asks of its frame; see :class:`scarl_sionna.dataset.readers.reader.StoredFrame`."""

    @property
    def scene(self) -> SceneInDataset:
        """The scene of the dataset that it belongs to."""

    @property
    def index(self) -> int:
        """Number of the frame in its scene."""
        raise NotImplementedError


class StoredResult:
    """What one sensor gave in one frame. Fields of the schema are attributes; one that was not made is None.

    Attributes
    ----------
    name : str
        The sensor's name in the rig.
    """

    table: tuple[schema.Field, ...] = ()

    def __init__(self, frame: FrameInDataset, name: str) -> None:
        self._frame, self.name = frame, name
        self._by_name = {item.name: item for item in self.table}

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name} of frame {self._frame.index}>"

    @property
    def spec(self) -> FieldValue:
        """Specification of the sensor."""
        spec: Spec = self._frame.scene.dataset.spec(self.name)
        return spec

    @cached_property
    def world_from_sensor(self) -> Pose:
        """Pose of the sensor."""
        row = self.read("world_from_sensor")
        return Pose(row[:3], row[3:])  # type: ignore[index]

    def read(self, field: str) -> npt.NDArray[Any] | None:
        """Return a field as it is stored, or None if this frame does not have it."""
        scene, index = self._frame.scene, self._frame.index
        value = scene.read_array(index, f"{self.name}/{field}")
        item = self._by_name.get(field)
        if value is None or item is None or item.axes[:1] != (schema.OBJECT,):
            return value
        count = scene.read_array(index, "objects/num_objects")
        return value[: int(count)]  # type: ignore[arg-type]

    def __getattr__(self, name: str) -> FieldValue:
        if name.startswith("_") or name not in self._by_name:
            raise AttributeError(f"{type(self).__name__} has no field '{name}' (fields: {', '.join(self._by_name)})")
        value = self.field(name)
        self.__dict__[name] = value
        return value

    def field(self, name: str) -> FieldValue:
        """Return a field as the sensor gave it."""
        if name == "diagnostics":
            meta = self._frame.scene.meta(self._frame.index)
            return dict(meta["sensors"][self.name]["diagnostics"])
        value = self.read(name)
        return value.item() if value is not None and value.ndim == 0 else value

    def to_result(self) -> SensorResult:
        """Return the result with all arrays in memory."""
        raise NotImplementedError


class StoredRadar(StoredResult):
    """A stored radar frame.

    `adc` complex64 [sqrt(W)], `adc_int` the converter's codes, `adc_scale`, `num_saturated`, `num_paths`.
    """

    table = schema.RADAR

    def field(self, name: str) -> FieldValue:
        """Return a field as the sensor gave it."""
        if name != "adc":
            return super().field(name)
        stored = self.read("adc")
        if stored is None or stored.dtype == np.complex64:
            return stored
        return RadarFrame(self.spec, self.world_from_sensor, stored, self.adc_scale).adc

    @cached_property
    def adc_int(self) -> npt.NDArray[np.int16]:
        """Codes of I and Q, shape (num_rx, num_chirps_total, num_samples, 2)."""
        stored = self.read("adc")
        assert stored is not None
        if stored.dtype == np.int16:
            return stored
        # a code times the scale is within 6e-8 of it in float32, far below half a code
        return np.rint(stored[..., None].view(np.float32) / self.adc_scale).astype(np.int16)

    def to_result(self) -> RadarFrame:
        """Return the radar's frame with all arrays in memory."""
        names = [item.name for item in fields(RadarFrame) if item.name not in ("spec", "world_from_sensor")]
        return RadarFrame(self.spec, self.world_from_sensor, **{name: getattr(self, name) for name in names})


class StoredRadio(StoredResult):
    """Stored channels of a radio: the fields of `RadioChannels`."""

    table = schema.RADIO

    def to_result(self) -> RadioChannels:
        """Return the channels with all arrays in memory."""
        names = [item.name for item in fields(RadioChannels) if item.name not in ("spec", "world_from_sensor")]
        return RadioChannels(self.spec, self.world_from_sensor, **{name: getattr(self, name) for name in names})


class StoredRadarScan(StoredResult):
    """A stored turn of a scanning radar: the fields of `RadarScan`."""

    table = schema.SCANNING_RADAR

    def to_result(self) -> RadarScan:
        """Return the turn with all arrays in memory."""
        names = [item.name for item in fields(RadarScan) if item.name not in ("spec", "world_from_sensor")]
        return RadarScan(self.spec, self.world_from_sensor, **{name: getattr(self, name) for name in names})


class StoredClosedRadar(StoredResult):
    """A stored map of a radar without raw data: the fields of `ClosedRadarFrame`."""

    table = schema.CLOSED_RADAR

    def to_result(self) -> ClosedRadarFrame:
        """Return the map in memory."""
        return ClosedRadarFrame(self.spec, self.world_from_sensor, self.power, self.num_paths, self.diagnostics)


class StoredLidar(StoredResult):
    """A lidar scan: the fields of `LidarScan`, one row a return."""

    table = schema.LIDAR

    def field(self, name: str) -> FieldValue:
        """Return a field as the sensor gave it."""
        value = self.read(name)
        if value is not None and schema.POINT in self._by_name[name].axes:
            return value[: self.num_points]
        return value.item() if value is not None and value.ndim == 0 else value

    def to_result(self) -> LidarScan:
        """Return the scan with all arrays in memory."""
        names = [item.name for item in fields(LidarScan) if item.name not in ("spec", "world_from_sensor")]
        return LidarScan(self.spec, self.world_from_sensor, **{name: getattr(self, name) for name in names})


class StoredImage(StoredResult):
    """A camera: `rgb`, `depth` [m], `semantic`, `instance`, `normal`, `flow`.

    None where the camera does not make it.
    """

    table = schema.CAMERA

    def field(self, name: str) -> FieldValue:
        """Return a field as the sensor gave it."""
        scene, index = self._frame.scene, self._frame.index
        if self._by_name[name].storage == "png":
            file = scene.read_image(index, self.name, name)
            if file is None:
                return self.read(name) if name == "depth" else None
            pixels = decode_png(name, file, f"frame {index}, {self.name}/{name}")
            return decode_depth(pixels, self.spec.max_distance) if name == "depth" else pixels
        value = self.read(name)
        return value.astype(np.float32) if value is not None and value.dtype == np.float16 else value

    def to_result(self) -> ImageFrame:
        """Return the images in memory."""
        names = [item.name for item in fields(ImageFrame) if item.name not in ("spec", "world_from_sensor")]
        return ImageFrame(self.spec, self.world_from_sensor, **{name: getattr(self, name) for name in names})


class StoredImages:
    """The images of all cameras of one suite together, each from the first camera that makes it."""

    def __init__(self, cameras: Mapping[str, StoredImage]) -> None:
        self.cameras = dict(cameras)

    def __getattr__(self, name: str) -> FieldValue:
        if name.startswith("_") or name not in {item.name for item in schema.CAMERA}:
            raise AttributeError(name)
        return next((image for item in self.cameras.values() if (image := getattr(item, name)) is not None), None)


class StoredForeign(StoredResult):
    """The result of a sensor kind of another package."""

    def __init__(self, frame: FrameInDataset, name: str, kind: str) -> None:
        declared = foreign_fields(kind)
        self.table = declared or ()
        self._kind = kind
        super().__init__(frame, name)

    def to_result(self) -> SensorResult:
        """Return the result as the sensor's class gives it."""
        result_type: Callable[..., Any] = sensor_class(self._kind).result_type  # type: ignore[attr-defined]
        values = {item.name: getattr(self, item.name) for item in self.table}
        return result_type(spec=self.spec, world_from_sensor=self.world_from_sensor, **values)


class SuiteMapping(Mapping[str, Result], Generic[Result]):
    """Sensors of one kind by name.

    The name of a suite (the part before the last ``/``) stands for its sensor of this kind.
    """

    def __init__(
        self, kind: str, sensors: Mapping[str, Any], merge: Callable[[Mapping[str, Any]], Any] | None = None
    ) -> None:
        self._kind, self._sensors, self._merge = kind, dict(sensors), merge

    def __getitem__(self, name: str) -> Result:
        if name in self._sensors:
            return self._sensors[name]
        members = {key: value for key, value in self._sensors.items() if key.rpartition("/")[0] == name}
        if len(members) == 1:
            return next(iter(members.values()))
        if members and self._merge is not None:
            merged: Result = self._merge(members)
            return merged
        raise UnknownNameError(self._kind, name, self._sensors)

    def __contains__(self, name: object) -> bool:
        return name in self._sensors

    def __iter__(self) -> Iterator[str]:
        return iter(self._sensors)

    def __len__(self) -> int:
        return len(self._sensors)

    def __repr__(self) -> str:
        return f"<{self._kind}: {', '.join(self._sensors)}>"


_BUILT_IN: Mapping[str, type[StoredResult]] = {
    "radar": StoredRadar,
    "lidar": StoredLidar,
    "camera": StoredImage,
    "scanning_radar": StoredRadarScan,
    "radio": StoredRadio,
    "closed_radar": StoredClosedRadar,
}


def stored_result(frame: FrameInDataset, name: str) -> StoredResult:
    """Return a sensor of a frame, by the type of its result."""
    kind = frame.scene.meta(frame.index)["sensors"][name]["type"]
    return _BUILT_IN[kind](frame, name) if kind in _BUILT_IN else StoredForeign(frame, name, kind)
