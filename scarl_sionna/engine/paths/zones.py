"""First Fresnel zones of paths, and the mirrors that are smaller than them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .tracing import SPECULAR, mirror_extent

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.integer]


def zone_diameters(points: Array, start: Array, length: Array, wavelength: float) -> Array:
    r"""Return the smaller diameter of the first Fresnel zone at each interaction [m], shape (num_paths, max_depth).

    Parameters
    ----------
    points : ndarray of float64, shape (num_paths, max_depth, 3)
        Interactions in order [m].
    start : ndarray of float64, shape (3,)
        Where the paths begin [m].
    length : ndarray of float64, shape (num_paths,)
        Of whole paths [m].
    wavelength : float
        [m]

    Notes
    -----
    .. math:: 2 \sqrt{\lambda d_1 d_2 / (d_1 + d_2)}

    with the lengths d1, d2 of the path before and behind. Along the plane of incidence the zone is longer
    by 1 / cos(theta).

    References
    ----------
    .. [1] Recommendation ITU-R P.526-15, section 2.1.
    """
    line = np.concatenate([np.broadcast_to(start, (len(length), 1, 3)), points], axis=1)
    before = np.cumsum(np.linalg.norm(np.diff(line, axis=1), axis=2), axis=1)
    behind = np.maximum(length[:, None] - before, 0.0)
    return np.asarray(2.0 * np.sqrt(wavelength * before * behind / np.maximum(before + behind, 1e-12)))


def mirror_sizes(state: WorldState, kind: Index, part: Index, face: Index) -> Array:
    """Return the smaller extent of the flat region that each mirror reflection is on [m], shape (num_paths, max_depth).

    Infinite where there is no mirror reflection.

    Parameters
    ----------
    state : WorldState
    kind, part, face : ndarray of int, shape (num_paths, max_depth)
        As in :mod:`.tracing`.
    """
    out = np.full(kind.shape, np.inf)
    known: dict[tuple[int, int], float] = {}
    for place in zip(*np.nonzero(kind == SPECULAR), strict=True):
        key = int(part[place]), int(face[place])
        if key not in known:
            known[key] = mirror_extent(state, *key)
        out[place] = known[key]
    return out
