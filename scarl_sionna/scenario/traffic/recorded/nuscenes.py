"""Recorded traffic from a scene of nuScenes' tables: its boxes with our actors, the way of its ego vehicle."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_smoothing_spline
from scipy.optimize import isotonic_regression

import scenes_xml
from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning, TrajectoryFileError, UnknownNameError
from scarl_sionna.scenario.motion.bodies import ActorBody, body_of
from scarl_sionna.scenario.motion.recorded import KNOT_TIME, Record, smooth_record
from scarl_sionna.scene.actors.model import ActorModel, read_actor_model
from scarl_sionna.scene.motion.trajectory import Trajectory
from scenes_xml.actors.bodies.roles import WALKERS

from ..planned import Conversion, PlannedActor
from .fcd import planned_from_record
from .nuscenes_tables import NuscenesDrive, Placed, Track, read_scene

Array = npt.NDArray[np.float64]

EGO = "ego"
"""Name of the ego vehicle where motion is taken by name."""
CLASSES: Mapping[str, tuple[str, ...]] = {
    "human.pedestrian": ("Pedestrian",), "vehicle.bicycle": ("Bicycle",), "vehicle.motorcycle": ("Motorcycle",),
    "vehicle.car": ("Car",), "vehicle.emergency.police": ("Car",), "vehicle.emergency": ("Car", "Truck"),
    "vehicle.truck": ("Car", "Truck"), "vehicle.construction": ("Truck",), "vehicle.trailer": ("Truck",),
    "vehicle.bus": ("Bus",),
}  # fmt: skip # a table
"""Classes of the actor models that a category may become, by the start of its name; the model nearest in size is taken.
Others (barriers, cones, debris) are left out."""
SMOOTHING = 0.005
"""Weight of the squared acceleration [s3] beside that of the squared distances of a track's boxes: what varies from one
keyframe to the next (0.5 s) is taken to a fifth, what takes 3 s to 96 %."""
NAMED: Mapping[str, str] = {
    "human.pedestrian.wheelchair": "wheelchair", "human.pedestrian.stroller": "pram", "animal": "dog",
    "human.pedestrian.personal_mobility": "scooter",
}  # fmt: skip # a table
"""Categories that have one actor model; no other category becomes one of these."""
NOTABLE = 0.3
"""Distance of a smoothed motion from its record that a warning tells of [m]: boxes of parked cars vary by so much."""
_SITTING = "sitting_man"
_LEAST_STEP = 0.09
"""Least time between two poses of the ego vehicle that are used [s]: closer ones hold the noise of its localisation."""
_EXACT = 0.19
"""Least time between the knots of the way of what this package wrote [s]."""
_KERB = 0.3
"""Heights of a record that are so near those of the lanes are kept [m]: lanes know no kerbs."""
_MOVES = 0.5
"""Way between two keyframes above which the heading is that of the way [m]; below, that of the box."""
_STANDS = 0.5
"""An object that is never farther from its median place stands [m]; people 0.3 m."""


def model_for(track: Track, models: Sequence[ActorModel] | None = None) -> str | None:
    """Return the name of the actor model nearest in size among those of a track's class; None where there is none.

    Parameters
    ----------
    track : Track
    models : sequence of ActorModel, optional
        To choose from; default: those of the package.

    Notes
    -----
    Sizes are compared by the sum of the absolute logarithms of their ratios; of people almost by height alone, since
    length and width of their boxes depend on step and arms.
    """
    if track.category in NAMED:
        return NAMED[track.category]
    key = max((name for name in CLASSES if track.category.startswith(name)), key=len, default=None)
    if key is None:
        return None
    pool = [read_actor_model(name) for name in scenes_xml.actor_names()] if models is None else models
    moves = _extent(track.boxes) > _STANDS
    others = (*NAMED.values(), _SITTING, *WALKERS)
    fitting = [one for one in pool if one.semantic in CLASSES[key] and one.name not in others]
    fitting = [one for one in fitting if not (moves and one.motion == "stand")]
    if key == "vehicle.trailer":  # a box of its own beside that of what tows it
        fitting = [one for one in fitting if all(joint["kind"] != "trailer" for joint in one.joints)]

    def misfit(model: ActorModel) -> float:
        ratios = np.abs(np.log(np.array(track.size) / [model.length, model.width, model.height]))
        return float(ratios[2] + 0.1 * ratios[1] if model.semantic == "Pedestrian" else ratios.sum())

    return min(fitting, key=misfit).name if fitting else None


def read_nuscenes(
    folder: str | Path,
    sequence: str | None = None,
    *,
    span: tuple[float, float] | None = None,
    conversion: Conversion | None = None,
) -> list[PlannedActor]:
    """Return the boxes of a scene of nuScenes' tables as traffic.

    Parameters
    ----------
    folder : str or Path
        Of the tables (``data/v1.0-mini``), of nuScenes or written by :func:`scarl_sionna.export_nuscenes`.
    sequence : str or None
        Name of the scene; None: the only one.
    span : (float, float) or None
        As of :func:`scarl_sionna.scenario.traffic.recorded.fcd.read_fcd`; times count from the scene's first sample.
    conversion : Conversion, optional
        `types` by category, as ``{"vehicle.car": "suv"}``; else the model of the class that is nearest in size.

    Returns
    -------
    list of PlannedActor
        `active` is from the first to the last keyframe with a box; `deviation` says how far the motion is off it.

    Raises
    ------
    TrajectoryFileError
        If a table is missing or broken; names file and token.
    UnknownNameError
        If there is no scene of that name.

    Warns
    -----
    ScarlWarning
        If objects have no actor model, are in one keyframe only, jump, or are smoothed by more than 0.3 m.
    """
    conversion, drive = conversion or Conversion(), read_scene(Path(folder), sequence)
    actors, without, alone = [], [], 0
    for name, track in drive.tracks.items():
        model = (conversion.types or {}).get(track.category) or model_for(track)
        if model is None:
            without.append(track.category)
            continue
        if len(track.boxes) < 2:
            alone += 1
            continue
        body = body_of(model, conversion.models)
        record = _record(name, track.feet, body, 0.0, conversion, 0.0 if drive.is_own else SMOOTHING)
        try:
            actor = planned_from_record(record, model, body, span, conversion, _knot_time(drive))
            actors.append(replace(actor, deviation=_deviation(actor.trajectory, track.feet, conversion)))
        except ParameterRangeError as error:
            warnings.warn(f"'{name}' of {drive.name} is left out: {error}", ScarlWarning, stacklevel=2)
    _tell(drive, actors, without, alone)
    return actors


def _tell(drive: NuscenesDrive, actors: Sequence[PlannedActor], without: Sequence[str], alone: int) -> None:
    """Warn of what is left out, and of what was smoothed by much."""
    parts = []
    if without:
        kinds = ", ".join(sorted(set(without)))
        parts.append(f"{len(without)} objects have no actor model ({kinds})")
    if alone:
        parts.append(f"{alone} are in one keyframe only")
    far = sorted((one for one in actors if one.deviation > NOTABLE), key=lambda one: -one.deviation)
    if far:
        parts.append(
            f"{len(far)} of {len(actors)} motions are smoothed by more than {NOTABLE:g} m, "
            f"'{far[0].name}' by {far[0].deviation:.2g} m"
        )
    if parts:
        warnings.warn(f"{drive.name}: {'; '.join(parts)}", ScarlWarning, stacklevel=3)


def about_scene(folder: str | Path, sequence: str | None = None) -> tuple[float, float, dict[str, str | None]]:
    """Return the first and the last time of a scene [s], and the tracks by name with their names in a run of ours."""
    drive = read_scene(Path(folder), sequence)
    return 0.0, drive.stop, {name: track.own_name for name, track in drive.tracks.items()}


def nuscenes_motion(
    folder: str | Path, sequence: str | None, wanted: str, body: ActorBody, conversion: Conversion
) -> Trajectory:
    """Return the motion of the ego vehicle (``ego``) or of an object of a scene by its name.

    Parameters
    ----------
    folder, sequence
        As of :func:`read_nuscenes`.
    wanted : str
    body : ActorBody
        Whose rear axle follows the way: that of the actor that takes the motion.
    conversion : Conversion

    Raises
    ------
    TrajectoryFileError, UnknownNameError
        As :func:`read_nuscenes`; also if the record jumps.
    """
    drive = read_scene(Path(folder), sequence)
    if wanted == EGO:
        record = _record(EGO, _ego_rows(drive), body, 0.0 if drive.is_own else body.rear_axle, conversion)
    elif wanted in drive.tracks:
        record = _record(wanted, drive.tracks[wanted].feet, body, 0.0, conversion)
    else:
        raise UnknownNameError("track", wanted, [EGO, *drive.tracks])
    try:
        return smooth_record(record, body, knot_time=_knot_time(drive)).trajectory
    except ParameterRangeError as error:
        raise TrajectoryFileError(str(error), Path(folder) / "ego_pose.json") from error


def _ego_rows(drive: NuscenesDrive) -> list[Placed]:
    """Return poses of the ego vehicle that are apart, and one after the last at its speed: sensors look into frames."""
    rows = [drive.ego[0]]
    for one in drive.ego[1:]:
        if one.time - rows[-1].time >= _LEAST_STEP:
            rows.append(one)
    if len(rows) < 2:
        return rows
    rows[-1], before, after = drive.ego[-1], rows[-2], _knot_time(drive) + 0.01
    share = after / (rows[-1].time - before.time)
    x, y, z = ((1.0 + share) * np.array(rows[-1].position) - share * np.array(before.position)).tolist()
    return [*rows, Placed(rows[-1].time + after, (x, y, z), rows[-1].heading)]


def _knot_time(drive: NuscenesDrive) -> float:
    """Return the least time between the knots of a way [s]: what this package wrote has no noise."""
    return _EXACT if drive.is_own else KNOT_TIME


def _extent(rows: Sequence[Placed]) -> float:
    places = np.array([one.position[:2] for one in rows])
    return float(np.linalg.norm(places - np.median(places, axis=0), axis=1).max())


def _deviation(trajectory: Trajectory, rows: Sequence[Placed], conversion: Conversion) -> float:
    """Return the largest distance in plan of a motion from the boxes that it was made of [m]."""
    inside = [one for one in rows if trajectory.start <= one.time <= trajectory.stop]
    places = np.array([trajectory.pose(one.time).position[:2] for one in inside])
    return float(np.linalg.norm(places - [one.position[:2] for one in inside] - conversion.offset, axis=1).max())


def _record(
    name: str, rows: Sequence[Placed], body: ActorBody, ahead: float, conversion: Conversion, smoothing: float = 0.0
) -> Record:
    """Return placed boxes as the record of a rear axle; `ahead`: how far their reference is ahead of the origin [m]."""
    times = np.array([one.time for one in rows])
    points = np.array([one.position for one in rows]) + [*conversion.offset, 0.0]
    headings = np.unwrap([one.heading for one in rows])
    height = conversion.heights()
    if height is not None:
        ground = np.asarray(height(points), dtype=np.float64)
        points[:, 2] = np.where(np.abs(points[:, 2] - ground) <= _KERB, points[:, 2], ground)
    if _extent(rows) <= (_STANDS if body.wheelbase > 0.0 else 0.6 * _STANDS):
        points[:] = np.median(points, axis=0)
        headings[:] = np.median(headings)
        return Record(name, times, points, headings, ahead)
    forward = np.stack([np.cos(headings), np.sin(headings), np.zeros(len(rows))], axis=1)
    points = points + (body.rear_axle - ahead) * forward
    if smoothing > 0.0 and len(times) >= 5:
        points = np.asarray(make_smoothing_spline(times, points, lam=smoothing)(times))
    points, backwards = _onwards(points, forward)
    return Record(name, times, points, _along(points, headings, backwards), body.rear_axle, backwards)


def _onwards(points: Array, forward: Array) -> tuple[Array, bool]:
    """Return points (N, 3) that go on and never back, and whether it is backwards that they go.

    The way along the headings is made monotone (isotonic regression), so that boxes that vary round one place stand.
    """
    middle = forward[:-1] + forward[1:]
    steps = (np.diff(points, axis=0) * middle / np.linalg.norm(middle, axis=1, keepdims=True)).sum(1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    backwards = bool(way[-1] < 0.0)
    fitted = isotonic_regression(way, increasing=not backwards).x
    points = points + (fitted - way)[:, None] * forward
    first = 0
    for last in [*np.flatnonzero(np.abs(np.diff(fitted)) > 1e-9), len(way) - 1]:
        if last > first:  # it stands: it does not go to the side either
            points[first : last + 1] = points[first : last + 1].mean(0)
        first = last + 1
    return points, backwards


def _along(points: Array, headings: Array, backwards: bool) -> Array:
    """Return the headings of the way where it goes on, those of the boxes elsewhere [rad]."""
    steps = (points[2:] - points[:-2]) * (-1.0 if backwards else 1.0)
    found = headings.copy()
    turn = np.arctan2(steps[:, 1], steps[:, 0]) - headings[1:-1]
    turn = (turn + np.pi) % (2.0 * np.pi) - np.pi
    far = (np.linalg.norm(steps[:, :2], axis=1) > _MOVES) & (np.abs(turn) < np.pi / 3.0)
    found[1:-1] += np.where(far, turn, 0.0)
    return found
