"""What all commands share: one message for a mistake, warnings in one line."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NoReturn

import typer

from scarl_sionna.core.errors import ScarlError, ScarlWarning
from scarl_sionna.scenario.spec.scenario import scenario_names
from scarl_sionna.scene.document.find import scene_names

EXIT_INCOMPLETE = EXIT_DAMAGED = 1
EXIT_ERROR = 2
EXIT_UNFINISHED = 3
EXIT_SIGNAL = 128


@contextmanager
def reported(context: typer.Context, interrupted: str) -> Iterator[None]:
    """Turn a user's error into a message and exit code 2, Ctrl-C into 130, SIGTERM of an export into 143."""
    try:
        yield
    except ScarlError as error:
        if context.obj and context.obj["debug"]:
            raise
        fail(f"error: {error}", EXIT_ERROR)
    except KeyboardInterrupt as error:
        fail(f"stopped, {interrupted}", EXIT_SIGNAL + getattr(error, "signal_number", signal.SIGINT))


@contextmanager
def collected_warnings() -> Iterator[None]:
    """Collect the project's warnings of a block, and print the first one and how many more there are."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScarlWarning)
        yield
    for item in caught:
        if not issubclass(item.category, ScarlWarning):
            warnings.warn_explicit(item.message, item.category, item.filename, item.lineno)
    messages = [str(item.message) for item in caught if issubclass(item.category, ScarlWarning)]
    if messages:
        more = f" (and {len(messages) - 1} more warnings)" if len(messages) > 1 else ""
        typer.echo(f"warning: {messages[0]}{more}", err=True)


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
