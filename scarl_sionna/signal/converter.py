"""Analogue-to-digital conversion: beat signal [sqrt(W)] in, int16 steps out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.fft

from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import dbm_to_watt

_TOGETHER = 1 << 15
"""Samples that are converted in one piece: what the processor's cache holds, changes no result."""


def step_size(radar: RadarSpec) -> float:
    """Return the value of one converter step [sqrt(W)]: a tone of full-scale power just reaches the largest code.

    By definition of full scale.
    """
    return float(np.sqrt(dbm_to_watt(radar.adc.full_scale_dbm)) / (2 ** (radar.adc.bits - 1) - 1))


def converter_noise_power(radar: RadarSpec) -> float:
    """Return the noise that a converter adds to its quantisation, I and Q together [W].

    As much as lowers the ratio of a full-scale tone to noise and quantisation to ``6.02 enob + 1.76`` dB; 0 if `enob`
    is not given or above `bits`.

    References
    ----------
    .. [1] IEEE Std 1241, *IEEE Standard for Terminology and Test Methods for Analog-to-Digital Converters*.
    """
    if radar.adc.enob is None:
        return 0.0
    full_scale = dbm_to_watt(radar.adc.full_scale_dbm)
    return max(0.0, full_scale / (1.5 * 4.0**radar.adc.enob) - step_size(radar) ** 2 / 6.0)


def bow(values: npt.NDArray[np.float64], radar: RadarSpec) -> npt.NDArray[np.float64]:
    """Return values in steps with the converter's nonlinearity added: a cubic, 0 at the middle and both ends.

    Its peak is `inl_lsb`, at 1 / sqrt(3) of full scale; the third harmonic of a full-scale tone is ``0.65 inl_lsb``.

    By definition of the cubic.
    """
    if not radar.adc.inl_lsb:
        return values
    share = np.clip(values / (2 ** (radar.adc.bits - 1) - 1), -1.0, 1.0)
    return np.asarray(values + radar.adc.inl_lsb * 1.5 * np.sqrt(3.0) * (share - share**3))


def decimation(radar: RadarSpec, share: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the amplitude that the converter's decimation leaves at shares of the sample rate, any shape.

    `Adc.response`: gains in decibels, linear between its points. Periodic, since samples tell frequencies apart modulo
    the sample rate; 1 where none is stated.
    """
    if not radar.adc.response:
        return np.ones(np.shape(share))
    places, gain_db = np.transpose(radar.adc.response)
    return np.asarray(10.0 ** (np.interp(np.asarray(share, dtype=np.float64), places, gain_db, period=1.0) / 20.0))


def quantize(
    adc: npt.NDArray[np.complexfloating], radar: RadarSpec, rng: np.random.Generator | None = None
) -> tuple[npt.NDArray[np.int16], float, int]:
    """Return the signal as the radar's converter gives it.

    Parameters
    ----------
    adc : ndarray of complex, shape (..., num_samples)
        Beat signal [sqrt(W)].
    radar : RadarSpec
        Its converter has `bits` of each of I and Q; a tone of `full_scale_dbm` spans the whole range.
    rng : numpy.random.Generator, optional
        Of the converter's own noise, where `enob` gives some; left out: none.

    Returns
    -------
    codes : ndarray of int16, shape (..., 2)
        I and Q, rounded to the nearest step and clipped to ``-2**(bits-1) .. 2**(bits-1) - 1``; Q is 0 where only I is
        sampled.
    scale : float
        Value of one step [sqrt(W)]; ``codes * scale`` is the signal again.
    num_saturated : int
        I and Q values that were clipped.

    Notes
    -----
    Without clipping the error of I and of Q is uniform in +- half a step: its power is ``scale**2 / 6`` in all.

    The noise of `enob` arises before the decimation, so `response` shapes it as it shapes the signal, as if each row
    went on periodically; a filter that runs on differs over its own length at both ends.

    References
    ----------
    .. [1] W. R. Bennett, "Spectra of quantized signals", Bell Syst. Tech. J. 27(3), 1948.
    """
    signal = np.ascontiguousarray(adc, dtype=np.complex64)
    rows = signal.reshape(int(np.prod(signal.shape[:-1])), signal.shape[-1])
    codes, highest = np.empty((*rows.shape, 2), dtype=np.int16), 2 ** (radar.adc.bits - 1) - 1
    together, num_saturated = max(1, _TOGETHER // max(1, rows.shape[1])), 0
    for first in range(0, len(rows), together):
        block = slice(first, first + together)
        steps = _steps(rows[block], radar, rng)
        clipped = np.clip(steps, -highest - 1, highest)
        codes[block] = clipped
        num_saturated += int(np.count_nonzero(clipped != steps))
    return codes.reshape(*signal.shape, 2), step_size(radar), num_saturated


def _steps(
    rows: npt.NDArray[np.complex64], radar: RadarSpec, rng: np.random.Generator | None
) -> npt.NDArray[np.float64]:
    """Return I and Q of rows of samples in whole steps, not clipped, shape (num_rows, num_samples, 2)."""
    # float64: scaled float32 could round 32767.4999 up and count it as clipped
    values = rows[..., None].view(np.float32).astype(np.float64)
    extra = converter_noise_power(radar) if rng is not None else 0.0
    if rng is not None and extra > 0.0:
        values += rng.normal(0.0, np.sqrt(0.5 * extra), values.shape)
    if radar.adc.response:
        gain = decimation(radar, np.arange(values.shape[-2]) / values.shape[-2])
        shaped = scipy.fft.ifft(scipy.fft.fft(values.view(np.complex128)[..., 0], axis=-1) * gain, axis=-1)
        values = np.ascontiguousarray(shaped)[..., None].view(np.float64)
    steps = np.rint(bow(values / step_size(radar), radar))
    if radar.adc.is_real:
        steps[..., 1] = 0.0
    return steps
