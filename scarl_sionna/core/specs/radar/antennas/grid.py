"""A measured pattern: gain, and phase where it was measured, over azimuth and elevation."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelsIsotropic, Degrees
from scarl_sionna.core.untrusted.csv_text import columns_of
from scarl_sionna.core.untrusted.files import MEGABYTE, read_text

if TYPE_CHECKING:
    from scipy.interpolate import RectBivariateSpline

Array = npt.NDArray[np.float64]
Row = tuple[DecibelsIsotropic, ...]
PhaseRow = tuple[Degrees, ...]

MOST_VALUES = 1_000_000
"""Entries of a table: 0.25 deg over the whole sphere."""
MOST_BYTES = 64 * MEGABYTE
RADIATED_SLACK = 1.1
"""A table may radiate so much of its power: measured gains are known to some 0.4 dB."""
_COLUMNS = ("azimuth_deg", "elevation_deg", "gain_dbi")
_GUARD = 4
"""Columns repeated beyond the ends of a table that goes all the way round."""


class GridPattern(Spec):
    """A measured table over azimuth x elevation; :meth:`read` takes it from a .csv file.

    Between the entries gains are interpolated in dB, linear or by cubic splines; of phases their phasors are, so that
    no turns have to be unwrapped. Outside of the table its last values hold, or `outside_dbi` does. A table whose
    azimuths go all the way round is closed.

    Raises
    ------
    ParameterRangeError
        If angles do not rise or rows differ in length, or if the antenna would radiate more than its power.
    """

    kind: Literal["grid"] = "grid"
    azimuth_deg: tuple[Degrees, ...] = Field(min_length=2, description="rising, left positive [deg]")
    elevation_deg: tuple[Degrees, ...] = Field(min_length=2, description="rising, up positive [deg]")
    gain_dbi: tuple[Row, ...] = Field(min_length=2, description="(num_azimuth, num_elevation), co-polar [dBi]")
    phase_deg: tuple[PhaseRow, ...] = Field(
        (), description="(num_azimuth, num_elevation), of the far field about the antenna's place [deg]; empty: 0"
    )
    interpolation: Literal["linear", "cubic"] = Field("linear", description="between the entries, of dB and phasors")
    outside_dbi: DecibelsIsotropic | None = Field(
        None, description="gain outside of the table [dBi]; None: that of its edge"
    )

    @model_validator(mode="after")
    def _check(self) -> GridPattern:
        for name, most in (("azimuth_deg", 360.0), ("elevation_deg", 180.0)):
            angles = getattr(self, name)
            if any(b <= a for a, b in pairwise(angles)):
                raise ValueError(f"{name} strictly rising")
            if angles[-1] - angles[0] > most + 1e-9:
                raise ValueError(f"{name} that spans at most {most:g} deg: {angles[0]:g} to {angles[-1]:g} deg")
        if self.elevation_deg[0] < -90.0 - 1e-9 or self.elevation_deg[-1] > 90.0 + 1e-9:
            raise ValueError("elevation_deg within -90 to 90 deg (not angles from the zenith)")
        shape = len(self.azimuth_deg), len(self.elevation_deg)
        for name in ("gain_dbi", "phase_deg"):
            rows = getattr(self, name)
            if name == "phase_deg" and not rows:
                continue
            wrong = [row for row in rows if len(row) != shape[1]]
            if len(rows) != shape[0] or wrong:
                raise ValueError(f"{name} of {shape[0]} rows (azimuth) of {shape[1]} values (elevation)")
        if shape[0] * shape[1] > MOST_VALUES:
            raise ValueError(f"at most {MOST_VALUES} entries: {shape[0]} x {shape[1]}")
        if self.radiated_share > RADIATED_SLACK:
            too_much = 10.0 * np.log10(self.radiated_share)
            raise ValueError(
                f"gains lower by {too_much:.1f} dB: within the table the antenna would radiate "
                f"{100.0 * self.radiated_share:.0f} % of its power. Is it in dBi, and not normalised to another level?"
            )
        return self

    @classmethod
    def read(cls, path: str | Path, interpolation: Literal["linear", "cubic"] = "linear") -> GridPattern:
        """Return the table of a .csv file; the specification then holds the numbers, not the file's name.

        Parameters
        ----------
        path : path
            A head line with ``azimuth_deg, elevation_deg, gain_dbi`` and, where it was measured, ``phase_deg``; then a
            line for every pair of an azimuth and an elevation, in any order.
        interpolation : {"linear", "cubic"}

        Raises
        ------
        ParameterRangeError
            If the file cannot be read, lacks a column, holds what is no number (the error names the line), or a pair
            of angles is missing or there twice.
        """
        try:
            columns = columns_of(read_text(path, MOST_BYTES, "utf-8-sig"), _COLUMNS)
            return cls(**_gridded(columns), interpolation=interpolation)
        except ParameterRangeError:
            raise
        except (OSError, ValueError) as error:
            what = "a .csv with columns azimuth_deg, elevation_deg, gain_dbi and, if measured, phase_deg"
            raise ParameterRangeError("pattern table", path, what, str(error)) from error

    @property
    def has_phase(self) -> bool:
        """Whether phases were measured."""
        return bool(self.phase_deg)

    @property
    def closed(self) -> bool:
        """Whether the azimuths go all the way round."""
        angles = self.azimuth_deg
        return angles[-1] - angles[0] + 1.01 * (angles[1] - angles[0]) >= 360.0

    @cached_property
    def radiated_share(self) -> float:
        """Part of the antenna's power that it radiates towards the directions of the table, by the trapezoidal rule."""
        gain = 10.0 ** (np.array(self.gain_dbi) / 10.0)
        elevation = np.radians(self.elevation_deg)
        rows = np.trapezoid(gain * np.cos(elevation), elevation, axis=1)
        return float(np.trapezoid(rows, np.radians(self.azimuth_deg)) / (4.0 * np.pi))

    def gain_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the gain [dBi] at azimuth (left positive) and elevation [rad], broadcast."""
        where, inside = self._places(azimuth, elevation)
        gain = np.asarray(self._gain.ev(*where), dtype=np.float64)
        return gain if self.outside_dbi is None else np.where(inside, gain, self.outside_dbi)

    def slopes_db(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the derivatives of the gain to azimuth and elevation [dB/rad]; none where the edge's values hold."""
        where, _ = self._places(azimuth, elevation)
        moves = [
            np.broadcast_to(_moves(angle, angles, closed), where[0].shape)
            for angle, angles, closed in (
                (azimuth, self.azimuth_deg, self.closed),
                (elevation, self.elevation_deg, False),
            )
        ]
        kept = moves[0] & moves[1] if self.outside_dbi is not None else None
        return tuple(  # type: ignore[return-value]
            np.where(own if kept is None else kept, slope * np.degrees(1.0), 0.0)
            for own, slope in zip(moves, self._slopes(*where), strict=True)
        )

    def _slopes(self, across: Array, up: Array) -> tuple[Array, Array]:
        """Return the derivatives at places in the table [dB/deg]; at an entry of a linear table those above it."""
        if self.interpolation == "cubic":
            return tuple(self._gain.ev(across, up, dx=1 - k, dy=k) for k in (0, 1))  # type: ignore[return-value]
        azimuth, elevation, values = self._closed(np.array(self.gain_dbi))
        i = np.clip(np.searchsorted(azimuth, across, side="right") - 1, 0, len(azimuth) - 2)
        k = np.clip(np.searchsorted(elevation, up, side="right") - 1, 0, len(elevation) - 2)
        wide, high = azimuth[i + 1] - azimuth[i], elevation[k + 1] - elevation[k]
        right, above = (across - azimuth[i]) / wide, (up - elevation[k]) / high
        corner, aside, over, opposite = values[i, k], values[i + 1, k], values[i, k + 1], values[i + 1, k + 1]
        to_side = (1.0 - above) * (aside - corner) + above * (opposite - over)
        upwards = (1.0 - right) * (over - corner) + right * (opposite - aside)
        return to_side / wide, upwards / high

    def phase(self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike) -> Array:
        """Return the phase of the far field [rad] at azimuth and elevation [rad], broadcast; 0 if not measured."""
        where, _ = self._places(azimuth, elevation)
        if not self.has_phase:
            return np.zeros(where[0].shape)
        real, imaginary = (part.ev(*where) for part in self._phasor)
        return np.arctan2(imaginary, real)

    def _places(
        self, azimuth: npt.ArrayLike, elevation: npt.ArrayLike
    ) -> tuple[tuple[Array, Array], npt.NDArray[np.bool_]]:
        """Return the places of directions in the table [deg], moved to its edge, and which were inside."""
        across, up = np.broadcast_arrays(np.degrees(azimuth), np.degrees(elevation))
        low, high = self.azimuth_deg[0], self.azimuth_deg[-1]
        middle = low + 180.0 if self.closed else 0.5 * (low + high)
        across = across - 360.0 * np.floor((across - middle + 180.0) / 360.0)  # the turn nearest to the table
        place = across if self.closed else np.clip(across, low, high)
        raised = np.clip(up, self.elevation_deg[0], self.elevation_deg[-1])
        inside = (np.abs(place - across) < 1e-9) & (np.abs(raised - up) < 1e-9)
        return (place, raised), inside

    @cached_property
    def _gain(self) -> RectBivariateSpline:
        return self._spline(np.array(self.gain_dbi))

    @cached_property
    def _phasor(self) -> tuple[RectBivariateSpline, RectBivariateSpline]:
        phase = np.radians(self.phase_deg)
        return self._spline(np.cos(phase)), self._spline(np.sin(phase))

    def _spline(self, values: Array) -> RectBivariateSpline:
        from scipy.interpolate import RectBivariateSpline

        azimuth, elevation, values = self._closed(values)
        degree = 1 if self.interpolation == "linear" else 3
        kinds = (min(degree, len(axis) - 1) for axis in (azimuth, elevation))
        return RectBivariateSpline(azimuth, elevation, values, **dict(zip(("kx", "ky"), kinds, strict=True)), s=0)

    def _closed(self, values: Array) -> tuple[Array, Array, Array]:
        """Return the angles of a table [deg] and its values, some columns repeated if it goes all the way round."""
        azimuth, elevation = np.array(self.azimuth_deg), np.array(self.elevation_deg)
        if not self.closed:
            return azimuth, elevation, values
        count = len(azimuth) - int(azimuth[-1] - azimuth[0] > 360.0 - 1e-6)  # the last is the first again
        guard = min(_GUARD, count)
        order = np.arange(-guard, count + guard + 1)
        return azimuth[order % count] + 360.0 * (order // count), elevation, values[order % count]


def _moves(angle: npt.ArrayLike, angles_deg: tuple[float, ...], closed: bool) -> npt.NDArray[np.bool_]:
    """Return where a table's value follows the angle: within its ends, or everywhere if it is closed."""
    degrees = np.degrees(angle)
    if closed:
        return np.ones(np.shape(degrees), dtype=np.bool_)
    middle = 0.5 * (angles_deg[0] + angles_deg[-1])
    turned = degrees - 360.0 * np.floor((degrees - middle + 180.0) / 360.0)
    return np.asarray((turned >= angles_deg[0]) & (turned <= angles_deg[-1]))


def _gridded(columns: dict[str, Array]) -> dict[str, object]:
    """Return the fields of a table whose lines stand in any order."""
    azimuth, row = np.unique(columns["azimuth_deg"], return_inverse=True)
    elevation, column = np.unique(columns["elevation_deg"], return_inverse=True)
    times = np.zeros((len(azimuth), len(elevation)), dtype=np.int64)
    np.add.at(times, (row, column), 1)
    if (times != 1).any():
        i, k = (int(index[0]) for index in np.nonzero(times != 1))
        what = "is missing" if times[i, k] == 0 else f"is there {times[i, k]} times"
        raise ValueError(f"azimuth {azimuth[i]:g} deg, elevation {elevation[k]:g} deg {what}; the table is a full grid")
    out: dict[str, object] = {"azimuth_deg": tuple(azimuth.tolist()), "elevation_deg": tuple(elevation.tolist())}
    for name in ("gain_dbi", "phase_deg"):
        if name in columns:
            values = np.empty(times.shape)
            values[row, column] = columns[name]
            out[name] = tuple(map(tuple, values.tolist()))
    return out
