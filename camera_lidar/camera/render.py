"""RGB by path tracing with Mitsuba, through exactly the projection of the label images."""

from __future__ import annotations

from math import isqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.camera_spec import CameraSpec
from scarl_sionna.core.pose import Pose
from scarl_sionna.world import variant

from .tone import linear_to_srgb8

NEAR_CLIP = 0.01
"""Nothing nearer along the optical axis is seen in the RGB image [m]."""
FAR_CLIP = 1e6
"""Nothing farther is seen [m]; the sky has no distance."""

ROULETTE_DEPTH = 3
"""Segments after which a light path ends at random (unbiased Russian roulette). 3 takes a quarter less time than Mitsuba's 5 for
2 % more noise; 2 gains nothing more (docs/camera.md)."""

_SENSOR_FROM_CAMERA_MITSUBA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Columns: Mitsuba's camera axes (x left, y up, z forward) in the sensor frame (x forward, y left, z up)."""


def stratified_samples(samples_per_pixel: int) -> int:
    """Return the number of samples that are really taken: the next full grid of the multi-jittered sampler.

    The grid has floor(sqrt(n)) columns and as many rows as n needs, so squares and most even numbers stay as they are.
    """
    columns = isqrt(samples_per_pixel)
    return columns * -(-samples_per_pixel // columns)


def sensor_dict(spec: CameraSpec, world_from_sensor: Pose) -> dict[str, Any]:
    """Return Mitsuba's `perspective` sensor with the projection of ``spec.intrinsics`` at a pose, for ``mi.load_dict``.

    A horizontal field of view about the middle of the film and square pixels are exactly K with its principal point in the
    middle. The box filter keeps every sample in its own pixel, so that a pixel of the image and of the labels mean the same
    square, and makes the sum over samples independent of the threads: same seed, same bytes.
    """
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = world_from_sensor.rotation @ _SENSOR_FROM_CAMERA_MITSUBA
    world_from_camera[:3, 3] = world_from_sensor.position
    with variant.optical() as mi:
        return {
            "type": "perspective",
            "fov": spec.horizontal_fov_deg,
            "fov_axis": "x",
            "near_clip": NEAR_CLIP,
            "far_clip": FAR_CLIP,
            "to_world": mi.ScalarTransform4f(world_from_camera),
            "film": {
                "type": "hdrfilm",
                "width": spec.width,
                "height": spec.height,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
            "sampler": {"type": "multijitter", "sample_count": stratified_samples(spec.samples_per_pixel)},
        }


def integrator_dict(spec: CameraSpec) -> dict[str, Any]:
    """Return Mitsuba's path tracer with the camera's longest light path, for ``mi.load_dict``."""
    return {"type": "path", "max_depth": spec.max_depth, "rr_depth": ROULETTE_DEPTH}


def render_radiance(
    state: Any, spec: CameraSpec, world_from_sensor: Pose, seed_generator: np.random.Generator
) -> npt.NDArray[np.float32]:
    """Path trace the linear RGB radiance of every pixel.

    Parameters
    ----------
    state : scarl_sionna.world.WorldState
    spec : CameraSpec
        `samples_per_pixel` is rounded up to a full grid (:func:`stratified_samples`); `max_depth` bounds the light path.
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    seed_generator : numpy.random.Generator
        Draws the seed of the sampler: the same generator state gives the same bytes.

    Returns
    -------
    ndarray of float32, shape (height, width, 3)
        Linear RGB (sRGB primaries), in the unit of the scene's emitters.

    Notes
    -----
    The estimate is unbiased but for paths longer than `max_depth`. Its standard deviation falls as n^-1/2 with n samples
    inside smooth areas, and faster at edges (multi-jittered sampling); measured in docs/camera.md.
    """
    seed = int(seed_generator.integers(2**32))
    scene = state.optical_scene()
    with variant.optical() as mi:
        sensor = mi.load_dict(sensor_dict(spec, world_from_sensor))
        integrator = mi.load_dict(integrator_dict(spec))
        image = mi.render(
            scene, sensor=sensor, integrator=integrator, seed=seed, spp=stratified_samples(spec.samples_per_pixel)
        )
        return np.array(image, dtype=np.float32)


def render_rgb(
    state: Any, spec: CameraSpec, world_from_sensor: Pose, seed_generator: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Return the 8-bit sRGB image, shape (height, width, 3), of :func:`render_radiance` at ``spec.exposure``."""
    return linear_to_srgb8(render_radiance(state, spec, world_from_sensor, seed_generator), spec.exposure)
