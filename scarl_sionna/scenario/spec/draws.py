"""What a scenario may leave to its seed: variant of the place, hour, day, weather; as plain data."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from scarl_sionna.core.errors import UnknownNameError
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.specs.weather import WEATHER_PRESETS, Weather
from scarl_sionna.core.units import Metres, MillimetresPerHour

ANY = ("draw", True)
"""What stands for the whole range of a draw."""
NUM_VARIANTS = 100
"""Variants that are drawn from where no number is stated."""

Rates = Annotated[tuple[Annotated[MillimetresPerHour, Field(gt=0.0, le=200.0)], ...], Field(min_length=2, max_length=2)]
Sights = Annotated[tuple[Annotated[Metres, Field(gt=10.0, le=1e5)], ...], Field(min_length=2, max_length=2)]


class WeatherDraw(Spec):
    """One weather among those that are drawn from: a preset, and values of it that are drawn between two."""

    preset: str = Field("clear", description="name of a weather")
    share: float = Field(1.0, gt=0.0, le=1e6, description="how often, beside the others' shares")
    rain_rate: Rates | None = Field(None, description="between two, evenly in their logarithm [mm/h]")
    snow_rate: Rates | None = Field(None, description="between two, evenly in their logarithm [mm/h]")
    visibility: Sights | None = Field(None, description="between two, evenly in their logarithm [m]")

    @model_validator(mode="after")
    def _check(self) -> WeatherDraw:
        if self.preset not in WEATHER_PRESETS:
            raise ValueError(str(UnknownNameError("weather", self.preset, WEATHER_PRESETS)))
        for name, span in self.ranges.items():
            if not span[0] < span[1]:
                raise ValueError(f"a {name} from a smaller to a larger value")
            for end in span:
                base = Weather.preset(self.preset).model_dump()
                Weather(**{**base, **({"fog_water": None} if name == "visibility" else {}), name: end})
        return self

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """The values that are drawn, each with its ends."""
        spans = {"rain_rate": self.rain_rate, "snow_rate": self.snow_rate, "visibility": self.visibility}
        return {name: (span[0], span[1]) for name, span in spans.items() if span is not None}


def _variants(value: object) -> object:
    return NUM_VARIANTS if _is_any(value) else value


def _hours(value: object) -> object:
    """Return two hours of texts or numbers; anything else is left to the model."""
    if _is_any(value):
        return (0.0, 24.0)
    if not isinstance(value, list | tuple):
        return value
    return [_clock(one) for one in value]


def _clock(value: object) -> object:
    match = re.fullmatch(r"(\d{1,2}):([0-5]\d)", value) if isinstance(value, str) else None
    return int(match[1]) + int(match[2]) / 60.0 if match else value


def _weathers(value: object) -> object:
    """Return a list of draws of names, of names with shares, or of all weathers."""
    if _is_any(value):
        return [{"preset": name} for name in WEATHER_PRESETS]
    if isinstance(value, Mapping):
        return [{"preset": name, "share": share} for name, share in value.items()]
    if isinstance(value, list | tuple):
        return [{"preset": one} if isinstance(one, str) else one for one in value]
    return value


def _is_any(value: Any) -> bool:  # noqa: ANN401
    return value is True or value == "draw"


Number = Annotated[int, Field(ge=0, le=10**9)]
VariantDraw = Annotated[
    Annotated[int, Field(ge=2, le=10**9)] | Annotated[tuple[Number, ...], Field(min_length=2)] | None,
    BeforeValidator(_variants),
]
"""A number n: one of 0 to n - 1; numbers: one of them; ``draw``: one of 100."""
HourDraw = Annotated[
    Annotated[tuple[Annotated[float, Field(ge=0.0, le=24.0)], ...], Field(min_length=2, max_length=2)] | None,
    BeforeValidator(_hours),
]
"""Between two true solar times, whole minutes; the first after the second: through midnight. ``draw``: any."""
DayDraw = Annotated[tuple[Annotated[int, Field(ge=1, le=366)], ...], Field(min_length=2, max_length=2)]
"""Between two days of the year, these among them; the first after the second: through the new year."""
WeatherDraws = Annotated[Annotated[tuple[WeatherDraw, ...], Field(min_length=1)] | None, BeforeValidator(_weathers)]
"""Names, names with shares, or mappings with ranges; ``draw``: all weathers by name, equally often."""
