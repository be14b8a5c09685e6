"""Label images from one ray through every pixel's centre, with hit points in float64."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.semantics import SKY
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.engine.world import WorldState

from .motion import shifted_sensor, shifted_state
from .projection import camera_optical_from_world, pixel_centres, pixel_rays
from .shutter import bands

LABEL_NAMES = ("depth", "semantic", "instance", "normal", "flow")


@dataclass(frozen=True, eq=False)
class LabelImages:
    """Label images of one camera, all from the same rays; see :class:`scarl_sionna.core.results.ImageFrame`.

    Attributes
    ----------
    depth : ndarray of float32, shape (height, width)
        Along the optical axis [m]; inf where nothing is hit or beyond ``spec.max_distance``.
    semantic : ndarray of uint8, shape (height, width)
    instance : ndarray of uint16, shape (height, width)
    normal : ndarray of float32, shape (height, width, 3), or None
    flow : ndarray of float32, shape (height, width, 2), or None
        [px]
    """

    depth: npt.NDArray[np.float32]
    semantic: npt.NDArray[np.uint8]
    instance: npt.NDArray[np.uint16]
    normal: npt.NDArray[np.float32] | None = None
    flow: npt.NDArray[np.float32] | None = None


@dataclass(frozen=True, eq=False)
class PixelHits:
    """What the rays through the pixel centres hit; one row a hit.

    Attributes
    ----------
    pixel : ndarray of int64, shape (num_hits,)
        row * width + column.
    point, normal : ndarray of float64, shape (num_hits, 3)
        [world].
    part : ndarray of int32, shape (num_hits,)
    """

    pixel: npt.NDArray[np.int64]
    point: npt.NDArray[np.float64]
    normal: npt.NDArray[np.float64]
    part: npt.NDArray[np.int32]
    face: npt.NDArray[np.int64]


_LAST_CAST: WeakKeyDictionary[Any, tuple[tuple[object, ...], PixelHits]] = WeakKeyDictionary()
"""The last cast of a state: the cameras of one suite ask for the same rays one after the other."""


def cast_pixels(state: WorldState, spec: CameraSpec, world_from_sensor: Pose) -> PixelHits:
    """Cast a ray through the centre of every pixel that the lens shows.

    The hits of the last camera of a state are kept: one of the same place and projection gets them at once.
    """
    rays = pixel_rays(spec)
    key = (spec.projection_key, world_from_sensor.position.tobytes(), world_from_sensor.quaternion.tobytes())
    kept = _LAST_CAST.get(state)
    if kept is not None and kept[0] == key:
        return kept[1]
    seen = None if np.isfinite(rays[:, 0]).all() else np.flatnonzero(np.isfinite(rays[:, 0]))
    hits = state.cast(world_from_sensor.position, world_from_sensor.rotate(rays if seen is None else rays[seen]))
    found = PixelHits(hits.ray if seen is None else seen[hits.ray], hits.point, hits.normal, hits.part, hits.face)
    _LAST_CAST[state] = (key, found)
    return found


def render_labels(
    state: WorldState,
    spec: CameraSpec,
    world_from_sensor: Pose,
    sensor_twist: Twist | None = None,
    images: Collection[str] = ("depth", "semantic", "instance"),
) -> LabelImages:
    """Cast a ray through the centre of every pixel and return what it hits first.

    Parameters
    ----------
    state : scarl_sionna.engine.world.WorldState
    spec : CameraSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    sensor_twist : Twist, optional
        Its velocity, for the flow and a rolling shutter; default: at rest.
    images : collection of str
        ``"normal"`` and ``"flow"`` are made only when named here; the others always.

    Returns
    -------
    LabelImages

    Notes
    -----
    One ray a pixel: a pixel belongs wholly to what its centre sees, without blending at edges. *Error* of the depth:
    that of the float32 it is stored in (6e-8 relative), since the hit point is a float64 one.
    """
    if spec.readout_time > 0.0:
        return _rolling_labels(state, spec, world_from_sensor, sensor_twist or Twist(), images)
    hits = cast_pixels(state, spec, world_from_sensor)
    depth_of_hit = (hits.point - world_from_sensor.position) @ world_from_sensor.rotation[:, 0]
    depth_of_hit[depth_of_hit > spec.max_distance] = np.inf
    num_pixels = spec.height * spec.width
    depth = np.full(num_pixels, np.inf, dtype=np.float32)
    semantic = np.full(num_pixels, SKY, dtype=np.uint8)
    instance = np.zeros(num_pixels, dtype=np.uint16)
    depth[hits.pixel] = depth_of_hit
    semantic[hits.pixel] = state.world.parts.semantic[hits.part]
    instance[hits.pixel] = state.world.parts.instance[hits.part]
    shape = (spec.height, spec.width)
    normal: npt.NDArray[np.float32] | None = None
    flow: npt.NDArray[np.float32] | None = None
    if "normal" in images:
        normal = np.zeros((*shape, 3), dtype=np.float32)
        normal.reshape(-1, 3)[hits.pixel] = hits.normal @ world_from_sensor.rotation
    if "flow" in images:
        flow = np.full((*shape, 2), np.nan, dtype=np.float32)
        flow.reshape(-1, 2)[hits.pixel] = _flow(state, spec, world_from_sensor, sensor_twist or Twist(), hits)
    return LabelImages(depth.reshape(shape), semantic.reshape(shape), instance.reshape(shape), normal, flow)


def _rolling_labels(
    state: WorldState, spec: CameraSpec, world_from_sensor: Pose, sensor_twist: Twist, images: Collection[str]
) -> LabelImages:
    """Return the labels of each band of rows at its own instant."""
    parts = [
        render_labels(band.state, band.spec, band.pose, sensor_twist, images)
        for band in bands(state, spec, world_from_sensor, sensor_twist)
    ]
    columns = {name: [getattr(part, name) for part in parts] for name in LABEL_NAMES}
    return LabelImages(**{name: np.concatenate(rows) for name, rows in columns.items() if rows[0] is not None})


def _flow(
    state: WorldState, spec: CameraSpec, world_from_sensor: Pose, sensor_twist: Twist, hits: PixelHits
) -> npt.NDArray[np.float64]:
    """Return how far [px] the surface point of every hit moves in the image within ``spec.flow_interval``.

    Hidden or not: a point that something else covers later still has its flow.
    """
    later = shifted_state(state, spec.flow_interval)
    points = hits.point.copy()
    for part in np.unique(hits.part[state.world.parts.actor[hits.part] >= 0]).tolist():
        rows = hits.part == part
        motion = later.part_pose(part).compose(state.part_pose(part).inverse())
        points[rows] = motion.apply(points[rows])
    bends, moved = state.carried(hits.face, hits.point, later)
    points[bends] = moved
    optical_from_world = camera_optical_from_world(shifted_sensor(state, later, world_from_sensor, sensor_twist))
    pixel, _ = spec.project(optical_from_world.apply(points))
    return pixel - pixel_centres(spec)[hits.pixel]
