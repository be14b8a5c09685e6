"""Rigid poses and the frames of the project.

A pose named `world_from_radar` maps points of the radar's frame into the world:
``p_world = world_from_radar @ p_radar``. Frames: `vehicle`, `radar`, `lidar`, `sensor` have x forward, y left, z up;
`camera_optical` has x right, y down, z forward. Quaternions are [w, x, y, z]; lengths are metres; everything is
float64.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .errors import ParameterRangeError
from .prompt.arguments import check_radians, numbers
from .prompt.describe import Described, Row, vector

Array = npt.NDArray[np.float64]

CAMERA_OPTICAL_FROM_SENSOR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""Rotation from a sensor frame (x forward, y left, z up) to the optical frame (x right, y down, z forward)."""


_EULER = "Euler angles [rad]: ss.Pose.from_euler(position, yaw, pitch, roll)"


@dataclass(frozen=True, eq=False, repr=False)
class Pose(Described):
    """A rigid transformation: rotation, then translation.

    Parameters
    ----------
    position : array_like of float, shape (3,)
        Origin of the source frame in the target frame [m].
    quaternion : array_like of float, shape (4,)
        Rotation [w, x, y, z]; normalised on construction.

    Raises
    ------
    ParameterRangeError
        If the position is not three finite numbers, or the quaternion not four with a length above zero.
    """

    position: Array = field(default_factory=lambda: np.zeros(3))
    quaternion: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))

    if TYPE_CHECKING:  # lists are taken, arrays are kept

        def __init__(self, position: npt.ArrayLike = ..., quaternion: npt.ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        position = numbers("position", self.position, 3, "three finite coordinates [m]", "write Pose([x, y, z])")
        allowed = "four finite numbers [w, x, y, z], not all zero"
        quaternion = numbers("quaternion", self.quaternion, 4, allowed, _EULER)
        norm = math.sqrt(quaternion @ quaternion)
        if not math.isfinite(norm) or norm < 1e-12:
            raise ParameterRangeError("quaternion", self.quaternion, allowed, _EULER)
        self._take(position, quaternion, norm)

    def _take(self, position: Array, quaternion: Array, norm: float) -> None:
        """Keep arrays that nobody else has; `norm` is the length of the quaternion."""
        if abs(norm - 1.0) > 1e-15:  # not twice: a pose read from a file keeps its last bit
            quaternion = quaternion / norm
        position.setflags(write=False)
        quaternion.setflags(write=False)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "quaternion", quaternion)

    @classmethod
    def _made(cls, position: Array, quaternion: Array) -> Pose:
        """Return the pose of new arrays that follow from other poses: they need no check."""
        pose = object.__new__(cls)
        pose._take(position, quaternion, math.sqrt(quaternion @ quaternion))
        return pose

    @classmethod
    def from_rotation(cls, position: npt.ArrayLike, rotation: npt.ArrayLike) -> Pose:
        """Return the pose with a 3 x 3 rotation matrix.

        Parameters
        ----------
        position : array_like of float, shape (3,)
            Origin of the source frame in the target frame [m].
        rotation : array_like of float, shape (3, 3)
            Rotation matrix: its columns are the axes of the source frame in the target frame.
        """
        from scipy.spatial.transform import Rotation  # 0.2 s, which a command line need not wait for

        quaternion = Rotation.from_matrix(np.asarray(rotation, dtype=np.float64)).as_quat()  # x, y, z, w
        return cls(np.asarray(position, dtype=np.float64), np.roll(quaternion, 1))

    @classmethod
    def from_euler(cls, position: npt.ArrayLike, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Pose:
        """Return the pose with intrinsic yaw (about z), pitch (about y, positive = nose down) and roll (about x) [rad].

        Parameters
        ----------
        position : array_like of float, shape (3,)
            Origin of the source frame in the target frame [m].
        yaw, pitch, roll : float
            [rad].

        Raises
        ------
        ParameterRangeError
            If an angle is larger than two turns: it was written in degrees.
        """
        for name, angle in (("yaw", yaw), ("pitch", pitch), ("roll", roll)):
            check_radians(name, angle)
        return cls._of_angles(position, yaw, pitch, roll)

    @classmethod
    def from_heading(cls, position: npt.ArrayLike, heading: float) -> Pose:
        """Return an upright pose whose x axis points along a heading [rad], after any number of turns.

        Parameters
        ----------
        position : array_like of float, shape (3,)
            Origin of the source frame in the target frame [m].
        heading : float
            From +x towards +y [rad].
        """
        return cls._of_angles(position, heading, 0.0, 0.0)

    @classmethod
    def _of_angles(cls, position: npt.ArrayLike, yaw: float, pitch: float, roll: float) -> Pose:
        cy, cp, cr = (math.cos(angle / 2.0) for angle in (yaw, pitch, roll))
        sy, sp, sr = (math.sin(angle / 2.0) for angle in (yaw, pitch, roll))
        quaternion = [
            cy * cp * cr + sy * sp * sr,
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
        ]
        return cls(np.asarray(position, dtype=np.float64), np.array(quaternion))

    @cached_property
    def rotation(self) -> Array:
        """Rotation matrix, shape (3, 3), read-only; its columns are the source frame's axes in the target frame."""
        w, x, y, z = self.quaternion.tolist()
        matrix = np.array(
            [
                [w * w + x * x - y * y - z * z, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
                [2.0 * (x * y + z * w), w * w - x * x + y * y - z * z, 2.0 * (y * z - x * w)],
                [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), w * w - x * x - y * y + z * z],
            ]
        )
        matrix.setflags(write=False)
        return matrix

    @property
    def matrix(self) -> Array:
        """Homogeneous matrix, shape (4, 4): rotation, dimensionless, and last column [m]."""
        out = np.eye(4)
        out[:3, :3] = self.rotation
        out[:3, 3] = self.position
        return out

    @property
    def yaw(self) -> float:
        """Heading of the x axis about z [rad]."""
        x_axis = self.rotation[:, 0]
        return float(np.arctan2(x_axis[1], x_axis[0]))

    def inverse(self) -> Pose:
        """Return the pose that undoes this one."""
        return Pose(-(self.rotation.T @ self.position), self.quaternion * [1.0, -1.0, -1.0, -1.0])

    def apply(self, points: npt.ArrayLike) -> Array:
        """Map points of shape (..., 3) [m] from the source to the target frame."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.position

    def rotate(self, vectors: npt.ArrayLike) -> Array:
        """Map vectors of shape (..., 3) from the source to the target frame; their unit stays."""
        return np.asarray(vectors, dtype=np.float64) @ self.rotation.T

    def __matmul__(self, other: Pose | npt.ArrayLike) -> Pose | Array:
        """Compose with a pose, or map points."""
        return self.compose(other) if isinstance(other, Pose) else self.apply(other)

    def compose(self, other: Pose) -> Pose:
        """Return the pose ``self @ other``."""
        return Pose._made(self.apply(other.position), _product(self.quaternion, other.quaternion))

    def __repr__(self) -> str:
        return f"Pose({', '.join(f'{name}={text}' for name, text in self._facts())})"

    def _facts(self) -> list[Row]:
        yaw, pitch, roll = (math.degrees(angle) + 0.0 for angle in self._angles())
        turned = (
            []
            if abs(pitch) < 5e-4 and abs(roll) < 5e-4
            else [("pitch", f"{pitch:.4g} deg"), ("roll", f"{roll:.4g} deg")]
        )
        return [("position", vector(self.position, "m")), ("yaw", f"{yaw:.4g} deg"), *turned]

    def _angles(self) -> tuple[float, float, float]:
        """Return yaw, pitch and roll of `from_euler` [rad]."""
        matrix = self.rotation
        pitch = math.asin(min(max(-matrix[2, 0], -1.0), 1.0))
        return self.yaw, pitch, math.atan2(matrix[2, 1], matrix[2, 2])

    def to_dict(self) -> dict[str, list[float]]:
        """Return position and quaternion as plain lists, for files."""
        return {"position": self.position.tolist(), "quaternion": self.quaternion.tolist()}


def _product(first: Array, second: Array) -> Array:
    """Return the quaternion of the rotation `second`, then `first`, with w >= 0."""
    a, b, c, d = first.tolist()
    e, f, g, h = second.tolist()
    product = np.array(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ]
    )
    return -product if product[0] < 0.0 else product


@dataclass(frozen=True, eq=False, repr=False)
class Twist(Described):
    """Velocity of a rigid body.

    Linear velocity of its origin [m/s] and angular velocity [rad/s], shape (3,) each, both in the world frame.
    """

    linear: Array = field(default_factory=lambda: np.zeros(3))
    angular: Array = field(default_factory=lambda: np.zeros(3))

    if TYPE_CHECKING:

        def __init__(self, linear: npt.ArrayLike = ..., angular: npt.ArrayLike = ...) -> None: ...

    def __post_init__(self) -> None:
        for name in ("linear", "angular"):
            value = numbers(name, getattr(self, name), 3, "three finite components", "write Twist([x, y, z])")
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def _made(cls, linear: Array, angular: Array) -> Twist:
        """Return the twist of new arrays that follow from other twists: they need no check."""
        twist = object.__new__(cls)
        for name, value in (("linear", linear), ("angular", angular)):
            value.setflags(write=False)
            object.__setattr__(twist, name, value)
        return twist

    def __repr__(self) -> str:
        return f"Twist({', '.join(f'{name}={text}' for name, text in self._facts())})"

    def _facts(self) -> list[Row]:
        return [("linear", vector(self.linear, "m/s")), ("angular", vector(self.angular, "rad/s"))]

    def velocity_at(self, offset: npt.ArrayLike) -> Array:
        """Return the velocity [m/s] of points at `offset` (..., 3) [m, world axes] from the body's origin."""
        lever = np.asarray(offset, dtype=np.float64)
        a, b, c = self.angular.tolist()
        if lever.ndim == 1:
            x, y, z = lever.tolist()
            return self.linear + np.array([b * z - c * y, c * x - a * z, a * y - b * x])
        x, y, z = lever[..., 0], lever[..., 1], lever[..., 2]
        return self.linear + np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)
