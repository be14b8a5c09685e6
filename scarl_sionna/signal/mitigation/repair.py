"""What stands in the place of samples that other radars hit: nothing, or what the others predict."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt
import scipy.linalg

from scarl_sionna.core.errors import ParameterRangeError

Complex = npt.NDArray[np.complex128]

MAX_WINDOWS = 60_000
"""Clean stretches of samples from which the prediction is learnt, at most: enough for 10^-2 of its coefficients."""


def mitigate(
    adc: npt.NDArray[np.complexfloating],
    hit: npt.NDArray[np.bool_],
    method: Literal["zero", "predict"] = "zero",
    order: int = 32,
) -> npt.NDArray[np.complex64]:
    r"""Return raw data without the samples that other radars hit.

    Parameters
    ----------
    adc : ndarray of complex, shape (num_rx, num_chirps_total, num_samples)
        Raw data [sqrt(W)].
    hit : ndarray of bool, shape (num_chirps_total, num_samples)
        Samples to replace: a frame's `interference_hit`, or :func:`find_hits`.
    method : {"zero", "predict"}
        ``"zero"``: by zero. ``"predict"``: by what an autoregressive model of the other samples says.
    order : int
        Of that model, not charted: above twice the number of strong echoes.

    Returns
    -------
    ndarray of complex64, same shape as `adc`
        [sqrt(W)]

    Raises
    ------
    ParameterRangeError
        If shapes do not fit, the method is unknown, or there are too few clean samples in a row for the order.

    Notes
    -----
    Zeros take the share rho of a tone's amplitude and of the noise's power: its peak falls by :math:`(1 - \rho)^2`, the
    noise by :math:`1 - \rho`, and gaps at one place in all chirps widen the response over range.

    One prediction-error filter is learnt by least squares from clean stretches of all rows and receivers (covariance
    method), since echoes are tones over fast time in all of them. Missing samples are those that make its output
    smallest: Janssen's interpolation. Tones go on through the gap; noise does not, beyond the filter's memory.

    References
    ----------
    .. [1] A. J. E. M. Janssen, R. N. J. Veldhuis, L. B. Vries, "Adaptive interpolation of discrete-time signals that
       can be modeled as autoregressive processes", IEEE Trans. Acoust., Speech, Signal Process. 34(2), 1986.
    """
    if np.ndim(adc) != 3 or np.shape(hit) != np.shape(adc)[1:]:
        allowed = "(num_rx, num_chirps_total, num_samples) and (num_chirps_total, num_samples)"
        raise ParameterRangeError("adc, hit", f"{np.shape(adc)}, {np.shape(hit)}", allowed)
    if method not in ("zero", "predict"):
        raise ParameterRangeError("method", repr(method), "'zero' or 'predict'")
    out = np.array(adc, dtype=np.complex64)
    out[:, hit] = 0.0
    if method == "zero" or not hit.any():
        return out
    if not 1 <= order < adc.shape[2]:
        raise ParameterRangeError("order", order, f">= 1 and < {adc.shape[2]} samples")
    gram = _gram(_error_filter(np.asarray(adc), hit, order), adc.shape[2])
    for row in np.flatnonzero(hit.any(axis=1) & ~hit.all(axis=1)):
        gone, left = np.flatnonzero(hit[row]), np.flatnonzero(~hit[row])
        known = out[:, row, left].astype(np.complex128).T
        found = scipy.linalg.solve(gram[np.ix_(gone, gone)], -gram[np.ix_(gone, left)] @ known, assume_a="pos")
        out[:, row, gone] = found.T
    return out


def _error_filter(adc: npt.NDArray[np.complexfloating], hit: npt.NDArray[np.bool_], order: int) -> Complex:
    """Return the filter whose output over clean samples is smallest, its first value 1, shape (order + 1,)."""
    windows = np.lib.stride_tricks.sliding_window_view(hit, order + 1, axis=1)
    row, start = np.nonzero(~windows.any(axis=2))
    count = len(row) * len(adc)
    if count < 4 * order:
        raise ParameterRangeError(
            "hit", f"{count} clean stretches of {order + 1} samples", f">= {4 * order} of them", "take a lower order"
        )
    step = max(1, count // MAX_WINDOWS)
    rx, which = np.divmod(np.arange(0, count, step), len(row))
    stretch = adc[rx[:, None], row[which][:, None], start[which][:, None] + np.arange(order, -1, -1)]
    stretch = stretch.astype(np.complex128)
    covariance = stretch.conj().T @ stretch
    ridge = 1e-9 * float(np.trace(covariance).real) / (order + 1)
    past = covariance[1:, 1:] + ridge * np.eye(order)
    return np.concatenate([[1.0], -scipy.linalg.solve(past, covariance[1:, 0], assume_a="pos")])


def _gram(error: Complex, count: int) -> Complex:
    """Return the square of the filter's matrix over a row, shape (count, count)."""
    missing = np.zeros(count - len(error))
    matrix = scipy.linalg.toeplitz(np.r_[error[-1], missing], np.r_[error[::-1], missing])
    return np.asarray(matrix.conj().T @ matrix + 1e-12 * np.eye(count))
