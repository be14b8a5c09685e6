"""Radar points of any source: one row a point, nan where the source does not tell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.prompt.describe import Described, Row, array_text, listed

Array = npt.NDArray[np.float64]
NO_OBJECT = -1


@dataclass(frozen=True, eq=False, repr=False)
class PointTable(
    Described,
    units={
        "time": "s",
        "position": "m",
        "range": "m",
        "azimuth": "rad",
        "elevation": "rad",
        "radial_velocity": "m/s",
        "velocity_over_ground": "m/s",
        "rcs_dbsm": "dBsm",
        "snr_db": "dB",
    },
):
    """Radar points; every array has one row a point. What a source does not tell is nan, and in `lacks`.

    Attributes
    ----------
    source : str
        Where the points are from.
    sensors : tuple of str
        Names of the radars.
    notes : tuple of str
        What was taken for granted, or left out.
    scan : ndarray of int64, shape (num_points,)
        Number of the scan, from 0: a measurement of one radar.
    num_scans : int
        Scans, those without points too.
    sensor : ndarray of int64, shape (num_points,)
        Index into `sensors`.
    time : ndarray of float64, shape (num_points,)
        Since the first scan [s].
    position : ndarray of float64, shape (num_points, 3)
        In the radar's frame, x ahead, y left, z up [m]; z is 0 where no elevation is measured.
    range, azimuth, elevation : ndarray of float64, shape (num_points,)
        [m], [rad] to the left, [rad] upwards.
    radial_velocity : ndarray of float64, shape (num_points,)
        Relative to the radar, positive when opening [m/s].
    velocity_over_ground : ndarray of float64, shape (num_points,)
        The same with the radar's own motion taken out [m/s].
    rcs_dbsm, snr_db : ndarray of float64, shape (num_points,)
        [dBsm], nan where it is not known; [dB].
    group : ndarray of int64, shape (num_points,)
        Group of the road user that a point belongs to, an index into ``GROUP_NAMES``; -1: none, or not told.
    track : ndarray of int64, shape (num_points,)
        Number of the object that a point belongs to, the same in all scans; -1: none, or not told.
    velocity_interval : ndarray of float64, shape (num_sensors,)
        Greatest interval that the radial velocities of all points of a radar are known modulo [m/s]; nan: not folded,
        or not told.
    """

    source: str
    sensors: tuple[str, ...]
    notes: tuple[str, ...]
    num_scans: int
    scan: npt.NDArray[np.int64]
    sensor: npt.NDArray[np.int64]
    time: Array
    position: Array
    range: Array
    azimuth: Array
    elevation: Array
    radial_velocity: Array
    velocity_over_ground: Array
    rcs_dbsm: Array
    snr_db: Array
    group: npt.NDArray[np.int64]
    track: npt.NDArray[np.int64]
    velocity_interval: Array

    def _facts(self) -> Iterable[Row]:
        yield "source", self.source
        yield "sensors", listed(self.sensors)
        yield "num_points", f"{self.num_points} in {self.num_scans} scans"
        yield "lacks", listed(self.lacks)
        for name in COLUMNS:
            if name not in self.lacks:
                yield name, array_text(getattr(self, name), self._units.get(name, ""))
        yield from (("note", note) for note in self.notes)

    @property
    def num_points(self) -> int:
        """Number of points."""
        return len(self.range)

    @property
    def lacks(self) -> tuple[str, ...]:
        """Columns of which the source tells nothing: nan, or -1, in every row."""
        found = []
        for name in COLUMNS:
            values = getattr(self, name)
            nothing = np.isnan(values) if values.dtype.kind == "f" else values == NO_OBJECT
            if nothing.all():
                found.append(name)
        return tuple(found)

    def select(self, rows: npt.NDArray[Any]) -> PointTable:
        """Return some of the points, by a mask or by numbers of rows."""
        return replace(self, **{name: getattr(self, name)[rows] for name in COLUMNS})


COLUMNS = tuple(
    entry.name
    for entry in fields(PointTable)
    if entry.name not in ("source", "sensors", "notes", "num_scans", "velocity_interval")
)
"""Names of the columns."""


def table_of(
    source: str,
    sensors: Sequence[str],
    notes: Sequence[str],
    num_scans: int,
    columns: dict[str, npt.NDArray[Any]],
    velocity_interval: Sequence[float] | None = None,
) -> PointTable:
    """Return a table of some columns; the others are nan or -1.

    Of `position` and `range`, `azimuth`, `elevation` either may be left out, and follows from the other.

    Raises
    ------
    ParameterRangeError
        If neither is given.
    """
    known = dict(columns)
    if "position" in known:
        x, y, z = np.asarray(known["position"], dtype=np.float64).T
        known.setdefault("range", np.sqrt(x**2 + y**2 + z**2))
        known.setdefault("azimuth", np.arctan2(y, x))
        known.setdefault("elevation", np.arctan2(z, np.hypot(x, y)))
    elif {"range", "azimuth"} <= set(known):
        level = np.nan_to_num(known.get("elevation", np.zeros(len(known["range"]))))
        unit = [np.cos(level) * np.cos(known["azimuth"]), np.cos(level) * np.sin(known["azimuth"]), np.sin(level)]
        known["position"] = np.stack(unit, axis=1) * known["range"][:, None]
    else:
        raise ParameterRangeError("columns", listed(known), "position, or range and azimuth")
    count = len(known["position"])
    whole = {"scan", "sensor", "group", "track"}
    filled: dict[str, Any] = {
        name: np.asarray(known[name], dtype=np.int64 if name in whole else np.float64)
        if name in known
        else np.full(count, NO_OBJECT, np.int64)
        if name in whole
        else np.full(count, np.nan)
        for name in COLUMNS
    }
    interval = np.full(len(sensors), np.nan) if velocity_interval is None else np.array(velocity_interval, np.float64)
    return PointTable(source, tuple(sensors), tuple(notes), num_scans, **filled, velocity_interval=interval)
