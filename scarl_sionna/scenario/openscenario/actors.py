"""The entities of an OpenSCENARIO file as actors with smooth motion."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike, body_of
from scarl_sionna.scenario.motion.recorded import Record, Smoothed, smooth_record
from scarl_sionna.scenario.traffic.people import person_for
from scarl_sionna.scenario.traffic.planned import PlannedActor
from scarl_sionna.scene.motion.trajectory import Trajectory

from .drive import Drive, read_drive
from .reading.entities import MODELS, Entity
from .running.motion import Motion
from .turning import goes_back, sharpest, smooth_turning

Array = npt.NDArray[np.float64]
HOST = "ego"
"""Name of the ego vehicle where motion is taken by name."""
KNOT_TIME = 0.1
"""Time between the knots of the way [s]: a run is free of noise, and its accelerations may change in steps."""
_APART = 1e-3
_RAMP = 1.0
"""Way over which a kerb is climbed [m]."""


def read_openscenario(
    path: str | Path,
    *,
    map_file: str | Path | None = None,
    span: tuple[float, float] | None = None,
    types: Mapping[str, str] | None = None,
    models: Mapping[str, BodyLike] | None = None,
) -> list[PlannedActor]:
    """Return the entities of an OpenSCENARIO file with the motion that its storyboard gives them.

    Parameters
    ----------
    path : str or Path
        OpenSCENARIO XML, 1.0 to 1.3 [1]_.
    map_file : str, Path or None
        OpenDRIVE file of the roads; None: the one that the file names.
    span : (float, float) or None
        Times [s] at which the motion shall be known at least. None: those of the run, from 0 s on.
    types : mapping or None
        Actor models by the names of entities, by those of their vehicles, or by category, as ``{"car": "suv"}``; others
        get the model of their category that is nearest in size; people are drawn by name among those about as tall.
    models : mapping or None
        Bodies by model name.

    Returns
    -------
    list of PlannedActor
        In the order of the file; `name` is that of the entity, in letters, digits, dashes and underscores.

    Raises
    ------
    ScenarioError
        As of :func:`scarl_sionna.scenario.openscenario.drive.read_drive`.

    Warns
    -----
    ScarlWarning
        If something has no effect, or no model stands for an entity, which is left out.

    References
    ----------
    .. [1] ASAM OpenSCENARIO XML 1.3.1, 2024.
    """
    return planned_actors(read_drive(path, map_file), span, types, models)


def planned_actors(
    drive: Drive,
    span: tuple[float, float] | None = None,
    types: Mapping[str, str] | None = None,
    models: Mapping[str, BodyLike] | None = None,
) -> list[PlannedActor]:
    """Return the entities of a drive; arguments as of :func:`read_openscenario`."""
    return [actor for own in _by_entity(drive, span, types, models).values() for actor in own]


def _by_entity(
    drive: Drive,
    span: tuple[float, float] | None = None,
    types: Mapping[str, str] | None = None,
    models: Mapping[str, BodyLike] | None = None,
) -> dict[str, list[PlannedActor]]:
    """Return the actors of each entity of a drive."""
    actors: dict[str, list[PlannedActor]] = {}
    left_out = []
    for name, entity in drive.entities.items():
        track = drive.run.tracks[name]
        if not track:
            continue
        model = model_of(entity, types)
        if model is None:
            left_out.append(f"'{name}' ({entity.category})")
            continue
        actors[name] = _actors(drive, entity, track, model, body_of(model, models), span)
    if left_out:
        warnings.warn(
            f"no actor model stands for {', '.join(left_out[:5])} of {drive.path.name}: left out",
            ScarlWarning,
            stacklevel=4,
        )
    return actors


def entity_tracks(path: Path, map_file: Path | None) -> dict[str, Trajectory]:
    """Return the motions of a file's entities by their names; that of the ego vehicle also as ``ego``.

    Raises
    ------
    ScenarioError
        As of :func:`read_openscenario`.
    """
    drive = read_drive(path, map_file)
    alone = (own[0] for own in _by_entity(drive).values() if len(own) == 1)  # a motion is one way
    found = {actor.name: actor.trajectory for actor in alone}
    if drive.hero is not None and actor_name(drive.hero) in found:
        found.setdefault(HOST, found[actor_name(drive.hero)])
    return {**found, **{name: found[actor_name(name)] for name in drive.entities if actor_name(name) in found}}


def actor_name(name: str) -> str:
    """Return the name of an entity's actor."""
    return re.sub(r"[^A-Za-z0-9_\-]", "_", name) or "entity"


def model_of(entity: Entity, types: Mapping[str, str] | None = None) -> str | None:
    """Return the actor model of an entity; None where none stands for it."""
    from scarl_sionna.scene.actors.model import actor_names

    for key in (entity.name, entity.label, entity.category):
        if types and key in types:
            return types[key]
    known = actor_names()
    for text in (entity.properties.get("actor_model", ""), entity.label):
        if text in known:
            return text
    if entity.category == "pedestrian":
        return person_for(entity.name, f"{entity.name} {entity.label}", entity.box.height)
    choices = [one for one in MODELS.get(entity.category, ()) if one in known]
    if entity.kind == "vehicle" and not choices and entity.category not in ("trailer", "semitrailer", "train", "tram"):
        choices = [one for one in MODELS["car"] if one in known]
    if not choices:
        return None
    return min(choices, key=lambda one: _difference(entity, body_of(one)))


def _difference(entity: Entity, body: ActorBody) -> float:
    return abs(entity.box.length - body.length) + 2.0 * abs(entity.box.height - body.height)


def _actors(
    drive: Drive,
    entity: Entity,
    track: Sequence[Motion],
    model: str,
    body: ActorBody,
    span: tuple[float, float] | None,
) -> list[PlannedActor]:
    """Return the actors of an entity: one for each time that it is there, and for each place that it is carried to."""
    found: list[PlannedActor] = []
    leaps = [list(part) for _, part in groupby(track, key=lambda motion: motion.leap)]
    whole = (track[0].time, track[-1].time) if span is None else span
    for number, part in enumerate(leaps):
        start = -np.inf if number == 0 else part[0].time
        stop = leaps[number + 1][0].time if number + 1 < len(leaps) else np.inf
        spans = [(max(low, start), min(high, stop)) for low, high in _spans(drive, entity)]
        spans = [(low, high) for low, high in spans if high - low > _APART or len(leaps) == 1]
        if not spans:
            continue
        motion = _smoothed(drive, entity, part, body, whole if len(leaps) > 1 else span)
        for active in spans:
            name = _free(actor_name(entity.name), len(found), drive)
            found.append(PlannedActor(name, model, None, motion.trajectory, body, 0.0, active, motion.deviation))
    if len(found) > 1 and entity.name == drive.hero:
        raise entity.node.unsupported(
            "let it be there all the time: it carries the sensors", f"comes and goes {len(found)} times"
        )
    return found


def _free(name: str, number: int, drive: Drive) -> str:
    """Return the name of an entity's actor, with a number from the second one on, that no other entity has."""
    names = {actor_name(one) for one in drive.entities}
    found = name if number == 0 else f"{name}_{number + 1}"
    while number and found in names:
        found += "_"
    return found


def _smoothed(
    drive: Drive, entity: Entity, track: Sequence[Motion], body: ActorBody, span: tuple[float, float] | None
) -> Smoothed:
    times, points, headings, speeds = _samples(drive, track)
    record = Record(entity.name, times, points, headings, body.rear_axle)
    if len(times) == 1:
        times = np.array([times[0], times[0] + 1.0])
        record = Record(entity.name, times, np.repeat(points, 2, 0), np.repeat(headings, 2), body.rear_axle)
    try:
        if goes_back(speeds):
            return smooth_turning(replace(record, headings=np.unwrap(headings)), speeds, body, span, KNOT_TIME)
        return smooth_record(record, body, span, KNOT_TIME, sharpest(record.points, ways_of(record.points)))
    except ParameterRangeError as error:
        raise entity.node.error(str(error)) from error


def _spans(drive: Drive, entity: Entity) -> list[tuple[float, float]]:
    """Return the times at which an entity is there [s]; one without any is there at none."""
    spans = drive.run.seen.get(entity.name, [])
    return [(-np.inf if start <= 0.0 else start, stop) for start, stop in spans] or [(0.0, 0.0)]


def _samples(drive: Drive, track: Sequence[Motion]) -> tuple[Array, Array, Array, Array]:
    """Return times (N,), points (N, 3) on the ground, headings and speeds (N,); instants nearly the same are one."""
    kept: list[Motion] = []
    for motion in track:
        if kept and motion.time - kept[-1].time < _APART and len(kept) > 1:
            kept.pop()
        elif kept and motion.time - kept[-1].time < _APART:
            continue
        kept.append(motion)
    times = np.array([one.time for one in kept])
    points = np.array([(one.x, one.y, one.z or 0.0) for one in kept])
    headings = np.array([one.heading for one in kept])
    roads = drive.roads
    if roads is not None:
        spots = [one.spot for one in kept]
        names = [spot.road for spot in spots if spot is not None]
        if len(names) == len(spots):
            s = np.array([spot.s for spot in spots if spot is not None])
            t = np.array([one.t(roads) for one in kept])
            points[:, 2] = _rounded(points, roads.heights(names, s, t))
    return times, points, headings, np.array([one.speed for one in kept])


def ways_of(points: Array) -> Array:
    """Return the way (N,) [m] in plan along points (N, 3)."""
    return np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))]


def _rounded(points: Array, heights: Array) -> Array:
    """Return heights (N,) [m] whose steps, as those of kerbs, are ramps over `_RAMP`."""
    way = ways_of(points)
    moving = np.r_[True, np.diff(way) > 1e-6]
    if moving.sum() < 2 or np.ptp(heights) < 1e-6:
        return heights
    along, area = way[moving], np.zeros(int(moving.sum()))
    area[1:] = np.cumsum(0.5 * (heights[moving][1:] + heights[moving][:-1]) * np.diff(along))
    low, high = np.clip(way - 0.5 * _RAMP, 0.0, along[-1]), np.clip(way + 0.5 * _RAMP, 0.0, along[-1])
    span = np.maximum(high - low, 1e-9)
    return np.asarray((np.interp(high, along, area) - np.interp(low, along, area)) / span)


def scenario_data(path: Path) -> tuple[dict[str, Any], dict[tuple[str | int, ...], tuple[int, int]]]:
    """Return the scenario of an OpenSCENARIO file as the keys of a scenario file, and the lines that they stand for.

    Raises
    ------
    ScenarioError
        As of :func:`read_drive`, or if it names no map or has no vehicle.
    """
    drive = read_drive(path)
    root = next(iter(drive.entities.values())).node
    if drive.map_file is None:
        raise root.error("the scenario names no map", "write a scenario file with a `scene`, see docs/openscenario.md")
    if drive.hero is None:
        raise root.error("the scenario has no vehicle that could carry the sensors", "write a scenario file")
    folder = path.resolve().parent
    scene = drive.map_file.resolve()
    model = model_of(drive.entities[drive.hero])
    data: dict[str, Any] = {
        "scene": str(scene.relative_to(folder)) if scene.is_relative_to(folder) else str(scene),
        "duration": max(round(drive.run.stop, 5), 0.1),
        "name": re.sub(r"[^A-Za-z0-9_\-]", "_", path.stem),
        "ego": {"model": model, "trajectory": {"kind": "table", "file": path.name}},
        "traffic": {"source": "openscenario", "file": path.name},
        "keep_default_actors": False,
        "collisions": "warn",
        **drive.surroundings,
    }
    marks: dict[tuple[str | int, ...], tuple[int, int]] = {(key,): (line, 1) for key, line in drive.lines.items()}
    return data, marks
