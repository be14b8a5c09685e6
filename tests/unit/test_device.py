"""Arrays on the engine's device: a kernel is compiled once, wherever NumPy put its inputs, however many they are."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.engine.device import ALIGNMENT, device
from tests.kernels import kernels

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
    with device() as on, kernels() as found:
        for shift in (0, 16, 8):
            tripled = getattr(on, kind)(placed(KINDS[kind], shift)) * 3 + 1
            on.dr.eval(tripled)
            np.testing.assert_array_equal(tripled.numpy(), 3 * np.arange(COUNT) + 1)
            seen |= found()
    assert len(seen) == 1


def test_one_kernel_however_many_vectors_go_to_the_device_and_back() -> None:
    seen = set()
    with device() as on, kernels() as found:
        for count in (7, 8, 1000):
            rows = np.arange(3.0 * count).reshape(-1, 3)
            doubled = 2.0 * on.single_vectors(rows)
            on.dr.eval(doubled)
            np.testing.assert_array_equal(on.on_host(doubled), 2.0 * rows)
            np.testing.assert_array_equal(on.on_host(doubled.x), 2.0 * rows[:, 0])
            seen |= found()
    assert len(seen) == 1


def test_one_kernel_however_many_rays_are_cast() -> None:
    state = ss.load_scene("floor_wall").at(0.0)
    state.cast(np.zeros(3), np.eye(3))
    with kernels() as found:
        for count in (5, 6, 999):
            directions = np.random.default_rng(count).normal(size=(count, 3))
            state.cast(np.array([0.0, 0.0, 1.0]), directions / np.linalg.norm(directions, axis=1, keepdims=True))
        assert len(found()) == 1
