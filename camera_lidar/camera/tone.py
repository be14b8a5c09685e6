"""From linear radiance to 8-bit sRGB.

A fixed daylight exposure, a tone curve with a shoulder, and the sRGB encoding.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

DAYLIGHT_EXPOSURE = 4.0
"""Linear image value of a radiance of 1 at exposure 1. Mitsuba's `sunsky` emitter, at its default scale, turbidity 3
and the sun 45 deg high, gives a white horizontal diffuser the luminance 0.36; so a grey card of 18 % gets the value
0.26, half a stop above its reflectance as cameras place dark roads, and white paper is still below clipping.
docs/camera.md."""

SHOULDER_START = 0.6
"""Linear value below which the tone curve is the identity, so that all darker tones stay photometric."""


def tone_curve(linear: npt.NDArray[np.floating]) -> Array:
    r"""Compress linear values >= 0 into [0, 1): the identity up to the shoulder, then an exponential approach to 1.

    Notes
    -----
    .. math:: y = x \;(x \le s), \qquad y = 1 - (1 - s) \exp\!\left(-\frac{x - s}{1 - s}\right) \;(x > s)

    Value and slope are continuous at s = `SHOULDER_START`; the curve is strictly monotonic, so it can be undone.
    """
    start = SHOULDER_START
    over = np.maximum(linear - start, 0.0)
    return np.where(linear <= start, np.maximum(linear, 0.0), 1.0 - (1.0 - start) * np.exp(-over / (1.0 - start)))


def inverse_tone_curve(compressed: npt.NDArray[np.floating]) -> Array:
    """Undo :func:`tone_curve` for values in [0, 1)."""
    start = SHOULDER_START
    room = np.maximum(1.0 - compressed, np.finfo(np.float64).tiny)
    return np.where(compressed <= start, compressed, start - (1.0 - start) * np.log(room / (1.0 - start)))


def srgb_encode(linear: npt.NDArray[np.floating]) -> Array:
    """Return the sRGB signal of linear values in [0, 1] (IEC 61966-2-1)."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-12) ** (1.0 / 2.4) - 0.055)


def srgb_decode(signal: npt.NDArray[np.floating]) -> Array:
    """Return the linear values of an sRGB signal in [0, 1] (IEC 61966-2-1)."""
    return np.where(signal <= 0.04045, signal / 12.92, ((signal + 0.055) / 1.055) ** 2.4)


def linear_to_srgb8(radiance: npt.NDArray[np.floating], exposure: float = 1.0) -> npt.NDArray[np.uint8]:
    """Expose, compress and encode radiance.

    Parameters
    ----------
    radiance : ndarray of float, shape (..., 3)
        Linear RGB radiance in the emitters' unit; what is not finite becomes black.
    exposure : float
        Factor on the radiance, > 0; 1 is the fixed daylight exposure of `DAYLIGHT_EXPOSURE`.

    Returns
    -------
    ndarray of uint8, shape (..., 3)
        sRGB.
    """
    linear = np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0) * (exposure * DAYLIGHT_EXPOSURE)
    return np.rint(255.0 * srgb_encode(tone_curve(linear))).astype(np.uint8)


def srgb8_to_linear(image: npt.NDArray[np.uint8], exposure: float = 1.0) -> Array:
    """Return the radiance of an image made by :func:`linear_to_srgb8`, up to its 8-bit rounding.

    255 means "at least".
    """
    compressed = srgb_decode(image.astype(np.float64) / 255.0)
    return inverse_tone_curve(np.minimum(compressed, 1.0 - 1e-4)) / (DAYLIGHT_EXPOSURE * exposure)
