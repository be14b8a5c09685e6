"""Pictures in files: colour images, and small pictures of what is none: depth, classes, radar maps."""

from __future__ import annotations

import io

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
import scipy.ndimage
from PIL import Image

from scarl_sionna.core.results import ImageFrame, RadarFrame
from scarl_sionna.core.semantics import SEMANTIC_COLORS
from scarl_sionna.core.units import power_to_db
from scarl_sionna.signal.processing import range_doppler, virtual_cube

Picture = npt.NDArray[np.uint8]

DEPTH_RANGE = (1.0, 200.0)
"""First and last colour of depth, logarithmic [m]."""
SNR_RANGE_DB = (-5.0, 60.0)
"""First and last colour of radar maps: power over the thermal noise of a cell [dB]."""


def depth_picture(depth: npt.NDArray[np.float32]) -> Picture:
    """Return depth [m] as colours, yellow is near; grey where nothing is hit."""
    near, far = DEPTH_RANGE
    level = np.log(np.clip(np.where(np.isfinite(depth), depth, far), near, far) / near) / np.log(far / near)
    picture = _colours("viridis_r", level)
    picture[~np.isfinite(depth)] = (223, 230, 238)
    return picture


def semantic_picture(semantic: npt.NDArray[np.uint8]) -> Picture:
    """Return classes in their colours."""
    return SEMANTIC_COLORS[semantic]


def range_doppler_picture(radar: RadarFrame) -> Picture:
    """Return the range-Doppler map as a picture.

    Range upwards, radial velocity to the right, power over noise as colour.
    """
    rd = range_doppler(virtual_cube(radar.adc, radar.spec), radar.spec)
    low, high = SNR_RANGE_DB
    level = (power_to_db(rd.power / rd.noise_power) - low) / (high - low)
    return np.ascontiguousarray(_colours("magma", level.T[::-1]))


def _colours(name: str, level: npt.ArrayLike) -> Picture:
    return mpl.colormaps[name](np.clip(level, 0.0, 1.0), bytes=True)[..., :3].copy()


def undistorted(image: ImageFrame) -> npt.NDArray[np.uint8]:
    """Return the RGB image as a pinhole camera with the same matrix K would show it.

    Black where the lens sees nothing.
    """
    assert image.rgb is not None
    spec = image.spec
    if spec.lens.model == "pinhole":
        return image.rgb
    line, column = np.mgrid[: spec.height, : spec.width] + 0.5
    (fx, _, cu), (_, fy, cv), _ = spec.intrinsics
    pixel, _ = spec.project(np.stack([(column - cu) / fx, (line - cv) / fy, np.ones_like(line)], axis=-1))
    place = np.nan_to_num(pixel[..., ::-1], nan=-10.0).transpose(2, 0, 1) - 0.5
    planes = [scipy.ndimage.map_coordinates(image.rgb[..., band], place, order=1, mode="constant") for band in range(3)]
    return np.stack(planes, axis=-1)


def centred_intrinsics(image: ImageFrame) -> npt.NDArray[np.float64]:
    """Return the intrinsics with pixels counted from the centre of the first one, as OpenCV, KITTI and nuScenes do."""
    matrix = image.spec.intrinsics.copy()
    matrix[:2, 2] -= 0.5
    return matrix


def encode_image(pixels: npt.NDArray[np.uint8], kind: str) -> bytes:
    """Return an image as ``"jpg"`` (quality 95, full colour resolution) or ``"png"``."""
    buffer = io.BytesIO()
    options = {"quality": 95, "subsampling": 0} if kind == "jpg" else {}
    Image.fromarray(pixels).save(buffer, format={"jpg": "JPEG", "png": "PNG"}[kind], **options)
    return buffer.getvalue()
