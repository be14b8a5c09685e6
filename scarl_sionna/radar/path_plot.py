"""Plots of propagation paths: their strength over range, and where they scatter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.axes import (
    DARK,
    POWER_MAP,
    VELOCITY_MAP,
    axes_or_new,
    centred,
    colour_bar,
    power_limits,
    sensor_map,
)
from scarl_sionna.core.units import power_to_db

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]
VIEWS = ("range", "map")
_FEW = 500
"""Paths up to this number have an outline."""
_GAIN = "received / transmitted power, isotropic antennas [dB]"


class PathsView(Protocol):
    """What is drawn of :class:`scarl_sionna.radar.paths.RadarPaths`."""

    @property
    def num_paths(self) -> int:
        """Number of paths."""

    @property
    def a(self) -> npt.NDArray[np.complex128]:
        """Polarimetric transfer, (num_paths, 2, 2)."""

    @property
    def length(self) -> Array:
        """Lengths between the array centres [m]."""

    @property
    def length_rate(self) -> Array:
        """Their change over time [m/s]."""

    @property
    def world_from_rx(self) -> Pose:
        """Frame of the receiver."""

    @property
    def apparent_points(self) -> Array:
        """Where the receiver sees the paths, (num_paths, 3) [m, world]."""


def plot_paths(paths: PathsView, view: str, dynamic_range_db: float, ax: Axes | None) -> Axes:
    """Draw paths, see `RadarPaths.plot`."""
    if view not in VIEWS:
        raise UnknownNameError("view", view, VIEWS)
    gain_db = power_to_db((np.abs(paths.a) ** 2).sum(axis=(1, 2)))
    limits = power_limits(gain_db, dynamic_range_db)
    order = np.argsort(gain_db, kind="stable")  # strong ones on top
    order = order[gain_db[order] >= limits[0]]
    if view == "range":
        axis = axes_or_new(ax)
        velocity = paths.length_rate[order] / 2.0
        low, high = centred(velocity)
        drawn = axis.scatter(
            paths.length[order] / 2.0,
            gain_db[order],
            c=velocity,
            s=14,
            cmap=VELOCITY_MAP,
            vmin=low,
            vmax=high,
            edgecolors="0.3",
            linewidths=0.3 if len(order) <= _FEW else 0.0,
            rasterized=True,
        )
        axis.set(
            xlabel="range, half of the length [m]", ylabel="received / transmitted power,\nisotropic antennas [dB]"
        )
        axis.set_xlim(left=0.0)
        axis.grid(color="0.92")
        axis.set_axisbelow(True)
        colour_bar(axis, drawn, "radial velocity [m/s], opening is positive")
    else:
        axis = axes_or_new(ax, 7.0, 6.0)
        place = paths.world_from_rx.inverse().apply(paths.apparent_points[order])
        drawn = axis.scatter(
            place[:, 1],
            place[:, 0],
            c=gain_db[order],
            s=8,
            cmap=POWER_MAP,
            vmin=limits[0],
            vmax=limits[1],
            linewidths=0,
            rasterized=True,
        )
        axis.plot([0.0], [0.0], marker="^", color="white", markersize=8)
        axis.set_facecolor(DARK)
        sensor_map(axis, float(np.abs(place[:, 1]).max(initial=10.0)) * 1.05)
        colour_bar(axis, drawn, _GAIN)
    axis.set_title(f"{len(order)} of {paths.num_paths} paths, within {dynamic_range_db:g} dB of the strongest")
    return axis
