"""A state of the world from above: ground, lanes, actors with their velocities, and the sensors of a rig."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from scarl_sionna.core.errors import ParameterRangeError, PlacementError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.prompt.axes import axes_or_new
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec

from .ground import View, actor_color, ground_picture
from .view import StateView

if TYPE_CHECKING:
    from matplotlib.axes import Axes

AROUND = 25.0
"""Margin around the actors [m]."""
LEAST_SIDE = 60.0
"""Least side of a plan [m]."""
PIXELS = 900
"""Longer side of the picture of the ground [px]."""
LANE_COLORS = {"drive": "#ffd75e", "cycle": "#7fd6ff", "walk": "#ff9ad5", "parking": "#c8c8c8"}
SENSOR_COLORS = {"radar": "#ff4d4d", "lidar": "#35d07f", "camera": "#4da3ff"}
OTHER_SENSOR = "white"
_ARROWS_APART = 25.0
"""Way between the arrows on a lane [m]."""
_FAN = 12.0
"""Length of a sensor's field of view in the plan [m]."""


class Mounted(Protocol):
    """A sensor of a rig, as far as it is drawn: the rig itself stands above this package."""

    @property
    def name(self) -> str:
        """Name in the rig."""

    @property
    def kind(self) -> str:
        """``"radar"``, ``"camera"``, ``"lidar"`` or another."""

    @property
    def spec(self) -> Spec:
        """What it is."""

    @property
    def vehicle_from_sensor(self) -> Pose:
        """Where it sits."""


class Sensors(Protocol):
    """A rig, as far as it is drawn."""

    @property
    def sensors(self) -> tuple[Any, ...]:
        """Its sensors, each a `Mounted`."""


def plot_state(
    state: StateView, rig: Sensors | None, extent: tuple[float, float, float, float] | None, ax: Axes | None
) -> Axes:
    """Draw a state from above, see `World.plot`."""
    actors = [item for item in state.boxes() if item.is_actor]
    view = _view(state, actors, extent)
    axis = axes_or_new(ax, 8.0, 1.0 + 7.0 * min(max(float(view.half[1] / view.half[0]), 0.35), 1.2))
    west, south = view.centre - view.half
    east, north = view.centre + view.half
    axis.imshow(ground_picture(state, view), extent=(west, east, south, north), interpolation="bilinear", zorder=0)
    _draw_lanes(axis, state)
    for item in actors:
        _draw_actor(axis, item, tuple(value / 255.0 for value in actor_color(item, state.world)))
    if rig is not None:
        _draw_sensors(axis, state, rig)
    axis.set(xlabel="x [m]", ylabel="y [m]", xlim=(west, east), ylim=(south, north))
    axis.set_aspect("equal", adjustable="box")
    axis.set_title(f"{state.world.name}, t = {state.time:g} s")
    return axis


def _view(state: StateView, actors: Iterable[ObjectState], extent: tuple[float, float, float, float] | None) -> View:
    """Return what is shown: as asked for, else around the actors, else the whole scene."""
    if extent is not None:
        west, east, south, north = extent
        if not (east > west and north > south and np.isfinite(extent).all()):
            raise ParameterRangeError("extent", extent, "(west, east, south, north) [m], rising")
        low, high = np.array([west, south]), np.array([east, north])
    else:
        places = np.array([item.world_from_box.position[:2] for item in actors]).reshape(-1, 2)
        if len(places):
            low, high = places.min(axis=0) - AROUND, places.max(axis=0) + AROUND
        else:
            lower, upper = state.world.part_bounds()
            low, high = lower[:, :2].min(axis=0), upper[:, :2].max(axis=0)
    half = (high - low) / 2.0 if extent is not None else np.maximum((high - low) / 2.0, LEAST_SIDE / 2.0)
    return View((low + high) / 2.0, half, PIXELS / (2.0 * float(half.max())))


def _draw_lanes(axis: Axes, state: StateView) -> None:
    """Draw the centre lines of the lanes, with an arrow in the direction of travel, and parking places."""
    network = state.world.document.lanes
    if network is None:
        return
    for lane in network.lanes:
        color = LANE_COLORS[lane.kind]
        axis.plot(
            lane.points[:, 0], lane.points[:, 1], color=color, linewidth=0.9, alpha=0.8, linestyle=(0, (6, 4)), zorder=1
        )
        for start in np.arange(_ARROWS_APART / 2.0, lane.length, _ARROWS_APART):
            tail, head = lane.at([start, min(start + 1.0, lane.length)])
            arrow = {"arrowstyle": "-|>", "color": color, "shrinkA": 0.0, "shrinkB": 0.0, "linewidth": 0.8}
            axis.annotate("", head[:2], tail[:2], arrowprops=arrow, zorder=1, annotation_clip=True)
    for place in network.parking:
        axis.plot(*place.position[:2], marker="s", color=LANE_COLORS["parking"], markersize=3, alpha=0.8, zorder=1)


def _draw_actor(axis: Axes, item: ObjectState, color: tuple[float, ...]) -> None:
    """Draw an actor's box from above, its nose, its velocity over one second, and its name."""
    from matplotlib.patches import Polygon

    size = np.maximum(item.size[:2], 0.7)
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size
    nose = np.array([(0.2, -0.42), (0.46, 0.0), (0.2, 0.42)]) * size
    for shape, face in ((corners, color), (nose, (0.08, 0.09, 0.12))):
        flat = item.world_from_box.apply(np.column_stack([shape, np.zeros(len(shape))]))[:, :2]
        axis.add_patch(Polygon(flat, closed=True, facecolor=face, edgecolor="0.05", linewidth=0.6, zorder=3))
    start = item.world_from_box.position[:2]
    way = item.twist.linear[:2]
    if np.linalg.norm(way) > 0.1:
        axis.annotate(
            "", start + way, start, arrowprops={"arrowstyle": "->", "color": "white", "linewidth": 1.1}, zorder=4
        )
    axis.annotate(
        item.name.replace("_", " "),
        start,
        xytext=(6, 6),
        textcoords="offset points",
        fontsize=7.5,
        color="white",
        zorder=5,
        annotation_clip=True,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": (0, 0, 0, 0.45), "edgecolor": "none"},
    )


def sensor_poses(state: StateView, rig: Sensors) -> list[tuple[Mounted, Pose]]:
    """Return the sensors of a rig on the ego vehicle, and where they stand in the world.

    Raises
    ------
    PlacementError
        If the world has no ego vehicle.
    """
    if state.world.ego is None:
        raise PlacementError(f"world '{state.world.name}' has no ego vehicle that carries the rig; leave the rig out")
    vehicle = state.actor_pose(state.world.ego)
    return [(mount, vehicle.compose(mount.vehicle_from_sensor)) for mount in rig.sensors]


def _draw_sensors(axis: Axes, state: StateView, rig: Sensors) -> None:
    """Draw where sensors stand and the width of their fields of view, one of each kind and place."""
    from matplotlib.patches import Patch, Wedge

    drawn: dict[str, None] = {}
    seen: set[tuple[str, tuple[float, ...]]] = set()
    for mount, pose in sensor_poses(state, rig):
        key = (mount.kind, tuple(np.round([*pose.position, pose.yaw], 3)))
        if key in seen:
            continue
        seen.add(key)
        color = SENSOR_COLORS.get(mount.kind, OTHER_SENSOR)
        drawn[mount.kind] = None
        right, left = _field_of_view(mount.spec)
        yaw = np.degrees(pose.yaw)
        axis.add_patch(
            Wedge(
                tuple(pose.position[:2]),
                _FAN,
                yaw + right,
                yaw + left,
                facecolor=color,
                alpha=0.25,
                edgecolor=color,
                zorder=2,
            )
        )
        axis.plot(*pose.position[:2], marker="o", markersize=3, color=color, zorder=6)
    handles = [Patch(facecolor=SENSOR_COLORS.get(kind, OTHER_SENSOR), label=kind) for kind in drawn]
    axis.legend(handles=handles, loc="upper right", fontsize=8)


def _field_of_view(spec: Spec) -> tuple[float, float]:
    """Return the first and the last azimuth of a sensor's field of view [deg], left positive.

    A narrow fan for other kinds.
    """
    if isinstance(spec, LidarSpec):
        first, last = spec.view_deg[:2]
        return min(first, last), max(first, last)
    half = 10.0
    if isinstance(spec, RadarSpec):
        half = spec.azimuth_fov_deg / 2.0
    elif isinstance(spec, CameraSpec):
        half = float(np.degrees(np.arctan(spec.width / 2.0 / spec.intrinsics[0, 0])))  # of the image without distortion
    return -half, half
