"""Integrals of the phase factor over triangles: plane wave, spherical waves, many plane waves in single precision.

All three form the divided difference of the exponential over the phases of the corners,
:func:`.fields.second_difference`.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.device import Device, device
from scarl_sionna.engine.types import DeviceArray

from .fields import HOST, OnDevice, second_difference

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Pair = tuple[DeviceArray, DeviceArray]

LANES = 1 << 22
"""Pairs of an aspect and a triangle worked at once: some 300 MB; changes no result."""
SINGLE_TERMS = 8
"""Terms of the series in single precision: the first one left out is 2e-8."""


def plane_wave_integral(corners: Array, wave_vector: Array) -> Complex:
    r"""Return the integral of exp(j q . r) over triangles, exact from a point to thousands of wavelengths.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_triangles, 3, 3)
        Corner points [m].
    wave_vector : ndarray of float64, shape (num_triangles, 3)
        q [rad/m].

    Returns
    -------
    ndarray of complex128, shape (num_triangles,)
        [m2].

    Notes
    -----
    With the corner phases :math:`a_i = q \cdot r_i` and the area A, the integral is the second divided difference of
    the exponential, :math:`2 A \exp[j a_0, j a_1, j a_2]` (Hermite-Genocchi).

    References
    ----------
    .. [1] C. de Boor, "Divided Differences", Surveys in Approximation Theory 1, 2005, section 9.
    """
    side_a, side_b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice_area = np.linalg.norm(np.cross(side_a, side_b), axis=1)
    phase = np.einsum("nij,nj->in", corners, wave_vector)
    mean = (phase[0] + phase[1] + phase[2]) / 3.0
    real, imaginary = second_difference(HOST, *(phase - mean))
    return np.asarray(twice_area * np.exp(1j * mean) * (real + 1j * imaginary))


def many_plane_wave_integrals(points: Array, twice_area: Array, wave_vectors: Array) -> npt.NDArray[np.complex64]:
    r"""Return the integral of exp(j q . r) over triangles for many q, in single precision on the engine.

    Parameters
    ----------
    points : ndarray of float64, shape (num_triangles, 3, 3)
        Corners from where their phase is zero [m]; single precision keeps 1e-4 rad up to 1000 rad.
    twice_area : ndarray of float64, shape (num_triangles,)
        [m2].
    wave_vectors : ndarray of float64, shape (num_aspects, 3)
        q [rad/m].

    Returns
    -------
    ndarray of complex64, shape (num_aspects, num_triangles)
        [m2]. The same sum as :func:`plane_wave_integral`.
    """
    count = len(points)
    result = np.zeros((len(wave_vectors), count), dtype=np.complex64)
    if not count:
        return result
    step = max(LANES // count, 1)
    for first in range(0, len(wave_vectors), step):
        some = wave_vectors[first : first + step]
        with device("radio") as on:
            result[first : first + len(some)] = _integrals(on, points, twice_area, some)
    return result


def _integrals(on: Device, points: Array, twice_area: Array, wave_vectors: Array) -> npt.NDArray[np.complex64]:
    dr, mi = on.dr, on.mi
    count, num_aspects = len(points), len(wave_vectors)
    lane = dr.arange(mi.UInt32, count * num_aspects)
    size = dr.opaque(mi.UInt32, count)
    aspect = lane // size
    triangle = lane - aspect * size
    corner = [[dr.gather(mi.Float, on.single(points[:, i, axis]), triangle) for axis in range(3)] for i in range(3)]
    q = [dr.gather(mi.Float, on.single(wave_vectors[:, axis]), aspect) for axis in range(3)]
    area = dr.gather(mi.Float, on.single(twice_area), triangle)
    phase = [sum((q[axis] * one[axis] for axis in range(3)), start=mi.Float(0.0)) for one in corner]
    mean = (phase[0] + phase[1] + phase[2]) / 3.0
    a, b, c = (one - mean for one in phase)
    re, im = second_difference(OnDevice(dr), a, b, c, SINGLE_TERMS)
    sine, cosine = dr.sincos(mean)
    real, imaginary = area * (re * cosine - im * sine), area * (re * sine + im * cosine)
    found = np.stack([real.numpy(), imaginary.numpy()], axis=-1)
    return found.reshape(num_aspects, count, 2).view(np.complex64)[..., 0]


def spherical_wave_integral(
    on: Device,
    corner: list[DeviceArray],
    stations: tuple[DeviceArray, DeviceArray],
    wavenumber: DeviceArray,
    largest: DeviceArray,
    wanted: DeviceArray = True,
) -> Pair:
    r"""Return the integrals over triangles of exp(-jk (length - length at the centre)) from sources to a receiver.

    Parameters
    ----------
    on : Device
    corner : list of Dr.Jit Array3f64
        The three corners [m].
    stations : tuple of two Dr.Jit Array3f64
        Source and receiver.
    wavenumber : float or Dr.Jit float64 number
        [rad/m].
    largest : float or Dr.Jit float64 number
        A triangle is cut into n^2 equal ones, so that the phase departs from a linear one by less than this at half of
        their sides [rad].
    wanted : Dr.Jit Bool
        Triangles of which the integral is needed; 0 of the others.

    Returns
    -------
    tuple
        Real and imaginary part [m2].

    Notes
    -----
    Over each part the linear phase is integrated exactly, and the quadratic one enters by its mean, a 12th of the sum
    over the corners.
    """
    dr, (source, receiver) = on.dr, stations
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    out, home = dr.norm(center - source), dr.norm(center - receiver)
    edge = [corner[(k + 1) % 3] - corner[k] for k in range(3)]
    longest = dr.maximum(dr.maximum(dr.squared_norm(edge[0]), dr.squared_norm(edge[1])), dr.squared_norm(edge[2]))
    cuts = dr.ceil(dr.sqrt(wavenumber * longest * (1.0 / out + 1.0 / home) / 8.0 / largest))
    cuts = dr.maximum(cuts, 1.0)
    twice_area = dr.norm(dr.cross(edge[0] / cuts, edge[1] / cuts))
    length = out + home

    def of_part(parts: list[DeviceArray]) -> Pair:
        return _linear_integral(dr, parts, source, receiver, wavenumber, length)

    re, im = over_parts(on, corner, dr.select(wanted, cuts, 0.0), of_part)
    return re * twice_area, im * twice_area


def over_parts(
    on: Device, corner: list[DeviceArray], cuts: DeviceArray, of_part: Callable[[list[DeviceArray]], Pair]
) -> Pair:
    """Return the sum of complex numbers over the cuts^2 equal parts of triangles.

    Parameters
    ----------
    on : Device
    corner : list of Dr.Jit Array3f64
        The three corners [m].
    cuts : Dr.Jit float64 array
        Whole numbers >= 1.
    of_part : callable
        From the corners of a part to real and imaginary part.
    """
    dr, mi, Real = on.dr, on.mi, on.Real
    step_a, step_b = (corner[1] - corner[0]) / cuts, (corner[2] - corner[1]) / cuts

    def step(
        index: DeviceArray, row: DeviceArray, column: DeviceArray, re: DeviceArray, im: DeviceArray
    ) -> tuple[DeviceArray, ...]:
        half = dr.floor(0.5 * column)
        down = column - 2.0 * half > 0.5  # every other part of a row stands on its head
        apex = corner[0] + row * step_a + half * step_b
        low = apex + step_a
        parts = [apex, low + dr.select(down, step_b, 0.0 * step_b), dr.select(down, apex, low) + step_b]
        part = of_part(parts)
        last = column > 2.0 * row - 0.5
        return (
            index + 1,
            dr.select(last, row + 1.0, row),
            dr.select(last, 0.0, column + 1.0),
            re + part[0],
            im + part[1],
        )

    zero = dr.zeros(Real, dr.width(cuts))
    number = mi.UInt32(cuts * cuts)
    state = (dr.zeros(mi.UInt32, dr.width(cuts)), zero, Real(zero), Real(zero), Real(zero))
    _, _, _, re, im = dr.while_loop(
        state, lambda index, row, column, re, im: index < number, step, label="parts of patches"
    )
    return re, im


def _linear_integral(
    dr: ModuleType,
    corner: list[DeviceArray],
    source: DeviceArray,
    receiver: DeviceArray,
    wavenumber: DeviceArray,
    length: DeviceArray,
) -> Pair:
    """Return the mean of the phase factor over triangles, times a half."""
    center = (corner[0] + corner[1] + corner[2]) / 3.0
    arriving, leaving = center - source, receiver - center
    out, home = dr.norm(arriving), dr.norm(leaving)
    arriving, leaving = arriving / out, leaving / home
    slope = wavenumber * (leaving - arriving)
    phases, spread = [], 0.0
    for point in corner:
        offset = point - center
        square = dr.squared_norm(offset)
        spread += (square - dr.dot(offset, arriving) ** 2) / out + (square - dr.dot(offset, leaving) ** 2) / home
        phases.append(dr.dot(offset, slope))
    phase = wavenumber * (out + home - length + spread / 24.0)
    sine, cosine = dr.sincos(phase)
    re, im = second_difference(OnDevice(dr), *phases)
    return re * cosine + im * sine, im * cosine - re * sine
