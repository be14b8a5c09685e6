"""What each camera and lidar of a frame sees of every object: pixels, rectangles, occlusion, truncation, returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import find_objects

from scarl_sionna.core.results import ImageFrame, LidarScan, ObjectState

from .labels import instance_histogram
from .silhouettes import silhouettes

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


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
    Cameras with the same place and projection share their silhouettes, and what the first instance image among them
    shows of an object is part of its silhouette.
    """
    numbers = np.array([item.instance for item in objects], dtype=np.int64)
    out = dict(results)
    cameras: dict[Any, dict[str, dict[str, npt.NDArray[Any]]]] = {}
    for name, result in results.items():
        if isinstance(result, LidarScan):
            count = instance_histogram([result.instance])
            out[name] = replace(result, object_points=count[numbers].astype(np.int32))
        elif isinstance(result, ImageFrame) and objects:
            place = result.world_from_sensor
            key = (place.position.tobytes(), place.quaternion.tobytes(), result.spec.projection_key)
            cameras.setdefault(key, {})[name] = _seen(result, numbers)
    for group in cameras.values():
        image: ImageFrame = results[next(iter(group))]
        nothing: dict[str, npt.NDArray[Any]] = {
            "object_pixels": np.zeros(len(numbers), np.int32),
            "object_visible_box": np.full((len(numbers), 4), np.nan, np.float32),
        }
        seen = next(filter(None, group.values()), nothing)
        known = seen["object_pixels"], seen["object_visible_box"]
        shared = silhouettes(state, objects, image.world_from_sensor, image.spec, *known)
        for name, own in group.items():
            out[name] = replace(
                results[name],
                object_box=shared.box,
                object_occlusion=shared.occlusion,
                object_truncation=shared.truncation,
                **own,
            )
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
