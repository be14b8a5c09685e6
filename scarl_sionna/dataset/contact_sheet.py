"""One picture of one frame: the project's counterpart of SCaRL's Fig. 2."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from scarl_sionna.core.errors import OutputError, UnknownNameError
from scarl_sionna.core.prompt.axes import POWER_MAP, colour_bar
from scarl_sionna.core.prompt.images import NEAREST_DEPTH, depth_bar, depth_colors, draw_classes, draw_depth, draw_rgb
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan, ObjectState, RadarFrame
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.units import watt_to_dbm
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import virtual_cube

from .store.atomic import whole_file
from .store.layout import SHEET_MARK

SHOWN_IMAGES = ("rgb", "depth", "semantic", "instance")
STYLE = {
    "font.size": 10.0,
    "axes.titlesize": 11.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.linewidth": 0.8,
    "font.family": "DejaVu Sans",
}
_MOST_NAMES = 8
"""Actors nearest to a radar that are named in its maps; the others only have a ring."""
_TICKS_DEG = np.arange(-80, 81, 20)


@dataclass(frozen=True, eq=False)
class RadarMaps:
    """Power maps of one radar frame.

    Attributes
    ----------
    range : ndarray, shape (num_range,) [m]
    radial_velocity : ndarray, shape (num_doppler,) [m/s], rising
    azimuth : ndarray, shape (num_azimuth,) [rad], rising, left positive
    range_doppler_dbm : ndarray, shape (num_doppler, num_range)
        Mean power of the channels [dBm].
    range_azimuth_dbm : ndarray, shape (num_range, num_azimuth)
        Power of the strongest Doppler bin (and elevation) [dBm].
    """

    range: npt.NDArray[np.float64]
    radial_velocity: npt.NDArray[np.float64]
    azimuth: npt.NDArray[np.float64]
    range_doppler_dbm: npt.NDArray[np.float64]
    range_azimuth_dbm: npt.NDArray[np.float64]


def radar_maps(frame: RadarFrame) -> RadarMaps:
    """Return the range-Doppler and the range-azimuth map of a radar frame."""
    rda = range_doppler_angle(virtual_cube(frame.adc, frame.spec), frame.spec, angle_window="taylor", num_azimuth=128)
    power = rda.data.max(axis=0)
    if rda.elevation is not None:
        power = power.max(axis=-1)
    return RadarMaps(rda.range, rda.radial_velocity, rda.azimuth, watt_to_dbm(rda.channels.power), watt_to_dbm(power))


def contact_sheet(
    frame: Frame,
    *,
    title: str = "",
    suite: str | None = None,
    max_range: float = 100.0,
    markers: bool = True,
) -> Figure:
    """Return one suite of a frame as a figure: RGB, depth, range-Doppler.

    Semantic with instances, lidar depth, range-azimuth.

    Parameters
    ----------
    frame : Frame
    title : str
        First words of the headline, for instance the scene's name.
    suite : str, optional
        Group of sensors, the part of their names before the last ``/``; default: ``front_center`` if there, else the
        first. A sensor of a kind that the suite lacks leaves its panel empty.
    max_range : float
        Last range and depth shown [m].
    markers : bool
        Mark the true places of the moving objects on the radar maps; velocities beyond the unambiguous interval where
        they fold to.

    Returns
    -------
    matplotlib.figure.Figure
        16 x 6.9 inches.

    Raises
    ------
    UnknownNameError
        If the frame has no such suite.
    """
    suite, chosen = _suite(frame, suite)
    time = frame.timestamp_ns * 1e-9
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(16.0, 6.9), layout="constrained")
        figure.get_layout_engine().set(w_pad=0.06, h_pad=0.06, wspace=0.02, hspace=0.03)  # type: ignore[union-attr]
        axes = figure.subplots(2, 3, width_ratios=(1.0, 1.0, 0.8))
        for axis in axes.flat:
            axis.set_anchor("N")
        words = [title, f"frame {frame.index}", f"t = {time:.3f} s", suite]
        figure.suptitle("   ·   ".join(word for word in words if word), fontsize=12.5)
        _draw_rgb(axes[0, 0], chosen.get("rgb"))
        _draw_depth(axes[0, 1], chosen.get("depth"), max_range)
        _draw_labels(axes[1, 0], chosen.get("semantic"), chosen.get("instance"))
        _draw_lidar(axes[1, 1], chosen.get("lidar"), max_range)
        _draw_radar(axes[0, 2], axes[1, 2], frame, chosen.get("radar"), max_range, markers)
    return figure


def write_contact_sheet(frame: Frame, path: str | Path, *, dpi: int = 150, **options: object) -> None:
    """Write the :func:`contact_sheet` of a frame to a PNG file.

    Parameters
    ----------
    frame : Frame
    path : path
    dpi : int
        Pixels an inch of the sheet.
    **options
        Of :func:`contact_sheet`.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    figure = contact_sheet(frame, **cast("dict[str, Any]", options))
    try:
        with mpl.rc_context(STYLE), whole_file(Path(path)) as partial:
            figure.savefig(partial, format="png", dpi=dpi, metadata={"Software": SHEET_MARK})
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}; choose a folder that you may write to") from error


def _suite(frame: Frame, suite: str | None) -> tuple[str, dict[str, Any]]:
    """Return the name of a suite and its results by what they show."""
    groups = dict.fromkeys(name.rpartition("/")[0] for name in frame.results)
    if suite is None:
        suite = "front_center" if "front_center" in groups else next(iter(groups))
    elif suite not in groups:
        raise UnknownNameError("suite", suite, groups)
    chosen: dict[str, Any] = {}
    for name, result in frame.results.items():
        if name.rpartition("/")[0] != suite:
            continue
        if isinstance(result, ImageFrame):
            shown = [kind for kind in SHOWN_IMAGES if getattr(result, kind) is not None]
        else:
            shown = [kind for kind, cls in (("lidar", LidarScan), ("radar", RadarFrame)) if isinstance(result, cls)]
        for kind in shown:
            chosen.setdefault(kind, result)
    return suite, chosen


def _draw_rgb(axis: Axes, camera: ImageFrame | None) -> None:
    axis.set_title("RGB camera")
    if camera is None or camera.rgb is None:
        return _leave_empty(axis)
    draw_rgb(axis, camera.rgb)
    _angle_axes(axis, camera.spec)


def _draw_depth(axis: Axes, camera: ImageFrame | None, max_range: float) -> None:
    axis.set_title("Depth camera")
    if camera is None or camera.depth is None:
        return _leave_empty(axis)
    draw_depth(axis, camera.depth, max_range)
    _angle_axes(axis, camera.spec)


def _draw_labels(axis: Axes, semantic: ImageFrame | None, instance: ImageFrame | None) -> None:
    axis.set_title("Semantic classes and instances")
    if semantic is None or semantic.semantic is None:
        return _leave_empty(axis)
    draw_classes(axis, semantic.semantic, None if instance is None else instance.instance)
    _angle_axes(axis, semantic.spec)


def _draw_lidar(axis: Axes, scan: LidarScan | None, max_range: float) -> None:
    axis.set_title("Lidar depth map")
    if scan is None:
        return _leave_empty(axis)
    spec = scan.spec
    grid = np.full((spec.num_elevation, spec.num_azimuth), np.inf)
    row, column = spec.scan.cells()
    order = np.argsort(-scan.position[:, 0], kind="stable")  # of several returns in a cell the nearest stays
    shot = scan.shot[order]
    grid[row[shot], column[shot]] = scan.position[order, 0]
    left, right, bottom, top = spec.view_deg
    norm = LogNorm(NEAREST_DEPTH, max_range)
    image = axis.imshow(
        np.ma.masked_invalid(grid),
        cmap=depth_colors(),
        norm=norm,
        extent=(left, right, bottom, top),
        origin="upper",
        interpolation="nearest",
        aspect="auto",
    )
    axis.set_xlim(max(left, right), min(left, right))  # left is left
    axis.set_xticks([tick for tick in _TICKS_DEG if min(left, right) <= tick <= max(left, right)])
    axis.set(xlabel="azimuth [deg]", ylabel="elevation [deg]")
    axis.set_box_aspect(9 / 16)
    depth_bar(axis, image, norm)


def _draw_radar(
    doppler_axis: Axes, azimuth_axis: Axes, frame: Frame, radar: RadarFrame | None, max_range: float, markers: bool
) -> None:
    doppler_axis.set_title("Range-Doppler map")
    azimuth_axis.set_title("Range-azimuth map")
    if radar is None:
        _leave_empty(doppler_axis)
        return _leave_empty(azimuth_axis)
    maps = radar_maps(radar)
    near = maps.range <= max_range
    _draw_power(doppler_axis, maps.radial_velocity, maps.range[near], maps.range_doppler_dbm[:, near].T)
    _draw_power(azimuth_axis, np.degrees(maps.azimuth), maps.range[near], maps.range_azimuth_dbm[near])
    for axis in (doppler_axis, azimuth_axis):
        _draw_end(axis, float(maps.range[-1]), max_range)
    doppler_axis.set(xlabel="radial velocity [m/s], opening is positive", ylabel="range [m]", ylim=(0.0, max_range))
    half = radar.spec.azimuth_fov_deg / 2.0
    azimuth_axis.set(xlabel="azimuth [deg]", ylabel="range [m]", ylim=(0.0, max_range), xlim=(half, -half))
    if not markers:
        return
    places = [(_in_radar(item, frame, radar), item.name) for item in frame.objects if item.is_actor]
    near_first = sorted((place, name) for place, name in places if place is not None and place[0] <= 0.97 * max_range)
    for number, ((distance, velocity, azimuth_deg), name) in enumerate(near_first):
        text = name if number < _MOST_NAMES else ""
        _mark(doppler_axis, _on_axis(velocity, maps.radial_velocity), distance, text)
        _mark(azimuth_axis, azimuth_deg, distance, text)


def _draw_power(axis: Axes, across: np.ndarray, distance: np.ndarray, power_dbm: np.ndarray) -> None:
    floor = float(np.median(power_dbm))
    norm = Normalize(floor, max(float(power_dbm.max()), floor + 10.0))
    image = axis.pcolormesh(
        across, distance, power_dbm, cmap=POWER_MAP, norm=norm, shading="nearest", rasterized=True, antialiased=False
    )
    axis.set_box_aspect(9 / 16 / 0.8)
    axis.set_facecolor(mpl.colormaps[POWER_MAP](0.0))
    colour_bar(axis, image, "power [dBm]", extend="min")


def _draw_end(axis: Axes, last: float, max_range: float) -> None:
    """Tell what is above a radar's last range [m]: nothing measured, not nothing there."""
    if last < max_range:
        axis.axhspan(last, max_range, facecolor="0.5", edgecolor="none")
        middle = (last + max_range) / 2.0
        axis.text(
            0.5, middle, "beyond the radar's range", transform=axis.get_yaxis_transform(), ha="center", va="center"
        )


def _on_axis(velocity: float, axis: npt.NDArray[np.float64]) -> float:
    """Return where an echo of a radial velocity [m/s] stands on the Doppler axis, which is periodic."""
    if len(axis) < 2:
        return float(axis[0])
    step = axis[1] - axis[0]
    first = axis[0] - step / 2.0
    return float(first + (velocity - first) % (len(axis) * step))


def _in_radar(item: ObjectState, frame: Frame, radar: RadarFrame) -> tuple[float, float, float] | None:
    """Return range [m], radial velocity [m/s] and azimuth [deg] of a box's nearest point, or None outside the view."""
    sensor = radar.world_from_sensor
    half = np.asarray(item.size) / 2.0
    origin = item.world_from_box.inverse().apply(sensor.position)
    nearest = item.world_from_box.apply(np.clip(origin, -half, half))
    offset = nearest - sensor.position
    distance = float(np.linalg.norm(offset))
    if distance < 1e-6:
        return None
    x, y, _ = sensor.inverse().rotate(offset)
    azimuth_deg = float(np.degrees(np.arctan2(y, x)))
    if abs(azimuth_deg) > radar.spec.azimuth_fov_deg / 2.0:
        return None
    own = frame.vehicle_twist.velocity_at(sensor.position - frame.world_from_vehicle.position)
    target = item.twist.velocity_at(nearest - item.world_from_box.position)
    return distance, float((target - own) @ offset / distance), azimuth_deg


def _mark(axis: Axes, x: float, y: float, text: str) -> None:
    axis.plot([x], [y], marker="o", markersize=9, markerfacecolor="none", markeredgecolor="white", markeredgewidth=1.0)
    axis.annotate(
        text.replace("_", " "),
        (x, y),
        xytext=(8, 5),
        textcoords="offset points",
        color="white",
        fontsize=8.5,
        clip_on=True,
    )


def _angle_axes(axis: Axes, spec: CameraSpec) -> None:
    """Label an image's columns and rows with azimuth and elevation [deg]."""
    (focal, _, center_u), (_, _, center_v) = spec.intrinsics[0], spec.intrinsics[1]
    for center, size, set_ticks in (
        (center_u, spec.width, axis.set_xticks),
        (center_v, spec.height, axis.set_yticks),
    ):
        pixels = center - focal * np.tan(np.radians(_TICKS_DEG)) - 0.5  # imshow's first pixel is centred on 0
        inside = (pixels >= -0.5) & (pixels <= size - 0.5)
        set_ticks(pixels[inside], [f"{tick}".replace("-", "\N{MINUS SIGN}") for tick in _TICKS_DEG[inside]])
    axis.set(xlabel="azimuth [deg]", ylabel="elevation [deg]")


def _leave_empty(axis: Axes) -> None:
    axis.text(0.5, 0.5, "not in this suite", ha="center", va="center", transform=axis.transAxes, color="0.5")
    axis.set(xticks=[], yticks=[])
