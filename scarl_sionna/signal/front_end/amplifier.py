"""Compression of the receiver's first amplifier."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.impairments import Amplifier
from scarl_sionna.core.units import dbm_to_watt

DROP = 1.0 - 10.0 ** (-1.0 / 20.0)
"""Loss of amplitude at the 1 dB compression point."""


def compress(adc: npt.NDArray[np.complexfloating], amplifier: Amplifier) -> npt.NDArray[np.complex64]:
    """Return the signal behind an amplifier of third order, referred to its input [sqrt(W)], same shape.

    ``x (1 - DROP |x|**2 / P1dB)`` up to the input of the largest output, that output beyond. Two tones give third-order
    products with an input intercept 9.6 dB above the 1 dB compression point.

    Parameters
    ----------
    adc : ndarray of complex
        Envelope at the input [sqrt(W)]: the beat signal before all filters.
    amplifier : Amplifier

    References
    ----------
    .. [1] B. Razavi, *RF Microelectronics*, 2nd ed., Prentice Hall, 2011, section 2.2.
    """
    strength = DROP / dbm_to_watt(amplifier.p1db_dbm)
    power = np.abs(adc).astype(np.float64) ** 2
    highest = 1.0 / (3.0 * strength)
    gain = 1.0 - strength * np.minimum(power, highest)
    beyond = np.sqrt(highest / np.maximum(power, highest))
    return np.asarray(adc * (gain * beyond), dtype=np.complex64)
