"""Light and weather of a scenario: a preset, values, or the time of day."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from scarl_sionna.core.errors import (
    ScenarioError,
    ScenarioKeyError,
    ScenarioNameError,
    ScenarioPlace,
    ScenarioValueError,
    UnknownNameError,
)
from scarl_sionna.core.specs.conditions import Conditions
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather

CLOCK = ("time_of_day", "day_of_year", "latitude_deg", "north_deg")
"""Keys of a lighting that give the sun's place by the clock."""
_EXPOSURE = ((-12.0, 700.0), (-6.0, 400.0), (0.0, 10.0), (3.5, 4.0), (38.0, 1.5), (90.0, 1.0))
"""Sun elevation [deg] and exposure: those of the presets night, dusk and day, and between them as the illuminance falls
in twilight (about 400 lx at 0 deg, 3.4 lx at -6 deg) until street lamps take over."""
_LIT_WINDOWS = ((0.0, 0.2), (2.0, 0.06), (5.0, 0.05), (7.0, 0.35), (16.0, 0.3), (19.0, 0.5), (22.0, 0.45), (24.0, 0.2))
"""Hour and share of rooms in which light burns when it is dark: an engineering estimate for homes and shops."""
_BY_THE_SUN = ("sun_elevation_deg", "sun_azimuth_deg", "headlamps", "street_lamps", "lit_windows", "exposure")
"""Values of a lighting that an hour decides; what else is stated of it stays."""
LAMPS_ON_BELOW = 5.0
"""Sun elevation below which lamps burn by default [deg]."""


def sun_at(hour: float, day_of_year: int = 80, latitude_deg: float = 50.0) -> tuple[float, float]:
    """Return elevation and azimuth of the sun (from north, clockwise) at a true solar time [deg].

    Parameters
    ----------
    hour : float
        True solar time, 0 to 24 [h]; at 12 the sun is in the south (north of the tropics).
    day_of_year : int
        1 to 366; 80: equinox, 172: June solstice.
    latitude_deg : float
        [deg].

    Notes
    -----
    Declination to 0.4 deg by P. I. Cooper, "The absorption of radiation in solar stills", Solar Energy 12(3), 1969, eq.
    (1).
    """
    declination = np.radians(23.45) * np.sin(2.0 * np.pi * (284 + day_of_year) / 365.0)
    angle, latitude = np.radians(15.0 * (hour - 12.0)), np.radians(latitude_deg)
    east = -np.cos(declination) * np.sin(angle)
    north = np.cos(latitude) * np.sin(declination) - np.sin(latitude) * np.cos(declination) * np.cos(angle)
    up = np.sin(latitude) * np.sin(declination) + np.cos(latitude) * np.cos(declination) * np.cos(angle)
    return float(np.degrees(np.arcsin(np.clip(up, -1.0, 1.0)))), float(np.degrees(np.arctan2(east, north)) % 360.0)


def lighting_at(
    hour: float, day_of_year: int = 80, latitude_deg: float = 50.0, north_deg: float = 90.0, **changes: object
) -> Lighting:
    """Return the lighting at a time of day: the sun's place, lamps when it is low, and an exposure that suits.

    Parameters
    ----------
    hour, day_of_year, latitude_deg
        As of `sun_at`.
    north_deg : float
        Direction of north in the scene, from +x towards +y [deg].
    **changes
        Values of `Lighting` that differ.
    """
    elevation, azimuth = sun_at(hour, day_of_year, latitude_deg)
    angles, exposures = zip(*_EXPOSURE, strict=True)
    hours, shares = zip(*_LIT_WINDOWS, strict=True)
    dark = elevation < LAMPS_ON_BELOW
    values: dict[str, Any] = {
        "sun_elevation_deg": round(elevation, 3),
        "sun_azimuth_deg": round((north_deg - azimuth + 180.0) % 360.0 - 180.0, 3),
        "cloud_cover": 0.3,
        "visibility": 25e3,
        "headlamps": dark,
        "street_lamps": dark,
        "lit_windows": round(float(np.interp(hour, hours, shares)), 3) if dark else 0.0,
        "exposure": round(float(np.exp(np.interp(elevation, angles, np.log(exposures)))), 4),
    }
    return Lighting(**{**values, **changes})


def at_hour(lighting: Lighting | None, hour: float, day_of_year: int = 80, **place: float) -> Lighting:
    """Return a lighting with sun, lamps and exposure of another time of day; what else it states stays.

    `place`: `latitude_deg` and `north_deg` of `lighting_at`.
    """
    light = lighting_at(hour, day_of_year, **place)
    return light if lighting is None else lighting.with_(**{name: getattr(light, name) for name in _BY_THE_SUN})


def _lighting(value: object) -> object:
    """Return the lighting of a preset's name or of a mapping; anything else is left to the model."""
    if isinstance(value, str):
        return _preset(Lighting, value, ())
    if not isinstance(value, Mapping) or not set(value) & {"preset", *CLOCK}:
        return value
    known = {"preset", *CLOCK, *Lighting.model_fields}
    if unknown := [str(key) for key in value if key not in known]:
        raise _unknown_key(unknown[0], known)
    changes = {key: item for key, item in value.items() if key in Lighting.model_fields}
    if "preset" in value:
        if clock := [key for key in CLOCK if key in value]:
            raise ScenarioKeyError("stands beside `preset`", ScenarioPlace(clock[0]), "give a preset or a time of day")
        return {**_preset(Lighting, str(value["preset"]), ("preset",)).model_dump(), **changes}
    if "time_of_day" not in value:
        raise ScenarioKeyError("is missing", ScenarioPlace("time_of_day"), 'give the hour, for instance "18:30"')
    numbers: dict[str, Any] = {}
    for key, lower, upper in (("day_of_year", 1, 366), ("latitude_deg", -90, 90), ("north_deg", -360, 360)):
        if key in value:
            number = value[key]
            if isinstance(number, bool) or not isinstance(number, int | float) or not lower <= number <= upper:
                raise ScenarioValueError(f"= {number!r} is not a number from {lower} to {upper}", ScenarioPlace(key))
            numbers[key] = number
    return {**lighting_at(hour_of(value["time_of_day"]), **numbers).model_dump(), **changes}


def _weather(value: object) -> object:
    """Return the weather of a preset's name or of a mapping that begins with one.

    Anything else is left to the model.
    """
    if isinstance(value, str):
        return _preset(Weather, value, ())
    if not isinstance(value, Mapping) or "preset" not in value:
        return value
    changes = {key: item for key, item in value.items() if key != "preset"}
    base = _preset(Weather, str(value["preset"]), ("preset",)).model_dump()
    if changes.get("fog_water") is not None and "visibility" not in changes:
        base["visibility"] = None
    return {**base, **changes}


def _preset(model: type[Lighting] | type[Weather], name: str, path: tuple[str, ...]) -> Lighting | Weather:
    try:
        return model.preset(name)
    except UnknownNameError as error:
        raise name_error(error, ScenarioPlace(".".join(path)), value=name) from None


def hour_of(value: object) -> float:
    """Return the hour of a text such as ``"18:30"``, or of a number.

    Raises
    ------
    ScenarioValueError
        If it is no time of day.
    """
    place = ScenarioPlace("time_of_day")
    if isinstance(value, str) and (match := re.fullmatch(r"(\d{1,2}):(\d{2})(?::(\d{2}))?", value)):
        hours, minutes, seconds = (int(part or 0) for part in match.groups())
        if minutes < 60 and seconds < 60 and hours + minutes / 60.0 <= 24.0:
            return hours + minutes / 60.0 + seconds / 3600.0
    elif isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 24.0:
        return float(value)
    raise ScenarioValueError(f'= {value!r} is not a time of day: "18:30", or hours from 0 to 24', place)


def _unknown_key(key: str, known: set[str]) -> ScenarioError:
    return name_error(UnknownNameError("key", key, known), ScenarioPlace(key), value=key, kind=ScenarioKeyError)


def name_error(
    error: UnknownNameError, place: ScenarioPlace, value: object = None, kind: type[ScenarioError] = ScenarioNameError
) -> ScenarioError:
    """Return the error of a scenario that an unknown name in it is."""
    return kind(str(error), place, value=error.name if value is None else value, kind=error.kind, known=error.known)


LightingField = Annotated[Lighting | None, BeforeValidator(_lighting)]
"""A lighting: an object, the name of a preset, or a mapping with `preset` or `time_of_day` and values that differ."""

WeatherField = Annotated[Weather | None, BeforeValidator(_weather)]
"""A weather: an object, the name of a preset, or a mapping, with `preset` and values that differ or without."""


class ConditionsSpec(Conditions):
    """Light and weather from a time on; each a preset, values or, of light, a time of day."""

    lighting: LightingField = None
    weather: WeatherField = None
