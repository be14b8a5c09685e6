"""Arrays on the engine's device: a kernel is compiled once, wherever NumPy put its inputs."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.engine.device import ALIGNMENT, device

COUNT = 1000
KINDS = {"reals": np.float64, "index": np.uint32, "label": np.int32}


def placed(dtype: type, shift: int) -> np.ndarray:
    """Return numbers that begin so many bytes behind a multiple of the alignment."""
    memory = np.zeros(COUNT * np.dtype(dtype).itemsize + 2 * ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT + shift
    values = memory[start : start + COUNT * np.dtype(dtype).itemsize].view(dtype)
    values[:] = np.arange(COUNT)
    return values


@pytest.mark.parametrize("kind", KINDS)
def test_one_kernel_wherever_the_inputs_lie(kind: str) -> None:
    seen = set()
    with device() as on:
        before = on.dr.flag(on.dr.JitFlag.KernelHistory)
        on.dr.set_flag(on.dr.JitFlag.KernelHistory, True)
        try:
            for shift in (0, 16, 8):
                on.dr.kernel_history_clear()
                found = getattr(on, kind)(placed(KINDS[kind], shift)) * 3 + 1
                on.dr.eval(found)
                np.testing.assert_array_equal(found.numpy(), 3 * np.arange(COUNT) + 1)
                seen |= {entry["hash"] for entry in on.dr.kernel_history([on.dr.KernelType.JIT])}
        finally:
            on.dr.set_flag(on.dr.JitFlag.KernelHistory, before)
    assert len(seen) == 1
