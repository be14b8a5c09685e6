"""What each camera and lidar of a frame sees of every object: pixels, rectangles, occlusion, truncation, returns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import find_objects

from scarl_sionna.core.arrays.rows import row_all, row_norm
from scarl_sionna.core.boxes import CORNERS, WIDEST, rays_over, rectangle, through_box
from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import ImageFrame, LidarScan, ObjectState
from scarl_sionna.core.specs.camera import CameraSpec

from .labels import instance_histogram

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

RAYS_ACROSS = 32
"""At most so many rays along each side of an object's rectangle: a silhouette is known to about 1 %."""
RAYS_LEAST = 6
MAX_LAYERS = 6
"""Surfaces within an object's box that a ray may pass before it is taken to miss the object."""
SMALLEST = 0.5
"""An object whose box has fewer pixels than this is out of sight."""
STEP = 1e-3
"""Behind a surface that hides an object the ray goes on after so much [m]."""


@dataclass(frozen=True, eq=False)
class _Silhouettes:
    """Of each object: rectangle in the image, share hidden and share outside; NaN where there is none."""

    box: npt.NDArray[np.float32]
    occlusion: npt.NDArray[np.float32]
    truncation: npt.NDArray[np.float32]


def add_visibility(state: WorldState, objects: Sequence[ObjectState], results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the results with what each sensor sees of each object, see `ImageFrame` and `LidarScan`.

    Parameters
    ----------
    state : WorldState
    objects : sequence of ObjectState
        Of the frame.
    results : mapping of str to sensor result
        Results of other kinds are returned as they are.

    Notes
    -----
    A silhouette is what rays through a grid over the object's box meet of the object when everything else is passed: a
    ray begins where it enters the box and goes on behind surfaces of others. What the camera's own first hits are along
    the same rays tells what is hidden. Cameras with the same place and projection share their silhouettes.
    """
    known: dict[Any, _Silhouettes] = {}
    numbers = np.array([item.instance for item in objects], dtype=np.int64)
    out = {}
    for name, result in results.items():
        if isinstance(result, LidarScan):
            count = instance_histogram([result.instance])
            result = replace(result, object_points=count[numbers].astype(np.int32))
        elif isinstance(result, ImageFrame) and objects:
            place = result.world_from_sensor
            spec = result.spec
            key = (place.position.tobytes(), place.quaternion.tobytes(), spec.projection_key)
            if key not in known:
                known[key] = _silhouettes(state, objects, place, spec)
            seen = _seen(result, numbers)
            box = known[key].box
            if seen:  # a coarse grid over a large object may end before the last pixel that shows it
                visible = seen["object_visible_box"]
                box = np.concatenate([np.fmin(box[:, :2], visible[:, :2]), np.fmax(box[:, 2:], visible[:, 2:])], axis=1)
            found: dict[str, Any] = {
                "object_box": box,
                "object_occlusion": known[key].occlusion,
                "object_truncation": known[key].truncation,
                **seen,
            }
            result = replace(result, **found)
        out[name] = result
    return out


def _seen(image: ImageFrame, numbers: npt.NDArray[np.int64]) -> dict[str, npt.NDArray[Any]]:
    """Return pixels and rectangle of each instance in an instance image."""
    if image.instance is None:
        return {}
    count = instance_histogram([image.instance])
    slices = find_objects(image.instance, int(numbers.max(initial=1)))
    box = np.full((len(numbers), 4), np.nan, dtype=np.float32)
    for row, number in enumerate(numbers):
        if slices[number - 1] is not None:
            rows, columns = slices[number - 1]
            box[row] = columns.start, rows.start, columns.stop, rows.stop
    return {"object_pixels": count[numbers].astype(np.int32), "object_visible_box": box}


def _silhouettes(state: WorldState, objects: Sequence[ObjectState], place: Pose, spec: CameraSpec) -> _Silhouettes:
    sensor_from_world = place.inverse()
    owner, rays = [], []
    for row, item in enumerate(objects):
        found = _grid(sensor_from_world.compose(item.world_from_tight_box), item.tight_size, spec)
        if found is not None:
            owner.append(np.full(len(found), row))
            rays.append(found)
    count = len(objects)
    box = np.full((count, 4), np.nan, dtype=np.float32)
    occlusion, truncation = np.full(count, np.nan, np.float32), np.full(count, np.nan, np.float32)
    if not rays:
        return _Silhouettes(box, occlusion, truncation)
    which, optical = np.concatenate(owner), np.concatenate(rays)
    pixel, _ = spec.project(optical)
    inside = row_all((pixel >= 0.0) & (pixel < [spec.width, spec.height])) & row_all(np.isfinite(pixel))
    direction = place.rotate(optical @ CAMERA_OPTICAL_FROM_SENSOR)
    direction /= row_norm(direction)[:, None]
    alone = _meets(state, objects, which, place.position, direction)
    first = np.zeros(len(which), dtype=np.int64)
    hits = state.cast(place.position, direction[alone])
    first[np.flatnonzero(alone)[hits.ray]] = state.world.parts.instance[hits.part]
    numbers = np.array([item.instance for item in objects])
    seen = alone & (first == numbers[which])
    whole, there, visible = (
        np.bincount(which[mask], minlength=count) for mask in (alone, alone & inside, seen & inside)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        truncation[:] = 1.0 - there / whole
        occlusion[:] = 1.0 - visible / there
    for row, own in _runs(which):
        if not there[row]:
            continue
        mine = pixel[own][alone[own] & inside[own]]
        half = 0.5 * _pitch(pixel[own])
        low, high = mine.min(axis=0) - half, mine.max(axis=0) + half
        box[row] = *np.maximum(low, 0.0), *np.minimum(high, [spec.width, spec.height])
    return _Silhouettes(box, occlusion, truncation)


def _runs(which: npt.NDArray[np.int64]) -> Iterator[tuple[int, slice]]:
    """Yield each object of the rays, which stand in its order, and where its rays are."""
    starts = np.flatnonzero(np.diff(which, prepend=-1))
    for first, stop in zip(starts.tolist(), [*starts[1:].tolist(), len(which)], strict=True):
        yield int(which[first]), slice(first, stop)


def _pitch(pixel: Array) -> Array:
    """Return the distance of neighbouring rays of a grid [px]."""
    span = np.nanmax(pixel, axis=0) - np.nanmin(pixel, axis=0)
    side = np.sqrt(len(pixel))
    return np.asarray(span / max(side - 1.0, 1.0))


def _grid(camera_from_box: Pose, size: Array, spec: CameraSpec) -> Array | None:
    """Return rays with z = 1 over the rectangle around a box, shape (num_rays, 3), camera_optical.

    None if it is out of sight.
    """
    bounds = rectangle(camera_from_box.apply(CORNERS * size) @ CAMERA_OPTICAL_FROM_SENSOR.T)
    if bounds is None:
        return None
    low, high = bounds
    extent = (high - low) * np.diag(spec.intrinsics)[:2]
    edges = spec.rays(np.array([[0.0, 0.0], [spec.width, spec.height]]))
    limits = np.sort(np.clip(edges[:, :2] / np.maximum(edges[:, 2:], 1e-3), -WIDEST, WIDEST), axis=0)
    if np.prod(extent) < SMALLEST or np.any(high < limits[0]) or np.any(low > limits[1]):
        return None
    side = int(np.clip(np.ceil(extent.max()), RAYS_LEAST, RAYS_ACROSS))
    return rays_over(low, high, (side, side)).reshape(-1, 3)


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
