"""How many processor cores this process may use, and where linear algebra uses one."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


def usable_cores() -> int:
    """Return the processor cores that this process may use; all of the machine where the system has no such limit."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _OneThread:
    """How many are in :func:`one_blas_thread`, and what the last one undoes."""

    def __init__(self) -> None:
        self._lock, self._inside = threading.Lock(), 0
        self._limit: ThreadpoolController | None = None

    def enter(self) -> None:
        with self._lock:
            if not self._inside:
                self._limit = _blas().limit(limits=1, user_api="blas")
            self._inside += 1

    def leave(self) -> None:
        with self._lock:
            self._inside -= 1
            if not self._inside and self._limit is not None:
                self._limit.restore_original_limits()


_one_thread = _OneThread()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Return a context manager in which BLAS runs on one thread in this process, until all that are in it have left.

    OpenBLAS sums up vectors of more than 10,000 numbers in as many parts as it has threads, so that norms, and all that
    is iterated until one is small, depend on their number, and each call of some microseconds wakes threads.
    """
    _one_thread.enter()
    try:
        yield
    finally:
        _one_thread.leave()


@lru_cache(maxsize=1)
def _blas() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 # has a BLAS of its own, which is loaded then
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
