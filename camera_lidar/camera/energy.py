"""Give a denoised image the light back that the filter took or added: like sums in places of like brightness."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CELL_PX = 16.0
"""Side of the cells over which light is summed first [px]."""
CELL_OCTAVES = 1.0
"""Width of a class of brightness there [factors of two]."""
MOST_FACTOR = 4.0
"""By how much a cell makes its pixels brighter or darker; one glint in the dark would light up all around it."""
CLASS_OCTAVES = 0.25
"""Width of a class of brightness in the whole image, over which the rest is given back [factors of two]."""
_DARKEST = 20.0
"""Octaves below the brightest pixel: what is darker forms one class."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def luminance(image: npt.NDArray[np.floating]) -> Array:
    """Return the luminance of linear RGB, not below 0, of the image's shape without its last axis."""
    return np.asarray(np.maximum(np.asarray(image, dtype=np.float64) @ _LUMINANCE, 0.0))


def keep_energy(denoised: npt.NDArray[np.floating], traced: npt.NDArray[np.floating]) -> Array:
    r"""Return the denoised image with the sums of the traced one, by place and brightness.

    Parameters
    ----------
    denoised, traced : ndarray of float, shape (height, width, 3)
        Linear; the traced image is noisy and unbiased.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)

    Notes
    -----
    A filter that minimises the error of compressed values takes light from skewed noise and spreads bright pixels over
    dark ones. Both images' luminances are summed into a grid over row, column and logarithm of the denoised luminance,
    linearly between cells and smoothed over neighbours, and each pixel takes the ratio of the sums at its place:

    .. math:: y = d \, \frac{(S r)(c)}{(S d)(c)}, \quad c = (i / 16, j / 16, \log_2 d)

    Pixels darker than their neighbourhood have sums of their own, so light does not leak to them. The ratio is kept
    within 1/4 to 4; what is left (a glint that one sample found) goes to all pixels of like brightness. Sums over the
    image are those of the traced one; colours are those of the denoised one.

    References
    ----------
    .. [1] J. Chen, S. Paris, F. Durand, "Real-time edge-aware image processing with the bilateral grid", ACM Trans.
       Graphics 26(3), 2007: the grid.
    """
    local = _balanced(np.asarray(denoised, dtype=np.float64), traced, CELL_PX, CELL_OCTAVES, MOST_FACTOR)
    return _balanced(local, traced, float(max(local.shape)), CLASS_OCTAVES, np.inf)


def _balanced(
    image: Array, traced: npt.NDArray[np.floating], cell_px: float, cell_octaves: float, most: float
) -> Array:
    """Return the image with the traced one's sums over cells, as far as factors up to `most` reach."""
    from scipy.ndimage import gaussian_filter, map_coordinates

    kept, wanted = luminance(image), luminance(traced)
    top = float(kept.max())
    if top <= 0.0:
        return image
    octave = np.log2(np.maximum(kept / top, 2.0**-_DARKEST)) + _DARKEST
    rows, columns = np.mgrid[: kept.shape[0], : kept.shape[1]] + 0.5
    place = np.stack([rows / cell_px, columns / cell_px, octave / cell_octaves]).reshape(3, -1)
    shape = tuple(int(value) + 2 for value in place.max(axis=1))
    first = place.astype(np.int64)
    part = place - first
    sums = np.zeros((2, int(np.prod(shape))))
    for corner in itertools.product((0, 1), repeat=3):
        weight = np.prod([np.abs(1 - step - part[k]) for k, step in enumerate(corner)], axis=0)
        cell = np.ravel_multi_index(tuple(first[k] + step for k, step in enumerate(corner)), shape)
        for total, of in zip(sums, (wanted, kept), strict=True):
            total += np.bincount(cell, weight * of.ravel(), minlength=len(total))
    has, had = (gaussian_filter(total.reshape(shape), 1.0, mode="constant") for total in sums)
    ratio = np.where(had > 0.0, has / np.maximum(had, np.finfo(np.float64).tiny), 1.0)
    ratio = np.clip(ratio, 1.0 / most, most)
    factor = map_coordinates(ratio, place, order=1, mode="nearest").reshape(kept.shape)
    return np.asarray(image * factor[..., None], dtype=np.float64)
