"""Dynamic obstacles of CommonRoad scenarios (XML), by the package commonroad-io."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import MissingPackageError, ParameterRangeError, ScarlWarning, TrajectoryFileError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.untrusted.xml_text import read_xml
from scarl_sionna.scenario.motion.bodies import BodyLike, body_of
from scarl_sionna.scenario.motion.recorded import Record, smooth_record
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import StaticTrajectory

from ..people import person_for
from ..planned import Conversion, Ground, PlannedActor

if TYPE_CHECKING:
    from commonroad.scenario.obstacle import Obstacle

MODELS: Mapping[str, str] = {
    "car": "saloon", "truck": "lorry", "bus": "bus", "bicycle": "bicycle", "priorityVehicle": "van",
    "parkedVehicle": "saloon", "motorcycle": "motorcycle", "taxi": "saloon",
}  # fmt: skip # a table
"""Actor models of CommonRoad's types of obstacles; others (buildings, pillars, trains) are left out. Pedestrians are
people of all ages by their numbers."""
_ON_FOOT = "pedestrian"


def read_commonroad(
    path: str | Path,
    *,
    span: tuple[float, float] | None = None,
    ground: LaneNetwork | Ground | None = None,
    types: Mapping[str, str] | None = None,
    models: Mapping[str, BodyLike] | None = None,
    offset: tuple[float, float] = (0.0, 0.0),
) -> list[PlannedActor]:
    """Return the obstacles of a CommonRoad scenario.

    Parameters
    ----------
    path : str or Path
        XML of the versions that commonroad-io reads (2018b, 2020a) [1]_.
    span, ground, models, offset
        As for :func:`scarl_sionna.scenario.traffic.recorded.fcd.read_fcd`.
    types : mapping or None
        Actor models by CommonRoad's types; None, or a type that it lacks: `MODELS`.

    Returns
    -------
    list of PlannedActor
        Named ``obstacle_<id>``, in the order of the ids.

    Raises
    ------
    MissingPackageError
        If commonroad-io is not installed.
    TrajectoryFileError
        If the file cannot be read.

    Warns
    -----
    ScarlWarning
        If an obstacle is left out: a type without a model, no trajectory, states that are sets instead of values, or a
        jump.

    References
    ----------
    .. [1] M. Althoff, M. Koschi, S. Manzinger, CommonRoad: composable benchmarks for motion planning on roads, IEEE IV
       2017.
    """
    path = Path(path)
    try:  # the reader of XML alone: the one of both formats needs an old protobuf, with which TensorFlow does not run
        from commonroad.common.reader.file_reader_xml import XMLFileReader
    except ImportError as error:
        raise MissingPackageError("commonroad-io", "commonroad") from error
    try:
        if read_xml(path).tag != "commonRoad":
            raise TrajectoryFileError("the root element is not <commonRoad>", path)
        scenario, _ = XMLFileReader(str(path)).open()
    except TrajectoryFileError:
        raise
    except OSError as error:
        raise TrajectoryFileError(f"cannot be read ({error})", path) from error
    except Exception as error:  # the package raises whatever its parser stumbles on
        raise TrajectoryFileError(
            f"is not a scenario that commonroad-io reads ({type(error).__name__}: {error})", path
        ) from error
    conversion = Conversion(ground, types, models, offset)
    height = conversion.heights()
    actors = []
    for obstacle in sorted(scenario.obstacles, key=lambda one: one.obstacle_id):
        try:
            actors.append(_actor(obstacle, float(scenario.dt), span, height, conversion))
        except ParameterRangeError as error:
            warnings.warn(
                f"obstacle {obstacle.obstacle_id} of {path.name} is left out: {error}", ScarlWarning, stacklevel=2
            )
    return actors


def _actor(
    obstacle: Obstacle, step: float, span: tuple[float, float] | None, height: Ground | None, conversion: Conversion
) -> PlannedActor:
    name, kind = f"obstacle_{obstacle.obstacle_id}", str(obstacle.obstacle_type.value)
    model = (conversion.types or {}).get(kind) or (person_for(name) if kind == _ON_FOOT else MODELS.get(kind))
    if model is None:
        raise ParameterRangeError("type", kind, ", ".join((*MODELS, _ON_FOOT)), "name a model for it in `types`")
    body = body_of(model, conversion.models)
    prediction = getattr(obstacle, "prediction", None)
    states = [
        obstacle.initial_state,
        *(prediction.trajectory.state_list if prediction is not None and hasattr(prediction, "trajectory") else ()),
    ]
    rows = []
    for state in states:
        place, turn = state.position, state.orientation
        if (
            not isinstance(place, np.ndarray)
            or not isinstance(turn, (int, float))
            or not isinstance(state.time_step, int)
        ):
            raise ParameterRangeError(
                f"state at step {state.time_step}", "a set of positions or headings", "exact values"
            )
        rows.append(
            (state.time_step * step, place[0] + conversion.offset[0], place[1] + conversion.offset[1], 0.0, turn)
        )
    table = np.array(rows, dtype=np.float64)
    if height is not None:
        table[:, 3] = height(table[:, 1:3])
    if len(table) == 1:
        pose = Pose.from_heading(table[0, 1:4], float(table[0, 4]))
        return PlannedActor(name, model, None, StaticTrajectory(pose), body)
    smoothed = smooth_record(Record(name, table[:, 0], table[:, 1:4], table[:, 4]), body, span)
    present = (float(table[0, 0]), float(table[-1, 0]))
    return PlannedActor(
        name, model, None, smoothed.trajectory, body, 0.0, present, smoothed.deviation, smoothed.num_lane_changes
    )
