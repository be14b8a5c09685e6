"""Finds the XML of a scene by its name or path: of this package, of Sionna RT, a user's own, or built from a map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

import scenes_xml
from scarl_sionna.core.errors import ParameterRangeError, SceneError, UnknownNameError

MAP_SUFFIXES = (".xodr", ".osm", ".osm.xml", ".net.xml", ".json")
"""Of maps, from which a scene is built: OpenDRIVE, OpenStreetMap, SUMO, nuScenes."""


def scene_names() -> list[str]:
    """Return the names of the scenes that come with the package."""
    return list(scenes_xml.scene_names())


def _sionna_scenes() -> dict[str, Path]:
    """Return the scenes that come with Sionna RT, without importing it."""
    from importlib.util import find_spec

    spec = find_spec("sionna")
    roots = [Path(place) / "rt" / "scenes" for place in (spec.submodule_search_locations or [])] if spec else []
    folders = [folder for root in roots if root.is_dir() for folder in root.iterdir()]
    return {
        folder.name: folder / f"{folder.name}.xml" for folder in folders if (folder / f"{folder.name}.xml").is_file()
    }


def find_scene(
    name_or_path: str | Path, variant: int = 0, detail: str = "detailed", around: npt.NDArray[np.float64] | None = None
) -> Path:
    """Return the XML file of a scene by its name or path, built where need be; the file itself is not looked at.

    Of a map, only what lies beside the points `around` (N, 2) [m] of a way, where they are given.
    """
    if detail not in scenes_xml.DETAILS:
        raise UnknownNameError("detail", str(detail), scenes_xml.DETAILS)
    name = str(name_or_path)
    if not isinstance(variant, int) or isinstance(variant, bool) or variant < 0:
        raise ParameterRangeError("variant", repr(variant), "whole numbers from 0")
    path = _file_of(name_or_path)
    if path is not None and path.name.endswith(MAP_SUFFIXES):
        from scarl_sionna.scene.streets.cached import map_scene  # takes a while, and few need it

        return map_scene(path, detail, variant, around)
    if path is not None or name not in scene_names():
        if variant != 0:
            raise ParameterRangeError(
                "variant", variant, f"0: '{name}' is neither a scene of this package nor a map and has no variants"
            )
        return path if path is not None else _sionna_file(name)
    try:
        return scenes_xml.scene_path(name, variant, detail)
    except ValueError as error:
        raise ParameterRangeError(
            "variant, detail", f"{variant}, {detail}", f"a level of '{name}' that exists", str(error)
        ) from error
    except OSError as error:
        raise SceneError(str(error.strerror or error)) from error


def _file_of(name_or_path: str | Path) -> Path | None:
    """Return the XML that a path names, or None for what is the name of a scene."""
    path = Path(name_or_path)
    if path.name.endswith((".xml", *MAP_SUFFIXES)):
        return path
    if path.is_dir():
        candidates = sorted(path.glob("*.xml"))
        if len(candidates) != 1:
            raise SceneError(f"holds {len(candidates)} XML files", path, "give the path of one XML")
        return candidates[0]
    return None


def _sionna_file(name: str) -> Path:
    sionna = _sionna_scenes()
    if name in sionna:
        return sionna[name]
    known = [*scene_names(), *sionna]
    raise UnknownNameError(
        "scene", name, known, "or give the path of a Mitsuba XML or a map (.xodr, .osm, .net.xml, .json)"
    )
