"""The formulas of physical optics, written once for NumPy and for Dr.Jit: reflection, currents, phase over a triangle.

Time dependence e^{+jwt}. A formula takes the arithmetic `on` that it runs on: :data:`HOST` (NumPy, complex128; the far
field, whose permittivities may be any complex numbers) or :class:`OnDevice` (Dr.Jit; kernels of a scene). What differs
between the two is how a complex number is held, and nothing else:

============  =========================================  ==================================================
              HOST                                       OnDevice
============  =========================================  ==================================================
scalar        real (n,)                                  Dr.Jit float
vector        real (n, 3)                                Dr.Jit array of three
coefficient   complex (n,)                               real and imaginary part
amplitude     complex (n, p), of p polarisations         for each polarisation, real and imaginary part
field         complex (n, 3, p)                          for each polarisation, real and imaginary part, vectors
============  =========================================  ==================================================
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

HEAD_ON = 1e-9
"""Sine of incidence below which any tangent serves as the axis across the plane of incidence."""
SERIES_BELOW = 1.0
"""Largest difference of the corner phases [rad] for which the power series is used."""
SERIES_TERMS = 15
"""The first term left out is below 1 / 17! = 3e-15 of the sum."""
SMALL_SINC = 1e-4
"""Argument below which sin(x) / x is 1 - x^2 / 6: the next term is 1e-18."""

Scalar: TypeAlias = Any
"""Real numbers, one for each tube: what they are made of is up to the arithmetic, see the table above."""
Vector: TypeAlias = Any
"""Real vectors."""
Coefficient: TypeAlias = Any
"""Complex numbers, such as reflection coefficients."""
Amplitude: TypeAlias = Any
"""Complex numbers for each polarisation."""
Field: TypeAlias = Any
"""Complex vectors for each polarisation."""
Coefficients = Callable[[Scalar], tuple[Coefficient, Coefficient]]
"""From cosines of incidence to TE and TM coefficients."""


class Wave(NamedTuple):
    """A plane wave, or a spherical one at one point: electric field and unit direction of travel."""

    field: Field
    direction: Vector


class Arithmetic(Protocol):
    """What the formulas need; see the module's table for the kinds of numbers."""

    def minimum(self, a: Scalar, b: Scalar) -> Scalar:
        """Return the smaller of two scalars."""

    def maximum(self, a: Scalar, b: Scalar) -> Scalar:
        """Return the larger of two scalars."""

    def sincos(self, a: Scalar) -> tuple[Scalar, Scalar]:
        """Return sine and cosine of a scalar."""

    def either(
        self, condition: Scalar, first: Callable[..., Any], second: Callable[..., Any], *values: Scalar
    ) -> tuple[Scalar, ...]:
        """Return a tuple of scalars by one of two functions of scalars."""

    def dot(self, a: Scalar, b: Scalar) -> Scalar:
        """Return the scalar product of two vectors."""

    def scaled(self, scalar: Scalar, vector: Vector) -> Vector:
        """Return a scalar times a vector."""

    def across(self, direction: Vector, normal: Vector) -> Vector:
        """Return unit vectors across the plane of incidence; any tangent where the incidence is normal."""

    def cross(self, vector: Vector, other: Vector) -> Vector:
        """Return the cross product of a vector with a vector."""

    def cross_field(self, vector: Vector, field: Field) -> Field:
        """Return the cross product of a vector with a field."""

    def component(self, vector: Vector, field: Field) -> Amplitude:
        """Return the amplitude of a field along a vector."""

    def times(self, coefficient: Coefficient, amplitude: Amplitude) -> Amplitude:
        """Return a coefficient times an amplitude."""

    def along(self, vector: Vector, amplitude: Amplitude) -> Field:
        """Return the field of an amplitude along a vector."""

    def add(self, first: Field, second: Field) -> Field:
        """Return the sum of two fields."""


def reflected_field(
    on: Arithmetic, coefficients: Coefficients, field: Field, direction: Vector, normal: Vector
) -> tuple[Field, Vector]:
    """Return the reflected field and its direction.

    Parameters
    ----------
    on : Arithmetic
    coefficients : callable
        From the cosine of incidence to the TE and the TM coefficient.
    field : field
        Incident electric field.
    direction, normal : vector
        Direction of travel and unit normal on the lit side.
    """
    cosine = -on.dot(direction, normal)
    onward = direction + on.scaled(2.0 * cosine, normal)
    te, tm = coefficients(cosine)
    axis = on.across(direction, normal)
    te_amplitude = on.times(te, on.component(axis, field))
    tm_amplitude = on.times(tm, on.component(on.cross(direction, axis), field))
    return on.add(on.along(axis, te_amplitude), on.along(on.cross(onward, axis), tm_amplitude)), onward


def radiating_vector(on: Arithmetic, incident: Wave, reflected: Wave, normal: Vector, scattered: Vector) -> Field:
    r"""Return eta J - s x M of the physical-optics currents, whose part across s is radiated towards s.

    Parameters
    ----------
    on : Arithmetic
    incident, reflected : Wave
        On the surface.
    normal, scattered : vector
        Normal on the lit side, direction s to the observer.

    Notes
    -----
    .. math:: J = n \times (H_i + H_r), \quad M = -n \times (E_i + E_r), \quad \eta H = k \times E

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., section 6.8 (far field) and 7.10 (physical
           optics).
    """
    magnetic = on.add(
        on.cross_field(incident.direction, incident.field), on.cross_field(reflected.direction, reflected.field)
    )
    electric = on.add(incident.field, reflected.field)
    current = on.cross_field(normal, magnetic)
    return on.add(current, on.cross_field(scattered, on.cross_field(normal, electric)))


def second_difference(
    on: Arithmetic, a: Scalar, b: Scalar, c: Scalar, terms: int = SERIES_TERMS
) -> tuple[Scalar, Scalar]:
    r"""Return the divided difference exp[ja, jb, jc] of three phases that sum to zero, real and imaginary part.

    Notes
    -----
    Twice the area times it is the integral of the phase factor over a triangle (Hermite-Genocchi). It is formed over
    the two phases that differ most, so nothing cancels, and by the power series of complete symmetric polynomials where
    all nearly agree; e_1 = 0 since the phases sum to zero.

    References
    ----------
    .. [1] C. de Boor, "Divided Differences", Surveys in Approximation Theory 1, 2005, section 9.
    """
    low, high = on.minimum(on.minimum(a, b), c), on.maximum(on.maximum(a, b), c)

    def by_series(low: Scalar, high: Scalar) -> tuple[Scalar, Scalar]:
        middle = -(low + high)
        return _series(low * middle + middle * high + high * low, low * middle * high, terms)

    def by_differences(low: Scalar, high: Scalar) -> tuple[Scalar, Scalar]:
        middle, spread = -(low + high), high - low
        upper, lower = _first_difference(on, high, middle), _first_difference(on, middle, low)
        return (upper[1] - lower[1]) / spread, (lower[0] - upper[0]) / spread

    real, imaginary = on.either(high - low < SERIES_BELOW, by_series, by_differences, low, high)
    return real, imaginary


def _series(e2: Scalar, e3: Scalar, terms: int) -> tuple[Scalar, Scalar]:
    """Return the sum of j^n h_n / (n + 2)!; h_n are complete symmetric polynomials of phases that sum to zero."""
    h = [1.0 + 0.0 * e2, 0.0 * e2, -e2]
    for order in range(3, terms):
        h.append(-e2 * h[order - 2] + e3 * h[order - 3])
    real, imaginary, factor = 0.0 * e2, 0.0 * e2, 0.5
    for order, polynomial in enumerate(h):
        term = factor * (-1.0) ** (order // 2) * polynomial
        if order % 2:
            imaginary = imaginary + term
        else:
            real = real + term
        factor /= order + 3
    return real, imaginary


def _first_difference(on: Arithmetic, x: Scalar, y: Scalar) -> tuple[Scalar, Scalar]:
    """Return exp[j x, j y], which is exp(j (x + y) / 2) times sinc."""
    half = 0.5 * (x - y)

    def small(half: Scalar) -> tuple[Scalar]:
        return (1.0 - half * half / 6.0,)

    def large(half: Scalar) -> tuple[Scalar]:
        return (on.sincos(half)[0] / half,)

    sine, cosine = on.sincos(0.5 * (x + y))
    (sinc,) = on.either(half < SMALL_SINC, small, large, half)
    return cosine * sinc, sine * sinc


class _Host:
    """NumPy; see :class:`Arithmetic`."""

    minimum, maximum = staticmethod(np.minimum), staticmethod(np.maximum)

    def sincos(self, a: Scalar) -> tuple[Scalar, Scalar]:
        return np.sin(a), np.cos(a)

    def either(
        self, condition: Scalar, first: Callable[..., Any], second: Callable[..., Any], *values: Scalar
    ) -> tuple[Scalar, ...]:
        if condition.all():
            return first(*values)
        if not condition.any():
            return second(*values)
        parts = first(*(value[condition] for value in values)), second(*(value[~condition] for value in values))
        result = []
        for one, other in zip(*parts, strict=True):
            column = np.empty(condition.shape)
            column[condition], column[~condition] = one, other
            result.append(column)
        return tuple(result)

    def dot(self, a: Scalar, b: Scalar) -> Scalar:
        return np.einsum("ij,ij->i", a, b)

    def scaled(self, scalar: Scalar, vector: Vector) -> Vector:
        return scalar[:, None] * vector

    def across(self, direction: Vector, normal: Vector) -> Vector:
        axis = np.cross(direction, normal)
        length = np.sqrt(np.einsum("ij,ij->i", axis, axis))
        head_on = length < HEAD_ON
        if head_on.any():
            helper = np.eye(3)[np.abs(normal[head_on]).argmin(axis=1)]
            axis[head_on] = np.cross(helper, normal[head_on])
            length[head_on] = np.linalg.norm(axis[head_on], axis=1)
        return axis / length[:, None]

    def cross(self, vector: Vector, other: Vector) -> Vector:
        return np.cross(vector, other)

    def cross_field(self, vector: Vector, field: Field) -> Field:
        result = np.empty_like(field)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            np.multiply(vector[:, j, None], field[:, k], out=result[:, i])
            result[:, i] -= vector[:, k, None] * field[:, j]
        return result

    def component(self, vector: Vector, field: Field) -> Amplitude:
        return np.einsum("ij,ijp->ip", vector, field)

    def times(self, coefficient: Coefficient, amplitude: Amplitude) -> Amplitude:
        return coefficient[:, None] * amplitude

    def along(self, vector: Vector, amplitude: Amplitude) -> Field:
        return vector[:, :, None] * amplitude[:, None]

    def add(self, first: Field, second: Field) -> Field:
        return first + second


HOST = _Host()


class OnDevice:
    """Dr.Jit; see :class:`Arithmetic`."""

    def __init__(self, dr: ModuleType) -> None:
        self.dr = dr
        self.minimum, self.maximum, self.sincos = dr.minimum, dr.maximum, dr.sincos
        self.dot, self.cross = dr.dot, dr.cross

    def either(
        self, condition: Scalar, first: Callable[..., Any], second: Callable[..., Any], *values: Scalar
    ) -> tuple[Scalar, ...]:
        """Return a tuple of scalars by one of two functions of scalars; both are computed."""
        pairs = zip(first(*values), second(*values), strict=True)
        return tuple(self.dr.select(condition, one, other) for one, other in pairs)

    def scaled(self, scalar: Scalar, vector: Vector) -> Vector:
        """Return a scalar times a vector."""
        return scalar * vector

    def across(self, direction: Vector, normal: Vector) -> Vector:
        """Return unit vectors across the plane of incidence; any tangent where the incidence is normal."""
        dr = self.dr
        axis = dr.cross(direction, normal)
        sine = dr.norm(axis)
        helper = dr.cross(dr.select(dr.abs(normal.x) < 0.8, type(normal)(1, 0, 0), type(normal)(0, 1, 0)), normal)
        return dr.select(sine < HEAD_ON, dr.normalize(helper), axis / sine)

    def cross_field(self, vector: Vector, field: Field) -> Field:
        """Return the cross product of a vector with a field."""
        return [(self.dr.cross(vector, re), self.dr.cross(vector, im)) for re, im in field]

    def component(self, vector: Vector, field: Field) -> Amplitude:
        """Return the amplitude of a field along a vector."""
        return [(self.dr.dot(vector, re), self.dr.dot(vector, im)) for re, im in field]

    def times(self, coefficient: Coefficient, amplitude: Amplitude) -> Amplitude:
        """Return a coefficient times an amplitude."""
        c, s = coefficient
        return [(c * re - s * im, c * im + s * re) for re, im in amplitude]

    def along(self, vector: Vector, amplitude: Amplitude) -> Field:
        """Return the field of an amplitude along a vector."""
        return [(vector * re, vector * im) for re, im in amplitude]

    def add(self, first: Field, second: Field) -> Field:
        """Return the sum of two fields."""
        return [(a + c, b + d) for (a, b), (c, d) in zip(first, second, strict=True)]
