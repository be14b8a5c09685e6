"""How many threads the engine uses in this process."""

from __future__ import annotations

from .backend.bootstrap import ensure_engine

LEAST = 2
"""With one thread, Mitsuba 3.9 waits for ever when it writes an EXR image: its tasks wait for a worker that is not
there."""


def limit_threads(count: int) -> None:
    """Let Dr.Jit use a number of threads, for processes that share one machine.

    Parameters
    ----------
    count : int
        At least `LEAST` are used.
    """
    ensure_engine()
    import drjit

    drjit.set_thread_count(max(count, LEAST))
