"""What is drawn at random for a scenario: colours, material values, placements.

Each draw has a generator of its own, named after what it is for, so that one switch does not change what another draws,
nor one actor what another gets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scarl_sionna.core import seeds
from scarl_sionna.core.untrusted.toml_text import read_toml
from scarl_sionna.scene.document.model import SceneDocument
from scarl_sionna.scene.document.staging import without_number
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial

from .spec.actors import JitterSpec

Color = tuple[float, float, float]

FACTOR = 1.5
"""Within what factor roughness and lidar reflectance are drawn; materials.toml states it for the reflectance."""
RANGES_FILE = Path(__file__).with_name("material_ranges.toml")

PAINTS: tuple[tuple[float, Color], ...] = (
    (0.30, (0.70, 0.70, 0.68)), (0.20, (0.012, 0.012, 0.014)), (0.18, (0.16, 0.165, 0.17)), (0.12, (0.50, 0.51, 0.52)),
    (0.09, (0.012, 0.045, 0.16)), (0.06, (0.36, 0.012, 0.014)), (0.02, (0.02, 0.09, 0.04)), (0.02, (0.28, 0.20, 0.11)),
    (0.01, (0.55, 0.36, 0.02)),
)  # fmt: skip # a table
"""Share and linear RGB of car paints: white, black, grey, silver, blue, red, green, brown, yellow. Shares are rounded
from the order in which makers of paint report the colours of new cars."""
CLOTHES: tuple[tuple[float, Color], ...] = (
    (0.2, (0.02, 0.02, 0.023)), (0.2, (0.03, 0.05, 0.12)), (0.15, (0.16, 0.165, 0.175)), (0.1, (0.6, 0.6, 0.58)),
    (0.1, (0.22, 0.17, 0.10)), (0.1, (0.36, 0.03, 0.035)), (0.05, (0.10, 0.11, 0.045)), (0.05, (0.05, 0.2, 0.1)),
    (0.05, (0.6, 0.45, 0.03)),
)  # fmt: skip # a table
"""Share and linear RGB of garments and of bicycles."""


def draw_look(
    seed: int, name: str, variants: Mapping[str, Mapping[str, Sequence[float]]], motion: str
) -> tuple[str | None, dict[str, Color]]:
    """Return a variant of an actor model, and colours for what its variants colour.

    Parameters
    ----------
    seed : int
        Of the scenario.
    name : str
        Of the actor.
    variants : mapping
        Colours of BSDFs by variant, as an actor model has them.
    motion : str
        How the model moves: ``vehicle`` takes car paints, others take the colours of clothes.
    """
    if not variants:
        return None, {}
    rng = seeds.generator(seed, "scenario_colors", actor=name)
    names = list(variants)
    variant = names[int(rng.integers(len(names)))]
    shares, palette = zip(*(PAINTS if motion == "vehicle" else CLOTHES), strict=True)
    shares = np.array(shares) / sum(shares)
    colors: dict[str, Color] = {}
    for bsdf in sorted(variants[variant]):
        base = np.array(palette[int(rng.choice(len(palette), p=shares))])
        red, green, blue = np.clip(base * rng.uniform(0.85, 1.15), 0.0, 1.0)
        colors[bsdf] = (round(float(red), 6), round(float(green), 6), round(float(blue), 6))
    return variant, colors


@dataclass(frozen=True)
class Jitter:
    """Shift along the heading and to the left [m], and turn [deg]."""

    along: float = 0.0
    lateral: float = 0.0
    yaw_deg: float = 0.0


def draw_jitter(seed: int, name: str, spec: JitterSpec | None, attempt: int = 0) -> Jitter:
    """Return the shift of an actor; `attempt` counts the draws that were given up because bodies touched."""
    if spec is None:
        return Jitter()
    rng = seeds.generator(seed, "scenario_placements", actor=name, attempt=attempt)
    along, lateral, yaw = rng.uniform(-1.0, 1.0, 3)
    return Jitter(float(along * spec.along), float(lateral * spec.lateral), float(yaw * spec.yaw_deg))


@cache
def material_ranges() -> dict[str, dict[str, Any]]:
    """Return between what the values of the built-in radio materials may lie, by material and field."""
    return read_toml(RANGES_FILE)


def draw_materials(seed: int, table: MaterialTable) -> MaterialTable:
    """Return a table of radio materials with values drawn within their uncertainty.

    Materials without a range stay as they are.
    """
    ranges = material_ranges()
    return MaterialTable(_drawn(material, seed, ranges.get(name)) for name, material in table.items())


def _drawn(material: RadioMaterial, seed: int, ranges: Mapping[str, Any] | None) -> RadioMaterial:
    if ranges is None:
        return material
    rng = seeds.generator(seed, "scenario_materials", material=material.name)
    draws = dict(zip(("relative_permittivity", "conductivity", "thickness"), rng.uniform(size=3), strict=True))
    rough, bright = (float(FACTOR**power) for power in rng.uniform(-1.0, 1.0, 2))
    if ranges.get("together"):
        draws["conductivity"] = draws["relative_permittivity"]
    changes: dict[str, float] = {}
    for key, draw in draws.items():
        if key in ranges:
            lower, upper = ranges[key]
            even = key == "relative_permittivity"
            changes[key] = float(lower + draw * (upper - lower) if even else lower * (upper / lower) ** draw)
    changes["roughness_rms"] = material.roughness_rms * rough
    changes["lidar_reflectance"] = min(material.lidar_reflectance * bright, 1.0 - material.lidar_transmittance)
    return material.with_(**changes)


def draw_reflectances(seed: int, document: SceneDocument) -> SceneDocument:
    """Return a scene whose own lidar reflectances, where its files state them, are drawn within their uncertainty."""
    materials = {}
    for bsdf, entry in document.materials.items():
        if entry.lidar_reflectance is not None:
            drawn = seeds.generator(seed, "scenario_reflectances", bsdf=without_number(bsdf)).uniform(-1.0, 1.0)
            factor = FACTOR**drawn
            most = 1.0 - (entry.lidar_transmittance or 0.0)
            entry = replace(entry, lidar_reflectance=min(float(entry.lidar_reflectance * factor), most))
        materials[bsdf] = entry
    return replace(document, materials=materials)
