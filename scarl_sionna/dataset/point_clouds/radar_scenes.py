"""Sequences of RadarScenes: all points in one HDF5 table, its scans in ``scenes.json``.

References
----------
.. [1] O. Schumann et al., "RadarScenes: a real-world radar point cloud data set for automotive applications", FUSION
   2021; radar-scenes.com/dataset/structure; names of labels as in github.com/oleschum/radar_scenes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.packages import require
from scarl_sionna.core.untrusted.checked import Table, checked
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular, read_text
from scarl_sionna.core.untrusted.json_text import parse_json
from scarl_sionna.dataset.statistics.groups import GROUP_NAMES, NO_GROUP

from .table import NO_OBJECT, PointTable, table_of

LARGEST_TABLE, LARGEST_TEXT = 1000 * MEGABYTE, 64 * MEGABYTE
NUMBERS = ("range_sc", "azimuth_sc", "rcs", "vr", "vr_compensated")
NUM_SENSORS = 4
_GROUP_OF_LABEL = np.full(12, NO_GROUP)
for _label, _group in (
    (0, "car"), (1, "large vehicle"), (2, "large vehicle"), (3, "large vehicle"), (4, "large vehicle"),
    (5, "two-wheeler"), (6, "two-wheeler"), (7, "pedestrian"), (8, "pedestrian"),
):  # fmt: skip # a table
    _GROUP_OF_LABEL[_label] = GROUP_NAMES.index(_group)
"""Group of a label: car, large vehicle, truck, bus, train; bicycle, motorised; pedestrian, group of them."""


class _Scene(Table):
    sensor_id: Annotated[int, Field(ge=1, le=NUM_SENSORS)]
    radar_indices: Annotated[list[int], Field(min_length=2, max_length=2)]


class _Scenes(Table):
    scenes: dict[str, _Scene]


def read_radar_scenes_points(path: str | Path) -> PointTable:
    """Return the radar points of a sequence of RadarScenes.

    Needs the extra ``hdf5``.

    Parameters
    ----------
    path : str or Path
        Folder of a sequence, with ``radar_data.h5`` and ``scenes.json``.

    Returns
    -------
    PointTable
        With groups and tracks of moving road users; a group of pedestrians is one of ``"pedestrian"``. No elevation
        and SNR.

    Raises
    ------
    InputFileError
        If a file is missing or damaged, or scans do not lie in the table.
    MissingPackageError
        If h5py is not installed.
    """
    folder = Path(path).absolute()
    scenes = _scenes(folder / "scenes.json")
    rows = _table(folder / "radar_data.h5")
    scan, sensor, time = (np.full(len(rows), NO_OBJECT), np.zeros(len(rows), np.int64), np.full(len(rows), np.nan))
    for number, (stamp, scene) in enumerate(scenes):
        first, last = scene.radar_indices
        if not 0 <= first <= last <= len(rows):
            raise InputFileError(
                f"has a scene of rows {first} to {last}, the table has {len(rows)}", folder / "scenes.json"
            )
        scan[first:last], sensor[first:last] = number, scene.sensor_id - 1
        time[first:last] = (stamp - scenes[0][0]) * 1e-6
    kept = scan != NO_OBJECT
    labels = np.asarray(rows["label_id"], dtype=np.int64)
    if labels.size and not (labels.min() >= 0 and labels.max() < len(_GROUP_OF_LABEL)):
        raise InputFileError("has a label that there is not", folder / "radar_data.h5")
    group = _GROUP_OF_LABEL[labels]
    columns: dict[str, npt.NDArray[Any]] = {
        "scan": scan,
        "sensor": sensor,
        "time": time,
        "range": rows["range_sc"].astype(np.float64),
        "azimuth": rows["azimuth_sc"].astype(np.float64),
        "radial_velocity": rows["vr"],
        "velocity_over_ground": rows["vr_compensated"],
        "rcs_dbsm": rows["rcs"],
        "group": group,
        "track": np.where(group == NO_GROUP, NO_OBJECT, _numbered(rows["track_id"])),
    }
    notes = ["no radar of this dataset measures elevation", "objects that stand still have no label"]
    if not kept.all():
        notes.append(f"{np.count_nonzero(~kept)} points of no scan are left out")
    sensors = [f"radar_{number + 1}" for number in range(NUM_SENSORS)]
    return table_of(
        "radar_scenes", sensors, notes, len(scenes), {name: column[kept] for name, column in columns.items()}
    )


def _scenes(path: Path) -> list[tuple[int, _Scene]]:
    """Return the scans with their times [us], rising."""
    try:
        found = checked(_Scenes, parse_json(read_text(path, LARGEST_TEXT)))
        return sorted(((int(stamp[:20]), scene) for stamp, scene in found.scenes.items()), key=lambda item: item[0])
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    except ValueError as error:
        raise InputFileError(f"is no scenes.json of RadarScenes ({error})", path) from error


def _table(path: Path) -> npt.NDArray[np.void]:
    """Return the table ``radar_data``, after a check of its size and of its fields."""
    h5py = require("h5py", "hdf5")
    wanted = (*NUMBERS, "label_id", "track_id")
    try:
        with open_regular(path, 10 * LARGEST_TABLE):
            pass
        with h5py.File(path, "r") as file:
            table = file["radar_data"]
            missing = [name for name in wanted if name not in (table.dtype.names or ())]
            if missing or table.ndim != 1:
                raise InputFileError(f"has no {', '.join(missing) or 'row a point'} in radar_data", path)
            if table.size * table.dtype.itemsize > LARGEST_TABLE:
                raise InputFileError(f"would have {table.size} points, at most 1 GB is read", path)
            rows: npt.NDArray[np.void] = table[()]
    except InputFileError:
        raise
    except (OSError, KeyError, AttributeError, ValueError, TypeError, RuntimeError) as error:
        raise InputFileError(f"is no radar_data.h5 of RadarScenes ({error})", path) from error
    kinds = {name: rows.dtype[name].kind for name in wanted}
    if any(kinds[name] != "f" for name in NUMBERS) or kinds["label_id"] not in "iu" or kinds["track_id"] not in "SOV":
        raise InputFileError("has fields of other types in radar_data", path)
    if not all(np.all(np.isfinite(rows[name])) for name in NUMBERS):
        raise InputFileError("has values that are no numbers", path)
    return rows


def _numbered(names: npt.NDArray[Any]) -> npt.NDArray[np.int64]:
    """Return a number for each name, from 0."""
    if names.dtype.kind == "O":
        names = np.array([name if isinstance(name, bytes) else str(name).encode() for name in names], dtype=bytes)
    return np.asarray(np.unique(names, return_inverse=True)[1], dtype=np.int64).reshape(len(names))
