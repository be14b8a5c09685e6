"""Recorded traffic from traces of ASAM OSI, and moving objects of its messages.

Traces ``.osi`` need no package, ``.mcap`` and messages the extra ``osi``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import TrajectoryFileError
from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import Pose

from ..people import person_for
from ..planned import Conversion, PlannedActor
from .fcd import MOST_SAMPLES, Samples, planned_from_samples
from .osi_trace import TracedObject, TracedTruth, Triple, read_trace

Array = npt.NDArray[np.float64]

MODELS = {
    "vehicle.small_car": "small_car",
    "vehicle.compact_car": "small_car",
    "vehicle.delivery_van": "van",
    "vehicle.heavy_truck": "lorry",
    "vehicle.semitractor": "lorry",
    "vehicle.motorbike": "motorcycle",
    "vehicle.bicycle": "bicycle",
    "vehicle.standup_scooter": "scooter",
    "vehicle.bus": "bus",
    "pedestrian": "adult_man",
}
"""Actor models by kind; other kinds are a saloon. Pedestrians of a trace are people of all ages by their numbers."""
HOST = "ego"
"""Name of the host vehicle of a trace where motion is taken by name."""


class MovingState(NamedTuple):
    """One moving object of a ground truth.

    `kind` is OSI's type and vehicle class, as ``"vehicle.car"``; `centre` world_from_box [m]; `velocity` that of the
    centre [m/s, world], None where the message has none; `yaw_rate` [rad/s]; `height` of the box [m].
    """

    name: str
    kind: str
    centre: Pose
    velocity: Array | None
    yaw_rate: float
    height: float

    @property
    def foot(self) -> Pose:
        """world_from_actor: the ground below the middle of the body."""
        below = self.centre.rotation @ np.array([0.0, 0.0, -0.5 * self.height])
        return Pose(self.centre.position + below, self.centre.quaternion)

    def model(self, types: Mapping[str, str] | None) -> str:
        """Return its actor model, by a table of the user's first."""
        return (types or {}).get(self.kind) or MODELS.get(self.kind, "saloon")


def moving_states(truth: Any) -> list[MovingState]:  # noqa: ANN401  # a message of the package
    """Return the moving objects of a GroundTruth message.

    Orientation is yaw, pitch, roll about the body's own axes as ISO 8855 has them [1]_. Of rates the yaw rate alone is
    taken.

    Raises
    ------
    TrajectoryFileError
        If a number is not finite.

    References
    ----------
    .. [1] ASAM OSI 3.8, osi_common.proto (Orientation3d, BaseMoving), osi_object.proto (MovingObject).
    """
    found = []
    for item in truth.moving_object:
        base = item.base
        kind = str(item.type.name).lower()
        if kind == "vehicle" and item.has_field("vehicle_classification"):
            kind = f"vehicle.{item.vehicle_classification.type.name.lower()}"
        angles, velocity = base.orientation, base.velocity if base.has_field("velocity") else None
        turns = (0.0, 0.0, 0.0) if angles is None else (angles.roll, angles.pitch, angles.yaw)
        rate = base.orientation_rate.yaw if base.has_field("orientation_rate") else 0.0
        height = base.dimension.height if base.has_field("dimension") else 0.0
        speed = None if velocity is None else _triple(velocity)
        found.append(_state(TracedObject(item.id.value, kind, _triple(base.position), turns, speed, rate, height)))
    return found


def _state(one: TracedObject) -> MovingState:
    """Return the state of an object; one with a number that is not finite is refused."""
    velocity = None if one.velocity is None else np.array(one.velocity, dtype=np.float64)
    numbers = (*one.position, *one.angles, one.yaw_rate, one.height, *(one.velocity or ()))
    if not np.isfinite(numbers).all():
        raise TrajectoryFileError(f"moving object {one.number} has a number that is not finite")
    roll, pitch, yaw = (np.remainder(np.array(one.angles) + np.pi, 2.0 * np.pi) - np.pi).tolist()
    centre = Pose.from_euler(one.position, yaw, pitch, roll)
    return MovingState(str(one.number), one.kind, centre, velocity, float(one.yaw_rate), float(one.height))


def _triple(vector: Any) -> Triple:  # noqa: ANN401
    return (0.0, 0.0, 0.0) if vector is None else (vector.x, vector.y, vector.z)


class Instant(NamedTuple):
    """One ground truth of a trace: its time [s], the host vehicle's number, and who moves."""

    time: float
    host: str | None
    states: list[MovingState]


def read_ground_truth(path: str | Path) -> Iterator[Instant]:
    """Yield the instants of a trace, ``.osi`` or ``.mcap``, of ground truth or sensor views.

    Raises
    ------
    MissingPackageError
        If it is a ``.mcap`` and betterosi is not installed.
    TrajectoryFileError
        If the file is not there or no such trace.
    """
    path, row = Path(path), 0
    truths = _instants_of_osi(path) if path.suffix.lower() == ".osi" else _instants_of_mcap(path)
    try:
        for row, instant in enumerate(truths, 1):  # noqa: B007  # the error says which
            yield instant
    except TrajectoryFileError as error:
        if error.path is not None:
            raise
        raise TrajectoryFileError(f"message {row + 1}: {error}", path) from error


def _instants_of_osi(path: Path) -> Iterator[Instant]:
    truth: TracedTruth
    for truth in read_trace(path):
        host = None if truth.host is None else str(truth.host)
        yield Instant(truth.time, host, [_state(one) for one in truth.objects])


def _instants_of_mcap(path: Path) -> Iterator[Instant]:
    remedy = "give a trace of GroundTruth or SensorView, .osi or .mcap"
    if path.suffix.lower() != ".mcap":
        raise TrajectoryFileError("is neither .osi nor .mcap", path, remedy)
    osi = require("betterosi", "osi")
    try:
        for truth in osi.read(str(path), return_ground_truth=True):
            host = str(truth.host_vehicle_id.value) if truth.has_field("host_vehicle_id") else None
            time = truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos
            yield Instant(time, host, moving_states(truth))
    except TrajectoryFileError:
        raise
    except Exception as error:  # the package raises what its readers raise
        raise TrajectoryFileError(f"cannot be read ({error})", path, remedy) from error


def about_trace(path: str | Path) -> tuple[float, float, str | None]:
    """Return the first and the last time of a trace [s], and the number of its host vehicle, None where none is told.

    Raises
    ------
    MissingPackageError, TrajectoryFileError
        As of :func:`read_ground_truth`; also if it holds no message.
    """
    start, stop, host = np.inf, -np.inf, None
    for instant in read_ground_truth(path):
        start, stop = min(start, instant.time), max(stop, instant.time)
        host = instant.host if host is None else host
    if start > stop:
        raise TrajectoryFileError("holds no message", path, "give a trace of ground truth with moving objects")
    return start, stop, host


def _model(one: MovingState, types: Mapping[str, str] | None) -> str:
    """Return the model of an object of a trace: of somebody on foot, a person about as tall as the box."""
    if one.kind == "pedestrian" and one.kind not in (types or {}):
        return person_for(one.name, height=one.height)
    return one.model(types)


def read_osi(
    path: str | Path, *, span: tuple[float, float] | None = None, conversion: Conversion | None = None
) -> list[PlannedActor]:
    """Return the moving objects of a trace as traffic.

    Parameters
    ----------
    path : str or Path
        ``.osi`` or ``.mcap``, of GroundTruth or of SensorView.
    span : (float, float) or None
        As of :func:`scarl_sionna.scenario.traffic.recorded.fcd.read_fcd`.
    conversion : Conversion, optional
        `types` by kind, as ``{"vehicle.car": "suv"}``; else :data:`MODELS`, and for pedestrians
        :func:`scarl_sionna.scenario.traffic.people.person_for`.

    Returns
    -------
    list of PlannedActor
        Their names are the numbers of the objects.

    Raises
    ------
    MissingPackageError
        If it is a ``.mcap`` and betterosi is not installed (``pip install 'scarl-sionna[osi]'``).
    TrajectoryFileError
        If the file cannot be read, holds no moving object, or times do not rise; names the message.

    Warns
    -----
    ScarlWarning
        As of :func:`scarl_sionna.scenario.traffic.recorded.fcd.read_fcd`.
    """
    conversion = conversion or Conversion()
    samples: Samples = {}
    kinds: dict[str, tuple[str, bool]] = {}
    before, count = -np.inf, 0
    for row, (time, _, states) in enumerate(read_ground_truth(path), 1):
        if time <= before:
            said = f"message {row} is of {time:.9g} s, the one before of {before:.9g} s"
            raise TrajectoryFileError(said, path, "write messages in the order of their times")
        before = time
        count += len(states)
        if count > MOST_SAMPLES:
            raise TrajectoryFileError(f"holds more than {MOST_SAMPLES} states of objects", path, "cut it")
        for one in states:
            x, y, z = one.foot.position.tolist()
            forward = one.centre.rotation[:, 0]
            angle = 90.0 - float(np.degrees(np.arctan2(forward[1], forward[0])))
            samples.setdefault(one.name, []).append((time, x, y, z, angle))
            if one.name not in kinds:
                kinds[one.name] = (_model(one, conversion.types), one.kind == "pedestrian")
    if not samples:
        raise TrajectoryFileError("holds no moving object", path, "give a trace of ground truth with moving objects")
    as_they_are = replace(conversion, types={model: model for model, _ in kinds.values()})
    return planned_from_samples(samples, kinds, span, as_they_are, at_front=False)
