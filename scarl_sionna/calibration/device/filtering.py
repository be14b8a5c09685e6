"""The stated filters of a device as a matrix over the samples of a chirp."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.signal.front_end.filters import apply_filters


def filter_matrix(radar: RadarSpec) -> npt.NDArray[np.complex128] | None:
    """Return what the filters make of each single sample, shape (num_samples, num_samples); None: there are none.

    Exact: filters are linear; ``chirp @ matrix`` is what :func:`apply_filters` makes of a chirp.
    """
    if radar.front_end.filters is None:
        return None
    single = np.eye(radar.num_samples, dtype=np.complex64)[None]
    return np.asarray(apply_filters(single, radar)[0], dtype=np.complex128)
