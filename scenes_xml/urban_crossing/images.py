"""Textures of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from ..generators.geometry.mesh import Array
from ..generators.surfaces import textures
from ..highway_guardrail import images as shared
from .layout import KERB_LEFT, KERB_RIGHT, LANE_LEFT


def _paving(size: int, seed: int, slabs: int = 4) -> Array:
    """Return concrete slabs of 0.3 m with joints, in sRGB, for a tile of 1.2 m."""
    tone = (
        0.56
        + 0.035 * textures.periodic_noise(size, seed, 0.5, 6.0)
        + 0.03 * textures.periodic_noise(size, seed + 1, 1.5, 1.0, 10.0)
    )
    step = size // slabs
    index = np.arange(size) // step
    own = np.random.default_rng(seed + 2).uniform(-0.035, 0.035, (slabs, slabs))
    tone = tone + own[index[:, None], index[None, :]]
    edge = np.minimum(np.arange(size) % step, step - 1 - np.arange(size) % step)
    joint = np.minimum(edge[:, None], edge[None, :]) < max(1, size // 170)
    return textures.tinted(np.where(joint, tone * 0.62, tone), (0.16, 0.155, 0.15), (0.92, 0.90, 0.87))


def _sign_crossing(size: int) -> Image.Image:
    """Return a blue square with a white triangle and a walker over a zebra."""
    big = 4 * size
    image = Image.new("RGB", (big, big), (235, 235, 235))
    draw = ImageDraw.Draw(image)
    m = big // 40
    draw.rounded_rectangle((m, m, big - m, big - m), big // 18, fill=(20, 70, 160))
    draw.polygon([(big * 0.5, big * 0.12), (big * 0.90, big * 0.84), (big * 0.10, big * 0.84)], fill=(240, 240, 240))
    black, w = (15, 15, 15), big // 26
    draw.ellipse((big * 0.485, big * 0.30, big * 0.565, big * 0.38), fill=black)
    for line in (
        [(0.52, 0.39), (0.49, 0.56)],
        [(0.49, 0.56), (0.56, 0.64), (0.57, 0.75)],
        [(0.49, 0.56), (0.44, 0.65), (0.37, 0.73)],
        [(0.52, 0.42), (0.45, 0.47), (0.41, 0.54)],
        [(0.52, 0.42), (0.58, 0.49), (0.64, 0.50)],
    ):
        draw.line([(x * big, y * big) for x, y in line], fill=black, width=w, joint="curve")
    for x in np.arange(0.24, 0.76, 0.13):
        draw.rectangle((x * big, 0.77 * big, (x + 0.065) * big, 0.82 * big), fill=black)
    return image.resize((size, size), Image.Resampling.LANCZOS)


def write(folder: Path, seed: int, used: set[str]) -> None:
    """Write the textures named in `used` into `folder`."""
    shared.write(folder, seed)
    span = KERB_LEFT - KERB_RIGHT
    tracks = tuple(lane + wheel - KERB_RIGHT for lane in (0.0, LANE_LEFT) for wheel in (-0.78, 0.78))
    street = textures.asphalt(1024, seed + 1, tracks, span)
    street[textures.crack_lines(1024, seed + 4)] *= 0.66
    textures.save(folder / "asphalt.png", street, 32)
    textures.save(folder / "puddles.png", textures.puddles(512, seed + 7, tracks, span), 32)
    textures.save(folder / "paving.png", _paving(512, seed + 5), 48)
    light = textures.plaster(512, seed + 41)
    for name, tint in (("yellow", (0.97, 0.89, 0.72)), ("red", (0.84, 0.64, 0.57)), ("grey", (0.76, 0.79, 0.82))):
        textures.save(folder / f"plaster_{name}.png", np.clip(light * np.array(tint), 0.0, 1.0), 64)
    _sign_crossing(256).save(folder / "sign_crossing.png", optimize=True)
    for file in folder.glob("*.png"):
        if file.name not in used:
            file.unlink()
