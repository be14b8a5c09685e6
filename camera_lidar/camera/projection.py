"""Projection between `camera_optical` and pixels, and the rays of all pixels. Pure numpy.

:func:`project` and :func:`unproject` are those of a matrix K alone; a camera with its lens has them as
:meth:`CameraSpec.project <scarl_sionna.core.specs.camera.CameraSpec.project>` and ``unproject``.

`camera_optical` has x right, y down, z forward. Pixel (u, v) = (column, row); the centre of the top-left pixel is (0.5,
0.5), so a point at column u falls into the array element ``[floor(v), floor(u)]``.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.specs.camera import CameraSpec, Lens

Array = npt.NDArray[np.float64]

SENSOR_FROM_CAMERA_OPTICAL = CAMERA_OPTICAL_FROM_SENSOR.T
"""Rotation from the optical frame (x right, y down, z forward) to the sensor frame (x forward, y left, z up)."""


def camera_optical_from_world(world_from_sensor: Pose) -> Pose:
    """Return the pose that maps world points into the optical frame of a camera with this mounting."""
    return Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR).compose(world_from_sensor.inverse())


def project(points_camera_optical: npt.ArrayLike, intrinsics: npt.ArrayLike) -> tuple[Array, Array]:
    r"""Project points to pixels of an ideal pinhole camera.

    Parameters
    ----------
    points_camera_optical : array_like of float, shape (..., 3)
        Points in `camera_optical` [m].
    intrinsics : array_like of float, shape (3, 3)
        Matrix K [px].

    Returns
    -------
    pixel : ndarray of float64, shape (..., 2)
        Column and row [px]; NaN for a point in or behind the camera's plane (depth <= 0).
    depth : ndarray of float64, shape (...)
        Distance along the optical axis [m], negative behind the camera.

    Notes
    -----
    .. math:: z \, (u, v, 1)^T = K \, (x, y, z)^T
    """
    points = np.asarray(points_camera_optical, dtype=np.float64)
    depth = points[..., 2]
    homogeneous = points @ np.asarray(intrinsics, dtype=np.float64).T
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel = homogeneous[..., :2] / homogeneous[..., 2:]
    pixel[~(depth > 0.0)] = np.nan
    return pixel, depth


def unproject(pixel: npt.ArrayLike, depth: npt.ArrayLike, intrinsics: npt.ArrayLike) -> Array:
    """Return the points in `camera_optical` [m] of a pinhole's pixels at a depth; the inverse of :func:`project`.

    Parameters
    ----------
    pixel : array_like of float, shape (..., 2)
        Column and row [px].
    depth : array_like of float, shape (...)
        Distance along the optical axis [m].
    intrinsics : array_like of float, shape (3, 3)
        Matrix K [px].

    Returns
    -------
    ndarray of float64, shape (..., 3)
    """
    pixel = np.asarray(pixel, dtype=np.float64)
    inverse = np.linalg.inv(np.asarray(intrinsics, dtype=np.float64))
    homogeneous = np.concatenate([pixel, np.ones((*pixel.shape[:-1], 1))], axis=-1)
    return (homogeneous @ inverse.T) * np.asarray(depth, dtype=np.float64)[..., None]


def pixel_centres(spec: CameraSpec) -> Array:
    """Return column and row of every pixel's centre, row by row [px]: float64, shape (height * width, 2)."""
    column, row = np.meshgrid(np.arange(spec.width) + 0.5, np.arange(spec.height) + 0.5)
    return np.stack([column.ravel(), row.ravel()], axis=-1)


@lru_cache(maxsize=4)
def _rays_of(
    width: int, height: int, lens: Lens, focal_length_px: tuple[float, float], principal_point: tuple[float, float]
) -> Array:
    spec = CameraSpec(
        width=width, height=height, lens=lens, focal_length_px=focal_length_px, principal_point=principal_point
    )
    rays = spec.rays(pixel_centres(spec)) @ SENSOR_FROM_CAMERA_OPTICAL.T
    rays.setflags(write=False)
    return rays


def pixel_rays(spec: CameraSpec) -> Array:
    """Return the unit directions through all pixel centres in the sensor frame.

    Parameters
    ----------
    spec : CameraSpec

    Returns
    -------
    ndarray of float64, shape (height * width, 3)
        Row by row from the top left; x forward, y left, z up; NaN outside of the lens' field. Read-only: cameras of one
        projection share it.
    """
    return _rays_of(*spec.projection_key)
