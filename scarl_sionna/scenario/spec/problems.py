"""Turns what pydantic finds wrong in a scenario into errors that name file, line and key, all of them at once."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError
from pydantic.fields import FieldInfo

from scarl_sionna.core.errors import (
    ParameterRangeError,
    ScenarioError,
    ScenarioKeyError,
    ScenarioValueError,
    UnknownNameError,
)
from scarl_sionna.core.spec import Spec

from .files import KeyPath, Origin, path_of, place_of

_UNITS: dict[str, tuple[str, float]] = {
    "km/h": ("m/s", 1.0 / 3.6), "kmh": ("m/s", 1.0 / 3.6), "kph": ("m/s", 1.0 / 3.6), "mph": ("m/s", 0.44704),
    "kn": ("m/s", 0.514444), "km": ("m", 1e3), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "ft": ("m", 0.3048),
    "ms": ("s", 1e-3), "us": ("s", 1e-6), "min": ("s", 60.0), "h": ("s", 3600.0), "rad": ("deg", 57.29577951308232),
    "khz": ("Hz", 1e3), "g": ("m/s2", 9.80665), "m/s": ("m/s", 1.0), "m": ("m", 1.0), "s": ("s", 1.0),
    "deg": ("deg", 1.0), "hz": ("Hz", 1.0), "m/s2": ("m/s2", 1.0), "mm/h": ("mm/h", 1.0), "1/km": ("1/km", 1.0),
}  # fmt: skip
"""Units that people write: the project's unit, and the factor to it."""
_NUMBER_WITH_UNIT = re.compile(r"^\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-z][A-Za-z0-9/^]*)\s*$")
_WORDS = (
    ("Value error, ", ""), ("Input should be", "it should be"), (" after validation", ""), ("Tuple should have", "it needs"),
    ("a valid number, unable to parse string as a number", "a number"), ("String should", "it should"),
    ("a valid integer, unable to parse string as an integer", "a whole number"),
)  # fmt: skip
"""Words of pydantic, and what they mean to people."""


def problems_of(error: ParameterRangeError, origin: Origin | None, data: Any = None) -> list[ScenarioError]:
    """Return all that pydantic found wrong when a specification refused `data`.

    Parameters
    ----------
    error : ParameterRangeError
        As raised by a `Spec`; its cause holds what was found.
    origin : Origin, optional
        Where the keys stand.
    data
        What was read, to tell the keys that are written from the names that pydantic puts between them.
    """
    cause = error.__cause__
    if not isinstance(cause, ValidationError):
        return [ScenarioValueError(str(error), place_of((), origin), value=error.value)]
    found = {problem.text: problem for problem in _expand(cause, (), origin, data)}
    return list(found.values())


def _expand(error: ValidationError, prefix: KeyPath, origin: Origin | None, data: Any) -> Iterator[ScenarioError]:
    """Yield the problems of an error and of those inside it."""
    model = _model_named(error.title)
    items = error.errors()
    for item in items:
        if item["type"] == "too_short" and any(_inside(other["loc"], item["loc"]) for other in items):
            continue  # items that are wrong themselves were not counted
        path = _written((*prefix, *item["loc"]), data)
        inner = item.get("ctx", {}).get("error")
        if isinstance(inner, ScenarioError):
            yield inner.at(place_of((*path, *path_of(inner.place.key)), origin))
        elif isinstance(inner, ParameterRangeError) and isinstance(inner.__cause__, ValidationError):
            yield from _expand(inner.__cause__, path, origin, data)
        else:
            yield _problem(item, path, model, origin)


def _inside(path: tuple[int | str, ...], other: tuple[int | str, ...]) -> bool:
    return len(path) > len(other) and path[: len(other)] == other


def _written(path: KeyPath, data: Any) -> KeyPath:
    """Return a path without the names that pydantic puts into it for the choices of a union."""
    out: list[str | int] = []
    for position, part in enumerate(path):
        inside = isinstance(data, dict) and part in data
        inside = inside or (isinstance(data, list | tuple) and isinstance(part, int) and part < len(data))
        if inside:
            out.append(part)
            data = data[part]
        elif position == len(path) - 1 and isinstance(data, dict) and part != data.get("kind"):
            out.append(part)  # a key that is missing
    return tuple(out)


def _problem(item: Any, path: KeyPath, model: type[Spec] | None, origin: Origin | None) -> ScenarioError:
    """Return the error of one of pydantic's."""
    kind, value = item["type"], item.get("input")
    place = place_of(path, origin)
    fields = {} if model is None else model.model_fields
    if kind == "extra_forbidden":
        unknown = UnknownNameError("key", str(path[-1]), fields)
        return ScenarioKeyError(str(unknown), place, value=value)
    if kind == "missing":
        return ScenarioKeyError("is missing", place, value=None)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        known = re.findall(r"'([a-z_]+)'", str(item.get("ctx", {}).get("expected_tags", "")))
        if kind == "union_tag_not_found":
            return ScenarioKeyError(
                f"lacks `kind` ({', '.join(known)})" if known else "lacks `kind`", place, value=value
            )
        tag = str(item["ctx"]["tag"])
        place = place_of((*path, "kind"), origin)
        return ScenarioValueError(str(UnknownNameError("kind", tag, known)), place, value=tag)
    unit = _unit(fields.get(str(item["loc"][0])) if item["loc"] else None)
    allowed = str(item["msg"])
    for words, better in _WORDS:
        allowed = allowed.replace(words, better)
    if kind == "value_error":
        return ScenarioValueError(f"is not allowed: it needs {allowed}", place, value=value)
    shown = "" if isinstance(value, dict | list | tuple) else f"= {value!r} "
    return ScenarioValueError(f"{shown}is not allowed: {allowed}{unit}", place, _unit_remedy(value, unit), value=value)


def _unit(info: FieldInfo | None) -> str:
    match = re.search(r"\[([^\],]+)(?:, world)?\]", (info.description or "") if info is not None else "")
    return f" [{match[1]}]" if match else ""


def _unit_remedy(value: object, unit: str) -> str:
    """Return what to write instead of a number with a unit."""
    match = _NUMBER_WITH_UNIT.match(value) if isinstance(value, str) else None
    wanted = unit.strip(" []")
    if match is None or not wanted:
        return ""
    target, factor = _UNITS.get(match[2].lower(), ("", 0.0))
    if target != wanted:
        return f"write a number in {wanted}, without a unit"
    return f"write {float(match[1]) * factor:.6g}: numbers are in {wanted}, without a unit"


def _model_named(title: str) -> type[Spec] | None:
    waiting: list[type[Spec]] = [Spec]
    while waiting:
        model = waiting.pop()
        if model.__name__ == title:
            return model
        waiting += model.__subclasses__()
    return None
