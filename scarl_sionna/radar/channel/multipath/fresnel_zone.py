"""Warns of mirrors and edges smaller than the first Fresnel zone on them, and of wavefronts with two radii."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from scarl_sionna.core.errors import ScarlWarning, SmallMirrorWarning
from scarl_sionna.engine.paths.tracing import DIFFRACTION, SPECULAR
from scarl_sionna.engine.paths.zones import mirror_sizes, zone_diameters

from .legs import Legs
from .station import Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


def warn_of_small_mirrors(state: WorldState, wavelength: float, mirrors: list[tuple[Legs, Station]]) -> int:
    """Warn once of the mirror or edge that is smallest against its Fresnel zone.

    Return the number of such interactions.
    """
    num_small, worst = 0, (1.0, 0.0, 0.0, -1, SPECULAR)
    for legs, station in mirrors:
        zones = zone_diameters(legs.point, station.position, legs.length, wavelength)
        sizes = mirror_sizes(state, legs.kind, legs.part, legs.face)
        for leg, k in zip(*np.nonzero((legs.kind == SPECULAR) | (legs.kind == DIFFRACTION)), strict=True):
            kind, zone = int(legs.kind[leg, k]), float(zones[leg, k])
            extent = float(sizes[leg, k] if kind == SPECULAR else legs.edge_length[leg])
            if extent < zone:
                num_small += 1
                worst = min(worst, (extent / zone, extent, zone, int(legs.part[leg, k]), kind))
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
