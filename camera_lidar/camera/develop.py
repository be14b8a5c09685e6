"""From radiance to the 8-bit image: exposure, image sensor, white balance, tone curve."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.image_sensor import ImageSensor

from .mosaic import through_mosaic
from .projection import pixel_rays
from .tone import DAYLIGHT_EXPOSURE, srgb_encode, tone_curve

Array = npt.NDArray[np.float64]

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_GLARE_WIDTH = 0.04
"""Standard deviation of the scattered light's spread, as a share of the image's width."""


def develop(
    radiance: npt.NDArray[np.floating], spec: CameraSpec, rng: np.random.Generator, gain: float = 1.0
) -> npt.NDArray[np.uint8]:
    """Return the 8-bit sRGB image of a radiance image.

    Parameters
    ----------
    radiance : ndarray of float, shape (height, width, 3)
        Linear RGB; what is not finite counts as black.
    spec : CameraSpec
    rng : numpy.random.Generator
        Draws the sensor's noise; not used without a sensor.
    gain : float
        Exposure of the lighting, a factor beside ``spec.exposure``.
    """
    clean = np.nan_to_num(np.asarray(radiance, dtype=np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    linear = np.maximum(clean, 0.0) * (gain * spec.exposure * DAYLIGHT_EXPOSURE)
    if spec.sensor is None:
        return np.rint(255.0 * srgb_encode(tone_curve(linear))).astype(np.uint8)
    linear = automatic(vignetted(linear, spec), spec.sensor)
    numbers = digitize(expose(linear, spec.sensor, rng), spec.sensor) - spec.sensor.black_level
    values = numbers.astype(np.float64) / full_scale(spec.sensor) * spec.sensor.saturation
    values = values if spec.sensor.mosaic is None else through_mosaic(values, spec.sensor.mosaic)
    balanced = white_balance(values, spec.sensor)
    curved = tone_curve(balanced) if spec.sensor.tone_curve == "shoulder" else np.clip(balanced, 0.0, 1.0)
    return np.rint(255.0 * srgb_encode(curved)).astype(np.uint8)


def expose(linear: Array, sensor: ImageSensor, rng: np.random.Generator) -> Array:
    r"""Return the electrons that are read out of the wells.

    Parameters
    ----------
    linear : ndarray of float64, shape (height, width, 3)
        Exposed linear value; ``sensor.saturation`` fills a well.

    Returns
    -------
    ndarray of float64, shape (height, width, 3)
        Electrons, the mean dark signal subtracted; below 0 where the read noise is.

    Notes
    -----
    .. math:: n \sim \min(\mathrm{Poisson}(\mu + d), N) + \mathcal N(0, \sigma_r^2) - d

    With :math:`\mu = N x / x_s`. *Moments* below saturation: mean :math:`\mu`, variance :math:`\mu + d + \sigma_r^2`.

    References
    ----------
    .. [1] EMVA Standard 1288, *Characterization of Image Sensors and Cameras*, release 4.0, section 2.
    """
    mean = veil(linear, sensor.veiling_glare) * (sensor.full_well / sensor.saturation) + sensor.dark_electrons
    electrons = rng.poisson(mean).astype(np.float64) if sensor.shot_noise else mean
    electrons = np.minimum(electrons, sensor.full_well)
    if sensor.read_noise > 0.0:
        electrons = electrons + rng.normal(0.0, sensor.read_noise, electrons.shape)
    return electrons - sensor.dark_electrons


def vignetted(linear: Array, spec: CameraSpec) -> Array:
    r"""Return the image with its light falling towards the corners: :math:`1 - v (1 - \cos^4 \theta)`.

    Theta is the angle to the optical axis; the law of thin lenses without glass that makes up for it.
    """
    share = 0.0 if spec.sensor is None else spec.sensor.vignetting
    if share == 0.0:
        return linear
    cosine = np.nan_to_num(pixel_rays(spec)[:, 0].reshape(linear.shape[:2]), nan=0.0)
    return np.asarray(linear * (1.0 - share * (1.0 - np.maximum(cosine, 0.0) ** 4))[..., None])


def automatic(linear: Array, sensor: ImageSensor) -> Array:
    """Return the image exposed so that its mean luminance is the sensor's `auto_exposure`; a black one stays."""
    mean = float(linear.mean(axis=(0, 1)) @ _LUMINANCE)
    if sensor.auto_exposure is None or mean <= 0.0:
        return linear
    return linear * (sensor.auto_exposure / mean)


def veil(linear: Array, share: float) -> Array:
    """Return an image of which a share of the light is spread widely by the optics.

    The mean stays (but at the border).
    """
    if share == 0.0:
        return linear
    from scipy.ndimage import gaussian_filter

    width = _GLARE_WIDTH * linear.shape[1]
    spread = sum(gaussian_filter(linear, (width * k, width * k, 0.0), mode="nearest") for k in (0.1, 0.3, 1.0))
    return (1.0 - share) * linear + share / 3.0 * spread


def full_scale(sensor: ImageSensor) -> int:
    """Return the converter's largest number."""
    return (1 << sensor.bits) - 1


def digitize(electrons: Array, sensor: ImageSensor) -> npt.NDArray[np.int64]:
    """Return the converter's numbers, 0 to :func:`full_scale`; a uniform step adds the variance step^2 / 12.

    The black level is in them.
    """
    scale = full_scale(sensor)
    return np.clip(np.rint(electrons * (scale / sensor.full_well)) + sensor.black_level, 0, scale).astype(np.int64)


def white_balance(linear: Array, sensor: ImageSensor) -> Array:
    """Return the image with the gains of its channels; grey world: equal means, that of green kept."""
    if sensor.white_balance == "none":
        return linear
    if sensor.white_balance == "grey_world":
        means = np.maximum(linear.reshape(-1, 3).mean(axis=0), 1e-12)
        return linear * (means[1] / means)
    return linear * np.asarray(sensor.white_balance)
