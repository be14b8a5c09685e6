"""Windows of the transforms, normalised to a sum of 1, and what they do to white noise."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.signal

from scarl_sionna.core.errors import UnknownNameError

Array = npt.NDArray[np.float64]

_WINDOWS = {
    "rect": "boxcar", "hann": "hann", "hamming": "hamming", "blackman": "blackman",
    "blackmanharris": "blackmanharris", "chebyshev": ("chebwin", 80.0), "taylor": ("taylor", 4, 35),
}  # fmt: skip # a table


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
    if key not in _WINDOWS:
        raise UnknownNameError("window", key, _WINDOWS)
    if count <= 2:  # hann and others vanish at both ends
        return np.full(count, 1.0 / count)
    values = scipy.signal.get_window(_WINDOWS[key], count, fftbins=key == "rect")
    # symmetric windows that touch zero lose two samples: build them two longer and drop the zeros
    if values[0] < 1e-9:
        values = scipy.signal.get_window(_WINDOWS[key], count + 2, fftbins=False)[1:-1]
    return values / values.sum()


def noise_bandwidth(name: str | None, count: int) -> float:
    """Return the equivalent noise bandwidth of a window in bins: 1 for ``"rect"``, 1.5 for a long ``"hann"``.

    References
    ----------
    .. [1] F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform", Proc.
       IEEE 66(1), 1978.
    """
    values = window_values(name, count)
    return float(count * np.sum(values**2))
