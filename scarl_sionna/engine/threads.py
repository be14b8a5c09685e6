"""How many threads the engine uses in this process, and where it uses none but the caller's.

A thread of the engine that has done its part of a kernel looks for more without a pause for 20 ms before it sleeps
(nanothread, Dr.Jit 1.5). Where small kernels and NumPy take turns it never sleeps, and costs as much processor time as
the work itself: 0.7 of 5.7 s of a frame of a street on two cores. So such stretches run in :func:`few_threads`, and the
large kernels among them in :func:`many_threads`. No result depends on it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from .backend.bootstrap import ensure_engine

LEAST = 2
"""With one thread, Mitsuba 3.9 waits for ever when it writes an EXR image: its tasks wait for a worker that is not
there."""
RAYS_PER_THREAD = 8192
"""Rays or tubes for which a further thread pays: some 10 ms of work, where it takes 0.1 ms to start and to stop one."""

_all: list[int] = []
"""The number of threads outside of the outermost :func:`few_threads`; empty outside of it."""


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


@contextmanager
def few_threads() -> Iterator[None]:
    """Return a context manager in which kernels run on the calling thread, but for those in :func:`many_threads`."""
    if _all:
        yield
        return
    ensure_engine()
    import drjit

    _all.append(drjit.thread_count())
    drjit.set_thread_count(1)
    try:
        yield
    finally:
        drjit.set_thread_count(_all.pop())


@contextmanager
def many_threads(work: int | None = None) -> Iterator[None]:
    """Return a context manager in which kernels run on as many threads as their work pays for.

    Parameters
    ----------
    work : int, optional
        Rays or tubes, see `RAYS_PER_THREAD`; all threads if left out, also for what needs `LEAST`.
    """
    wanted = _all[0] if _all and work is None else min(_all[0], 1 + work // RAYS_PER_THREAD) if _all and work else 1
    if wanted == 1:
        yield
        return
    import drjit

    before = drjit.thread_count()
    drjit.set_thread_count(max(wanted, before))
    try:
        yield
    finally:
        drjit.set_thread_count(before)
