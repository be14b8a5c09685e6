"""Colour filter mosaic (Bayer): one colour a pixel, and the other two from its neighbours."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_COLORS = "rgb"
_CROSS = np.array([[0.0, 1.0, 0.0], [1.0, 4.0, 1.0], [0.0, 1.0, 0.0]]) / 4.0
_SQUARE = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]]) / 4.0


def filters(shape: tuple[int, int], mosaic: str) -> npt.NDArray[np.int64]:
    """Return the colour (0 red, 1 green, 2 blue) of each pixel's filter, shape (height, width).

    Parameters
    ----------
    shape : tuple of int
        Height and width.
    mosaic : str
        Colours of the first two pixels of the first two rows, such as ``"rggb"``.
    """
    tile = np.array([_COLORS.index(letter) for letter in mosaic]).reshape(2, 2)
    return np.asarray(np.tile(tile, (shape[0] // 2 + 1, shape[1] // 2 + 1))[: shape[0], : shape[1]], dtype=np.int64)


def through_mosaic(planes: npt.NDArray[np.float64], mosaic: str) -> Array:
    """Return three planes of which each pixel measured one; the others are linear between the neighbours that did.

    Parameters
    ----------
    planes : ndarray of float64, shape (height, width, 3)
        Values of three full planes; only the one of each pixel's filter is used.
    mosaic : str
        As for :func:`filters`.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)

    Notes
    -----
    Bilinear interpolation; exact for images that are linear in row and column (but at the border, where the image is
    mirrored). Coloured fringes at edges and moiré of fine patterns are those of this interpolation.
    """
    from scipy.ndimage import convolve

    color = filters(planes.shape[:2], mosaic)
    full = np.empty_like(planes)
    for index in range(3):
        own = np.where(color == index, planes[..., index], 0.0)
        full[..., index] = convolve(own, _CROSS if index == 1 else _SQUARE, mode="mirror")
    return full
