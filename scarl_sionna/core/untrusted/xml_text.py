"""XML as a tree of a bounded depth."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from pathlib import Path

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
