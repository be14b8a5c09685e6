"""Antennas of a radar: gains towards directions, and the virtual elements."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.antennas.element import COMPONENTS, CROSSED, AntennaElement
from scarl_sionna.core.specs.radar.antennas.grid import GridPattern
from scarl_sionna.core.specs.radar.array import AntennaArray
from scarl_sionna.core.specs.radar.pattern import AntennaPattern, IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

CROSSED_SHARE = 1e-3
"""Pairs of antennas that hear less than this part of what a sphere sends back are taken as crossed."""


def azimuth_elevation(vectors: npt.ArrayLike) -> tuple[Array, Array]:
    """Return azimuth (left positive) and elevation [rad] of vectors (..., 3) in the radar frame.

    Exact geometry.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def field_gain(pattern: AntennaPattern, vectors: npt.ArrayLike) -> Array:
    """Return the square root of the power gain towards vectors (..., 3) in the radar frame.

    By definition of the pattern, dimensionless.
    """
    azimuth, elevation = azimuth_elevation(vectors)
    return 10.0 ** (pattern.gain_db(azimuth, elevation) / 20.0)


def field_gain_slope(pattern: AntennaPattern, vectors: npt.ArrayLike) -> Array:
    """Return the derivative of the logarithm of :func:`field_gain` to the vectors (..., 3) [1/m].

    By definition of the pattern.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    over_azimuth, over_elevation = pattern.slopes_db(*azimuth_elevation(vectors))
    flat = np.maximum(np.hypot(x, y), 1e-12)  # straight up the azimuth has no derivative
    squared = np.maximum(x**2 + y**2 + z**2, 1e-24)
    azimuth = np.stack([-y, x, np.zeros_like(x)], axis=-1) / flat[..., None] ** 2
    elevation = np.stack([-x * z / flat, -y * z / flat, flat], axis=-1) / squared[..., None]
    slope = over_azimuth[..., None] * azimuth + over_elevation[..., None] * elevation
    return np.asarray(np.log(10.0) / 20.0 * slope)


def spherical_basis(vectors: npt.ArrayLike) -> Array:
    """Return theta-hat and phi-hat at vectors (..., 3), shape (..., 2, 3); phi-hat is y along the z axis.

    By definition of spherical coordinates about z.
    """
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    flat = np.hypot(x, y)
    up = flat <= 1e-15 * np.abs(z)
    flat_or_one = np.where(up, 1.0, flat)
    ca, sa = np.where(up, 1.0, x / flat_or_one), np.where(up, 0.0, y / flat_or_one)
    length = np.hypot(flat, z)
    theta = np.stack([ca * z / length, sa * z / length, -flat / length], axis=-1)
    return np.stack([theta, np.stack([-sa, ca, np.zeros_like(ca)], axis=-1)], axis=-2)


def ludwig_basis(vectors: npt.ArrayLike) -> Array:
    """Return the directions of V and H of Ludwig's third definition at vectors (..., 3), shape (..., 2, 3).

    Those at boresight (-z and y), turned with x along the shortest way; straight behind, where it is not defined, back
    over the top.

    References
    ----------
    .. [1] A. C. Ludwig, "The definition of cross polarization", IEEE Trans. Antennas Propag. 21(1), 1973.
    """
    given = np.asarray(vectors, dtype=np.float64)
    unit = given / np.linalg.norm(given, axis=-1, keepdims=True)
    start = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    ahead = np.array([1.0, 0.0, 0.0])
    opened = 1.0 + unit[..., 0]
    behind = opened < 1e-12
    along = (unit @ start.T)[..., None] / np.where(behind, 1.0, opened)[..., None, None]
    turned = start - along * (ahead + unit)[..., None, :]
    over = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    return np.asarray(np.where(behind[..., None, None], over, turned))


def element_field(element: AntennaElement, vectors: npt.ArrayLike) -> Complex:
    r"""Return the far field that an antenna sends towards vectors in the radar frame, and hears with.

    Parameters
    ----------
    element : AntennaElement
        With its pattern and polarisation.
    vectors : array_like of float, shape (..., 3)
        Of any length.

    Returns
    -------
    ndarray of complex128, shape (..., 2)
        Parts along theta-hat and phi-hat of the radar frame; the sum of their squared magnitudes is the power gain.

    Notes
    -----
    .. math:: e = \sqrt{G_c} e^{j \psi_c} \hat c + \sqrt{G_x} e^{j \psi_x} \hat x

    with the antenna's co- and cross-polar directions. The voltage that a field E brings is e . E (reciprocity).

    References
    ----------
    .. [1] C. A. Balanis, *Antenna Theory*, 4th ed., 2016, sections 2.12 and 2.15.
    """
    given = np.asarray(vectors, dtype=np.float64)
    turn = element.radar_from_antenna
    own = given @ turn
    basis = spherical_basis(own) if element.basis == "spherical" else ludwig_basis(own)
    polarization = element.polarization or "V"
    parts = _amplitude(element.pattern or IsotropicPattern(), own)[..., None] * np.array(COMPONENTS[polarization])
    crossed = np.exp(1j * np.radians(element.cross_polar_phase_deg)) * np.array(COMPONENTS[CROSSED[polarization]])
    if element.cross_polar_pattern is not None:
        parts = parts + _amplitude(element.cross_polar_pattern, own)[..., None] * crossed
    elif element.cross_polar_db is not None:
        level = 10.0 ** (element.cross_polar_db / 20.0) * _amplitude(element.pattern or IsotropicPattern(), own)
        parts = parts + level[..., None] * crossed
    field = np.einsum("...k,...ki->...i", parts, basis) @ turn.T
    return np.asarray(np.einsum("...ki,...i->...k", spherical_basis(given), field))


def _amplitude(pattern: AntennaPattern, vectors: Array) -> Complex:
    """Return the root of the gain, with the phase where one was measured."""
    azimuth, elevation = azimuth_elevation(vectors)
    amplitude = 10.0 ** (pattern.gain_db(azimuth, elevation) / 20.0) + 0j
    if isinstance(pattern, GridPattern) and pattern.has_phase:
        amplitude = amplitude * np.exp(1j * pattern.phase(azimuth, elevation))
    return np.asarray(amplitude)


def antenna_fields(elements: tuple[AntennaElement, ...], vectors: npt.ArrayLike) -> list[Complex]:
    """Return :func:`element_field` of antennas, each of shape (..., 2); equal antennas share one array.

    By definition.
    """
    known: dict[AntennaElement, Complex] = {}
    for one in elements:
        if one not in known:
            known[one] = element_field(one, vectors)
    return [known[one] for one in elements]


def pair_factors(array: AntennaArray, vectors: npt.ArrayLike) -> Complex:
    """Return the gain of every channel ``i * num_rx + j`` for an isotropic point, in amplitude: (..., num_virtual).

    By definition the product of both antennas' fields, for the scattering matrix of a sphere. Where every channel is
    crossed (a sphere brings it less than `CROSSED_SHARE`), the product of their magnitudes: the gain for what is
    cross-polarised.
    """
    tx, rx = antenna_fields(array.tx, vectors), antenna_fields(array.rx, vectors)
    factor = np.stack([np.einsum("...k,...k->...", sent, heard) for sent in tx for heard in rx], axis=-1)
    size = np.stack([_size(sent) * _size(heard) for sent in tx for heard in rx], axis=-1)
    crossed = (np.abs(factor) ** 2 <= CROSSED_SHARE * size**2).all(axis=-1)
    return np.where(crossed[..., None], size, factor)


class PairPolarization(NamedTuple):
    """How some pairs of an array are polarised, see :func:`pair_polarizations`."""

    share: float
    """Of all pairs."""
    sent: Complex
    """V and H part of the field that the transmitters send, unit vector of shape (2,)."""
    heard: Complex
    """The same of the receivers."""


def pair_polarizations(array: AntennaArray) -> list[PairPolarization]:
    """Return the different polarisations of an array's pairs, each antenna's ahead of it.

    By definition.
    """
    ends = []
    for elements in (array.tx, array.rx):
        alike = [one.with_(pattern=IsotropicPattern(), cross_polar_pattern=None) for one in elements]
        ahead = [element_field(one, one.radar_from_antenna[:, 0]) for one in alike]
        ends.append(Counter(tuple(np.round(one / _size(one), 12).tolist()) for one in ahead))
    pairs = array.num_tx * array.num_rx
    return [
        PairPolarization(count * other / pairs, np.array(sent), np.array(heard))
        for sent, count in ends[0].items()
        for heard, other in ends[1].items()
    ]


def is_crossed(array: AntennaArray) -> bool:
    """Return whether no pair of an array hears what a sphere sends back, such as V that sends and H that hears.

    By definition, with `CROSSED_SHARE`.
    """
    return all(abs(np.dot(sent, heard)) ** 2 < CROSSED_SHARE for _, sent, heard in pair_polarizations(array))


def _size(field: Complex) -> Array:
    return np.linalg.norm(field, axis=-1)


def two_way_gain(array: AntennaArray, vectors: npt.ArrayLike) -> Array:
    """Return the two-way power gain towards vectors (..., 3), the mean of all channels.

    By definition of the patterns. Where antennas are described one by one, for an isotropic point; for what is
    cross-polarised where they are crossed, as in :func:`pair_factors`.
    """
    if array.is_uniform:
        return field_gain(array.pattern, vectors) ** 4
    counts = [Counter(elements) for elements in (array.tx, array.rx)]
    tx, rx = ([(element_field(one, vectors), times) for one, times in count.items()] for count in counts)
    plain = sum(m * n * np.abs(np.einsum("...k,...k->...", e, f)) ** 2 for e, m in tx for f, n in rx)
    size = sum(m * n * (_size(e) * _size(f)) ** 2 for e, m in tx for f, n in rx)
    return np.asarray(np.where(plain <= CROSSED_SHARE * size, size, plain) / array.num_virtual)


def beam_gain(array: AntennaArray, vectors: npt.ArrayLike) -> Array:
    """Return the two-way power gain of a beam that adds all channels in phase, over their number squared: (...).

    By definition; that of one pair where all antennas are alike.
    """
    if array.is_uniform:
        return field_gain(array.pattern, vectors) ** 4
    return np.asarray(np.mean(np.abs(pair_factors(array, vectors)), axis=-1) ** 2)


def largest_field_gain(array: AntennaArray, vectors: npt.ArrayLike) -> Array:
    """Return the one-way gain in amplitude of the best antennas towards vectors (..., 3).

    By definition; that of the array's pattern where all antennas are alike.
    """
    if array.is_uniform:
        return field_gain(array.pattern, vectors)
    ends = [np.max([_size(one) for one in antenna_fields(own, vectors)], axis=0) for own in (array.tx, array.rx)]
    return np.asarray(np.sqrt(ends[0] * ends[1]))


def boresights(array: AntennaArray) -> Array:
    """Return where antennas point, shape (num_directions, 3) [radar frame]: ahead, where all are alike.

    By definition.
    """
    if array.is_uniform:
        return np.array([[1.0, 0.0, 0.0]])
    return np.stack([one.radar_from_antenna[:, 0] for one in {*array.tx, *array.rx}])


def virtual_positions(radar: RadarSpec) -> Array:
    """Return tx + rx position of every channel ``i * num_rx + j``, shape (num_virtual, 3) [m, radar frame].

    In the far field the length of channel c towards the unit vector n is ``2 R - virtual_positions[c] @ n``.

    References
    ----------
    .. [1] J. Li, P. Stoica, "MIMO radar with colocated antennas", IEEE Signal Process. Mag. 24(5), 2007.
    """
    return (radar.tx_array[:, None, :] + radar.rx_array[None, :, :]).reshape(-1, 3)
