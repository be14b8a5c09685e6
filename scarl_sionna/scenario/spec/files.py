"""Reads YAML and JSON with the line and column of every key, so that an error can name them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from scarl_sionna.core.errors import ScenarioError, ScenarioFileError, ScenarioKeyError, ScenarioPlace
from scarl_sionna.core.untrusted.files import read_text
from scarl_sionna.core.untrusted.yaml_text import MOST_BYTES, PlainLoader, constructed

KeyPath = tuple[str | int, ...]
"""Keys and list positions from the top, for instance ``("actors", 1, "model")``."""


@dataclass(frozen=True)
class Origin:
    """Where a scenario comes from: its file, that file's folder, and line and column (from 1) of each key."""

    file: str
    folder: Path
    marks: Mapping[KeyPath, tuple[int, int]] = field(default_factory=dict)

    def without(self, keys: Iterable[str]) -> Origin:
        """Return the origin without the lines of some keys of the top level, which no longer say what they said."""
        gone = set(keys)
        return replace(self, marks={path: mark for path, mark in self.marks.items() if not path or path[0] not in gone})


def key_text(path: Iterable[str | int]) -> str:
    """Return a key path as text: ``actors[1].model``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def path_of(text: str) -> KeyPath:
    """Return the key path of a text, the inverse of `key_text`."""
    return tuple(int(number) if number else word for number, word in re.findall(r"\[(\d+)\]|([^.\[\]]+)", text))


def place_of(path: KeyPath, origin: Origin | None) -> ScenarioPlace:
    """Return the place of a key; of one that is not written, that of the nearest key around it."""
    if origin is None:
        return ScenarioPlace(key_text(path))
    known = next(path[:length] for length in range(len(path), -1, -1) if path[:length] in origin.marks or not length)
    line, column = origin.marks.get(known, (None, None)) if known or not path else (None, None)
    return ScenarioPlace(key_text(path), origin.file, line, column)


def read_marked(path: Path) -> tuple[Any, Origin]:
    """Return the content of a YAML or JSON file, and where each of its keys stands.

    Raises
    ------
    ScenarioFileError
        If the file cannot be read or is not YAML.
    ScenarioKeyError
        If a key stands twice, or is not a text.
    """
    file = str(path)
    try:
        text = read_text(path, MOST_BYTES)
        loader = PlainLoader(text)
    except (OSError, yaml.YAMLError) as error:  # of a character that YAML does not allow
        reason = getattr(error, "strerror", None) or str(error)
        raise ScenarioFileError(
            f"scenario file = {path} cannot be read ({reason})",
            ScenarioPlace("", file),
            "give a readable YAML or JSON file",
            value=path,
        ) from error
    try:
        node = loader.get_single_node()
        marks: dict[KeyPath, tuple[int, int]] = {}
        problems: list[ScenarioError] = []
        if node is not None:
            _walk(loader, node, (), marks, problems, file)
        if problems:
            raise ScenarioError.first_of(problems)
        data = None if node is None else constructed(loader, node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = ScenarioPlace("", file) if mark is None else ScenarioPlace("", file, mark.line + 1, mark.column + 1)
        what = " ".join(part for part in (error.context, error.problem) if part)
        raise ScenarioFileError(f"scenario file = {path} is not valid YAML ({what})", place, value=path) from error
    except yaml.YAMLError as error:
        raise ScenarioFileError(
            f"scenario file = {path} is not valid YAML ({error})", ScenarioPlace("", file), value=path
        ) from error
    finally:
        loader.dispose()
    return data, Origin(file, path.resolve().parent, marks)


def _walk(
    loader: PlainLoader,
    node: yaml.Node,
    path: KeyPath,
    marks: dict[KeyPath, tuple[int, int]],
    problems: list[ScenarioError],
    file: str,
) -> None:
    """Note line and column of every key and list item below a node."""
    marks.setdefault(path, _mark(node))
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            _walk(loader, item, (*path, index), marks, problems, file)
    elif isinstance(node, yaml.MappingNode):
        _check_keys(node, path, problems, file)
        loader.flatten_mapping(node)
        for key, value in node.value:
            inner = (*path, str(key.value))
            scalar = isinstance(value, yaml.ScalarNode) and value.start_mark.line == key.start_mark.line
            marks[inner] = _mark(value if scalar else key)
            _walk(loader, value, inner, marks, problems, file)


def _check_keys(node: yaml.MappingNode, path: KeyPath, problems: list[ScenarioError], file: str) -> None:
    seen: dict[str, int] = {}
    for key, _ in node.value:
        if key.tag == "tag:yaml.org,2002:merge":
            continue
        line, column = _mark(key)
        place = ScenarioPlace(key_text((*path, str(key.value))), file, line, column)
        if not isinstance(key, yaml.ScalarNode) or key.tag != "tag:yaml.org,2002:str":
            problems.append(ScenarioKeyError("is not a key of a scenario: keys are words", place))
        elif key.value in seen:
            problems.append(ScenarioKeyError(f"stands twice: first in line {seen[key.value]}", place, "remove one"))
        else:
            seen[key.value] = line


def _mark(node: yaml.Node) -> tuple[int, int]:
    return node.start_mark.line + 1, node.start_mark.column + 1
