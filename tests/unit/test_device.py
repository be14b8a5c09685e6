"""Arrays on the engine's device: a kernel is compiled once, wherever NumPy put its inputs, however many they are."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.engine.device import ALIGNMENT, device
from scarl_sionna.engine.rays.face_rays import StateRays
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


@pytest.mark.parametrize("active", [True, False])
def test_no_ray_is_blocked_on_no_way_at_all(active: bool) -> None:
    """Of a ray with a distance below 0 the engine says that it is blocked, whatever is there and active or not."""
    state = ss.load_scene("floor_wall").at(0.0)
    with device() as on:
        rays = StateRays(on.mi, state)
        origin, down = (on.vectors(np.tile([0.0, 0.0, height], (4, 1))) for height in (1.0, -1.0))
        found = rays.blocked(origin, down, on.reals([-1.0, 0.0, 0.5, 2.0]), on.mask([active] * 4))
        assert found.numpy().tolist() == [False, False, False, active]


AT_THE_EDGE = """
import ctypes, mmap
import numpy as np
from scarl_sionna.engine.device import device

PAGE = mmap.PAGESIZE
libc = ctypes.CDLL(None)

def at_the_edge(values):
    memory = mmap.mmap(-1, 3 * PAGE)
    begin = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    assert libc.mprotect(ctypes.c_void_p(begin + 2 * PAGE), PAGE, 0) == 0
    last = np.frombuffer(memory, dtype=np.uint8)[2 * PAGE - values.nbytes : 2 * PAGE].view(values.dtype)
    last[:] = values
    return last

with device() as on:
    for count in (1, 7, 8, 100):
        numbers = np.arange(count)
        for kind, dtype in dict(reals="f8", single="f4", index="u4", label="i4").items():
            assert np.all((getattr(on, kind)(at_the_edge(numbers.astype(dtype))) + 1).numpy() == numbers + 1)
        assert np.all((~on.mask(at_the_edge(numbers % 3 == 0))).numpy() == (numbers % 3 != 0))
print("read")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a page that nobody may read")
def test_what_lies_behind_an_array_is_not_read() -> None:
    """Kernels read whole packets: of NumPy's own memory they read beyond its end, and now and then a process died."""
    done = subprocess.run([sys.executable, "-c", AT_THE_EDGE], capture_output=True, text=True, timeout=120, check=False)
    assert done.stdout == "read\n", (done.returncode, done.stderr)


def test_no_module_lets_kernels_read_memory_of_numpy() -> None:
    root = Path(ss.__file__).parents[1]
    straight = re.compile(
        r"\b(mi|on|rays|self)\.(Float|UInt32|Int32|Bool|Real|Fine|TensorXf|Vector3f|Point3f)"
        r"\((?![^()]*\bin_packets\b)[^()]*(\bnp\.|\.astype\(|\.ravel\()"
    )
    found = [
        f"{path.relative_to(root)}:{number}: {line.strip()}"
        for folder in ("scarl_sionna", "camera_lidar")
        for path in sorted((root / folder).rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if straight.search(line)
    ]
    assert not found, found
