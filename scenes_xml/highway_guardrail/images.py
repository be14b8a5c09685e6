"""Textures of the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.surfaces import textures
from . import layout as at
from .layout import LANE_LEFT, PAVEMENT_LEFT, PAVEMENT_RIGHT


def write(folder: Path, seed: int) -> None:
    """Write every texture of the scene into `folder`."""
    span = PAVEMENT_LEFT - PAVEMENT_RIGHT
    tracks = tuple(lane + wheel - PAVEMENT_RIGHT for lane in (0.0, LANE_LEFT) for wheel in (-0.78, 0.78))
    road = textures.asphalt(1024, seed + 1, tracks, span)
    road[textures.crack_lines(1024, seed + 4)] *= 0.62
    middle = int(1024 * (0.5 * (at.LANE_RIGHT + at.LANE_LEFT) - PAVEMENT_RIGHT) / span)
    road[:, middle - 1 : middle + 1] *= 0.72  # joint between the lanes
    oil = textures.periodic_noise(1024, seed + 9, 1.2, 2.0, 80.0)
    lane = (np.arange(1024) + 0.5) / 1024 * span + PAVEMENT_RIGHT
    drip = sum(np.exp(-(((lane - c) / 0.30) ** 2)) for c in (at.LANE_RIGHT, at.LANE_LEFT))
    road *= (1.0 - (0.07 + 0.03 * np.clip(oil, -1, 2)) * drip[None, :])[..., None]
    textures.save(folder / "asphalt.png", road, 32)
    textures.save(folder / "puddles.png", textures.puddles(512, seed + 7, tracks, span), 16)
    textures.save(folder / "grass.png", textures.grass(768, seed + 11), 28)
    textures.save(folder / "gravel.png", textures.gravel(512, seed + 21), 40)
    textures.save(folder / "bark.png", textures.bark(256, seed + 31), 40)
    textures.save(folder / "plaster.png", textures.plaster(512, seed + 41), 64)
    textures.save(folder / "bricks.png", textures.bricks(512, seed + 51), 64)
    textures.save(folder / "roof_tiles.png", textures.roof_tiles(512, seed + 61), 64)
    worn = 0.80 + 0.04 * textures.periodic_noise(512, seed + 71, 0.3, 20.0)
    worn += 0.05 * textures.periodic_noise(512, seed + 73, 1.3, 1.0, 16.0)
    chips = textures.periodic_noise(512, seed + 72, 0.6, 8.0) + 0.8 * textures.periodic_noise(
        512, seed + 74, 1.2, 1.0, 8.0
    )
    chipped = np.clip((chips - 1.7) / 0.25, 0.0, 1.0)
    textures.save(folder / "marking.png", worn * (1.0 - chipped) + 0.42 * chipped, 48)
    stain = (
        0.58
        + 0.04 * textures.periodic_noise(512, seed + 81, 0.4, 10.0)
        + 0.05 * textures.periodic_noise(512, seed + 82, 1.4, 1.0, 12.0)
    )
    textures.save(folder / "concrete.png", textures.tinted(stain, (0.2, 0.2, 0.19), (0.9, 0.89, 0.86)), 48)
    textures.sign_speed(256).save(folder / "sign_speed.png", optimize=True)
    textures.sign_bend(256).save(folder / "sign_bend.png", optimize=True)
    textures.chevrons(512, 128).save(folder / "sign_chevron.png", optimize=True)
    textures.headlamp(256, 96).save(folder / "headlamp.png", optimize=True)
    textures.taillamp(128, 192).save(folder / "taillamp.png", optimize=True)
    textures.plate(256, 56, seed + 91).save(folder / "plate.png", optimize=True)
    tone = np.linspace(0.0, 1.0, 64)[None, :] * np.ones((4, 1))
    green = textures.tinted(tone, (0.26, 0.36, 0.10), (0.52, 0.60, 0.22))
    green[:, 58:] = (0.62, 0.60, 0.25)
    textures.save(folder / "leaves.png", green)
