"""Stages of the image sensor that are off by default: vignetting, automatic exposure, black level, mosaic."""

from __future__ import annotations

import numpy as np
import pytest

from camera_lidar.camera.develop import automatic, develop, digitize, expose, vignetted
from camera_lidar.camera.mosaic import filters, through_mosaic
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.specs.camera import CameraSpec, ImageSensor

QUIET = ImageSensor(shot_noise=False, read_noise=0.0, bits=16)


def test_vignetting_is_the_fourth_power_of_the_cosine() -> None:
    spec = CameraSpec(width=41, height=31, horizontal_fov_deg=100.0, sensor=QUIET.with_(vignetting=0.7))
    image = vignetted(np.ones((31, 41, 3)), spec)
    focal = 20.5 / np.tan(np.radians(50.0))
    column, row = np.meshgrid(np.arange(41) + 0.5 - 20.5, np.arange(31) + 0.5 - 15.5)
    cosine = focal / np.sqrt(focal**2 + column**2 + row**2)
    np.testing.assert_allclose(image[..., 1], 1.0 - 0.7 * (1.0 - cosine**4), rtol=1e-9)
    plain = np.ones((31, 41, 3))
    assert vignetted(plain, spec.with_(sensor=QUIET)) is plain


def test_automatic_exposure_reaches_its_mean_whatever_the_light() -> None:
    light = np.random.default_rng(0).uniform(0.0, 1.0, (20, 30, 3))
    sensor = QUIET.with_(auto_exposure=0.18)
    for scale in (1e-5, 1.0, 1e3):
        mean = automatic(light * scale, sensor).mean(axis=(0, 1)) @ [0.2126, 0.7152, 0.0722]
        assert mean == pytest.approx(0.18, rel=1e-12)
    assert automatic(light, QUIET) is light and automatic(0.0 * light, sensor).max() == 0.0
    bright, dim = (develop(light * s, CameraSpec(sensor=sensor), np.random.default_rng(0)) for s in (1.0, 0.01))
    assert np.array_equal(bright, dim)


def test_a_black_level_keeps_the_mean_of_the_dark() -> None:
    dark = np.zeros((200, 200, 3))
    sensor = ImageSensor(read_noise=8.0, full_well=4095.0, bits=12)
    electrons = expose(dark, sensor, np.random.default_rng(1))
    cut = digitize(electrons, sensor)
    kept = digitize(electrons, sensor.with_(black_level=64)) - 64
    error = np.sqrt((64.0 + 1.0 / 12.0) / dark.size)
    assert abs(kept.mean()) < 5.0 * error
    assert cut.mean() == pytest.approx(8.0 / np.sqrt(2.0 * np.pi), rel=0.02)  # half a normal distribution
    assert np.array_equal(np.maximum(kept, 0), cut)
    with pytest.raises(ParameterRangeError, match="black_level"):
        ImageSensor(bits=8, black_level=255)


@pytest.mark.parametrize("mosaic", ["rggb", "bggr", "grbg", "gbrg"])
def test_a_mosaic_is_exact_for_linear_images_and_uses_one_colour_a_pixel(mosaic: str) -> None:
    row, column = np.mgrid[:12, :16].astype(float)
    image = np.stack([1.0 + 2.0 * row + column, 5.0 - row, 3.0 * column - 0.5 * row], axis=-1)
    np.testing.assert_allclose(through_mosaic(image, mosaic)[1:-1, 1:-1], image[1:-1, 1:-1], rtol=1e-12, atol=1e-12)
    color = filters((12, 16), mosaic)
    assert "".join("rgb"[index] for index in color[:2, :2].ravel()) == mosaic
    spoilt = np.where(color[..., None] == np.arange(3), image, 1e6)
    np.testing.assert_array_equal(through_mosaic(spoilt, mosaic), through_mosaic(image, mosaic))


def test_stages_are_off_by_default_and_each_changes_the_image() -> None:
    light = np.random.default_rng(3).uniform(0.0, 0.2, (24, 32, 3))
    spec = CameraSpec(width=32, height=24, sensor=ImageSensor())
    plain = develop(light, spec, np.random.default_rng(0))
    off = ImageSensor(vignetting=0.0, auto_exposure=None, black_level=0, mosaic=None)
    assert np.array_equal(plain, develop(light, spec.with_(sensor=off), np.random.default_rng(0)))
    for change in ({"vignetting": 1.0}, {"auto_exposure": 0.3}, {"mosaic": "rggb"}):
        other = develop(light, spec.with_(sensor=ImageSensor(**change)), np.random.default_rng(0))
        assert not np.array_equal(plain, other)
