"""JSON as plain data: numbers of a bounded length, a bounded depth."""

from __future__ import annotations

import codecs
import json
from collections.abc import Iterator
from typing import Any, BinaryIO

PlainData = Any
"""Mappings, lists, texts, numbers, truth values and None: to be made a checked model before anything else."""

_LONGEST_INTEGER = 40
_CHUNK = 2**20


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


def iterate_json_array(file: BinaryIO, largest: int = 2**20) -> Iterator[PlainData]:
    """Yield the items of a JSON array one by one, so that a file need not fit into memory.

    Parameters
    ----------
    file : binary file
        In UTF-8.
    largest : int
        Characters of one item; a larger one is refused.

    Raises
    ------
    ValueError
        If it is no JSON array; items before the fault are yielded.
    """
    reader, decoder = codecs.getincrementaldecoder("utf-8")(), json.JSONDecoder(parse_int=_integer)
    text, at, is_whole = "", 0, False

    def is_short() -> bool:
        """Read on; whether there was more."""
        nonlocal text, at, is_whole
        if is_whole:
            return False
        raw = file.read(_CHUNK)
        is_whole = not raw
        text, at = text[at:] + reader.decode(raw, final=is_whole), 0
        return True

    def token() -> str:
        """Return the next character that is no space, empty at the end."""
        nonlocal at
        while True:
            at = _space(text, at)
            if at < len(text) or not is_short():
                return text[at : at + 1]

    if token() != "[":
        raise ValueError("is no JSON array")
    at += 1
    is_first = True
    while (mark := token()) != "]":
        if not is_first:
            if mark != ",":
                raise ValueError("ends within the array" if not mark else f"'{mark}' stands where a comma should")
            at += 1
            token()
        while True:
            try:
                item, stop = decoder.raw_decode(text, at)
                if stop < len(text) or is_whole:
                    break
            except json.JSONDecodeError as error:
                if is_whole or len(text) - at > largest:
                    raise ValueError(f"item {text[at : at + 40]!r} is no JSON ({error.msg})") from error
            except RecursionError as error:
                raise ValueError("is nested too deeply") from error
            is_short()
        if "\\ud" in text[at:stop].lower():
            try:
                json.dumps(item, ensure_ascii=False).encode()
            except UnicodeEncodeError as error:
                raise ValueError("holds half a character") from error
        at, is_first = stop, False
        yield item


def _space(text: str, at: int) -> int:
    while at < len(text) and text[at] in " \t\r\n":
        at += 1
    return at
