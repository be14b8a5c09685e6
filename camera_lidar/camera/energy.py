"""Give a denoised image back what the filter took or added: where samples know better, and sums of like places."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CELL_PX = 16.0
"""Side of the cells over which light is summed [px]."""
CELL_OCTAVES = 0.25
"""Width of a class of brightness [factors of two]."""
_DARKEST = 20.0
"""Octaves below the brightest pixel: what is darker forms one class."""
GLINT = (16.0, 1024.0)
"""How much brighter than the denoised pixel the traced one may be to share its light with others, in the darker half of
the image and in the brighter."""
_AROUND_PX = 1.5
"""Standard deviation of the weights with which noise is looked at around a pixel [px]."""
_NOISES = 3.0
"""Times the variance of the traced image: it is an estimate itself."""
_UNSURE = 2.0
"""Standard deviation of the traced luminance, in units of itself, whatever its samples say."""
_ONE_HIT = 0.8
"""Variance over squared mean from which one sample made it all (then it is 1)."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def take_known(
    denoised: npt.NDArray[np.floating], traced: npt.NDArray[np.floating], variance: npt.NDArray[np.floating]
) -> Array:
    r"""Return the denoised image, drawn to the traced one where they differ by more than the noise.

    Parameters
    ----------
    denoised, traced : ndarray of float, shape (height, width, 3)
        Linear.
    variance : ndarray of float, shape (height, width)
        Of the traced luminance; 0 where there is no noise, as in the sky.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)

    Notes
    -----
    The filter spreads bright pixels over dark neighbours, whose own light the samples know well. With luminances d and
    r, the mean of their squared difference is the filter's squared error plus the noise v, so the mixture of least
    squared error takes the share :math:`w = 1 - v / (d - r)^2` of the traced image, not below 0.

    16 samples often miss what is rare, and their variance with it. So v is the largest of :math:`(2 r)^2`, thrice the
    pixel's variance, and thrice :math:`\frac14 (d + r)^2 \overline{v / (v + d^2 + r^2)}`, a mean over the pixels
    around; nothing is taken where one sample made all the light, or none has any. Four of the nine pixels around must
    have as large a share: the filter errs in places, noise is in single pixels.

    References
    ----------
    .. [1] W. James, C. Stein, "Estimation with quadratic loss", Proc. 4th Berkeley Symp. Math. Statist. Prob. 1, 1961:
       shrinkage by the positive part.
    """
    from scipy.ndimage import gaussian_filter, rank_filter

    kept, wanted = (np.maximum(np.asarray(image, dtype=np.float64) @ _LUMINANCE, 0.0) for image in (denoised, traced))
    tiny = 1e-100
    around = gaussian_filter(variance / np.maximum(variance + kept**2 + wanted**2, tiny), _AROUND_PX)
    noise = _NOISES * np.maximum(variance, around * (0.5 * (kept + wanted)) ** 2)
    noise = np.maximum(noise, (_UNSURE * wanted) ** 2)
    share = np.maximum(1.0 - noise / np.maximum((wanted - kept) ** 2, tiny), 0.0)
    share = np.where(variance < _ONE_HIT * wanted**2, share, 0.0)
    share = np.minimum(share, rank_filter(share, 5, 3))
    return np.asarray(denoised + share[..., None] * (traced - denoised), dtype=np.float64)


def keep_energy(
    denoised: npt.NDArray[np.floating],
    traced: npt.NDArray[np.floating],
    glint: tuple[float, float] | None = GLINT,
) -> Array:
    r"""Return the denoised image with the sums of the traced one, by place and brightness.

    Parameters
    ----------
    denoised, traced : ndarray of float, shape (height, width, 3)
        Linear; the traced image is noisy and unbiased.
    glint : tuple of float, optional
        As `GLINT`; None: every pixel shares all of its light.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)

    Notes
    -----
    A filter that minimises the error of compressed values takes light from skewed noise and spreads bright pixels over
    dark ones. Both images' luminances are summed into a grid over row, column and logarithm of the denoised luminance,
    linearly between cells and smoothed over neighbours, and each pixel takes the ratio of the sums at its place:

    .. math:: y = d \, \frac{(S r)(c)}{(S d)(c)}, \quad c = (i / 16, j / 16, 4 \log_2 d)

    Pixels darker than their neighbourhood have sums of their own, so light does not leak to them. Sums over several
    cells are those of the traced image; colours are those of the denoised one. A traced pixel that is more than `glint`
    times the denoised one (a lamp in a pane, met by one sample in hundreds) would brighten all pixels of its class:
    what is above stays where it is. Bright classes have many pixels, which hardly change by it.

    References
    ----------
    .. [1] J. Chen, S. Paris, F. Durand, "Real-time edge-aware image processing with the bilateral grid", ACM Trans.
       Graphics 26(3), 2007: the grid.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    kept, wanted = (np.maximum(np.asarray(image, dtype=np.float64) @ _LUMINANCE, 0.0) for image in (denoised, traced))
    top = float(kept.max())
    if top <= 0.0:
        return np.asarray(denoised, dtype=np.float64)
    shared = wanted if glint is None else np.where(kept < np.median(kept), *glint) * kept
    rest = np.maximum(1.0 - shared / np.maximum(wanted, np.finfo(np.float64).tiny), 0.0) * (wanted > 0.0)
    wanted *= 1.0 - rest
    octave = np.log2(np.maximum(kept / top, 2.0**-_DARKEST)) + _DARKEST
    rows, columns = np.mgrid[: kept.shape[0], : kept.shape[1]] + 0.5
    place = np.stack([rows / CELL_PX, columns / CELL_PX, octave / CELL_OCTAVES]).reshape(3, -1)
    shape = tuple(int(value) + 2 for value in place.max(axis=1))
    first = place.astype(np.int64)
    part = place - first
    sums = np.zeros((2, int(np.prod(shape))))
    for corner in itertools.product((0, 1), repeat=3):
        weight = np.prod([np.abs(1 - step - part[k]) for k, step in enumerate(corner)], axis=0)
        cell = np.ravel_multi_index(tuple(first[k] + step for k, step in enumerate(corner)), shape)
        for total, image in zip(sums, (wanted, kept), strict=True):
            total += np.bincount(cell, weight * image.ravel(), minlength=len(total))
    has, had = (gaussian_filter(total.reshape(shape), 1.0, mode="constant") for total in sums)
    ratio = np.where(had > 0.0, has / np.maximum(had, np.finfo(np.float64).tiny), 1.0)
    factor = map_coordinates(ratio, place, order=1, mode="nearest").reshape(kept.shape)
    return np.asarray(denoised * factor[..., None] + traced * rest[..., None], dtype=np.float64)
