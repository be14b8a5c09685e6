"""A map's scene in the user's cache: built on first use, found again as long as map and builder are the same."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

import scenes_xml
from scarl_sionna.core.errors import MapError, MapWarning, ParameterRangeError
from scarl_sionna.core.untrusted.files import read_bytes
from scarl_sionna.core.untrusted.toml_text import read_toml
from scenes_xml.cache import kept_folder

from .building.scene import build_scene, scene_name
from .model import Array, StreetMap
from .nearby import nearby
from .nuscenes.street import read_expansion
from .opendrive.street import read_map
from .openstreetmap.extract import read_extract
from .source import MOST_BYTES, map_errors
from .sumo.street import read_network

READERS: dict[str, Callable[[Path], StreetMap]] = {
    ".xodr": read_map,
    ".net.xml": read_network,
    ".osm": read_extract,
    ".osm.xml": read_extract,
    ".json": read_expansion,
}
"""How a map is read, by the end of its name."""


def map_scene(path: Path, detail: str = "detailed", variant: int = 0, around: Array | None = None) -> Path:
    """Return the XML of a map's scene, built into the cache folder unless it is there.

    Parameters
    ----------
    path : Path
        An OpenDRIVE file (``.xodr``), an extract of OpenStreetMap (``.osm``), a network of SUMO (``.net.xml``) or a map
        expansion of nuScenes (``.json``).
    detail : str
        ``detailed`` or ``light``.
    variant : int
        0: what the map states. Any other number is the seed of what stands beside its streets where it states nothing;
        not for map expansions, whose lanes are roads of their own.
    around : ndarray of float64, shape (N, 2), optional
        Points of a way [m]: of the map what is within `nearby.REACH` of it; default: all.

    Raises
    ------
    MapError
        If the file cannot be read, or no cache folder can be written.
    ParameterRangeError
        If a map expansion is asked for in another variant than 0.

    Warns
    -----
    MapWarning
        If the file holds what is not used; `findings` of the scene's information list it.
    """
    with map_errors(path, f"give the path of a map ({', '.join(READERS)})"):
        data = read_bytes(path, MOST_BYTES)
    ending = next(one for one in READERS if path.name.endswith(one))
    if ending == ".json" and variant:
        raise ParameterRangeError("variant", variant, f"0: '{path.name}' is a map expansion and has no variants")
    stem = path.name.removesuffix(ending)
    parts = [stem.encode() + ending.encode(), data, _builder_hash().encode()]
    if around is not None:
        parts.append(np.asarray(around, dtype=np.float64).tobytes())
    key = hashlib.sha256(b"\0".join(parts)).hexdigest()[:16]
    name = scene_name(stem)
    try:
        folder = kept_folder(
            "maps",
            f"{detail}-v{variant}-{key}",
            [f"{name}.xml", "scene.toml"],
            lambda place: build_scene(nearby(READERS[ending](path), around), place, detail, variant),
        )
    except OSError as error:
        if isinstance(error, MapError):
            raise
        raise MapError(str(error.strerror or error), path) from error
    findings = map_findings(folder / f"{name}.xml")
    if findings:
        more = f" and {len(findings) - 1} more of its kind" if len(findings) > 1 else ""
        warnings.warn(
            f"{path.name} holds what is not used or does not fit: {findings[0]}{more}; "
            "all stand in world.document.info['findings']",
            MapWarning,
            stacklevel=2,
        )
    return folder / f"{name}.xml"


def map_findings(scene: Path) -> list[str]:
    """Return the findings in the scene.toml beside a map's XML."""
    return [str(one) for one in read_toml(scene.parent / "scene.toml").get("scene", {}).get("findings", [])]


@lru_cache(maxsize=1)
def _builder_hash() -> str:
    """Return a hash of all sources that shape a map's scene."""
    digest = hashlib.sha256(scenes_xml.source_hash().encode())
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()
