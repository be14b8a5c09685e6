"""Textures of the road's own: those that follow its lanes, and the meadow beside them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image

from ..generators.geometry.mesh import Array
from ..generators.surfaces import images, interior, textures
from ..generators.surfaces.palette import PALETTE
from ..generators.xml import Bsdf
from . import layout as at
from .layout import LANE_LEFT, PAVEMENT_LEFT, PAVEMENT_RIGHT

SPAN = PAVEMENT_LEFT - PAVEMENT_RIGHT
TRACKS = tuple(lane + wheel - PAVEMENT_RIGHT for lane in (0.0, LANE_LEFT) for wheel in (-0.78, 0.78))
"""Middles of the wheel tracks from the right edge of the pavement [m]."""


def _road(seed: int, size: int = 640) -> Array:
    """Return the pavement: wheel tracks, sealed cracks, the joint between the lanes, oil that dripped."""
    fine = 1024
    road = textures.asphalt(fine, seed + 1, TRACKS, SPAN)
    road[textures.crack_lines(fine, seed + 4)] *= 0.62
    middle = int(fine * (0.5 * (at.LANE_RIGHT + at.LANE_LEFT) - PAVEMENT_RIGHT) / SPAN)
    road[:, middle - 1 : middle + 1] *= 0.72
    oil = textures.periodic_noise(fine, seed + 9, 1.2, 2.0, 80.0)
    lane = (np.arange(fine) + 0.5) / fine * SPAN + PAVEMENT_RIGHT
    drip = sum(np.exp(-(((lane - c) / 0.30) ** 2)) for c in (at.LANE_RIGHT, at.LANE_LEFT))
    road *= (1.0 - (0.07 + 0.03 * np.clip(oil, -1, 2)) * drip[None, :])[..., None]
    return textures.resized(road, size)


IMAGES: dict[str, Callable[[int], Any]] = {
    **images.IMAGES,
    **interior.IMAGES,
    "asphalt.png": _road,
    "puddles.png": lambda seed: textures.resized(textures.puddles(512, seed + 7, TRACKS, SPAN), 256),
    "grass.png": lambda seed: textures.grass(384, seed + 11),
    "sign_bend_right.png": lambda seed: textures.sign_bend(256).transpose(Image.Transpose.FLIP_LEFT_RIGHT),
}
"""File -> function of the seed that draws it."""

MATERIALS: dict[str, Bsdf] = {"sign_bend_right": replace(PALETTE["sign_bend"], texture="sign_bend_right.png")}
"""Name of the bsdf -> its properties; beside those of the palette."""
