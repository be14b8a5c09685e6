"""Materials and textures of trees by kind: barks, leaves and needles in several tones."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from ..geometry.mesh import Array
from ..xml import Bsdf
from . import textures
from .palette import ROUGH

GREEN = "estimate, green leaves between the water bands"
Colour = tuple[float, float, float]


def _cards(texture: str, lidar: float = 0.45) -> Bsdf:
    return Bsdf(
        "principledthin",
        "foliage",
        lidar,
        GREEN,
        texture=texture,
        floats={"roughness": 0.5, "diff_trans": 0.9, "eta": 1.4},
    )


def _core(lidar: float, color: Colour) -> Bsdf:
    return Bsdf("principled", "foliage", lidar, GREEN, color=color, floats={"roughness": 0.9, "specular": 0.1})


def _bark(texture: str) -> Bsdf:
    return Bsdf("principled", "wood", 0.45, "estimate, dry bark", texture=texture, floats=ROUGH, wets=0.6)


MATERIALS: dict[str, Bsdf] = {
    "bark_pale": _bark("bark_pale.png"),
    "bark_red": _bark("bark_red.png"),
    "bark_birch": _bark("bark_birch.png"),
    "leaf_cards_dark": _cards("leaf_tones_dark.png"),
    "leaf_cards_pale": _cards("leaf_tones_pale.png"),
    "leaf_cards_copper": _cards("leaf_tones_copper.png"),
    "petal_cards": _cards("petal_tones.png", 0.55),
    "leaves_dark": _core(0.42, (0.034, 0.066, 0.016)),
    "leaves_pale": _core(0.42, (0.088, 0.130, 0.036)),
    "leaves_copper": _core(0.40, (0.130, 0.062, 0.024)),
    "petals_pale": _core(0.50, (0.46, 0.30, 0.31)),
}
"""Name of the bsdf -> its properties."""


def tones(dark: Colour, light: Colour, last: Colour, seed: int = 0) -> Array:
    """Return the tones of leaf cards: along u one leaf after the other, the last of them of another colour."""
    image = textures.tinted(np.linspace(0.0, 1.0, 64)[None, :] * np.ones((4, 1)), dark, light)
    image[:, 59:] = last
    return image


def bark(tint: Colour, seed: int, size: int = 128) -> Array:
    """Return bark of a tint, furrowed along the vertical axis."""
    return np.clip(textures.bark(size, seed + 31) * np.array(tint), 0.0, 1.0)


def birch_bark(seed: int, size: int = 128) -> Array:
    """Return white bark with short dark bars across."""
    generator = np.random.default_rng(seed + 141)
    tone = 0.86 + 0.04 * textures.periodic_noise(size, seed + 142, 0.8, 3.0)
    rows, columns = np.arange(size)[:, None], np.arange(size)[None, :]
    for _ in range(26):
        y, x = generator.integers(0, size, 2)
        long, high = generator.integers(6, 30), generator.integers(1, 4)
        tone = np.where(((rows - y) % size < high) & ((columns - x) % size < long), 0.22, tone)
    return textures.tinted(tone, (0.10, 0.09, 0.08), (0.95, 0.93, 0.88))


IMAGES: dict[str, Callable[[int], Any]] = {
    "bark_pale.png": partial(bark, (1.45, 1.42, 1.30)),
    "bark_red.png": partial(bark, (1.35, 0.92, 0.70)),
    "bark_birch.png": birch_bark,
    "leaf_tones_dark.png": partial(tones, (0.17, 0.27, 0.08), (0.36, 0.46, 0.16), (0.42, 0.44, 0.18)),
    "leaf_tones_pale.png": partial(tones, (0.38, 0.46, 0.19), (0.64, 0.70, 0.36), (0.74, 0.70, 0.34)),
    "leaf_tones_copper.png": partial(tones, (0.36, 0.18, 0.10), (0.66, 0.38, 0.18), (0.72, 0.50, 0.18)),
    "petal_tones.png": partial(tones, (0.80, 0.60, 0.64), (0.98, 0.88, 0.90), (0.42, 0.46, 0.20)),
}
"""File -> function of the seed that draws it."""
