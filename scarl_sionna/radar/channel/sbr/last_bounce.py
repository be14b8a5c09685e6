"""What the last bounce that is followed has of each echo, and what a coarser look finds beyond it."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.settings.warn import WarningLevels
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import power_to_db
from scarl_sionna.radar.channel.band_mean import NUM_FREQUENCIES, mean_power
from scarl_sionna.radar.paths import RadarPaths

from .shadows import MOST_DB

Mask = npt.NDArray[np.bool_]

NOTHING_DB = -60.0
"""Smaller shares are not listed."""
LOOK_FROM_DB = -20.0
"""Instances whose last bounce has more of the echo than this are looked at with more bounces: waves that go on.

What cancels by symmetry in the last bounce is not, as the second bounces of a corner that is seen along its axis."""
MORE = 2
"""So many: what comes back the way it came has an odd number."""


def last_bounces_db(paths: RadarPaths, radar: RadarSpec, max_depth: int) -> dict[int, float]:
    """Return the power of the last bounce over that of the whole echo [dB], by the instance that is met first.

    Parameters
    ----------
    paths : RadarPaths
        Of `sbr`: what the antennas hear counts, mean over the band; patches of random phases add their powers.
    radar : RadarSpec
    max_depth : int
        Bounces that were followed: 1 is none after the first, of which nothing is said.
    """
    first, last = paths.instance[:, 0] if paths.num_paths else np.zeros(0, np.int32), paths.depth >= max_depth
    numbers = np.unique(first[last])
    if max_depth == 1 or not len(numbers):
        return {}
    whole, end = (_powers(paths, radar, some, numbers) for some in (np.isin(first, numbers), last))
    share = power_to_db(end / np.maximum(whole, 1e-300))
    return {int(n): round(float(one), 1) for n, one in zip(numbers, share, strict=True) if one > NOTHING_DB}


def further_db(found: RadarPaths, more: RadarPaths, radar: RadarSpec, max_depth: int) -> dict[int, float]:
    """Return the power of what comes after `max_depth` bounces over that of the whole echo [dB], by instance.

    :data:`.MOST_DB` at most, where the whole echo is below the floor, too.

    Parameters
    ----------
    found : RadarPaths
        Of `max_depth` bounces.
    more : RadarPaths
        Of some of its instances, with more bounces, however coarse.
    radar : RadarSpec
    max_depth : int
    """
    beyond = more.depth > max_depth
    numbers = np.unique(more.instance[beyond, 0])
    if not len(numbers):
        return {}
    whole = _powers(found, radar, np.isin(found.instance[:, 0], numbers), numbers)
    share = np.minimum(power_to_db(_powers(more, radar, beyond, numbers) / np.maximum(whole, 1e-300)), MOST_DB)
    return {int(n): round(float(one), 1) for n, one in zip(numbers, share, strict=True) if one > NOTHING_DB}


def _powers(paths: RadarPaths, radar: RadarSpec, some: Mask, numbers: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    """Return the power of some paths by the instance that they meet first, one of `numbers`, in their order."""
    rows = np.flatnonzero(some)
    place = np.searchsorted(numbers, paths.instance[rows, 0])
    return mean_power(paths, radar, rows, place, len(numbers), NUM_FREQUENCIES)


def warn_of_further(further: Mapping[str, float], max_depth: int, levels: WarningLevels) -> None:
    """Warn of instances, by name, whose echo what comes after the last bounce may change [dB over the echo]."""
    change = {name: 20.0 * float(np.log10(1.0 + 10.0 ** (share / 20.0))) for name, share in further.items()}
    some: Sequence[str] = [name for name in change if change[name] > levels.further_bounces]
    if some:
        worst = max(some, key=lambda name: change[name])
        warnings.warn(
            f"waves go on after the {max_depth} bounces that are followed: {MORE} more may change the echo of "
            f"{len(some)} instance(s), such as '{worst}', by {change[worst]:.2g} dB: a larger max_depth; "
            "diagnostics['further_db'] has each",
            ScarlWarning,
            stacklevel=4,
        )
