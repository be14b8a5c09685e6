"""Silhouettes of objects before a camera, everything else passed: their rectangles, and shares hidden and outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_any, row_norm
from scarl_sionna.core.boxes import through_box
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import ObjectState
from scarl_sionna.core.specs.camera import CameraSpec

from .charts import Chart, area_of_pixels, bounds, grid, image_chart, whole_chart

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

RAYS_ACROSS = 32
"""At most so many rays along each side of an object's rectangle: a silhouette is known to about 1 %."""
RAYS_LEAST = 6
MAX_LAYERS = 6
"""Surfaces within an object's box that a ray may pass before it is taken to miss the object."""
SMALLEST = 0.5
"""An object whose box has fewer pixels than this, and no pixel that shows it, is out of sight."""
STEP = 1e-3
"""Behind a surface that hides an object the ray goes on after so much [m]."""
SHARP = 0.2
"""Sides of a silhouette's rectangle are looked for until they are between lines so near to each other [px]."""
_BETWEEN = np.array([0.25, 0.5, 0.75])
_TO_END = np.array([1.0 / 3.0, 2.0 / 3.0, 1.0])
"""Where a side is looked for, from the last ray that meets the object: to what holds it, or to the end of the image."""


@dataclass(frozen=True, eq=False)
class Silhouettes:
    """Of each object: rectangle in the image [px], share hidden and share outside; NaN where there is none."""

    box: npt.NDArray[np.float32]
    occlusion: npt.NDArray[np.float32]
    truncation: npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Eye:
    """Who looks at what."""

    state: WorldState
    objects: Sequence[ObjectState]
    place: Pose
    image: Chart

    def directions(self, optical: Array) -> Array:
        """Return unit vectors of rays (num_rays, 3) in the world."""
        rays = self.place.rotate(optical @ CAMERA_OPTICAL_FROM_SENSOR)
        return np.asarray(rays / row_norm(rays)[:, None])

    def meets(self, which: npt.NDArray[np.int64], optical: Array) -> Flags:
        """Return which rays meet the object that they are for, whatever stands before it."""
        return _meets(self.state, self.objects, which, self.place.position, self.directions(optical))


def silhouettes(
    state: WorldState,
    objects: Sequence[ObjectState],
    place: Pose,
    spec: CameraSpec,
    pixels: npt.NDArray[np.int32],
    visible_box: npt.NDArray[np.float32],
) -> Silhouettes:
    """Return the silhouettes of objects.

    Parameters
    ----------
    state : WorldState
    objects : sequence of ObjectState
    place : Pose
        Of the camera in the world.
    spec : CameraSpec
    pixels : ndarray of int32, shape (num_objects,)
        How many pixels are known to show each object; 0 where none is known to.
    visible_box : ndarray of float32, shape (num_objects, 4)
        Rectangles around those pixels; NaN where there is none.

    Notes
    -----
    Rays through a grid over the part of the image where an object's box is, each from where it enters the box and on
    behind surfaces of others, tell what of the image its silhouette takes; what the camera's own first hits are along
    the same rays tells what is hidden. Sides of its rectangle are then looked for by halves. Of an object that the
    image cuts, rays beyond the image tell what is outside of it, see `whole_chart`.
    """
    eye = _Eye(state, objects, place, image_chart(spec))
    whole = whole_chart(spec)
    count = len(objects)
    low, high, pitch = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros((count, 2))
    cell = np.zeros(count)  # area of a cell of a grid beyond the image
    inner_points, outer_points = list[tuple[int, Array]](), list[tuple[int, Array]]()
    sensor_from_world = place.inverse()
    for row, item in enumerate(objects):
        box = _OPTICAL.compose(sensor_from_world.compose(item.world_from_tight_box))
        found = bounds(eye.image, box, item.tight_size)
        if found is None or (np.prod(found[1] - found[0]) < SMALLEST and not pixels[row]):
            continue
        low[row], high[row], is_whole = found
        side = np.clip(np.ceil(high[row] - low[row]), RAYS_LEAST, RAYS_ACROSS).astype(np.int64)
        pitch[row] = (high[row] - low[row]) / side
        inner_points.append((row, grid(low[row], high[row], side)))
        if not is_whole and (beyond := bounds(whole, box, item.tight_size)) is not None:
            outer_points.append((row, grid(*beyond[:2], np.full(2, RAYS_ACROSS))))
            cell[row] = np.prod((beyond[1] - beyond[0]) / RAYS_ACROSS)
    missing = np.full(count, np.nan, np.float32)
    out = Silhouettes(np.full((count, 4), np.nan, np.float32), missing, missing.copy())
    if not inner_points:
        return out
    which, points = _together(inner_points)
    rays = eye.image.rays(points)
    alone = eye.meets(which, rays)
    first = np.zeros(len(which), dtype=np.int64)
    hits = state.cast(place.position, eye.directions(rays[alone]))
    first[np.flatnonzero(alone)[hits.ray]] = state.world.parts.instance[hits.part]
    seen = alone & (first == np.array([item.instance for item in objects])[which])
    there, visible = (np.bincount(which[mask], minlength=count) for mask in (alone, seen))
    area = np.bincount(which[alone], area_of_pixels(whole, eye.image, rays[alone]), count)
    middle = area_of_pixels(whole, eye.image, eye.image.rays((low + high) / 2.0))
    outside = _outside(eye, whole, outer_points, count) * cell
    shown = there * np.prod(pitch, axis=1)  # [px]
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.where((visible == 0) & (pixels > 0), np.fmin(pixels / shown, 1.0), visible / there)
        inside = np.where(there > 0, area / there, middle) * np.maximum(shown, pixels)
        out.occlusion[:] = 1.0 - share
        out.truncation[:] = np.where(inside > 0.0, outside / (inside + outside), np.nan)
    open_rows = ~((visible == there) & (pixels > 0))  # where nothing hides it, the pixels tell all
    _add_boxes(out.box, eye, (which[alone], points[alone]), (low, high, open_rows))
    out.box[:, :2] = np.fmin(out.box[:, :2], visible_box[:, :2])
    out.box[:, 2:] = np.fmax(out.box[:, 2:], visible_box[:, 2:])
    return out


_OPTICAL = Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR)


def _together(points: Sequence[tuple[int, Array]]) -> tuple[npt.NDArray[np.int64], Array]:
    """Return the objects of points, and the points, in one array each."""
    which = np.repeat([row for row, _ in points], [len(own) for _, own in points])
    return which, np.concatenate([own for _, own in points])


def _outside(eye: _Eye, whole: Chart, points: Sequence[tuple[int, Array]], count: int) -> npt.NDArray[np.int64]:
    """Return how many points of a whole chart show their object and are not in the image, by object."""
    if not points:
        return np.zeros(count, dtype=np.int64)
    which, at = _together(points)
    rays = whole.rays(at)
    beyond = ~eye.image.shows(eye.image.place(rays)) & np.isfinite(rays[:, 2])
    met = eye.meets(which[beyond], rays[beyond])
    return np.bincount(which[beyond][met], minlength=count)


def _add_boxes(
    box: npt.NDArray[np.float32],
    eye: _Eye,
    met: tuple[npt.NDArray[np.int64], Array],
    known: tuple[Array, Array, Flags],
) -> None:
    """Set the rectangles of silhouettes.

    Parameters
    ----------
    box : ndarray of float32, shape (num_objects, 4)
        To be set.
    eye : _Eye
    met : (ndarray of int64, ndarray of float64)
        Objects, in their order, and points of the image (num_points, 2) that show them.
    known : two of ndarray of float64, shape (num_objects, 2), and ndarray of bool, shape (num_objects,)
        Corners of a rectangle outside of which an object is not [px], and of which objects the sides are looked for.
    """
    low, high, open_rows = known
    inner = np.full((len(box), 4), np.nan)
    for number, own in _runs(met[0]):
        inner[number] = *met[1][own].min(axis=0), *met[1][own].max(axis=0)
    outer = np.where(open_rows[:, None], np.concatenate([low, high], axis=1), inner)
    ends = np.concatenate([eye.image.low, eye.image.high])
    share = np.linspace(0.0, 1.0, RAYS_ACROSS)
    while len(open_sides := np.argwhere(np.abs(outer - inner) > SHARP)):
        row, side = open_sides[:, 0], open_sides[:, 1]
        near, far = inner[row, side], outer[row, side]
        at = near[:, None] + (far - near)[:, None] * np.where((far == ends[side])[:, None], _TO_END, _BETWEEN)
        across = 1 - side % 2
        first, last = outer[row, across][:, None], outer[row, across + 2][:, None]
        points = np.empty((*at.shape, RAYS_ACROSS, 2))
        points[np.arange(len(row)), ..., side % 2] = at[..., None]
        points[np.arange(len(row)), ..., across] = (first + (last - first) * share)[:, None]
        found = eye.meets(np.repeat(row, at.shape[1] * RAYS_ACROSS), eye.image.rays(points.reshape(-1, 2)))
        is_met = row_any(found.reshape(*at.shape, RAYS_ACROSS))
        last_met = np.where(row_any(is_met), at.shape[1] - 1 - np.argmax(is_met[:, ::-1], axis=1), -1)
        steps = np.concatenate([near[:, None], at, far[:, None]], axis=1)
        inner[row, side] = steps[np.arange(len(row)), last_met + 1]
        outer[row, side] = steps[np.arange(len(row)), last_met + 2]
    box[:] = (inner + outer) / 2.0


def _runs(which: npt.NDArray[np.int64]) -> Iterator[tuple[int, slice]]:
    """Yield each object of the rays, which stand in its order, and where its rays are."""
    starts = np.flatnonzero(np.diff(which, prepend=-1))
    for first, stop in zip(starts.tolist(), [*starts[1:].tolist(), len(which)], strict=True):
        yield int(which[first]), slice(first, stop)


def _meets(
    state: WorldState, objects: Sequence[ObjectState], which: npt.NDArray[np.int64], origin: Array, direction: Array
) -> npt.NDArray[np.bool_]:
    """Return which rays meet their object, whatever stands before it."""
    enter, leave = np.empty(len(which)), np.empty(len(which))
    for row, mine in _runs(which):
        half = objects[row].tight_size / 2.0 + STEP
        box_from_world = objects[row].world_from_tight_box.inverse()
        enter[mine], leave[mine] = through_box(
            box_from_world.apply(origin), box_from_world.rotate(direction[mine]), -half, half
        )
    numbers = np.array([item.instance for item in objects])[which]
    begin = np.maximum(enter - STEP, 0.0)
    met = np.zeros(len(which), dtype=bool)
    active = np.flatnonzero((enter <= leave) & (leave > 0.0))
    for _ in range(MAX_LAYERS):
        if not len(active):
            break
        hits = state.cast(origin + begin[active, None] * direction[active], direction[active])
        rays = active[hits.ray]
        along = begin[rays] + hits.distance
        own = state.world.parts.instance[hits.part] == numbers[rays]
        within = along <= leave[rays] + STEP
        met[rays[own & within]] = True
        onward = within & ~own
        active = rays[onward]
        begin[active] = along[onward] + STEP
    return met
