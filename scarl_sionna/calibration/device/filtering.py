"""The stated filters of a device as a matrix over the samples of a chirp."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.linalg

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.front_end.filters import apply_filters, filter_factor


def filter_matrix(radar: RadarSpec) -> npt.NDArray[np.complex128] | None:
    """Return what the filters make of each single sample, shape (num_samples, num_samples); None: there are none.

    Exact: filters are linear; ``chirp @ matrix`` is what :func:`apply_filters` makes of a chirp.
    """
    if radar.front_end.filters is None:
        return None
    single = np.eye(radar.num_samples, dtype=np.complex64)[None]
    return np.asarray(apply_filters(single, radar)[0], dtype=np.complex128)


def noise_matrix(radar: RadarSpec) -> npt.NDArray[np.complex128] | None:
    """Return what the filters make of each sample of white noise, (num_before, num_samples); None: there are none.

    Exact: noise stands before a chirp, too, and behind the filters it is stationary.
    """
    if radar.front_end.filters is None:
        return None
    pulse = np.fft.ifft(filter_factor(radar))
    return np.asarray(scipy.linalg.circulant(pulse).T[:, : radar.num_samples], dtype=np.complex128)
