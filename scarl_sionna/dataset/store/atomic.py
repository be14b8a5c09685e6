"""Files that are whole or not there."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PARTIAL = ".partial_"
"""Begins the name of what is being written; a killed run may leave it, and the next run removes it."""


def partial_path(path: Path) -> Path:
    """Return the temporary name of a file or folder, beside it."""
    return path.with_name(f"{PARTIAL}{path.name}_{os.getpid()}")


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path to write to; it gets its name when the block ends without an error."""
    partial = partial_path(path)
    try:
        yield partial
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
