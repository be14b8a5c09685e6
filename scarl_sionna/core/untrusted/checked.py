"""Plain data against a model: what does not fit is one typed error that names the place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from scarl_sionna.core.errors import UnknownNameError

ModelT = TypeVar("ModelT", bound=BaseModel)

Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e30, le=1e30)]
"""A finite number; a text or a truth value is none."""
Text = Annotated[str, Field(max_length=10_000)]


class Table(BaseModel):
    """A table whose values have the types stated; keys that it does not name stay, for their own reader to refuse."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True, populate_by_name=True)


def place(location: Iterable[str | int]) -> str:
    """Return where something stands, as ``actors[1].name``."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def checked(model: type[ModelT], data: object) -> ModelT:
    """Return plain data as a model.

    Raises
    ------
    ValueError
        With the first thing that does not fit, its place and how many more there are.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        found = error.errors(include_url=False)
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        first = found[0]
        value = repr(first["input"])[:60]
        raise ValueError(f"{place(first['loc']) or 'it'} = {value}: {first['msg']}{more}") from None


def check_keys(table: Iterable[str], what: str, known: Iterable[str]) -> None:
    """Check that a table has no key that its reader does not know.

    Raises
    ------
    UnknownNameError
        With the first that is unknown, `what` it is (``"key of [scene]"``), and the nearest known one.
    """
    allowed = set(known)
    if unknown := sorted(set(table) - allowed):
        raise UnknownNameError(what, unknown[0], allowed)


def plain(model: BaseModel) -> dict[str, Any]:
    """Return what was written of a model as plain data, under the names in the file."""
    return model.model_dump(by_alias=True, exclude_unset=True)


def is_mapping(data: object) -> bool:
    """Return whether data is a table whose keys are texts."""
    return isinstance(data, Mapping) and all(isinstance(key, str) for key in data)
