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
_SUN = ("sun_elevation_deg", "sun_azimuth_deg")
_ALSO_ZERO = ("wetness", "temperature_celsius", "wind")
"""Values of which 0 is not the default."""


@dataclass(frozen=True)
class Clock:
    """The time of day at the start of a scenario, and whether it goes on with the scenario's time."""

    start: datetime.datetime
    goes_on: bool

    def after(self, when: datetime.datetime, time: float) -> float:
        """Return by how much it is later than a time of day, at a time of the scenario [s]."""
        return (self.start - when).total_seconds() + (time if self.goes_on else 0.0)

    def at(self, time: float) -> datetime.datetime:
        """Return the time of day at a time of the scenario [s]."""
        return self.start + datetime.timedelta(seconds=time if self.goes_on else 0.0)


@dataclass(frozen=True)
class Environment:
    """What an ``<EnvironmentAction>`` states; what it leaves out stays as it was.

    Attributes
    ----------
    node : Node
    clock : Clock or None
    lighting, weather : dict
        Values as a scenario file states them.
    """

    node: Node
    clock: Clock | None
    lighting: dict[str, Any]
    weather: dict[str, Any]


def read_environment(action: Node, catalogs: Catalogs) -> Environment:
    """Return what an ``<EnvironmentAction>`` states of light and weather.

    Raises
    ------
    ScenarioError
        If a value is wrong or outside what the models of light and weather allow.
    """
    node = _environment(action, catalogs)
    lighting: dict[str, Any] = {}
    weather: dict[str, Any] = {}
    sky = node.child("Weather")
    if sky is not None:
        _sky(sky, lighting)
        weather = _air(sky)
    road = node.child("RoadCondition")
    if road is not None:
        road.note("frictionScaleFactor has no effect on the motion")
        if road.has("wetness"):
            weather["wetness"] = _WETNESS[road.choice("wetness", tuple(_WETNESS))]
    clock = node.child("TimeOfDay")
    shown = None if clock is None else Clock(date_time(clock), clock.truth("animation", False))
    return Environment(action if sky is None else sky, shown, lighting, weather)


class Surroundings:
    """Light and weather of a run, one environment after the other."""

    def __init__(self) -> None:
        self.clock: Clock | None = None
        self._lighting: dict[str, Any] = {}
        self._weather: dict[str, Any] = {}

    def take(self, stated: Environment, time: float) -> None:
        """Let an environment hold from a time on [s].

        Raises
        ------
        ScenarioError
            If rain or snow would fall at a temperature at which it does not.
        """
        if stated.clock is not None:
            start = stated.clock.start - datetime.timedelta(seconds=time if stated.clock.goes_on else 0.0)
            self.clock = Clock(start, stated.clock.goes_on)
            self._lighting = {key: value for key, value in self._lighting.items() if key not in _SUN}
        self._lighting |= stated.lighting
        self._weather |= stated.weather
        _check_temperature(stated.node, self._weather)

    def at(self, time: float) -> dict[str, Any]:
        """Return `lighting` and `weather` at a time [s] as a scenario file states them, where something is stated."""
        lighting = dict(self._lighting)
        if self.clock is not None:
            when = self.clock.at(time)
            hour = when.hour + when.minute / 60.0 + when.second / 3600.0
            lighting = lighting_at(hour, when.timetuple().tm_yday).model_dump() | lighting
        weather = {key: value for key, value in self._weather.items() if value not in (None, 0.0) or key in _ALSO_ZERO}
        found = {"lighting": lighting} if lighting else {}
        return found | ({"weather": weather} if weather or self._weather else {})


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
        weather["visibility"] = max(sight, 10.5) if sight < _FOG else None
    fall = sky.child("Precipitation")
    if fall is not None:
        kind = fall.choice("precipitationType", ("dry", "rain", "snow"))
        rate = 0.0
        if kind != "dry":
            rate = _rate(fall, _MOST_RAIN if kind == "rain" else _MOST_SNOW)
        weather |= {"rain_rate": rate if kind == "rain" else 0.0, "snow_rate": rate if kind == "snow" else 0.0}
    wind = sky.child("Wind")
    if wind is not None:
        speed, direction = wind.number("speed", low=0.0, high=60.0, unit="m/s"), wind.number("direction")
        weather["wind"] = (round(speed * math.cos(direction), 6), round(speed * math.sin(direction), 6))
    if sky.has("temperature"):
        celsius = sky.number("temperature", low=170.0, high=340.0, unit="K") - 273.15
        weather["temperature_celsius"] = round(celsius, 3)
        if not -20.0 <= celsius <= 40.0:
            raise sky.error(f"temperature = {celsius + 273.15:g} K", "253.15 to 313.15 K are read")
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
    if weather.get("snow_rate") and celsius is None:
        weather["temperature_celsius"] = 0.0
    elif weather.get("snow_rate") and float(celsius or 0.0) > 5.0:
        raise sky.error(f"snow at {celsius:g} degrees Celsius", "give a temperature of at most 278.15 K")
    if weather.get("rain_rate") and celsius is not None and celsius < -5.0:
        raise sky.error(f"rain at {celsius:g} degrees Celsius", "give a temperature of at least 268.15 K")
