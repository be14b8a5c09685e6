"""One scene of nuScenes' tables as plain data: poses of the ego vehicle, boxes by object. Tables are read row by row.

References
----------
.. [1] H. Caesar et al., "nuScenes: A multimodal dataset for autonomous driving", CVPR 2020, and its schema page.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import TrajectoryFileError, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular
from scarl_sionna.core.untrusted.json_text import iterate_json_array

Array = npt.NDArray[np.float64]
Row = dict[str, Any]

TABLES = ("scene", "log", "sample", "sample_data", "ego_pose", "category", "instance", "sample_annotation")
"""Tables that are read."""
MOST_BYTES = 8000 * MEGABYTE
"""Size of a table on the disk [bytes]."""
MOST_ROWS = 2_000_000
"""Rows of a table that belong to one scene."""
LARGEST = 1e7
"""Coordinates [m] and sizes beyond it are refused."""
_REMEDY = "give the folder of nuScenes' tables, as data/v1.0-mini"


class Placed(NamedTuple):
    """Where something was: time since the scene's first sample [s], position [m, world], heading [rad], upward axis."""

    time: float
    position: tuple[float, float, float]
    heading: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Track:
    """One object: category, length, width, height [m] (medians), and the centre of its box at each keyframe.

    `own_name` is its name in the run that an export of ours holds, None for others.
    """

    token: str
    category: str
    size: tuple[float, float, float]
    boxes: tuple[Placed, ...]
    own_name: str | None

    @property
    def feet(self) -> list[Placed]:
        """The ground below the middle of the box at each keyframe."""
        found = []
        for one in self.boxes:
            x, y, z = (np.array(one.position) - 0.5 * self.size[2] * np.array(one.up)).tolist()
            found.append(one._replace(position=(x, y, z)))
        return found


@dataclass(frozen=True, eq=False)
class NuscenesDrive:
    """One scene: where the ego vehicle was, and the tracks by name.

    Attributes
    ----------
    name, location : str
        Of the scene, and of its map.
    is_own : bool
        Whether this package wrote it: poses of the ego vehicle are then those of its middle, else of its rear axle.
    ego : tuple of Placed
        On the ground, rising times.
    tracks : dict of str to Track
    stop : float
        Time of the last sample [s]; the first is at 0.
    """

    name: str
    location: str
    is_own: bool
    ego: tuple[Placed, ...]
    tracks: dict[str, Track]
    stop: float


def read_scene(folder: Path, sequence: str | None = None) -> NuscenesDrive:
    """Return one scene of a folder of tables; the last few stay in memory as long as their files are the same.

    Parameters
    ----------
    folder : Path
        With the tables (``scene.json`` and others).
    sequence : str or None
        Name of the scene; None: the only one.

    Raises
    ------
    TrajectoryFileError
        If a table is not there or no table, or a record lacks something; names file and token.
    UnknownNameError
        If no scene has that name, or there are several and none is named.
    """
    marks = []
    for table in TABLES:
        path = folder / f"{table}.json"
        if not path.is_file():
            raise TrajectoryFileError("table not found", path, _REMEDY)
        about = path.stat()
        marks.append((about.st_size, about.st_mtime_ns))
    return _read(folder, sequence, tuple(marks))


@lru_cache(maxsize=4)
def _read(folder: Path, sequence: str | None, marks: tuple[tuple[int, int], ...]) -> NuscenesDrive:
    """Return a scene; `marks` are sizes and times of the tables, so that changed ones are read again."""
    scene = _scene(folder, sequence)
    samples = {
        row.token: row.whole("timestamp") for row in _rows(folder, "sample", "scene_token", {scene.token}.__contains__)
    }
    if not samples:
        raise TrajectoryFileError(f"no sample of scene '{scene.token}'", folder / "sample.json")
    start = min(samples.values())
    shift, is_own = np.zeros(3), "scarl_world_from_map" in scene.row
    if is_own:
        shift = scene.numbers("scarl_world_from_map", 3)
    location = next((row.text("location") for row in _rows(folder, "log", "token", scene.text("log_token").__eq__)), "")
    ego = _ego(folder, samples, start, shift)
    tracks = _tracks(folder, samples, start, shift)
    return NuscenesDrive(scene.text("name"), location, is_own, ego, tracks, (max(samples.values()) - start) / 1e6)


@dataclass(frozen=True, eq=False)
class _Record:
    """A row of a table with checked values."""

    row: Row
    path: Path

    @property
    def token(self) -> str:
        return self.text("token")

    def fault(self, message: str) -> TrajectoryFileError:
        return TrajectoryFileError(f"record '{str(self.row.get('token'))[:40]}': {message}", self.path)

    def text(self, key: str) -> str:
        value = self.row.get(key)
        if not isinstance(value, str):
            raise self.fault(f"{key} = {value!r:.60} is no text")
        return value

    def whole(self, key: str) -> int:
        value = self.row.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**62:
            raise self.fault(f"{key} = {value!r:.60} is no time [us]")
        return value

    def numbers(self, key: str, count: int) -> Array:
        value = self.row.get(key)
        fine = isinstance(value, list) and len(value) == count
        if not fine or not all(isinstance(one, int | float) and abs(one) <= LARGEST for one in value):  # type: ignore[union-attr]
            raise self.fault(f"{key} = {value!r:.60} is not {count} finite numbers up to {LARGEST:g}")
        return np.array(value, dtype=np.float64)

    def placed(self, time: float, shift: Array) -> Placed:
        """Return position and heading at a time; the rotation has no need to be of unit length."""
        turn = self.numbers("rotation", 4)
        if np.linalg.norm(turn) < 1e-3:
            raise self.fault("rotation is a quaternion of length 0")
        forward, _, up = Pose(np.zeros(3), turn / np.linalg.norm(turn)).rotation.T
        x, y, z = (self.numbers("translation", 3) + shift).tolist()
        return Placed(
            time, (x, y, z), float(np.arctan2(forward[1], forward[0])), (float(up[0]), float(up[1]), float(up[2]))
        )


def _rows(folder: Path, table: str, key: str, wanted: Callable[[str], bool]) -> Iterator[_Record]:
    """Yield the records of a table whose value of a key is wanted."""
    path, count = folder / f"{table}.json", 0
    try:
        with open_regular(path, MOST_BYTES) as file:
            for row in iterate_json_array(file):
                if not isinstance(row, dict) or not isinstance(row.get("token"), str):
                    raise TrajectoryFileError(f"{row!r:.60} is no record with a token", path, _REMEDY)
                record = _Record(row, path)
                if wanted(record.text(key)):
                    count += 1
                    if count > MOST_ROWS:
                        raise TrajectoryFileError(f"more than {MOST_ROWS} records of one scene", path)
                    yield record
    except (OSError, ValueError) as error:
        raise TrajectoryFileError(f"cannot be read ({error})", path, _REMEDY) from error


def _scene(folder: Path, sequence: str | None) -> _Record:
    scenes = {row.text("name"): row for row in _rows(folder, "scene", "token", lambda _: True)}
    if not scenes:
        raise TrajectoryFileError("holds no scene", folder / "scene.json")
    if sequence is None and len(scenes) == 1:
        return next(iter(scenes.values()))
    if sequence not in scenes:
        raise UnknownNameError("sequence", str(sequence), sorted(scenes))
    return scenes[sequence]


def _ego(folder: Path, samples: dict[str, int], start: int, shift: Array) -> tuple[Placed, ...]:
    wanted = {row.text("ego_pose_token") for row in _rows(folder, "sample_data", "sample_token", samples.__contains__)}
    found: dict[int, Placed] = {}
    for row in _rows(folder, "ego_pose", "token", wanted.__contains__):
        time = row.whole("timestamp")
        found.setdefault(time, row.placed((time - start) / 1e6, shift))
    if not found:
        raise TrajectoryFileError("no pose of the ego vehicle in this scene", folder / "ego_pose.json")
    return tuple(found[time] for time in sorted(found))


def _tracks(folder: Path, samples: dict[str, int], start: int, shift: Array) -> dict[str, Track]:
    boxes: dict[str, dict[int, tuple[Placed, Array]]] = {}
    first: dict[str, _Record] = {}
    for row in _rows(folder, "sample_annotation", "sample_token", samples.__contains__):
        time, size = samples[row.text("sample_token")], row.numbers("size", 3)
        if not np.all(size > 0.0):
            raise row.fault(f"size = {size.tolist()} is not above 0 [m]")
        first.setdefault(row.text("instance_token"), row)
        boxes.setdefault(row.text("instance_token"), {})[time] = (row.placed((time - start) / 1e6, shift), size)
    names = {row.token: row.text("name") for row in _rows(folder, "category", "token", lambda _: True)}
    tracks: dict[str, Track] = {}
    for row in _rows(folder, "instance", "token", boxes.__contains__):
        category = names.get(row.text("category_token"))
        if category is None:
            raise row.fault(f"category '{row.text('category_token')[:40]}' is in no row of category.json")
        own = boxes.pop(row.token)
        width, length, height = np.median([size for _, size in own.values()], axis=0).tolist()
        own_name = row.text("scarl_name") if "scarl_name" in row.row else None
        name = re.sub(r"[^A-Za-z0-9_\-]", "_", own_name or f"{category.rpartition('.')[2]}_{len(tracks)}")
        if name in tracks:
            raise row.fault(f"'{name}' is the name of another one")
        placed = tuple(own[time][0] for time in sorted(own))
        tracks[name] = Track(row.token, category, (length, width, height), placed, own_name)
    if boxes:
        alone = next(iter(boxes))
        raise first[alone].fault(f"instance '{alone[:40]}' is in no row of instance.json")
    return tracks
