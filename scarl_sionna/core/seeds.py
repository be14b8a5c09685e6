"""One seed tree: every random number comes from a generator that is named after what it is for.

The generator depends on the root seed and the names only, never on call order or on the number of workers.
"""

from __future__ import annotations

import hashlib

import numpy as np
import numpy.typing as npt

from .errors import ParameterRangeError


def generator(seed: int, purpose: str, **names: int | str) -> np.random.Generator:
    """Return the random generator of one purpose.

    Parameters
    ----------
    seed : int
        Root seed, >= 0 (0 is a legal seed).
    purpose : str
        What the numbers are for, for instance ``"radar_noise"``.
    **names : int or str
        What tells this use apart, for instance ``frame=12, sensor="front_left"``. Their order does not matter.

    Returns
    -------
    numpy.random.Generator
        PCG64, seeded by a SHA-256 of seed, purpose and names.
    """
    if isinstance(seed, bool) or int(seed) != seed or seed < 0:
        raise ParameterRangeError("seed", seed, "an integer >= 0")
    label = "|".join([purpose, *(f"{key}={names[key]!r}" for key in sorted(names))])
    digest = hashlib.sha256(f"{int(seed)}|{label}".encode()).digest()
    return np.random.Generator(np.random.PCG64(np.frombuffer(digest, dtype=np.uint32)))


def uniform_hash(keys: npt.NDArray[np.int64], seed: int) -> npt.NDArray[np.float64]:
    """Return numbers that look independent and uniform over [0, 1), one for each row of keys.

    Parameters
    ----------
    keys : ndarray of int64, shape (n, k)
        What tells each number apart, k integers of any sign; their order counts.
    seed : int
        From 0 to ``2**64 - 1``.

    Returns
    -------
    ndarray of float64, shape (n,)
        Multiples of ``2**-53``; equal rows have equal numbers.

    References
    ----------
    .. [1] G. L. Steele, D. Lea, C. H. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014 (the
           finalizer of SplitMix64).
    """
    state = np.full(len(keys), seed, dtype=np.uint64)
    for column in keys.T:
        state = _mixed((state ^ column.astype(np.uint64)) + np.uint64(0x9E3779B97F4A7C15))
    return (state >> np.uint64(11)).astype(np.float64) * 2.0**-53


def _mixed(word: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))
