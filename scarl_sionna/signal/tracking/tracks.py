"""Tracks: the table of objects followed over frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.prompt.describe import Described, Row, field_rows

Array = npt.NDArray[np.float64]
Ids = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False, repr=False)
class RadarTracks(
    Described, units={"time": "s", "position": "m", "velocity": "m/s", "covariance": "m, m/s: x, y, vx, vy"}
):
    """Confirmed tracks by frame: one row a track and frame, sorted by frame, then by track.

    Attributes
    ----------
    frame : ndarray of int64, shape (num_rows,)
        Number of the frame in the list that was tracked.
    time : ndarray of float64, shape (num_rows,)
        [s]
    track : ndarray of int64, shape (num_rows,)
        Number of the track, from 0 in the order of confirmation.
    position : ndarray of float64, shape (num_rows, 2)
        In the world, seen from above [m].
    velocity : ndarray of float64, shape (num_rows, 2)
        Over ground, world axes [m/s].
    covariance : ndarray of float64, shape (num_rows, 4, 4)
        Of x, y, vx, vy [m, m/s].
    cluster : ndarray of int64, shape (num_rows,)
        Row of the frame's cluster that the track took, -1 where it went on without.
    instance : ndarray of int32, shape (num_rows,)
        Of most clusters that the track took so far, the latest of as many; 0 without labels.
    semantic : ndarray of uint8, shape (num_rows,)
        Class of that instance; 0 without labels.
    """

    frame: Ids
    time: Array
    track: Ids
    position: Array
    velocity: Array
    covariance: Array
    cluster: Ids
    instance: npt.NDArray[np.int32]
    semantic: npt.NDArray[np.uint8]

    def _facts(self) -> Iterable[Row]:
        yield "num_tracks", f"{self.num_tracks} in {len(np.unique(self.frame))} frames with any"
        yield from field_rows(self)

    @property
    def num_tracks(self) -> int:
        """Number of different tracks."""
        return len(np.unique(self.track))

    def select(self, rows: npt.NDArray[np.bool_] | Ids) -> RadarTracks:
        """Return some of the rows: ``tracks.select(tracks.track == 3)`` is the way of one."""
        return RadarTracks(**{item.name: getattr(self, item.name)[rows] for item in fields(self)})
