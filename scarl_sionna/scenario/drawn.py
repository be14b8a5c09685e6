"""What a seed draws of a scenario beside what moves: variant of the place, hour and day, weather."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from scarl_sionna.core import seeds
from scarl_sionna.core.specs.weather import Weather

from .spec.draws import WeatherDraw
from .spec.light import at_hour
from .spec.scenario import ScenarioSpec

_EQUINOX = 80
_YEAR = 365
_DIGITS = 3


def drawn(spec: ScenarioSpec) -> tuple[ScenarioSpec, dict[str, Any]]:
    """Return a scenario with what its seed draws in place of the ranges, and the draws by name.

    Parameters
    ----------
    spec : ScenarioSpec
        Its `randomization` says what is drawn. Each draw has a generator of its own: one more changes no other.

    Returns
    -------
    ScenarioSpec
        Draws nothing of these itself; the same one where nothing was to be drawn.
    dict
        ``variant``, ``hour`` (as ``"17:32"``), ``day_of_year``, ``weather`` (with its drawn values), as far as drawn.
    """
    wanted = spec.randomization
    found: dict[str, Any] = {}
    changes: dict[str, Any] = {}
    if wanted.variant is not None:
        count = wanted.variant if isinstance(wanted.variant, int) else len(wanted.variant)
        index = int(seeds.generator(spec.seed, "scenario_variant").integers(count))
        found["variant"] = changes["variant"] = index if isinstance(wanted.variant, int) else wanted.variant[index]
    if wanted.hour is not None:
        first, num_minutes = _minutes(wanted.hour)
        minute = (first + int(seeds.generator(spec.seed, "scenario_hour").integers(num_minutes))) % 1440
        day = _EQUINOX
        if wanted.day_of_year is not None:
            days = _days(wanted.day_of_year)
            day = found["day_of_year"] = days[int(seeds.generator(spec.seed, "scenario_day").integers(len(days)))]
        found["hour"] = f"{minute // 60:02d}:{minute % 60:02d}"
        changes["lighting"] = at_hour(
            spec.lighting, minute / 60.0, day, latitude_deg=wanted.latitude_deg, north_deg=wanted.north_deg
        )
    if wanted.weather is not None:
        rng = seeds.generator(spec.seed, "scenario_weather")
        shares = np.array([one.share for one in wanted.weather])
        chosen = wanted.weather[int(rng.choice(len(shares), p=shares / shares.sum()))]
        values = _values(chosen, spec.seed)
        base = Weather.preset(chosen.preset).model_dump() | values
        changes["weather"] = Weather(**base)
        found["weather"] = {"preset": chosen.preset, **values} if values else chosen.preset
    if not changes:
        return spec, {}
    rest = wanted.with_(variant=None, hour=None, day_of_year=None, weather=None)
    return spec.with_(**changes, randomization=rest), found


def _minutes(hours: tuple[float, ...]) -> tuple[int, int]:
    """Return the first minute of the day of a span, and how many there are; both ends belong to it."""
    first, last = (round(60.0 * hour) for hour in hours)
    return first, min((last - first) % 1440 + 1, 1440) if last - first != 1440 else 1440


def _days(span: tuple[int, ...]) -> list[int]:
    """Return the days of a span; both ends belong to it, day 366 too, and it may pass the new year."""
    first, last = span
    return [*range(first, last + 1)] if first <= last else [*range(first, max(first, _YEAR) + 1), *range(1, last + 1)]


def _values(chosen: WeatherDraw, seed: int) -> dict[str, float]:
    """Return the values of a weather that are drawn between two, each by itself."""
    found = {}
    for name, (low, high) in chosen.ranges.items():
        draw = float(seeds.generator(seed, "scenario_weather_value", value=name).uniform())
        found[name] = float(f"{low * (high / low) ** draw:.{_DIGITS}g}")
    return found


def num_distinct(spec: ScenarioSpec) -> int:
    """Return how many combinations of variant, minute, day and kind of weather a scenario's seeds may draw.

    Values of a weather that are drawn between two, colours, materials, placements and traffic are not counted: they
    differ from seed to seed.
    """
    wanted, count = spec.randomization, 1
    if wanted.variant is not None:
        count *= wanted.variant if isinstance(wanted.variant, int) else len(set(wanted.variant))
    if wanted.hour is not None:
        count *= _minutes(wanted.hour)[1]
    if wanted.day_of_year is not None:
        count *= len(_days(wanted.day_of_year))
    if wanted.weather is not None:
        count *= len(wanted.weather)
    return count


def drawn_text(specs: Iterable[ScenarioSpec]) -> str:
    """Return what the seeds of scenarios draw in a line or two; empty where nothing is drawn."""
    drives = [(spec, drawn(spec)[1]) for spec in specs]
    drives = [(spec, found) for spec, found in drives if found]
    if not drives:
        return ""
    if len(drives) == 1:
        spec, found = drives[0]
        return f"seed {spec.seed} draws {_listed(found)}; one of {num_distinct(spec):,} combinations"
    kinds = {(spec.scene, *sorted((name, str(value)) for name, value in found.items())) for spec, found in drives}
    parts = [f"{len({str(found[name]) for _, found in drives if name in found})} {words}" for name, words in (
        ("variant", "variants of places"), ("hour", "times of day"), ("day_of_year", "days"), ("weather", "weathers"),
    ) if any(name in found for _, found in drives)]  # fmt: skip # a table
    most = sum({spec.with_(seed=0, name="one"): num_distinct(spec) for spec, _ in drives}.values())
    return f"{len(drives)} drives draw {', '.join(parts)}: {len(kinds):,} distinct combinations of {most:,}"


def _listed(found: dict[str, Any]) -> str:
    words = []
    for name, value in found.items():
        if isinstance(value, dict):
            value = " ".join(
                str(one) for one in (value["preset"], *(f"{k} {v:g}" for k, v in value.items() if k != "preset"))
            )
        words.append(f"{name.replace('_', ' ')} {value}")
    return ", ".join(words)
