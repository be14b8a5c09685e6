"""The optical twin's BSDFs and emitters under a lighting: sky, sun, lamps, and wet ground."""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from functools import lru_cache
from pathlib import Path
from types import ModuleType

import numpy as np
import numpy.typing as npt
from PIL import Image

from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import MitsubaObject
from scarl_sionna.scene.document.model import MaterialEntry, SceneDocument
from scarl_sionna.scene.materials.wet import WET_DARKENING

from .sky import LOWEST_SUN_DEG, clear_sky, clouded_light, sky_image, sun_direction

WET_ROUGHNESS = 0.28
"""Of a wet surface without standing water."""
PUDDLE_ROUGHNESS = 0.02
_WATER_SPECULAR = 0.25
"""`specular` of Mitsuba's principled BSDF for n = 1.33: 0.08 s = ((n - 1) / (n + 1))^2 = 0.02."""


def sky_elements(lighting: Lighting, folder: Path, mi: ModuleType) -> list[ET.Element]:
    """Return the emitters of sun and sky; an environment map is written into `folder`."""
    if lighting.cloud_cover == 0.0 and lighting.sun_elevation_deg >= LOWEST_SUN_DEG:
        element = ET.Element("emitter", {"type": "sunsky"})
        ET.SubElement(element, "vector", {"name": "sun_direction", "value": _text(sun_direction(lighting))})
        ET.SubElement(element, "float", {"name": "turbidity", "value": repr(lighting.turbidity)})
        return [element]
    image, sun = _sky_of(
        mi, lighting.with_(headlamps=False, street_lamps=False, wetness=0.0, visibility=None, exposure=1.0)
    )
    file = folder / "sky.exr"
    file.write_bytes(image)
    sky = ET.Element("emitter", {"type": "envmap"})
    ET.SubElement(sky, "string", {"name": "filename", "value": str(file)})
    turn = ET.SubElement(sky, "transform", {"name": "to_world"})
    ET.SubElement(turn, "rotate", {"x": "1", "angle": "90"})
    if lighting.cloud_cover >= 1.0 or sun.max() == 0.0:
        return [sky]
    element = ET.Element("emitter", {"type": "directional"})
    ET.SubElement(element, "vector", {"name": "direction", "value": _text(-sun_direction(lighting))})
    ET.SubElement(element, "rgb", {"name": "irradiance", "value": _text(sun)})
    return [sky, element]


@lru_cache(maxsize=4)
def _sky_of(mi: ModuleType, lighting: Lighting) -> tuple[bytes, npt.NDArray[np.float64]]:
    """Return the environment map as a file and the sun's irradiance under clouds.

    Kept, since worlds are often loaded again: drawing the map takes 0.6 s, packing it into a file 0.3 s.
    """
    clear, sun = clear_sky(mi, lighting)
    packed = mi.MemoryStream()
    mi.Bitmap(sky_image(lighting, clear, sun)).write(packed, mi.Bitmap.FileFormat.OpenEXR)
    return packed.raw_buffer(), sun * clouded_light(lighting, clear, sun).sun_share


def _text(values: npt.ArrayLike) -> str:
    return ", ".join(repr(float(value)) for value in np.asarray(values))


def wet_bsdfs(
    bsdfs: dict[str, ET.Element], document: SceneDocument, lighting: Lighting, folder: Path
) -> dict[str, ET.Element]:
    """Return the BSDFs with a film of water on those that take it; textures are written into `folder`.

    A principled BSDF gets darker, smoother and the reflectance of water; where its material names a map of puddles,
    smooth water stands there. Other BSDFs stay dry.
    """
    wet = {}
    for bsdf_id, element in bsdfs.items():
        material = document.materials[bsdf_id]
        amount = lighting.wetness * material.wets
        wet[bsdf_id] = copy.deepcopy(element)
        principled = next((e for e in wet[bsdf_id].iter("bsdf") if e.get("type") == "principled"), None)
        if amount > 0.0 and principled is not None:
            _wet(principled, material, amount, folder / f"wet_{bsdf_id}")
    return wet


def _wet(principled: ET.Element, material: MaterialEntry, amount: float, stem: Path) -> None:
    dark = 1.0 - amount * (1.0 - WET_DARKENING)
    water = None
    if material.puddles is not None:
        level = np.asarray(Image.open(material.puddles).convert("L"), dtype=np.float64) / 255.0
        water = np.clip((level - (1.0 - 0.5 * amount)) / 0.12 + 0.5, 0.0, 1.0) * amount  # fuller when wetter
    for child in principled:
        if child.get("name") == "base_color" and child.tag == "rgb":
            child.set(
                "value", _text(dark * np.array([float(v) for v in str(child.get("value")).replace(",", " ").split()]))
            )
        elif child.get("name") == "base_color" and child.tag == "texture":
            file = next(e for e in child.iter("string") if e.get("name") == "filename")
            srgb = np.asarray(Image.open(str(file.get("value"))).convert("RGB"), dtype=np.float64) / 255.0
            darker = srgb * dark ** (1.0 / 2.2)
            Image.fromarray(np.rint(255.0 * darker).astype(np.uint8)).save(stem.with_suffix(".png"))
            file.set("value", str(stem.with_suffix(".png")))
    roughness = float(_take(principled, "roughness") or 0.5)
    _take(principled, "specular")
    film = (1.0 - amount) * roughness + amount * min(roughness, WET_ROUGHNESS)
    ET.SubElement(principled, "float", {"name": "specular", "value": repr(_WATER_SPECULAR)})
    if water is None:
        ET.SubElement(principled, "float", {"name": "roughness", "value": repr(film)})
        return
    mapped = (1.0 - water) * film + water * PUDDLE_ROUGHNESS
    file_name = stem.with_name(stem.name + "_roughness.png")
    Image.fromarray(np.rint(255.0 * mapped).astype(np.uint8)).save(file_name)
    texture = ET.SubElement(principled, "texture", {"type": "bitmap", "name": "roughness"})
    ET.SubElement(texture, "string", {"name": "filename", "value": str(file_name)})
    ET.SubElement(texture, "boolean", {"name": "raw", "value": "true"})


def _take(element: ET.Element, name: str) -> str | None:
    """Remove a plain parameter of a BSDF and return its value."""
    for child in list(element):
        if child.get("name") == name and child.tag == "float":
            element.remove(child)
            return child.get("value")
    return None


def airlight(mi: ModuleType, scene: MitsubaObject) -> npt.NDArray[np.float64]:
    """Return the mean radiance of the sky just above the horizon, shape (3,): what haze far away looks like.

    In the unit of the scenes. Zero for a scene without sky. Run it inside ``variant.optical()``.

    Notes
    -----
    H. Koschmieder, "Theorie der horizontalen Sichtweite", 1924: haze of the brightness of the horizon.
    """
    environment = scene.environment()
    if environment is None:
        return np.zeros(3)
    azimuth = np.arange(72) * (2.0 * np.pi / 72)
    direction = np.stack([np.cos(azimuth), np.sin(azimuth), np.full(72, np.tan(np.radians(3.0)))])
    direction /= np.linalg.norm(direction, axis=0)
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = Device(mi).single_vectors(-direction.T)
    radiance = np.array(environment.eval(interaction, True), dtype=np.float64).reshape(3, -1)
    return np.median(radiance, axis=1)  # median: not the sun's disc
