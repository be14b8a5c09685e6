"""Directions by subspaces, of a uniform line: MUSIC and ESPRIT on smoothed subarrays of a single snapshot."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT

from ..angle import UniformLine, uniform_line

Array = npt.NDArray[np.float64]
Phasors = npt.NDArray[np.complex128]

LEAST_ELEMENTS = 3


def line_of(radar: RadarSpec, method: str) -> UniformLine:
    """Return the uniform line that a method needs.

    Raises
    ------
    ParameterRangeError
        If the virtual array is none, or has fewer than three elements.
    """
    line = uniform_line(radar)
    if line is None or len(line.order) < LEAST_ELEMENTS:
        raise ParameterRangeError(
            "direction",
            f"{method!r} for a virtual array that is no uniform line of {LEAST_ELEMENTS} elements or more along y",
            "'relax', 'omp' or 'bartlett', which hold for any array",
        )
    return line


def subarray(num_elements: int) -> int:
    """Return the length of the subarrays: two thirds of the elements, of which there are a third, and their mirrors.

    References
    ----------
    .. [1] S. U. Pillai, B. H. Kwon, "Forward/backward spatial smoothing techniques for coherent signal
       identification", IEEE Trans. Acoust. Speech Signal Process. 37(1), 1989.
    """
    return num_elements - num_elements // 3


def most_directions(num_elements: int) -> int:
    """Return how many directions the subarrays can tell: fewer than their elements, no more than smoothed vectors.

    By definition of :func:`subarray`.
    """
    return min(subarray(num_elements) - 1, 2 * (num_elements // 3 + 1))


def smoothed(snapshot: Phasors) -> Phasors:
    """Return covariances (n, m, m) of the subarrays of snapshots (n, num_elements), forward and backward [W].

    References
    ----------
    .. [1] S. U. Pillai, B. H. Kwon, "Forward/backward spatial smoothing techniques for coherent signal
       identification", IEEE Trans. Acoust. Speech Signal Process. 37(1), 1989.
    """
    parts = np.lib.stride_tricks.sliding_window_view(snapshot, subarray(snapshot.shape[1]), axis=1)
    forward = np.einsum("npi,npj->nij", parts, np.conj(parts))
    return np.asarray((forward + np.conj(forward[:, ::-1, ::-1])) / (2.0 * parts.shape[1]))


def music(vectors: Phasors, count: int) -> Array:
    r"""Return the phases (n, count) from element to element [rad] at which steering vectors leave the noise's subspace.

    Parameters
    ----------
    vectors : ndarray of complex128, shape (n, m, m)
        Eigenvectors of covariances, of rising eigenvalues.
    count : int
        Directions.

    Returns
    -------
    ndarray of float64, shape (n, count)

    Notes
    -----
    MUSIC's spectrum of a uniform line is a polynomial; its roots nearest to the unit circle are the peaks, without a
    grid (root-MUSIC).

    References
    ----------
    .. [1] R. O. Schmidt, "Multiple emitter location and signal parameter estimation", IEEE Trans. Antennas Propag.
       34(3), 1986.
    .. [2] A. J. Barabell, "Improving the resolution performance of eigenstructure-based direction-finding algorithms",
       IEEE ICASSP 1983.
    """
    noise = vectors[:, :, : vectors.shape[1] - count]
    projector = np.einsum("nik,njk->nij", noise, np.conj(noise))
    size = projector.shape[1]
    sums = [np.trace(projector, offset=lag, axis1=1, axis2=2) for lag in range(size - 1, -size, -1)]
    polynomial = np.stack(sums, axis=1)
    companion = np.zeros((len(vectors), 2 * size - 2, 2 * size - 2), dtype=np.complex128)
    companion[:, 0, :] = -polynomial[:, 1:] / polynomial[:, :1]
    companion[:, np.arange(1, 2 * size - 2), np.arange(2 * size - 3)] = 1.0
    roots = np.linalg.eigvals(companion)
    away = np.where(np.abs(roots) <= 1.0, 1.0 - np.abs(roots), np.inf)  # they come in pairs, z and 1 / conj(z)
    nearest = np.argsort(away, axis=1)[:, :count]
    return np.asarray(np.angle(np.take_along_axis(roots, nearest, axis=1)))


def esprit(vectors: Phasors, count: int) -> Array:
    """Return the phases (n, count) from element to element [rad] that turn a line into its neighbour, a step further.

    Parameters
    ----------
    vectors : ndarray of complex128, shape (n, m, m)
        Eigenvectors of covariances, of rising eigenvalues.
    count : int
        Directions.

    Returns
    -------
    ndarray of float64, shape (n, count)

    Notes
    -----
    Total least squares.

    References
    ----------
    .. [1] R. Roy, T. Kailath, "ESPRIT: estimation of signal parameters via rotational invariance techniques", IEEE
       Trans. Acoust. Speech Signal Process. 37(7), 1989.
    """
    signal = vectors[:, :, vectors.shape[1] - count :]
    both = np.concatenate([signal[:, :-1], signal[:, 1:]], axis=2)
    _, _, right = np.linalg.svd(both, full_matrices=True)
    free = np.conj(np.swapaxes(right, 1, 2))[:, :, count:]
    turn = -np.linalg.solve(
        np.swapaxes(free[:, count:], 1, 2), np.swapaxes(free[:, :count], 1, 2)
    )  # transposed: the same eigenvalues
    return np.asarray(np.angle(np.linalg.eigvals(turn)))


KINDS: dict[str, Callable[[Phasors, int], Array]] = {"music": music, "esprit": esprit}


def subspace_sines(radar: RadarSpec, snapshot: Phasors, count: int, method: str) -> Array:
    """Return the sines (n, count, 2) of azimuth, and 0, of the directions of snapshots (n, num_virtual).

    Plane waves; a line whose elements are more than half a wavelength apart tells them modulo wavelength over spacing.

    References
    ----------
    .. [1] H. L. Van Trees, *Optimum Array Processing*, 2002, chapter 9.
    """
    line = line_of(radar, method)
    _, vectors = np.linalg.eigh(smoothed(snapshot[:, line.order]))
    phase = KINDS[method](vectors, count)
    wavelength = SPEED_OF_LIGHT / radar.center_frequency
    out = np.zeros((len(snapshot), count, 2))
    out[..., 0] = np.clip(-phase * wavelength / (2.0 * np.pi * line.spacing), -1.0, 1.0)
    return out
