"""Memory that a process holds though nothing uses it, and how it is given back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8
"""Parameters of glibc's mallopt, as in malloc.h."""


def resident_bytes() -> tuple[int, int]:
    """Return how much memory this process has now and had at most [bytes].

    Zeros where the system does not tell (not Linux).
    """
    try:
        with open("/proc/self/status", encoding="ascii", errors="replace") as file:
            lines = dict(line.split(":", 1) for line in file if line.startswith(("VmRSS", "VmHWM")))
    except OSError:
        return 0, 0
    now, most = (1024 * int(lines.get(name, "0").split()[0]) for name in ("VmRSS", "VmHWM"))
    return now, most


def forget_peak() -> None:
    """Let the peak of `resident_bytes` begin anew with what this process has now.

    Does nothing where that is not possible (not Linux).
    """
    try:
        with open("/proc/self/clear_refs", "w", encoding="ascii") as file:
            file.write("5")
    except OSError:
        pass


def keep_freed_memory() -> None:
    """Let the C library keep what is freed for the next arrays, as it does where nobody tells it otherwise.

    Dask starts its workers with ``MALLOC_TRIM_THRESHOLD_``, with which glibc no longer learns from sizes and maps every
    array over 128 kB anew: 40 times the page faults of a frame, and half as much CPU time again (docs/export.md). Set
    are the largest thresholds that glibc comes to by itself. Does nothing without glibc.
    """
    _set_allocator({_M_MMAP_THRESHOLD: 32 << 20, _M_TRIM_THRESHOLD: 64 << 20})


def share_heaps(count: int = 2) -> None:
    """Let new threads share some heaps of the C library instead of having one each, up to eight a core.

    What is freed at the end of a thread's heap, up to 64 MB, `release_memory` cannot give back: a process that starts
    many threads comes to hold 16 MB and more for each heap. Call it before threads are started, where memory counts
    more than threads that wait for each other when they allocate. Does nothing without glibc.
    """
    _set_allocator({_M_ARENA_MAX: count})


def _set_allocator(values: dict[int, int]) -> None:
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for name, value in values.items():
            mallopt(name, value)


def release_memory() -> None:
    """Give memory that nothing uses back to the system.

    Worlds hang in cycles until Python's collector runs, Dr.Jit keeps freed arrays for the next ones of their size, and
    the C library keeps freed pages. Call it between unrelated worlds in a process that loads many. It
    takes some 0.3 s, changes no result, and does nothing to what is still referred to.
    """
    gc.collect()
    drjit = sys.modules.get("drjit")
    if drjit is not None:
        drjit.sync_thread()
        drjit.flush_malloc_cache()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:  # glibc; musl has none
            trim(0)
