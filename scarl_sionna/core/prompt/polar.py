"""Pictures of scanning radars: from above, and azimuth over range."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError

from .axes import POWER_MAP, axes_or_new, colour_bar, power_limits, sensor_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from scarl_sionna.core.specs.radar.scanning.spec import ScanningRadarSpec

VIEWS = ("map", "polar")
_MOST_PIXELS = 100_000_000
_PIXELS_ACROSS = 900
"""Pixels of a drawn map from edge to edge."""


class Scan(Protocol):
    """What is drawn of :class:`scarl_sionna.core.results.RadarScan`."""

    @property
    def spec(self) -> ScanningRadarSpec:
        """The radar."""

    @property
    def azimuth(self) -> npt.NDArray[np.float64]:
        """Azimuths, (num_azimuths,) [rad]."""

    @property
    def power_dbm(self) -> npt.NDArray[np.float32]:
        """Power, (num_azimuths, num_cells) [dBm]."""

    @property
    def floor_dbm(self) -> float:
        """Lowest power that has a code [dBm]."""


def seen_from_above(scan: Scan, cell: float, reach: float | None) -> npt.NDArray[np.float32]:
    """Return the image from above, see `RadarScan.cartesian`."""
    spec = scan.spec
    reach = spec.max_range - spec.range_bin if reach is None else float(reach)
    if not 0.0 < cell <= reach:
        raise ParameterRangeError("cell", f"{cell} m", f"0 < cell <= the reach of {reach:g} m")
    half = int(reach / cell + 1e-9)
    if (2 * half + 1) ** 2 > _MOST_PIXELS:
        raise ParameterRangeError(
            "cell", f"{cell} m", f"at most {_MOST_PIXELS} pixels, not {2 * half + 1} squared", "take wider pixels"
        )
    power = scan.power_dbm
    place = np.arange(half, -half - 1, -1) * cell
    out = np.full((len(place), len(place)), np.float32(scan.floor_dbm))
    step = spec.azimuth_rate * spec.azimuth_interval
    for row, forward in zip(out, place, strict=True):
        distance = np.hypot(forward, place) / spec.range_bin
        inside = distance <= spec.num_cells - 1
        turn = ((np.arctan2(place, forward) - scan.azimuth[0]) / step)[inside] % spec.num_azimuths
        before, nearer = np.floor(turn).astype(int), np.minimum(distance[inside].astype(int), spec.num_cells - 2)
        after, before = (before + 1) % spec.num_azimuths, before % spec.num_azimuths  # the last one meets the first
        aside, farther = turn - np.floor(turn), distance[inside] - nearer
        row[inside] = (1.0 - aside) * (
            (1.0 - farther) * power[before, nearer] + farther * power[before, nearer + 1]
        ) + aside * ((1.0 - farther) * power[after, nearer] + farther * power[after, nearer + 1])
    return out


def plot_scan(scan: Scan, view: str, max_range: float | None, dynamic_range_db: float, ax: Axes | None) -> Axes:
    """Draw the image, see `RadarScan.plot`."""
    if view not in VIEWS:
        raise UnknownNameError("view", view, VIEWS)
    reach = scan.spec.max_range - scan.spec.range_bin
    reach = reach if max_range is None else min(float(max_range), reach)
    axis = axes_or_new(ax, 7.0, 6.0)
    if view == "map":
        shown = seen_from_above(scan, max(2.0 * reach / _PIXELS_ACROSS, 1e-3), reach)
        extent = (reach, -reach, -reach, reach)
        sensor_map(axis, reach)
    else:
        shown = scan.power_dbm[:, : int(reach / scan.spec.range_bin) + 1]
        extent = (0.0, reach, scan.spec.num_azimuths - 0.5, -0.5)
        axis.set(xlabel="range [m]", ylabel="number of the azimuth")
    low, high = power_limits(shown, dynamic_range_db)
    image = axis.imshow(
        shown, cmap=POWER_MAP, vmin=low, vmax=high, extent=extent, aspect="equal" if view == "map" else "auto"
    )
    axis.set_title("Radar scan")
    colour_bar(axis, image, "power [dBm]", extend="min")
    return axis
