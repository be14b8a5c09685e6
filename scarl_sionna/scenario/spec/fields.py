"""One field of a specification by its dotted path, as ``--set`` and sweeps name it."""

from __future__ import annotations

import typing

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.spec import Spec, SpecT

from .light import CLOCK, at_hour, hour_of

_TOGETHER = {
    **dict.fromkeys(
        (f"lighting.{key}" for key in CLOCK),
        """give all of it: --set 'lighting={time_of_day: "18:30", day_of_year: 172}'""",
    ),
    "lighting.preset": "set lighting=dusk, or --set 'lighting={preset: dusk, cloud_cover: 0.9}'",
    "weather.preset": "set weather=rain, or --set 'weather={preset: rain, rain_rate: 5}'",
}
"""Keys of scenario files that are no fields of their own, and what to write instead."""


def with_field(spec: SpecT, path: str, value: object) -> SpecT:
    """Return a specification with the field at a dotted path changed, for instance ``radar.raycast.num_rays``.

    ``lighting.time_of_day`` is no field, but a key of scenario files: sun, lamps and exposure follow from it.

    Raises
    ------
    UnknownNameError
        If there is no such field.
    ParameterRangeError
        If the value is not allowed.
    """
    name, _, rest = path.partition(".")
    if name not in type(spec).model_fields:
        raise UnknownNameError(f"field of {type(spec).__name__}", name, type(spec).model_fields)
    if not rest:
        return spec.with_(**{name: value})
    inner = getattr(spec, name)
    if path == "lighting.time_of_day":
        return spec.with_(lighting=at_hour(inner, hour_of(value)))
    if path in _TOGETHER:
        raise ParameterRangeError(f"--set {path}", value, "together with what it goes with", _TOGETHER[path])
    if inner is None:
        inner = _empty(type(spec), name)
    if not isinstance(inner, Spec):
        raise ParameterRangeError(f"--set {path}", value, f"'{name}' has no fields", f"set {name}=...")
    return spec.with_(**{name: with_field(inner, rest, value)})


def _empty(kind: type[Spec], name: str) -> Spec | None:
    """Return the specification of an optional field that is left out, with its defaults."""
    for option in typing.get_args(kind.model_fields[name].annotation):
        if isinstance(option, type) and issubclass(option, Spec):
            return option()
    return None
