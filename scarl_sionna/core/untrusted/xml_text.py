"""XML as a tree of a bounded depth."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from scarl_sionna.core.errors import InputFileError

from .files import MEGABYTE, read_bytes

DEEPEST = 100
MOST_BYTES = 256 * MEGABYTE


def read_xml(path: str | Path, most: int = MOST_BYTES) -> ET.Element:
    """Return the root of an XML file; entities that grow are refused by the parser (expat 2.4.1 and later).

    Raises
    ------
    InputFileError
        If it is no regular file, too large, nested too deeply, or not valid XML.
    OSError
        If it cannot be opened.
    """
    data = read_bytes(path, most)
    depth, root = 0, None
    try:
        for event, element in ET.iterparse(io.BytesIO(data), ("start", "end")):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise InputFileError(f"has more than {DEEPEST} elements inside each other", path)
    except (ET.ParseError, ValueError, LookupError) as error:  # the last two: of an encoding that is none
        raise InputFileError(f"is not valid XML ({error})", path, "correct the line named above") from error
    assert root is not None  # an empty text is no XML
    return root


class LinedElement(ET.Element):
    """An element that knows the line of its file, from 1."""

    line: int = 0


def read_xml_with_lines(path: str | Path, most: int = MOST_BYTES, most_elements: int = 5_000_000) -> LinedElement:
    """Return the root of an XML file whose elements know their lines; errors as for :func:`read_xml`.

    Files with a document type are refused, so that no entity can grow.
    """
    data = read_bytes(path, most)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    builder = _Builder(parser, path, most_elements)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.StartDoctypeDeclHandler = builder.refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputFileError(f"is not valid XML ({error})", path, "correct the line named above") from error
    assert builder.root is not None  # an empty text is no XML
    return builder.root


class _Builder:
    """Makes elements from the parser's events; texts between elements are not kept."""

    def __init__(self, parser: expat.XMLParserType, path: str | Path, most: int) -> None:
        self.parser, self.path, self.left = parser, path, most
        self.root: LinedElement | None = None
        self.open: list[LinedElement] = []

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Begin an element."""
        element = LinedElement(tag, attributes)
        element.line = self.parser.CurrentLineNumber
        self.left -= 1
        if len(self.open) >= DEEPEST or self.left < 0:
            what = f"more than {DEEPEST} elements inside each other" if self.left >= 0 else "too many elements"
            raise InputFileError(f"has {what} (line {element.line})", self.path)
        if self.open:
            self.open[-1].append(element)
        else:
            self.root = element
        self.open.append(element)

    def end(self, tag: str) -> None:
        """End an element."""
        self.open.pop()

    def refuse(self, *declaration: object) -> None:
        """Refuse a document type."""
        raise InputFileError(
            f"has a document type (line {self.parser.CurrentLineNumber}), which is not read", self.path, "remove it"
        )
