"""Labels of a frame: what its sensors see of each object."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from scarl_sionna.core.results import ImageFrame, LidarScan, ObjectState


def count_labels(objects: Iterable[ObjectState], results: Mapping[str, Any]) -> tuple[ObjectState, ...]:
    """Return the objects with `num_pixels` and `num_lidar_points` counted over all results.

    Parameters
    ----------
    objects : iterable of ObjectState
    results : mapping of str to sensor result
        Instance images and lidar scans are counted, summed over sensors; others are passed over.
    """
    pixels = instance_histogram(
        r.instance for r in results.values() if isinstance(r, ImageFrame) and r.instance is not None
    )
    points = instance_histogram(r.instance for r in results.values() if isinstance(r, LidarScan))
    return tuple(
        replace(o, num_pixels=int(pixels[o.instance]), num_lidar_points=int(points[o.instance])) for o in objects
    )


def instance_histogram(labels: Iterable[np.ndarray]) -> np.ndarray:
    """Return how often each uint16 instance id occurs, shape (65536,)."""
    total = np.zeros(2**16, dtype=np.int64)
    for instance in labels:
        total += np.bincount(instance.reshape(-1), minlength=total.size)
    return total
