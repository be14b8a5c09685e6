"""Plots of radar maps and detections: powers in dBm, 60 dB below the peak, and maps with equal axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.prompt.axes import (
    VELOCITY_MAP,
    axes_or_new,
    centred,
    colour_bar,
    draw_power,
    power_limits,
    sensor_map,
)
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import watt_to_dbm

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]
Powers = npt.NDArray[np.float32]
VIEWS = ("map", "range_azimuth", "range_doppler")


class Map(Protocol):
    """Axes of a radar map."""

    @property
    def range(self) -> Array:
        """Ranges [m]."""

    @property
    def radial_velocity(self) -> Array:
        """Radial velocities [m/s]."""


class RangeDopplerView(Map, Protocol):
    """What is drawn of :class:`scarl_sionna.signal.processing.RangeDoppler`."""

    @property
    def power(self) -> Powers:
        """Mean power of the channels, (velocities, ranges) [W]."""


class RangeDopplerAngleView(Map, Protocol):
    """What is drawn of :class:`scarl_sionna.signal.angle.RangeDopplerAngle`."""

    @property
    def data(self) -> Powers:
        """Power, (velocities, ranges, azimuths) or with elevations last [W]."""

    @property
    def azimuth(self) -> Array:
        """Azimuths [rad]."""

    @property
    def elevation(self) -> Array | None:
        """Elevations [rad]; None without."""

    @property
    def radar(self) -> RadarSpec:
        """The radar."""


class PointsView(Protocol):
    """What is drawn of :class:`scarl_sionna.signal.detection.RadarPoints`."""

    @property
    def num_points(self) -> int:
        """Number of detections."""

    @property
    def position(self) -> Array:
        """Positions, (num_points, 3) [m, radar frame]."""

    @property
    def radial_velocity(self) -> Array:
        """Radial velocities [m/s]."""

    @property
    def snr_db(self) -> Array:
        """Signal over noise [dB]."""


def plot_range_doppler(rd: RangeDopplerView, max_range: float | None, dynamic_range_db: float, ax: Axes | None) -> Axes:
    """Draw the mean power of the channels, see `RangeDoppler.plot`."""
    axis = axes_or_new(ax)
    near = slice(None) if max_range is None else rd.range <= max_range
    power = watt_to_dbm(rd.power[:, near]).T
    draw_power(axis, rd.radial_velocity, rd.range[near], power, power_limits(power, dynamic_range_db))
    axis.set(xlabel="radial velocity [m/s], opening is positive", ylabel="range [m]", title="Range-Doppler map")
    return axis


def plot_range_doppler_angle(
    rda: RangeDopplerAngleView, view: str, max_range: float | None, dynamic_range_db: float, ax: Axes | None
) -> Axes:
    """Draw the strongest power over what is not shown, see `RangeDopplerAngle.plot`."""
    if view not in VIEWS:
        raise UnknownNameError("view", view, VIEWS)
    power = rda.data.max(axis=3) if rda.elevation is not None else rda.data
    near = rda.range <= (np.inf if max_range is None else max_range)
    distance = rda.range[near]
    if view == "range_doppler":
        axis = axes_or_new(ax)
        shown = watt_to_dbm(power.max(axis=2)[:, near]).T
        draw_power(axis, rda.radial_velocity, distance, shown, power_limits(shown, dynamic_range_db))
        axis.set(xlabel="radial velocity [m/s], opening is positive", ylabel="range [m]", title="Strongest direction")
        return axis
    shown = watt_to_dbm(power.max(axis=0)[near])
    limits = power_limits(shown, dynamic_range_db)
    if view == "range_azimuth":
        axis = axes_or_new(ax)
        draw_power(axis, np.degrees(rda.azimuth), distance, shown, limits)
        axis.set(xlabel="azimuth [deg], left is positive", ylabel="range [m]", title="Range-azimuth map")
        axis.set_xlim(*np.degrees(rda.azimuth[[-1, 0]]))
        return axis
    axis = axes_or_new(ax, 7.0, 6.0)
    half = np.radians(rda.radar.azimuth_fov_deg / 2.0)
    seen = np.abs(rda.azimuth) <= half
    across = np.outer(distance, np.sin(rda.azimuth[seen]))
    ahead = np.outer(distance, np.cos(rda.azimuth[seen]))
    draw_power(axis, across, ahead, shown[:, seen], limits)
    sensor_map(axis, float(distance[-1]), float(np.abs(across).max(initial=1.0)))
    axis.set(ylim=(0.0, float(distance[-1])), title="Radar map, strongest velocity")
    return axis


def plot_points(points: PointsView, ax: Axes | None) -> Axes:
    """Draw detections from above, see `RadarPoints.plot`."""
    axis = axes_or_new(ax, 7.0, 6.0)
    low, high = centred(points.radial_velocity)
    size = 12.0 + 2.0 * np.clip(points.snr_db, 0.0, 60.0)
    drawn = axis.scatter(
        points.position[:, 1],
        points.position[:, 0],
        c=points.radial_velocity,
        s=size,
        cmap=VELOCITY_MAP,
        vmin=low,
        vmax=high,
        edgecolors="0.25",
        linewidths=0.5,
    )
    axis.plot([0.0], [0.0], marker="^", color="black", markersize=8)
    aside = max(1.1 * np.abs(points.position[:, 1]).max(initial=10.0), 0.35 * points.position[:, 0].max(initial=0.0))
    sensor_map(axis, float(aside))
    axis.grid(color="0.9")
    axis.set_axisbelow(True)
    axis.set_title(f"{points.num_points} detections, radar frame; larger: higher SNR")
    colour_bar(axis, drawn, "radial velocity [m/s], opening is positive")
    return axis
