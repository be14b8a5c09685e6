"""The turn of a scanning radar: what the sensor kind ``scanning_radar`` gives."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.describe import Described, Row, field_rows, listed
from scarl_sionna.core.specs.radar.scanning.spec import ScanningRadarSpec

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class RadarScan(Described, units={"azimuth": "rad", "time": "s", "floor_dbm": "dBm", "power": "W"}):
    """One turn of a scanning radar: power over azimuth and range, each azimuth at a time of its own.

    Attributes
    ----------
    spec : ScanningRadarSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up; it does not turn with the antenna) at the start of the turn.
    azimuth : ndarray of float64, shape (num_azimuths,)
        Where the antenna points in the sensor frame in the middle of each ramp's samples [rad]; left positive, not
        wrapped: it falls or rises by a turn.
    time : ndarray of float64, shape (num_azimuths,)
        Of that instant after the frame's timestamp [s].
    azimuth_pose : ndarray of float64, shape (num_azimuths, 7)
        Sensor frame at that instant in the world: position x, y, z [m] and quaternion w, x, y, z.
    azimuth_twist : ndarray of float64, shape (num_azimuths, 6)
        Its linear [m/s] and angular [rad/s] velocity, world axes.
    image : ndarray of uint8, shape (num_azimuths, num_cells)
        Code k stands for ``floor_dbm + k * spec.image_step_db``; ranges are ``spec.range``, not corrected for Doppler.
    floor_dbm : float
        Power of the code 0 [dBm].
    num_saturated : int
        Cells above the highest code.
    num_paths : int
        Paths that were solved, over all azimuths.
    diagnostics : mapping
        What the solver chose and left out at the first of the times at which paths were solved.
    power : ndarray of float32, shape (num_azimuths, num_cells), or None
        Power before it is coded [W]; only with ``keep_power`` of the settings.
    """

    spec: ScanningRadarSpec
    world_from_sensor: Pose
    azimuth: npt.NDArray[np.float64]
    time: npt.NDArray[np.float64]
    azimuth_pose: npt.NDArray[np.float64]
    azimuth_twist: npt.NDArray[np.float64]
    image: npt.NDArray[np.uint8]
    floor_dbm: float
    num_saturated: int = 0
    num_paths: int = 0
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    power: npt.NDArray[np.float32] | None = None

    def _facts(self) -> Iterable[Row]:
        yield from field_rows(self, without=("diagnostics",))
        yield "diagnostics", listed(self.diagnostics)

    @property
    def power_dbm(self) -> npt.NDArray[np.float32]:
        """Power of the image's codes, shape (num_azimuths, num_cells) [dBm]."""
        step = np.float32(self.spec.image_step_db)
        return np.asarray(np.float32(self.floor_dbm) + step * self.image, dtype=np.float32)

    @property
    def encoder(self) -> npt.NDArray[np.uint16]:
        """Counts of the angle encoder, shape (num_azimuths,): 0 is ahead, rising to the right (clockwise)."""
        counts = self.spec.encoder_counts
        return np.asarray(np.rint(-self.azimuth / (2.0 * np.pi) * counts).astype(np.int64) % counts, dtype=np.uint16)

    def oxford_rows(self, timestamp_ns: int = 0) -> npt.NDArray[np.uint8]:
        """Return the image as the Oxford Radar RobotCar and Boreas datasets keep it, a row an azimuth.

        Saved as a PNG file, the readers of both open it.

        Parameters
        ----------
        timestamp_ns : int
            Of the frame [ns], to which the times of the azimuths are added.

        Returns
        -------
        ndarray of uint8, shape (num_azimuths, 11 + num_cells)
            Eight bytes of the time [us] and two of the encoder, little-endian, 255 for valid, then the image.

        References
        ----------
        .. [1] github.com/utiasASRL/pyboreas, DATA_REFERENCE.md; github.com/ori-mrg/robotcar-dataset-sdk, radar.py.
        """
        when = (timestamp_ns + np.rint(self.time * 1e9).astype(np.int64)) // 1000
        rows = len(self.time)
        head = [when.astype("<i8").view(np.uint8), self.encoder.astype("<u2").view(np.uint8)]
        valid = np.full((rows, 1), 255, dtype=np.uint8)
        return np.concatenate([*(part.reshape(rows, -1) for part in head), valid, self.image], axis=1)

    def cartesian(self, cell: float = 0.25, reach: float | None = None) -> npt.NDArray[np.float32]:
        """Return the image from above, bilinear between azimuths and ranges, without correction of motion.

        Parameters
        ----------
        cell : float
            Width of a pixel [m].
        reach : float, optional
            From the radar to the edges of the picture [m]; default: the largest range.

        Returns
        -------
        ndarray of float32, shape (num_pixels, num_pixels)
            Power [dBm]; row 0 lies ahead, column 0 to the left, the radar in the middle pixel; the lowest code beyond
            the largest range.

        Raises
        ------
        ParameterRangeError
            If there would be no pixel beside the middle one, or more than 100 million.
        """
        from scarl_sionna.core.prompt.polar import seen_from_above

        return seen_from_above(self, cell, reach)

    def plot(
        self, view: str = "map", max_range: float | None = None, dynamic_range_db: float = 60.0, ax: Axes | None = None
    ) -> Axes:
        """Draw the image.

        Parameters
        ----------
        view : {"map", "polar"}
            ``"map"``: from above, forward is up. ``"polar"``: azimuth over range, as it is recorded.
        max_range : float, optional
            Last range shown [m].
        dynamic_range_db : float
            Powers farther below the strongest have one colour [dB].
        ax : matplotlib.axes.Axes, optional
            Drawn into; default: those of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        UnknownNameError, ParameterRangeError
            If there is no such view, or the dynamic range is not positive.
        """
        from scarl_sionna.core.prompt.polar import plot_scan

        return plot_scan(self, view, max_range, dynamic_range_db, ax)
