"""Traces of ASAM OSI: moving objects of ground truth, and recorded traffic from them. Needs the extra ``osi``."""

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

from .fcd import Samples, planned_from_samples
from .planned import Conversion, PlannedActor

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
"""Actor models by kind; other kinds are a saloon."""


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
        place, angles, speed = _triple(base.position), base.orientation, base.velocity
        turns = [0.0] * 3 if angles is None else [angles.yaw, angles.pitch, angles.roll]
        velocity = _triple(speed) if base.has_field("velocity") else None
        rate = base.orientation_rate.yaw if base.has_field("orientation_rate") else 0.0
        height = base.dimension.height if base.has_field("dimension") else 0.0
        if not np.isfinite([*place, *turns, *(velocity if velocity is not None else ()), rate, height]).all():
            raise TrajectoryFileError(f"moving object {item.id.value} has a number that is not finite")
        yaw, pitch, roll = np.remainder(np.array(turns) + np.pi, 2.0 * np.pi) - np.pi
        centre = Pose.from_euler(place, float(yaw), float(pitch), float(roll))
        found.append(MovingState(str(item.id.value), kind, centre, velocity, float(rate), float(height)))
    return found


def _triple(vector: Any) -> Array:  # noqa: ANN401
    return np.zeros(3) if vector is None else np.array([vector.x, vector.y, vector.z], dtype=np.float64)


def read_ground_truth(path: str | Path) -> Iterator[tuple[float, Any]]:
    """Yield time [s] and GroundTruth message of a trace, ``.osi`` or ``.mcap``, of ground truth or sensor views.

    Raises
    ------
    MissingPackageError
        If betterosi is not installed.
    TrajectoryFileError
        If the file is not there or no such trace.
    """
    osi = require("betterosi", "osi")
    remedy = "give a trace of GroundTruth or SensorView, .osi or .mcap"
    if Path(path).suffix not in (".osi", ".mcap"):
        raise TrajectoryFileError("is neither .osi nor .mcap", path, remedy)
    try:
        for truth in osi.read(str(path), return_ground_truth=True):
            yield truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos, truth
    except TrajectoryFileError:
        raise
    except Exception as error:  # the package raises what its readers of both formats raise
        raise TrajectoryFileError(f"cannot be read ({error})", path, remedy) from error


def read_osi(
    path: str | Path, *, span: tuple[float, float] | None = None, conversion: Conversion | None = None
) -> list[PlannedActor]:
    """Return the moving objects of a trace as traffic.

    Parameters
    ----------
    path : str or Path
        ``.osi`` or ``.mcap``, of GroundTruth or of SensorView.
    span : (float, float) or None
        As of :func:`scarl_sionna.scenario.traffic.fcd.read_fcd`.
    conversion : Conversion, optional
        `types` by kind, as ``{"vehicle.car": "suv"}``; else :data:`MODELS`.

    Returns
    -------
    list of PlannedActor
        Their names are the numbers of the objects.

    Raises
    ------
    MissingPackageError
        If betterosi is not installed (``pip install 'scarl-sionna[osi]'``).
    TrajectoryFileError
        If the file cannot be read.

    Warns
    -----
    ScarlWarning
        As of :func:`scarl_sionna.scenario.traffic.fcd.read_fcd`.
    """
    conversion = conversion or Conversion()
    samples: Samples = {}
    kinds: dict[str, tuple[str, bool]] = {}
    for time, truth in read_ground_truth(path):
        for one in moving_states(truth):
            x, y, z = one.foot.position.tolist()
            forward = one.centre.rotation[:, 0]
            angle = 90.0 - float(np.degrees(np.arctan2(forward[1], forward[0])))
            samples.setdefault(one.name, []).append((time, x, y, z, angle))
            kinds[one.name] = (one.model(conversion.types), one.kind == "pedestrian")
    as_they_are = replace(conversion, types={model: model for model, _ in kinds.values()})
    return planned_from_samples(samples, kinds, span, as_they_are, at_front=False)
