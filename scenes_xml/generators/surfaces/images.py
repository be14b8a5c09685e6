"""Textures by file name: tileable surfaces of 256 to 512 pixels, which builders of scenes share.

Each is made from a seed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from ..geometry.mesh import Array
from . import textures

Colour = tuple[float, float, float]


def save(path: Path, image: Array | Image.Image, levels: int = 32) -> None:
    """Write a PNG: an image as it is, or sRGB 0 to 1 of shape (h, w[, 3]).

    Arrays are rounded to `levels` steps, so that files stay small.
    """
    if isinstance(image, Image.Image):
        image.save(path, compress_level=textures.PNG_LEVEL)
    else:
        textures.save(path, image, levels)


def asphalt(seed: int, size: int = 384, tone: float = 1.0) -> Array:
    """Return asphalt without wheel tracks, for a tile of 4 m."""
    value = (
        0.42
        + 0.085 * textures.periodic_noise(size, seed + 1, 0.15, 30.0)
        + 0.03 * textures.periodic_noise(size, seed + 2, 1.3, 1.0, 30.0)
    )
    value = np.where(textures.periodic_noise(size, seed + 3, 0.0, 100.0) > 2.1, value + 0.14, value)
    return textures.tinted(value, (0.20, 0.20, 0.205), (0.66, 0.65, 0.63)) * tone


def paving(seed: int, size: int = 256, slabs: int = 4) -> Array:
    """Return concrete slabs with joints; 0.3 m each for a tile of 1.2 m."""
    tone = (
        0.56
        + 0.035 * textures.periodic_noise(size, seed + 5, 0.5, 6.0)
        + 0.03 * textures.periodic_noise(size, seed + 6, 1.5, 1.0, 10.0)
    )
    index = np.arange(size) * slabs // size
    own = np.random.default_rng(seed + 7).uniform(-0.035, 0.035, (slabs, slabs))
    tone = tone + own[index[:, None], index[None, :]]
    within = np.arange(size) % (size // slabs)
    edge = np.minimum(within, size // slabs - 1 - within)
    joint = np.minimum(edge[:, None], edge[None, :]) < 1
    return textures.tinted(np.where(joint, tone * 0.62, tone), (0.16, 0.155, 0.15), (0.92, 0.90, 0.87))


def setts(seed: int, size: int = 256, rows: int = 12) -> Array:
    """Return granite setts of some 0.1 m for a tile of 1.2 m, each of its own tone."""
    generator = np.random.default_rng(seed + 8)
    v, u = np.meshgrid((np.arange(size) + 0.5) / size * rows, (np.arange(size) + 0.5) / size * rows, indexing="ij")
    row = np.floor(v).astype(int)
    u = (u + 0.5 * (row % 2)) % rows
    tone = generator.uniform(-1, 1, (rows, rows))[row, np.floor(u).astype(int)]
    round_top = 1.0 - 1.3 * np.maximum(np.abs(u % 1 - 0.5), np.abs(v % 1 - 0.5)) ** 2
    joint = np.maximum(np.abs(u % 1 - 0.5), np.abs(v % 1 - 0.5)) > 0.44
    value = 0.55 * round_top + 0.11 * tone + 0.05 * textures.periodic_noise(size, seed + 9, 0.3, 10.0)
    return textures.tinted(np.where(joint, 0.22, value), (0.16, 0.155, 0.15), (0.80, 0.78, 0.75))


def marking(seed: int, size: int = 256) -> Array:
    """Return worn road marking."""
    worn = (
        0.80
        + 0.04 * textures.periodic_noise(size, seed + 71, 0.3, 20.0)
        + 0.05 * textures.periodic_noise(size, seed + 73, 1.3, 1.0, 16.0)
    )
    chips = textures.periodic_noise(size, seed + 72, 0.6, 8.0) + 0.8 * textures.periodic_noise(
        size, seed + 74, 1.2, 1.0, 8.0
    )
    chipped = np.clip((chips - 1.7) / 0.25, 0.0, 1.0)
    return worn * (1.0 - chipped) + 0.42 * chipped


def concrete(seed: int, size: int = 256) -> Array:
    """Return weathered concrete."""
    stain = (
        0.58
        + 0.04 * textures.periodic_noise(size, seed + 81, 0.4, 10.0)
        + 0.05 * textures.periodic_noise(size, seed + 82, 1.4, 1.0, 12.0)
    )
    return textures.tinted(stain, (0.2, 0.2, 0.19), (0.9, 0.89, 0.86))


def plaster(tint: Colour, seed: int, size: int = 256) -> Array:
    """Return plaster of a tint."""
    return np.clip(textures.plaster(size, seed + 41) * np.array(tint), 0.0, 1.0)


def leaves(seed: int) -> Array:
    """Return the tones of leaf cards: along u one leaf after the other."""
    tone = np.linspace(0.0, 1.0, 64)[None, :] * np.ones((4, 1))
    green = textures.tinted(tone, (0.26, 0.36, 0.10), (0.52, 0.60, 0.22))
    green[:, 58:] = (0.62, 0.60, 0.25)
    return green


def hedge(seed: int, size: int = 256) -> Array:
    """Return a clipped hedge, for a tile of 1.5 m: small leaves with dark gaps."""
    fine = textures.periodic_noise(size, seed + 101, 0.25, 24.0)
    clumps = textures.periodic_noise(size, seed + 102, 1.1, 2.0, 24.0)
    value = 0.42 + 0.20 * fine + 0.12 * clumps
    return textures.tinted(value, (0.06, 0.10, 0.04), (0.42, 0.52, 0.22))


def soil(seed: int, size: int = 256) -> Array:
    """Return bare soil with clods, for a tile of 3 m."""
    value = (
        0.45
        + 0.14 * textures.periodic_noise(size, seed + 111, 0.6, 6.0)
        + 0.08 * textures.periodic_noise(size, seed + 112, 1.4, 1.0, 20.0)
    )
    return textures.tinted(value, (0.16, 0.11, 0.07), (0.52, 0.42, 0.31))


def wood(seed: int, size: int = 256, boards: int = 8) -> Array:
    """Return weathered boards, upright: grain along v, one tone a board."""
    generator = np.random.default_rng(seed + 121)
    column = np.arange(size) * boards // size
    grain = np.repeat(textures.periodic_noise(size, seed + 122, 0.6, 10.0)[: size // 8], 8, axis=0)
    joint = np.arange(size) % (size // boards) < 2
    value = 0.5 + 0.10 * grain + 0.10 * generator.uniform(-1, 1, boards)[column][None, :]
    return textures.tinted(np.where(joint[None, :], 0.08, value), (0.20, 0.14, 0.09), (0.66, 0.53, 0.39))


def manhole(seed: int, size: int = 128) -> Array:
    """Return the cast pattern of a manhole cover: studs in a ring."""
    v, u = np.meshgrid(*2 * [(np.arange(size) + 0.5) / size * 2 - 1], indexing="ij")
    r = np.hypot(u, v)
    studs = (np.sin(11 * np.pi * u) * np.sin(11 * np.pi * v) > 0.15) & (r < 0.78)
    value = 0.36 + 0.22 * studs + 0.15 * ((r > 0.82) & (r < 0.90)) - 0.22 * ((r > 0.90) & (r < 0.94))
    value = value + 0.04 * textures.periodic_noise(size, seed + 131, 0.4, 8.0)
    return textures.tinted(value, (0.07, 0.065, 0.06), (0.62, 0.58, 0.54))


def crop(seed: int, size: int = 256, rows: int = 16) -> Array:
    """Return ripe grain in drilled rows, for a tile of 4 m."""
    across = np.sin(2 * np.pi * rows * (np.arange(size) + 0.5) / size)
    value = (
        0.5
        + 0.12 * across[None, :]
        + 0.13 * textures.periodic_noise(size, seed + 141, 0.3, 20.0)
        + 0.07 * textures.periodic_noise(size, seed + 142, 1.3, 1.0, 14.0)
    )
    return textures.tinted(value, (0.40, 0.31, 0.13), (0.82, 0.70, 0.40))


_RED, _BLUE, _WHITE, _BLACK = (196, 18, 28), (20, 70, 160), (240, 240, 238), (20, 20, 22)


def _board(size: int, ground: tuple[int, int, int]) -> tuple[Image.Image, ImageDraw.ImageDraw, int]:
    image = Image.new("RGB", (4 * size, 4 * size), ground)
    return image, ImageDraw.Draw(image), 4 * size


def sign_crossing(seed: int, size: int = 192) -> Image.Image:
    """Return a blue square with a white triangle and a walker over a zebra."""
    image, draw, big = _board(size, (235, 235, 235))
    draw.rounded_rectangle((big // 40, big // 40, big - big // 40, big - big // 40), big // 18, fill=_BLUE)
    draw.polygon([(big * 0.5, big * 0.12), (big * 0.90, big * 0.84), (big * 0.10, big * 0.84)], fill=_WHITE)
    draw.ellipse((big * 0.485, big * 0.30, big * 0.565, big * 0.38), fill=_BLACK)
    for line in (
        [(0.52, 0.39), (0.49, 0.56)],
        [(0.49, 0.56), (0.56, 0.64), (0.57, 0.75)],
        [(0.49, 0.56), (0.44, 0.65), (0.37, 0.73)],
        [(0.52, 0.42), (0.45, 0.47), (0.41, 0.54)],
        [(0.52, 0.42), (0.58, 0.49), (0.64, 0.50)],
    ):
        draw.line([(x * big, y * big) for x, y in line], fill=_BLACK, width=big // 26, joint="curve")
    for x in np.arange(0.24, 0.76, 0.13):
        draw.rectangle((x * big, 0.77 * big, (x + 0.065) * big, 0.82 * big), fill=_BLACK)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def sign_yield(seed: int, size: int = 192) -> Image.Image:
    """Return the face of a triangle on its tip: red rim, white field; the sign's outline is that triangle."""
    image, draw, big = _board(size, _RED)
    draw.polygon([(0.5 * big, 0.80 * big), (0.155 * big, 0.125 * big), (0.845 * big, 0.125 * big)], fill=_WHITE)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def sign_roundabout(seed: int, size: int = 192) -> Image.Image:
    """Return a blue disc with three white arrows that turn anticlockwise."""
    image, draw, big = _board(size, _BLUE)
    for start in (20.0, 140.0, 260.0):
        draw.arc((0.24 * big, 0.24 * big, 0.76 * big, 0.76 * big), start, start + 78.0, fill=_WHITE, width=big // 11)
        angle = np.radians(start)  # y points down: an arrow against the angle turns anticlockwise
        tip, radius, half = angle - 0.42, 0.215 * big, 0.095 * big
        base = [
            ((0.5 * big) + (radius + d) * np.cos(angle), (0.5 * big) + (radius + d) * np.sin(angle))
            for d in (-half, half)
        ]
        draw.polygon([*base, (0.5 * big + radius * np.cos(tip), 0.5 * big + radius * np.sin(tip))], fill=_WHITE)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def sign_keep_right(seed: int, size: int = 192) -> Image.Image:
    """Return a blue disc with a white arrow down to the right."""
    image, draw, big = _board(size, _BLUE)
    draw.line([(0.30 * big, 0.30 * big), (0.62 * big, 0.62 * big)], fill=_WHITE, width=big // 9)
    draw.polygon([(0.76 * big, 0.76 * big), (0.76 * big, 0.46 * big), (0.46 * big, 0.76 * big)], fill=_WHITE)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def sign_zone(seed: int, size: int = 192) -> Image.Image:
    """Return a round speed limit of 30 km/h on a white board."""
    return textures.sign_speed(size, "30")


def sign_chevron(seed: int) -> Image.Image:
    """Return a bend board with arrows to the left."""
    return textures.chevrons(256, 64)


def _surface(
    function: Callable[[int, int], Image.Image | Array], shift: int, size: int, seed: int
) -> Image.Image | Array:
    return function(size, seed + shift)


IMAGES: dict[str, Callable[[int], Any]] = {
    "asphalt_plain.png": asphalt,
    "asphalt_dark.png": partial(asphalt, size=256, tone=0.78),
    "paving_slabs.png": paving,
    "setts.png": setts,
    "marking_worn.png": marking,
    "concrete_plain.png": concrete,
    "lawn.png": partial(_surface, textures.grass, 11, 384),
    "gravel_fine.png": partial(_surface, textures.gravel, 21, 256),
    "bark_furrowed.png": partial(_surface, textures.bark, 31, 128),
    "plaster_white.png": partial(plaster, (1.0, 1.0, 1.0)),
    "plaster_ochre.png": partial(plaster, (0.97, 0.87, 0.66)),
    "plaster_rose.png": partial(plaster, (0.88, 0.66, 0.58)),
    "plaster_cool.png": partial(plaster, (0.78, 0.81, 0.84)),
    "brick_bond.png": partial(_surface, textures.bricks, 51, 256),
    "tiles_red.png": partial(_surface, textures.roof_tiles, 61, 256),
    "tiles_dark.png": lambda seed: textures.roof_tiles(256, seed + 62) * np.array((0.52, 0.60, 0.66)),
    "leaf_tones.png": leaves,
    "hedge.png": hedge,
    "soil.png": soil,
    "crop.png": crop,
    "boards.png": wood,
    "manhole.png": manhole,
    "plaster.png": partial(plaster, (1.0, 1.0, 1.0)),
    "plaster_yellow.png": partial(plaster, (0.97, 0.89, 0.72)),
    "plaster_red.png": partial(plaster, (0.84, 0.64, 0.57)),
    "plaster_grey.png": partial(plaster, (0.76, 0.79, 0.82)),
    "bricks.png": partial(_surface, textures.bricks, 51, 512),
    "roof_tiles.png": partial(_surface, textures.roof_tiles, 61, 512),
    "headlamp.png": lambda seed: textures.headlamp(256, 96),
    "taillamp.png": lambda seed: textures.taillamp(128, 192),
    "plate.png": lambda seed: textures.plate(256, 56, seed + 91),
    "sign_speed.png": lambda seed: textures.sign_speed(256),
    "sign_bend.png": lambda seed: textures.sign_bend(256),
    "sign_chevron.png": lambda seed: textures.chevrons(512, 128),
    "sign_crossing.png": partial(sign_crossing, size=256),
    "sign_walkers.png": sign_crossing,
    "sign_yield.png": sign_yield,
    "sign_roundabout.png": sign_roundabout,
    "sign_keep_right.png": sign_keep_right,
    "sign_zone.png": sign_zone,
    "sign_bend_left.png": lambda seed: textures.sign_bend(192),
    "sign_arrows.png": sign_chevron,
    "sign_arrows_right.png": lambda seed: sign_chevron(seed).transpose(Image.Transpose.FLIP_LEFT_RIGHT),
}
"""File name -> function of the seed that returns sRGB values or an image."""
