"""Depth, semantic and instance images from one ray through every pixel's centre, with hit points in float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import SKY

from .projection import pixel_rays


@dataclass(frozen=True, eq=False)
class LabelImages:
    """Label images of one camera, all from the same rays; see :class:`scarl_sionna.core.results.ImageFrame`.

    Attributes
    ----------
    depth : ndarray of float32, shape (height, width)
        Along the optical axis [m]; inf where nothing is hit or beyond ``spec.max_distance``.
    semantic : ndarray of uint8, shape (height, width)
    instance : ndarray of uint16, shape (height, width)
    """

    depth: npt.NDArray[np.float32]
    semantic: npt.NDArray[np.uint8]
    instance: npt.NDArray[np.uint16]


def render_labels(state: Any, spec: CameraSpec, world_from_sensor: Pose) -> LabelImages:
    """Cast a ray through the centre of every pixel and return what it hits first.

    Parameters
    ----------
    state : scarl_sionna.world.WorldState
    spec : CameraSpec
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).

    Returns
    -------
    LabelImages

    Notes
    -----
    One ray a pixel: a pixel belongs wholly to what its centre sees, without blending at edges. *Error* of the depth: that of
    the float32 it is stored in (6e-8 relative), since the hit point is a float64 one.
    """
    directions = world_from_sensor.rotate(pixel_rays(spec))
    hits = state.cast(world_from_sensor.position, directions)
    depth_of_hit = (hits.point - world_from_sensor.position) @ world_from_sensor.rotation[:, 0]
    depth_of_hit[depth_of_hit > spec.max_distance] = np.inf
    num_pixels = spec.height * spec.width
    depth = np.full(num_pixels, np.inf, dtype=np.float32)
    semantic = np.full(num_pixels, SKY, dtype=np.uint8)
    instance = np.zeros(num_pixels, dtype=np.uint16)
    depth[hits.ray] = depth_of_hit
    semantic[hits.ray] = state.world.parts.semantic[hits.part]
    instance[hits.ray] = state.world.parts.instance[hits.part]
    shape = (spec.height, spec.width)
    return LabelImages(depth.reshape(shape), semantic.reshape(shape), instance.reshape(shape))
