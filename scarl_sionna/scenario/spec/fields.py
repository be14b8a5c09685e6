"""One field of a specification by its dotted path, as ``--set`` and sweeps name it."""

from __future__ import annotations

import typing

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.spec import Spec, SpecT


def with_field(spec: SpecT, path: str, value: object) -> SpecT:
    """Return a specification with the field at a dotted path changed, for instance ``radar.raycast.num_rays``.

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
