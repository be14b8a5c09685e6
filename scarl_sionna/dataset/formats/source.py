"""What an exporter reads: scenes of frames in time order, and the rig that made them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from scarl_sionna.core.errors import DatasetError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import Frame, ImageFrame, SensorResult

if TYPE_CHECKING:
    from scarl_sionna.dataset.readers.reader import Dataset, StoredFrame

OnProgress = Callable[[int, int], None]
"""Called with the number of finished frames and of all frames."""


def no_progress(done: int, total: int) -> None:
    """Report nothing."""


_OF_OBJECTS = tuple(item.name for item in fields(ImageFrame) if item.name.startswith("object_"))
"""Fields of an image frame that hold a number for each object."""
_SCENE_NAME = re.compile(r"[A-Za-z0-9_\-][A-Za-z0-9_\-.]*")


Convertible: TypeAlias = "FrameSource | Dataset | str | Path"
"""What an exporter takes, see :func:`as_source`."""


class Frames(Protocol):
    """Frames by index, read when they are asked for."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Frame: ...


@dataclass(frozen=True)
class SceneFrames:
    """One drive: a name, its frames in time order, and how it was made as far as that is known."""

    name: str
    frames: Frames
    configuration: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not _SCENE_NAME.fullmatch(self.name):
            raise ParameterRangeError("scene name", repr(self.name), "letters, digits, '_', '-', '.', not first '.'")

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.frames)

    def __iter__(self) -> Iterator[Frame]:
        """Frames, one after the other; none is kept."""
        return (self.frames[index] for index in range(len(self.frames)))

    def labels(self) -> Iterator[Frame]:
        """Yield the frames with poses and labels; of a stored one the results of the sensors are not read."""
        return (_read_by(self.frames, "without_results", index) for index in range(len(self.frames)))

    def without_pictures(self, index: int) -> Frame:
        """Return a frame; of a stored one only radars, and the numbers of cameras about objects, are read."""
        return _read_by(self.frames, "without_pictures", index)


@dataclass(frozen=True)
class FrameSource:
    """Scenes of one rig.

    Parameters
    ----------
    rig : mapping
        `Rig.to_dict()`.
    scenes : sequence of SceneFrames
    splits : mapping of str to list of str
        Scene names by split; may be empty.
    """

    rig: Mapping[str, Any]
    scenes: Sequence[SceneFrames]
    splits: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @property
    def num_frames(self) -> int:
        """Number of frames of all scenes."""
        return sum(len(scene) for scene in self.scenes)

    def not_empty(self) -> FrameSource:
        """Return these scenes.

        Raises
        ------
        ParameterRangeError
            If they have no frames.
        """
        if not self.num_frames:
            raise ParameterRangeError("dataset", "no frames", "at least one frame")
        return self

    @property
    def mounts(self) -> dict[str, Mapping[str, Any]]:
        """Rig entries by sensor name."""
        return {mount["name"]: mount for mount in self.rig["sensors"]}

    def vehicle_from_sensor(self, name: str) -> Pose:
        """Return where a sensor sits on the vehicle."""
        pose = self.mounts[name]["vehicle_from_sensor"]
        return Pose(pose["position"], pose.get("quaternion", (1.0, 0.0, 0.0, 0.0)))

    def split_of(self, scene: str) -> str | None:
        """Return the split that a scene belongs to, or None."""
        return next((split for split, names in self.splits.items() if scene in names), None)

    def subset(
        self, scenes: Sequence[str] = (), num_frames: int | None = None, splits: Sequence[str] = ()
    ) -> FrameSource:
        """Return some scenes by name or by split (none given: all), and the first frames of each.

        Raises
        ------
        UnknownNameError, ParameterRangeError
            If a scene or a split is unknown, no scene is left, or the number is below 1.
        """
        if num_frames is not None and num_frames < 1:
            raise ParameterRangeError("num_frames", num_frames, ">= 1")
        known = {scene.name: scene for scene in self.scenes}
        for name in scenes:
            if name not in known:
                raise UnknownNameError("scene", name, known)
        for name in splits:
            if name not in self.splits:
                raise UnknownNameError("split", name, self.splits)
        chosen = [known[name] for name in scenes] if scenes else list(self.scenes)
        if splits:
            chosen = [scene for scene in chosen if self.split_of(scene.name) in splits]
            if not chosen:
                raise ParameterRangeError("split", ", ".join(splits), "a split with scenes", "see `scarl-sionna info`")
        if num_frames is not None:
            chosen = [replace(scene, frames=_First(scene.frames, num_frames)) for scene in chosen]
        kept = {scene.name for scene in chosen}
        left = {split: [name for name in names if name in kept] for split, names in self.splits.items()}
        return FrameSource(self.rig, chosen, {split: names for split, names in left.items() if names})


def _read_by(frames: Frames, way: str, index: int) -> Frame:
    """Return a frame, without what takes long to read where its frames know the way."""
    read: Callable[[int], Frame] = getattr(frames, way, frames.__getitem__)
    return read(index)


@dataclass(frozen=True)
class _First:
    """The first frames of a sequence."""

    frames: Frames
    count: int

    def __len__(self) -> int:
        return min(self.count, len(self.frames))

    def __getitem__(self, index: int) -> Frame:
        return self.frames[index]

    def without_results(self, index: int) -> Frame:
        """Return a frame with poses and labels only."""
        return _read_by(self.frames, "without_results", index)

    def without_pictures(self, index: int) -> Frame:
        """Return a frame with radars and the numbers of cameras about objects."""
        return _read_by(self.frames, "without_pictures", index)


@dataclass(frozen=True)
class _DatasetFrames:
    """Frames of a dataset of the native store, whole ones."""

    scene: Any

    def __len__(self) -> int:
        return len(self.scene)

    def __getitem__(self, index: int) -> Frame:
        return self.scene[index].to_frame()  # type: ignore[no-any-return]

    def without_results(self, index: int) -> Frame:
        """Return a frame with poses and labels only."""
        item = self.scene[index]
        return self._with(item, {})

    def without_pictures(self, index: int) -> Frame:
        """Return a frame with radars and the numbers of cameras about objects."""
        item = self.scene[index]
        results: dict[str, SensorResult] = {name: radar.to_result() for name, radar in item.radar.items()}
        for name, image in item.image.items():
            numbers = {key: getattr(image, key) for key in _OF_OBJECTS}
            results[name] = ImageFrame(image.spec, image.world_from_sensor, **numbers)
        return self._with(item, results)

    @staticmethod
    def _with(item: StoredFrame, results: Mapping[str, SensorResult]) -> Frame:
        pose, twist = item.world_from_vehicle, item.vehicle_twist
        return Frame(item.index, item.timestamp_ns, item.seed, pose, twist, dict(results), item.labels)


def as_source(data: Convertible, form: str = "", takes: Collection[str] = ()) -> FrameSource:
    """Return what an exporter reads.

    Parameters
    ----------
    data : FrameSource, dataset of `open_dataset`, or path
        A path is that of a dataset (also a URL).
    form : str
        Name of the format that is written, for the warning.
    takes : collection of str
        Kinds of sensors that the format has a place for; a `ScarlWarning` names the sensors of other kinds. None given:
        it has one for all.

    Raises
    ------
    DatasetError
        If there is no dataset.
    """
    source = _source_of(data)
    left = [f"{name} ({mount['kind']})" for name, mount in source.mounts.items() if mount["kind"] not in takes]
    if takes and left:
        warnings.warn(
            f"{form} has no place for {', '.join(left)}, which it leaves out; hdf5, tfrecord and webdataset hold them",
            ScarlWarning,
            stacklevel=3,
        )
    return source


def _source_of(data: Convertible) -> FrameSource:
    if isinstance(data, FrameSource):
        return data
    if isinstance(data, str | Path):
        if Path(data).is_file():
            raise DatasetError("is a file", data, "give the folder that holds the dataset")
        from scarl_sionna.dataset.readers.reader import open_dataset

        data = open_dataset(data)
    scenes = [_scene_of(data, name) for name in data.scenes]
    return FrameSource(data.rig, scenes, getattr(data, "splits", None) or {})


def _scene_of(data: Dataset, name: str) -> SceneFrames:
    scene = data.scene(name)
    return SceneFrames(name, _DatasetFrames(scene), scene.configuration)
