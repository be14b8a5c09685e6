"""Groups of road users, those of RadarScenes, and names of weather."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from scarl_sionna.core.errors import ScarlError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.specs.weather import WEATHER_PRESETS, Weather

GROUPS: Mapping[str, tuple[str, ...]] = {
    "car": ("Car",),
    "large vehicle": ("Truck", "Bus", "Train"),
    "two-wheeler": ("Motorcycle", "Bicycle", "Rider"),
    "pedestrian": ("Pedestrian",),
}
"""Semantic classes of each group of road users."""
GROUP_NAMES = tuple(GROUPS)
NO_GROUP = -1

GROUP_OF_SEMANTIC = np.array(
    [
        next((number for number, classes in enumerate(GROUPS.values()) if name in classes), NO_GROUP)
        for name in SEMANTIC_CLASSES
    ],
    dtype=np.int8,
)
"""Group by semantic id; -1: no road user."""


def weather_name(configuration: Mapping[str, Any], time: float = -math.inf) -> str:
    """Return the weather of a scene's configuration in a word or two: the preset that it is, or its rates.

    Parameters
    ----------
    configuration : mapping
        Of the scene; without an entry ``weather`` it is clear. Its ``changes`` state the weather of later times.
    time : float
        [s]
    """
    stated = configuration.get("weather")
    for change in configuration.get("changes", ()):
        if change["time"] <= time:
            stated = change.get("weather", stated)
    if stated is None:
        return "clear"
    if isinstance(stated, str):
        return stated
    try:
        weather = Weather.model_validate(stated)
    except (ScarlError, ValueError):
        return "unknown"  # of another version
    for name in WEATHER_PRESETS:
        if Weather.preset(name) == weather:
            return name
    parts = []
    if weather.rain_rate:
        parts.append(f"rain {weather.rain_rate:g} mm/h")
    if weather.snow_rate:
        parts.append(f"snow {weather.snow_rate:g} mm/h")
    if weather.fog_visibility is not None:
        parts.append(f"fog {weather.fog_visibility:g} m")
    if weather.lying_snow != "none":
        parts.append("lying snow")
    return ", ".join(parts) or "clear"
