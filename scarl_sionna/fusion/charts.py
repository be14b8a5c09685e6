"""Flat charts of the directions before a camera, and the rectangle in one that holds a box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_all
from scarl_sionna.core.boxes import CORNERS, WIDEST, through_box
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec, KannalaBrandt

Array = npt.NDArray[np.float64]

_CELLS = 24
"""Along each side of a chart, where a box that is cut by the chart's edge is looked for."""
_POINTS = 33
"""Along each edge of a box."""
_HALVINGS = 14
"""Of the way between two of them, to where the edge leaves a chart."""
_STEP = 1e-4
"""Of a finite difference, in units of the plane before the camera."""


@dataclass(frozen=True, eq=False)
class Chart:
    """A rectangle that shows directions: an image, or what the lens would draw beyond its edges.

    Attributes
    ----------
    low, high : ndarray of float64, shape (2,)
    rays : callable
        Directions (..., 3) [camera_optical], of any length, of points (..., 2); NaN where a point shows nothing.
    place : callable
        Points (..., 2) of directions (..., 3); NaN for one that is not shown. It may lie outside of the rectangle.
    """

    low: Array
    high: Array
    rays: Callable[[Array], Array]
    place: Callable[[Array], Array]

    def shows(self, points: Array) -> npt.NDArray[np.bool_]:
        """Return which points (..., 2) are in the rectangle."""
        return row_all((points >= self.low) & (points < self.high))

    @cached_property
    def probes(self) -> tuple[Array, Array, Array]:
        """Points (num, 2), their rays (num, 3), and how far around one what holds it may reach, (2,).

        A convex body whose edges the chart does not show takes all of its corners, or, where the lens' field ends in
        the chart, whatever part of it.
        """
        corners = np.array([(x, y) for x in (self.low[0], self.high[0]) for y in (self.low[1], self.high[1])])
        cells = grid(self.low, self.high, np.array([_CELLS, _CELLS]))
        if np.isfinite(self.rays(cells)).all():
            return corners, self.rays(corners), np.zeros(2)
        return cells, self.rays(cells), (self.high - self.low) / _CELLS


def image_chart(spec: CameraSpec) -> Chart:
    """Return the image of a camera [px]."""
    return Chart(np.zeros(2), np.array([spec.width, spec.height], float), spec.rays, lambda rays: spec.project(rays)[0])


def whole_chart(spec: CameraSpec) -> Chart:
    """Return what a camera would see without the edges of its image.

    Of a fisheye angles off the axis (x, y) [rad], up to half a turn; of other lenses the plane at z = 1, to `WIDEST`.
    """
    if isinstance(spec.lens, KannalaBrandt):
        return Chart(np.full(2, -np.pi), np.full(2, np.pi), _fisheye_rays, _fisheye_place)
    return Chart(np.full(2, -WIDEST), np.full(2, WIDEST), _plane_rays, _plane_place)


def _plane_rays(points: Array) -> Array:
    return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)


def _plane_place(rays: Array) -> Array:
    depth = np.where(rays[..., 2:] > 1e-9, rays[..., 2:], np.nan)
    return np.asarray(rays[..., :2] / depth)


def _fisheye_rays(points: Array) -> Array:
    angle = np.linalg.norm(points, axis=-1, keepdims=True)
    rays = np.concatenate([points * np.sinc(angle / np.pi), np.cos(angle)], axis=-1)
    return np.where(angle <= np.pi, rays, np.nan)


def _fisheye_place(rays: Array) -> Array:
    across = np.linalg.norm(rays[..., :2], axis=-1, keepdims=True)
    return np.asarray(rays[..., :2] * (np.arctan2(across, rays[..., 2:]) / np.maximum(across, 1e-300)))


def area_of_pixels(whole: Chart, image: Chart, rays: Array) -> Array:
    """Return the area in a whole chart that a pixel has around rays of an image, shape (num_rays,)."""
    at = whole.place(rays)
    corner, right, down = (image.place(whole.rays(at + step)) for step in _STEP * np.array([(0, 0), (1, 0), (0, 1)]))
    right, down = right - corner, down - corner
    pixels = np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(_STEP * _STEP / pixels, nan=0.0, posinf=0.0))


def grid(low: Array, high: Array, count: npt.NDArray[np.int64]) -> Array:
    """Return the middles of the cells of a grid over a rectangle, shape (num_x * num_y, 2)."""
    x, y = (a + (b - a) * (np.arange(n) + 0.5) / n for a, b, n in zip(low, high, count.tolist(), strict=True))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


def bounds(chart: Chart, optical_from_box: Pose, size: Array) -> tuple[Array, Array, bool] | None:
    """Return a rectangle of a chart that holds all that it shows of a box, and whether that is the whole box.

    None if it shows nothing of it.

    Parameters
    ----------
    chart : Chart
    optical_from_box : Pose
        From the box's middle and axes to camera_optical.
    size : ndarray of float64, shape (3,)
        [m]
    """
    edges = _along_edges(optical_from_box.apply(_ENDS * size))
    points = chart.place(edges)
    shown = chart.shows(points)
    if shown.all() and edges[..., 2].min() > 0.0:
        flat = points.reshape(-1, 2)
        return flat.min(axis=0), flat.max(axis=0), True
    cells, rays, pitch = chart.probes
    met = cells[_meets_box(rays, optical_from_box, size)]
    found = [points[shown], _crossings(chart, edges, shown), met - pitch, met + pitch]
    every = np.concatenate(found)
    if not len(every):
        return None
    return np.maximum(every.min(axis=0), chart.low), np.minimum(every.max(axis=0), chart.high), False


def _along_edges(ends: Array) -> Array:
    """Return points along edges (num_edges, 2, 3), at equal angles as seen from the origin: (num_edges, _POINTS, 3)."""
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-9)
    along = along / length[:, None]
    nearest = -np.sum(start * along, axis=1)
    away = np.maximum(np.linalg.norm(start + nearest[:, None] * along, axis=1), 1e-9)
    first, last = np.arctan(-nearest / away), np.arctan((length - nearest) / away)
    angle = first[:, None] + (last - first)[:, None] * np.linspace(0.0, 1.0, _POINTS)
    share = np.clip(nearest[:, None] + away[:, None] * np.tan(angle), 0.0, length[:, None])
    share[:, -1] = length
    return np.asarray(start[:, None] + share[..., None] * along[:, None])


def _crossings(chart: Chart, edges: Array, shown: npt.NDArray[np.bool_]) -> Array:
    """Return where edges (num_edges, num_points, 3) leave what a chart shows of them, shape (num, 2)."""
    edge, point = np.nonzero(shown[:, 1:] != shown[:, :-1])
    before, after = edges[edge, point], edges[edge, point + 1]
    leaves = shown[edge, point][:, None]
    inner, outer = np.where(leaves, before, after), np.where(leaves, after, before)
    for _ in range(_HALVINGS):
        middle = (inner + outer) / 2.0
        is_shown = chart.shows(chart.place(middle))[:, None]
        inner, outer = np.where(is_shown, middle, inner), np.where(is_shown, outer, middle)
    return chart.place(inner)


def _meets_box(rays: Array, optical_from_box: Pose, size: Array) -> npt.NDArray[np.bool_]:
    box_from_optical = optical_from_box.inverse()
    enter, leave = through_box(box_from_optical.position, box_from_optical.rotate(rays), -size / 2.0, size / 2.0)
    return (enter <= leave) & (leave > 0.0)


_ENDS = np.array(
    [(CORNERS[a], CORNERS[b]) for a in range(8) for b in range(a) if np.count_nonzero(CORNERS[a] != CORNERS[b]) == 1]
)
"""Of the 12 edges of a box with sides of 1 about the origin, shape (12, 2, 3)."""
