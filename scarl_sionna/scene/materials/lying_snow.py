"""Lying snow: the scene's document with snow in place of the materials that it covers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

from scarl_sionna.scene.document.model import MaterialEntry, SceneDocument

SNOW_BSDF = "lying-snow"
"""Id of the BSDF and the material of what snow covers."""
ALBEDO = {"dry": (0.86, 0.87, 0.89), "wet": (0.70, 0.71, 0.73)}
"""Of visible light, linear RGB: fresh snow 0.8 to 0.9, old and melting snow 0.6 to 0.75 (S. G. Warren, "Optical
properties of snow", Rev. Geophys. 20(1), 1982)."""


def with_lying_snow(document: SceneDocument, shapes: Iterable[str], kind: Literal["dry", "wet"]) -> SceneDocument:
    """Return a scene's document in which shapes are covered with snow.

    Parameters
    ----------
    document : SceneDocument
    shapes : iterable of str
        Ids of the shapes.
    kind : str
        ``"dry"`` or ``"wet"``: the radio material is ``snow_dry`` or ``snow_wet``, whose entry has the lidar's
        reflectance.
    """
    root = ET.Element(document.root.tag, dict(document.root.attrib))
    outer = ET.SubElement(root, "bsdf", {"type": "twosided", "id": SNOW_BSDF})
    inner = ET.SubElement(outer, "bsdf", {"type": "diffuse"})
    color = " ".join(f"{value:g}" for value in ALBEDO[kind])
    ET.SubElement(inner, "rgb", {"name": "reflectance", "value": color})
    root.extend(document.root)
    covered = dict.fromkeys(shapes, SNOW_BSDF)
    return replace(
        document,
        root=root,
        bsdf_of_shape={**document.bsdf_of_shape, **covered},
        materials={**document.materials, SNOW_BSDF: MaterialEntry(f"snow_{kind}")},
    )
