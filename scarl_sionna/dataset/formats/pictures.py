"""Small colour pictures of what is no colour image, for viewers: depth, classes, radar maps."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import numpy.typing as npt

from scarl_sionna.core.results import RadarFrame
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
