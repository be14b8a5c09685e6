"""Which samples of raw data other radars hit, found in the data alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.ndimage

from scarl_sionna.core.errors import ParameterRangeError


def find_hits(adc: npt.NDArray[np.complexfloating], pfa: float = 1e-4, guard: int = 2) -> npt.NDArray[np.bool_]:
    r"""Return which samples stand out of their row by their power.

    Parameters
    ----------
    adc : ndarray of complex, shape (num_rx, num_chirps_total, num_samples)
        Raw data [sqrt(W)].
    pfa : float
        Part of the samples of noise alone that is found.
    guard : int
        Samples on either side of what is found that count as hit, too.

    Returns
    -------
    ndarray of bool, shape (num_chirps_total, num_samples)

    Raises
    ------
    ParameterRangeError
        If the shape is another, or `pfa` not between 0 and 1.

    Notes
    -----
    The power summed over the receivers is compared with its median over the row, which bursts shorter than half a row
    hardly move. In noise, equally strong in all receivers, the sum has a gamma distribution of the shape of as many as
    receivers, of real samples (no imaginary part anywhere) half as many, so that the threshold is

    .. math:: \mathrm{median} \cdot F^{-1}(1 - p) / F^{-1}(1/2)

    Noise behind filters is as strong in every sample, so that the same holds; the fewer of a row's samples a low pass
    leaves independent, the more its median scatters, and the rate with it.

    Echoes that are stronger than the noise in a sample raise the median, and with it the threshold.

    References
    ----------
    .. [1] G. M. Brooker, "Mutual interference of millimeter-wave radar systems", IEEE Trans. Electromagn. Compat.
       49(1), 2007.
    """
    if np.ndim(adc) != 3:
        raise ParameterRangeError("adc", np.shape(adc), "(num_rx, num_chirps_total, num_samples)", "give frame.adc")
    if not 0.0 < pfa < 1.0:
        raise ParameterRangeError("pfa", pfa, "> 0 and < 1")
    if guard < 0:
        raise ParameterRangeError("guard", guard, ">= 0")
    power = np.sum(adc.real.astype(np.float64) ** 2 + adc.imag.astype(np.float64) ** 2, axis=0)
    from scipy.stats import gamma  # 0.5 s, which few need

    law = gamma(len(adc) if adc.imag.any() else 0.5 * len(adc))
    threshold = np.median(power, axis=1, keepdims=True) * law.isf(pfa) / law.median()
    found = power > threshold
    if guard and found.any():
        found = scipy.ndimage.binary_dilation(found, np.ones((1, 2 * guard + 1), dtype=bool))
    return np.asarray(found)
