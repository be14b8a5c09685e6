"""Where and when a lidar shoots: raster, spinning beams, Risley prisms, or any table."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Hertz, Seconds
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text
from scarl_sionna.core.untrusted.numpy_file import read_npz

Array = npt.NDArray[np.float64]

FULL_TURN_DEG = 360.0
MAX_SHOTS = 4_000_000
"""Most shots of a scan, so that a slip in a count is an error and not a full memory."""


def _evenly(first: float, last: float, number: int) -> Array:
    """Return `number` values from first to last, both included; the middle for one value."""
    return np.linspace(first, last, number) if number > 1 else np.array([(first + last) / 2.0])


def _check_count(number: int) -> None:
    if number > MAX_SHOTS:
        raise ValueError(f"at most {MAX_SHOTS} shots a scan, not {number}")


class RasterScan(Spec):
    """Straight lines over a field of view, as a MEMS or galvanometer mirror draws them.

    Shot number = elevation line * num_azimuth + azimuth column; line 0 is the lowest, column 0 the first azimuth. Both
    ends of a field of view are shot at, but for a full turn, whose end is its start; a single column or line looks
    along the middle. `scan_time` 0 is a flash of all shots, as in SCaRL; otherwise the shots follow each other evenly,
    line after line.
    """

    kind: Literal["raster"] = "raster"
    azimuth_fov_deg: tuple[Degrees, Degrees] = Field((-60.0, 60.0), description="first and last azimuth [deg]")
    elevation_fov_deg: tuple[Degrees, Degrees] = Field((-20.0, 10.0), description="lowest and highest elevation [deg]")
    num_azimuth: int = Field(600, ge=1, description="shots a line")
    num_elevation: int = Field(64, ge=1, description="lines")
    scan_time: Seconds = Field(0.0, ge=0.0, le=10.0, description="duration of a scan [s]; 0: all shots at one instant")
    lines_at_once: int = Field(1, ge=1, description="neighbouring lines that are shot in parallel")
    serpentine: bool = Field(False, description="every second pass runs back")

    @model_validator(mode="after")
    def _check(self) -> RasterScan:
        first, last = self.azimuth_fov_deg
        low, high = self.elevation_fov_deg
        azimuth, elevation = f"({first:g}, {last:g}) deg", f"({low:g}, {high:g}) deg"
        if abs(last - first) > FULL_TURN_DEG:
            raise ValueError(f"azimuth_fov_deg of at most a full turn, not {azimuth}")
        if first == last and self.num_azimuth > 1:
            raise ValueError(f"azimuth_fov_deg with two different ends, or num_azimuth = 1; {azimuth} is empty")
        if not -90.0 <= low <= high <= 90.0:
            raise ValueError(f"elevation_fov_deg = (lowest, highest) within -90 to 90 deg, not {elevation}")
        if low == high and self.num_elevation > 1:
            raise ValueError(f"elevation_fov_deg with two different ends, or num_elevation = 1; {elevation} is empty")
        if self.num_elevation % self.lines_at_once:
            raise ValueError(
                f"lines_at_once that divides num_elevation = {self.num_elevation}, not {self.lines_at_once}"
            )
        _check_count(self.num_azimuth * self.num_elevation)
        return self

    @property
    def num_shots(self) -> int:
        """Number of shots of a scan."""
        return self.num_azimuth * self.num_elevation

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Rows and columns of the range view."""
        return self.num_elevation, self.num_azimuth

    @property
    def column_azimuth(self) -> Array:
        """Azimuth of every column [rad], shape (num_azimuth,)."""
        first, last = self.azimuth_fov_deg
        if abs(last - first) >= FULL_TURN_DEG:
            return np.radians(first + (last - first) * np.arange(self.num_azimuth) / self.num_azimuth)
        return np.radians(_evenly(first, last, self.num_azimuth))

    @property
    def line_elevation(self) -> Array:
        """Elevation of every line [rad], shape (num_elevation,)."""
        return np.radians(_evenly(*self.elevation_fov_deg, self.num_elevation))

    def angles(self) -> tuple[Array, Array]:
        """Return azimuth and elevation of every shot [rad], each of shape (num_shots,)."""
        return np.tile(self.column_azimuth, self.num_elevation), np.repeat(self.line_elevation, self.num_azimuth)

    def times(self) -> Array:
        """Return the time of every shot after the start of the scan [s], shape (num_shots,)."""
        line, column = np.divmod(np.arange(self.num_shots), self.num_azimuth)
        sweep = line // self.lines_at_once
        if self.serpentine:
            column = np.where(sweep % 2, self.num_azimuth - 1 - column, column)
        slots = self.num_shots // self.lines_at_once
        return (sweep * self.num_azimuth + column) * (self.scan_time / slots)

    def cells(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return row and column of every shot in the upright range view, shape (num_shots,) each."""
        line, column = np.divmod(np.arange(self.num_shots), self.num_azimuth)
        azimuth = self.column_azimuth
        if azimuth[-1] > azimuth[0]:
            column = self.num_azimuth - 1 - column
        return self.num_elevation - 1 - line, column


class SpinningScan(Spec):
    """Beams in a vertical fan that turns about z: an elevation table, firing times, a rate.

    Shot number = column * number of beams + beam. Beam b of column c fires at
    ``c / (rate * num_azimuth) + firing_time[b]``, and the fan keeps turning between the beams.
    """

    kind: Literal["spinning"] = "spinning"
    elevation_deg: tuple[Degrees, ...] = Field(min_length=1, max_length=1024, description="of every beam [deg]")
    azimuth_offset_deg: tuple[Degrees, ...] | None = Field(None, description="of every beam to the fan [deg]; None: 0")
    firing_time: tuple[Seconds, ...] | None = Field(
        None, description="of every beam after its column's start [s]; None: evenly over the column"
    )
    num_azimuth: int = Field(1800, ge=1, description="columns a turn")
    rotation_rate: Hertz = Field(10.0, gt=0.0, description="turns a second [Hz]")
    start_azimuth_deg: Degrees = Field(180.0, ge=-360.0, le=360.0, description="of the first column [deg]")
    clockwise: bool = Field(True, description="turns to the right, seen from above")

    @model_validator(mode="after")
    def _check(self) -> SpinningScan:
        beams = len(self.elevation_deg)
        if any(not -90.0 <= value <= 90.0 for value in self.elevation_deg):
            raise ValueError("elevation_deg within -90 to 90 deg")
        for name in ("azimuth_offset_deg", "firing_time"):
            table = getattr(self, name)
            if table is not None and len(table) != beams:
                raise ValueError(f"{name} with one value a beam ({beams}), not {len(table)}")
        column = 1.0 / (self.rotation_rate * self.num_azimuth)
        if self.firing_time is not None and not all(0.0 <= value <= column for value in self.firing_time):
            raise ValueError(f"firing_time within a column's time, 0 to {column:.3g} s")
        _check_count(beams * self.num_azimuth)
        return self

    @property
    def num_shots(self) -> int:
        """Number of shots of a scan."""
        return self.num_azimuth * len(self.elevation_deg)

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Rows and columns of the range view."""
        return len(self.elevation_deg), self.num_azimuth

    @property
    def scan_time(self) -> float:
        """Duration of a turn [s]."""
        return 1.0 / self.rotation_rate

    def times(self) -> Array:
        """Return the time of every shot after the start of the scan [s], shape (num_shots,)."""
        beams, column_time = len(self.elevation_deg), self.scan_time / self.num_azimuth
        within = np.arange(beams) / beams * column_time if self.firing_time is None else np.array(self.firing_time)
        return (np.arange(self.num_azimuth)[:, None] * column_time + within).reshape(-1)

    def angles(self) -> tuple[Array, Array]:
        """Return azimuth and elevation of every shot [rad], each of shape (num_shots,)."""
        sense = -1.0 if self.clockwise else 1.0
        turned = np.radians(self.start_azimuth_deg) + sense * 2.0 * np.pi * self.rotation_rate * self.times()
        offset = np.zeros(len(self.elevation_deg)) if self.azimuth_offset_deg is None else self.azimuth_offset_deg
        azimuth = turned + np.tile(np.radians(offset), self.num_azimuth)
        return azimuth, np.tile(np.radians(self.elevation_deg), self.num_azimuth)

    def cells(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return row and column of every shot in the upright range view (highest beam first, left azimuth first)."""
        column, beam = np.divmod(np.arange(self.num_shots), len(self.elevation_deg))
        rank = np.empty(len(self.elevation_deg), dtype=np.int64)
        rank[np.argsort(-np.array(self.elevation_deg), kind="stable")] = np.arange(len(rank))
        return rank[beam], column if self.clockwise else self.num_azimuth - 1 - column


class RisleyScan(Spec):
    """Two thin turning prisms: a rosette over a round field of view.

    In the approximation of thin prisms the deflections add as vectors of `wedge_angles_deg` that turn at
    `rotation_rates` (Marshall, "Risley prism scan patterns", Proc. SPIE 3787, 1999).
    """

    kind: Literal["risley"] = "risley"
    wedge_angles_deg: tuple[Degrees, Degrees] = Field((12.0, 12.0), description="deflection of each prism [deg]")
    rotation_rates: tuple[Hertz, Hertz] = Field((121.3, -73.7), description="turns of each prism a second [Hz]")
    num_shots: int = Field(40_000, ge=1, le=MAX_SHOTS, description="shots of a scan")
    scan_time: Seconds = Field(0.1, gt=0.0, le=10.0, description="duration of a scan [s]")

    @model_validator(mode="after")
    def _check(self) -> RisleyScan:
        if min(self.wedge_angles_deg) < 0.0 or not 0.0 < sum(self.wedge_angles_deg) < 90.0:
            raise ValueError("wedge_angles_deg >= 0 with a sum above 0 and below 90 deg")
        return self

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Rows and columns of the range view; a rosette has no grid of its own: about one shot a cell."""
        side = max(round(np.sqrt(self.num_shots)), 1)
        return side, side

    def times(self) -> Array:
        """Return the time of every shot after the start of the scan [s], shape (num_shots,)."""
        return np.arange(self.num_shots, dtype=np.float64) * float(self.scan_time / self.num_shots)

    def angles(self) -> tuple[Array, Array]:
        """Return azimuth and elevation of every shot [rad], each of shape (num_shots,)."""
        turned = 2.0 * np.pi * np.multiply.outer(self.times(), self.rotation_rates)
        deflection = np.radians(self.wedge_angles_deg)
        return np.cos(turned) @ deflection, np.sin(turned) @ deflection

    def cells(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return row and column of every shot in an upright view of the field of view, shape (num_shots,) each."""
        return _binned(*self.angles(), self.grid_shape)


class TableScan(Spec):
    """Any directions at any times. :meth:`read` takes them from a .csv or .npz file."""

    kind: Literal["table"] = "table"
    azimuth_deg: tuple[Degrees, ...] = Field(
        min_length=1, max_length=MAX_SHOTS, description="of every shot, left positive [deg]"
    )
    elevation_deg: tuple[Degrees, ...] = Field(min_length=1, description="of every shot, up positive [deg]")
    time: tuple[Seconds, ...] | None = Field(None, description="of every shot after the scan's start [s]; None: all 0")

    @model_validator(mode="after")
    def _check(self) -> TableScan:
        number = len(self.azimuth_deg)
        if len(self.elevation_deg) != number or (self.time is not None and len(self.time) != number):
            raise ValueError("azimuth_deg, elevation_deg and time of the same length")
        if any(not -90.0 <= value <= 90.0 for value in self.elevation_deg):
            raise ValueError("elevation_deg within -90 to 90 deg")
        if self.time is not None and not 0.0 <= min(self.time) <= max(self.time) <= 10.0:
            raise ValueError("time within 0 to 10 s")
        return self

    @classmethod
    def read(cls, path: str | Path) -> TableScan:
        """Return the table of a file; the specification then holds the numbers, not the file's name.

        Parameters
        ----------
        path : path
            A .csv with a head line or a .npz, with columns ``azimuth_deg, elevation_deg`` [deg] or ``x, y, z`` (sensor
            frame, of any length), and ``time`` [s] if the shots are not at one instant.

        Raises
        ------
        ParameterRangeError
            If the file cannot be read or lacks a column.
        """
        try:
            columns = _read_columns(Path(path))
            if {"azimuth_deg", "elevation_deg"} <= columns.keys():
                azimuth, elevation = columns["azimuth_deg"], columns["elevation_deg"]
            else:
                x, y, z = columns["x"], columns["y"], columns["z"]
                azimuth, elevation = np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(z, np.hypot(x, y)))
            time = columns.get("time")
        except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
            what = "a .csv or .npz with columns azimuth_deg, elevation_deg (or x, y, z) and time"
            raise ParameterRangeError("scan table", path, what, str(error)) from error
        return cls(
            azimuth_deg=tuple(azimuth.tolist()),
            elevation_deg=tuple(elevation.tolist()),
            time=None if time is None else tuple(time.tolist()),
        )

    @property
    def num_shots(self) -> int:
        """Number of shots of a scan."""
        return len(self.azimuth_deg)

    @property
    def grid_shape(self) -> tuple[int, int]:
        """Rows and columns of the range view: about one shot a cell over the table's field of view."""
        azimuth, elevation = self.angles()
        width, height = np.ptp(azimuth), np.ptp(elevation)
        if width == 0.0 or height == 0.0:
            return (1, self.num_shots) if height == 0.0 else (self.num_shots, 1)
        rows = int(np.clip(round(np.sqrt(self.num_shots * height / width)), 1, self.num_shots))
        return rows, max(self.num_shots // rows, 1)

    @property
    def scan_time(self) -> float:
        """Time of the last shot [s]."""
        return 0.0 if self.time is None else max(self.time)

    def times(self) -> Array:
        """Return the time of every shot after the start of the scan [s], shape (num_shots,)."""
        return np.zeros(self.num_shots) if self.time is None else np.array(self.time)

    def angles(self) -> tuple[Array, Array]:
        """Return azimuth and elevation of every shot [rad], each of shape (num_shots,)."""
        return np.radians(self.azimuth_deg), np.radians(self.elevation_deg)

    def cells(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return row and column of every shot in an upright view of the field of view, shape (num_shots,) each."""
        return _binned(*self.angles(), self.grid_shape)


ScanPattern = Annotated[RasterScan | SpinningScan | RisleyScan | TableScan, Field(discriminator="kind")]


def _binned(
    azimuth: Array, elevation: Array, shape: tuple[int, int]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return row (top first) and column (left first) of directions in an even grid over their field of view."""

    def bins(values: Array, number: int) -> npt.NDArray[np.int64]:
        width = np.ptp(values) or 1.0
        place = np.minimum(((values - values.min()) / width * number).astype(np.int64), number - 1)
        return number - 1 - place

    return bins(elevation, shape[0]), bins(azimuth, shape[1])


_MOST_BYTES = 256 * MEGABYTE


def _read_columns(path: Path) -> dict[str, Array]:
    if path.suffix == ".npz":
        return {name: np.asarray(values, dtype=np.float64) for name, values in read_npz(path, _MOST_BYTES).items()}
    if path.suffix != ".csv":
        raise ValueError(f"the ending '{path.suffix}' is neither .csv nor .npz")
    text = io.StringIO(read_text(path, _MOST_BYTES))
    table: Any = np.atleast_1d(np.genfromtxt(text, delimiter=",", names=True, dtype=np.float64))
    return {name: np.asarray(table[name]) for name in table.dtype.names or ()}
