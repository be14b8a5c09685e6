"""Values between key frames with their exact derivatives over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

Array = npt.NDArray[np.float64]

KINDS = ("LINEAR", "STEP", "CUBICSPLINE", "SMOOTH")
"""How values go on between keys: as glTF defines them, or a cubic spline without steps in the velocity."""
_SMALL_ANGLE = 1e-6
"""Quaternions nearer than this [rad] are interpolated in a straight line, which differs by the angle's square."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Key frames of one property of a node.

    Attributes
    ----------
    times : ndarray of float64, shape (num_keys,)
        Rising [s].
    values : ndarray of float64, shape (num_keys, width), or (num_keys, 3, width) for CUBICSPLINE
        Of a rotation: quaternions [w, x, y, z]; of CUBICSPLINE tangent in, value and tangent out.
    kind : str
        One of `KINDS`.
    turns : bool
        Whether values are rotations: LINEAR is then the spherical one.

    Notes
    -----
    Before the first and after the last key the value stays. The derivative is that of the interpolant; at a key of
    LINEAR, where it has a step, that of what follows.
    """

    times: Array
    values: Array
    kind: str = "LINEAR"
    turns: bool = False
    _between: Callable[[int, float], tuple[Array, Array]] = field(init=False, repr=False)
    _splines: tuple[CubicSpline, CubicSpline] | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        values, kind = self.values, self.kind
        if kind != "CUBICSPLINE" and self.turns:
            object.__setattr__(self, "values", _one_sided(values))
        if kind == "SMOOTH" and len(self.times) > 1:
            closed = bool(np.allclose(self.values[0], self.values[-1], rtol=0.0, atol=1e-9))
            keys = self.values.copy()
            if closed:
                keys[-1] = keys[0]
            spline = CubicSpline(self.times, keys, bc_type="periodic" if closed and len(keys) > 2 else "not-a-knot")
            object.__setattr__(self, "_splines", (spline, spline.derivative()))
            object.__setattr__(self, "_between", self._along)
            return
        own = {"STEP": self._step, "CUBICSPLINE": self._hermite}.get(kind, self._slerp if self.turns else self._line)
        object.__setattr__(self, "_between", own)

    def at(self, time: float) -> tuple[Array, Array]:
        """Return value and rate [1/s] at a time [s], each of shape (width,)."""
        last = len(self.times) - 1
        if last == 0 or not self.times[0] <= time < self.times[last]:
            value = self._key(0 if time < self.times[0] else last)
            return value, np.zeros_like(value)
        return self._between(int(np.searchsorted(self.times, time, side="right")) - 1, time)

    def _key(self, k: int) -> Array:
        return self.values[k, 1] if self.kind == "CUBICSPLINE" else self.values[k]

    def _along(self, k: int, time: float) -> tuple[Array, Array]:
        assert self._splines is not None  # where this is called
        value, rate = self._splines
        return value(time), rate(time)

    def _step(self, k: int, time: float) -> tuple[Array, Array]:
        return self.values[k], np.zeros_like(self.values[k])

    def _line(self, k: int, time: float) -> tuple[Array, Array]:
        rate = (self.values[k + 1] - self.values[k]) / (self.times[k + 1] - self.times[k])
        return self.values[k] + (time - self.times[k]) * rate, rate

    def _slerp(self, k: int, time: float) -> tuple[Array, Array]:
        first, second = self.values[k], self.values[k + 1]
        step = self.times[k + 1] - self.times[k]
        angle = 2.0 * np.arctan2(np.linalg.norm(second - first), np.linalg.norm(second + first))
        if angle < _SMALL_ANGLE:
            return self._line(k, time)
        u = (time - self.times[k]) / step
        value = np.sin((1.0 - u) * angle) * first + np.sin(u * angle) * second
        rate = np.cos(u * angle) * second - np.cos((1.0 - u) * angle) * first
        return value / np.sin(angle), rate * (angle / (step * np.sin(angle)))

    def _hermite(self, k: int, time: float) -> tuple[Array, Array]:
        (_, first, leaving), (arriving, second, _) = self.values[k], self.values[k + 1]
        step = self.times[k + 1] - self.times[k]
        u = (time - self.times[k]) / step
        value = (2.0 * u**3 - 3.0 * u**2 + 1.0) * first + (3.0 * u**2 - 2.0 * u**3) * second
        value += step * ((u**3 - 2.0 * u**2 + u) * leaving + (u**3 - u**2) * arriving)
        rate = (6.0 * u**2 - 6.0 * u) * (first - second) / step
        rate += (3.0 * u**2 - 4.0 * u + 1.0) * leaving + (3.0 * u**2 - 2.0 * u) * arriving
        return value, rate


def _one_sided(quaternions: Array) -> Array:
    """Return unit quaternions, each with the sign that brings it nearest to the one before."""
    unit = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    flips = np.einsum("ij,ij->i", unit[1:], unit[:-1]) < 0.0
    sign = np.cumprod(np.where(flips, -1.0, 1.0))
    unit[1:] *= sign[:, None]
    return unit


def rotation_with_rate(quaternion: Array, rate: Array) -> tuple[Array, Array]:
    """Return the rotation matrix of a quaternion [w, x, y, z] of any length, and its derivative, each (3, 3)."""
    length = np.sqrt(quaternion @ quaternion)
    unit = quaternion / length
    w, x, y, z = unit.tolist()
    dw, dx, dy, dz = ((rate - unit * (unit @ rate)) / length).tolist()
    matrix = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    xx, yy, zz = 2.0 * x * dx, 2.0 * y * dy, 2.0 * z * dz
    xy, xz, yz = x * dy + dx * y, x * dz + dx * z, y * dz + dy * z
    wx, wy, wz = w * dx + dw * x, w * dy + dw * y, w * dz + dw * z
    derivative = 2.0 * np.array(
        [[-yy - zz, xy - wz, xz + wy], [xy + wz, -xx - zz, yz - wx], [xz - wy, yz + wx, -xx - yy]]
    )
    return matrix, derivative
