"""Directions by the beamformer: the largest maxima of its power over the grid, each refined."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from .manifold import Manifold

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]


def bartlett_sines(manifold: Manifold, snapshot: Phasors, distance: Array, count: int) -> Array:
    """Return the sines (n, count, 2) of the beamformer's largest maxima, largest first; the largest where are fewer.

    References
    ----------
    .. [1] M. S. Bartlett, "Periodogram analysis and continuous spectra", Biometrika 37(1/2), 1950.
    """
    sines = np.zeros((len(snapshot), min(count, len(manifold.sines)), 2))
    for block in manifold.blocks(len(snapshot)):
        power = manifold.spectrum(snapshot[block], distance[block]).reshape(-1, *manifold.shape)
        peak = power == scipy.ndimage.maximum_filter(power, size=(1, 3, 3), mode="nearest")
        height = np.where(peak, power, -1.0).reshape(len(power), -1)
        order = np.argsort(-height, axis=1, kind="stable")[:, :count]
        order = np.where(np.take_along_axis(height, order, axis=1) >= 0.0, order, order[:, :1])
        sines[block] = manifold.sines[order]
    for index in range(sines.shape[1]):
        sines[:, index] = manifold.refine(snapshot, sines[:, index], distance)
    return np.asarray(sines)
