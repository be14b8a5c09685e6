"""Textures of the street's own: those that follow its lanes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..generators.geometry.mesh import Array
from ..generators.surfaces import images, interior, textures
from .layout import KERB_LEFT, KERB_RIGHT, LANE_LEFT

SPAN = KERB_LEFT - KERB_RIGHT
TRACKS = tuple(lane + wheel - KERB_RIGHT for lane in (0.0, LANE_LEFT) for wheel in (-0.78, 0.78))
"""Middles of the wheel tracks from the right kerb [m]."""


def _street(seed: int, size: int = 640) -> Array:
    """Return the carriageway: wheel tracks and sealed cracks."""
    street = textures.asphalt(1024, seed + 1, TRACKS, SPAN)
    street[textures.crack_lines(1024, seed + 4)] *= 0.66
    return textures.resized(street, size)


IMAGES: dict[str, Callable[[int], Any]] = {
    **images.IMAGES,
    **interior.IMAGES,
    "asphalt.png": _street,
    "puddles.png": lambda seed: textures.resized(textures.puddles(512, seed + 7, TRACKS, SPAN), 256),
}
"""File -> function of the seed that draws it."""
