"""Which settings the paths of each method depend on: what has no effect is refused as a keyword, else warned of."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from functools import cache

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.core.prompt.describe import short
from scarl_sionna.core.spec import Spec

from .radar import METHODS, QUALITIES, RadarSettings

_ALL = frozenset({"method", "max_distance", "num_band_frequencies", "warn_at"})
_BUDGETS = frozenset({"accuracy.cpu_budget", "accuracy.memory_budget"})
_OBJECTS = frozenset({"raycast", "sionna", "sbr", "scatterers"})
READS: Mapping[str, frozenset[str]] = {
    "raycast": _ALL | {"raycast", "instances"},
    "sionna": _ALL | {"sionna"},
    "scatterers": _ALL | {"scatterers"},
    "sbr": _ALL | _BUDGETS | {"sbr", "instances", "accuracy.over_budget", "auto.levels"},
    "hybrid": _ALL | _BUDGETS | _OBJECTS | {"plan", "mirrors", "accuracy.over_budget", "auto"},
    "auto": _ALL
    | _BUDGETS
    | _OBJECTS - {"sbr"}
    | {"auto", "mirrors", "accuracy.channel_tolerance_db", "accuracy.channel_floor_db", "accuracy.tube_budget"}
    | {"sbr.reciprocal"},
}
"""Parts of the settings, or single fields of a part or of the settings themselves, that paths depend on, by method.
``tests/unit/test_settings_reads.py`` watches what solves take from their settings."""
OF_FRAMES = frozenset(
    {
        "noise",
        "chirps_per_block",
        "interferers",
        "cell_labels",
        "weather_echoes",
        "scanning",
        "accuracy.synthesis_tolerance",
        "accuracy.motion_tolerance",
        "accuracy.channel_floor_db",  # for the echoes of rain and snow
    }
)
"""What frames depend on with any method."""


def refuse_unread(method: str, fields: Mapping[str, object]) -> None:
    """Refuse fields, given one by one, on which the paths of a method do not depend, and parts by such fields alone.

    Parameters
    ----------
    method : str
    fields : mapping
        As of :meth:`RadarSettings.changed`.

    Raises
    ------
    ParameterRangeError
        If a field has no effect.
    UnknownNameError
        If there is no such field.
    """
    for name, value in fields.items():
        part = RadarSettings.part_of(name, method)
        path = name if part is None else f"{part}.{name}"
        given = (_given(name, value) if part is None else []) or [path]
        known = READS[method] | OF_FRAMES
        if not _is_read(path, READS[method]) or not any(_is_read(one, known) for one in given):
            allowed = f"with method '{method}' settings of {_listed(method)}"
            raise ParameterRangeError(name, short(value), allowed, _remedy(path, method))


def warn_of_unread(settings: RadarSettings) -> None:
    """Warn of settings that are neither the default nor of a quality, and on which nothing depends with their method.

    Warns
    -----
    ScarlWarning
        With their names.
    """
    if found := unread(settings):
        texts = dict.fromkeys(_remedy(name, settings.method) for name in found)
        warnings.warn(
            f"{', '.join(found)}: no effect with method '{settings.method}', which reads settings of "
            f"{_listed(settings.method)}; {'; '.join(texts)}",
            ScarlWarning,
            stacklevel=3,
        )


def unread(settings: RadarSettings) -> list[str]:
    """Return the names of settings, ``part.field``, of which :func:`warn_of_unread` warns."""
    usual = _usual()
    allowed = READS[settings.method] | OF_FRAMES
    if settings.method == "hybrid":
        allowed |= READS["auto"]  # the settings that a plan was made by
    found: list[str] = []
    for name in RadarSettings.model_fields:
        value = getattr(settings, name)
        if name in allowed or value == getattr(usual[0], name):
            continue
        known = [getattr(one, name) for one in usual]
        if not isinstance(value, Spec):
            found += [name] * (value not in known)
            continue
        for field in type(value).model_fields:
            others = [getattr(one, field) for one in known]
            if f"{name}.{field}" not in allowed and getattr(value, field) not in others:
                found.append(f"{name}.{field}")
    return found


@cache
def _usual() -> tuple[RadarSettings, ...]:
    """Return the default settings, and those of the qualities."""
    return RadarSettings(), *(RadarSettings.preset(quality) for quality in QUALITIES)


def _is_read(path: str, allowed: Iterable[str]) -> bool:
    """Return whether a part, or a field of one, is among others, or holds one of them."""
    part = path.partition(".")[0]
    return path in allowed or part in allowed or any(one.startswith(f"{path}.") for one in allowed)


def _given(part: str, value: object) -> list[str]:
    """Return the names of the fields that are set in a part of the settings, ``part.field``."""
    fields = value.model_fields_set if isinstance(value, Spec) else value if isinstance(value, Mapping) else ()
    return [f"{part}.{field}" for field in fields]


def _listed(method: str) -> str:
    return ", ".join(f"`{name}`" for name in sorted(READS[method] - {"method"}))


def _remedy(path: str, method: str) -> str:
    if path in OF_FRAMES:
        return "frames depend on it: Radar(radar, settings).observe(...)"
    others = [other for other in METHODS if other != method and _is_read(path, READS[other])]
    text = "choose method " + " or ".join(f"'{other}'" for other in others)
    if "hybrid" in others and path != "plan":
        text += " (with a plan)"
    if method == "auto" and path.partition(".")[0] == "sbr":
        text = f"'auto' has levels of its own, to be changed by auto=AutoSettings(levels=...); or {text}"
    return text
