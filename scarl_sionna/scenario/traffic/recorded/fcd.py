"""Floating car data of SUMO: the XML that ``sumo --fcd-output`` writes, plain or compressed."""

from __future__ import annotations

import gzip
import warnings
import xml.etree.ElementTree as ET
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning, TrajectoryFileError
from scarl_sionna.core.seeds import generator
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike, body_of
from scarl_sionna.scenario.motion.recorded import KNOT_TIME, Record, smooth_record
from scarl_sionna.scenario.motion.stated import StatedTrack, check_stated
from scarl_sionna.scene.actors.model import actor_names
from scarl_sionna.scene.lanes import LaneNetwork

from ..people import person_for
from ..planned import Conversion, Ground, PlannedActor, draw_variant

MOST_RECORD_BYTES = 2000 * MEGABYTE
"""Size of a record of traffic on the disk [bytes]; it is read piece by piece."""
MOST_SAMPLES = 5_000_000

_WORDS = (
    ("bus", "bus"), ("coach", "coach"), ("tram", "tram"), ("pickup", "pickup"),
    ("trailer", "articulated_lorry"), ("articulated", "articulated_lorry"),
    ("truck", "lorry"), ("lorry", "lorry"), ("delivery", "van"), ("van", "van"),
    ("emergency", "van"), ("motorcycle", "motorcycle"), ("moped", "scooter"), ("scooter", "scooter"), ("bike",
    "bicycle"), ("bicycle", "bicycle"),
    ("suv", "suv"), ("wagon", "estate"), ("hatchback", "small_car"), ("small", "small_car"),
    ("child", "child"), ("woman", "adult_woman"), ("ped", "adult_man"), ("person", "adult_man"),
)  # fmt: skip # a table
_ROLES = ("adult_man", "adult_woman", "child")
"""Models that stand for somebody on foot of whom no more is known."""
Samples = dict[str, list[tuple[float, float, float, float, float]]]
"""By name: time [s], x, y, z [m], angle [deg, clockwise from north]."""


def model_of_type(kind: str, is_person: bool = False) -> str:
    """Return the actor model for the name of a type of another program: the model of that name, or by its words.

    Else a saloon; `model_of_record` draws people.
    """
    name = kind.lower()
    if name in actor_names():
        return name
    for word, model in _WORDS:
        if word in name:
            return model
    return "adult_man" if is_person else "saloon"


def model_of_record(name: str, kind: str, is_person: bool = False) -> str:
    """Return the actor model of a road user by its name and that of its type; people are of all ages.

    See :func:`scarl_sionna.scenario.traffic.people.person_for`. A type by the name of one of them is that one.
    """
    model = model_of_type(kind, is_person)
    return person_for(name, kind) if model in _ROLES else model


def heading_of_angle(angle_deg: float) -> float:
    """Return the heading [rad, counter-clockwise from x] of SUMO's angle [deg, clockwise from north (y)]."""
    return float(np.radians(90.0 - angle_deg))


def read_fcd(
    path: str | Path,
    *,
    span: tuple[float, float] | None = None,
    ground: LaneNetwork | Ground | None = None,
    types: Mapping[str, str] | None = None,
    models: Mapping[str, BodyLike] | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
) -> list[PlannedActor]:
    """Return the vehicles and people of a file of SUMO's floating car data.

    Parameters
    ----------
    path : str or Path
        XML, also compressed (``.gz``).
    span : (float, float) or None
        Times [s] at which all actors shall be known: one that is in the file for a part of it goes straight on before
        and after. None: each for the time that it is in the file.
    ground : LaneNetwork, callable or None
        Gives the heights: that of the nearest lane, or a function of points, (N, 3) where the file has heights, else
        (N, 2). None: the file's, 0 where it has none.
    types : mapping or None
        Actor models by SUMO's type names; None, or a type that it lacks: by the words in its name
        (:func:`model_of_type`), people one by one (:func:`model_of_record`).
    models : mapping or None
        Bodies by model name; None, or a name that it lacks: the actor model of that name.
    offset : (float, float)
        Is added to the positions [m]: scene minus network.

    Returns
    -------
    list of PlannedActor
        In the order of their names. `active` is the time in the file.

    Raises
    ------
    TrajectoryFileError
        If the file is missing, is not XML of floating car data, a value is missing or not a number, or speeds show that
        positions are no metres (``--fcd-output.geo``), see :func:`~scarl_sionna.scenario.motion.stated.check_stated`.

    Warns
    -----
    ScarlWarning
        If what it states hardly fits its positions; or
        if one was carried elsewhere by SUMO (teleport) and is left out, or is there for one instant only.

    Notes
    -----
    SUMO's positions are those of the middle of the front bumper; the origin of an actor is half its model's length
    behind, along the path.
    """
    path = Path(path)
    samples, kinds, speeds = _read(path)
    stated = []
    for name, rows in samples.items():
        table = np.array(rows)
        own = np.array(speeds[name]) if len(speeds[name]) == len(rows) else None
        stated.append(StatedTrack(table[:, 0], table[:, 1:3], own, np.radians(90.0 - table[:, 4])))
    check_stated(path, stated, heading="angle")
    return planned_from_samples(samples, kinds, span, Conversion(ground, types, models, offset))


def planned_from_samples(
    samples: Samples,
    kinds: Mapping[str, tuple[str, bool]],
    span: tuple[float, float] | None,
    conversion: Conversion,
    *,
    at_front: bool = True,
) -> list[PlannedActor]:
    """Return the actors of samples as SUMO gives them.

    `kinds` holds each one's type name and whether it is a person; positions of vehicles are those of the middle of the
    front bumper, or of the origin.
    """
    models, offset = conversion.models, conversion.offset
    with_heights = any(row[3] != 0.0 for rows in samples.values() for row in rows)
    height = conversion.heights()
    actors, left_out = [], []
    for name in sorted(samples):
        rows = np.array(samples[name])
        kind, is_person = kinds[name]
        if len(rows) < 2:
            left_out.append(name)
            continue
        model = (conversion.types or {}).get(kind) or model_of_record(name, kind, is_person)
        body = body_of(model, models)
        points = rows[:, 1:4] + [offset[0], offset[1], 0.0]
        if height is not None:
            points[:, 2] = height(points if with_heights else points[:, :2])
        record = Record(
            name,
            rows[:, 0],
            points,
            np.radians(90.0 - rows[:, 4]),
            body.length / 2.0 if at_front and not is_person else 0.0,
        )
        try:
            actors.append(planned_from_record(record, model, body, span, conversion))
        except ParameterRangeError as error:
            warnings.warn(f"'{name}' is left out: {error}", ScarlWarning, stacklevel=3)
    if left_out:
        warnings.warn(
            f"{len(left_out)} actors are there at one instant only and are left out: {', '.join(left_out[:5])}",
            ScarlWarning,
            stacklevel=3,
        )
    return actors


def planned_from_record(
    record: Record,
    model: str,
    body: ActorBody,
    span: tuple[float, float] | None,
    conversion: Conversion,
    knot_time: float = KNOT_TIME,
) -> PlannedActor:
    """Return the actor of a record: smooth motion known for the whole span, active where the record is.

    Raises
    ------
    ParameterRangeError
        As of :func:`scarl_sionna.scenario.motion.recorded.smooth_record`.
    """
    smoothed = smooth_record(record, body, span, knot_time)
    present = (float(record.times[0]), float(record.times[-1]))
    if span is not None:
        present = (max(present[0], span[0]), min(present[1], span[1]))
    look = draw_variant(model, conversion.models, float(generator(0, "recorded_looks", name=record.name).uniform()))
    found = (smoothed.deviation, smoothed.num_lane_changes)
    return PlannedActor(record.name, model, look, smoothed.trajectory, body, 0.0, present, *found)


def _read(path: Path) -> tuple[Samples, dict[str, tuple[str, bool]], dict[str, list[float]]]:
    """Return samples, kinds (type name, whether a person), and the speeds of those samples that state them [m/s]."""
    speeds: dict[str, list[float]] = {}
    samples: Samples = {}
    kinds: dict[str, tuple[str, bool]] = {}
    num_samples = 0
    try:
        with _opened(path) as file:
            time, root = float("nan"), None
            for event, element in ET.iterparse(file, ("start", "end")):
                if root is None:
                    root = element
                    if element.tag != "fcd-export":
                        raise TrajectoryFileError(
                            f"the root element is <{element.tag}>, not <fcd-export>",
                            path,
                            "write it by sumo --fcd-output",
                        )
                if event == "start" and element.tag == "timestep":
                    time = _number(element, "time", path, "timestep")
                elif event == "end" and element.tag in ("vehicle", "person"):
                    num_samples += 1
                    if num_samples > MOST_SAMPLES:
                        raise TrajectoryFileError(f"holds more than {MOST_SAMPLES} samples", path, "cut it")
                    name = str(element.get("id"))
                    where = f"{element.tag} '{name}' at {time:g} s"
                    row = [_number(element, key, path, where) for key in ("x", "y")]
                    height = _number(element, "z", path, where) if "z" in element.attrib else 0.0
                    samples.setdefault(name, []).append(
                        (time, row[0], row[1], height, _number(element, "angle", path, where))
                    )
                    stated = speeds.setdefault(name, [])
                    if "speed" in element.attrib:
                        stated.append(_number(element, "speed", path, where))
                    kinds[name] = (str(element.get("type", "")), element.tag == "person")
                elif event == "end" and element.tag == "timestep":
                    root.clear()
    except (OSError, EOFError, zlib.error) as error:
        raise TrajectoryFileError(
            f"cannot be read ({error})", path, "give a file that sumo --fcd-output wrote"
        ) from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise TrajectoryFileError(
            f"is not valid XML ({error})", path, "give a file that sumo --fcd-output wrote"
        ) from error
    return samples, kinds, speeds


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a file, packed by gzip or not."""
    with open_regular(path, MOST_RECORD_BYTES) as file:
        if path.suffix != ".gz":
            yield file
            return
        with gzip.GzipFile(fileobj=file) as unpacked:
            yield cast(BinaryIO, unpacked)


def _number(element: ET.Element, key: str, path: Path, where: str) -> float:
    text = element.get(key)
    try:
        value = float(text) if text is not None else float("nan")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise TrajectoryFileError(
            f"{where}: {key} is {'missing' if text is None else repr(text)}, not a finite number", path
        )
    return value
