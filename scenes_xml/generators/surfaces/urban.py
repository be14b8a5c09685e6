"""Materials and textures of town streets between tall houses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from ..geometry.mesh import Array
from ..xml import Bsdf
from . import images, textures
from .interior import COATED, ROUGH, TYPICAL, font, lettered, limit
from .palette import SHEET


def _wall(texture: str, radio: str = "brick", lidar: float = 0.5) -> Bsdf:
    return Bsdf("principled", radio, lidar, "estimate, light plaster on brick", texture=texture, floats=ROUGH, wets=0.2)


def _sign(texture: str) -> Bsdf:
    return Bsdf(
        "principled",
        "metal",
        0.6,
        SHEET,
        texture=texture,
        floats={"roughness": 0.4},
        retroreflection=250.0,
    )


MATERIALS: dict[str, Bsdf] = {
    "facade_white": _wall("facade_white.png"),
    "facade_cream": _wall("facade_cream.png"),
    "facade_rose": _wall("facade_rose.png"),
    "facade_grey": _wall("facade_grey.png"),
    "facade_brick": _wall("facade_brick.png", lidar=0.4),
    "facade_stone": _wall("facade_stone.png", "concrete", 0.4),
    "facade_trim": Bsdf("principled", "concrete", 0.5, TYPICAL, color=(0.52, 0.50, 0.46), floats={"roughness": 0.6}),
    "shelter_glass": Bsdf(
        "principled", "glass", 0.05, TYPICAL, color=(0.10, 0.14, 0.15), floats={"roughness": 0.05, "specular": 0.6}
    ),
    "manhole_iron": Bsdf("principled", "metal", 0.2, TYPICAL, texture="manhole.png", floats={"roughness": 0.6}),
    "poster": Bsdf("principled", "glass", 0.3, TYPICAL, texture="poster.png", floats=COATED),
    "sign_directions": _sign("sign_directions.png"),
    "sign_bus_stop": _sign("sign_bus_stop.png"),
    "sign_50": _sign("sign_50.png"),
    "barrier_board": _sign("barrier_board.png"),
    "sign_limit_120": _sign("sign_120.png"),
    "sign_ahead": _sign("sign_ahead.png"),
    "sign_exit_way": _sign("sign_exit_way.png"),
    "noise_panel": Bsdf("principled", "wood", 0.4, TYPICAL, texture="noise_panel.png", floats=ROUGH, wets=0.4),
}
"""Name of the bsdf -> its properties."""


def facade(tint: tuple[float, float, float], seed: int, size: int = 256) -> Array:
    """Return weathered plaster, a tile of 3 m, shape (size, size, 3)."""
    tone = (
        0.84
        + 0.02 * textures.periodic_noise(size, seed + 401, 0.4, 8.0)
        + 0.035 * textures.periodic_noise(size, seed + 402, 1.5, 1.0, 8.0)
    )
    return textures.tinted(tone, (0.2, 0.19, 0.18), (0.98, 0.97, 0.95)) * np.array(tint)


def ashlar(seed: int, size: int = 256, rows: int = 6) -> Array:
    """Return cut stone in courses of 0.5 m, a tile of 3 m, shape (size, size, 3)."""
    g = np.random.default_rng(seed + 411)
    k = np.arange(size)
    row = k * rows // size
    shift = (row % 2) * size // 6
    column = ((k[None, :] + shift[:, None]) * 3 // size) % 3
    tone = (
        0.64
        + 0.03 * textures.periodic_noise(size, seed + 412, 0.6, 4.0)
        + g.uniform(-0.04, 0.04, (rows, 3))[row[:, None], column]
    )
    joint = (k * rows % size < rows * 2)[:, None] | ((k[None, :] + shift[:, None]) * 3 % size < 6)
    return textures.tinted(np.where(joint, tone * 0.8, tone), (0.22, 0.20, 0.17), (0.95, 0.90, 0.81))


def noise_panel(seed: int, size: int = 128) -> Array:
    """Return boards of wood-fibre concrete with grooves and posts' joints, a tile of 4 m, shape (size, size, 3)."""
    k = np.arange(size)
    tone = (
        0.5
        + 0.05 * textures.periodic_noise(size, seed + 431, 0.4, 6.0)
        + 0.05 * textures.periodic_noise(size, seed + 432, 1.4, 1.0, 8.0)
    )
    tone[k % 16 < 2, :] -= 0.16
    return textures.tinted(tone, (0.12, 0.16, 0.11), (0.62, 0.66, 0.52))


def poster(seed: int) -> Image.Image:
    """Return a poster of coloured shapes."""
    g = np.random.default_rng(seed + 421)
    image = Image.new("RGB", (96, 144), (238, 226, 196))
    draw = ImageDraw.Draw(image)
    for _ in range(6):
        x, y, r = g.uniform(0, 96), g.uniform(10, 100), g.uniform(10, 34)
        draw.ellipse([x - r, y - r, x + r, y + r], fill=tuple(int(v) for v in g.integers(30, 230, 3)))
    draw.rectangle([0, 112, 96, 144], fill=(24, 30, 52))
    draw.text((48, 128), "MUSEUM", (245, 240, 230), font(19), anchor="mm")
    return image


def bus_flag(size: int = 96) -> Image.Image:
    """Return the flag of a bus stop: H in a ring."""
    s = 4 * size
    image = Image.new("RGB", (s, s), (238, 200, 30))
    draw = ImageDraw.Draw(image)
    draw.ellipse([0.06 * s, 0.06 * s, 0.94 * s, 0.94 * s], fill=(20, 110, 60))
    draw.ellipse([0.14 * s, 0.14 * s, 0.86 * s, 0.86 * s], fill=(238, 200, 30))
    draw.text((0.5 * s, 0.5 * s), "H", (20, 110, 60), font(0.62 * s), anchor="mm", stroke_width=int(0.015 * s))
    return image.resize((size, size), Image.Resampling.LANCZOS)


def barrier_board(size: int = 64) -> Image.Image:
    """Return slanting red and white stripes, a tile of 1 m x 0.25 m."""
    x, y = np.meshgrid(np.arange(4 * size), np.arange(size))
    is_red = ((x + y) // size) % 2 == 0
    return Image.fromarray(np.where(is_red[..., None], (190, 25, 30), (245, 245, 240)).astype(np.uint8))


IMAGES: dict[str, Callable[[int], Any]] = {
    "facade_white.png": partial(facade, (1.0, 1.0, 1.0)),
    "facade_cream.png": partial(facade, (0.98, 0.90, 0.72)),
    "facade_rose.png": partial(facade, (0.86, 0.66, 0.57)),
    "facade_grey.png": partial(facade, (0.70, 0.73, 0.76)),
    "facade_brick.png": lambda seed: textures.bricks(256, seed + 51, 24, 12),
    "facade_stone.png": ashlar,
    "manhole.png": images.IMAGES["manhole.png"],
    "poster.png": poster,
    "sign_directions.png": lambda seed: lettered(
        256, 80, "Centre  ^\nStation  >", (20, 70, 160), (250, 250, 250), 0.72
    ),
    "sign_bus_stop.png": lambda seed: bus_flag(),
    "sign_50.png": lambda seed: limit("50"),
    "barrier_board.png": lambda seed: barrier_board(),
    "sign_120.png": lambda seed: limit("120"),
    "sign_ahead.png": lambda seed: lettered(256, 150, "A 7\nNorth\nHarbour", (20, 70, 160), (250, 250, 250), 0.85),
    "sign_exit_way.png": lambda seed: lettered(
        256, 150, "Exit 12\nLakeside\nAirport  >", (20, 70, 160), (250, 250, 250), 0.85
    ),
    "noise_panel.png": noise_panel,
}
"""File -> function of the seed that draws it."""
