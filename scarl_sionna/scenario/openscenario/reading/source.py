"""Elements of an OpenSCENARIO file as checked values, with errors that name file and line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from scarl_sionna.core.errors import (
    InputFileError,
    ScenarioError,
    ScenarioFileError,
    ScenarioKeyError,
    ScenarioPlace,
    ScenarioValueError,
    UnsupportedElementError,
)
from scarl_sionna.core.untrusted.files import MEGABYTE
from scarl_sionna.core.untrusted.xml_text import LinedElement, read_xml_with_lines

from .expressions import resolved

MOST_BYTES, MOST_ELEMENTS = 32 * MEGABYTE, 500_000
LARGEST = 1e7
"""Numbers beyond it are no time, way or speed."""
_NAME = re.compile(r"^\$?([A-Za-z_][A-Za-z0-9_]*)$")


@dataclass
class Problems:
    """What was found in all files of a scenario: errors, raised together, and what has no effect."""

    errors: list[ScenarioError] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)

    @contextmanager
    def collected(self) -> Iterator[None]:
        """Keep an error raised inside and go on."""
        try:
            yield
        except ScenarioError as error:
            self.errors += error.problems

    def check(self) -> None:
        """Raise the errors that were kept, if any."""
        if self.errors:
            unique = list({problem.text: problem for problem in self.errors}.values())
            raise ScenarioError.first_of(unique)


@dataclass(frozen=True, eq=False)
class Node:
    """An element with its file and the parameters that are known in it."""

    element: LinedElement
    file: Path
    scope: Mapping[str, str]
    problems: Problems
    is_assigned: bool = False

    @property
    def tag(self) -> str:
        """Name of the element."""
        return self.element.tag

    @property
    def line(self) -> int:
        """Its line in the file, from 1."""
        return self.element.line

    @property
    def place(self) -> ScenarioPlace:
        """Where it stands."""
        return ScenarioPlace(f"<{self.tag}>", str(self.file), self.line)

    def within(self, scope: Mapping[str, str]) -> Node:
        """Return the element with further parameters."""
        return replace(self, scope={**self.scope, **scope})

    def error(self, message: str, remedy: str = "") -> ScenarioValueError:
        """Return an error about a value, to be raised."""
        return ScenarioValueError(message, self.place, remedy)

    def unsupported(self, remedy: str, what: str = "is not read") -> UnsupportedElementError:
        """Return the error for an element that would decide motion and is not read, to be raised."""
        return UnsupportedElementError(what, self.place, remedy)

    def note(self, text: str) -> None:
        """Tell that something has no effect."""
        said = f"{self.file.name}, line {self.line}: <{self.tag}> {text}"
        if said not in self.problems.findings:
            self.problems.findings.append(said)

    def children(self, *tags: str) -> list[Node]:
        """Return the children of some kinds, of all kinds without an argument."""
        found = [one for one in self.element if not tags or one.tag in tags]
        return [replace(self, element=one, is_assigned=False) for one in found]  # type: ignore[arg-type]

    def child(self, *tags: str) -> Node | None:
        """Return the first child of some kinds."""
        found = self.children(*tags)
        return found[0] if found else None

    def need(self, *tags: str) -> Node:
        """Return the first child of some kinds; it must be there."""
        found = self.child(*tags)
        if found is None:
            raise ScenarioKeyError(f"has no <{'> or <'.join(tags)}>", self.place)
        return found

    def only(self) -> Node:
        """Return the one child that an element with a choice has."""
        found = [one for one in self.children() if one.tag != "ParameterDeclarations"]
        if len(found) != 1:
            raise self.error(f"has {len(found)} children", "give one of those that the format allows here")
        return found[0]

    def has(self, name: str) -> bool:
        """Return whether an attribute is there and not empty."""
        return bool(str(self.element.get(name, "")).strip())

    def text(self, name: str, default: str | None = None) -> str:
        """Return an attribute with its parameters resolved; without a default it must be there."""
        raw = self.element.get(name)
        if raw is None:
            if default is None:
                raise ScenarioKeyError(f"has no '{name}'", self.place)
            return default
        try:
            return resolved(raw, self.scope)
        except ValueError as error:
            raise self.error(f"{name}: {error}") from None

    def name(self, default: str = "") -> str:
        """Return the element's name; what is no parameter stays as it is."""
        raw = str(self.element.get("name", default))
        try:
            return resolved(raw, self.scope)
        except ValueError:
            return raw

    def number(
        self, name: str, default: float | None = None, low: float = -LARGEST, high: float = LARGEST, unit: str = ""
    ) -> float:
        """Return an attribute as a finite number within limits; without a default it must be there."""
        if not self.has(name) and default is not None:
            return default
        raw = self.text(name)
        try:
            value = float(raw)
        except ValueError:
            raise self.error(f"{name} = '{raw[:40]}' is no number") from None
        if not math.isfinite(value) or not low <= value <= high:
            raise self.error(f"{name} = {raw[:40]} {unit}".rstrip() + f" is outside {low:g} to {high:g}")
        return value

    def limit(self, name: str) -> float:
        """Return a limit above 0; infinite where none is given or it says INF."""
        if not self.has(name) or self.text(name).lower() in ("inf", "+inf", "infinity"):
            return math.inf
        try:
            value = float(self.text(name))
        except ValueError:
            raise self.error(f"{name} = '{self.text(name)[:40]}' is no number") from None
        if math.isnan(value) or not value > 0.0:
            raise self.error(f"{name} = {value:g} is not above 0")
        return value

    def whole(self, name: str, default: int | None = None) -> int:
        """Return an attribute as a whole number."""
        value = self.number(name, None if default is None else float(default))
        if value != int(value):
            raise self.error(f"{name} = {value:g} is no whole number")
        return int(value)

    def truth(self, name: str, default: bool | None = None) -> bool:
        """Return an attribute as true or false."""
        raw = self.text(name, None if default is None else str(default).lower()).lower()
        if raw not in ("true", "false", "1", "0"):
            raise self.error(f"{name} = '{raw[:40]}' is neither true nor false")
        return raw in ("true", "1")

    def choice(self, name: str, allowed: tuple[str, ...], default: str | None = None) -> str:
        """Return an attribute that is one of some words."""
        value = self.text(name, default)
        if value not in allowed:
            raise self.error(f"{name} = '{value[:40]}'", f"{', '.join(allowed)} are allowed")
        return value

    def declared(self) -> Node:
        """Return the element with the parameters that its own ParameterDeclarations state.

        What a catalog gave has them already.
        """
        if self.is_assigned:
            return self
        scope = dict(self.scope)
        for holder in self.children("ParameterDeclarations"):
            for one in holder.children("ParameterDeclaration"):
                inner = replace(one, scope=scope)
                scope[parameter_name(one)] = inner.text("value", "")
        return replace(self, scope=scope)


def parameter_name(node: Node, attribute: str = "name") -> str:
    """Return the name of a parameter, with or without its ``$``."""
    raw = str(node.element.get(attribute, ""))
    found = _NAME.match(raw)
    if found is None:
        raise node.error(f"{attribute} = '{raw[:40]}' is no name of a parameter")
    return found[1]


def read_root(path: Path, problems: Problems) -> Node:
    """Return the root of an OpenSCENARIO file, its header checked.

    Raises
    ------
    ScenarioError
        If the file cannot be read, is no OpenSCENARIO XML of version 1, or holds no XML.
    """
    place = ScenarioPlace("", str(path))
    try:
        root = read_xml_with_lines(path, MOST_BYTES, MOST_ELEMENTS)
    except FileNotFoundError:
        raise ScenarioFileError("is not there", place, "give the path of an OpenSCENARIO file", value=path) from None
    except InputFileError as error:
        raise ScenarioFileError(str(error.strerror), place, value=path) from error
    except OSError as error:
        raise ScenarioFileError(f"cannot be read ({error.strerror})", place, value=path) from error
    node = Node(root, path, {}, problems)
    if root.tag not in ("OpenSCENARIO", "OpenScenario"):
        raise ScenarioFileError(
            f"the root element is <{root.tag}>, not <OpenSCENARIO>",
            node.place,
            "give an OpenSCENARIO XML of 1.0 to 1.3",
        )
    header = node.need("FileHeader")
    major, minor = header.whole("revMajor", 1), header.whole("revMinor", 0)
    if major != 1:
        raise header.unsupported("convert it to version 1", f"revMajor = {major}: versions 1.0 to 1.3 are read")
    if minor > 3:
        header.note(f"version 1.{minor} is read as 1.3")
    return node
