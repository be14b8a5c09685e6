"""Base of all specifications: frozen, unknown keys forbidden, changed by copy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from .errors import ParameterRangeError, UnknownNameError

SpecT = TypeVar("SpecT", bound="Spec")


class Spec(BaseModel):
    """A frozen specification. Bad values raise :class:`ParameterRangeError` with the field, the value and what is allowed."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            first = error.errors()[0]
            name = ".".join([type(self).__name__, *(str(part) for part in first["loc"])])
            inner = first.get("ctx", {}).get("error")
            if isinstance(inner, ParameterRangeError):  # of a specification inside this one: its own value and remedy
                name = ".".join(part for part in (name, inner.name.partition(".")[2]) if part)
                raise ParameterRangeError(name, inner.value, inner.allowed, inner.remedy) from error
            value, allowed = first.get("input"), first["msg"].removeprefix("Value error, ")
            raise ParameterRangeError(name, repr(value)[:80], allowed) from error

    @classmethod
    def of(cls: type[SpecT], **fields: Any) -> SpecT:
        """Return the specification of some fields; a misspelt one is an error that lists the known ones.

        Raises
        ------
        UnknownNameError
            If there is no such field.
        ParameterRangeError
            If a value is not allowed.
        """
        for name in fields:
            if name not in cls.model_fields:
                raise UnknownNameError(f"field of {cls.__name__}", name, cls.model_fields)
        return cls(**fields)

    def with_(self: SpecT, **changes: Any) -> SpecT:
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
