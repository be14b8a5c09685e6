"""How far the echo of each object may be off, from the run itself: what cancels is uncertain, bounces are cut."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.auto import ErrorEstimate, SbrLevel
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.band_mean import NUM_FREQUENCIES, band_power, heard_power, mean_power
from scarl_sionna.radar.paths import RadarPaths

Array = npt.NDArray[np.float64]
Part: TypeAlias = "float | Array"


LEAST_DB, MOST_DB = 1e-3, 99.0
"""Range of the errors that are reported [dB]: what is beyond is not told apart."""


def expected_errors(
    paths: RadarPaths, radar: RadarSpec, numbers: Sequence[int], fit: ErrorEstimate, level: SbrLevel
) -> dict[int, float]:
    r"""Return for objects the error that their echo is expected to have [dB]; none for an object without a path.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    numbers : sequence of int
        Instance ids of objects computed by `sbr`.
    fit : ErrorEstimate
    level : SbrLevel
        That which was taken: its number of bounces, and the relative errors of its patches and of its bounces.

    Notes
    -----
    With the amplitudes a of an object's patches and the mean over the band and over the phases of rough surfaces, what
    is left of independent relative errors of the patches, of bounces beyond the last, and of each chain c of instances
    as a whole, relative to the echo is

    .. math:: e^2 = \frac{\epsilon^2 \sum |a|^2 + \kappa^2 \langle|\sum_{last} a|^2\rangle
        + \sum_c \beta_c^2 \langle|\sum_c a|^2\rangle}{\langle|\sum a|^2\rangle}

    and the error :math:`20 \log_{10}(1 + e)`. A flash, whose patches add up, is certain; a side lobe, which is what
    is left where they cancel, is not, nor is a fade between ways over mirrors. What tubes lack of a bounce between
    bodies, such as what comes through a gap, all of its patches lack alike: beta is that of the level's bounces there,
    else `way_error`, also for what bounces within one body, such as a corner. The constants are measured:
    docs/accuracy.md, expected error.
    """
    if not paths.num_paths or not len(numbers):
        return {}
    owner = owners(paths, numbers)
    place = np.searchsorted(np.sort(numbers), owner)
    rows = np.flatnonzero(owner >= 0)
    place, count = place[rows], len(numbers)
    met = np.isin(paths.instance[rows], numbers)
    last = met.sum(axis=1) >= level.max_depth
    whole = mean_power(paths, radar, rows, place, count, NUM_FREQUENCIES)
    beyond = mean_power(paths, radar, rows[last], place[last], count, NUM_FREQUENCIES)
    apart = np.bincount(place, heard_power(paths.a[rows], radar), count)
    chain, first = _chains(paths.instance[rows])
    alike = mean_power(paths, radar, rows, chain, len(first), NUM_FREQUENCIES)
    between = _num_bodies(paths.instance[rows[first]], met[first]) > 1
    ways, bounces = (np.bincount(place[first], alike * kind, count) for kind in (~between, between))
    parts = (power / np.maximum(whole, 1e-300) for power in (apart, beyond, ways, bounces))
    error = error_db(level, fit, *parts)
    some = np.bincount(place, minlength=count) > 0
    return {number: float(error[k]) for k, number in enumerate(sorted(numbers)) if some[k]}


def error_db(level: SbrLevel, fit: ErrorEstimate, apart: Part, last: Part, ways: Part, bounces: Part) -> Array:
    """Return the expected error of echoes [dB] by powers relative to theirs; docs/accuracy.md, expected error.

    Parameters
    ----------
    level : SbrLevel
    fit : ErrorEstimate
    apart, last, ways, bounces : float or ndarray of float64, shape (n,)
        Sum of the powers of patches, power of the last bounce, and sums of the powers of chains within one body and
        between bodies.
    """
    square = level.patch_error**2 * np.asarray(apart) + fit.last_bounce**2 * np.asarray(last)
    square = square + fit.way_error**2 * np.asarray(ways) + level.error_of_bounces**2 * np.asarray(bounces)
    return np.asarray(20.0 * np.log10(1.0 + np.sqrt(square)))


def _num_bodies(instance: npt.NDArray[np.int32], is_body: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """Return how often chains come to a body from elsewhere, shape (n,): one that bounces within it is there once."""
    begins = is_body.copy()
    begins[:, 1:] &= instance[:, 1:] != instance[:, :-1]
    return np.asarray(begins.sum(axis=1))


def _chains(instance: npt.NDArray[np.int32]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the number of each path's chain of instances, shape (n,), and a path of each chain.

    Most paths follow others of their chain.
    """
    begins = np.ones(len(instance), dtype=np.bool_)
    begins[1:] = (instance[1:] != instance[:-1]).any(axis=1)
    _, first, number = np.unique(instance[begins], axis=0, return_index=True, return_inverse=True)
    return number.ravel()[np.cumsum(begins) - 1], np.flatnonzero(begins)[first]


def reverse_doubts(
    paths: RadarPaths, radar: RadarSpec, numbers: Sequence[int], lit: Collection[int]
) -> dict[int, float]:
    r"""Return by how much the two directions of bounces between objects differ, against the echo of each [dB].

    Parameters
    ----------
    paths : RadarPaths
        Of a monostatic radar.
    radar : RadarSpec
    numbers : sequence of int
        Instance ids of objects computed by `sbr`.
    lit : collection of int
        Those of them on which tubes started: only what begins and ends at two of these has been traced both ways.

    Notes
    -----
    A wave that meets object n first and another one last has a twin that runs the other way, with the same field
    (reciprocity). The two are traced from other faces by other tubes, so with the sum A of all that begin at n and end
    elsewhere, and B of all that end at n and began elsewhere,

    .. math:: 20 \log_{10}\left(1 + \sqrt{\langle|A - B|^2\rangle / \langle|\sum a|^2\rangle}\right)

    tells what tubes lack that two levels lack. Side lobes of a bounce have no exact twin in physical
    optics, so it is a doubt, not an error.

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., 2012, section 7.5 (reciprocity).
    """
    order = np.sort(numbers)
    first, last = owners(paths, numbers), owners(paths, numbers, last=True)
    some = list(lit)
    between = (first != last) & np.isin(first, some) & np.isin(last, some) & ~paths.filled("random_phase")
    rows = np.flatnonzero(between)
    if not len(rows):
        return {}
    begin, end = np.searchsorted(order, first[rows]), np.searchsorted(order, last[rows])
    twice = paths.select(np.concatenate([rows, rows]))
    twice = replace(twice, a=twice.a * np.repeat([1.0, -1.0], len(rows))[:, None, None])
    place = np.concatenate([begin, end])
    apart = band_power(twice, radar, np.arange(len(place)), place, len(order), NUM_FREQUENCIES)
    found = {}
    for number, level in levels_db(paths, radar, numbers).items():
        square = apart[int(np.searchsorted(order, number))] / 10.0 ** (level / 10.0)
        found[number] = min(20.0 * float(np.log10(1.0 + np.sqrt(square))), MOST_DB)
    return found


def kept_error(errors: Sequence[float], bounds: Sequence[float], share: float, fit: ErrorEstimate) -> float:
    r"""Return the error that a share of objects keeps with a probability of `fit.confidence` [dB].

    Parameters
    ----------
    errors : sequence of float
        Expected error of the objects that are computed [dB], see :func:`expected_errors`.
    bounds : sequence of float
        Error of the others, which is certain [dB].
    share : float
        Of all objects, 0 to 1.
    fit : ErrorEstimate
        How the errors that were found are distributed about those expected.

    Notes
    -----
    An object whose expected error is e is taken to be off by at most x with the probability

    .. math:: F = \frac{1}{1 + (m e / x)^a}

    independently of the others (log-logistic, median m e): most objects are off by far less than expected, and one in
    twenty by more. The number of objects beyond x is then a sum of independent trials of different odds.

    References
    ----------
    .. [1] Y. H. Wang, "On the number of successes in independent trials", Statistica Sinica 3(2), 1993.
    """
    count = len(errors) + len(bounds)
    if count == 0:
        return 0.0
    low, high = LEAST_DB, MOST_DB
    if keeps(low, errors, bounds, share, fit) or not keeps(high, errors, bounds, share, fit):
        return low if keeps(low, errors, bounds, share, fit) else high
    while high / low > 1.00001:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if keeps(middle, errors, bounds, share, fit) else (middle, high)
    return high


def keeps(most: float, errors: Sequence[float], bounds: Sequence[float], share: float, fit: ErrorEstimate) -> bool:
    """Return whether a share of objects is within `most` [dB] with enough probability, see :func:`kept_error`."""
    computed, certain = np.asarray(errors, dtype=np.float64), np.asarray(bounds, dtype=np.float64)
    count = len(computed) + len(certain)
    left = count - int(np.ceil(share * count - 1e-9)) - int(np.count_nonzero(certain > most))
    if left < 0:
        return False
    beyond = np.zeros(left + 1)  # probability of so many objects beyond
    beyond[0] = 1.0
    for miss in 1.0 - 1.0 / (1.0 + (fit.median * computed / most) ** fit.tail):
        beyond[1:] = beyond[1:] * (1.0 - miss) + beyond[:-1] * miss
        beyond[0] *= 1.0 - miss
    return bool(beyond.sum() >= fit.confidence)


def levels_db(paths: RadarPaths, radar: RadarSpec, numbers: Sequence[int]) -> dict[int, float]:
    """Return the power of objects, mean over the band [dB of the transmitted]: to be compared with each other."""
    owner = owners(paths, numbers)
    rows, order = np.flatnonzero(owner >= 0), sorted(numbers)
    power = mean_power(paths, radar, rows, np.searchsorted(order, owner[rows]), len(order), NUM_FREQUENCIES)
    return {number: 10.0 * float(np.log10(max(power[k], 1e-40))) for k, number in enumerate(order)}


def owners(paths: RadarPaths, numbers: Sequence[int], last: bool = False) -> npt.NDArray[np.int64]:
    """Return the first (or last) of some objects that each path meets, -1 if it meets none, shape (num_paths,)."""
    owner = np.full(paths.num_paths, -1, dtype=np.int64)
    columns = range(paths.instance.shape[1])
    for column in reversed(columns) if last else columns:
        here = paths.instance[:, column]
        owner = np.where((owner < 0) & np.isin(here, numbers), here, owner)
    return owner
