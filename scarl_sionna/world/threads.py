"""How many threads the engine uses in this process."""

from __future__ import annotations

from .engine import ensure_engine


def limit_threads(count: int) -> None:
    """Let Dr.Jit use a number of threads, for processes that share one machine.

    Parameters
    ----------
    count : int
        At least one is used.
    """
    ensure_engine()
    import drjit

    drjit.set_thread_count(max(count, 1))
