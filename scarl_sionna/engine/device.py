"""Dr.Jit arrays on the engine's device, for kernels that are written outside of this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import numpy.typing as npt

from . import variant


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

    def __init__(self, mi: Any) -> None:
        import drjit as dr

        self.mi, self.dr = mi, dr
        self.Real, self.Vector = dr.float64_array_t(mi.Float), dr.float64_array_t(mi.Point3f)

    def real(self, value: float) -> Any:
        """Return a number that a kernel takes as an input, so that the kernel stays the same when it changes."""
        return self.dr.opaque(self.Real, float(value))

    def vector(self, values: npt.ArrayLike) -> Any:
        """Return a vector (3,) that a kernel takes as an input."""
        return self.Vector(*(self.real(value) for value in np.asarray(values, dtype=np.float64)))


@contextmanager
def device(twin: str = "optical") -> Iterator[Device]:
    """Return a context manager that yields the :class:`Device` of a twin's variant."""
    with variant.use(twin) as mi:
        yield Device(mi)
