"""Lens models: from a direction to the image plane at focal length 1 and back, and the field where that is possible.

A direction is a vector in `camera_optical` (x right, y down, z forward) of any length. The image plane is in units of
the focal length, its origin is the principal point. Pure numpy, float64.
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees

Array = npt.NDArray[np.float64]

_TABLE_SIZE = 4096
_NEWTON_STEPS = 20
_CONVERGED = 1e-13
"""Largest distance on the image plane that the iteration leaves; 1e-10 px at a focal length of 1000 px."""
_EDGE = 1.0 - 1e-9
"""Share of the field's radius that is used: at the edge itself the model has no slope."""


class Pinhole(Spec):
    """The ideal lens: straight lines stay straight. Sees what is in front of the camera's plane."""

    model: Literal["pinhole"] = "pinhole"

    @property
    def coefficients(self) -> tuple[float, ...]:
        """No coefficients."""
        return ()

    @property
    def field_radius(self) -> float:
        """Radius on the image plane, in units of the focal length, within which the model can be undone: infinite."""
        return np.inf

    def image_radius(self, angle: float) -> float:
        """Return the distance from the principal point of a direction at an angle [rad] from the axis."""
        return float(np.tan(angle)) if angle < np.pi / 2 else np.inf

    def distort(self, directions: npt.ArrayLike) -> Array:
        """Return points on the image plane, shape (..., 2); NaN for a direction that the lens does not see."""
        direction = np.asarray(directions, dtype=np.float64)
        return _perspective(direction)

    def undistort(self, image_points: npt.ArrayLike) -> Array:
        """Return directions with z = 1, shape (..., 3), of points on the image plane, in units of the focal length."""
        points = np.asarray(image_points, dtype=np.float64)
        return np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1)


class BrownConrady(Spec):
    r"""Radial and tangential distortion of a lens for fields below 180 deg, in the form of OpenCV.

    Notes
    -----
    With :math:`x = X/Z, y = Y/Z, r^2 = x^2 + y^2`:

    .. math::
        d(r) = \frac{1 + k_1 r^2 + k_2 r^4 + k_3 r^6}{1 + k_4 r^2 + k_5 r^4 + k_6 r^6} \\
        x' = x\,d + 2 p_1 x y + p_2 (r^2 + 2 x^2), \quad y' = y\,d + p_1 (r^2 + 2 y^2) + 2 p_2 x y

    *Validity*: up to the radius where :math:`r\,d(r)` stops to grow: beyond it the image folds back and a pixel would
    show two directions. There, and where the Jacobian with the tangential terms is not positive, nothing is imaged.

    References
    ----------
    .. [1] D. C. Brown, "Decentering Distortion of Lenses", Photogrammetric Engineering 32(3), 1966.
    .. [2] OpenCV documentation, *Camera Calibration and 3D Reconstruction*, detailed description.
    """

    model: Literal["brown_conrady"] = "brown_conrady"
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0
    k4: float = Field(0.0, description="k4 to k6: denominator of the rational model")
    k5: float = 0.0
    k6: float = 0.0

    @property
    def coefficients(self) -> tuple[float, ...]:
        """(k1, k2, p1, p2, k3, k4, k5, k6): OpenCV's order, dimensionless."""
        return (self.k1, self.k2, self.p1, self.p2, self.k3, self.k4, self.k5, self.k6)

    def _radial(self, r2: Array) -> tuple[Array, Array]:
        """Return d and its derivative by r^2."""
        top = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        top_slope = self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3)
        bottom = 1.0 + r2 * (self.k4 + r2 * (self.k5 + r2 * self.k6))
        bottom_slope = self.k4 + r2 * (2.0 * self.k5 + r2 * 3.0 * self.k6)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return top / bottom, (top_slope * bottom - top * bottom_slope) / (bottom * bottom)

    @cached_property
    def _limit(self) -> float:
        """Largest r = tan(angle) of the field."""
        top = np.polynomial.Polynomial([1.0, self.k1, self.k2, self.k3])
        bottom = np.polynomial.Polynomial([1.0, self.k4, self.k5, self.k6])
        u = np.polynomial.Polynomial([0.0, 1.0])
        # d/dr (r d) = d + 2 u d' with u = r^2; times the squared denominator it is a polynomial in u
        slope = top * bottom + 2.0 * u * (top.deriv() * bottom - top * bottom.deriv())
        return float(np.sqrt(min(_first_root(slope), _first_root(bottom))))

    @property
    def field_radius(self) -> float:
        """Radius on the image plane, in units of the focal length, within which the radial part can be undone."""
        return np.inf if np.isinf(self._limit) else self._image_radius_of(self._limit)

    def _image_radius_of(self, r: float) -> float:
        return float(r * self._radial(np.asarray(r * r))[0])

    def image_radius(self, angle: float) -> float:
        """Return the distance from the principal point of a direction at an angle [rad].

        Infinite outside of the field.
        """
        r = np.tan(angle) if angle < np.pi / 2 else np.inf
        return self._image_radius_of(r) if r < self._limit else np.inf

    def _forward(self, x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        d, _ = self._radial(r2)
        return (
            x * d + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * d + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )

    def _jacobian(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        """Return the derivatives xx, xy, yx, yy."""
        d, slope = self._radial(x * x + y * y)
        cross = 2.0 * x * y * slope
        return (
            d + 2.0 * x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            cross + 2.0 * self.p1 * x + 2.0 * self.p2 * y,
            cross + 2.0 * self.p1 * x + 2.0 * self.p2 * y,
            d + 2.0 * y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )

    def _in_field(self, x: Array, y: Array) -> npt.NDArray[np.bool_]:
        xx, xy, yx, yy = self._jacobian(x, y)
        with np.errstate(invalid="ignore"):
            return (np.hypot(x, y) < self._limit * _EDGE) & (xx * yy - xy * yx > 0.0) & (xx + yy > 0.0)

    def distort(self, directions: npt.ArrayLike) -> Array:
        """Return points on the image plane, shape (..., 2); NaN for a direction outside of the field."""
        ideal = _perspective(np.asarray(directions, dtype=np.float64))
        x, y = ideal[..., 0], ideal[..., 1]
        out = np.stack(self._forward(x, y), axis=-1)
        out[~self._in_field(x, y)] = np.nan
        return out

    def undistort(self, image_points: npt.ArrayLike) -> Array:
        """Return directions with z = 1, shape (..., 3); NaN for a point of the image plane that shows nothing.

        The radial part is undone by a table, then Newton's method solves for both coordinates.

        Points are in units of the focal length.
        """
        goal = np.asarray(image_points, dtype=np.float64)
        radius = np.hypot(goal[..., 0], goal[..., 1])
        scale = self._undo_radius(radius) / np.where(radius > 0.0, radius, 1.0)
        x, y = goal[..., 0] * scale, goal[..., 1] * scale
        error = np.full(x.shape, np.inf)
        for _ in range(_NEWTON_STEPS):
            got_x, got_y = self._forward(x, y)
            miss_x, miss_y = got_x - goal[..., 0], got_y - goal[..., 1]
            error = np.hypot(miss_x, miss_y)
            finite = error[np.isfinite(error)]
            if finite.size == 0 or finite.max() < _CONVERGED:
                break
            xx, xy, yx, yy = self._jacobian(x, y)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                determinant = xx * yy - xy * yx
                x = x - (yy * miss_x - xy * miss_y) / determinant
                y = y - (xx * miss_y - yx * miss_x) / determinant
        out = np.stack([x, y, np.ones_like(x)], axis=-1)
        with np.errstate(invalid="ignore"):
            found = (error < 1e-10 * (1.0 + radius)) & self._in_field(x, y)
        out[~found] = np.nan
        return out

    def _undo_radius(self, radius: Array) -> Array:
        """Return r of r d(r), from a table; outside of the field its edge."""
        finite = radius[np.isfinite(radius)]
        reach = 2.0 * float(finite.max(initial=1e-3))
        limit = self._limit
        if np.isinf(limit):
            limit = reach
            while self._image_radius_of(limit) < reach and limit < 1e6:
                limit *= 2.0
        r = limit * np.linspace(0.0, 1.0, _TABLE_SIZE) * _EDGE
        return np.interp(radius, r * self._radial(r * r)[0], r)


class KannalaBrandt(Spec):
    r"""Fisheye lens, in the form of OpenCV: the distance from the principal point is a polynomial of the angle.

    Notes
    -----
    .. math:: r = \theta\,(1 + k_1 \theta^2 + k_2 \theta^4 + k_3 \theta^6 + k_4 \theta^8)

    *Validity*: up to the angle where r stops to grow, and at most `max_angle_deg`; it may pass 90 deg.

    References
    ----------
    .. [1] J. Kannala, S. Brandt, "A Generic Camera Model and Calibration Method for Conventional, Wide-Angle, and
       Fish-Eye Lenses", IEEE Trans. PAMI 28(8), 2006, Eq. (6).
    """

    model: Literal["kannala_brandt"] = "kannala_brandt"
    k1: float = 0.0
    k2: float = 0.0
    k3: float = 0.0
    k4: float = 0.0
    max_angle_deg: Degrees = Field(180.0, gt=0.0, le=180.0, description="half angle of the lens' image circle [deg]")

    @property
    def coefficients(self) -> tuple[float, ...]:
        """(k1, k2, k3, k4): OpenCV's order, dimensionless."""
        return (self.k1, self.k2, self.k3, self.k4)

    def _radius(self, angle: npt.ArrayLike) -> Array:
        t = np.asarray(angle, dtype=np.float64)
        u = t * t
        return t * (1.0 + u * (self.k1 + u * (self.k2 + u * (self.k3 + u * self.k4))))

    def _slope(self, angle: Array) -> Array:
        u = angle * angle
        return 1.0 + u * (3.0 * self.k1 + u * (5.0 * self.k2 + u * (7.0 * self.k3 + u * 9.0 * self.k4)))

    @cached_property
    def _fold(self) -> float:
        """Angle at which the radius stops to grow [rad]."""
        slope = np.polynomial.Polynomial([1.0, 3.0 * self.k1, 5.0 * self.k2, 7.0 * self.k3, 9.0 * self.k4])
        return float(np.sqrt(_first_root(slope)))

    @property
    def _limit(self) -> float:
        return float(min(self._fold * _EDGE, np.radians(self.max_angle_deg)))

    @property
    def field_radius(self) -> float:
        """Radius on the image plane, in units of the focal length, where the polynomial can be undone.

        Infinite where it always can.
        """
        return float(self._radius(self._fold)) if self._fold < np.radians(self.max_angle_deg) else np.inf

    def image_radius(self, angle: float) -> float:
        """Return the distance from the principal point of a direction at an angle [rad].

        Infinite outside of the field.
        """
        return float(self._radius(angle)) if angle <= self._limit else np.inf

    def distort(self, directions: npt.ArrayLike) -> Array:
        """Return points on the image plane, shape (..., 2); NaN for a direction outside of the field."""
        direction = np.asarray(directions, dtype=np.float64)
        across = np.hypot(direction[..., 0], direction[..., 1])
        angle = np.arctan2(across, direction[..., 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(across > 0.0, self._radius(angle) / across, 1.0 / np.abs(direction[..., 2]))
        out = direction[..., :2] * scale[..., None]
        out[~(angle <= self._limit)] = np.nan
        return out

    def undistort(self, image_points: npt.ArrayLike) -> Array:
        """Return unit directions, shape (..., 3); NaN for a point of the image plane that shows nothing."""
        goal = np.asarray(image_points, dtype=np.float64)
        radius = np.hypot(goal[..., 0], goal[..., 1])
        table = self._limit * np.linspace(0.0, 1.0, _TABLE_SIZE)
        radii = self._radius(table)
        angle = np.interp(radius, radii, table)
        with np.errstate(divide="ignore", invalid="ignore"):
            for _ in range(_NEWTON_STEPS):
                step = (self._radius(angle) - radius) / self._slope(angle)
                angle = angle - step
                finite = np.abs(step[np.isfinite(step)])
                if finite.size == 0 or finite.max() < _CONVERGED:
                    break
            sine = np.where(radius > 0.0, np.sin(angle) / radius, 1.0)
            found = (radius <= radii[-1]) & (np.abs(self._radius(angle) - radius) < 1e-10 * (1.0 + radius))
        out = np.concatenate([goal * sine[..., None], np.cos(angle)[..., None]], axis=-1)
        out[~found] = np.nan
        return out


Lens = Pinhole | BrownConrady | KannalaBrandt


def _perspective(direction: Array) -> Array:
    """Return x / z and y / z, shape (..., 2); NaN where z <= 0."""
    ahead = direction[..., 2] > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        out = direction[..., :2] / direction[..., 2:]
    out[~ahead] = np.nan
    return out


def _first_root(polynomial: np.polynomial.Polynomial) -> float:
    """Return the smallest real positive root, infinite if there is none."""
    roots = polynomial.trim().roots()
    real = roots.real[(np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots.real))) & (roots.real > 0.0)]
    return float(real.min(initial=np.inf))
