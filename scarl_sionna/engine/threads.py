"""How many threads the engine uses in this process, and where it uses none but the caller's.

A thread of the engine that has done its part of a kernel looks for more without a pause for 20 ms before it sleeps
(nanothread, Dr.Jit 1.5). Where small kernels and NumPy take turns it never sleeps, and costs as much processor time as
the work itself: 0.7 of 5.7 s of a frame of a street on two cores. So such stretches run in :func:`few_threads`, and the
large kernels among them in :func:`many_threads`. No result depends on it.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from .backend.bootstrap import ensure_engine

LEAST = 2
"""With one thread, Mitsuba 3.9 waits for ever when it writes an EXR image: its tasks wait for a worker that is not
there."""
RAYS_PER_THREAD = 8192
"""Rays or tubes for which a further thread pays: some 10 ms of work, where it takes 0.1 ms to start and to stop one."""

_all = LEAST
"""The number of threads outside of :func:`few_threads`, while somebody is in it."""
_inside: set[int] = set()
"""Python's threads that are in :func:`few_threads`."""
_lock = threading.Lock()


def limit_threads(count: int) -> None:
    """Let Dr.Jit use a number of threads, for processes that share one machine.

    Parameters
    ----------
    count : int
        At least `LEAST` are used.
    """
    ensure_engine()
    with _lock:
        _change(max(count, LEAST))


def _change(count: int) -> None:
    """Change the number of threads when nothing runs and nothing that is planned counts on the number.

    Sums from many places into few (``scatter_add``, ``scatter_reduce``) have a copy of the few for each thread there is
    when they are planned: one more that joins while they wait, or while their kernel runs, writes beyond the copies.
    """
    import drjit

    if drjit.thread_count() != count:
        drjit.eval()
        drjit.sync_thread()
        drjit.set_thread_count(count)


@contextmanager
def few_threads() -> Iterator[None]:
    """Return a context manager in which kernels run on the calling thread, but for those in :func:`many_threads`.

    While several of Python's threads are in it, none changes anything: the kernels of another may run.
    """
    global _all
    me = threading.get_ident()
    if me in _inside:
        yield
        return
    ensure_engine()
    import drjit

    with _lock:
        _inside.add(me)
        if _inside == {me}:
            _all = drjit.thread_count()
            _change(1)
    try:
        yield
    finally:
        with _lock:
            _inside.discard(me)
            if not _inside:
                _change(_all)


@contextmanager
def many_threads(work: int | None = None) -> Iterator[None]:
    """Return a context manager in which kernels run on as many threads as their work pays for.

    Parameters
    ----------
    work : int, optional
        Rays or tubes, see `RAYS_PER_THREAD`; all threads if left out, also for what needs `LEAST`.
    """
    me = threading.get_ident()
    before = 0
    if me in _inside:
        import drjit

        wanted = _all if work is None else min(_all, 1 + work // RAYS_PER_THREAD)
        with _lock:
            if _inside == {me} and wanted > drjit.thread_count():
                before = drjit.thread_count()
                _change(wanted)
    try:
        yield
    finally:
        if before:
            with _lock:
                if _inside == {me}:
                    _change(before)
