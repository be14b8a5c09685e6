"""Materials and textures of enclosed places (tunnel, car park) and of lit signs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..geometry.mesh import Array
from ..xml import Bsdf
from . import images, textures

TYPICAL = "estimate, typical of this surface at 1550 nm"
ROUGH = {"roughness": 0.85, "specular": 0.25}
COATED = {"roughness": 0.35, "specular": 0.5}
MARKING = 0.15
"""Retroreflected luminance of a street's markings with beads [cd/(lx m2)], EN 1436 class R3."""


def _plain(
    radio: str, lidar: float, color: tuple[float, float, float], lamp: str | None = None, **floats: float
) -> Bsdf:
    return Bsdf("principled", radio, lidar, TYPICAL, color=color, floats=floats or ROUGH, lamp=lamp)


def _printed(texture: str, radio: str = "plastic", lidar: float = 0.5, **floats: float) -> Bsdf:
    return Bsdf("principled", radio, lidar, TYPICAL, texture=texture, floats=floats or COATED)


MATERIALS: dict[str, Bsdf] = {
    "lining_concrete": _printed("lining_concrete.png", "concrete", 0.35, **ROUGH),
    "lining_coated": _printed("lining_coated.png", "concrete", 0.55, **COATED),
    "garage_concrete": _printed("garage_concrete.png", "concrete", 0.40, **ROUGH),
    "garage_core": _plain("concrete", 0.45, (0.20, 0.33, 0.36), roughness=0.6),
    "garage_floor": _printed("garage_floor.png", "concrete", 0.30, roughness=0.22, specular=0.5),
    "lamp_indoor": _plain("plastic", 0.50, (0.8, 0.8, 0.78), "indoor", roughness=0.4),
    "signal_green": _plain("plastic", 0.15, (0.005, 0.06, 0.03), "signal_green", roughness=0.15),
    "signal_amber": _plain("plastic", 0.15, (0.10, 0.045, 0.003), "signal_amber", roughness=0.15),
    "signal_red": _plain("plastic", 0.15, (0.08, 0.003, 0.003), "signal_red", roughness=0.15),
    "lane_green_on": _plain("plastic", 0.30, (0.02, 0.35, 0.12), "lane_green", roughness=0.3),
    "lane_red_on": _plain("plastic", 0.30, (0.45, 0.01, 0.01), "lane_red", roughness=0.3),
    "signal_green_off": _plain("plastic", 0.15, (0.005, 0.06, 0.03), roughness=0.15),
    "signal_amber_off": _plain("plastic", 0.15, (0.10, 0.045, 0.003), roughness=0.15),
    "signal_red_off": _plain("plastic", 0.15, (0.08, 0.003, 0.003), roughness=0.15),
    "grey_steel": _plain("metal", 0.45, (0.30, 0.31, 0.32), roughness=0.4, metallic=0.5),
    "duct_steel": _plain("metal", 0.50, (0.60, 0.61, 0.62), roughness=0.35, metallic=0.8),
    "paint_orange": _plain("metal", 0.50, (0.75, 0.20, 0.02), **COATED),
    "paint_green": _plain("metal", 0.45, (0.02, 0.28, 0.10), **COATED),
    "paint_red": _plain("metal", 0.45, (0.50, 0.02, 0.02), **COATED),
    "paint_yellow": _plain("metal", 0.55, (0.80, 0.52, 0.03), **COATED),
    "paint_blue": _plain("metal", 0.40, (0.02, 0.08, 0.35), **COATED),
    "cast_iron": _plain("metal", 0.20, (0.05, 0.048, 0.045), roughness=0.6, metallic=0.4),
    "line_white": replace(
        _plain("road_paint", 0.55, (0.72, 0.72, 0.70), roughness=0.6), retroreflected_luminance=MARKING
    ),
    "line_yellow": replace(
        _plain("road_paint", 0.50, (0.72, 0.48, 0.05), roughness=0.6), retroreflected_luminance=MARKING
    ),
    "black_gloss": _plain("plastic", 0.06, (0.012, 0.012, 0.013), roughness=0.3),
    "sign_sos": _printed("sign_sos.png"),
    "sign_exit": _printed("sign_exit.png"),
    "sign_70": _printed("sign_70.png", "metal", 0.6),
    "sign_parking": _printed("sign_parking.png"),
    "sign_height": _printed("sign_height.png", "metal", 0.6),
}
"""Name of the bsdf -> its properties."""


def mottled(size: int, seed: int, base: float, grain: float, stain: float) -> Array:
    """Return uneven grey around `base`, shape (size, size): fine grain and large stains."""
    fine = textures.periodic_noise(size, seed, 0.4, 10.0)
    return base + grain * fine + stain * textures.periodic_noise(size, seed + 1, 1.5, 1.0, 10.0)


def lining_concrete(seed: int, size: int = 256) -> Array:
    """Return shuttered concrete with soot, a tile of 5 m, shape (size, size, 3)."""
    tone = mottled(size, seed + 301, 0.47, 0.03, 0.05)
    k = np.arange(size)
    tone[(k % (size // 4)) < 2, :] -= 0.10
    tone[:, (k % (size // 2)) < 2] -= 0.12
    return textures.tinted(tone, (0.15, 0.145, 0.14), (0.88, 0.87, 0.84))


def lining_coated(seed: int, size: int = 256) -> Array:
    """Return a light coating in panels of 1.25 m x half the wall's height, dirty at the foot, shape (size, size, 3).

    v = 0 is the foot.
    """
    tone = mottled(size, seed + 311, 0.86, 0.012, 0.02)
    k = np.arange(size)
    up = 1.0 - (k + 0.5) / size
    tone -= 0.30 * np.exp(-up / 0.16)[:, None] * (1.0 + 0.3 * textures.periodic_noise(size, seed + 315, 1.2, 2.0))
    tone[:, (k % (size // 4)) < 2] *= 0.72
    tone[(k % (size // 2)) < 2, :] *= 0.72
    return textures.tinted(tone, (0.14, 0.13, 0.115), (0.93, 0.92, 0.86))


def garage_concrete(seed: int, size: int = 256) -> Array:
    """Return painted, slightly stained concrete, a tile of 4 m, shape (size, size, 3)."""
    return textures.tinted(mottled(size, seed + 321, 0.70, 0.02, 0.035), (0.18, 0.18, 0.175), (0.95, 0.945, 0.93))


def garage_floor(seed: int, size: int = 512) -> Array:
    """Return a coated floor with tyre rubber and stains, a tile of 8 m, shape (size, size, 3)."""
    tone = mottled(size, seed + 331, 0.52, 0.015, 0.04)
    drops = textures.periodic_noise(size, seed + 335, 0.9, 6.0, 60.0)
    tone -= 0.16 * np.clip(drops - 2.0, 0.0, 1.0)
    return textures.tinted(tone, (0.16, 0.17, 0.175), (0.80, 0.81, 0.81))


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Return the type of signs."""
    return ImageFont.load_default(size)


def lettered(
    width: int, height: int, text: str, ground: tuple[int, int, int], ink: tuple[int, int, int], share: float = 0.6
) -> Image.Image:
    """Return a plate with centred text; `share` is the height of the letters in that of a line of the plate."""
    big = Image.new("RGB", (4 * width, 4 * height), ground)
    draw = ImageDraw.Draw(big)
    lines = text.split("\n")
    draw.multiline_text(
        (2 * width, 2 * height),
        text,
        ink,
        font(4 * height * share / len(lines)),
        anchor="mm",
        align="center",
        spacing=4 * height * 0.04,
    )
    return big.resize((width, height), Image.Resampling.LANCZOS)


def running_man(size: int, ground: tuple[int, int, int] = (0, 120, 60)) -> Image.Image:
    """Return the sign of an emergency exit: a running figure and a doorway."""
    s = 4 * size
    image = Image.new("RGB", (s, s), ground)
    draw, white = ImageDraw.Draw(image), (240, 245, 240)
    draw.rectangle([0.60 * s, 0.12 * s, 0.88 * s, 0.90 * s], fill=white)
    draw.ellipse([0.36 * s, 0.12 * s, 0.48 * s, 0.24 * s], fill=white)
    for line in (
        [(0.40, 0.28), (0.34, 0.52)],
        [(0.34, 0.52), (0.46, 0.62), (0.42, 0.84)],
        [(0.34, 0.52), (0.28, 0.70), (0.12, 0.74)],
        [(0.38, 0.32), (0.24, 0.36), (0.18, 0.48)],
        [(0.40, 0.32), (0.50, 0.42), (0.58, 0.38)],
    ):
        draw.line([(x * s, y * s) for x, y in line], fill=white, width=int(0.075 * s), joint="curve")
    return image.resize((size, size), Image.Resampling.LANCZOS)


def limit(text: str, size: int = 128) -> Image.Image:
    """Return a round speed-limit sign (on a square image) with any text."""
    s = 4 * size
    image = Image.new("RGB", (s, s), (196, 18, 28))
    draw = ImageDraw.Draw(image)
    draw.ellipse([0.115 * s, 0.115 * s, 0.885 * s, 0.885 * s], fill=(240, 240, 238))
    draw.text(
        (0.5 * s, 0.5 * s),
        text,
        (20, 20, 22),
        font(0.42 * s if len(text) < 3 else 0.26 * s),
        anchor="mm",
        stroke_width=int(0.012 * s),
    )
    return image.resize((size, size), Image.Resampling.LANCZOS)


IMAGES: dict[str, Callable[[int], Any]] = {
    "lining_concrete.png": lining_concrete,
    "lining_coated.png": lining_coated,
    "garage_concrete.png": garage_concrete,
    "garage_floor.png": garage_floor,
    "sign_sos.png": lambda seed: lettered(96, 96, "SOS", (214, 88, 12), (250, 250, 250), 0.36),
    "sign_exit.png": lambda seed: running_man(96),
    "sign_70.png": lambda seed: limit("70"),
    "sign_parking.png": lambda seed: lettered(96, 96, "P", (18, 70, 165), (250, 250, 250), 0.8),
    "sign_height.png": lambda seed: limit("2.1m"),
    "asphalt.png": images.asphalt,
    "puddles.png": lambda seed: textures.puddles(128, seed + 7, (1.2, 2.76, 4.74, 6.3), 7.5),
    "concrete.png": images.concrete,
    "marking.png": images.marking,
    "grass.png": lambda seed: textures.grass(256, seed + 11),
    "gravel.png": lambda seed: textures.gravel(256, seed + 21),
    "leaves.png": images.leaves,
    "bark.png": lambda seed: textures.bark(128, seed + 31),
    "paving.png": images.paving,
}
"""File -> function of the seed that draws it; also those of the palette that the scenes with these materials use."""
