"""A CUDA device is taken only where Dr.Jit can use it.

The driver and its libraries are played by small ones compiled here.
"""

from __future__ import annotations

import os
import subprocess
import sys
from ctypes.util import find_library
from pathlib import Path

import pytest

from scarl_sionna.core.errors import EngineError
from scarl_sionna.engine.backend import bootstrap, cuda, doctor

LIBRARIES = ("DRJIT_LIBCUDA_PATH", "DRJIT_LIBOPTIX_PATH")

DRIVER = """
#include <string.h>
static const int major[] = {%(major)s}, minor[] = {%(minor)s};
int cuInit(unsigned flags) { return 0; }
int cuDeviceGetCount(int *count) { *count = sizeof(major) / sizeof(int); return 0; }
int cuDeviceGet(int *device, int index) { *device = index; return 0; }
int cuDeviceGetName(char *name, int length, int device) {
    strcpy(name, device ? "Second Card" : "First Card");
    return 0;
}
int cuDriverGetVersion(int *version) { *version = %(driver)d; return 0; }
int cuDeviceGetAttribute(int *value, int key, int device) {
    *value = key == 75 ? major[device] : minor[device];
    return 0;
}
"""
"""All that the probe asks for and a small part of what Dr.Jit does, so that Dr.Jit leaves its CUDA backend off."""


def build(folder: Path, name: str, source: str) -> str:
    (folder / "fake.c").write_text(source)
    try:
        subprocess.run(
            ["cc", "-shared", "-fPIC", "-o", folder / name, folder / "fake.c"], check=True, capture_output=True
        )
    except FileNotFoundError:
        pytest.skip("needs a C compiler to build a driver")
    return str(folder / name)


def install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, driver: int, capabilities: list[tuple[int, int]], optix: bool = True
) -> None:
    """Let the machine have a driver of a CUDA version (1000 times major plus 10 times minor) with some devices."""
    major, minor = (", ".join(str(one[k]) for one in capabilities) for k in range(2))
    source = DRIVER % {"major": major, "minor": minor, "driver": driver}
    monkeypatch.setenv(LIBRARIES[0], build(folder, "libcuda.so.1", source))
    monkeypatch.setenv(
        LIBRARIES[1], build(folder, "libnvoptix.so.1", "int x;") if optix else str(folder / "libnvoptix.so.1")
    )
    cuda.find_cuda.cache_clear()


@pytest.fixture(autouse=True)
def forget_afterwards() -> object:
    yield
    cuda.find_cuda.cache_clear()


@pytest.mark.parametrize(
    ("driver", "capability", "optix", "reason"),
    [
        (12020, (7, 5), True, ""),
        (13000, (9, 0), True, ""),
        (12010, (8, 9), True, "for CUDA 12.1 (allowed: >= 12.2)"),
        (11080, (8, 6), True, "driver 535 or newer"),
        (12070, (8, 9), True, "refuses drivers of CUDA 12.7"),
        (12080, (7, 0), True, "compute capability is 7.0 (allowed: >= 7.5)"),
        (12080, (8, 9), False, "libnvoptix.so.1"),
    ],
)
def test_what_dr_jit_refuses(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    driver: int,
    capability: tuple[int, int],
    optix: bool,
    reason: str,
) -> None:
    install(tmp_path, monkeypatch, driver, [capability], optix)
    found = cuda.find_cuda()
    assert found == cuda.Cuda("First Card", (driver // 1000, driver % 1000 // 10), capability, optix)
    assert reason in found.refusal and bool(found.refusal) == bool(reason)
    assert cuda.cuda_device() == (None if reason else "First Card")
    row = doctor._engine_findings()[1]
    assert row.status == ("warn" if reason else "ok") and "First Card" in row.found and reason in row.remedy


def test_an_old_device_beside_a_new_one_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, 12080, [(6, 1), (8, 9)])
    assert cuda.cuda_device() == "Second Card"


def test_no_driver_or_none_that_answers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIBRARIES[0], str(tmp_path / "libcuda.so.1"))
    cuda.find_cuda.cache_clear()
    assert cuda.find_cuda() is None
    build(tmp_path, "libcuda.so.1", "int cuInit(unsigned flags) { return 100; }")  # CUDA_ERROR_NO_DEVICE
    cuda.find_cuda.cache_clear()
    assert cuda.find_cuda() is None and cuda.cuda_device() is None


def test_a_device_that_is_asked_for_and_refused_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, 11040, [(8, 6)])
    monkeypatch.setenv("SCARL_BACKEND", "cuda")
    with pytest.raises(
        EngineError, match=r"First Card .* cannot be used: its driver is for CUDA 11\.4.*SCARL_BACKEND=llvm"
    ):
        bootstrap.ensure_engine.__wrapped__()


ENSURE = """
import os
from scarl_sionna.engine.backend.bootstrap import ensure_engine
print("backend", ensure_engine(), "library", os.environ.get("DRJIT_LIBCUDA_PATH"))
"""


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name != "SCARL_BACKEND"}
    return subprocess.run(
        [sys.executable, "-c", code], env=kept | environment, capture_output=True, text=True, check=False
    )


def test_llvm_where_dr_jit_does_not_start_on_a_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The driver has what the probe asks for but not all that Dr.Jit loads."""
    install(tmp_path, monkeypatch, 12080, [(8, 9)])
    done = run(ENSURE)
    assert done.returncode == 0 and done.stdout.startswith("backend llvm"), done.stderr
    assert "ScarlWarning: Dr.Jit does not start on First Card (CUDA 12.8, compute capability 8.9)" in done.stderr
    done = run(ENSURE, SCARL_BACKEND="cuda")
    assert done.returncode == 1 and "Dr.Jit has no cuda backend in this process" in done.stderr


@pytest.mark.slow
def test_a_device_that_is_refused_is_passed_over_in_silence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, 11040, [(8, 6)])
    done = run(ENSURE)
    assert done.returncode == 0 and done.stdout.startswith("backend llvm") and "Warning" not in done.stderr, done.stderr


@pytest.mark.slow
def test_dr_jit_gets_the_library_that_was_probed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Alone it asks for ``libcuda.so``, which only development files bring, and looks into some system folders."""
    install(tmp_path, monkeypatch, 12080, [(8, 9)])
    monkeypatch.delenv(LIBRARIES[0])
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    done = run(ENSURE)
    assert done.stdout.split() == ["backend", "llvm", "library", "libcuda.so.1"], done.stderr
    alone = "import drjit as dr; dr.has_backend(dr.JitBackend.CUDA)"
    assert "could not find symbol" in run(alone, DRJIT_LIBCUDA_PATH="libcuda.so.1").stderr  # of this small library
    if find_library("cuda") is None:
        assert "could not find symbol" not in run(alone).stderr  # it was not looked at
