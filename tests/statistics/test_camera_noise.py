"""Noise of the image sensor: moments against their closed forms, stages that can be switched off."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.camera.develop import develop, digitize, expose, full_scale, veil, white_balance
from camera_lidar.camera.tone import DAYLIGHT_EXPOSURE
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.image_sensor import ImageSensor

COUNT = 400
SHAPE = (COUNT, COUNT, 3)
N = COUNT * COUNT * 3
IDEAL = ImageSensor(shot_noise=False, read_noise=0.0, bits=16)


@pytest.mark.parametrize("level", [0.0, 0.002, 0.1, 0.9])
@pytest.mark.parametrize(("read_noise", "dark"), [(0.0, 0.0), (4.0, 0.0), (2.5, 30.0)])
def test_mean_and_variance_of_the_electrons(level: float, read_noise: float, dark: float) -> None:
    sensor = ImageSensor(saturation=2.0, full_well=10_000.0, read_noise=read_noise, dark_electrons=dark)
    electrons = expose(np.full(SHAPE, level), sensor, np.random.default_rng(7))
    mean, variance = 5_000.0 * level, 5_000.0 * level + dark + read_noise**2
    if variance == 0.0:
        assert (electrons == 0.0).all()
        return
    assert abs(electrons.mean() - mean) < 5.0 * np.sqrt(variance / N)
    # Var(s^2) = (mu4 - sigma^4) / N with mu4 of Poisson + normal: 3 sigma^4 + the Poisson part's mean
    spread = np.sqrt((2.0 * variance**2 + 5_000.0 * level + dark) / N)
    assert abs(electrons.var() - variance) < 5.0 * spread


def test_noise_stages_are_off_when_off_and_seeded_when_on() -> None:
    level = np.full((8, 8, 3), 0.3)
    quiet = expose(level, IDEAL, np.random.default_rng(0))
    assert (quiet == 0.3 / IDEAL.saturation * IDEAL.full_well).all()
    noisy = ImageSensor()
    first, again, other = (expose(level, noisy, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_a_full_well_saturates() -> None:
    sensor = ImageSensor(saturation=1.5, read_noise=0.0)
    electrons = expose(np.full((16, 16, 3), 3.0), sensor, np.random.default_rng(0))
    assert (electrons == sensor.full_well).all()
    assert (digitize(electrons, sensor) == full_scale(sensor)).all()


def test_quantization_error_is_uniform() -> None:
    sensor = IDEAL.with_(bits=6, full_well=1000.0)
    step = 1000.0 / full_scale(sensor)
    electrons = np.random.default_rng(3).uniform(10 * step, 50 * step, 300_000)
    error = digitize(electrons, sensor) * step - electrons
    assert np.abs(error).max() <= step / 2 * (1 + 1e-12)
    assert abs(error.mean()) < 5.0 * step / np.sqrt(12 * 300_000)
    # Var of the sample variance of a uniform error: step^4 / 180 / N
    assert abs(error.var() - step**2 / 12) < 5.0 * step**2 / np.sqrt(180 * 300_000)


def test_the_read_out_is_clipped_not_wrapped() -> None:
    assert digitize(np.array([-50.0, 1e9]), IDEAL).tolist() == [0, full_scale(IDEAL)]


def test_glare_spreads_light_and_keeps_it() -> None:
    image = np.zeros((101, 201, 3))
    image[50, 100] = 1000.0
    assert veil(image, 0.0) is image
    spread = veil(image, 0.1)
    assert spread.sum() == pytest.approx(image.sum(), rel=1e-3)  # the widest part, 8 px, is cut off at 4 sigma
    assert spread[50, 100, 0] == pytest.approx(900.0, rel=0.05) and spread[50, 110, 0] > 0.0


def test_white_balance() -> None:
    rng = np.random.default_rng(0)
    tinted = rng.uniform(0.0, 1.0, (64, 64, 1)) * [1.3, 1.0, 0.7]
    grey = white_balance(tinted, IDEAL.with_(white_balance="grey_world"))
    np.testing.assert_allclose(grey[..., 0], grey[..., 2], rtol=1e-12)
    np.testing.assert_allclose(grey[..., 1], tinted[..., 1], rtol=1e-12)
    gains = white_balance(tinted, IDEAL.with_(white_balance=(2.0, 1.0, 0.5)))
    np.testing.assert_allclose(gains, tinted * [2.0, 1.0, 0.5])


def test_an_ideal_sensor_gives_the_ideal_image() -> None:
    radiance = np.random.default_rng(1).uniform(0.0, 0.4, (40, 40, 3))
    ideal = develop(radiance, CameraSpec(), np.random.default_rng(0))
    through = develop(radiance, CameraSpec(sensor=IDEAL), np.random.default_rng(0))
    # 2^-16 of the full scale is below a tenth of an 8-bit step for all values above 0.001
    assert np.abs(ideal.astype(int) - through.astype(int)).max() <= 1
    assert (ideal == through).mean() > 0.98


def test_the_linear_curve_clips_at_one() -> None:
    spec = CameraSpec(sensor=IDEAL.with_(tone_curve="linear"))
    radiance = np.array([[[0.5, 1.0, 1.5]]]) / DAYLIGHT_EXPOSURE
    image = develop(radiance, spec, np.random.default_rng(0))
    assert image.tolist() == [[[188, 255, 255]]]  # sRGB of 0.5 is 187.5


def test_exposure_of_the_camera_and_of_the_light_multiply() -> None:
    radiance = np.random.default_rng(1).uniform(0.0, 0.1, (20, 20, 3))
    one = develop(radiance, CameraSpec(exposure=6.0), np.random.default_rng(0))
    both = develop(radiance, CameraSpec(exposure=2.0), np.random.default_rng(0), gain=3.0)
    assert np.array_equal(one, both)
