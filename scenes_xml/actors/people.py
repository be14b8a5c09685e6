"""What people wear and carry, and their skin and hair, as materials of models."""

from __future__ import annotations

from ..generators.xml import Bsdf
from .model import Color

CREASE = 70.0
CLOTH = {"roughness": 0.9, "specular": 0.15, "sheen": 0.4}
DRESSED = "estimate; for the radar the mean of garments on skin"
SKIN = "estimate, skin at 1550 nm: water absorbs"


def cloth(color: Color, lidar: float = 0.5) -> Bsdf:
    """Return the look of clothes on a body."""
    return Bsdf("principled", "clothed_skin", lidar, DRESSED, color=color, floats=CLOTH)


def bare(color: Color) -> Bsdf:
    """Return the look of skin."""
    return Bsdf("principled", "skin", 0.12, SKIN, color=color, floats={"roughness": 0.55, "specular": 0.35})


def hair(color: Color) -> Bsdf:
    """Return the look of hair, through which a radar sees the skin."""
    return Bsdf(
        "principled", "skin", 0.30, "estimate, dark hair", color=color, floats={"roughness": 0.6, "specular": 0.3}
    )


def shoes(color: Color) -> Bsdf:
    """Return the look of shoes."""
    return Bsdf(
        "principled",
        "rubber",
        0.25,
        "estimate, rubber and leather",
        color=color,
        floats={"roughness": 0.5, "specular": 0.4},
    )


def bag(color: Color) -> Bsdf:
    """Return the look of a bag of fabric."""
    return Bsdf(
        "principled",
        "clothing",
        0.45,
        "estimate, woven fabric; for the radar without what is in it",
        color=color,
        floats=CLOTH,
    )


def tinted(bsdf: Bsdf, color: Color | None) -> Bsdf:
    """Return a material in another colour, or itself."""
    return bsdf if color is None else Bsdf(**{**vars(bsdf), "color": color})
