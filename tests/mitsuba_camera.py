"""Mitsuba's own `perspective` sensor for a pinhole camera: an oracle that shares no ray with the package's cameras."""

from __future__ import annotations

from typing import Any

import numpy as np

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.camera import CameraSpec

_SENSOR_FROM_CAMERA_MITSUBA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Columns: Mitsuba's camera axes (x left, y up, z forward) in the sensor frame (x forward, y left, z up)."""


def perspective_dict(mi: Any, spec: CameraSpec, world_from_sensor: Pose) -> dict[str, Any]:
    """Return the sensor for ``mi.load_dict``; the principal point must be in the middle and the pixels square."""
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = world_from_sensor.rotation @ _SENSOR_FROM_CAMERA_MITSUBA
    world_from_camera[:3, 3] = world_from_sensor.position
    fov = 2.0 * np.degrees(np.arctan(spec.width / 2.0 / spec.intrinsics[0, 0]))
    film = {
        "type": "hdrfilm",
        "width": spec.width,
        "height": spec.height,
        "pixel_format": "rgb",
        "rfilter": {"type": "box"},
    }
    return {
        "type": "perspective",
        "fov": float(fov),
        "fov_axis": "x",
        "near_clip": 0.01,
        "far_clip": 1e6,
        "to_world": mi.ScalarTransform4f(world_from_camera),
        "film": {**film, "component_format": "float32"},
        "sampler": {"type": "multijitter", "sample_count": spec.samples_per_pixel},
    }
