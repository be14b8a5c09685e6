"""What all commands share: one message for a mistake, a line for each kind of warning."""

from __future__ import annotations

import re
import signal
import tempfile
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

from scarl_sionna.core.errors import ScarlError, ScarlWarning
from scarl_sionna.core.temporary import FULL, REFUSED
from scarl_sionna.scenario.spec.scenario import scenario_names
from scarl_sionna.scene.document.find import scene_names

EXIT_INCOMPLETE = EXIT_DAMAGED = 1
EXIT_ERROR = 2
EXIT_UNFINISHED = 3
EXIT_SIGNAL = 128
MOST_KINDS = 10
"""Kinds of warnings that a command prints."""


@contextmanager
def reported(context: typer.Context, interrupted: str) -> Iterator[None]:
    """Turn a user's error, and one of the disk, into a message and exit code 2, Ctrl-C into 130, SIGTERM into 143."""
    try:
        yield
    except ScarlError as error:
        if context.obj and context.obj["debug"]:
            raise
        fail(f"error: {error}", EXIT_ERROR)
    except OSError as error:
        message = _of_disk(error)
        if message is None or (context.obj and context.obj["debug"]):
            raise
        fail(f"error: {message}", EXIT_ERROR)
    except KeyboardInterrupt as error:
        fail(f"stopped, {interrupted}", EXIT_SIGNAL + getattr(error, "signal_number", signal.SIGINT))


def _of_disk(error: OSError) -> str | None:
    """Return what is to be said of a disk that is full or a place that may not be used; None for another error."""
    what = str(error.filename) if error.filename is not None else "a file"
    if error.errno in FULL:
        where = f"{what} or {tempfile.gettempdir()}" if error.filename is None else what
        return f"cannot write {where}: {error.strerror}; free some space, or choose another disk (--out, TMPDIR)"
    if error.errno in REFUSED:
        return f"cannot use {what}: {error.strerror}; choose another place, or change its permissions"
    return None


@contextmanager
def collected_warnings(context: typer.Context) -> Iterator[None]:
    """Collect the project's warnings of a block, and print each kind of them once at its end, however it ends.

    With ``--debug`` each text is a kind. Progress bars go inside of the block: what is printed would cut through them.
    """
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScarlWarning)
        try:
            yield
        finally:
            texts = [str(item.message) for item in caught if issubclass(item.category, ScarlWarning)]
            for line in warning_lines(texts, all_of_them=bool(context.obj and context.obj["debug"])):
                typer.echo(line, err=True)
    for item in caught:
        if not issubclass(item.category, ScarlWarning):
            warnings.warn_explicit(item.message, item.category, item.filename, item.lineno)


def warning_lines(texts: Iterable[str], all_of_them: bool = False) -> list[str]:
    """Return a line for each kind of some warnings, with how many there are.

    Texts that are the same up to numbers and names are of one kind, and the first of them is shown; of more than
    `MOST_KINDS` kinds the rest is counted. With `all_of_them` every text is shown, once.
    """
    kinds: dict[str, list[str]] = {}
    for text in texts:
        kinds.setdefault(text if all_of_them else _kind(text), []).append(text)
    lines = []
    for alike in kinds.values():
        others = sum(text != alike[0] for text in alike)
        more = f" ({len(alike)} times)" if len(alike) > 1 else ""
        if others:
            more = f" (and {len(alike) - 1} more of this kind; --debug shows all)"
        lines.append(f"warning: {alike[0]}{more}")
    if all_of_them or len(lines) <= MOST_KINDS:
        return lines
    rest = [len(alike) for alike in list(kinds.values())[MOST_KINDS:]]
    return [
        *lines[:MOST_KINDS],
        f"warning: {sum(rest)} more warnings of {len(rest)} other kinds; --debug shows all",
    ]


def _kind(text: str) -> str:
    """Return a text without its numbers and names: what is in quotes, and words with digits, slashes and underscores.

    Lists of names of different lengths are the same.
    """
    bare = re.sub(r"\S*[\d/_]\S*", "#", re.sub(r"'[^']*'", "#", text))
    return re.sub(r"#(?:(?:,| and|, and)? #)+", "#", bare)


def completing(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Return what completes a value in the shell: those of some names that begin as what was typed."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return complete


def ready_names() -> tuple[str, ...]:
    """Return the names of ready scenarios and of scenes."""
    return (*scenario_names(), *scene_names())


def fail(message: str, code: int) -> NoReturn:
    """Print a message and end the command."""
    typer.echo(message, err=True)
    raise typer.Exit(code)
