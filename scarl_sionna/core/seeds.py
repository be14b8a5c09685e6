"""One seed tree: every random number comes from a generator that is named after what it is for.

The generator depends on the root seed and the names only, never on call order or on the number of workers.
"""

from __future__ import annotations

import hashlib

import numpy as np

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
