"""Imbalance of I and Q, and a constant at the converter."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.radar.impairments import Mixer
from scarl_sionna.core.units import dbm_to_watt


def image_factors(mixer: Mixer) -> tuple[complex, complex]:
    """Return the factors of a tone and of its image.

    References
    ----------
    .. [1] B. Razavi, *RF Microelectronics*, 2nd ed., Prentice Hall, 2011, section 4.2.
    """
    turn = 10.0 ** (mixer.iq_gain_db / 20.0) * np.exp(1j * np.radians(mixer.iq_phase_deg))
    return complex((1.0 + turn) / 2.0), complex((1.0 - turn.conjugate()) / 2.0)


def unbalance(adc: npt.NDArray[np.complexfloating], mixer: Mixer) -> npt.NDArray[np.complex64]:
    """Return the signal behind a mixer whose Q has another gain and phase than I [sqrt(W)], same shape.

    Exact: the tone and its complex conjugate, by :func:`image_factors`.
    """
    kept, image = image_factors(mixer)
    return np.asarray(kept * adc + image * np.conj(adc), dtype=np.complex64)


def add_offset(adc: npt.NDArray[np.complexfloating], dc_offset_dbm: float) -> npt.NDArray[np.complex64]:
    """Return the signal with a constant of some power, half in I and half in Q [sqrt(W)], same shape. By definition."""
    constant = np.sqrt(dbm_to_watt(dc_offset_dbm)) * np.exp(0.25j * np.pi)
    return np.asarray(adc + constant, dtype=np.complex64)


def in_phase(adc: npt.NDArray[np.complexfloating]) -> npt.NDArray[np.complex64]:
    """Return what a receiver without Q has [sqrt(W)]: I, as complex numbers without imaginary part, same shape.

    By definition: half of the signal and half of its image at the opposite frequency.
    """
    return np.asarray(np.real(adc), dtype=np.complex64)
