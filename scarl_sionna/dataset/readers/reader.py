"""Reading a dataset: lazy, any frame at once, from a folder or an fsspec URL."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import DatasetError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.prompt.describe import Described, Row, listed, quantity
from scarl_sionna.core.results import Frame, ObjectState, SensorResult
from scarl_sionna.core.spec import FieldValue, Spec
from scarl_sionna.dataset.encoding import mount_today, spec_of
from scarl_sionna.dataset.store.archives import ArchivedFiles, archived_files
from scarl_sionna.dataset.store.files import Files, absolute_place, open_files
from scarl_sionna.dataset.store.manifest import (
    ARRAYS,
    BACKUP,
    DatasetPlan,
    ManifestMissing,
    ScenePlan,
    plan_of,
    recover_manifest,
)
from scarl_sionna.dataset.store.records import ShardRecord
from scarl_sionna.dataset.store.shards import ArrayInfo

from .shard_files import ShardFiles
from .stored import (
    StoredClosedRadar,
    StoredImage,
    StoredImages,
    StoredLidar,
    StoredRadar,
    StoredRadarScan,
    StoredRadio,
    StoredResult,
    SuiteMapping,
    stored_result,
)

if TYPE_CHECKING:
    import zarr

    from .zarr_store import SceneStore


class Dataset(Described, Sequence["StoredFrame"]):
    """A dataset that is open for reading; nothing is read before it is asked for.

    ``ds[i]`` is the i-th frame that is there, scene after scene in the order of their names. Safe to use from several
    threads and to send to other processes (it is opened again there).
    """

    def __init__(self, place: str | Path) -> None:
        self.place = absolute_place(place)
        self.files: Files = open_files(place)
        try:
            self.manifest, self.manifest_fault = recover_manifest(self.files)
        except ManifestMissing:
            archived = archived_files(self.files)
            if archived is None:
                raise
            self.files = archived
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
        for fault in (fault for scene in self._scenes.values() for fault in scene.faults.values()):
            warnings.warn(fault, ScarlWarning, stacklevel=3)
        self._frames = [(name, index) for name, scene in self._scenes.items() for index in scene.frames]

    def __reduce__(self) -> tuple[Any, ...]:
        return Dataset, (self.place,)

    def _facts(self) -> Iterable[Row]:
        yield "place", self.place
        yield "frames", f"{len(self)} in {len(self._scenes)} scenes"
        yield "scenes", listed(f"{name} ({len(scene)})" for name, scene in self._scenes.items())
        yield "splits", listed(f"{split}: {len(names)}" for split, names in self.splits.items())
        yield "sensors", f"{len(self.sensors)}: {listed(self.sensors)}"
        yield "licence", self.manifest.licence

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
        return dict(self.manifest.calibration)

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes."""
        return list(self._scenes)

    @property
    def splits(self) -> dict[str, list[str]]:
        """Names of the scenes of each split."""
        return {split: list(names) for split, names in self.manifest.splits.items()}

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
        rows = dataset.manifest["shards"].get(self.name, [])
        self._files = ShardFiles(dataset.files, dataset.place, plan, dataset.plan.options, rows)
        self.frames: tuple[int, ...] = tuple(self._files.frames())
        self.faults = self._files.faults

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
            fault = self.faults.get(index // self.dataset.plan.options.shard_frames)
            raise DatasetError(
                f"scene {self.name} has no frame {index}" + (f" ({fault})" if fault else ""),
                self.dataset.place,
                "run the export again to make it",
            )
        return StoredFrame(self, index)

    @property
    def configuration(self) -> dict[str, Any]:
        """How the scene was made."""
        return dict(self.plan.configuration)

    @cached_property
    def group(self) -> zarr.Group:
        """The scene's Zarr group: lazy arrays over all frames that are there now, for slices.

        ``group["front_left/radar/adc"][3, :, :16]``. For xarray see `open_xarray`.

        Raises
        ------
        DatasetError
            If the record of a shard is damaged or lost.
        """
        import zarr

        return zarr.open_group(self.zarr_place(), mode="r")

    def zarr_place(self) -> str | SceneStore:
        """Return what Zarr and xarray open as this scene's hierarchy: an address, or a store.

        Raises
        ------
        DatasetError
            If the record of a shard is damaged or lost.
        """
        dataset = self.dataset
        if dataset.plan.options.layout == "files" and not isinstance(dataset.files, ArchivedFiles):
            return f"{dataset.place.rstrip('/')}/{ARRAYS}/{self.name}"
        return self._files.zarr_store(partial(_zarr_place, dataset.place, self.name))

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
        return self._files.arrays(index)

    def read_array(self, index: int, name: str) -> npt.NDArray[Any] | None:
        """Return one array of one frame, or None if the frame does not have it.

        With the shape and in the unit that the schema states, see docs/dataset.md.

        Raises
        ------
        DatasetError
            If the file is missing, cut or damaged.
        """
        return self._files.read_array(index, name)

    def read_file(self, name: str, index: int | None = None) -> bytes:
        """Return a file of the dataset; `index` is the frame that an error names.

        Raises
        ------
        DatasetError
            If the file is missing or cannot be read.
        """
        return self._files.read_file(name, index)

    def image_file(self, index: int, sensor: str, image: str) -> str | None:
        """Return the name of an image's PNG file in the dataset, or None if the frame does not have it."""
        return self._files.image_file(index, sensor, image)

    def read_image(self, index: int, sensor: str, image: str) -> bytes | None:
        """Return an image's PNG file, or None if the frame does not have it.

        Raises
        ------
        DatasetError
            If the file is missing, or is not the one that was written.
        """
        return self._files.read_image(index, sensor, image)

    def hold(self, name: str, data: bytes) -> None:
        """Read a file from memory from now on, until another is held: for who goes through all of a shard."""
        self._files.hold(name, data)

    def members(self, shard: int) -> tuple[ShardRecord, Iterator[tuple[str, list[bytes]]]] | None:
        """Return the record of a shard, and name and content of its files, each checked; None: it is not finished.

        Raises
        ------
        DatasetError
            If a file is missing, or is not the one that was written.
        """
        return self._files.members(shard)

    def meta(self, index: int) -> dict[str, Any]:
        """Return what of a frame stands in JSON."""
        return self._files.meta(index)


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
    def radar_scan(self) -> SuiteMapping[StoredRadarScan]:
        """Scanning radars by sensor name, or by the name of their suite: ``radar_scan["roof"].image``."""
        return SuiteMapping("radar_scan", {n: r for n, r in self.results.items() if isinstance(r, StoredRadarScan)})

    @cached_property
    def closed_radar(self) -> SuiteMapping[StoredClosedRadar]:
        """Radars without raw data by sensor name, or by the name of their suite: ``closed_radar["front"].power``."""
        return SuiteMapping("closed_radar", {n: r for n, r in self.results.items() if isinstance(r, StoredClosedRadar)})

    @cached_property
    def radio(self) -> SuiteMapping[StoredRadio]:
        """Radios by sensor name, or by the name of their suite: ``radio["front_left"].cfr``."""
        return SuiteMapping("radio", {n: r for n, r in self.results.items() if isinstance(r, StoredRadio)})

    @cached_property
    def image(self) -> SuiteMapping[StoredImage | StoredImages]:
        """Cameras by sensor name; by the name of a suite, the images of all of its cameras together."""
        return SuiteMapping(
            "camera", {n: r for n, r in self.results.items() if isinstance(r, StoredImage)}, StoredImages
        )

    @cached_property
    def label_arrays(self) -> dict[str, Any]:
        """Columns of the objects.

        Instance, semantic, is_actor, world_from_box (N, 7), size (N, 3), twist (N, 6), counts, name, and, where the
        dataset has them, tight_center (N, 3) and tight_size (N, 3).
        """
        from scarl_sionna.dataset.schema import LATER, OBJECTS

        count = int(self._array("objects/num_objects"))
        columns: dict[str, Any] = {"name": list(self.scene.meta(self.index)["objects"])}
        for item in OBJECTS:
            if item.storage == "array" and item.axes:
                name = f"objects/{item.name}"
                is_later = item.name in LATER["objects"]
                values = self.scene.read_array(self.index, name) if is_later else self._array(name)
                if values is not None:
                    columns[item.name] = values[:count]
        return columns

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

        All is as it was, but depth, which is within 7.6e-5 of its value from 5 cm on (that of fisheyes is as it was),
        camera normals (float16, within 2.5e-4), and the times that something took, which are not stored.
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


def _zarr_place(place: str, scene: str) -> str | SceneStore:
    return Dataset(place).scene(scene).zarr_place()


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
        Folder that `scarl-sionna export` or `demo` wrote, also while it is still written, or its archives
        (`scarl-sionna archive`), or an fsspec URL
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
