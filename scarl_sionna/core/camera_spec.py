"""What a camera is: resolution, intrinsics and the samples of its render."""

from __future__ import annotations

from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from .spec import Spec

CameraImage = Literal["rgb", "depth", "semantic", "instance"]


class CameraSpec(Spec):
    """An ideal pinhole camera.

    The camera is mounted by a sensor frame (x forward = optical axis, y left, z up). Pixel (u, v) = (column, row);
    the centre of the top-left pixel is (0.5, 0.5).
    """

    width: int = Field(960, ge=1, le=16384, description="columns [px]")
    height: int = Field(540, ge=1, le=16384, description="rows [px]")
    horizontal_fov_deg: float = Field(90.0, gt=0.0, lt=180.0, description="horizontal field of view [deg]")
    samples_per_pixel: int = Field(64, ge=1, le=65536, description="path-traced samples of the RGB image")
    max_depth: int = Field(6, ge=1, le=64, description="longest light path of the RGB image [segments]")
    exposure: float = Field(1.0, gt=0.0, description="factor on the scene's radiance before the tone curve")
    max_distance: float = Field(1000.0, gt=0.0, description="depth is infinite beyond [m]")
    images: tuple[CameraImage, ...] = ("rgb", "depth", "semantic", "instance")

    @cached_property
    def intrinsics(self) -> npt.NDArray[np.float64]:
        """Matrix K, shape (3, 3) [px]: pixel ~ K @ point in camera_optical."""
        focal = self.width / (2.0 * np.tan(np.radians(self.horizontal_fov_deg) / 2.0))
        return np.array([[focal, 0.0, self.width / 2.0], [0.0, focal, self.height / 2.0], [0.0, 0.0, 1.0]])
