"""True boxes of a frame: relative to a pose, whether a point is inside, and how much of a box a camera sees."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame, ImageFrame, ObjectState

Array = npt.NDArray[np.float64]

EGO_OFFSET = 0.5
"""An object whose centre is within this of the vehicle's origin, forward and left, is the vehicle itself [m]."""
OCCLUSION_MARGIN = 0.1
"""A surface hides a box if it is nearer than the box by more than this [m]."""
SURFACE_MARGIN = 0.01
"""A point this far outside of a box counts as on its surface: half of the returns of a flat side are, by rounding [m]."""
_GRID = 96  # at most this many rays a side of a box's bounding rectangle: visibility to about 1 %
_NEAR = 0.05
_WIDEST = 4.0  # tangent of the widest angle off the axis that counts: 76 deg

_CORNERS = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def is_ego(frame: Frame, item: ObjectState) -> bool:
    """Return whether an object of a frame is the vehicle that carries the rig."""
    offset = frame.world_from_vehicle.inverse().apply(item.world_from_box.position)
    return bool(item.is_actor and np.all(np.abs(offset[:2]) < EGO_OFFSET))


def other_objects(frame: Frame) -> list[ObjectState]:
    """Return the objects of a frame without the vehicle that carries the rig."""
    return [item for item in frame.objects if not is_ego(frame, item)]


def corners(item: ObjectState) -> Array:
    """Return the corners of a box, shape (8, 3) [m, world]."""
    return item.world_from_box.apply(_CORNERS * item.size)


def points_inside(item: ObjectState, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which points (N, 3) [m, world] are inside a box or, to within 1 cm, on its surface."""
    local = item.world_from_box.inverse().apply(points)
    return np.all(np.abs(local) <= item.size / 2.0 + SURFACE_MARGIN, axis=-1)


def visible_fraction(item: ObjectState, image: ImageFrame) -> float:
    """Return the part of a box's outline that lies in an image and that nothing nearer hides.

    Parameters
    ----------
    item : ObjectState
    image : ImageFrame
        Its `depth` tells what hides the box; without it only the image's border cuts the box.

    Returns
    -------
    float
        0 to 1. Rays through a grid over the box's bounding rectangle on the plane in front of the camera, also outside of
        the image, are cut with the box: the share of those that hit it and that the image shows with no surface 0.1 m or more
        in front of the box. What is behind the camera's plane does not count.
    """
    camera_from_box = image.world_from_sensor.inverse().compose(item.world_from_box)
    optical = CAMERA_OPTICAL_FROM_SENSOR @ camera_from_box.apply(_CORNERS * item.size).T
    if optical[2].max() < _NEAR:
        return 0.0
    rays = _grid(optical, image.spec)
    enter, leave = _slabs(rays @ CAMERA_OPTICAL_FROM_SENSOR, camera_from_box, item.size / 2.0)
    hit = (enter <= leave) & (leave > _NEAR)
    total = np.count_nonzero(hit)
    if not total:
        return 0.0
    pixel, _ = image.spec.project(rays)
    column, line = np.floor(np.nan_to_num(pixel, nan=-1.0)).astype(int).transpose(2, 0, 1)
    seen = hit & (column >= 0) & (column < image.spec.width) & (line >= 0) & (line < image.spec.height)
    if image.depth is not None:
        column, line = column[seen], line[seen]
        center = image.spec.rays(np.stack([column + 0.5, line + 0.5], axis=-1))  # what the pixel's depth belongs to
        center /= np.where(np.abs(center[:, 2:]) > 1e-9, center[:, 2:], 1e-9)
        near, far = _slabs(center @ CAMERA_OPTICAL_FROM_SENSOR, camera_from_box, item.size / 2.0)
        near = np.where(near <= far, near, enter[seen])
        seen[seen] = image.depth[line, column] >= np.maximum(near, _NEAR) - OCCLUSION_MARGIN
    return float(np.count_nonzero(seen) / total)


def _grid(optical: Array, spec: CameraSpec) -> Array:
    """Return rays with z = 1 over the rectangle around a box's corners (3, 8), shape (num_u, num_v, 3), camera_optical."""
    if optical[2].min() < _NEAR:  # part of the box is behind the camera: its outline has no bounds
        low, high = np.full(2, -_WIDEST), np.full(2, _WIDEST)
    else:
        plane = np.clip(optical[:2] / optical[2], -_WIDEST, _WIDEST)
        low, high = plane.min(axis=1), plane.max(axis=1)
    focal = np.diag(spec.intrinsics)[:2]
    count = np.clip(np.ceil((high - low) * focal).astype(int), 8, _GRID)
    x, y = (a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, count, strict=True))
    return np.stack([*np.meshgrid(x, y, indexing="ij"), np.ones(tuple(count))], axis=-1)


def _slabs(directions: Array, camera_from_box: Pose, half: Array) -> tuple[Array, Array]:
    """Return where rays from the camera enter and leave a box, in multiples of the direction (..., 3), camera axes."""
    box_from_camera = camera_from_box.inverse()
    local = box_from_camera.rotate(directions)
    local = np.where(np.abs(local) < 1e-12, 1e-12, local)
    first = (-half - box_from_camera.position) / local
    second = (half - box_from_camera.position) / local
    return np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
