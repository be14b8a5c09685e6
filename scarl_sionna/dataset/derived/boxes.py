"""True boxes of a frame: relative to a pose, whether a point is inside, and how much of a box a camera sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.boxes import CORNERS, NEAR, rays_over, rectangle, through_box
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame, ImageFrame, ObjectState

Array = npt.NDArray[np.float64]

EGO_OFFSET = 0.5
"""An object whose centre is within this of the vehicle's origin, forward and left, is the vehicle itself [m]."""
OCCLUSION_MARGIN = 0.1
"""A surface hides a box if it is nearer than the box by more than this [m]."""
SURFACE_MARGIN = 0.01
"""A point this far outside of a box counts as on its surface: half of the returns of a flat side are, by rounding
[m]."""
MOVING_SPEED = 0.5
"""An object faster than this counts as moving [m/s]."""
_GRID = 96  # at most this many rays a side of a box's bounding rectangle: visibility to about 1 %


def is_ego(frame: Frame, item: ObjectState) -> bool:
    """Return whether an object of a frame is the vehicle that carries the rig."""
    offset = frame.world_from_vehicle.inverse().apply(item.world_from_box.position)
    return bool(item.is_actor and np.all(np.abs(offset[:2]) < EGO_OFFSET))


def other_objects(frame: Frame) -> list[ObjectState]:
    """Return the objects of a frame without the vehicle that carries the rig."""
    return [item for item in frame.objects if not is_ego(frame, item)]


def points_inside(item: ObjectState, points: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return which points (N, 3) [m, world] are inside a box or, to within 1 cm, on its surface."""
    local = item.world_from_box.inverse().apply(points)
    return np.all(np.abs(local) <= item.size / 2.0 + SURFACE_MARGIN, axis=-1)


def nearest_footprint(
    items: Sequence[ObjectState], points: npt.ArrayLike, margin: float = SURFACE_MARGIN
) -> npt.NDArray[np.int64]:
    """Return the object whose box, seen from above, is nearest to each point.

    Height does not count: most automotive radars measure none.

    Parameters
    ----------
    items : sequence of ObjectState
    points : array_like, shape (num_points, 3)
        World [m].
    margin : float
        Farthest from the footprint [m].

    Returns
    -------
    ndarray of int64, shape (num_points,)
        Index into `items`, of the first of those equally near; -1 where none is within the margin.
    """
    places = np.asarray(points, np.float64).reshape(-1, 3)
    nearest, found = np.full(len(places), margin), np.full(len(places), -1)
    for number, item in enumerate(items):
        local = item.world_from_box.inverse().apply(places)[:, :2]
        away = np.linalg.norm(np.maximum(np.abs(local) - item.size[:2] / 2.0, 0.0), axis=1)
        closer = (away < nearest) | ((away == nearest) & (found < 0))
        nearest[closer], found[closer] = away[closer], number
    return found


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
        0 to 1. Rays through a grid over the box's bounding rectangle on the plane in front of the camera, also outside
        of the image, are cut with the box: the share of those that hit it and that the image shows with no surface 0.1
        m or more in front of the box. What is behind the camera's plane does not count.
    """
    camera_from_box = image.world_from_sensor.inverse().compose(item.world_from_box)
    bounds = rectangle(camera_from_box.apply(CORNERS * item.size) @ CAMERA_OPTICAL_FROM_SENSOR.T)
    if bounds is None:
        return 0.0
    extent = (bounds[1] - bounds[0]) * np.diag(image.spec.intrinsics)[:2]
    across, down = np.clip(np.ceil(extent).astype(int), 8, _GRID).tolist()
    rays = rays_over(*bounds, (across, down))
    enter, leave = _through(rays @ CAMERA_OPTICAL_FROM_SENSOR, camera_from_box, item.size / 2.0)
    hit = (enter <= leave) & (leave > NEAR)
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
        near, far = _through(center @ CAMERA_OPTICAL_FROM_SENSOR, camera_from_box, item.size / 2.0)
        near = np.where(near <= far, near, enter[seen])
        seen[seen] = image.depth[line, column] >= np.maximum(near, NEAR) - OCCLUSION_MARGIN
    return float(np.count_nonzero(seen) / total)


def _through(directions: Array, camera_from_box: Pose, half: Array) -> tuple[Array, Array]:
    """Return where rays from the camera enter and leave a box, in multiples of the direction (..., 3), camera axes."""
    box_from_camera = camera_from_box.inverse()
    return through_box(box_from_camera.position, box_from_camera.rotate(directions), -half, half)
