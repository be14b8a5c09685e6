"""Processes that tests start: they end with the process that started them, however that one ends."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

_PR_SET_PDEATHSIG = 1


def with_parent() -> dict[str, Any]:
    """Return arguments for `subprocess` that let a process be killed when this one is gone (Linux only).

    A test run that is killed from outside would leave its exports at work otherwise.
    """
    return {"preexec_fn": _end_with(os.getpid())} if sys.platform == "linux" else {}


def _end_with(parent: int) -> Callable[[], None]:
    library = ctypes.CDLL(None)  # before the fork: what runs after it should do little

    def ask() -> None:
        library.prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))
        if os.getppid() != parent:  # it was gone before
            os._exit(1)

    return ask
