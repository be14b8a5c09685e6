"""Reading a dataset: lazy, any frame at once, from a folder or an fsspec URL."""

from __future__ import annotations

import hashlib
import re
import threading
import warnings
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetDamage, DatasetError, DatasetUnreachable, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.describe import Described, Row, listed, quantity
from scarl_sionna.core.results import Frame, ObjectState, SensorResult
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.core.untrusted.checked import checked, plain
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.encoding import mount_today, spec_of
from scarl_sionna.dataset.store.files import Files, open_files, read_small
from scarl_sionna.dataset.store.forms import MetasForm
from scarl_sionna.dataset.store.manifest import (
    ARRAYS,
    BACKUP,
    SHARDS,
    DatasetPlan,
    ScenePlan,
    plan_of,
    recover_manifest,
)
from scarl_sionna.dataset.store.shard_writer import ShardRecord, array_key, image_name, meta_name, record_name
from scarl_sionna.dataset.store.shards import ArrayInfo, decode_chunk, index_length, parse_index

from .stored import StoredImage, StoredImages, StoredLidar, StoredRadar, StoredResult, SuiteMapping, stored_result

if TYPE_CHECKING:
    import zarr

_CACHED_SHARDS = 64
"""Shards whose indices and JSON are kept in memory, a scene."""
_RECORD = re.compile(r"\d{6,7}\.json")
_ALTERED = ValueError("it is not what was written (size or checksum)")


class Dataset(Described, Sequence["StoredFrame"]):
    """A dataset that is open for reading; nothing is read before it is asked for.

    ``ds[i]`` is the i-th frame that is there, scene after scene in the order of their names. Safe to use from several
    threads and to send to other processes (it is opened again there).
    """

    def __init__(self, place: str | Path) -> None:
        self.place = str(place)
        self.files: Files = open_files(place)
        self.manifest, self.manifest_fault = recover_manifest(self.files)
        if self.manifest_fault is not None:
            warnings.warn(
                f"{self.manifest_fault}; read from its copy {BACKUP}; `scarl-sionna verify --repair` puts it back",
                ScarlWarning,
                stacklevel=3,
            )
        self.plan: DatasetPlan = plan_of(self.manifest)
        self._specs: dict[str, Spec] = {}
        self._scenes = {scene.name: Scene(self, scene) for scene in self.plan.scenes}
        self._frames = [(name, index) for name, scene in self._scenes.items() for index in scene.frames]

    def __reduce__(self) -> tuple[Any, ...]:
        return Dataset, (self.place,)

    def _facts(self) -> Iterable[Row]:
        yield "place", self.place
        yield "frames", f"{len(self)} in {len(self._scenes)} scenes"
        yield "scenes", listed(f"{name} ({len(scene)})" for name, scene in self._scenes.items())
        yield "splits", listed(f"{split}: {len(names)}" for split, names in self.splits.items())
        yield "sensors", f"{len(self.sensors)}: {listed(self.sensors)}"
        yield "licence", str(self.manifest["licence"])

    def __len__(self) -> int:
        return len(self._frames)

    @overload
    def __getitem__(self, index: int) -> StoredFrame: ...

    @overload
    def __getitem__(self, index: slice) -> list[StoredFrame]: ...

    def __getitem__(self, index: int | slice) -> StoredFrame | list[StoredFrame]:
        if isinstance(index, slice):
            return [self[position] for position in range(*index.indices(len(self)))]
        name, number = self._frames[index]
        return StoredFrame(self._scenes[name], number)

    @property
    def rig(self) -> dict[str, Any]:
        """The rig, as `Rig.to_dict()` gives it, also of a dataset of an earlier schema version."""
        sensors = [mount_today(mount) for mount in self.plan.rig["sensors"]]
        return {**self.plan.rig, "sensors": sensors}

    @property
    def sensors(self) -> dict[str, str]:
        """Kind of each sensor by its name."""
        return {mount["name"]: mount["kind"] for mount in self.plan.rig["sensors"]}

    @property
    def calibration(self) -> dict[str, Any]:
        """By sensor: place in the vehicle, and numbers such as intrinsics or range resolution."""
        return dict(self.manifest["calibration"])

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes."""
        return list(self._scenes)

    @property
    def splits(self) -> dict[str, list[str]]:
        """Names of the scenes of each split."""
        return {split: list(names) for split, names in self.manifest["splits"].items()}

    def scene(self, name: str) -> Scene:
        """Return a scene (sequence) by name.

        Raises
        ------
        UnknownNameError
            If there is no such scene.
        """
        if name not in self._scenes:
            raise UnknownNameError("scene", name, self._scenes)
        return self._scenes[name]

    def spec(self, sensor: str) -> Spec:
        """Return the specification of a sensor.

        Raises
        ------
        UnknownNameError
            If there is no such sensor.
        """
        if sensor not in self._specs:
            mounts = {mount["name"]: mount for mount in self.plan.rig["sensors"]}
            if sensor not in mounts:
                raise UnknownNameError("sensor", sensor, mounts)
            self._specs[sensor] = spec_of(mounts[sensor])
        return self._specs[sensor]


class Scene(Described, Sequence["StoredFrame"]):
    """One scene (sequence) of a dataset: ``scene[k]`` is the k-th frame that is there."""

    def __init__(self, dataset: Dataset, plan: ScenePlan) -> None:
        self.dataset, self.plan, self.name = dataset, plan, plan.name
        self._options = dataset.plan.options
        self._lock = threading.Lock()
        self._shards: OrderedDict[int, _Shard] = OrderedDict()
        self.frames: tuple[int, ...] = tuple(self._find_frames())

    def _facts(self) -> Iterable[Row]:
        yield "name", self.name
        yield "frames", f"{len(self)} of {self.plan.num_frames}"
        yield "split", self.plan.split
        yield "dataset", self.dataset.place

    def __len__(self) -> int:
        return len(self.frames)

    @overload
    def __getitem__(self, index: int) -> StoredFrame: ...

    @overload
    def __getitem__(self, index: slice) -> list[StoredFrame]: ...

    def __getitem__(self, index: int | slice) -> StoredFrame | list[StoredFrame]:
        if isinstance(index, slice):
            return [self[position] for position in range(*index.indices(len(self)))]
        return StoredFrame(self, self.frames[index])

    def frame(self, index: int) -> StoredFrame:
        """Return the frame of a number (`Frame.index`).

        Raises
        ------
        DatasetError
            If the frame is not there (yet).
        """
        if index not in self.frames:
            raise DatasetError(
                f"scene {self.name} has no frame {index}", self.dataset.place, "run the export again to make it"
            )
        return StoredFrame(self, index)

    @property
    def configuration(self) -> dict[str, Any]:
        """How the scene was made."""
        return dict(self.plan.configuration)

    @cached_property
    def group(self) -> zarr.Group:
        """The scene's Zarr group: lazy arrays over all frames, for slices.

        ``group["front_left/radar/adc"][3, :, :16]``.
        """
        import zarr

        place = self.dataset.place.rstrip("/")
        return zarr.open_group(f"{place}/{ARRAYS}/{self.name}", mode="r")

    def array(self, name: str) -> npt.NDArray[Any]:
        """Return a small array, for instance ``"timestamp_ns"``, over all frames, shape (num_frames, ...).

        In the unit that the schema states, see docs/dataset.md.

        Raises
        ------
        UnknownNameError
            If there is no such array.
        """
        rows = [self.read_array(index, name) for index in self.frames]
        if any(row is None for row in rows):
            raise UnknownNameError("array", name, self.arrays(self.frames[0]) if self.frames else ())
        return np.stack(rows) if rows else np.zeros((0,))  # type: ignore[arg-type]

    def arrays(self, index: int) -> dict[str, ArrayInfo]:
        """Return the arrays of a frame's shard by name."""
        return dict(self._shard(index).arrays)

    def read_array(self, index: int, name: str) -> npt.NDArray[Any] | None:
        """Return one array of one frame, or None if the frame does not have it.

        With the shape and in the unit that the schema states, see docs/dataset.md.

        Raises
        ------
        DatasetError
            If the file is missing, cut or damaged.
        """
        shard = self._shard(index)
        info = shard.arrays.get(name)
        if info is None:
            return None
        number, position = divmod(index, self._options.shard_frames)
        key = array_key(self.name, name, number, info)
        try:
            places = shard.places.get(name)
            end = shard.files[key][0]
            if places is None:
                tail = self.dataset.files.read(key, end - index_length(self._options.shard_frames), end)
                places = shard.places[name] = parse_index(tail, self._options.shard_frames)
            place = places[position]
            if place is None:
                return None
            if place[0] + place[1] > end:
                raise _ALTERED
            return decode_chunk(self.dataset.files.read(key, place[0], place[0] + place[1]), info)
        except (OSError, DatasetError, RuntimeError, KeyError, ValueError) as error:
            raise self._damaged(key, error, index) from error

    def read_file(self, name: str, index: int | None = None) -> bytes:
        """Return a file of the dataset; `index` is the frame that an error names.

        Raises
        ------
        DatasetError
            If the file is missing or cannot be read.
        """
        try:
            return self.dataset.files.read(name)
        except (OSError, DatasetError) as error:
            raise self._damaged(name, error, index) from error

    def image_file(self, index: int, sensor: str, image: str) -> str | None:
        """Return the name of an image's PNG file in the dataset, or None if the frame does not have it."""
        name = image_name(self.name, f"{sensor}/{image}/{index:06d}.png")
        return name if name in self._shard(index).files else None

    def read_image(self, index: int, sensor: str, image: str) -> bytes | None:
        """Return an image's PNG file, or None if the frame does not have it.

        Raises
        ------
        DatasetError
            If the file is missing, or is not the one that was written.
        """
        name = self.image_file(index, sensor, image)
        return None if name is None else self._read_checked(name, self._shard(index).files[name], index)

    def _read_checked(self, name: str, written: tuple[int, str], index: int) -> bytes:
        """Return a file whose size and SHA-256 are those that its shard's record states."""
        data = self.read_file(name, index)
        if (len(data), hashlib.sha256(data).hexdigest()) != written:
            raise self._damaged(name, _ALTERED, index)
        return data

    def meta(self, index: int) -> dict[str, Any]:
        """Return what of a frame stands in JSON."""
        try:
            return self._shard(index).metas[index]
        except KeyError as error:
            name = meta_name(self.name, index // self._options.shard_frames)
            raise self._damaged(name, ValueError(f"it has no frame {index}"), index) from error

    def _damaged(self, key: str, error: Exception, index: int | None = None) -> DatasetError:
        if isinstance(error, DatasetUnreachable | DatasetDamage):
            return error
        text = "is not there" if isinstance(error, FileNotFoundError) else f"cannot be read: {error}"
        frame = "" if index is None else f"frame {index} of {self.name}: "
        return DatasetDamage(
            f"{frame}{key} {text}",
            self.dataset.place,
            "run `scarl-sionna verify --repair`, then the export again",
            (key, self.name, index),
        )

    def _find_frames(self) -> Iterator[int]:
        """Yield the frames of finished shards: from the manifest, and from records that came after it."""
        full = {shard for shard in range(self._num_rows) if self._is_full(shard)}
        shards, there = sorted(full), set[int]()
        if len(full) < self.plan.num_shards(self._options):
            names = self.dataset.files.names(f"{SHARDS}/{self.name}")
            there = {int(name[:-5]) for name in names if _RECORD.fullmatch(name)} - full
            shards = sorted(full | {shard for shard in there if shard < self.plan.num_shards(self._options)})
        for shard in shards:
            frames = self.plan.shard_range(shard, self._options)
            yield from (index for index in self._record(shard).frames if index in frames) if shard in there else frames

    @property
    def _num_rows(self) -> int:
        return len(self.dataset.manifest["shards"].get(self.name, []))

    def _is_full(self, shard: int) -> bool:
        row = self._row(shard)
        return row is not None and row[1] == len(self.plan.shard_range(shard, self._options))

    def _row(self, shard: int) -> list[Any] | None:
        """Return what the manifest states of a shard: checksum of its record and number of frames first."""
        rows = self.dataset.manifest["shards"].get(self.name, [])
        return rows[shard] if shard < len(rows) else None

    def _record(self, shard: int) -> ShardRecord:
        key = record_name(self.name, shard)
        try:
            text = read_small(self.dataset.files, key)
        except (OSError, DatasetError) as error:
            raise self._damaged(key, error) from error
        row = self._row(shard)
        frames = row[1] if row is not None and row[0] != hashlib.sha256(text).hexdigest() else None
        if frames == len(self.plan.shard_range(shard, self._options)):
            raise self._damaged(key, _ALTERED)
        record = ShardRecord.parse(text, f"{self.dataset.place}/{key}")
        if frames == len(record.frames):  # one that came after the manifest has more
            raise self._damaged(key, _ALTERED)
        return record

    def _shard(self, index: int) -> _Shard:
        number = index // self._options.shard_frames
        with self._lock:
            if number in self._shards:
                self._shards.move_to_end(number)
                return self._shards[number]
        record = self._record(number)
        try:
            name = meta_name(self.name, number)
            if name in record.files:
                text = self._read_checked(name, record.files[name], index)
            else:
                text = self.read_file(name, index)
            metas = {meta.index: plain(meta) for meta in checked(MetasForm, parse_json(text)).root}
        except ValueError as error:
            raise self._damaged(meta_name(self.name, number), error, index) from error
        shard = _Shard(record, metas)
        with self._lock:
            self._shards[number] = shard
            while len(self._shards) > _CACHED_SHARDS:
                self._shards.popitem(last=False)
        return shard


class _Shard:
    """What is kept of a shard: its arrays, size and checksum of its files, its JSON, and the indices that were read."""

    def __init__(self, record: ShardRecord, metas: dict[int, dict[str, Any]]) -> None:
        self.arrays, self.metas = record.arrays, metas
        self.files = record.files
        self.places: dict[str, list[tuple[int, int] | None]] = {}


class StoredFrame(Described):
    """One frame of a dataset; its arrays are read when they are asked for.

    Attributes
    ----------
    scene : Scene
    index : int
        Number of the frame in its scene.
    """

    def __init__(self, scene: Scene, index: int) -> None:
        self.scene, self.index = scene, index

    def _facts(self) -> Iterable[Row]:
        yield "scene", self.scene.name
        yield "index", str(self.index)
        yield "time", quantity(self.timestamp_ns * 1e-9, "s")
        yield "sensors", f"{len(self.sensors)}: {listed(self.sensors)}"
        yield "objects", str(len(self.label_arrays["name"]))

    @cached_property
    def timestamp_ns(self) -> int:
        """Time of the frame [ns]."""
        return int(self._array("timestamp_ns"))

    @property
    def seed(self) -> int:
        """Root of the frame's random numbers."""
        return int(self.scene.meta(self.index)["seed"])

    @cached_property
    def world_from_vehicle(self) -> Pose:
        """Pose of the vehicle."""
        row = self._array("world_from_vehicle")
        return Pose(row[:3], row[3:])

    @cached_property
    def vehicle_twist(self) -> Twist:
        """Velocity of the vehicle, world axes."""
        row = self._array("vehicle_twist")
        return Twist(row[:3], row[3:])

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors, in the rig's order."""
        return tuple(self.scene.meta(self.index)["sensors"])

    @cached_property
    def results(self) -> Mapping[str, StoredResult]:
        """All sensors by name."""
        return {name: stored_result(self, name) for name in self.sensors}

    @cached_property
    def radar(self) -> SuiteMapping[StoredRadar]:
        """Radars by sensor name, or by the name of their suite: ``radar["front_left"].adc``."""
        return SuiteMapping("radar", {n: r for n, r in self.results.items() if isinstance(r, StoredRadar)})

    @cached_property
    def lidar(self) -> SuiteMapping[StoredLidar]:
        """Lidars by sensor name, or by the name of their suite."""
        return SuiteMapping("lidar", {n: r for n, r in self.results.items() if isinstance(r, StoredLidar)})

    @cached_property
    def image(self) -> SuiteMapping[StoredImage | StoredImages]:
        """Cameras by sensor name; by the name of a suite, the images of all of its cameras together."""
        return SuiteMapping(
            "camera", {n: r for n, r in self.results.items() if isinstance(r, StoredImage)}, StoredImages
        )

    @cached_property
    def label_arrays(self) -> dict[str, Any]:
        """Columns of the objects.

        Instance, semantic, is_actor, world_from_box (N, 7), size (N, 3), twist (N, 6), counts, name.
        """
        from scarl_sionna.dataset.schema import OBJECTS

        count = int(self._array("objects/num_objects"))
        columns: dict[str, Any] = {
            item.name: self._array(f"objects/{item.name}")[:count]
            for item in OBJECTS
            if item.storage == "array" and item.axes
        }
        return {"name": list(self.scene.meta(self.index)["objects"]), **columns}

    @cached_property
    def labels(self) -> tuple[ObjectState, ...]:
        """Ground truth of every object of the scene.

        Oriented box, velocity, class, instance, what the sensors see of it.
        """
        columns = self.label_arrays
        return tuple(
            ObjectState(**{name: _object_value(name, column[row]) for name, column in columns.items()})
            for row in range(len(columns["name"]))
        )

    def to_frame(self) -> Frame:
        """Return the frame with all arrays in memory, as ``ss.observe`` gave it.

        All is as it was, but depth, which is within 7.6e-5 of its value, camera normals (float16, within 2.5e-4), and
        the times that something took, which are not stored.
        """
        results: dict[str, SensorResult] = {name: result.to_result() for name, result in self.results.items()}
        return Frame(
            self.index, self.timestamp_ns, self.seed, self.world_from_vehicle, self.vehicle_twist, results, self.labels
        )

    def _array(self, name: str) -> npt.NDArray[Any]:
        values = self.scene.read_array(self.index, name)
        if values is None:
            raise DatasetError(f"frame {self.index} of {self.scene.name} has no {name}", self.scene.dataset.place)
        return values


def _object_value(name: str, value: FieldValue) -> FieldValue:
    if name == "world_from_box":
        return Pose(value[:3], value[3:])
    if name == "twist":
        return Twist(value[:3], value[3:])
    return value.item() if isinstance(value, np.generic) else value


def open_dataset(place: str | Path) -> Dataset:
    """Open a dataset for reading.

    Parameters
    ----------
    place : path or str
        Folder that `scarl-sionna export` or `demo` wrote, also while it is still written, or an fsspec URL
        (``s3://...``, ``https://...``; over HTTP, where folders cannot be listed, only what stands in the manifest).

    Warns
    -----
    ScarlWarning
        If the manifest is lost or damaged and was read from its copy ``manifest.backup.json``.

    Raises
    ------
    DatasetError
        If there is no dataset, or it is of a newer schema or damaged.
    """
    return Dataset(place)
