"""Dr.Jit arrays on the engine's device, for kernels that are written outside of this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from . import variant
from .types import DeviceArray

ALIGNMENT = 64
"""Of arrays that kernels read [bytes]."""
PACKET = 16
"""Numbers that a kernel reads at a time, at most: also the last of an array, and what is behind them in memory."""


class Device:
    """The modules and float64 array types of the variant that runs; make it inside ``variant.use(twin)``.

    Parameters
    ----------
    mi : module
        Mitsuba in the variant whose arrays are meant.

    Attributes
    ----------
    mi, dr : module
        Mitsuba and Dr.Jit.
    Real, Vector : type
        Dr.Jit arrays of float64 and of three of them.
    """

    def __init__(self, mi: ModuleType) -> None:
        import drjit as dr

        self.mi, self.dr = mi, dr
        self.Real, self.Vector = dr.float64_array_t(mi.Float), dr.float64_array_t(mi.Point3f)

    def real(self, value: float) -> DeviceArray:
        """Return a number that a kernel takes as an input, so that the kernel stays the same when it changes."""
        return self.dr.opaque(self.Real, float(value))

    def vector(self, values: npt.ArrayLike) -> DeviceArray:
        """Return a vector (3,) that a kernel takes as an input."""
        return self.Vector(*(self.real(value) for value in np.asarray(values, dtype=np.float64)))

    def reals(self, values: npt.ArrayLike) -> DeviceArray:
        """Return an array of any shape on the device, row after row."""
        return self.Real(in_packets(np.asarray(values, dtype=np.float64)))

    def single(self, values: npt.ArrayLike) -> DeviceArray:
        """Return an array of any shape on the device, row after row, rounded to float32."""
        return self.mi.Float(in_packets(np.asarray(values, dtype=np.float32)))

    def vectors(self, values: npt.ArrayLike) -> DeviceArray:
        """Return vectors (n, 3) on the device."""
        rows = np.asarray(values, dtype=np.float64)
        return self.dr.gather(self.Vector, self.reals(rows), self.dr.arange(self.mi.UInt32, len(rows)))

    def single_vectors(self, values: npt.ArrayLike) -> DeviceArray:
        """Return vectors (n, 3) on the device, rounded to float32.

        By a gather from a flat array: given NumPy's (3, n), Dr.Jit writes the number of rows into the kernel, so that
        each number makes a kernel of its own.
        """
        rows = np.asarray(values)
        return self.dr.gather(self.mi.Vector3f, self.single(rows), self.dr.arange(self.mi.UInt32, len(rows)))

    def on_host(self, values: DeviceArray) -> npt.NDArray[Any]:
        """Return numbers (n,) or vectors (n, 3) of the device as NumPy arrays.

        Component by component: for whole vectors Dr.Jit writes the number of rows into a kernel, too.
        """
        if self.dr.depth_v(values) == 1:
            return np.asarray(values.numpy())
        return np.stack([component.numpy() for component in values], axis=1)

    def corners(self, triangles: npt.ArrayLike) -> list[DeviceArray]:
        """Return the three corners of triangles (n, 3, 3) on the device."""
        rows = np.asarray(triangles, dtype=np.float64)
        flat, place = self.reals(rows), 3 * self.dr.arange(self.mi.UInt32, len(rows))
        return [self.dr.gather(self.Vector, flat, place + k) for k in range(3)]

    def index(self, values: npt.NDArray[np.integer]) -> DeviceArray:
        """Return numbers >= 0 of any shape on the device, row after row."""
        return self.mi.UInt32(in_packets(np.asarray(values, dtype=np.uint32)))

    def label(self, values: npt.NDArray[np.integer]) -> DeviceArray:
        """Return numbers of any shape and sign on the device, row after row."""
        return self.mi.Int32(in_packets(np.asarray(values, dtype=np.int32)))

    def own(self, values: DeviceArray) -> DeviceArray:
        """Return numbers in memory of Dr.Jit's own, not NumPy's, for what stays in a scene.

        What is recorded for later (:mod:`.light.recording`) follows a number to its new memory, but keeps the address
        of memory that Dr.Jit maps, and reads it when NumPy has given it to others.
        """
        copied = values * self.dr.opaque(type(values), 1)  # a plain copy is found to be the same and left out
        self.dr.eval(copied)
        return copied

    def mask(self, values: npt.NDArray[np.bool_]) -> DeviceArray:
        """Return truth values of any shape on the device, row after row."""
        return self.mi.Bool(in_packets(np.asarray(values, dtype=np.bool_)))


def in_packets(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return a flat copy that Dr.Jit may read in place: at a multiple of `ALIGNMENT`, with a whole packet behind it.

    Dr.Jit maps NumPy's memory, and a kernel for LLVM reads it in whole packets (`PACKET`): of an array that ends where
    memory ends it reads beyond, and the process dies. Such a kernel also states how each input is aligned: arrays
    wherever NumPy puts them make a new kernel for each combination, 0.2 to 0.8 s each.
    """
    memory = np.empty(values.nbytes + PACKET * values.itemsize + ALIGNMENT, dtype=np.uint8)
    start = -memory.ctypes.data % ALIGNMENT
    found = memory[start : start + values.nbytes].view(values.dtype)
    found[:] = values.ravel()
    return found


@contextmanager
def device(twin: str = "optical") -> Iterator[Device]:
    """Return a context manager that yields the :class:`Device` of a twin's variant."""
    with variant.use(twin) as mi:
        yield Device(mi)
