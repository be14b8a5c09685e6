"""How objects show themselves: a name and a short table of facts, as text of at most 20 lines and as HTML."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Row = tuple[str, str]
"""Name of a fact, and the fact."""

MAX_LINES = 20
"""Most lines of a text; facts beyond are named in the last one."""
MAX_WIDTH = 110
"""Most characters of a line."""
_PREFIXED = ("Hz", "s", "W")
"""Units that are shown with a decimal prefix."""
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"), (1e-12, "p"))


class Described:
    """An object that shows itself as a table; a dataclass gives its fields.

    ``class Echo(Described, units={"range": "m"})`` states the units of fields. A dataclass needs ``repr=False``, since
    it would write a ``__repr__`` of its own.
    """

    _units: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, units: Mapping[str, str] | None = None, **others: object) -> None:
        super().__init_subclass__(**others)
        if units is not None:
            cls._units = dict(units)

    def _facts(self) -> Iterable[Row]:
        """Return the rows of the table; by default the fields that are not None."""
        return field_rows(self)  # type: ignore[arg-type]  # a subclass that is no dataclass has rows of its own

    def __repr__(self) -> str:
        return text_table(type(self).__name__, self._facts())

    def _repr_html_(self) -> str:
        return html_table(type(self).__name__, self._facts())


def field_rows(item: DataclassInstance, without: Iterable[str] = ()) -> list[Row]:
    """Return a row for every field of a dataclass that is not None."""
    units, left_out = getattr(item, "_units", {}), set(without)
    names = (entry.name for entry in fields(item) if entry.name not in left_out and not entry.name.startswith("_"))
    values = ((name, getattr(item, name)) for name in names)
    return [(name, value_text(value, units.get(name, ""))) for name, value in values if value is not None]


def text_table(title: str, rows: Iterable[Row]) -> str:
    """Return a title and rows as text of at most `MAX_LINES` lines of `MAX_WIDTH` characters."""
    table = list(rows)
    room = MAX_LINES - 1
    rest = table[room - 1 :] if len(table) > room else []
    table = table[: len(table) - len(rest)]
    width = max((len(name) for name, _ in table), default=0)
    lines = [title, *(f"  {name:<{width}}  {text}" for name, text in table)]
    if rest:
        lines.append(f"  and {len(rest)} more: " + ", ".join(f"{name} {text}" for name, text in rest))
    return "\n".join(clipped(line) for line in lines)


def html_table(title: str, rows: Iterable[Row], picture: str = "") -> str:
    """Return a title and rows as HTML; `picture` is HTML that stands above the table."""
    body = "".join(
        f'<tr><td style="text-align:left"><b>{html.escape(name)}</b></td>'
        f'<td style="text-align:left">{html.escape(text)}</td></tr>'
        for name, text in rows
    )
    return f"<div><b>{html.escape(title)}</b>{picture}<table>{body}</table></div>"


def clipped(text: str, width: int = MAX_WIDTH) -> str:
    """Return a text in one line of at most `width` characters."""
    line = text.replace("\n", " ") if "\n" in text else text
    return line if len(line) <= width else line[: width - 3] + "..."


def value_text(value: object, unit: str = "") -> str:
    """Return a value in a few words: shape and type of an array, never its numbers but for the ends of an axis."""
    if isinstance(value, np.ndarray):
        return array_text(value, unit)
    if isinstance(value, bool | np.bool_):
        return str(bool(value))
    if isinstance(value, int | float | np.integer | np.floating):
        return quantity(value, unit)
    if isinstance(value, str):
        return value
    if isinstance(value, Mapping):
        return "; ".join(f"{key}: {short(item)}" for key, item in value.items()) if value else "none"
    if isinstance(value, list | tuple):
        return _sequence_text(value, unit)
    return short(value)


def array_text(values: np.ndarray, unit: str = "") -> str:
    """Return type and shape of an array, and the ends of a line of numbers: ``float64 (512,), 0 to 255.5 m``.

    Up to four as such.
    """
    after = f" [{unit}]" if unit else ""
    text = f"{values.dtype} {values.shape}"
    if values.ndim != 1 or not len(values) or values.dtype.kind not in "fiu":
        return text + after
    if len(values) <= 4:
        return vector(values, unit)
    known = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    return f"{text}, {span(known.min(), known.max(), unit)}" if len(known) else text + after


def span(low: float, high: float, unit: str = "") -> str:
    """Return an interval with its unit."""
    return f"{low:.5g} to {high:.5g}" + (f" {unit}" if unit else "")


def quantity(value: float | np.integer | np.floating, unit: str = "") -> str:
    """Return a number with its unit: ``77 GHz``, ``12 dB``, ``0.5 m``."""
    number = float(value)
    if unit in _PREFIXED and np.isfinite(number) and number:
        factor, prefix = next((row for row in _PREFIXES if abs(number) >= row[0]), (1.0, ""))
        return f"{number / factor:.6g} {prefix}{unit}"
    text = str(int(value)) if isinstance(value, int | np.integer) else f"{number:.6g}"
    return f"{text} {unit}" if unit else text


def vector(values: Iterable[float], unit: str = "") -> str:
    """Return a few numbers in brackets with their unit."""
    inside = ", ".join(f"{float(value) + 0.0:.4g}" for value in values)
    return f"[{inside}]" + (f" {unit}" if unit else "")


def short(value: object) -> str:
    """Return a value in one line: its own repr where that is one, else the name of its type."""
    if isinstance(value, np.ndarray):
        return array_text(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return f"{len(value)} entries"
    if isinstance(value, Described) or is_dataclass(value):
        name = getattr(value, "name", None)
        own = repr(value) if isinstance(value, Described) else ""
        if own and "\n" not in own:
            return own
        return f"{type(value).__name__} {name}" if isinstance(name, str) else f"{type(value).__name__}(...)"
    if "__repr__" not in {
        name for kind in type(value).__mro__[:-1] for name in vars(kind)
    }:  # that of object, with an address
        return f"{type(value).__name__}(...)"
    text = str(value) if isinstance(value, str | PurePath) else repr(value)
    return clipped(text.splitlines()[0] if "\n" in text else text, 60)


def _sequence_text(values: Sequence[Any], unit: str) -> str:
    if not values:
        return "none"
    if all(isinstance(value, int | float) for value in values) and len(values) <= 6:
        return vector(values, unit)
    if all(isinstance(value, str) for value in values):
        return listed(values)
    if all(isinstance(value, list | tuple) for value in values):
        sizes = sorted({len(value) for value in values})
        return f"{len(values)} x {' or '.join(map(str, sizes))} values" + (f" [{unit}]" if unit else "")
    kinds = dict.fromkeys(type(value).__name__ for value in values)
    after = f" [{unit}]" if unit else ""
    return f"{len(values)} x {', '.join(kinds)}{after}"


def listed(names: Iterable[Any], most: int = 6) -> str:
    """Return the first names of a list, and how many there are: ``a, b, c and 4 more``."""
    every = [str(name) for name in names]
    more = f" and {len(every) - most} more" if len(every) > most else ""
    return ", ".join(every[:most]) + more if every else "none"
