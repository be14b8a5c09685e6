"""Wet surfaces: what a film of water makes of the radio materials and of the lidar's reflectances of a scene."""

from __future__ import annotations

import math
from dataclasses import replace

from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scene.document.model import MaterialEntry, SceneDocument

from .dielectrics import CELSIUS
from .table import MaterialTable

WET_DARKENING = 0.5
"""Diffuse reflectance of a wet rough surface relative to the dry one. J. Lekner, M. C. Dorf, "Why some things are
darker when wet", Applied Optics 27(7), 1988: internal reflection in the film gives about 0.5 for the reflectances of
asphalt and soil."""
WET_BEADS = 0.25
"""Retroreflected luminance of a wet marking relative to the dry one: EN 1436 has classes of 25 to 75 wet, 100 to 300
dry."""

WATER_ABSORPTION = 1.0e3
"""Absorption coefficient of liquid water at 1550 nm [1/m], within about 20 %: L. Kou, D. Labrie, P. Chylek, Appl. Opt.
32(19), 1993."""
LEAST_FILM = 1e-7
"""A thinner film [m] changes no reflectance by 0.01 dB and is left out."""


def wet_surfaces(
    document: SceneDocument, materials: MaterialTable, weather: Weather
) -> tuple[SceneDocument, MaterialTable]:
    r"""Return a dry scene's document and radio materials as they are in a weather; the same objects where it is dry.

    Parameters
    ----------
    document : SceneDocument
    materials : MaterialTable
    weather : Weather

    Notes
    -----
    A material of the scene takes the share `wets` of the wetness: a film of water of that share of
    ``weather.film_thickness`` lies on its radio material, which gets a name of its own ("asphalt, 0.5 mm of water");
    the `water_film` of an entry itself stays where it is thicker. Its diffuse reflectance at the lidar's wavelength
    falls as that of a rough surface in visible light (:data:`WET_DARKENING`), and by two passes through the film:

    .. math:: \rho_w = \rho \, [1 - w (1 - 0.5)] \, e^{-2 \alpha d}

    *Not modelled*: texture that stands out of the film, single drops on cars and signs, water running off.
    """
    if weather.surface_wetness == 0.0:
        return document, materials
    table, entries = dict(materials), {}
    for bsdf_id, entry in document.materials.items():
        depth = weather.film_thickness * entry.wets
        if depth <= LEAST_FILM:
            entries[bsdf_id] = entry
            continue
        dry = materials[entry.radio]
        name = dry.name
        if depth > dry.water_film:
            name = f"{dry.name}, {depth * 1e3:.6g} mm of water"
            temperature = weather.temperature_celsius + CELSIUS
            table[name] = dry.with_(name=name, water_film=depth, water_temperature=temperature)
        entries[bsdf_id] = _wet_entry(entry, name, dry.lidar_reflectance, weather.surface_wetness * entry.wets, depth)
    return replace(document, materials=entries), MaterialTable(table.values())


def _wet_entry(entry: MaterialEntry, radio: str, reflectance: float, amount: float, depth: float) -> MaterialEntry:
    own = reflectance if entry.lidar_reflectance is None else entry.lidar_reflectance
    factor = (1.0 - amount * (1.0 - WET_DARKENING)) * math.exp(-2.0 * WATER_ABSORPTION * depth)
    beads = entry.retroreflected_luminance * (1.0 - amount * (1.0 - WET_BEADS))
    return replace(entry, radio=radio, lidar_reflectance=own * factor, retroreflected_luminance=beads)
