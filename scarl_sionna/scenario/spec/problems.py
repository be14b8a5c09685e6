"""Turns what pydantic finds wrong in a scenario into errors that name file, line and key, all of them at once."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from scarl_sionna.core.errors import (
    ParameterRangeError,
    ScenarioError,
    ScenarioKeyError,
    ScenarioValueError,
    SpecError,
    UnknownNameError,
)
from scarl_sionna.core.prompt.refusals import allowed_text, remedy_of, tags_of, unit_of
from scarl_sionna.core.spec import FieldValue

from .files import KeyPath, Origin, path_of, place_of


def problems_of(error: ParameterRangeError, origin: Origin | None, data: object = None) -> list[ScenarioError]:
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
    found = {problem.text: problem for problem in _expand(error, cause, (), origin, data)}
    return list(found.values())


def _expand(
    error: ParameterRangeError, cause: ValidationError, prefix: KeyPath, origin: Origin | None, data: object
) -> Iterator[ScenarioError]:
    """Yield the problems of an error and of those inside it."""
    model = error.model if isinstance(error, SpecError) else None
    items = cause.errors()
    for item in items:
        if item["type"] == "too_short" and any(_inside(other["loc"], item["loc"]) for other in items):
            continue  # items that are wrong themselves were not counted
        path = _written((*prefix, *item["loc"]), data)
        inner = item.get("ctx", {}).get("error")
        if isinstance(inner, ScenarioError):
            yield inner.at(place_of((*path, *path_of(inner.place.key)), origin))
        elif isinstance(inner, ParameterRangeError) and isinstance(inner.__cause__, ValidationError):
            yield from _expand(inner, inner.__cause__, path, origin, data)
        else:
            yield _problem(item, path, model, origin)


def _inside(path: tuple[int | str, ...], other: tuple[int | str, ...]) -> bool:
    return len(path) > len(other) and path[: len(other)] == other


def _written(path: KeyPath, data: FieldValue) -> KeyPath:
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


def _problem(item: ErrorDetails, path: KeyPath, model: type[BaseModel] | None, origin: Origin | None) -> ScenarioError:
    """Return the error of one of pydantic's."""
    kind, value = item["type"], item.get("input")
    place = place_of(path, origin)
    fields = {} if model is None else model.model_fields
    info = fields.get(str(item["loc"][0])) if item["loc"] else None
    if kind == "extra_forbidden":
        unknown = UnknownNameError("key", str(path[-1]), fields)
        return ScenarioKeyError(str(unknown), place, value=value)
    if kind == "missing":
        return ScenarioKeyError("is missing", place, value=None)
    if kind == "union_tag_not_found":
        name, known = tags_of(info)
        return ScenarioKeyError(f"lacks `{name}` ({', '.join(known)})", place, value=value)
    if kind == "union_tag_invalid":
        name, known = tags_of(info)
        tag = str(item["ctx"]["tag"])
        return ScenarioValueError(str(UnknownNameError(name, tag, known)), place_of((*path, name), origin), value=tag)
    allowed = allowed_text(item, info)
    if kind == "value_error":
        return ScenarioValueError(f"is not allowed: it needs {allowed}", place, value=value)
    unit = unit_of(info)
    shown = "" if isinstance(value, dict | list | tuple) else f"= {value!r} "
    message = f"{shown}is not allowed: it should be {allowed}" + (f" [{unit}]" if unit else "")
    return ScenarioValueError(message, place, remedy_of(item, info), value=value)
