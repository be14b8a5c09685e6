"""Plane waves through plane layers, by formulas that are written once for NumPy and for the engine's arrays.

A formula takes the arithmetic `on` that it runs on: :data:`HOST` is NumPy.

Time dependence e^{+j 2 pi f t}: losses are a negative imaginary part of the permittivity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np

Number: TypeAlias = Any
"""Real or complex numbers, one for each ray: NumPy arrays, or arrays of the engine."""


class Arithmetic(Protocol):
    """What the formulas need beside sum, product and quotient."""

    def minimum(self, a: Number, b: Number) -> Number:
        """Return the smaller of two real numbers."""

    def where(self, condition: Number, first: Number, second: Number) -> Number:
        """Return one or the other of two real numbers."""

    def root(self, value: Number) -> Number:
        """Return the principal square root."""

    def delayed(self, phase: Number) -> Number:
        """Return exp(-j phase) of complex phases."""

    def interface(self, first: Number, second: Number) -> Number:
        """Return (a - b) / (a + b), 0 where both vanish (grazing)."""


def layers(
    on: Arithmetic, media: Sequence[Number], depths: Sequence[Number], cosine: Number
) -> tuple[tuple[Number, Number], tuple[Number, Number]]:
    """Return reflection and transmission coefficients, TE and TM each, as :func:`.fresnel.layer_coefficients` does.

    Parameters
    ----------
    on : Arithmetic
    media : sequence of complex arrays
        Relative permittivities of the layers from the face on, and of what is behind the last.
    depths : sequence of real arrays
        Of the layers, one fewer, times the wavenumber in vacuum [rad].
    cosine : real array
        Of the angle from the normal in air.
    """
    normal = [on.root(medium - (1.0 - cosine * cosine)) for medium in (media[0] * 0.0 + 1.0, *media)]
    reflected, passed = [], []
    for magnetic in (False, True):
        admittance = normal
        if magnetic:
            admittance = [normal[0], *(q / medium for q, medium in zip(normal[1:], media, strict=True))]
        total = on.interface(admittance[-2], admittance[-1])
        through = total + 1.0
        for index in range(len(depths), 0, -1):
            once = on.delayed(depths[index - 1] * normal[index])
            face = on.interface(admittance[index - 1], admittance[index])
            turned = total * once * once
            denominator = face * turned + 1.0
            through = (face + 1.0) * through * once / denominator
            total = (face + turned) / denominator
        reflected.append(total)
        passed.append(through)
    return (reflected[0], reflected[1]), (passed[0], passed[1])


class _Host:
    """NumPy's float64 and complex128; see :class:`Arithmetic`."""

    minimum, where = staticmethod(np.minimum), staticmethod(np.where)

    def root(self, value: Number) -> Number:
        return np.sqrt(value + 0j)

    def delayed(self, phase: Number) -> Number:
        return np.exp(-1j * phase)

    def interface(self, first: Number, second: Number) -> Number:
        total = first + second
        return np.asarray(np.divide(first - second, total, out=np.zeros_like(total), where=total != 0))


HOST = _Host()
