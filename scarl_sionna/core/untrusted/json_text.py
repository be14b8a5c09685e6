"""JSON as plain data: numbers of a bounded length, a bounded depth."""

from __future__ import annotations

import json
from typing import Any

PlainData = Any
"""Mappings, lists, texts, numbers, truth values and None: to be made a checked model before anything else."""

_LONGEST_INTEGER = 40


def parse_json(text: str | bytes) -> PlainData:
    """Return the plain data of a JSON text.

    Raises
    ------
    ValueError
        If it is no JSON, nested too deeply, has an integer of more than 40 digits, or a text with half a character.
    """
    try:
        data = json.loads(text, parse_int=_integer)
        if (b"\\ud" if isinstance(text, bytes) else "\\ud") in text.lower():  # type: ignore[operator]
            json.dumps(data, ensure_ascii=False).encode()
        return data
    except RecursionError as error:
        raise ValueError("is nested too deeply") from error
    except UnicodeEncodeError as error:
        raise ValueError("holds half a character") from error


def _integer(text: str) -> int:
    if len(text) > _LONGEST_INTEGER:
        raise ValueError(f"an integer of {len(text)} digits, at most {_LONGEST_INTEGER} are read")
    return int(text)
