"""YAML as plain data: version 1.2's numbers, no tags but the plain ones, bounded in depth, breadth and numbers.

An alias is counted as often as it is used, so that ten lines cannot stand for 10^9 values.
"""

from __future__ import annotations

import re
from collections.abc import Hashable
from pathlib import Path

import yaml

from scarl_sionna.core.errors import InputFileError

from .files import MEGABYTE, read_text
from .json_text import PlainData, parse_json

DEEPEST = 32
"""More levels than any file of ours has."""
MOST_NODES = 100_000
"""Values that a file may stand for, aliases written out."""
MOST_BYTES = 16 * MEGABYTE
_LONGEST_INTEGER = 40
_PREFIX = "tag:yaml.org,2002:"
_PLAIN = frozenset(f"{_PREFIX}{kind}" for kind in ("str", "int", "float", "bool", "null", "seq", "map", "merge"))


class PlainLoader(yaml.SafeLoader):
    """YAML as in version 1.2: ``1e3`` is a number, ``18:30`` is a text, a date is a text."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._level = self._made = 0

    def compose_node(self, parent: yaml.Node | None, index: object) -> yaml.Node | None:  # type: ignore[override]
        """Return the next node, which is not too deep and not one too many."""
        self._level += 1
        self._made += 1
        mark = self.peek_event().start_mark
        if self._level > DEEPEST:
            raise yaml.MarkedYAMLError(problem="is nested too deeply", problem_mark=mark)
        if self._made > MOST_NODES:
            raise yaml.MarkedYAMLError(problem=f"holds more than {MOST_NODES} values", problem_mark=mark)
        node: yaml.Node | None = super().compose_node(parent, index)  # type: ignore[arg-type]
        self._level -= 1
        if node is not None and node.tag not in _PLAIN:
            raise yaml.MarkedYAMLError(problem=f"has the tag {node.tag!r:.60}, which is not read", problem_mark=mark)
        if isinstance(node, yaml.ScalarNode) and not node.value.isascii():
            node.value = _whole(node.value, mark)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, PlainData]:
        """Return a mapping, whose keys are texts."""
        found: dict[Hashable, PlainData] = super().construct_mapping(node, deep)
        for key in found:
            if not isinstance(key, str):
                raise yaml.MarkedYAMLError(
                    problem=f"{key!r:.40} is no key: keys are texts", problem_mark=node.start_mark
                )
        return found

    def get_single_node(self) -> yaml.Node | None:
        """Return the document's root, None where there is none."""
        try:
            node: yaml.Node | None = super().get_single_node()
        except (ValueError, OverflowError, RecursionError) as error:  # an escape of no character, and the like
            raise yaml.YAMLError(str(error)) from error
        if node is not None and _size(node, {}, set()) > MOST_NODES:
            raise yaml.MarkedYAMLError(
                problem=f"stands for more than {MOST_NODES} values, aliases written out", problem_mark=node.start_mark
            )
        return node


def _size(node: yaml.Node, known: dict[int, int], above: set[int]) -> int:
    """Return how many values a node stands for; a node inside itself is nested too deeply."""
    if not isinstance(node, yaml.CollectionNode):
        return 1
    if id(node) in above:
        raise yaml.MarkedYAMLError(problem="is nested too deeply", problem_mark=node.start_mark)
    if id(node) not in known:
        above.add(id(node))
        inner = node.value if isinstance(node, yaml.SequenceNode) else [part for pair in node.value for part in pair]
        known[id(node)] = 1 + sum(_size(item, known, above) for item in inner)
        above.remove(id(node))
    return known[id(node)]


PlainLoader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag.rpartition(":")[2] not in ("int", "float", "timestamp")]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
PlainLoader.add_implicit_resolver(
    f"{_PREFIX}int", re.compile(r"^[-+]?(?:0x[0-9a-fA-F]+|[0-9]+)$"), list("-+0123456789")
)
PlainLoader.add_implicit_resolver(
    f"{_PREFIX}float",
    re.compile(r"^[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|\.(?:inf|Inf|INF))$|^\.(?:nan|NaN|NAN)$"),
    list("-+0123456789."),
)


def _whole(text: str, mark: yaml.Mark | None) -> str:
    """Return a text whose pairs of surrogates, which JSON writes for what is beyond U+FFFF, are one character each."""
    try:
        return text.encode("utf-16", "surrogatepass").decode("utf-16")
    except UnicodeDecodeError as error:
        raise yaml.MarkedYAMLError(problem="holds half a character", problem_mark=mark) from error


def _decimal(loader: PlainLoader, node: yaml.ScalarNode) -> int:
    text = str(node.value)
    if len(text) > _LONGEST_INTEGER:
        raise yaml.MarkedYAMLError(
            problem=f"is an integer of {len(text)} digits, at most {_LONGEST_INTEGER} are read",
            problem_mark=node.start_mark,
        )
    return int(text, 16 if "x" in text else 10)


PlainLoader.add_constructor(f"{_PREFIX}int", _decimal)


def constructed(loader: PlainLoader, node: yaml.Node) -> PlainData:
    """Return the plain data of a node.

    Raises
    ------
    yaml.MarkedYAMLError
        Also where a tag says that a text is a number and it is none, or a key is no single value.
    """
    try:
        return loader.construct_document(node)
    except (ValueError, TypeError, OverflowError, RecursionError, KeyError) as error:
        raise yaml.MarkedYAMLError(problem=str(error), problem_mark=node.start_mark) from error


def parse_yaml(text: str) -> PlainData:
    """Return the plain data of a YAML text, None for an empty one.

    Raises
    ------
    yaml.YAMLError
        If it is not YAML, or nested too deeply, too long, or has tags.
    """
    loader = PlainLoader(text)
    try:
        node = loader.get_single_node()
        return None if node is None else constructed(loader, node)
    finally:
        loader.dispose()


def read_yaml(path: str | Path, most: int = MOST_BYTES) -> PlainData:
    """Return the plain data of a YAML or JSON file.

    Raises
    ------
    InputFileError
        If it is no regular file, too large, no text, or not YAML.
    OSError
        If it cannot be opened.
    """
    text = read_text(path, most)
    if text.lstrip()[:1] in ("{", "["):  # JSON is a part of YAML, and read a hundred times faster
        try:
            return parse_json(text)
        except ValueError:
            pass
    try:
        return parse_yaml(text)
    except yaml.YAMLError as error:
        raise InputFileError(f"not a valid YAML file ({error})", path, "correct the line named above") from error
