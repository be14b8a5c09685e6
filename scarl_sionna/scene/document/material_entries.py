"""Reads what a scene.toml or an actor.toml says of the materials behind BSDFs."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from scarl_sionna.core.errors import MaterialError, SceneError, UnknownNameError
from scarl_sionna.core.untrusted.checked import check_keys

from .model import MaterialEntry
from .xml_file import property_of

MOST_RETROREFLECTION = 5000.0
"""[cd/(lx m2)]; prismatic sheets have up to 1000."""
_KEYS = {
    "radio", "lidar_reflectance", "lidar_transmittance", "retroreflection", "retroreflected_luminance", "wets", "lamp",
    "puddles", "source",
}  # fmt: skip # a table
LAMP_KINDS = (
    "headlamp",
    "taillamp",
    "indicator",
    "street_lamp",
    "indoor",
    "signal_red",
    "signal_amber",
    "signal_green",
    "lane_red",
    "lane_green",
)
"""What a material's `lamp` may be."""


def material_entries(
    root: ET.Element, table: dict[str, Any], used: Iterable[str], path: Path
) -> dict[str, MaterialEntry]:
    """Return the entry of every BSDF in use: from scene.toml, or from Sionna's naming of ITU materials."""
    types = {
        str(bsdf.get("id")): property_of(bsdf, "type")
        for bsdf in root.iter("bsdf")
        if bsdf.get("type") == "itu-radio-material"
    }
    entries = {}
    for bsdf_id in sorted(used):
        if bsdf_id in table:
            row = table[bsdf_id]
            check_keys(row, f"key of [materials.{bsdf_id}]", _KEYS)
            if "radio" not in row:
                raise MaterialError(f"[materials.{bsdf_id}] in {path.parent.name}/scene.toml lacks 'radio'")
            optical = {key: float(row[key]) for key in ("lidar_reflectance", "lidar_transmittance") if key in row}
            for key, value in optical.items():
                if not 0.0 <= value <= 1.0:
                    raise MaterialError(f"[materials.{bsdf_id}] {key} = {value} is not within 0 to 1")
            if sum(optical.values()) > 1.0:
                raise MaterialError(
                    f"[materials.{bsdf_id}] lidar_reflectance + lidar_transmittance = {sum(optical.values()):g} > 1"
                )
            look = {**_look(bsdf_id, row, path), **_retroreflection(bsdf_id, row)}
            entries[bsdf_id] = MaterialEntry(row["radio"], **{**optical, **look})
        else:
            plain = bsdf_id.removeprefix("mat-").removeprefix("itu_").removeprefix("itu-")
            entries[bsdf_id] = MaterialEntry(types.get(bsdf_id) or plain)
    return entries


def _retroreflection(bsdf_id: str, row: dict[str, Any]) -> dict[str, float]:
    """Return what a material's table says about the light that it sends back to where it came from."""
    found = {key: float(row.get(key, 0.0)) for key in ("retroreflection", "retroreflected_luminance")}
    for key, value in found.items():
        if not 0.0 <= value <= MOST_RETROREFLECTION:
            raise MaterialError(
                f"[materials.{bsdf_id}] {key} = {value} cd/(lx m2) is not within 0 to {MOST_RETROREFLECTION:g}"
            )
    return found


def _look(bsdf_id: str, row: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return what a material's table says about lamps and water."""
    lamp, wets = row.get("lamp"), float(row.get("wets", 0.0))
    if lamp is not None and lamp not in LAMP_KINDS:
        raise UnknownNameError(f"lamp of [materials.{bsdf_id}]", str(lamp), LAMP_KINDS)
    if not 0.0 <= wets <= 1.0:
        raise MaterialError(f"[materials.{bsdf_id}] wets = {wets} is not within 0 to 1")
    puddles = path.parent / row["puddles"] if "puddles" in row else None
    if puddles is not None and not puddles.is_file():
        raise SceneError(f"texture '{row['puddles']}' of [materials.{bsdf_id}] is missing", path)
    return {"lamp": lamp, "wets": wets, "puddles": puddles}
