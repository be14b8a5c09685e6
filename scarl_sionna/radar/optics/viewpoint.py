"""Where the two ends of tubes stand, and what they look at."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_any, row_max, row_norm
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.rays.face_planes import FaceTable

from .tubes.screens import FieldOfView, Window
from .tubes.trace import GRAZING
from .tubes.tube_shape import middle

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

WIDE_FACE = 0.5
"""Faces that look wider than this [rad] are never sorted out before they are cut into patches, which are tested alone:
decides the time, not the accuracy."""

_ROUNDING = 1e-9
"""Of angles [rad]."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where a transmitter or receiver stands, how it moves and what it looks at.

    Attributes
    ----------
    pose : Pose
        world_from_radar.
    velocity : ndarray of float64, shape (3,)
        [m/s, world].
    azimuth_fov, elevation_fov : float
        [rad].
    window : Window, optional
        Of a station that is an image: the plane of the mirror, through which it looks.
    passing : ndarray of float64, shape (3,), optional
        Of an image: its velocity as far as the size of patches goes [m/s]; `velocity` if left out.
    axes : ndarray of float64, shape (3, 3), optional
        Of an image: the mirrored axes of the radar, as columns, in which its field of view is meant; those of `pose` if
        left out.
    """

    pose: Pose
    velocity: Array
    azimuth_fov: float
    elevation_fov: float
    window: Window | None = None
    axes: Array | None = None
    passing: Array | None = None

    @property
    def drift(self) -> Array:
        """Velocity that counts for the size of patches, shape (3,) [m/s]."""
        return self.velocity if self.passing is None else self.passing

    @property
    def key(self) -> Hashable:
        """What a tracing follows from: tubes from stations with equal keys are the same."""
        place = self.pose.position, self._axes, self.drift
        return *(column.tobytes() for column in place), self.azimuth_fov, self.elevation_fov, id(self.window)

    @property
    def _axes(self) -> Array:
        return self.pose.rotation if self.axes is None else self.axes

    @property
    def view(self) -> FieldOfView:
        """What it looks at."""
        return FieldOfView(self._axes, self.azimuth_fov, self.elevation_fov)

    @classmethod
    def of(cls, radar: RadarSpec, pose: Pose, velocity: Array) -> Viewpoint:
        """Return the station of a radar."""
        return cls(pose, velocity, np.radians(radar.azimuth_fov_deg), np.radians(radar.elevation_fov_deg))

    def outside(self, points: Array) -> tuple[Array, Array, Array]:
        """Return by how much points are outside of the view in azimuth and elevation [rad], and their distance [m]."""
        local = (points - self.pose.position) @ self._axes
        distance = np.sqrt(np.einsum("ij,ij->i", local, local))
        azimuth = np.abs(np.arctan2(local[:, 1], local[:, 0])) - self.azimuth_fov / 2.0
        sine = np.divide(local[:, 2], distance, out=np.zeros_like(distance), where=distance > 0.0)
        elevation = np.abs(np.arcsin(np.clip(sine, -1.0, 1.0))) - self.elevation_fov / 2.0
        return azimuth, elevation, distance

    def sees(self, points: Array) -> Mask:
        """Return whether points are in the field of view."""
        local = (points - self.pose.position) @ self._axes
        flat = local[:, 0] ** 2 + local[:, 1] ** 2
        ahead = local[:, 0] >= np.cos(self.azimuth_fov / 2.0) * np.sqrt(flat)
        return ahead & (np.abs(local[:, 2]) <= np.sin(self.elevation_fov / 2.0) * np.sqrt(flat + local[:, 2] ** 2))

    def touches(self, corners: Array) -> Mask:
        """Return whether a corner or the middle of triangles (n, 3, 3) is in the field of view, shape (n,)."""
        points = np.concatenate([corners, middle(corners)[:, None]], axis=1)
        return row_any(self.sees(points.reshape(-1, 3)).reshape(-1, 4))

    def may_hold(self, center: Array, radius: Array) -> Mask:
        """Return of which balls a part may be in the field of view, shape (n,): of no other ball is there any.

        Parameters
        ----------
        center : ndarray of float64, shape (n, 3)
            [m, world].
        radius : ndarray of float64, shape (n,)
            [m].
        """
        azimuth, elevation, distance = self.outside(center)
        width = np.arcsin(np.minimum(radius / np.maximum(distance, 1e-9), 1.0))
        high = elevation + self.elevation_fov / 2.0
        over_pole = width + high >= np.pi / 2.0
        cosine = np.cos(np.where(over_pole, 0.0, high))
        across = np.where(over_pole, np.pi, np.arcsin(np.minimum(np.sin(width) / cosine, 1.0)))
        return np.asarray((azimuth <= across + _ROUNDING) & (elevation <= width + _ROUNDING))

    def may_see(self, faces: FaceTable, rows: Index, reach: float) -> Mask:
        """Return of which of some faces a part may be in the field of view and in reach, and that are not edge-on."""
        corners, normal, offset = (
            column[rows] for column in (faces.triangles.corners, faces.triangles.normal, faces.triangles.offset)
        )
        center = middle(corners)
        arm = corners - center[:, None]
        radius = np.sqrt(row_max(np.einsum("nij,nij->ni", arm, arm)))
        distance = row_norm(center - self.pose.position)
        inside = self.may_hold(center, radius) | (radius > np.sin(WIDE_FACE) * distance)
        height = np.abs(normal @ self.pose.position - offset)
        return inside & (distance - radius < reach) & (height > GRAZING * distance) & row_any(normal)
