"""Warnings and messages of the work on shards, for the export's log."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from scarl_sionna.core.errors import ScarlWarning

LOG = logging.getLogger("scarl_sionna.batch")
"""What goes to it is in ``export.log``."""
LOG.addHandler(logging.NullHandler())  # without an export it is not for the terminal


@contextmanager
def noted_warnings(note: Callable[[str], object]) -> Iterator[None]:
    """Hand the text of each warning of this project that a block shows to a function; it is shown as without it."""
    shown = warnings.showwarning

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        if issubclass(category, ScarlWarning):
            note(str(message))
        shown(message, category, filename, lineno, file, line)

    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = shown


@contextmanager
def logged_warnings(where: str) -> Iterator[None]:
    """Write the warnings of a block to the export's log, after where they come from."""
    with noted_warnings(lambda text: LOG.warning("%s: warning: %s", where, text)):
        yield


class _Lines(logging.Handler):
    """Keeps messages as text."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(self.format(record))


@contextmanager
def log_lines() -> Iterator[list[str]]:
    """Yield a list that takes the messages of a block that are for the export's log, in a process that has none."""
    handler, passes = _Lines(), LOG.propagate
    LOG.addHandler(handler)
    LOG.propagate = False
    try:
        yield handler.lines
    finally:
        LOG.removeHandler(handler)
        LOG.propagate = passes
