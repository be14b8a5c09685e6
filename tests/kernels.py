"""Which kernels Dr.Jit runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def kernels() -> Iterator[Callable[..., set[str]]]:
    """Yield a function that returns the kernels of at least some number of operations since it was last called."""
    import drjit as dr

    def found(least: int = 0) -> set[str]:
        history = dr.kernel_history([dr.KernelType.JIT])
        return {entry["hash"] for entry in history if entry["operation_count"] >= least}

    before = dr.flag(dr.JitFlag.KernelHistory)
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    try:
        dr.kernel_history_clear()
        yield found
    finally:
        dr.set_flag(dr.JitFlag.KernelHistory, before)
