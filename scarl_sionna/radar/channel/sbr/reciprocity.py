"""Both senses of what physical optics traces: exchanged, transmitter and receiver see the same.

The currents of physical optics at the last bounce of a chain are not those at the last bounce of its reverse, so that a
chain and its reverse, which is traced from other faces, have matrices that are not the transposed of each other.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.radar.paths import RadarPaths

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Flags = npt.NDArray[np.bool_]


def of_both_senses(state: WorldState, both: Sequence[RadarPaths]) -> RadarPaths:
    """Return the mean of the fields of a pair of radars and of the same pair with the ends exchanged.

    By definition; the reciprocal pair is that of the two in the other order, with the same lengths and the transposed
    fields. Of what rough surfaces scatter the powers have their mean, since the phases are drawn anew.
    """
    halves = []
    for paths in (both[0], both[1].reversed()):
        share = np.where(paths.filled("random_phase"), np.sqrt(0.5), 0.5)
        halves.append(_labelled(state, paths.scaled(share)))
    return RadarPaths.concatenate(halves, both[0].diagnostics)


def with_reverses(state: WorldState, paths: RadarPaths, as_traced: Collection[int] = ()) -> RadarPaths:
    r"""Return the paths of a monostatic radar with the reverse of each chain of bounces, each with half of the field.

    Parameters
    ----------
    state : WorldState
    paths : RadarPaths
        By physical optics, some perhaps by other solvers.
    as_traced : collection of int
        Instances whose chains are left as they are.

    Returns
    -------
    RadarPaths
        HV = VH, for antennas off the middle of the array, too. What is new comes last;
        ``diagnostics["num_reverses"]`` is its number. Left as they are: single bounces and mirror chains, what rough
        surfaces scatter, and paths whose reverse is among the paths.

    Notes
    -----
    With the matrix S of a chain from P to Q, and S' of the chain that was traced the other way,

    .. math:: \tfrac12 (S + S'^T) \text{ from P to Q}, \quad \tfrac12 (S' + S^T) \text{ from Q to P},

    the mean of two estimates of one matrix each way. VV and HH of the middle of the array are what they were.

    References
    ----------
    .. [1] C. A. Balanis, *Advanced Engineering Electromagnetics*, 2nd ed., 2012, section 7.5 (reciprocity).
    """
    alone = (paths.depth > 1) & ~paths.is_mirror_chain & ~paths.filled("random_phase")
    alone &= ~np.isin(paths.instance, list(as_traced)).any(axis=1)
    alone[alone] = ~_has_reverse(paths.select(alone))
    if not alone.any():
        return paths
    halves = paths.scaled(np.where(alone, 0.5, 1.0))
    reverses = _labelled(state, halves.select(alone).reversed())
    diagnostics = {**paths.diagnostics, "num_reverses": int(alone.sum())}
    return RadarPaths.concatenate([halves, reverses], diagnostics)


def _labelled(state: WorldState, paths: RadarPaths) -> RadarPaths:
    """Return paths with the class of what each meets last."""
    table = state.world.instances
    last = np.take_along_axis(paths.instance, paths.depth[:, None].astype(np.int64) - 1, axis=1)[:, 0]
    names, place = np.unique(last, return_inverse=True)
    semantic = np.array([table[int(number)].semantic for number in names], dtype=np.uint8)[place]
    return replace(paths, semantic=semantic)


def _has_reverse(paths: RadarPaths) -> Flags:
    """Return whether the reverse of each path is among the paths to the last bit, as copies of it are."""
    ends = paths.tx_point.T, paths.rx_point.T
    (vv, vh), (hv, hh) = paths.a.transpose(1, 2, 0)
    weights = np.random.default_rng(0).uniform(1.0, 2.0, size=14)  # of a hash

    def mixed(first: npt.NDArray[np.float64], last: npt.NDArray[np.float64], *entries: npt.ArrayLike) -> npt.ArrayLike:
        parts = [part for entry in entries for part in (np.real(entry), np.imag(entry))]
        return sum(weight * part for weight, part in zip(weights, (*first, *last, *parts), strict=True))

    return np.isin(mixed(*ends, vv, vh, hv, hh), mixed(*ends[::-1], vv, hv, vh, hh))
