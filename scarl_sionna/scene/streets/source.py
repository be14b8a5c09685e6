"""The root of a map's file, attributes of its elements as checked values, and the list of what is not used."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from scarl_sionna.core.errors import InputFileError, MapError
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.xml_text import LinedElement, read_xml_with_lines

from .model import Cubics, Finding

MOST_BYTES = 128 * MEGABYTE
LARGEST = 1e7
"""Numbers beyond it are no length in metres, and no angle."""

_SPEEDS = {"km/h": 1.0 / 3.6, "mph": 0.44704, "m/s": 1.0}


@contextmanager
def map_errors(path: Path, remedy: str) -> Iterator[None]:
    """Raise a `MapError` for a file that is not there (with the remedy) or cannot be read."""
    try:
        yield
    except FileNotFoundError:
        raise MapError("map file not found", path, remedy) from None
    except InputFileError as error:
        raise MapError(str(error.strerror), path) from error
    except OSError as error:
        raise MapError(f"cannot be read ({error.strerror})", path, "check its permissions") from error


def read_root(path: Path, tag: str, file: str, form: str) -> LinedElement:
    """Return the root element of a map, which has that tag; remedies name the `file` and its `form`.

    Raises
    ------
    MapError
        If the file is not there, cannot be read, is no XML, or has another root.
    """
    remedy = f"give the path of {file}"
    if not path.is_file():
        raise MapError("map file not found", path, remedy)
    with map_errors(path, remedy):
        root = read_xml_with_lines(path, MOST_BYTES)
    if root.tag != tag:
        raise MapError(f"the root element is <{root.tag}>, not <{tag}>", path, f"give {form}", root.line)
    return root


class Source:
    """A file that is being read: its path, and findings that are alike as one."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._found: dict[str, list[int]] = {}

    def note(self, line: int, text: str) -> None:
        """Add a finding."""
        self._found.setdefault(text, []).append(line)

    def findings(self) -> tuple[Finding, ...]:
        """Return the findings in the order of their lines; those that are alike stand at the first one's."""
        rows = []
        for text, lines in self._found.items():
            more = f" (and on {len(lines) - 1} more lines)" if len(lines) > 1 else ""
            rows.append(Finding(min(lines), text + more))
        return tuple(sorted(rows, key=lambda finding: finding.line))

    def note_unused(self, root: LinedElement, used: Mapping[str, Sequence[str]]) -> None:
        """Add a finding for every element that is not used, not for those inside it.

        `used` names the children of each element that are.
        """
        waiting = [root]
        while waiting:
            element = waiting.pop()
            for child in element:
                assert isinstance(child, LinedElement)
                if child.tag in used.get(element.tag, ()):
                    waiting.append(child)
                elif len(child) or child.attrib or element.tag not in used:
                    self.note(child.line, f"<{child.tag}> in <{element.tag}> is not used")

    def error(self, element: LinedElement, message: str, remedy: str = "") -> MapError:
        """Return the error for an element, to be raised."""
        return MapError(f"<{element.tag}> {message}", self.path, remedy, element.line)

    def text(self, element: LinedElement, name: str, default: str | None = None) -> str:
        """Return an attribute; without a default it must be there."""
        value = element.get(name, default)
        if value is None:
            raise self.error(element, f"has no '{name}'")
        return str(value)

    def number(
        self,
        element: LinedElement,
        name: str,
        default: float | None = None,
        low: float = -LARGEST,
        high: float = LARGEST,
    ) -> float:
        """Return an attribute as a finite number within limits; without a default it must be there."""
        raw = element.get(name)
        if raw is None or (not raw.strip() and default is not None):
            if default is None:
                raise self.error(element, f"has no '{name}'")
            return default
        try:
            value = float(raw)
        except ValueError:
            raise self.error(element, f"{name} = '{raw[:40]}' is no number") from None
        if not math.isfinite(value) or not low <= value <= high:
            raise self.error(element, f"{name} = {raw[:40]} is outside {low:g} to {high:g}")
        return value

    def whole(self, element: LinedElement, name: str, default: int | None = None) -> int:
        """Return an attribute as a whole number."""
        raw = element.get(name)
        if raw is None and default is not None:
            return default
        try:
            return int(self.text(element, name))
        except ValueError:
            raise self.error(element, f"{name} = '{str(raw)[:40]}' is no whole number") from None

    def numbers(self, element: LinedElement, names: Iterable[str]) -> dict[str, float]:
        """Return attributes as numbers by name; all must be there."""
        return {name: self.number(element, name) for name in names}

    def cubics(self, elements: list[LinedElement], start: str = "s") -> Cubics:
        """Return the polynomials ``a`` to ``d`` of elements, which must stand in the order of their starts."""
        rows = [[self.number(e, start), *(self.number(e, key) for key in "abcd")] for e in elements]
        for element, before, after in zip(elements[1:], rows[:-1], rows[1:], strict=True):
            if after[0] < before[0]:
                raise self.error(element, f"{start} = {after[0]:g} comes after {before[0]:g}", "put them in order")
        table = np.array(rows).reshape(-1, 5)
        return Cubics(table[:, 0].copy(), table[:, 1:].copy())

    def speed(self, element: LinedElement) -> float | None:
        """Return the speed limit of a ``<speed>`` [m/s]; None where none is stated."""
        if self.text(element, "max") in ("no limit", "undefined", "-1"):
            return None
        unit = self.text(element, "unit", "m/s")
        if unit not in _SPEEDS:
            raise self.error(element, f"unit = '{unit}'", f"{', '.join(_SPEEDS)} are allowed")
        return self.number(element, "max", low=0.0, high=1000.0) * _SPEEDS[unit] or None


def children(element: LinedElement | None, tag: str) -> list[LinedElement]:
    """Return the children of one kind, none of no element."""
    found = [] if element is None else [child for child in element if child.tag == tag]
    return found  # type: ignore[return-value]


def child(element: LinedElement | None, tag: str) -> LinedElement | None:
    """Return the first child of one kind."""
    return next(iter(children(element, tag)), None)
