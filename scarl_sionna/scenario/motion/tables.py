"""Recorded motion in tables: CSV and Parquet, read and written."""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import (
    MissingPackageError,
    OutputError,
    ParameterRangeError,
    ScarlError,
    ScarlWarning,
    TrajectoryFileError,
)
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular, read_bytes, read_text
from scarl_sionna.scenario.traffic.planned import Conversion, Ground, PlannedActor, lane_ground
from scarl_sionna.scenario.traffic.recorded.fcd import MOST_RECORD_BYTES, model_of_type, read_fcd
from scarl_sionna.scenario.traffic.recorded.osi import HOST, about_trace, read_osi
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory, WaypointTrajectory

from .bodies import ActorBody, BodyLike, body_of
from .paths import sample_motion
from .recorded import FARTHEST_STEP, FASTEST
from .routes import vehicle_trajectory
from .stated import StatedTrack, check_stated

Array = npt.NDArray[np.float64]

_MOST_BYTES = 256 * MEGABYTE
_FARTHEST = 1e8
"""Coordinates beyond it [m] are no place on Earth, whatever the projection."""
COLUMNS = ("time", "id", "x", "y", "z", "yaw_deg", "speed", "model")
"""Columns of a table: the first four are needed."""
_SAME = {
    "actor": "id",
    "track_id": "id",
    "name": "id",
    "t": "time",
    "timestamp": "time",
    "heading_deg": "yaw_deg",
    "type": "model",
}
"""Other names that mean a column."""


SUFFIXES = (".csv", ".parquet")
"""Of the files that are tables in the narrow sense; what else :func:`read_table` reads has formats of its own."""


@dataclass(frozen=True, eq=False)
class TableTrack:
    """Samples of one actor of a table, which a body drives along.

    Attributes
    ----------
    name : str
    model : str
        As the table says it, a name or a word; empty where it says none.
    times : ndarray of float64, shape (N,)
        Strictly rising [s].
    points : ndarray of float64, shape (N, 3)
        Of the actor's origin [m, world].
    yaw_deg : ndarray of float64, shape (N,), or None
        [deg]
    path : Path
    row : int
        First row in the file, from 1.
    """

    name: str
    model: str
    times: Array
    points: Array
    yaw_deg: Array | None
    path: Path
    row: int

    def motion(self, body: ActorBody) -> Trajectory:
        """Return the motion of a body: with headings their spline, else its rear axle follows the way.

        Raises
        ------
        TrajectoryFileError
            If there is no such motion.
        """
        try:
            return _trajectory(self.name, self.times, self.points, self.yaw_deg, body)
        except ScarlError as error:
            raise TrajectoryFileError(f"motion of '{self.name}': {error}", self.path, row=self.row) from error


def read_table(
    path: str | Path, *, ground: LaneNetwork | Ground | None = None, models: Mapping[str, BodyLike] | None = None
) -> dict[str, Trajectory]:
    """Return the motion of each actor of a table.

    Parameters
    ----------
    path : str or Path
        ``.csv`` or ``.parquet`` with the columns ``time`` [s], ``id``, ``x``, ``y`` [m], and, where wanted, ``z`` [m],
        ``yaw_deg`` [deg], ``speed`` [m/s] (only compared: speeds are derivatives) and ``model``; floating car data of
        SUMO (``.xml``, ``.xml.gz``); a trace of ASAM OSI (``.osi``, ``.mcap``), whose host vehicle is called ``ego``; a
        scenario of CommonRoad (``.xml``) or of ASAM OpenSCENARIO (``.xosc``).
    ground, models
        Heights where a table has none, and bodies by model name, as for :func:`read_fcd`.

    Returns
    -------
    dict of str to Trajectory
        By id, in the order of first appearance.

    Raises
    ------
    TrajectoryFileError
        If the file or a column is missing, a value is not usable, or speeds or headings show that units are not these
        (:func:`~scarl_sionna.scenario.motion.stated.check_stated`); names row (from 1, without the header) and column.
    MissingPackageError
        If a package for the format is not installed.

    Warns
    -----
    ScarlWarning
        If the table has a column that is not known, or what it states hardly fits its positions.

    Notes
    -----
    See :func:`read_table_actors`, which also returns models.
    """
    return {actor.name: actor.trajectory for actor in read_table_actors(path, ground=ground, models=models)}


def read_table_actors(
    path: str | Path, *, ground: LaneNetwork | Ground | None = None, models: Mapping[str, BodyLike] | None = None
) -> list[PlannedActor]:
    """Return the actors of a table with models and motion; arguments and errors as for :func:`read_table`.

    Notes
    -----
    With ``yaw_deg`` the motion is the cubic spline (C2) through positions and headings; without, the rear axle of the
    model (a saloon where none is named) follows the smooth curve through the positions (:func:`vehicle_trajectory`). An
    actor that never moves more than 1 cm stands.
    """
    path = Path(path)
    suffixes = "".join(path.suffixes[-2:]).lower()
    if suffixes.endswith((".xml", ".xml.gz")):
        if not suffixes.endswith(".gz") and _root_tag(path) == "commonRoad":
            from scarl_sionna.scenario.traffic.recorded.commonroad import read_commonroad

            return read_commonroad(path, ground=ground, models=models)
        return read_fcd(path, ground=ground, models=models)
    if path.suffix.lower() in (".osi", ".mcap"):
        *_, host = about_trace(path)
        found = read_osi(path, conversion=Conversion(ground, models=models))
        return [replace(actor, name=HOST) if actor.name == host else actor for actor in found]
    if path.suffix.lower() == ".xosc":
        from scarl_sionna.scenario.openscenario.actors import read_openscenario

        return read_openscenario(path, models=models)
    if path.suffix.lower() not in SUFFIXES:
        raise TrajectoryFileError(
            f"the format '{path.suffix}' is not known", path, "give .csv, .parquet, .xml, .xml.gz, .osi or .mcap"
        )
    return [_actor(track, models) for track in table_tracks(path, ground)]


def table_tracks(path: Path, ground: LaneNetwork | Ground | None = None) -> list[TableTrack]:
    """Return the samples of each actor of a ``.csv`` or ``.parquet``; arguments and errors as for :func:`read_table`.

    Their motions are made by whoever knows what drives along them.
    """
    columns = _csv(path) if path.suffix.lower() == ".csv" else _parquet(path)
    return _tracks(path, columns, lane_ground(ground) if isinstance(ground, LaneNetwork) else ground)


def _actor(track: TableTrack, models: Mapping[str, BodyLike] | None) -> PlannedActor:
    """Return the actor of a track with the body that the table names, a saloon's where it names none."""
    kind = track.model
    model = model_of_type(kind) if not (models and kind in models) else kind
    body = body_of(model, models) if kind else ActorBody()
    span = (float(track.times[0]), float(track.times[-1]))
    return PlannedActor(track.name, model, None, track.motion(body), body, 0.0, span)


def write_table(
    path: str | Path, actors: Sequence[tuple[str, Trajectory] | PlannedActor], times: npt.ArrayLike
) -> None:
    """Write the motion of actors at times (N,) [s] as a table (``.csv`` or ``.parquet``).

    With headings, speeds and, if known, models.

    Raises
    ------
    TimeRangeError
        If a motion is not known at one of the times.
    OutputError
        If the file cannot be written.
    """
    path = Path(path)
    rows: dict[str, list[object]] = {name: [] for name in COLUMNS}
    for actor in actors:
        name, trajectory = (actor.name, actor.trajectory) if isinstance(actor, PlannedActor) else actor
        model = actor.model if isinstance(actor, PlannedActor) else ""
        motion = sample_motion(trajectory, times)
        speed = np.linalg.norm(motion.velocity, axis=1)
        for index, time in enumerate(motion.times.tolist()):
            values = (
                time,
                name,
                *motion.position[index].tolist(),
                float(np.degrees(motion.heading[index])),
                float(speed[index]),
                model,
            )
            for key, value in zip(COLUMNS, values, strict=True):
                rows[key].append(value)
    if not any(rows["model"]):
        del rows["model"]
    try:
        if path.suffix.lower() == ".parquet":
            _pandas().DataFrame(rows).to_parquet(path, index=False)
        elif path.suffix.lower() == ".csv":
            with path.open("w", newline="", encoding="utf-8") as file:
                writer = csv.writer(file)
                writer.writerow(rows)
                writer.writerows(zip(*rows.values(), strict=True))
        else:
            raise ParameterRangeError("path", path, "a file that ends in .csv or .parquet")
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}; choose a writable folder") from error


def _root_tag(path: Path) -> str:
    import xml.etree.ElementTree as ET

    try:
        with open_regular(path, MOST_RECORD_BYTES) as file:
            return str(next(iter(ET.iterparse(file, ("start",))))[1].tag)
    except (OSError, ET.ParseError, StopIteration, ValueError, LookupError) as error:
        raise TrajectoryFileError(f"cannot be read as XML ({error})", path) from error


def _pandas() -> ModuleType:
    try:
        import pandas
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise MissingPackageError("pandas and pyarrow", "tables") from error
    return pandas


def _csv(path: Path) -> dict[str, list[object]]:
    try:
        text = read_text(path, _MOST_BYTES, "utf-8-sig")
        rows = [row for row in csv.reader(io.StringIO(text, newline="")) if row]
    except (OSError, csv.Error) as error:
        raise TrajectoryFileError(f"cannot be read ({error})", path, "give a readable CSV file") from error
    if not rows:
        raise TrajectoryFileError("is empty", path, "the first line names the columns: " + ", ".join(COLUMNS))
    header, body = [name.strip() for name in rows[0]], rows[1:]
    for index, row in enumerate(body, start=1):
        if len(row) != len(header):
            raise TrajectoryFileError(f"{len(row)} values", path, f"the header has {len(header)} columns", row=index)
    return {name: [row[column].strip() for row in body] for column, name in enumerate(header)}


def _parquet(path: Path) -> dict[str, list[object]]:
    pandas = _pandas()
    try:
        frame = pandas.read_parquet(io.BytesIO(read_bytes(path, _MOST_BYTES)))
    except Exception as error:  # what pyarrow raises on a broken file is not one class
        raise TrajectoryFileError(f"cannot be read ({error})", path, "give a readable Parquet file") from error
    return {str(name): frame[name].tolist() for name in frame.columns}


def _tracks(path: Path, given: dict[str, list[object]], ground: Ground | None) -> list[TableTrack]:
    columns = {_SAME.get(name.lower(), name.lower()): values for name, values in given.items()}
    for name in COLUMNS[:4]:
        if name not in columns:
            raise TrajectoryFileError("is missing", path, f"the file has {', '.join(given) or 'none'}", column=name)
    unknown = [name for name in given if _SAME.get(name.lower(), name.lower()) not in COLUMNS]
    if unknown:
        known = ", ".join((*COLUMNS, *_SAME))
        warnings.warn(f"{path}: not used: {', '.join(unknown)}; known columns: {known}", ScarlWarning, stacklevel=4)
    numbers = {
        name: _floats(path, name, columns[name]) for name in ("time", "x", "y", "z", "yaw_deg") if name in columns
    }
    speeds = np.array([_number(value) for value in columns["speed"]]) if "speed" in columns else None
    rows_of: dict[str, list[int]] = {}
    for index, value in enumerate(columns["id"]):
        if value is None or not str(value).strip():
            raise TrajectoryFileError("is empty", path, row=index + 1, column="id")
        rows_of.setdefault(str(value).strip(), []).append(index)
    if not rows_of:
        raise TrajectoryFileError("has no rows", path)
    tracks, stated = [], []
    for name, listed in rows_of.items():
        rows = np.array(listed)
        times = numbers["time"][rows]
        if np.any(np.diff(times) <= 0.0):
            row = listed[int(np.flatnonzero(np.diff(times) <= 0.0)[0]) + 1]
            raise TrajectoryFileError(
                f"{numbers['time'][row]:g} s does not come after the time before of '{name}'",
                path,
                "sort the rows of each actor",
                row + 1,
                "time",
            )
        plan = np.stack([numbers["x"][rows], numbers["y"][rows]], axis=1)
        _check_steps(path, name, times, plan, listed)
        height = numbers["z"][rows] if "z" in numbers else ground(plan) if ground is not None else np.zeros(len(rows))
        kind = str(columns["model"][listed[0]] or "").strip() if "model" in columns else ""
        yaw = numbers["yaw_deg"][rows] if "yaw_deg" in numbers else None
        tracks.append(TableTrack(name, kind, times, np.column_stack([plan, height]), yaw, path, listed[0] + 1))
        own = None if speeds is None else speeds[rows]
        stated.append(StatedTrack(times, plan, own, None if yaw is None else np.radians(yaw)))
    check_stated(path, stated)
    return tracks


def _check_steps(path: Path, name: str, times: Array, plan: Array, rows: Sequence[int]) -> None:
    """Raise where an actor jumps: the curve through a jump would go for kilometres."""
    far = np.maximum(FASTEST * np.diff(times), FARTHEST_STEP)
    steps = np.linalg.norm(np.diff(plan, axis=0), axis=1)
    bad = np.flatnonzero(~(steps <= far))
    if bad.size:
        index = int(bad[0])
        raise TrajectoryFileError(
            f"'{name}' goes {steps[index]:.4g} m in {times[index + 1] - times[index]:.3g} s",
            path,
            f"at most {FASTEST:g} m/s; give actors that are carried elsewhere another id",
            rows[index + 1] + 1,
        )


def _floats(path: Path, name: str, values: Sequence[object]) -> Array:
    numbers = np.empty(len(values))
    for index, value in enumerate(values):
        numbers[index] = _number(value)
        if not np.isfinite(numbers[index]):
            raise TrajectoryFileError(f"{value!r:.60} is not a finite number", path, row=index + 1, column=name)
        if abs(numbers[index]) > _FARTHEST:
            raise TrajectoryFileError(f"{value!r:.60} is beyond {_FARTHEST:g}", path, row=index + 1, column=name)
    return numbers


def _number(value: object) -> float:
    """Return a value as a number, nan for what is none."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return float("nan")


def _trajectory(name: str, times: Array, points: Array, yaw_deg: Array | None, body: ActorBody) -> Trajectory:
    if np.ptp(points, axis=0).max() < 0.01 and (yaw_deg is None or np.ptp(np.unwrap(np.radians(yaw_deg))) < 1e-3):
        pose = Pose.from_euler(points.mean(0), yaw=0.0 if yaw_deg is None else float(np.radians(yaw_deg[0])))
        return StaticTrajectory(
            pose, float(times[0]) if len(times) > 1 else -np.inf, float(times[-1]) if len(times) > 1 else np.inf
        )
    if yaw_deg is not None:
        return WaypointTrajectory(times, points, yaw_deg, name=name)
    return vehicle_trajectory(points, times, model=body, name=name)
