"""Results of benchmarks as files of lines of JSON, a row each; those whose name ends with .xz are compressed (LZMA).

python benchmarks/row_files.py docs/figures/data/whole_streets.jsonl.xz     print them as they are, as `xzcat` does
"""

from __future__ import annotations

import fcntl
import json
import lzma
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file.

    Raises
    ------
    FileNotFoundError
        If there is none: tables of a mistyped name would be empty, and replace those of a page.
    """
    return [json.loads(line) for line in _text(path).splitlines()]


def rows_so_far(path: Path) -> list[dict[str, Any]]:
    """Return the rows that a run is to add to, none where it begins the file."""
    return read_rows(path) if path.exists() else []


def append_rows(path: Path, *rows: dict[str, Any]) -> None:
    """Add rows at the end; several processes may. A compressed file is written anew: rows alone hardly shrink."""
    with _alone(path):
        if path.suffix == ".xz":
            _write(path, (_text(path) if path.exists() else "") + _lines(rows))
        else:
            with path.open("a", encoding="utf-8") as file:
                file.write(_lines(rows))


def put_row(path: Path, row: dict[str, Any], key: str) -> None:
    """Add a row, in place of one of the same value of a key, and sort by it; several processes may."""
    with _alone(path):
        others = [one for one in rows_so_far(path) if one[key] != row[key]]
        _write(path, _lines(sorted([*others, row], key=lambda one: one[key])))


def write_rows(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write rows in place of what is there."""
    text = _lines(rows)
    with _alone(path):
        _write(path, text)


@contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Wait until no other process writes in the folder of a file, and keep others waiting; nothing is left there."""
    descriptor = os.open(path.parent, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _lines(rows: Iterable[dict[str, Any]]) -> str:
    return "".join(json.dumps(row) + "\n" for row in rows)


def _text(path: Path) -> str:
    content = path.read_bytes()
    return (lzma.decompress(content) if path.suffix == ".xz" else content).decode()


def _write(path: Path, text: str) -> None:
    """Write through another file, so that a stopped run leaves what was there."""
    new = path.with_name(path.name + ".new")
    content = text.encode()
    new.write_bytes(lzma.compress(content, preset=9 | lzma.PRESET_EXTREME) if path.suffix == ".xz" else content)
    new.replace(path)


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        print(_text(Path(argument)), end="")
