"""Whether Dr.Jit can use the CUDA device of this machine, found out before Dr.Jit is imported.

Dr.Jit 1.5 leaves its CUDA backend off without an exception, or fails at the first scene, where the driver or the device
is too old for it or OptiX is not there. The rules of :attr:`Cuda.refusal` are those that it states in its messages.

Environment: ``DRJIT_LIBCUDA_PATH`` and ``DRJIT_LIBOPTIX_PATH`` name the libraries, as for Dr.Jit.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

from .platforms import places
from .probing import run_probe

MIN_DRIVER = (12, 2)
"""Oldest CUDA version of a driver that Dr.Jit 1.5 takes (NVIDIA driver 535)."""
REFUSED_DRIVER = (12, 7)
"""CUDA version whose drivers (565 and up, below 570) Dr.Jit 1.5 refuses, since they compile OptiX programs wrongly."""
MIN_CAPABILITY = (7, 5)
"""Lowest compute capability that Dr.Jit 1.5 takes (Turing)."""

_LIBCUDA, _LIBOPTIX = "DRJIT_LIBCUDA_PATH", "DRJIT_LIBOPTIX_PATH"

_PROBE = """
import ctypes, sys
cuda, least = ctypes.CDLL(sys.argv[1]), tuple(map(int, sys.argv[3:5]))
try:
    ctypes.CDLL(sys.argv[2])
    optix = 1
except OSError:
    optix = 0
count, driver, value = ctypes.c_int(), ctypes.c_int(), ctypes.c_int()
assert cuda.cuInit(0) == 0 and cuda.cuDeviceGetCount(ctypes.byref(count)) == 0 and count.value > 0
assert cuda.cuDriverGetVersion(ctypes.byref(driver)) == 0
found = []
for index in range(count.value):
    device, name, numbers = ctypes.c_int(), ctypes.create_string_buffer(256), []
    assert cuda.cuDeviceGet(ctypes.byref(device), index) == 0 and cuda.cuDeviceGetName(name, 256, device) == 0
    for attribute in (75, 76):  # CU_DEVICE_ATTRIBUTE_COMPUTE_CAPABILITY_MAJOR and _MINOR
        assert cuda.cuDeviceGetAttribute(ctypes.byref(value), attribute, device) == 0
        numbers.append(value.value)
    found.append((tuple(numbers), name.value.decode()))
capability, name = next((one for one in found if one[0] >= least), found[0])  # Dr.Jit skips devices below
print("CUDA", driver.value // 1000, driver.value % 1000 // 10, *capability, optix, name)
"""


@dataclass(frozen=True)
class Cuda:
    """A CUDA device: the first that Dr.Jit would take, or the first of all.

    Attributes
    ----------
    name : str
    driver : tuple of int
        CUDA version of the driver, (major, minor).
    capability : tuple of int
        Compute capability, (major, minor).
    optix : bool
        True if the OptiX library of the driver can be loaded.
    """

    name: str
    driver: tuple[int, int]
    capability: tuple[int, int]
    optix: bool

    @property
    def refusal(self) -> str:
        """Why Dr.Jit cannot trace rays on it, with the remedy; empty if it can."""
        driver, capability = (".".join(map(str, pair)) for pair in (self.driver, self.capability))
        if self.driver < MIN_DRIVER:
            return f"its driver is for CUDA {driver} (allowed: >= 12.2); install NVIDIA's driver 535 or newer"
        if self.driver == REFUSED_DRIVER:
            return f"Dr.Jit refuses drivers of CUDA {driver}; install NVIDIA's driver 570 or newer"
        if self.capability < MIN_CAPABILITY:
            return f"its compute capability is {capability} (allowed: >= 7.5); use another device"
        if not self.optix:
            return (
                f"{_optix_name()} (OptiX, a part of NVIDIA's driver) cannot be loaded; in a container let "
                "NVIDIA_DRIVER_CAPABILITIES hold 'graphics', or name the library by DRJIT_LIBOPTIX_PATH"
            )
        return ""

    def __str__(self) -> str:
        driver, capability = (".".join(map(str, pair)) for pair in (self.driver, self.capability))
        return f"{self.name} (CUDA {driver}, compute capability {capability})"


def loadable(names: Iterable[str]) -> str:
    """Return the first of some libraries, names or paths, that the system's loader finds; empty if none."""
    for name in names:
        with suppress(OSError):
            ctypes.CDLL(name)
            return name
    return ""


def _cuda_name() -> str:
    return os.environ.get(_LIBCUDA) or loadable(places().cuda)


def _optix_name() -> str:
    names = places().optix
    return os.environ.get(_LIBOPTIX) or loadable(names) or "".join(names[:1])


@cache
def find_cuda() -> Cuda | None:
    """Return the CUDA device of this machine, usable or not, or None; it is looked for once."""
    name = _cuda_name()
    if not (name and loadable([name])):  # cheap look before a process is started
        return None
    words = run_probe(_PROBE, name, _optix_name(), *map(str, MIN_CAPABILITY))
    if len(words) < 6 or words[0] != "CUDA":
        return None
    numbers = [int(word) for word in words[1:6]]
    return Cuda(" ".join(words[6:]), (numbers[0], numbers[1]), (numbers[2], numbers[3]), bool(numbers[4]))


def cuda_device() -> str | None:
    """Return the name of the CUDA device on which Dr.Jit can trace rays, or None."""
    found = find_cuda()
    return None if found is None or found.refusal else found.name


def activate_cuda() -> None:
    """Tell Dr.Jit which library to load.

    It looks for ``libcuda.so``, which a driver without development files does not have, and for OptiX by name alone.
    """
    os.environ[_LIBCUDA] = _cuda_name()
    os.environ[_LIBOPTIX] = _optix_name()
