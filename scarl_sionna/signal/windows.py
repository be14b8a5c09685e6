"""Windows of the transforms, normalised to a sum of 1, and what they do to white noise."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import UnknownNameError

Array = npt.NDArray[np.float64]

_COSINES = {
    "rect": (1.0,), "hann": (0.5, 0.5), "hamming": (0.54, 1.0 - 0.54), "blackman": (0.42, 0.5, 0.08),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
}  # fmt: skip # a table
"""Amplitudes of the cosines whose sum a window is."""
_OTHERS = {"chebyshev": ("chebwin", 80.0), "taylor": ("taylor", 4, 35)}


def window_values(name: str | None, count: int) -> Array:
    """Return a window symmetric about its middle whose values sum to 1, shape (count,); None is ``"rect"``.

    Raises
    ------
    UnknownNameError
        If the name is not known.

    References
    ----------
    .. [1] F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
       IEEE 66(1), 1978.
    """
    key = "rect" if name is None else name
    if key not in _COSINES and key not in _OTHERS:
        raise UnknownNameError("window", key, {**_COSINES, **_OTHERS})
    if count <= 2:  # hann and others vanish at both ends
        return np.full(count, 1.0 / count)
    values = _symmetric(key, count)
    # symmetric windows that touch zero lose two samples: build them two longer and drop the zeros
    if values[0] < 1e-9:
        values = _symmetric(key, count + 2)[1:-1]
    return values / values.sum()


def _symmetric(key: str, count: int) -> Array:
    if key in _OTHERS:
        from scipy.signal import get_window  # 0.7 s, which other windows need not wait for

        return np.asarray(get_window(_OTHERS[key], count, fftbins=False))
    phase = np.linspace(-np.pi, np.pi, count)
    values = np.zeros(count)
    for k, amplitude in enumerate(_COSINES[key]):
        values += amplitude * np.cos(k * phase)
    return values


def noise_bandwidth(name: str | None, count: int) -> float:
    """Return the equivalent noise bandwidth of a window in bins: 1 for ``"rect"``, 1.5 for a long ``"hann"``.

    References
    ----------
    .. [1] F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
       IEEE 66(1), 1978.
    """
    values = window_values(name, count)
    return float(count * np.sum(values**2))
