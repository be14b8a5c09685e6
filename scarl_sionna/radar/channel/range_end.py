"""The end of the range, where paths go out smoothly: for all solvers."""

from __future__ import annotations

import numpy as np

from scarl_sionna.radar.paths import RadarPaths

LONGEST_FADE = 0.25
"""Depth before the end of the range over which paths go out, at most [m]: what ends there radiates 1.5e-5 of the field
of a sharp end at 77 GHz, 1.6e-4 at 24 GHz. The same at all frequencies, so that a band has one."""
FADED_SHARE = 0.05
"""The same as a part of the range, for short ones: of 0.5 m at 60 GHz 2.5 cm go out, 2.5e-3 of the field."""


def fade_of(reach: float) -> float:
    """Return the depth before the end of a range over which paths go out [m]; `reach` > 0 [m]."""
    return min(LONGEST_FADE, FADED_SHARE * reach)


def within_reach(paths: RadarPaths, reach: float) -> RadarPaths:
    r"""Return the paths that are shorter than twice the `reach` [m]; nearly as long ones go out smoothly.

    A solver calls it once for each of its paths. Their diagnostics stay.

    Notes
    -----
    The field of a path of length L is multiplied by

    .. math:: \sin^2\left(\frac{\pi}{2} \min\left(\frac{r - L/2}{d}, 1\right)\right)

    with the reach r and the depth d of :func:`fade_of`: by -1.4 dB at three quarters of it before the end, -6.0 dB at
    the half, -16.7 dB at a quarter, -32.2 dB at a tenth. A body that passes the end is cut there, patch by patch: with
    a sharp end the cut radiates as much as the body, and changes with every quarter of a wavelength; with this one
    :math:`1 / ((4 d / \lambda)^2 - 1)` of that field is left, by the integral of the weight's slope.
    """
    before = np.asarray(reach - paths.length / 2.0)
    fade = fade_of(reach)
    if np.all(before >= fade):
        return paths
    kept = before > 0.0
    paths, before = paths.select(kept), before[kept]
    return paths.scaled(np.sin(np.pi / 2.0 * np.minimum(before / fade, 1.0)) ** 2)
