"""What a camera is: resolution, projection, and what its render costs."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationInfo, field_validator, model_validator

from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, Pixels, Seconds, Unit

from .image_sensor import ImageSensor
from .lens import BrownConrady, KannalaBrandt, Lens, Pinhole

Array = npt.NDArray[np.float64]
CameraImage = Literal["rgb", "depth", "semantic", "instance", "normal", "flow"]

DEFAULT_FOV_DEG = 90.0
"""Horizontal field of view where neither it nor a focal length is given [deg]."""


class CameraSpec(Spec):
    """A camera with any of the lens models of :mod:`scarl_sionna.core.specs.lens`; by default an ideal pinhole.

    The camera is mounted by a sensor frame (x forward = optical axis, y left, z up). Pixel (u, v) = (column, row);
    the centre of the top-left pixel is (0.5, 0.5). All images of a camera share one projection, pixel for pixel.
    """

    width: Annotated[int, Unit("px")] = Field(960, ge=1, le=16384, description="columns [px]")
    height: Annotated[int, Unit("px")] = Field(540, ge=1, le=16384, description="rows [px]")
    lens: Annotated[Lens, Field(discriminator="model")] = Pinhole()
    horizontal_fov_deg: Degrees | None = Field(
        None,
        gt=0.0,
        le=360.0,
        description="angle that the width shows through the lens, were the principal point in the middle [deg]; "
        "90 where no focal length is given either",
    )
    focal_length_px: Pixels | tuple[Pixels, Pixels] | None = Field(
        None, description="instead of the field of view: focal length, or that of columns and of rows [px]"
    )
    principal_point: tuple[Pixels, Pixels] | None = Field(None, description="column and row [px]; None: the middle")
    samples_per_pixel: int = Field(
        16, ge=1, le=65536, description="light paths of the RGB image; error against time: docs/camera.md"
    )
    denoise: bool = Field(True, description="Open Image Denoise over the RGB image, led by albedo and normals")
    max_depth: Annotated[int, Unit("segments")] = Field(
        6, ge=1, le=64, description="longest light path of the RGB image [segments]"
    )
    exposure: float = Field(1.0, gt=0.0, description="factor on the scene's radiance before the tone curve")
    exposure_time: Seconds = Field(
        0.0, ge=0.0, le=10.0, description="shutter, its middle at the frame's time [s]; 0: no blur"
    )
    num_shutter_times: int = Field(8, ge=1, le=256, description="instants of an exposure with blur")
    readout_time: Seconds = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description="rolling shutter: from top to bottom, the middle at the frame's time [s]; 0: global shutter",
    )
    num_readout_bands: int = Field(
        16, ge=1, le=16384, description="instants at which the rows of a rolling shutter are seen"
    )
    sensor: ImageSensor | None = Field(None, description="noise and converter of the RGB image; None: ideal")
    max_distance: Metres = Field(1000.0, gt=0.0, description="depth is infinite beyond [m]")
    flow_interval: Seconds = Field(0.1, gt=0.0, description="time over which the flow image is taken [s]")
    images: tuple[CameraImage, ...] = ("rgb", "depth", "semantic", "instance")

    @field_validator("horizontal_fov_deg")
    @classmethod
    def _check_fov(cls, value: float | None, info: ValidationInfo) -> float | None:
        lens = info.data.get("lens")
        if value is None or lens is None:
            return value
        if value >= 180.0 and not isinstance(lens, KannalaBrandt):
            raise ValueError("below 180 deg; a wider field needs the lens KannalaBrandt")
        if np.isinf(lens.image_radius(np.radians(value) / 2.0)):
            raise ValueError(
                f"a field in which the lens {lens.model} can be inverted; it folds back before {value:g} deg"
            )
        return value

    @field_validator("focal_length_px")
    @classmethod
    def _check_focal(cls, value: float | tuple[float, float] | None) -> float | tuple[float, float] | None:
        if value is not None and np.min(value) <= 0.0:
            raise ValueError("> 0 px")
        return value

    @model_validator(mode="after")
    def _check(self) -> CameraSpec:
        if self.focal_length_px is not None and self.horizontal_fov_deg is not None:
            raise ValueError("either focal_length_px or horizontal_fov_deg, not both; set the other to None")
        if self.focal_length_px is None and np.isinf(self.lens.image_radius(self._half_angle)):
            raise ValueError(f"a lens that covers {2.0 * np.degrees(self._half_angle):g} deg, or a focal_length_px")
        (fx, _, cu), (_, fy, cv), _ = self.intrinsics
        nearest = min(cu, self.width - cu, cv, self.height - cv)
        radius = self.lens.field_radius * min(fx, fy)
        if radius < nearest:
            raise ValueError(
                "a distortion that can be inverted up to the image's nearest edge, "
                f"{nearest:.0f} px from the principal "
                f"point; this one folds back at {radius:.0f} px"
            )
        return self

    @property
    def _half_angle(self) -> float:
        return float(np.radians(self.horizontal_fov_deg or DEFAULT_FOV_DEG) / 2.0)

    @property
    def intrinsics(self) -> Array:
        """Matrix K, shape (3, 3) [px]: from the image plane behind the lens to pixels."""
        if self.focal_length_px is None:
            fx = fy = self.width / (2.0 * self.lens.image_radius(self._half_angle))
        else:
            fx, fy = np.broadcast_to(self.focal_length_px, 2).tolist()
        cu, cv = self.principal_point or (self.width / 2.0, self.height / 2.0)
        return np.array([[fx, 0.0, cu], [0.0, fy, cv], [0.0, 0.0, 1.0]])

    @property
    def projection_key(self) -> tuple[int, int, Lens, tuple[float, float], tuple[float, float]]:
        """All that decides which pixel shows which ray: size, lens, focal lengths and principal point [px]."""
        (fx, _, cu), (_, fy, cv), _ = self.intrinsics.tolist()
        return self.width, self.height, self.lens, (fx, fy), (cu, cv)

    @property
    def distortion_coefficients(self) -> tuple[float, ...]:
        """Coefficients of the lens in OpenCV's order; empty for a pinhole."""
        return self.lens.coefficients

    @property
    def widest_angle(self) -> float:
        """Largest angle off the optical axis at which the image shows something [rad]: of its edge or the lens' field.

        To within 0.1 deg: looked for along the image's edges at a few hundred points.
        """
        along = np.linspace(0.0, 1.0, 65)
        low, high = np.zeros_like(along), np.ones_like(along)
        sides = ((along, low), (along, high), (low, along), (high, along))
        centre = self.intrinsics[:2, 2]
        away = np.concatenate([np.stack(side, axis=-1) for side in sides]) * (self.width, self.height) - centre
        inner, outer, widest = np.zeros(len(away)), np.ones(len(away)), 0.0
        at = outer  # share of the way to the edge; where it shows nothing, the field's edge is between inner and outer
        for _ in range(20):
            rays = self.rays(centre + at[:, None] * away)
            seen = np.isfinite(rays[:, 2])
            widest = max(widest, np.arctan2(np.hypot(rays[seen, 0], rays[seen, 1]), rays[seen, 2]).max(initial=0.0))
            inner, outer = np.where(seen, at, inner), np.where(seen, outer, at)
            if seen.all():
                break
            at = (inner + outer) / 2.0
        return float(widest)

    def project(self, points_camera_optical: npt.ArrayLike) -> tuple[Array, Array]:
        """Project points to pixels through the lens.

        Parameters
        ----------
        points_camera_optical : array_like of float, shape (..., 3)
            Points in `camera_optical` (x right, y down, z forward) [m].

        Returns
        -------
        pixel : ndarray of float64, shape (..., 2)
            Column and row [px]; NaN for a point that the lens does not see. It may lie outside of the image.
        depth : ndarray of float64, shape (...)
            Distance along the optical axis [m]; negative behind the camera's plane.
        """
        points = np.asarray(points_camera_optical, dtype=np.float64)
        (fx, _, cu), (_, fy, cv), _ = self.intrinsics
        return self.lens.distort(points) * (fx, fy) + (cu, cv), points[..., 2]

    def rays(self, pixel: npt.ArrayLike) -> Array:
        """Return the unit directions in `camera_optical` that pixels show.

        Parameters
        ----------
        pixel : array_like of float, shape (..., 2)
            Column and row [px].

        Returns
        -------
        ndarray of float64, shape (..., 3)
            Unit vectors; NaN outside of the lens' field.
        """
        direction = self._plane_directions(pixel)
        return direction / np.linalg.norm(direction, axis=-1, keepdims=True)

    def unproject(self, pixel: npt.ArrayLike, depth: npt.ArrayLike) -> Array:
        """Return the points in `camera_optical` [m] of pixels at a depth; the inverse of :meth:`project`.

        Parameters
        ----------
        pixel : array_like of float, shape (..., 2)
            Column and row [px].
        depth : array_like of float, shape (...)
            Distance along the optical axis [m]; negative for pixels of a fisheye that look backwards.

        Returns
        -------
        ndarray of float64, shape (..., 3)
            [m]; NaN outside of the lens' field.
        """
        direction = self._plane_directions(pixel)
        return direction * (np.asarray(depth, dtype=np.float64) / direction[..., 2])[..., None]

    def _plane_directions(self, pixel: npt.ArrayLike) -> Array:
        (fx, _, cu), (_, fy, cv), _ = self.intrinsics
        return self.lens.undistort((np.asarray(pixel, dtype=np.float64) - (cu, cv)) / (fx, fy))


__all__ = ["BrownConrady", "CameraImage", "CameraSpec", "ImageSensor", "KannalaBrandt", "Lens", "Pinhole"]
