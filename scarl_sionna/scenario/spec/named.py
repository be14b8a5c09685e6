"""Scenarios by their files and names."""

from __future__ import annotations

import re
from pathlib import Path

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.scene.document.find import find_scene, scene_names

from .scenario import ScenarioSpec, scenario_names

SCENARIO_FILES = (".yaml", ".yml", ".json", ".xosc")
"""Suffixes of scenario files."""


def named_scenario(text: str) -> ScenarioSpec:
    """Return the scenario of a file, or a ready one by its name."""
    return ScenarioSpec.load(text) if Path(text).suffix in SCENARIO_FILES else ScenarioSpec.preset(text)


def scenario_of(text: str) -> ScenarioSpec:
    """Return the scenario of a file, named after it, a ready one, or that of a scene by its name or XML file.

    Raises
    ------
    UnknownNameError
        If it is the name of neither.
    ScenarioError
        If the file cannot be read, or what it says is not allowed.
    """
    path = Path(text)
    if path.suffix in SCENARIO_FILES or text in scenario_names():
        scenario = named_scenario(text)
        if scenario.name is None:
            scenario = scenario.with_(name=re.sub(r"[^A-Za-z0-9_\-]", "_", path.stem))
        return scenario
    if text not in scene_names():
        try:
            find_scene(text)
        except UnknownNameError as error:
            known = {*error.known, *scenario_names()}
            remedy = "or give the path of a scenario file or of a scene's XML"
            raise UnknownNameError("scenario or scene", text, known, remedy) from None
    return ScenarioSpec(scene=text)
