"""The end of the range, where paths go out smoothly."""

from __future__ import annotations

import numpy as np

from scarl_sionna.radar.paths import RadarPaths

END = 0.25
"""Depth before the end of the range over which paths go out [m]: 128 half wavelengths at 77 GHz, so that what ends
there does not radiate as an edge would (1e-5 of its field)."""


def fading_out(paths: RadarPaths, reach: float) -> RadarPaths:
    """Return paths of which those go out smoothly that are nearly as long as twice the `reach` [m].

    A body that passes the end of the range is cut there, patch by patch: with a sharp end the cut radiates as much as
    the body, and changes with every quarter of a wavelength.
    """
    before = np.asarray(reach - paths.length / 2.0)
    if not np.any(before < END):
        return paths
    return paths.scaled(np.sin(np.pi / 2.0 * np.clip(before / END, 0.0, 1.0)) ** 2)
