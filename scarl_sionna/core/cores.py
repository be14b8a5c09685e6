"""How many processor cores this process may use, and where linear algebra uses one."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


def usable_cores() -> int:
    """Return the processor cores that this process may use; all of the machine where the system has no such limit."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_blas_thread() -> AbstractContextManager[object]:
    """Return a context manager in which BLAS runs on one thread in this process.

    OpenBLAS sums up vectors of more than 10,000 numbers in as many parts as it has threads, so that norms, and all that
    is iterated until one is small, depend on their number, and each call of some microseconds wakes threads.
    """
    return _blas().limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _blas() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 # has a BLAS of its own, which is loaded then
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
