"""Points: the table of detections of one frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.prompt.describe import Described, Row, field_rows

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from scarl_sionna.core.specs.radar.spec import RadarSpec

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class RadarPoints(
    Described,
    units={
        "position": "m",
        "range": "m",
        "azimuth": "rad",
        "elevation": "rad",
        "radial_velocity": "m/s",
        "power": "W",
        "snr_db": "dB",
        "rcs": "m2",
        "velocity_interval": "m/s",
    },
):
    """Detections of one frame, strongest first; every array has one row a point.

    Attributes
    ----------
    position : ndarray of float64, shape (num_points, 3)
        In the radar frame at the start of the first ramp [m].
    range, azimuth, elevation : ndarray of float64, shape (num_points,)
        [m], [rad], [rad]; elevation is 0 where the array has no vertical extent.
    radial_velocity : ndarray of float64, shape (num_points,)
        Positive when opening, modulo `velocity_interval` [m/s].
    power : ndarray of float64, shape (num_points,)
        Received by one channel [W].
    snr_db : ndarray of float64, shape (num_points,)
        Power of the cell after beamforming over its thermal noise, both behind the receiver's filters [dB].
    rcs : ndarray of float64, shape (num_points,)
        From the radar equation with the antennas' gains and what the receiver's filters leave at that beat frequency
        [m2]; NaN where they leave next to nothing, the direction is none, or the range is 0, so that it is not known.
    cell : ndarray of int64, shape (num_points,), or None
        Number of the map's cell that a point was found in, counted along range, then Doppler; several directions of a
        cell have the same one. None for points that are of no map.
    velocity_interval : ndarray of float64, shape (num_points,), or None
        Interval that the radial velocity is known modulo [m/s]: that of the map, or the wider one of time division and
        of staggered chirps where the point tells which it is. None where it is not known, as of closed radars.
    """

    position: Array
    range: Array
    azimuth: Array
    elevation: Array
    radial_velocity: Array
    power: Array
    snr_db: Array
    rcs: Array
    cell: npt.NDArray[np.int64] | None = None
    velocity_interval: Array | None = None

    def _facts(self) -> Iterable[Row]:
        yield "num_points", f"{self.num_points}, strongest first"
        yield from field_rows(self)

    @property
    def num_points(self) -> int:
        """Number of detections."""
        return int(self.range.shape[0])

    def strongest(self, count: int | None) -> RadarPoints:
        """Return the strongest points only, as a device sends whose list is that long; None: all."""
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        kept: dict[str, Any] = {name: column[:count] for name, column in columns.items() if column is not None}
        return RadarPoints(**kept)

    def known_modulo(self, radar: RadarSpec) -> Array:
        """Return the interval that each radial velocity is known modulo, shape (num_points,) [m/s].

        It is `velocity_interval`, or that of the radar's map for points of none; the velocities of several points are
        known modulo the smallest of theirs.
        """
        map_wide = np.full(self.num_points, 2.0 * radar.unambiguous_velocity)
        return map_wide if self.velocity_interval is None else self.velocity_interval

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the detections from above, in the radar frame, coloured by radial velocity; larger: higher SNR.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        from ..plots import plot_points

        return plot_points(self, ax)
