"""Radar sweeps of nuScenes: one ``.pcd`` file a scan.

References
----------
.. [1] H. Caesar et al., "nuScenes: a multimodal dataset for autonomous driving", CVPR 2020; fields, their meaning and
   which states are left out as in github.com/nutonomy/nuscenes-devkit, nuscenes/utils/data_classes.py.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputFileError
from scarl_sionna.core.untrusted.files import MEGABYTE, read_bytes

from .table import PointTable, table_of

LARGEST = 16 * MEGABYTE
UNKNOWN_RCS_DBSM = -64.0
"""The least that the dataset's radar can send; in exported files an RCS that is not known."""
NEEDED = ("x", "y", "rcs", "vx", "vy", "vx_comp", "vy_comp", "dyn_prop", "ambig_state", "invalid_state")
_DATA = re.compile(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", re.MULTILINE)
_NAME = re.compile(r"__(?P<sensor>[A-Za-z0-9_]+?)__(?P<time>\d{1,18})$")
KEPT = {"invalid_state": (0,), "dyn_prop": range(7), "ambig_state": (3,)}
"""States that the dataset's own code keeps."""


def read_nuscenes_points(path: str | Path, *, only_valid: bool = True) -> PointTable:
    """Return radar points of nuScenes.

    Parameters
    ----------
    path : str or Path
        A ``.pcd`` file, or a folder of them (or with folders of them, as ``sweeps`` has ``RADAR_FRONT`` and others).
    only_valid : bool
        Leave out what the dataset's own code leaves out: states that are not valid, velocities that are not
        unambiguous.

    Returns
    -------
    PointTable
        No elevation, SNR, groups and tracks: boxes are in tables of their own. A file whose first point has a nan is a
        scan without points.

    Raises
    ------
    InputFileError
        If there is no file, or one is damaged or of other fields.
    """
    place = Path(path).absolute()
    files = [place] if place.is_file() else sorted([*place.glob("*.pcd"), *place.glob("*/*.pcd")])
    if not files:
        raise InputFileError("has no .pcd file, nor has a folder in it", place)
    named = [(_sensor_and_time(file), file) for file in files]
    named.sort(key=lambda item: (item[0][1], item[0][0]))
    sensors = sorted({sensor for (sensor, _), _ in named})
    first, parts, left_out = named[0][0][1], [], 0
    for scan, ((sensor, time), file) in enumerate(named):
        points = _points(file)
        kept = np.ones(len(points), dtype=bool)
        if only_valid:
            for name, states in KEPT.items():
                kept &= np.isin(points[name], list(states))
        left_out += int(np.count_nonzero(~kept))
        parts.append(_columns(points[kept], scan, sensors.index(sensor), (time - first) * 1e-6))
    notes = ["no radar of this dataset measures elevation"]
    if left_out:
        notes.append(f"{left_out} points of states that are not valid are left out")
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return table_of("nuscenes", sensors, notes, len(named), columns)


def _columns(points: npt.NDArray[np.void], scan: int, sensor: int, time: float) -> dict[str, npt.NDArray[Any]]:
    x, y = (points[name].astype(np.float64) for name in ("x", "y"))
    distance = np.hypot(x, y)
    away = np.stack([x, y]) / np.maximum(distance, 1e-9)
    return {
        "scan": np.full(len(points), scan),
        "sensor": np.full(len(points), sensor),
        "time": np.full(len(points), time),
        "position": np.stack([x, y, np.zeros(len(x))], axis=1),
        "elevation": np.full(len(points), np.nan),
        "radial_velocity": away[0] * points["vx"] + away[1] * points["vy"],
        "velocity_over_ground": away[0] * points["vx_comp"] + away[1] * points["vy_comp"],
        "rcs_dbsm": np.where(points["rcs"] <= UNKNOWN_RCS_DBSM, np.nan, points["rcs"].astype(np.float64)),
    }


def _sensor_and_time(file: Path) -> tuple[str, int]:
    """Return the name of the sensor and the time [us], by the file's name, or by its folder's and 0."""
    found = _NAME.search(file.stem)
    return (found["sensor"], int(found["time"])) if found else (file.resolve().parent.name, 0)


def _points(path: Path) -> npt.NDArray[np.void]:
    """Return the points of a file as a structured array: none where the first one has a nan, as the dataset says it.

    Raises
    ------
    InputFileError
        If it is damaged, or lacks a field.
    """
    try:
        data = read_bytes(path, LARGEST)
    except InputFileError:
        raise
    except OSError as error:
        raise InputFileError(f"cannot be read ({error.strerror})", path) from error
    end = _DATA.search(data, 0, 10_000)
    if end is None or end[1] != b"binary":
        raise InputFileError("is no point cloud with binary data", path)
    lines = [line.split() for line in data[: end.start()].decode("ascii", "replace").splitlines() if line.strip()]
    head = {words[0]: words[1:] for words in lines if words[0] != "#"}
    try:
        dtype = _dtype(head["FIELDS"], head["SIZE"], head["TYPE"], head["COUNT"])
        count = int(head["WIDTH"][0]) * int(head["HEIGHT"][0])
    except (KeyError, IndexError, ValueError, TypeError) as error:
        raise InputFileError(f"has a damaged head ({error})", path) from error
    missing = [name for name in NEEDED if name not in (dtype.names or ())]
    if missing:
        raise InputFileError(f"has no field {', '.join(missing)}", path, "give a radar's file of nuScenes")
    body = data[end.end() :]
    if not 0 <= count <= LARGEST or len(body) < count * dtype.itemsize:
        raise InputFileError(f"has {len(body)} bytes for {count} points of {dtype.itemsize}", path, "copy it again")
    points = np.frombuffer(body, dtype, count)
    if count and any(np.isnan(points[0][name]) for name in dtype.names or () if dtype[name].kind == "f"):
        return points[:0]
    if not all(np.all(np.isfinite(points[name])) for name in NEEDED[:7]):
        raise InputFileError("has values that are no numbers", path)
    return points


def _dtype(
    names: Sequence[str], sizes: Sequence[str], kinds: Sequence[str], counts: Sequence[str]
) -> np.dtype[np.void]:
    if len({len(names), len(sizes), len(kinds), len(counts)}) != 1 or any(count != "1" for count in counts):
        raise ValueError("fields of one value each are read")
    letters = {"F": "f", "I": "i", "U": "u"}
    if not set(sizes) <= {"1", "2", "4", "8"} or not set(kinds) <= set(letters):
        raise ValueError("a type that is none")
    return np.dtype([(name, f"<{letters[kind]}{size}") for name, kind, size in zip(names, kinds, sizes, strict=True)])
