"""Names of fields inside the parts of a specification, as a short form of a copy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scarl_sionna.core.errors import SpecError
from scarl_sionna.core.prompt.refusals import Parts, home_of, parts_of, unknown_field
from scarl_sionna.core.spec import Spec

RENAMED: Mapping[str, str] = {"adc_bits": "bits", "adc_full_scale_dbm": "full_scale_dbm"}
"""Fields of version 0.1 that have another name in their part."""

SETTINGS = ("num_rays", "cell_labels")
"""Fields of version 0.1 that are no property of a radar and stand in `RadarSettings` today."""


def into_parts(spec: Spec, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return changes of a specification's own fields, with those of fields inside its parts put into the parts.

    Parameters
    ----------
    spec : Spec
    changes : mapping
        New values by name of a field of the specification or of one of its parts.

    Raises
    ------
    SpecError
        If no field has a name. The error suggests one, and says where it stands.
    """
    own = type(spec).model_fields
    out = {name: value for name, value in changes.items() if name in own}
    parts = {name: getattr(spec, name) for name in parts_of(type(spec))}
    parts.update({name: value for name, value in out.items() if isinstance(value, Spec)})
    kinds = {name: (type(value),) for name, value in parts.items()}
    for name, value in changes.items():
        if name in own:
            continue
        home = home_of(name, kinds)
        if home is None:
            raise misplaced(type(spec), name, value, kinds)
        part, _ = home
        there = out.get(part, parts[part])
        if isinstance(there, Spec):
            kept = {"kind", *there.model_fields_set}
            there = {item: getattr(there, item) for item in type(there).model_fields if item in kept}
        if isinstance(there, Mapping):  # what is no mapping is refused with the others
            there = {**there, name: value}
        out[part] = there
    return out


def misplaced(spec: type[Spec], name: str, value: object, parts: Parts | None = None) -> SpecError:
    """Return the error about a name that a specification does not have itself; see :func:`unknown_field`."""
    if name in SETTINGS:
        shown = f"{value!r:.80}"
        return SpecError(spec, (name,), shown, "in the settings", f"write RadarSettings.of({name}={shown})")
    return unknown_field(spec, (name,), value, parts, RENAMED)


def place_of(spec: type[Spec], name: str) -> str | None:
    """Return where to read a field that stands in a part, ``"adc.bits"``; None if no part has it."""
    field = RENAMED.get(name, name)
    home = home_of(field, parts_of(spec))
    return None if home is None else f"{home[0]}.{field}"
