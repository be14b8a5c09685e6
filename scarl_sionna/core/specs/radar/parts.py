"""Names of fields inside the parts of a specification: as a short form of a copy, and in errors about a misplaced name."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.spec import Spec

RENAMED: Mapping[str, str] = {"adc_bits": "bits", "adc_full_scale_dbm": "full_scale_dbm"}
"""Fields of version 0.1 that have another name in their part."""

SETTINGS = ("num_rays", "cell_labels")
"""Fields of version 0.1 that are no property of a radar and stand in `RadarSettings` today."""


def parts_of(spec: type[Spec]) -> dict[str, Spec]:
    """Return the parts of a specification with their defaults, by the name of their field."""
    defaults = {name: field.default for name, field in spec.model_fields.items()}
    return {name: value for name, value in defaults.items() if isinstance(value, Spec)}


def home_of(name: str, parts: Mapping[str, Spec]) -> tuple[str, str] | None:
    """Return the part that has a field of a name, and the field's name there; None if no part has it."""
    field = RENAMED.get(name, name)
    homes = (part for part, value in parts.items() if field in type(value).model_fields and field != "kind")
    found = next(homes, None)
    return None if found is None else (found, field)


def into_parts(spec: Spec, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes of a specification's own fields, with those of fields inside its parts put into the parts.

    Parameters
    ----------
    spec : Spec
    changes : mapping
        New values by name of a field of the specification or of one of its parts.

    Raises
    ------
    ParameterRangeError
        If no field has a name. The error suggests one, and says where it stands.
    """
    own = type(spec).model_fields
    out = {name: value for name, value in changes.items() if name in own}
    parts = {name: getattr(spec, name) for name in parts_of(type(spec))}
    parts.update({name: value for name, value in out.items() if isinstance(value, Spec)})
    for name, value in changes.items():
        if name in own:
            continue
        home = home_of(name, parts)
        if home is None or name in RENAMED:
            raise misplaced(type(spec), name, value, parts)
        part, field = home
        there = out.get(part, parts[part])
        if isinstance(there, Spec):
            kept = {"kind", *there.model_fields_set}
            there = {item: getattr(there, item) for item in type(there).model_fields if item in kept}
        if isinstance(there, Mapping):  # what is no mapping is refused with the others
            there = {**there, field: value}
        out[part] = there
    return out


def misplaced(spec: type[Spec], name: str, value: object, parts: Mapping[str, Spec]) -> ParameterRangeError:
    """Return the error about a name that a specification does not have: where it stands, or the name that was meant."""
    where, text = f"{spec.__name__}.{name}", f"{value!r:.80}"
    if name in SETTINGS:
        return ParameterRangeError(where, text, "in the settings", f"write RadarSettings.of({name}={text})")
    home = home_of(name, parts)
    if home is None:
        fields = {field for part in parts.values() for field in type(part).model_fields if field != "kind"}
        close = get_close_matches(name, sorted({*spec.model_fields, *fields}), n=1)
        known = f"a field of {spec.__name__} or of one of its parts {', '.join(parts)}"
        if not close:
            return ParameterRangeError(where, text, known)
        home = home_of(close[0], parts)
        if home is None:
            return ParameterRangeError(where, text, known, f"did you mean '{close[0]}'?")
        return ParameterRangeError(where, text, known, f"did you mean '{close[0]}'? {_remedy(spec, home, text, parts)}")
    return ParameterRangeError(where, text, f"in its part `{home[0]}`", _remedy(spec, home, text, parts))


def _remedy(spec: type[Spec], home: tuple[str, str], value: str, parts: Mapping[str, Spec]) -> str:
    """Return how to write a field of a part."""
    part, field = home
    kind = type(parts[part]).__name__
    return f"write {spec.__name__}({part}={kind}({field}={value})) or {spec.__name__}().with_({field}={value})"
