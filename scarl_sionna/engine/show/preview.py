"""A state of the world in three dimensions, in a notebook: Sionna RT's own previewer with sensors, paths and points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.axes import DYNAMIC_RANGE_DB, POWER_MAP, VELOCITY_MAP, centred
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.units import power_to_db
from scarl_sionna.engine import variant
from scarl_sionna.signal.detection import RadarPoints

from .plan import OTHER_SENSOR, SENSOR_COLORS, Sensors, sensor_poses
from .view import StateView

if TYPE_CHECKING:
    from sionna.rt.preview import Previewer

Array = npt.NDArray[np.float64]

SENSOR_RADIUS = 0.15
"""Of the ball that stands for a sensor [m]."""
POINT_RADIUS = 0.2
"""Of the ball that stands for a point [m]."""
BORESIGHT = 2.0
"""Length of the line that shows where a sensor looks [m]."""
MOST_PATHS = 3000
"""Strongest paths that are drawn: a browser turns no more lines smoothly."""
RESOLUTION = (960, 600)
"""Size of the view [px]."""


class Drawn(Protocol):
    """Paths, as far as they are drawn: :class:`scarl_sionna.RadarPaths` stands above this package."""

    @property
    def a(self) -> npt.NDArray[np.complex128]:
        """Polarimetric transfer, (num_paths, 2, 2)."""

    @property
    def world_from_rx(self) -> Pose:
        """Place of the receiver."""

    @property
    def apparent_points(self) -> Array:
        """Where the receiver sees them, (num_paths, 3) [m, world]."""


Points = RadarPoints | LidarScan | npt.NDArray[np.floating]


def preview_state(state: StateView, rig: Sensors | None, paths: Drawn | None, points: Points | None) -> Previewer:
    """Return the previewer of a state, see `World.preview`."""
    with variant.radio():
        from sionna.rt.preview import Previewer

        view = Previewer(state.radio_scene(), resolution=RESOLUTION)
        if rig is not None:
            _add_sensors(view, state, rig)
        if paths is not None:
            _add_paths(view, paths)
        if points is not None:
            place, color = _placed(state, rig, paths, points)
            if len(place):
                view._plot_points(place, persist=False, colors=color, radius=POINT_RADIUS)
        view.center_view()
    return view


def _add_sensors(view: Previewer, state: StateView, rig: Sensors) -> None:
    """Draw a ball and the boresight of every sensor, and what the colours mean."""
    from matplotlib.colors import to_rgb

    mounted = sensor_poses(state, rig)
    start = np.array([pose.position for _, pose in mounted])
    ahead = np.array([pose.rotation[:, 0] for _, pose in mounted])
    color = np.array([to_rgb(SENSOR_COLORS.get(mount.kind, OTHER_SENSOR)) for mount, _ in mounted])
    view._plot_points(start, persist=False, colors=color, radius=SENSOR_RADIUS)
    view._plot_lines(start, start + BORESIGHT * ahead, color, 2.0)
    kinds = dict(zip((mount.kind for mount, _ in mounted), map(tuple, color), strict=True))
    view._add_legend_items([(kind, view._circular_legend_item(shown)) for kind, shown in kinds.items()])


def _add_paths(view: Previewer, paths: Drawn) -> None:
    """Draw the strongest paths as lines from the receiver to where it sees them, brighter where they are stronger."""
    import matplotlib as mpl

    gain_db = power_to_db((np.abs(paths.a) ** 2).sum(axis=(1, 2)))
    order = np.argsort(-gain_db, kind="stable")[:MOST_PATHS]
    order = order[gain_db[order] >= gain_db.max(initial=-np.inf) - DYNAMIC_RANGE_DB]
    if not len(order):
        return
    share = 1.0 + (gain_db[order] - gain_db[order[0]]) / DYNAMIC_RANGE_DB
    end = paths.apparent_points[order]
    start = np.broadcast_to(paths.world_from_rx.position, end.shape)
    view._plot_lines(start, end, mpl.colormaps[POWER_MAP](share)[:, :3], 1.0)


def _placed(
    state: StateView, rig: Sensors | None, paths: Drawn | None, points: Points
) -> tuple[Array, npt.NDArray[np.floating]]:
    """Return points in the world [m], (num_points, 3), and their colours: by radial velocity where they have one."""
    import matplotlib as mpl

    if isinstance(points, np.ndarray):
        if points.ndim != 2 or points.shape[1] != 3:
            raise ParameterRangeError("points", f"shape {points.shape}", "shape (num_points, 3) [m, world]")
        return points.astype(np.float64), np.array([1.0, 0.55, 0.0])
    if isinstance(points, LidarScan):
        frame = points.world_from_sensor
    elif isinstance(points, RadarPoints):
        frame = _radar_pose(state, rig, paths)
    else:
        raise InputTypeError(
            "points", points, "RadarPoints, a LidarScan or an array (num_points, 3)", "give ss.detect(...)"
        )
    low, high = centred(points.radial_velocity)
    share = np.nan_to_num((points.radial_velocity - low) / (high - low), nan=0.5)
    return frame.apply(points.position), mpl.colormaps[VELOCITY_MAP](share)[:, :3]


def _radar_pose(state: StateView, rig: Sensors | None, paths: Drawn | None) -> Pose:
    """Return the pose of the radar whose detections are drawn: that of the paths, else the first of the rig."""
    if paths is not None:
        return paths.world_from_rx
    for mount, pose in sensor_poses(state, rig) if rig is not None else ():
        if mount.kind == "radar":
            return pose
    raise ParameterRangeError(
        "points", "detections", "with the radar's paths, or a rig with a radar", "its pose is needed"
    )
