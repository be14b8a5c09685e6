"""Base of all specifications: frozen, unknown keys forbidden, changed by copy."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping
from functools import reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, ClassVar, TypeAlias, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, SerializerFunctionWrapHandler, ValidationError, model_serializer

from .errors import FrozenError
from .prompt.describe import Described, Row, short, value_text
from .prompt.refusals import refusal, unit_of

SpecT = TypeVar("SpecT", bound="Spec")
FieldValue: TypeAlias = Any
"""The value of a field by its name. `Any`, since the type follows from the name: pydantic checks it in a specification,
the schema states it for a dataset."""
_ONE_LINE = 100
"""A specification whose fields take at most so many characters shows itself in one line."""


class Spec(Described, BaseModel):
    """A frozen specification. Bad values raise :class:`SpecError` with the field, the value and what is allowed.

    Raises
    ------
    SpecError
        If a value is not allowed; it is a ParameterRangeError.
    UnknownFieldError
        If there is no field of a name.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    _derived: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Properties that its table shows first, each with its unit."""
    _quiet: ClassVar[tuple[str, ...]] = ()
    """Fields that its table shows only where they are not the default."""

    def __init__(self, **data: object) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise refusal(type(self), error) from error

    @classmethod
    def __pydantic_init_subclass__(cls, **others: object) -> None:
        """Give the class the signature of its fields, with plain types."""
        cls.__signature__ = inspect.Signature(  # type: ignore[assignment]
            [
                inspect.Parameter(
                    name,
                    inspect.Parameter.KEYWORD_ONLY,
                    default=inspect.Parameter.empty
                    if info.is_required()
                    else _as_written(info.get_default(call_default_factory=True)),
                    annotation=_plain(info.annotation),
                )
                for name, info in cls.model_fields.items()
            ]
        )

    def __setattr__(self, name: str, value: object) -> None:
        if name in type(self).model_fields:
            kind = type(self).__name__
            raise FrozenError(f"a {kind} is frozen: {name} cannot be set; make a copy: with_({name}={short(value)})")
        super().__setattr__(name, value)

    @classmethod
    def of(cls: type[SpecT], **fields: FieldValue) -> SpecT:
        """Return the specification of some fields, as the constructor does.

        Subclasses take names of their parts' fields, too.

        Raises
        ------
        UnknownFieldError
            If there is no such field.
        SpecError
            If a value is not allowed.
        """
        return cls(**fields)

    def with_(self: SpecT, **changes: object) -> SpecT:
        """Return a copy with some fields changed; the copy is validated again, and knows which fields were ever set."""
        kept = {name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set}
        return type(self)(**{**kept, **changes})

    def merged(self: SpecT, changes: SpecT) -> SpecT:
        """Return a copy with the fields that were set in `changes`, those of nested specifications one by one."""
        fields = {}
        for name in changes.model_fields_set:
            old, new = getattr(self, name), getattr(changes, name)
            fields[name] = old.merged(new) if isinstance(new, Spec) and type(old) is type(new) else new
        return self.with_(**fields) if fields else self

    def model_copy(self: SpecT, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> SpecT:
        """Return :meth:`with_` of the fields in `update`: validated again, and without anything computed before.

        Parameters
        ----------
        update : mapping, optional
            New values by name of a field.
        deep : bool
            Copy the values of the other fields, too. They are frozen: there is no need to.
        """
        copied = self.with_(**(update or {}))
        return copied.__deepcopy__() if deep else copied

    def __eq__(self, other: object) -> bool:
        """Whether all fields are equal. What was computed from them and kept, arrays for instance, does not count."""
        if not isinstance(other, Spec) or type(self) is not type(other):
            return NotImplemented
        names = type(self).model_fields
        mine, yours = self.__pydantic_private__, other.__pydantic_private__
        return all(getattr(self, name) == getattr(other, name) for name in names) and mine == yours

    def _facts(self) -> Iterable[Row]:
        for name, unit in self._derived:
            yield name, value_text(getattr(self, name), unit)
        for name, info in type(self).model_fields.items():
            value = getattr(self, name)
            if value is not None and not (name in self._quiet and value == info.default):
                yield name, value_text(value, unit_of(info))

    def __repr__(self) -> str:
        values = {name: getattr(self, name) for name in type(self).model_fields}
        inside = ", ".join(
            f"{name}={repr(value) if isinstance(value, str) else short(value)}"
            for name, value in values.items()
            if value is not None
        )
        if len(inside) <= _ONE_LINE:
            return f"{type(self).__name__}({inside})"
        return Described.__repr__(self)

    def __str__(self) -> str:
        return repr(self)


class WithoutNone(Spec):
    """A specification whose files leave out the fields that are None, as those of versions that did not know them."""

    @model_serializer(mode="wrap")
    def _without_none(self, inner: SerializerFunctionWrapHandler) -> dict[str, object]:
        return {name: value for name, value in inner(self).items() if value is not None}


class _Written:
    """Stands in a signature for a specification that is a default, and shows as one would write it."""

    def __init__(self, value: Spec) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return bool(self.value == (other.value if isinstance(other, _Written) else other))

    def __hash__(self) -> int:
        return hash(repr(self))

    def __repr__(self) -> str:
        fields = ", ".join(
            f"{name}={_as_written(getattr(self.value, name))!r}" for name in sorted(self.value.model_fields_set)
        )
        return f"{type(self.value).__name__}({fields})"


def _as_written(value: object) -> object:
    if isinstance(value, tuple) and any(isinstance(item, Spec) for item in value):
        return tuple(_as_written(item) for item in value)
    return _Written(value) if isinstance(value, Spec) else value


def _plain(annotation: object) -> object:
    """Return a type without its metadata."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _plain(arguments[0])
    if origin in (Union, UnionType):
        return reduce(or_, [_plain(one) for one in arguments])
    if isinstance(origin, type) and arguments:
        return origin[tuple(_plain(one) for one in arguments)]  # type: ignore[index]
    return annotation
