"""Warns of mirrors and edges smaller than the first Fresnel zone on them, and of wavefronts with two radii."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning, SmallMirrorWarning
from scarl_sionna.engine.paths.tracing import DIFFRACTION, SPECULAR, mirror_extent

from .legs import Legs
from .station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]


def zone_diameters(legs: Legs, start: Array, wavelength: float) -> Array:
    r"""Return the smaller diameter of the first Fresnel zone at each interaction [m], shape (num_legs, max_depth).

    .. math:: 2 \sqrt{\lambda d_1 d_2 / (d_1 + d_2)}

    with the lengths d1, d2 of the path before and behind. Along the plane of incidence the zone is longer
    by 1 / cos(theta).

    References
    ----------
    .. [1] Recommendation ITU-R P.526-15, section 2.1.
    """
    line = np.concatenate([np.broadcast_to(start, (len(legs.length), 1, 3)), legs.point], axis=1)
    before = np.cumsum(np.linalg.norm(np.diff(line, axis=1), axis=2), axis=1)
    behind = np.maximum(legs.length[:, None] - before, 0.0)
    return 2.0 * np.sqrt(wavelength * before * behind / np.maximum(before + behind, 1e-12))


def warn_of_small_mirrors(state: WorldState, wavelength: float, mirrors: list[tuple[Legs, Station]]) -> int:
    """Warn once of the mirror or edge that is smallest against its Fresnel zone.

    Return the number of such interactions.
    """
    extents: dict[tuple[int, int], float] = {}
    num_small, worst = 0, (1.0, 0.0, 0.0, -1, SPECULAR)
    for legs, station in mirrors:
        zones = zone_diameters(legs, station.position, wavelength)
        for leg, k in zip(*np.nonzero((legs.kind == SPECULAR) | (legs.kind == DIFFRACTION)), strict=True):
            key, kind = (int(legs.part[leg, k]), int(legs.face[leg, k])), int(legs.kind[leg, k])
            if kind == SPECULAR and key not in extents:
                extents[key] = mirror_extent(state, *key)
            extent = extents[key] if kind == SPECULAR else float(legs.edge_length[leg])
            zone = float(zones[leg, k])
            if extent < zone:
                num_small += 1
                worst = min(worst, (extent / zone, extent, zone, key[0], kind))
    if num_small:
        name = state.world.instances[int(state.world.parts.instance[worst[3]])].name
        what = "a flat face" if worst[4] == SPECULAR else "an edge"
        warnings.warn(
            f"{num_small} mirror reflection(s) or diffraction(s) at surfaces smaller than the first Fresnel zone, "
            f"most of all '{name}': {what} of {worst[1]:.2g} m where the zone is {worst[2]:.2g} m across. The "
            "amplitude ignores the size and the curvature of a surface, so these echoes are wrong, most often too "
            "strong; use method='sbr' for such objects",
            SmallMirrorWarning,
            stacklevel=4,
        )
    return num_small


def warn_of_edge_wavefronts(wavelength: float, mirrors: list[tuple[Legs, Station]], largest: float) -> float:
    """Warn where the wavefront of an edge is no sphere over the antennas; return the largest error of a length [m].

    `largest` is the phase [rad] that an antenna may be off before there is a warning.
    """
    error = max((float(legs.spread.max(initial=0.0)) for legs, _ in mirrors), default=0.0)
    if error * 2.0 * np.pi / wavelength > largest:
        warnings.warn(
            f"an edge's wavefront has two radii, and over this array it is up to {error * 1e3:.2g} mm "
            f"({360.0 * error / wavelength:.0f} deg of phase) off the one sphere that a path holds; solve for parts "
            "of the array apart (receiver=...), or leave diffraction out",
            ScarlWarning,
            stacklevel=4,
        )
    return error
