"""Counts the objects and radar points of a dataset, frame by frame."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import OutputError, ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described, Row, listed
from scarl_sionna.core.results import Frame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.boxes import MOVING_SPEED, nearest_footprint, other_objects
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.dataset.formats.source import (
    Convertible,
    FrameSource,
    OnProgress,
    SceneFrames,
    as_source,
    no_progress,
)

from .counted import FARTHEST, FIELD_OF_VIEW_DEG, OBJECT_ROW, POINT_ROW, SCAN_ROW, Rows, SceneFacts, velocity_spread
from .groups import GROUP_NAMES, GROUP_OF_SEMANTIC, NO_GROUP, weather_name


@dataclass(frozen=True, eq=False, repr=False)
class DatasetStatistics(Described):
    """What a dataset holds, counted; `save` writes it as a page beside published figures of other datasets.

    Road users are cars, large vehicles, two-wheelers and pedestrians (the index into `GROUP_NAMES`), the vehicle with
    the sensors left out. A radar point belongs to the road user whose box, seen from above, is nearest, if it is
    within `margin` of it.

    Attributes
    ----------
    scenes : tuple of SceneFacts
    objects : structured ndarray, shape (num_labels,)
        A row an object of a frame: ``scene`` (index), ``instance``, ``semantic``, ``group`` (-1: no road user),
        ``moving`` (above 0.5 m/s), ``range`` from the vehicle over ground [m], ``occlusion`` (share that is hidden, in
        the camera that sees most; nan: in none), ``pixels``, ``lidar_points``, ``radar_points`` (of all radars).
    scans : structured ndarray, shape (num_scans,)
        A row a road user and radar of a frame that looks at it (within 60 deg and 100 m): ``group``, ``moving``,
        ``range`` from the radar [m], ``points``, ``velocity_spread`` (standard deviation of the points' radial
        velocity [m/s]; nan below 3 points).
    points : structured ndarray, shape (num_points,)
        A row a radar point: ``group`` (-1: of none), ``moving``, ``range`` [m], ``snr_db``, ``rcs_dbsm``.
    points_per_scan : ndarray of int64, shape (num_radar_frames,)
        Points of a radar in a frame.
    points_per_frame : ndarray of int64, shape (num_frames,)
        Points of all radars in a frame.
    pfa, margin : float
        Probability of false alarm of the detector; see above [m].
    most_points : int or None
        How many points of a radar and frame were kept, the strongest; None: all.
    """

    scenes: tuple[SceneFacts, ...]
    objects: Rows
    scans: Rows
    points: Rows
    points_per_scan: npt.NDArray[np.int64]
    points_per_frame: npt.NDArray[np.int64]
    pfa: float
    margin: float
    most_points: int | None = None

    @property
    def num_frames(self) -> int:
        """Number of frames that were counted."""
        return sum(scene.num_frames for scene in self.scenes)

    def frames_by(self, what: str) -> dict[str, int]:
        """Return the number of frames by ``"weather"`` or ``"split"``."""
        count: Counter[str] = Counter()
        for scene in self.scenes:
            count[getattr(scene, what)] += scene.num_frames
        return dict(count)

    def class_balance(self) -> dict[str, tuple[int, int]]:
        """Return by semantic class the number of labels (an object in a frame), and of different objects."""
        found = {}
        for semantic in np.unique(self.objects["semantic"]):
            rows = self.objects[self.objects["semantic"] == semantic]
            different = np.unique(rows[["scene", "instance"]])
            found[SEMANTIC_CLASSES[semantic]] = (len(rows), len(different))
        return dict(sorted(found.items(), key=lambda item: -item[1][0]))

    def facts(self) -> list[Row]:
        """Return the facts in short: names and texts."""
        return list(self._facts())

    def _facts(self) -> Iterable[Row]:
        yield "frames", f"{self.num_frames} in {len({scene.name for scene in self.scenes})} scenes"
        yield "splits", listed(f"{name}: {count}" for name, count in self.frames_by("split").items())
        yield "weather", listed(f"{name}: {count}" for name, count in self.frames_by("weather").items())
        balance = self.class_balance()
        yield "labels", listed(f"{name}: {labels} of {objects}" for name, (labels, objects) in balance.items())
        kept = "" if self.most_points is None else f", the strongest {self.most_points} of a scan"
        yield "radar points", f"{len(self.points)}, false alarm {self.pfa:g}{kept}, within {self.margin:g} m of a box"
        for number, name in enumerate(GROUP_NAMES):
            scans = self.scans[self.scans["group"] == number]
            if len(scans):
                seen = scans[scans["points"] > 0]
                mean = f"{seen['points'].mean():.1f} points where there are any" if len(seen) else "never a point"
                yield name, f"{len(scans)} looks of a radar, {len(seen) / len(scans):.0%} with points; {mean}"

    def save(self, path: str | Path) -> Path:
        """Write a page (HTML, one file) of charts and tables, beside published figures of other datasets.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        from scarl_sionna.dataset.store.atomic import whole_file

        from .page import page  # imports Matplotlib

        path = Path(path)
        text = page(self)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as partial:
                partial.write_text(text, encoding="utf-8")
        except OSError as error:
            raise OutputError(f"cannot write {path}: {error.strerror}; choose a file that you may write to") from error
        return path


def dataset_statistics(
    data: Convertible,
    *,
    pfa: float = 1e-6,
    margin: float = 0.5,
    every: int = 1,
    most_points: int | None = None,
    on_progress: OnProgress = no_progress,
) -> DatasetStatistics:
    """Count what a dataset holds: labels, radar points of each object, their RCS and SNR, occlusion, weather.

    Parameters
    ----------
    data : FrameSource, dataset or path
        See `as_source`. Of a stored dataset the radars' data and the labels are read, no pictures.
    pfa : float
        Probability of false alarm of the detector that makes the radar points.
    margin : float
        A radar point this far from a road user's box, seen from above, is still its own [m].
    every : int
        Only every n-th frame of each scene.
    most_points : int, optional
        Keep the strongest points of a radar and frame only, as a device whose list of targets is that long.
    on_progress : callable

    Raises
    ------
    ParameterRangeError
        If a parameter is out of range, or there are no frames.
    DatasetError
        If there is no dataset, or it is damaged.
    """
    if every < 1:
        raise ParameterRangeError("every", every, ">= 1")
    if most_points is not None and most_points < 1:
        raise ParameterRangeError("most_points", most_points, ">= 1")
    if not 0.0 <= margin < math.inf:
        raise ParameterRangeError("margin", f"{margin:g} m", ">= 0 m")
    source = as_source(data)
    if not source.num_frames:
        raise ParameterRangeError("dataset", "no frames", "at least one frame")
    counter = _Counter(source, pfa, margin, most_points)
    indices = [range(0, len(scene), every) for scene in source.scenes]
    total, done = sum(map(len, indices)), 0
    for number, (scene, chosen) in enumerate(zip(source.scenes, indices, strict=True)):
        for index in chosen:
            counter.add(number, scene.without_pictures(index))
            done += 1
            on_progress(done, total)
        counter.finish(scene)
    return counter.result()


class _Counter:
    """Gathers the rows of all frames."""

    def __init__(self, source: FrameSource, pfa: float, margin: float, most_points: int | None) -> None:
        self.source, self.pfa, self.margin, self.most_points = source, pfa, margin, most_points
        self._scenes: list[SceneFacts] = []
        self._rows: dict[str, list[Any]] = defaultdict(list)
        self._weathers: Counter[str] = Counter()

    def add(self, scene: int, frame: Frame) -> None:
        """Count a frame."""
        self._weathers[weather_name(self.source.scenes[scene].configuration, frame.timestamp_ns / 1e9)] += 1
        items = other_objects(frame)
        users = [item for item in items if GROUP_OF_SEMANTIC[item.semantic] != NO_GROUP]
        counts = np.zeros(len(users), np.int64)
        per_frame = 0
        for radar in frame.radars.values():
            points = sensed_points(frame, radar, self.pfa).points.strongest(self.most_points)
            owner = nearest_footprint(users, radar.world_from_sensor.apply(points.position), self.margin)
            own = np.bincount(owner[owner >= 0], minlength=len(users))
            interval, farthest = points.known_modulo(radar.spec), min(FARTHEST, radar.spec.max_range)
            for number, item in _looked_at(users, radar.world_from_sensor, farthest):
                mine = owner == number
                spread = velocity_spread(points.radial_velocity[mine], interval[mine].min(initial=np.inf))
                away = _away(radar.world_from_sensor, item)
                self._rows["scans"].append((*_kind(item), away, own[number], spread))
            group = np.array([*(GROUP_OF_SEMANTIC[item.semantic] for item in users), NO_GROUP])[owner]
            moving = np.array([*(_moves(item) for item in users), False])[owner]
            rcs = power_to_db(points.rcs)
            self._rows["points"] += zip(group, moving, points.range, points.snr_db, rcs, strict=True)
            self._rows["points_per_scan"].append(points.num_points)
            counts += own
            per_frame += points.num_points
        self._rows["points_per_frame"].append(per_frame)
        by_instance = {item.instance: int(count) for item, count in zip(users, counts, strict=True)}
        hidden = _occlusion(frame)
        for item in items:
            self._rows["objects"].append(
                (
                    scene,
                    item.instance,
                    item.semantic,
                    *_kind(item),
                    _away(frame.world_from_vehicle, item),
                    hidden.get(item.instance, math.nan),
                    item.num_pixels,
                    item.num_lidar_points,
                    by_instance.get(item.instance, 0),
                )
            )

    def finish(self, scene: SceneFrames) -> None:
        """End a scene; one whose weather changes has a row for each weather."""
        split = self.source.split_of(scene.name) or "none"
        self._scenes += [SceneFacts(scene.name, split, name, count) for name, count in self._weathers.items()]
        self._weathers.clear()
        for name, kind in (("objects", OBJECT_ROW), ("scans", SCAN_ROW), ("points", POINT_ROW)):
            self._rows[f"{name} done"].append(np.array(self._rows.pop(name, []), dtype=kind))  # rows take 10 times more

    def result(self) -> DatasetStatistics:
        """Return all that was counted."""
        objects, scans, points = (np.concatenate(self._rows[f"{name} done"]) for name in ("objects", "scans", "points"))
        per_scan, per_frame = (np.array(self._rows[f"points_per_{name}"], np.int64) for name in ("scan", "frame"))
        return DatasetStatistics(
            tuple(self._scenes), objects, scans, points, per_scan, per_frame, self.pfa, self.margin, self.most_points
        )


def _kind(item: ObjectState) -> tuple[int, bool]:
    """Return an object's group, and whether it moves."""
    return int(GROUP_OF_SEMANTIC[item.semantic]), _moves(item)


def _moves(item: ObjectState) -> bool:
    return bool(np.linalg.norm(item.twist.linear) > MOVING_SPEED)


def _away(world_from_here: Pose, item: ObjectState) -> float:
    """Return the distance of an object's centre over ground [m]."""
    return float(np.linalg.norm((item.world_from_box.position - world_from_here.position)[:2]))


def _looked_at(items: list[ObjectState], world_from_radar: Pose, farthest: float) -> Iterator[tuple[int, ObjectState]]:
    """Yield the objects, with their index, whose centre lies where a radar looks."""
    radar_from_world = world_from_radar.inverse()
    for number, item in enumerate(items):
        x, y, _ = radar_from_world.apply(item.world_from_box.position)
        if math.hypot(x, y) <= farthest and abs(math.degrees(math.atan2(y, x))) <= FIELD_OF_VIEW_DEG:
            yield number, item


def _occlusion(frame: Frame) -> Mapping[int, float]:
    """Return by instance the share of an object that is hidden in the camera that sees most of it."""
    found: dict[int, float] = {}
    for image in frame.images.values():
        if image.object_occlusion is None:
            continue
        for item, hidden in zip(frame.objects, image.object_occlusion, strict=True):
            if not math.isnan(hidden):
                found[item.instance] = min(float(hidden), found.get(item.instance, 1.0))
    return found
