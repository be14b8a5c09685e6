"""A radar without raw data: its map's grid, what a point looks like in it, noise and threshold."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import DecibelMilliwatts, Decibels, Degrees, Metres, MetresPerSecond

from ..spec import RadarSpec
from .table import PointSpread

Array = npt.NDArray[np.float64]

MOST_CELLS = 100_000_000


class MapAxes(Spec):
    """Cells of a device's map. An axis of one cell is one that the device does not have.

    Raises
    ------
    SpecError
        If an axis does not rise, or there are too many cells.
    """

    range: tuple[Metres, ...] = Field(min_length=1, description="of the cells, rising [m]")
    radial_velocity: tuple[MetresPerSecond, ...] = Field((0.0,), min_length=1, description="opening positive [m/s]")
    azimuth_deg: tuple[Degrees, ...] = Field((0.0,), min_length=1, description="left positive [deg]")

    @model_validator(mode="after")
    def _check(self) -> MapAxes:
        for name in type(self).model_fields:
            if any(b <= a for a, b in pairwise(getattr(self, name))):
                raise ValueError(f"{name} strictly rising")
        if not -90.0 <= self.azimuth_deg[0] <= self.azimuth_deg[-1] <= 90.0:
            raise ValueError("azimuth_deg within -90 to 90 deg")
        if np.prod([float(count) for count in self.shape]) > MOST_CELLS:
            raise ValueError(f"at most {MOST_CELLS} cells: {' x '.join(map(str, self.shape))}")
        return self

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of cells over velocity, range and azimuth, as maps have them."""
        return len(self.radial_velocity), len(self.range), len(self.azimuth_deg)

    @classmethod
    def of_arrays(
        cls, distance: npt.ArrayLike, radial_velocity: npt.ArrayLike = (0.0,), azimuth: npt.ArrayLike = (0.0,)
    ) -> MapAxes:
        """Return the axes of arrays, (num_cells,) each: distances [m], velocities [m/s] and azimuths [rad].

        Raises
        ------
        SpecError
            If an axis does not rise.
        """
        rows = (np.asarray(row, dtype=np.float64).tolist() for row in (distance, radial_velocity, np.degrees(azimuth)))
        return cls(**dict(zip(("range", "radial_velocity", "azimuth_deg"), map(tuple, rows), strict=True)))


class ClosedRadarSpec(Spec):
    """A radar that gives maps or targets, and whose waveform and processing are not known.

    `radar` has what is known, at least about: the carrier, the power and the antennas' pattern (which echoes there
    are, and how strong), the number and the interval of chirps (when the middle of a frame is, how far velocities are
    told). Its antennas stand at the origin. A point's map peaks at the power that one channel of `radar` receives,
    times `gain_db`; effects of the front end (phase noise, leakage, filters, compression) are refused.

    Raises
    ------
    SpecError
        If the point spread and the map have not the same axes, or the spread is wider than velocities are told; if
        `radar` has effects of a front end, or a radome that sends something back: nothing would come of them.
    """

    radar: RadarSpec = Field(RadarSpec(), description="what is known of the radar")
    spread: PointSpread = Field(description="what a point looks like")
    axes: MapAxes = Field(description="cells of the map")
    gain_db: Decibels = Field(0.0, description="map at a point's peak over the power received from it [dB]")
    noise_power_dbm: DecibelMilliwatts | None = Field(
        None, description="mean noise of a cell before `gain_db` [dBm]; None: none"
    )
    num_looks: int = Field(1, ge=1, le=1_000_000, description="independent values that a cell's power is the mean of")
    compensates_motion: bool = Field(
        True, description="whether ranges are those at the frame's start, by the cell's own velocity; else as they beat"
    )
    velocity_period: MetresPerSecond | None = Field(
        None, gt=0.0, description="velocities repeat after so much [m/s]; None: twice radar.unambiguous_velocity"
    )
    range_period: Metres | None = Field(
        None, gt=0.0, description="sidelobes beyond it stand at the other end of the map [m]; None: they do not"
    )
    sine_period: float | None = Field(
        None,
        gt=0.0,
        le=100.0,
        description="directions of an even line of antennas repeat after so much in the sine of azimuth, wavelength "
        "over spacing; None: they do not",
    )
    period_phase_deg: tuple[Degrees, Degrees, Degrees] = Field(
        (0.0, 0.0, 0.0),
        description="what amplitudes turn by over a period of range, of velocity and of the sine of azimuth [deg]",
    )
    full_scale_dbm: DecibelMilliwatts | None = Field(
        None, description="largest value of a cell, before `gain_db`: what is above is cut [dBm]; None: none"
    )
    threshold_db: Decibels = Field(13.0, gt=0.0, description="of a detection over the noise [dB]")

    @model_validator(mode="after")
    def _check(self) -> ClosedRadarSpec:
        if not self.radar.front_end.is_ideal or self.radar.array.has_echo:
            raise ValueError(
                "a radar with power and noise alone: the table says what a point looks like, and nothing else of the "
                "receiver reaches the map; take radar.with_(front_end=radar.front_end.ideal()), radomes with echo=False"
            )
        counts = dict(zip(("velocity", "range", "azimuth"), self.axes.shape, strict=True))
        for axis, count in counts.items():
            if (axis in self.spread.axes) != (count > 1) and axis != "range":
                has = "has" if axis in self.spread.axes else "has not"
                raise ValueError(f"axes of the map that are those of the spread, which {has} an offset over {axis}")
        for axis, period in (
            ("range", self.range_period),
            ("velocity", self.velocity_span),
            ("azimuth", self.sine_period),
        ):
            if axis in self.spread.axes and period is not None:
                reach = np.abs(self.spread.offsets[self.spread.axes.index(axis)]).max()
                if reach > 0.5 * period * (1.0 + 1e-9):
                    raise ValueError(f"a spread that reaches at most half the period of {axis}, {0.5 * period:.4g}")
        if self.sine_period is not None and self.spread.azimuth_scale != "sine":
            raise ValueError('sine_period with a spread of azimuth_scale "sine" only')
        return self

    @property
    def velocity_span(self) -> float:
        """Velocities repeat after so much [m/s]."""
        return self.velocity_period or 2.0 * self.radar.unambiguous_velocity

    @property
    def noise_power(self) -> float:
        """Mean noise of a cell before the gain [W]; 0 if there is none."""
        return 0.0 if self.noise_power_dbm is None else 1e-3 * 10.0 ** (self.noise_power_dbm / 10.0)

    @property
    def gain(self) -> float:
        """The gain as a factor of the power."""
        return float(10.0 ** (self.gain_db / 10.0))
