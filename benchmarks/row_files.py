"""Results of benchmarks as files of lines of JSON, a row each; those whose name ends with .xz are compressed (LZMA).

python benchmarks/row_files.py docs/figures/data/whole_streets.jsonl.xz     print them as they are, as `xzcat` does
"""

from __future__ import annotations

import json
import lzma
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a file, none where there is no file."""
    return [json.loads(line) for line in _text(path).splitlines()]


def append_rows(path: Path, *rows: dict[str, Any]) -> None:
    """Add rows at the end; one process at a time: a compressed file is written anew, since rows alone hardly shrink."""
    if path.suffix == ".xz":
        _write(path, _text(path) + _lines(rows))
    else:
        with path.open("a", encoding="utf-8") as file:
            file.write(_lines(rows))


def write_rows(path: Path, rows: Iterable[dict[str, Any]]) -> None:
    """Write rows in place of what is there."""
    _write(path, _lines(rows))


def _lines(rows: Iterable[dict[str, Any]]) -> str:
    return "".join(json.dumps(row) + "\n" for row in rows)


def _text(path: Path) -> str:
    if not path.exists():
        return ""
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
