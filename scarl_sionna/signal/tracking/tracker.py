"""The tracker: clusters of frame after frame, from a sensor that may move, become tracks over ground."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.arguments import expect, number

from .clusters import RadarClusters
from .tracks import RadarTracks

if TYPE_CHECKING:
    from datetime import datetime

    from stonesoup.types.detection import Detection
    from stonesoup.types.state import State
    from stonesoup.types.track import Track

    from .stone_soup import Parts

Array = npt.NDArray[np.float64]

NEAREST = 0.1
"""Clusters nearer to the radar than this have no bearing [m]."""
STEEPEST = np.radians(60.0)
"""Clusters higher or lower than this are left out: their range rate says little of motion over ground."""


class TrackOptions(TypedDict, total=False):
    """Keywords of :func:`track`."""

    position_std: float
    angle_std: float
    velocity_std: float
    acceleration: float
    initial_speed: float
    gate: float
    confirm: int
    max_missed: int


DEFAULTS: dict[str, float] = {
    "position_std": 0.5,
    "angle_std": 0.02,
    "velocity_std": 0.3,
    "acceleration": 1.0,
    "initial_speed": 8.0,
    "gate": 0.99,
    "confirm": 3,
    "max_missed": 2,
}


def track(
    clusters: Sequence[RadarClusters],
    times: npt.ArrayLike,
    mounts: Sequence[Mount | Pose] | Mount | Pose,
    **options: Unpack[TrackOptions],
) -> RadarTracks:
    r"""Return the tracks of objects over ground that clusters of successive frames belong to.

    Parameters
    ----------
    clusters : sequence of RadarClusters
        One a frame, from :func:`ss.cluster`.
    times : array_like of float, shape (num_frames,)
        Of the frames, increasing by a microsecond or more [s].
    mounts : sequence of Mount or Pose
        Of the radar in each frame, or one for all. A bare pose stands still; the range rate of a radar that moves
        needs its velocity (``state.mount("ego", pose)``).
    **options
        Standard deviations of a cluster: `position_std` (0.5 m) of its centre on the object, along and across the line
        of sight, `angle_std` (0.02 rad) of the radar's angle, `velocity_std` (0.3 m/s). `acceleration` (1 m2/s3): power
        density of the accelerations of objects. `initial_speed` (8 m/s): standard deviation of a component of an
        object's velocity before it is measured. `gate` (0.99): probability that an object's own cluster is within the
        gate. `confirm` (3): clusters that make a track. `max_missed` (2): frames in a row that a track lives without.

    Returns
    -------
    RadarTracks

    Raises
    ------
    InputTypeError
        If `clusters` or `mounts` hold something else.
    ParameterRangeError
        If there are no frames, numbers of frames differ, times do not increase, or an option is out of range.
    MissingPackageError
        If Stone Soup is not installed (``pip install 'scarl-sionna[tracking]'``).

    Notes
    -----
    By Stone Soup: nearly constant velocity over ground in an extended Kalman filter, bearing, range and range rate seen
    from the radar's own place and velocity, global nearest neighbour by Mahalanobis distance within a gate. Heights are
    left out: bearing and range are those over ground, and the range rate is divided by the cosine of the elevation.
    Numeric options are not charted.

    *Not modelled*: velocities beyond the radar's unambiguous interval, which a track would take as they are; the extent
    of objects, whose centre is that of the points seen.
    """
    frames, stamps, places = _checked(clusters, times, mounts)
    setting = _settings(options)
    require("stonesoup", "tracking")
    from .stone_soup import Motion, measurement, parts, stamp

    motion = Motion(
        setting["acceleration"],
        setting["initial_speed"],
        setting["gate"],
        int(setting["confirm"]),
        int(setting["max_missed"]),
    )
    tool = parts(motion)
    book = _Book()
    alive: set[Track] = set()
    for frame, (found, time, place) in enumerate(zip(frames, stamps, places, strict=True)):
        sensor = place.pose.position[:2], place.twist.linear[:2]
        seen = {
            measurement(time, value, deviation, sensor, row)
            for row, value, deviation in _measured(found, place.pose, setting)
        }
        alive = _step(tool, alive, seen, stamp(time))
        book.write(frame, time, alive, frames)
    return book.table()


def _step(tool: Parts, alive: set[Track], seen: set[Detection], now: datetime) -> set[Track]:
    """Return the confirmed tracks after a frame."""
    used = set()
    for one, chosen in tool.associator.associate(alive, seen, now).items():
        if chosen:
            one.append(tool.updater.update(chosen))
            used.add(chosen.measurement)
        else:
            one.append(chosen.prediction)
    alive = alive - tool.deleter.delete_tracks(alive)
    return alive | tool.initiator.initiate(seen - used, now)


def _measured(found: RadarClusters, pose: Pose, setting: dict[str, float]) -> list[tuple[int, Array, Array]]:
    """Return row, (bearing, range, range rate) over ground and standard deviations of every cluster; exact geometry."""
    out = []
    for row, away in enumerate(pose.rotate(found.position)):
        level = float(np.hypot(away[0], away[1]))
        if level < NEAREST or abs(away[2]) > np.tan(STEEPEST) * level:
            continue
        slope = level / float(np.linalg.norm(away))
        rate = float(found.radial_velocity[row])
        value = np.array([np.arctan2(away[1], away[0]), level, rate / slope])
        across = np.hypot(setting["angle_std"], setting["position_std"] / level)
        out.append((row, value, np.array([across, setting["position_std"], setting["velocity_std"] / slope])))
    return out


class _Book:
    """What is written down of tracks: their numbers, the clusters that they took, and the rows of the table."""

    def __init__(self) -> None:
        self.numbers: dict[str, int] = {}
        self.votes: dict[str, list[tuple[int, int]]] = {}
        self.rows: list[tuple[Any, ...]] = []

    def write(self, frame: int, time: float, alive: set[Track], frames: Sequence[RadarClusters]) -> None:
        """Add the rows of one frame."""
        from .stone_soup import ORDER

        fresh = [one for one in alive if one.id not in self.numbers]
        for one in sorted(fresh, key=lambda item: (_taken(item.states[-1]), *np.ravel(item.state_vector).tolist())):
            self.numbers[one.id] = len(self.numbers)
            first = frame + 1 - len(one.states)
            self.votes[one.id] = [
                vote
                for number, state in zip(range(first, frame), one.states[:-1], strict=True)
                for vote in _votes(frames[number], _taken(state))
            ]
        for one in sorted(alive, key=lambda item: self.numbers[item.id]):
            row = _taken(one.states[-1])
            votes = self.votes[one.id]
            votes += _votes(frames[frame], row)
            count = Counter(votes)
            last = {vote: place for place, vote in enumerate(votes)}
            label = max(votes, key=lambda vote: (count[vote], last[vote]), default=(0, 0))
            mean, covariance = np.ravel(one.state_vector).astype(np.float64)[ORDER], np.asarray(one.covar, np.float64)
            self.rows.append((frame, time, self.numbers[one.id], mean, covariance[np.ix_(ORDER, ORDER)], row, label))

    def table(self) -> RadarTracks:
        """Return all rows."""
        count = len(self.rows)
        frame, time, number, mean, covariance, row, label = zip(*self.rows, strict=True) if count else ((),) * 7
        state, labels = np.reshape(mean, (count, 4)), np.reshape(label, (count, 2))
        return RadarTracks(
            frame=np.array(frame, dtype=np.int64),
            time=np.array(time, dtype=np.float64),
            track=np.array(number, dtype=np.int64),
            position=state[:, :2],
            velocity=state[:, 2:],
            covariance=np.reshape(covariance, (count, 4, 4)),
            cluster=np.array(row, dtype=np.int64),
            instance=labels[:, 0].astype(np.int32),
            semantic=labels[:, 1].astype(np.uint8),
        )


def _taken(state: State) -> int:
    """Return the row of the cluster that a state was updated by, -1 for none."""
    chosen = getattr(state, "hypothesis", None)
    return int(chosen.measurement.metadata["cluster"]) if chosen else -1


def _votes(found: RadarClusters, row: int) -> list[tuple[int, int]]:
    """Return instance and class of a cluster, nothing for no cluster or no label."""
    if row < 0 or found.instance[row] == 0:
        return []
    return [(int(found.instance[row]), int(found.semantic[row]))]


def _checked(
    clusters: Sequence[RadarClusters], times: npt.ArrayLike, mounts: Sequence[Mount | Pose] | Mount | Pose
) -> tuple[list[RadarClusters], list[float], list[Mount]]:
    """Return frames, times and mounts, one each."""
    expect("clusters", clusters, (list, tuple), "give a list, one ss.cluster(points) a frame")
    for position, one in enumerate(clusters):
        expect(f"clusters[{position}]", one, RadarClusters, "give ss.cluster(points)")
    if not len(clusters):
        raise ParameterRangeError("clusters", "no frames", "one frame or more")
    stamps = np.asarray(times, dtype=np.float64)
    if stamps.shape != (len(clusters),) or not np.isfinite(stamps).all():
        raise ParameterRangeError("times", f"an array of shape {stamps.shape}", f"{len(clusters)} finite times [s]")
    late = np.flatnonzero(np.diff(stamps) < 1e-6)
    if len(late):
        shown = f"{stamps[late[0]]:g} s, then {stamps[late[0] + 1]:g} s"
        raise ParameterRangeError("times", shown, "increasing by 1e-6 s or more", "sort the frames by time")
    places = [mounts] * len(clusters) if isinstance(mounts, Mount | Pose) else list(mounts)
    if len(places) != len(clusters):
        raise ParameterRangeError("mounts", f"{len(places)} mounts", f"one, or {len(clusters)}, one a frame")
    return list(clusters), stamps.tolist(), [Mount.of(place) for place in places]


def _settings(options: TrackOptions) -> dict[str, float]:
    """Return all options as numbers."""
    for name in options:
        if name not in DEFAULTS:
            raise UnknownNameError("option of track", name, tuple(DEFAULTS))
    setting = {name: number(name, value, "give one number") for name, value in {**DEFAULTS, **options}.items()}
    for name, value in setting.items():
        if name == "gate":
            fits, allowed = 0.0 < value < 1.0, "0 < gate < 1"
        elif name in ("confirm", "max_missed"):
            least = 1 if name == "confirm" else 0
            fits, allowed = value >= least and value == int(value), f"a whole number >= {least}"
        else:
            fits, allowed = 0.0 < value < np.inf or (name == "angle_std" and value == 0.0), "> 0"
        if not fits:
            raise ParameterRangeError(name, f"{value:g}", allowed)
    return setting
