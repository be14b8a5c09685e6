"""The mean power over the band of what paths sum up to, in groups, as the antennas hear it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import pair_polarizations

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

NUM_FREQUENCIES = 16
"""At which the field of an object is summed over the band: its power is their mean, whatever range cells it fills."""


def mean_over_band(
    field: Complex,
    length: Array,
    place: npt.NDArray[np.int64],
    radar: RadarSpec,
    num_frequencies: int = NUM_FREQUENCIES,
) -> Array:
    """Return the mean over the band of the power |sum field|^2 of groups of paths, shape (num_groups,).

    Parameters
    ----------
    field : ndarray of complex128, shape (n,)
        Of each path, without the carrier's phase over its length.
    length : ndarray of float64, shape (n,)
        [m].
    place : ndarray of int64, shape (n,)
        Group of each; the last group has at least one path.
    radar : RadarSpec
    num_frequencies : int
        Over the sampled band, weighted by a Hann window.
    """
    share = (np.arange(num_frequencies) + 0.5) / num_frequencies
    weight = np.sin(np.pi * share) ** 2
    weight = weight**2 / np.sum(weight**2)
    wave = 2.0 * np.pi / SPEED_OF_LIGHT * length
    start = radar.center_frequency + (share[0] - 0.5) * radar.sampled_bandwidth
    field = field * np.exp(-1j * wave * start)
    step = np.exp(-1j * wave * (radar.sampled_bandwidth / num_frequencies))
    count = int(place.max(initial=-1)) + 1
    power = np.zeros(count)
    for one in weight:
        power += one * (np.bincount(place, field.real, count) ** 2 + np.bincount(place, field.imag, count) ** 2)
        field = field * step
    return power


def mean_power(
    paths: RadarPaths,
    radar: RadarSpec,
    rows: npt.NDArray[np.int64],
    place: npt.NDArray[np.int64],
    count: int,
    num_frequencies: int,
) -> Array:
    """Return the mean power of groups of paths over the band and over what rough surfaces may be, shape (count,).

    What a rough patch scatters has a random phase, which is another one where patches are cut otherwise: its power is
    added, not its field. Parameters as of :func:`band_power`.
    """
    rough = paths.filled("random_phase")[rows]
    found = band_power(paths, radar, rows[~rough], place[~rough], count, num_frequencies)
    found += np.bincount(place[rough], heard_power(paths.a[rows[rough]], radar, paths.is_monostatic), count)
    return found


def band_power(
    paths: RadarPaths,
    radar: RadarSpec,
    rows: npt.NDArray[np.int64],
    place: npt.NDArray[np.int64],
    count: int,
    num_frequencies: int,
) -> Array:
    """Return the mean over the band of the power |sum a|^2 of groups of paths, shape (count,).

    As the radar hears them, see :func:`heard`.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    rows, place : ndarray of int64, shape (n,)
        Paths, and the group of each.
    count : int
        Groups.
    num_frequencies : int
        Over the sampled band, weighted by a Hann window.
    """
    power = np.zeros(count)
    for field in heard(paths.a[rows], radar, paths.is_monostatic):
        found = mean_over_band(field, paths.length[rows], place, radar, num_frequencies)
        power[: len(found)] += found
    return power


def heard(a: Complex, radar: RadarSpec, is_monostatic: bool = True) -> list[Complex]:
    """Return the fields of paths that a radar hears, each of shape (n,).

    Parameters
    ----------
    a : ndarray of complex128, shape (n, 2, 2)
        As in :class:`RadarPaths`.
    radar : RadarSpec
    is_monostatic : bool
        Whether it hears both senses of each path, whose lengths are the same: the mean of both.

    Returns
    -------
    list of ndarray of complex128
        VV where all antennas are V, HH where all are H; else of every polarisation of a pair, the powers of which are
        to be added, times the root of its share of the pairs.
    """
    array = radar.array
    if array.is_of_one_polarization:
        entry = "VH".index(str(array.tx[0].polarization))
        return [a[:, entry, entry]]
    mean = 0.5 * (a + a.transpose(0, 2, 1)) if is_monostatic else a
    return [np.sqrt(share) * np.einsum("i,nij,j->n", rx, mean, tx) for share, tx, rx in pair_polarizations(array)]


def heard_power(a: Complex, radar: RadarSpec, is_monostatic: bool = True) -> Array:
    """Return the power of each path that a radar hears, shape (n,); parameters as of :func:`heard`."""
    return np.asarray(sum(np.abs(field) ** 2 for field in heard(a, radar, is_monostatic)))
