"""Plots of the channels of radio links."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from .axes import axes_or_new

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from scarl_sionna.core.specs.radio import RadioSpec

DEPTH_DB = 70.0
"""Paths farther below the strongest of all stations are below the plot [dB]."""


class Channels(Protocol):
    """What is drawn of :class:`scarl_sionna.core.channels.RadioChannels`."""

    @property
    def spec(self) -> RadioSpec:
        """The radio."""

    @property
    def a(self) -> npt.NDArray[np.complex64]:
        """Coefficients, (num_stations, num_station_antennas, num_antennas, max_paths)."""

    @property
    def tau(self) -> npt.NDArray[np.float64]:
        """Delays, (num_stations, max_paths) [s]."""

    @property
    def valid(self) -> npt.NDArray[np.bool_]:
        """Which paths there are, (num_stations, max_paths)."""


def plot_profiles(channels: Channels, ax: Axes | None = None) -> Axes:
    """Draw gain against delay of every path, see `RadioChannels.plot`."""
    axis = axes_or_new(ax, 7.0, 4.0)
    gain = 10.0 * np.log10(np.maximum((np.abs(channels.a) ** 2).mean(axis=(1, 2)), 1e-30))
    top = float(gain[channels.valid].max()) if channels.valid.any() else 0.0
    for index, station in enumerate(channels.spec.stations):
        kept = channels.valid[index]
        color = f"C{index % 10}"
        delay, power = channels.tau[index, kept] * 1e9, gain[index, kept]
        axis.vlines(delay, top - DEPTH_DB, power, color=color, linewidth=1.2, alpha=0.7)
        axis.plot(delay, power, "o", color=color, markersize=4.0, label=f"{station.name}: {np.count_nonzero(kept)}")
    axis.set(xlabel="delay [ns]", ylabel="gain of a path [dB]", ylim=(top - DEPTH_DB, top + 5.0))
    axis.set_title(f"paths at {channels.spec.frequency / 1e9:g} GHz")
    axis.legend(title="paths of station", fontsize=8.0)
    axis.grid(alpha=0.3)
    return axis
