"""The radar equation: how much of what an isotropic antenna sends a scatterer brings back to another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def spreading(wavelength: float, *distances: npt.ArrayLike) -> Array:
    r"""Return what a scattering matrix is multiplied by to become the transfer of a path.

    Parameters
    ----------
    wavelength : float
        [m].
    *distances : array_like of float, shapes that broadcast
        Legs of the path, from antenna to scatterer, from scatterer to scatterer, and back [m], > 0.

    Returns
    -------
    ndarray of float64, of the broadcast shape
        Received over incident amplitude, for scattering matrices S [m] with :math:`\sigma = 4 \pi |S|^2` at every
        scatterer.

    Notes
    -----
    .. math:: \frac{\lambda}{4 \pi} \prod_i \frac{1}{L_i}

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, Eq. (1.6).
    """
    product: Array = np.ones(())
    for distance in distances:
        product = product * np.asarray(distance, dtype=np.float64)
    return wavelength / (4.0 * np.pi) / product


def radar_gain(wavelength: float, distance: npt.ArrayLike) -> Array:
    r"""Return received over transmitted power of a monostatic radar with isotropic antennas for 1 m2 [1/m2].

    Parameters
    ----------
    wavelength : float
        [m].
    distance : array_like of float, any shape
        [m], > 0.

    Returns
    -------
    ndarray of float64, shape of `distance`
        [1/m2].

    Notes
    -----
    The radar equation is this times transmitted power, two-way antenna gain and radar cross-section:

    .. math:: P_r = P_t G^2 \sigma \frac{\lambda^2}{(4 \pi)^3 R^4}

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, Eq. (1.6).
    """
    return np.asarray(spreading(wavelength, distance, distance) ** 2 / (4.0 * np.pi))
