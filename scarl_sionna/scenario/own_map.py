"""The map of a recorded drive: a drive of nuScenes' tables takes place in the map expansion of its location."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScenarioFileError, ScenarioValueError, TrajectoryFileError, UnknownNameError

from .spec.light import name_error
from .spec.motion import TableSpec
from .spec.scenario import ScenarioSpec
from .traffic.recorded.nuscenes_tables import NuscenesDrive, read_scene

OWN_MAP = "nuscenes"
"""As the scene of a scenario: the map of the drive whose tables the traffic or the ego vehicle names."""
FOLDER = "maps/expansion"
"""Where map expansions lie beside the folder of the tables."""


def own_map(spec: ScenarioSpec) -> tuple[str, npt.NDArray[np.float64] | None]:
    """Return the file of the map that a scenario takes place in, and the way of the ego vehicle of its tables (N, 2).

    The way is None where no tables are named; all of the map is built then.

    Raises
    ------
    ScenarioError
        If the scene is that of the tables and none are named, or they, or their map, are not there.
    """
    found = _drive(spec)
    if found is None:
        if spec.scene == OWN_MAP:
            raise ScenarioValueError(
                "takes the map of a drive of nuScenes, and none is named", spec.place("scene"),
                "add traffic: {source: nuscenes, file: ...}", value=spec.scene,
            )  # fmt: skip # a call
        return spec.scene, None
    file, drive = found
    way = np.array([one.position[:2] for one in drive.ego])
    if spec.scene != OWN_MAP:
        return spec.scene, way
    place = spec.find(file).resolve().parent / FOLDER / f"{drive.location}.json"
    if not place.is_file():
        raise ScenarioFileError(
            f"the map of '{drive.location}' is not there: {place}", spec.place("scene"),
            f"put the map expansion into {FOLDER} beside the tables, or name another scene", value=spec.scene,
        )  # fmt: skip # a call
    return str(place), way


def _drive(spec: ScenarioSpec) -> tuple[str, NuscenesDrive] | None:
    """Return the folder of tables that a scenario names, and the drive; None where it names none."""
    stated: list[tuple[str, str | None, tuple[str, ...]]] = []
    if spec.traffic is not None and spec.traffic.source == "nuscenes" and spec.traffic.file is not None:
        stated.append((spec.traffic.file, spec.traffic.sequence, ("traffic",)))
    if spec.ego is not None and isinstance(spec.ego.trajectory, TableSpec):
        motion = spec.ego.trajectory
        if (spec.find(motion.file) / "ego_pose.json").is_file():
            stated.append((motion.file, motion.sequence, ("ego", "trajectory")))
    for file, sequence, where in stated:
        try:
            return file, read_scene(spec.find(file), sequence)
        except UnknownNameError as error:
            raise name_error(error, spec.place(*where, "sequence")) from error
        except TrajectoryFileError as error:
            raise ScenarioFileError(str(error), spec.place(*where, "file"), value=file) from error
    return None
