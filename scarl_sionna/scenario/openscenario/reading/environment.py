"""Weather and time of day of an Environment as light and weather of a scenario."""

from __future__ import annotations

import datetime
import math
from dataclasses import dataclass
from typing import Any

from scarl_sionna.scenario.spec.light import lighting_at

from .catalogs import Catalogs
from .source import Node

_CLOUDS_OF_STATE = {"free": 0.0, "skyOff": 0.0, "cloudy": 0.5, "overcast": 1.0, "rainy": 1.0}
_OKTAS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine")
_WETNESS = {"dry": 0.0, "moist": 0.3, "wetWithPuddles": 0.9, "lowFlooded": 1.0, "highFlooded": 1.0}
_MOST_RAIN, _MOST_SNOW = 200.0, 20.0
_CLEAR = 25e3
"""Visual range from which on there is no fog [m]."""
_FOG = 2000.0


def environment_of(action: Node, catalogs: Catalogs) -> dict[str, Any]:
    """Return light and weather of an ``<EnvironmentAction>`` as a scenario file states them.

    Returns
    -------
    dict
        `lighting` and `weather`, where something of them is stated.

    Raises
    ------
    ScenarioError
        If a value is wrong or outside what the models of light and weather allow.
    """
    node = _environment(action, catalogs)
    lighting, weather = _time_of_day(node), {}
    sky = node.child("Weather")
    if sky is not None:
        _sky(sky, lighting)
        weather = _air(sky)
    road = node.child("RoadCondition")
    if road is not None:
        road.note("frictionScaleFactor has no effect on the motion")
        if road.has("wetness"):
            weather["wetness"] = _WETNESS[road.choice("wetness", tuple(_WETNESS))]
    found: dict[str, Any] = {}
    if lighting:
        found["lighting"] = lighting
    if weather:
        found["weather"] = weather
    return found


@dataclass(frozen=True)
class Clock:
    """The time of day at the start of a scenario, and whether it goes on with the scenario's time."""

    start: datetime.datetime
    goes_on: bool

    def after(self, when: datetime.datetime, time: float) -> float:
        """Return by how much it is later than a time of day, at a time of the scenario [s]."""
        return (self.start - when).total_seconds() + (time if self.goes_on else 0.0)


def clock_of(action: Node, catalogs: Catalogs) -> Clock | None:
    """Return the clock of an ``<EnvironmentAction>``; None where it states no time of day."""
    clock = _environment(action, catalogs).child("TimeOfDay")
    return None if clock is None else Clock(date_time(clock), clock.truth("animation", False))


def date_time(clock: Node) -> datetime.datetime:
    """Return the `dateTime` of an element, without its time zone."""
    text = clock.text("dateTime")
    try:
        return datetime.datetime.fromisoformat(text).replace(tzinfo=None)
    except ValueError:
        raise clock.error(f"dateTime = '{text[:40]}' is no time such as 2024-06-21T12:00:00") from None


def _environment(action: Node, catalogs: Catalogs) -> Node:
    node = action.need("Environment", "CatalogReference")
    return (catalogs.resolve(node) if node.tag == "CatalogReference" else node).declared()


def _time_of_day(node: Node) -> dict[str, Any]:
    clock = node.child("TimeOfDay")
    if clock is None:
        return {}
    when = date_time(clock)
    hour = when.hour + when.minute / 60.0 + when.second / 3600.0
    return dict(lighting_at(hour, when.timetuple().tm_yday).model_dump())


def _sky(sky: Node, lighting: dict[str, Any]) -> None:
    sun = sky.child("Sun")
    if sun is not None:
        elevation = math.degrees(sun.number("elevation", low=-math.pi, high=math.pi, unit="rad"))
        azimuth = math.degrees(sun.number("azimuth", low=-2.0 * math.pi, high=2.0 * math.pi, unit="rad"))
        lighting["sun_elevation_deg"] = round(min(max(elevation, -90.0), 90.0), 3)
        lighting["sun_azimuth_deg"] = round((90.0 - azimuth + 180.0) % 360.0 - 180.0, 3)
    if sky.has("fractionalCloudCover"):
        word = sky.choice("fractionalCloudCover", tuple(f"{one}Oktas" for one in _OKTAS))
        lighting["cloud_cover"] = min(_OKTAS.index(word.removesuffix("Oktas")) / 8.0, 1.0)
    elif sky.has("cloudState"):
        lighting["cloud_cover"] = _CLOUDS_OF_STATE[sky.choice("cloudState", tuple(_CLOUDS_OF_STATE))]


def _air(sky: Node) -> dict[str, Any]:
    weather: dict[str, Any] = {}
    fog = sky.child("Fog")
    if fog is not None:
        sight = fog.limit("visualRange")
        if sight < _FOG:
            weather["visibility"] = max(sight, 10.5)
    fall = sky.child("Precipitation")
    if fall is not None:
        kind = fall.choice("precipitationType", ("dry", "rain", "snow"))
        rate = 0.0
        if kind != "dry":
            rate = _rate(fall, _MOST_RAIN if kind == "rain" else _MOST_SNOW)
        if rate > 0.0:
            weather["rain_rate" if kind == "rain" else "snow_rate"] = rate
    wind = sky.child("Wind")
    if wind is not None:
        speed, direction = wind.number("speed", low=0.0, high=60.0, unit="m/s"), wind.number("direction")
        weather["wind"] = (round(speed * math.cos(direction), 6), round(speed * math.sin(direction), 6))
    if sky.has("temperature"):
        celsius = sky.number("temperature", low=170.0, high=340.0, unit="K") - 273.15
        weather["temperature_celsius"] = round(celsius, 3)
        if not -20.0 <= celsius <= 40.0:
            raise sky.error(f"temperature = {celsius + 273.15:g} K", "253.15 to 313.15 K are read")
    _check_temperature(sky, weather)
    return weather


def _rate(fall: Node, most: float) -> float:
    if fall.has("precipitationIntensity"):
        return fall.number("precipitationIntensity", low=0.0, high=most, unit="mm/h")
    part = fall.number("intensity", 0.0, 0.0, unit="")
    if part > 1.0:
        raise fall.error(f"intensity = {part:g} is outside 0 to 1", "give precipitationIntensity in mm/h")
    fall.note("intensity is a part of 1: 1 is read as 50 mm/h of rain, 5 mm/h of snow")
    return part * (50.0 if most == _MOST_RAIN else 5.0)


def _check_temperature(sky: Node, weather: dict[str, Any]) -> None:
    """Raise where rain or snow falls at a temperature at which it does not; without one, snow falls at 0 degrees."""
    celsius = weather.get("temperature_celsius")
    if "snow_rate" in weather and celsius is None:
        weather["temperature_celsius"] = 0.0
    elif "snow_rate" in weather and float(celsius or 0.0) > 5.0:
        raise sky.error(f"snow at {celsius:g} degrees Celsius", "give a temperature of at most 278.15 K")
    if "rain_rate" in weather and celsius is not None and celsius < -5.0:
        raise sky.error(f"rain at {celsius:g} degrees Celsius", "give a temperature of at least 268.15 K")
