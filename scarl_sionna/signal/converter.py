"""Analogue-to-digital conversion: beat signal [sqrt(W)] in, int16 steps out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt


def step_size(radar: RadarSpec) -> float:
    """Return the value of one converter step [sqrt(W)]: a tone of full-scale power just reaches the largest code.

    By definition of full scale.
    """
    return float(np.sqrt(dbm_to_watt(radar.adc.full_scale_dbm)) / (2 ** (radar.adc.bits - 1) - 1))


def quantize(adc: npt.NDArray[np.complexfloating], radar: RadarSpec) -> tuple[npt.NDArray[np.int16], float, int]:
    """Return the signal as the radar's converter gives it.

    Parameters
    ----------
    adc : ndarray of complex, any shape
        Beat signal [sqrt(W)].
    radar : RadarSpec
        Its converter has `bits` of each of I and Q; a tone of `full_scale_dbm` spans the whole range.

    Returns
    -------
    codes : ndarray of int16, shape (..., 2)
        I and Q, rounded to the nearest step and clipped to ``-2**(bits-1) .. 2**(bits-1) - 1``.
    scale : float
        Value of one step [sqrt(W)]; ``codes * scale`` is the signal again.
    num_saturated : int
        I and Q values that were clipped.

    Notes
    -----
    Without clipping the error of I and of Q is uniform in +- half a step: its power is ``scale**2 / 6`` in all.

    References
    ----------
    .. [1] W. R. Bennett, "Spectra of quantized signals", Bell Syst. Tech. J. 27(3), 1948.
    """
    scale = step_size(radar)
    highest = 2 ** (radar.adc.bits - 1) - 1
    # float64: scaled float32 could round 32767.4999 up and count it as clipped
    values = np.ascontiguousarray(adc, dtype=np.complex64)[..., None].view(np.float32).astype(np.float64)
    steps = np.rint(values / scale)
    codes = np.clip(steps, -highest - 1, highest)
    return codes.astype(np.int16), scale, int(np.count_nonzero(codes != steps))
