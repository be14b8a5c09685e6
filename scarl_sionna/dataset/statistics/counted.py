"""What is counted of a dataset: rows of tables, and what charts and figures read of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.prompt.describe import Row

OBJECT_ROW = np.dtype(
    [
        ("scene", "i4"), ("instance", "i4"), ("semantic", "u1"), ("group", "i1"), ("moving", "?"), ("range", "f4"),
        ("occlusion", "f4"), ("pixels", "i8"), ("lidar_points", "i8"), ("radar_points", "i4"),
    ]
)  # fmt: skip # a table
SCAN_ROW = np.dtype([("group", "i1"), ("moving", "?"), ("range", "f4"), ("points", "i4"), ("velocity_spread", "f4")])
POINT_ROW = np.dtype([("group", "i1"), ("moving", "?"), ("range", "f4"), ("snr_db", "f4"), ("rcs_dbsm", "f4")])
Rows = npt.NDArray[np.void]

FEWEST_FOR_SPREAD = 3
"""Points of an object in a scan from which a spread of their velocities is told."""

FIELD_OF_VIEW_DEG = 60.0
"""Half angle in azimuth within which a radar counts as looking at an object [deg]: that of RadarScenes' sensors."""
FARTHEST = 100.0
"""Largest range at which it does, if the radar reaches that far [m]: that of RadarScenes' sensors."""


@dataclass(frozen=True)
class SceneFacts:
    """One scene, or of one whose weather changes the part in one weather: name, split, weather, frames counted."""

    name: str
    split: str
    weather: str
    num_frames: int


class CountedPoints(Protocol):
    """What charts of points alone read."""

    @property
    def scans(self) -> Rows:
        """Rows of `SCAN_ROW`."""
        raise NotImplementedError

    @property
    def points(self) -> Rows:
        """Rows of `POINT_ROW`."""
        raise NotImplementedError


class Counted(CountedPoints, Protocol):
    """What charts, figures and the page read; see :class:`~.collect.DatasetStatistics`."""

    @property
    def scenes(self) -> tuple[SceneFacts, ...]:
        """Scenes that were counted."""
        raise NotImplementedError

    @property
    def objects(self) -> Rows:
        """Rows of `OBJECT_ROW`."""
        raise NotImplementedError

    @property
    def points_per_scan(self) -> npt.NDArray[np.int64]:
        """Points of each radar in each frame."""
        raise NotImplementedError

    @property
    def points_per_frame(self) -> npt.NDArray[np.int64]:
        """Points of all radars in each frame."""
        raise NotImplementedError

    @property
    def pfa(self) -> float:
        """Probability of false alarm."""
        raise NotImplementedError

    @property
    def most_points(self) -> int | None:
        """How many points of a radar and frame were kept, the strongest."""
        raise NotImplementedError

    @property
    def margin(self) -> float:
        """Farthest of a point from its box [m]."""
        raise NotImplementedError

    @property
    def num_frames(self) -> int:
        """Frames that were counted."""
        raise NotImplementedError

    def facts(self) -> list[Row]:
        """Names and texts of the facts in short."""

    def frames_by(self, what: str) -> dict[str, int]:
        """Frames by weather or split."""

    def class_balance(self) -> dict[str, tuple[int, int]]:
        """Labels and objects by semantic class."""


def velocity_spread(velocity: npt.NDArray[np.float64], interval: float) -> float:
    """Return the standard deviation of the radial velocities of an object's points in a scan [m/s].

    Parameters
    ----------
    velocity : ndarray of float64, shape (num_points,)
        [m/s], the strongest point first.
    interval : float
        Width that they are folded to [m/s]: each is unfolded about the first; nan: they are not folded.

    Returns
    -------
    float
        nan below `FEWEST_FOR_SPREAD` points. By definition of the standard deviation.
    """
    if len(velocity) < FEWEST_FOR_SPREAD:
        return math.nan
    gap = velocity - velocity[0]
    return float(np.std(gap if math.isnan(interval) else gap - interval * np.rint(gap / interval)))
