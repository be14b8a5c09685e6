"""What a specification refuses, in words: the value, what is allowed with its unit, and what was probably meant."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from scarl_sionna.core.errors import ParameterRangeError, SpecError, UnknownFieldError, did_you_mean
from scarl_sionna.core.units import Unit

Path = tuple[str | int, ...]
Names = Mapping[str, str]
Parts = Mapping[str, tuple[type[BaseModel], ...]]
"""Specifications that stand, or may stand, in a field, by its name."""

_UNITS: Mapping[str, tuple[str, float]] = {
    "km/h": ("m/s", 1.0 / 3.6), "kmh": ("m/s", 1.0 / 3.6), "kph": ("m/s", 1.0 / 3.6), "mph": ("m/s", 0.44704),
    "kn": ("m/s", 0.514444), "km": ("m", 1e3), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "um": ("m", 1e-6), "nm": ("m",
    1e-9),
    "ft": ("m", 0.3048), "ms": ("s", 1e-3), "us": ("s", 1e-6), "ns": ("s", 1e-9), "min": ("s", 60.0), "h": ("s",
    3600.0),
    "rad": ("deg", 57.29577951308232), "khz": ("Hz", 1e3), "mhz": ("Hz", 1e6), "ghz": ("Hz", 1e9), "g": ("m/s2",
    9.80665),
    "mw": ("W", 1e-3), "w": ("W", 1.0), "m/s": ("m/s", 1.0), "m": ("m", 1.0), "s": ("s", 1.0), "deg": ("deg", 1.0),
    "hz": ("Hz", 1.0), "m/s2": ("m/s2", 1.0), "mm/h": ("mm/h", 1.0), "1/km": ("1/km", 1.0), "db": ("dB", 1.0),
    "dbm": ("dBm", 1.0), "dbi": ("dBi", 1.0), "k": ("K", 1.0),
}  # fmt: skip # a table
"""Units that people write, in small letters: the project's unit, and the factor to it."""
_NUMBER_WITH_UNIT = re.compile(r"^\s*([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*([A-Za-z][A-Za-z0-9/^]*)\s*$")
_SCALES: Mapping[str, tuple[tuple[float, str], ...]] = {
    "Hz": ((1e3, "kHz"), (1e6, "MHz"), (1e9, "GHz")),
    "s": ((1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")),
    "m": ((1e-2, "cm"), (1e-3, "mm"), (1e-9, "nm")),
    "W": ((1e-3, "mW"),),
}
"""Units in which people think where the project's own is far from a usual value."""
_ALLOWED: Mapping[str, str] = {
    "greater_than": "greater than {gt:.12g}", "greater_than_equal": "greater than or equal to {ge:.12g}",
    "less_than": "less than {lt:.12g}", "less_than_equal": "less than or equal to {le:.12g}",
    "finite_number": "a finite number",
    "float_type": "a number", "float_parsing": "a number", "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number", "bool_type": "true or false", "bool_parsing": "true or false",
    "string_type": "a text",
    "string_too_short": "a text of at least {min_length} characters", "string_pattern_mismatch": "a text of the form "
                                                                                                 "{pattern}",
    "too_short": "a list of at least {min_length} items", "too_long": "a list of at most {max_length} items",
    "tuple_type": "a list", "list_type": "a list", "dict_type": "a mapping", "missing": "a value: it has no default",
}  # fmt: skip # a table
"""What pydantic's kinds of errors ask for, with the numbers of their context."""


def refusal(model: type[BaseModel], error: ValidationError) -> SpecError:
    """Return the first thing that pydantic found wrong as an error of the project."""
    item = error.errors()[0]
    path = _without_kinds(model, tuple(item["loc"]))
    inner = item.get("ctx", {}).get("error")
    if isinstance(inner, UnknownFieldError):
        return UnknownFieldError(model, (*path, *inner.path), inner.known, inner.remedy, inner.owner)
    if isinstance(inner, ParameterRangeError):  # of a specification inside this one: its own value and remedy
        inside = inner.path if isinstance(inner, SpecError) else ()
        return SpecError(model, (*path, *inside), inner.value, inner.allowed, inner.remedy)
    if item["type"] == "extra_forbidden":
        return unknown_field(model, path, item["input"])
    info = model.model_fields.get(str(path[0])) if path else None
    unit = unit_of(info)
    shown = repr(item.get("input")) if item["type"] != "missing" else "nothing"
    if item["type"] == "union_tag_invalid":
        path, shown = (*path, tags_of(info)[0]), repr(item["ctx"]["tag"])
    allowed = allowed_text(item, info) + (
        f" [{unit}]" if unit and item["type"] not in ("value_error", "missing") else ""
    )
    return SpecError(model, path, shown[:80], allowed, remedy_of(item, info))


def _without_kinds(model: type[BaseModel], path: Path) -> Path:
    """Return the way to a value without the kinds that pydantic puts behind a field which takes several."""
    info = model.model_fields.get(str(path[0])) if len(path) > 1 else None
    return (path[0], *path[2:]) if path[1:] and path[1] in tags_of(info)[1] else path


def parts_of(model: type[BaseModel]) -> dict[str, tuple[type[BaseModel], ...]]:
    """Return the specifications that may stand in the fields of a specification, by the name of the field."""
    found = {name: tuple(_models_in(info.annotation)) for name, info in model.model_fields.items()}
    return {name: kinds for name, kinds in found.items() if kinds}


def home_of(name: str, parts: Parts) -> tuple[str, type[BaseModel]] | None:
    """Return the part that has a field of a name, and what it is; None if no part has it.

    Every part may have a `kind`.
    """
    homes = ((part, kind) for part, kinds in parts.items() for kind in kinds if name in kind.model_fields)
    return next(homes, None) if name != "kind" else None


def unknown_field(
    model: type[BaseModel], path: Path, value: object, parts: Parts | None = None, short_form: Names | None = None
) -> SpecError:
    """Return the error about a name that a specification does not have.

    It says in which part the name stands, or which name was meant.

    Parameters
    ----------
    model : type
        The specification's class.
    path : tuple of str or int
        The way to the name, and the name.
    value : object
        What the name was given.
    parts : mapping, optional
        Those that are there; default: all that the class allows, see :func:`parts_of`.
    short_form : mapping, optional
        For a specification whose `with_` takes the fields of its parts: other names of such fields, and their names
        there.
    """
    parts, name, shown = parts_of(model) if parts is None else parts, str(path[-1]), f"{value!r:.80}"
    field = (short_form or {}).get(name, name)
    allowed, meant, home = "", "", home_of(field, parts)
    if home is not None:
        allowed = f"in its part `{home[0]}`"
    else:
        inside = {field for kinds in parts.values() for kind in kinds for field in kind.model_fields} - {"kind"}
        field = next(iter(get_close_matches(name, sorted(inside.union(model.model_fields)), n=1)), "")
        home = home_of(field, parts) if field not in model.model_fields else None
        if home is None:
            return UnknownFieldError(model, path, model.model_fields)
        allowed = f"a field of {model.__name__} or of one of its parts {', '.join(parts)}"
        meant = f"did you mean '{field}'? "
    part, kind = home
    remedy = f"{meant}write {model.__name__}({part}={kind.__name__}({field}={shown}))"
    if short_form is not None and isinstance(model.model_fields[part].default, kind):
        remedy += f" or {model.__name__}().with_({field}={shown})"
    return SpecError(model, path, shown, allowed, remedy)


def unit_of(info: FieldInfo | None) -> str:
    """Return the unit of a field's numbers; empty if it has none."""
    if info is None:
        return ""
    found = next(_units_in((info.annotation, *info.metadata)), None)
    return found.symbol if found is not None else ""


def _units_in(parts: tuple[Any, ...]) -> Iterator[Unit]:
    for part in parts:
        if isinstance(part, Unit):
            yield part
        elif not isinstance(part, type):
            yield from _units_in(get_args(part))


def _models_in(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def choices_of(annotation: object) -> tuple[str, ...]:
    """Return the texts that a field takes, if it takes only some."""
    if get_origin(annotation) is Literal:
        return tuple(value for value in get_args(annotation) if isinstance(value, str))
    return tuple(choice for part in get_args(annotation) for choice in choices_of(part))


def tags_of(info: FieldInfo | None) -> tuple[str, tuple[str, ...]]:
    """Return the field by which the specifications that a field takes are told apart, and its values."""
    models = list(_models_in(info.annotation)) if info is not None else []
    for name in models[0].model_fields if models else ():
        values = [choices_of(model.model_fields[name].annotation) for model in models if name in model.model_fields]
        if len(values) == len(models) and all(values):
            return name, tuple(value for some in values for value in some)
    return "", ()


def allowed_text(item: ErrorDetails, info: FieldInfo | None) -> str:
    """Return what a value should have been, without its unit."""
    kind, context = item["type"], item.get("ctx", {})
    if kind == "value_error":
        return str(context["error"])
    if kind == "literal_error" and info is not None and (choices := choices_of(info.annotation)):
        return " or ".join(repr(choice) for choice in choices)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        name, tags = tags_of(info)
        return f"a `{name}` of {', '.join(map(repr, tags))}"
    if kind in ("model_type", "model_attributes_type"):
        return f"a {context.get('class_name', 'specification')}"
    try:
        return _ALLOWED[kind].format_map(context)
    except KeyError:
        return str(item["msg"])  # pydantic's own words, for people only


def remedy_of(item: ErrorDetails, info: FieldInfo | None) -> str:
    """Return what was probably meant, or nothing."""
    value, unit = item.get("input"), unit_of(info)
    if isinstance(value, str):
        if info is not None and item["type"] == "literal_error":
            return did_you_mean(value, choices_of(info.annotation))
        return in_our_unit(value, unit)
    if item["type"] == "union_tag_invalid":
        return did_you_mean(str(item["ctx"]["tag"]), tags_of(info)[1])
    if isinstance(value, int | float) and not isinstance(value, bool):
        return scaled(float(value), unit, item.get("ctx", {}))
    return ""


def in_our_unit(text: str, unit: str) -> str:
    """Return what to write instead of a text with a number and its unit, or nothing if it is none."""
    match = _NUMBER_WITH_UNIT.match(text)
    if match is None or not unit:
        return ""
    target, factor = _UNITS.get(match[2].lower(), ("", 0.0))
    if target != unit:
        return f"write a number in {unit}, without a unit"
    return f"write {float(match[1]) * factor:.6g}: numbers are in {unit}, without a unit"


def scaled(value: float, unit: str, limits: Mapping[str, Any]) -> str:
    """Return the numbers that a value outside of its limits would be in other units, where those are inside."""
    if not math.isfinite(value) or value <= 0.0:
        return ""

    def inside(number: float) -> bool:
        low, high = limits.get("gt", limits.get("ge", -math.inf)), limits.get("lt", limits.get("le", math.inf))
        return bool(low <= number <= high)

    meant = [
        f"{value * factor:.6g} for {value:g} {name}" for factor, name in _SCALES.get(unit, ()) if inside(value * factor)
    ]
    return f"numbers are in {unit}: write {' or '.join(meant)}" if meant else ""
