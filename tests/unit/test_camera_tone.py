"""From radiance to 8 bits."""

from __future__ import annotations

import numpy as np

from camera_lidar.camera.tone import (
    DAYLIGHT_EXPOSURE,
    SHOULDER_START,
    inverse_tone_curve,
    linear_to_srgb8,
    srgb8_to_linear,
    srgb_decode,
    srgb_encode,
    tone_curve,
)


def test_tone_curve_is_the_identity_below_its_shoulder_and_smooth_and_monotonic_above() -> None:
    dark = np.linspace(0.0, SHOULDER_START, 50)
    assert np.array_equal(tone_curve(dark), dark)
    step = 1e-6
    slope = (tone_curve(np.array([SHOULDER_START + step])) - SHOULDER_START) / step
    assert abs(slope[0] - 1.0) < 2e-6  # second-order term: step / (2 * (1 - start)) = 1.25e-6
    bright = tone_curve(np.linspace(0.0, 5.0, 2000))
    assert (np.diff(bright) > 0).all() and bright[-1] < 1.0


def test_tone_curve_and_srgb_can_be_undone() -> None:
    values = np.linspace(0.0, 4.0, 500)
    # rounding of 1 - y near 1, amplified by the logarithm: eps / exp(-(4 - 0.6) / 0.4) = 1e-12
    assert np.allclose(inverse_tone_curve(tone_curve(values)), values, atol=1e-11)
    signal = np.linspace(0.0, 1.0, 256)
    assert np.allclose(srgb_encode(srgb_decode(signal)), signal, atol=1e-7)  # the standard's rounded constants


def test_srgb_reference_values() -> None:
    # IEC 61966-2-1: 18 % grey is signal 0.4614; 50 % is 0.7354
    assert np.allclose(srgb_encode(np.array([0.0, 0.18, 0.5, 1.0])), [0.0, 0.4614, 0.7354, 1.0], atol=5e-5)


def test_exposure_is_a_factor_and_one_is_daylight() -> None:
    card = np.full((1, 1, 3), 0.18 / DAYLIGHT_EXPOSURE)  # linear 0.18 is sRGB 118 (IEC 61966-2-1)
    assert linear_to_srgb8(card).tolist() == [[[118, 118, 118]]]
    assert linear_to_srgb8(card / 2.0, exposure=2.0).tolist() == [[[118, 118, 118]]]


def test_not_finite_radiance_is_black_and_bright_is_white() -> None:
    image = linear_to_srgb8(np.array([[[np.nan, np.inf, 1e6], [0.0, -1.0, 0.0]]]))
    assert image.tolist() == [[[0, 0, 255], [0, 0, 0]]]


def test_eight_bits_hold_radiance_to_their_rounding() -> None:
    radiance = np.linspace(0.01, 0.2, 100) / DAYLIGHT_EXPOSURE / 0.36
    image = linear_to_srgb8(np.repeat(radiance[:, None], 3, axis=1))
    # half a step of 1/255; d ln(linear)/d(signal) <= 2.4 * 1.055 / (signal + 0.055) at signal >= 0.18 -> 2.1 %
    assert np.allclose(srgb8_to_linear(image)[:, 0], radiance, rtol=0.022)
