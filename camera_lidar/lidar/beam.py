"""The Gaussian beam of a lidar: its radius, and rays over its footprint."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lidar.spec import LidarSpec

Array = npt.NDArray[np.float64]

_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))


def beam_radius(spec: LidarSpec, distance: npt.ArrayLike) -> Array:
    r"""Return the radius of the beam to 1/e2 of its intensity [m] at distances [m], any shape.

    Notes
    -----
    .. math:: w(R)^2 = (D/2)^2 + (\Theta R / 2)^2

    which is the Gaussian beam with its waist at the lens where the divergence is the diffraction limit.
    """
    distance = np.asarray(distance, dtype=np.float64)
    return np.hypot(spec.aperture_diameter / 2.0, spec.divergence / 2.0 * distance)


@lru_cache(maxsize=8)
def footprint(sub_rays: int) -> Array:
    """Return where rays of equal power cross a Gaussian beam, in units of its 1/e2 radius, shape (sub_rays, 2).

    A sunflower: radius by the inverse of the enclosed power ``1 - exp(-2 r^2)`` at the middle of each share, angle by
    golden steps; then centred and, from 3 rays on, stretched so that the second moments are those of the beam, 1/4. One
    ray is the axis.

    The enclosed power is that of a Gaussian beam by definition; the even layout is our own choice.
    """
    index = np.arange(sub_rays)
    radius = np.sqrt(-0.5 * np.log(1.0 - (index + 0.5) / sub_rays))
    if sub_rays == 1:
        radius = np.zeros(1)
    angle = index * _GOLDEN_ANGLE
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    points -= points.mean(axis=0)
    if sub_rays >= 3:
        value, axes = np.linalg.eigh(points.T @ points / sub_rays)
        points = points @ (axes * (0.5 / np.sqrt(value))) @ axes.T
    points.setflags(write=False)
    return points


@lru_cache(maxsize=8)
def widest_gap(sub_rays: int) -> float:
    """Return the widest gap between neighbouring rays of a footprint, in units of the beam's radius.

    It is seen along any line.

    Exact geometry.
    """
    points, angle = footprint(sub_rays), np.linspace(0.0, np.pi, 180)
    along = np.sort(points @ np.stack([np.cos(angle), np.sin(angle)]), axis=0)
    return float(np.diff(along, axis=0).max(initial=0.0))


def sub_directions(spec: LidarSpec, directions: Array) -> Array:
    """Return the directions of all rays of each shot, shape (num_shots, sub_rays, 3), from those of the axes.

    Unit vectors, both. *Error*: rays leave from one point, so the footprint is short of the aperture's radius at the
    sensor itself.

    Exact geometry.
    """
    offsets = footprint(spec.sub_rays) * (spec.divergence / 2.0)
    vertical = np.abs(directions[:, 2:]) > 0.9
    helper = np.where(vertical, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    across = np.cross(helper, directions)
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    upward = np.cross(directions, across)
    rays = directions[:, None, :] + offsets[:, :1] * across[:, None, :] + offsets[:, 1:] * upward[:, None, :]
    return rays / np.linalg.norm(rays, axis=-1, keepdims=True)
