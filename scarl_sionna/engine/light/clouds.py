"""Clouds: how they look from below, and how much light of sky and sun they let through to level ground.

References
----------
.. [1] F. Kasten, G. Czeplak, "Solar and terrestrial radiation dependent on the amount and type of cloud", Solar Energy
   24, 1980: global radiation 1 - 0.75 N^3.4 of the clear sky's, diffuse share of it 0.3 + 0.7 N^2, for a share N of the
   sky covered (ten years of hourly sums, Hamburg).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

COVER_EXPONENT = 3.4
"""Of the global radiation in the cloud cover [1]_."""
DIFFUSE_EXPONENT = 2.0
"""Of the diffuse share of the global radiation in the cloud cover [1]_."""
_CLOSING = 0.8
"""Cloud cover from which the gaps close: broken clouds turn into the even layer of the overcast sky."""

_SEED = 20
_NOISE_SIZE = 1024
_NOISE_PERIOD = 9.0
"""Side of the noise's tile in heights of the cloud layer."""


class CloudedLight(NamedTuple):
    """What reaches level ground: illuminance of the sky [lx], and the share of the clear sun's direct light."""

    sky: float
    sun_share: float


def through_clouds(cover: float, sky: float, sun: float, overcast: float) -> CloudedLight:
    r"""Return the light of sky and sun under clouds.

    Parameters
    ----------
    cover : float
        Share of the sky with clouds, N.
    sky, sun : float
        Illuminance of level ground by the clear sky and by the unhidden sun [lx].
    overcast : float
        Illuminance of level ground under the overcast sky [lx].

    Returns
    -------
    CloudedLight

    Notes
    -----
    Kasten and Czeplak's laws [1]_ with the ends of our own clear and overcast sky in place of theirs (0.75; 0.3):

    .. math:: G = G_0 - (G_0 - G_1) N^{3.4}, \quad D / G = f_0 + (1 - f_0) N^2, \quad f_0 = D_0 / G_0

    Means over time: in nature the sun is there or not. *Error*: single hours scatter by a factor of two.
    """
    clear = sky + sun
    if clear <= 0.0:
        return CloudedLight(overcast * cover**COVER_EXPONENT, 0.0)
    total = clear - (clear - overcast) * cover**COVER_EXPONENT
    diffuse = sky / clear + sun / clear * cover**DIFFUSE_EXPONENT
    return CloudedLight(total * diffuse, total * (1.0 - diffuse) / sun if sun > 0.0 else 0.0)


def broken_clouds(sky: Array, layer: Array, sun_irradiance: Array, cover: float, directions: Array) -> Array:
    """Return the radiance of a sky with clouds before it is scaled to the light that they let through.

    Parameters
    ----------
    sky, layer : ndarray of float64, shape (rows, columns, 3)
        Radiance of the clear and of the overcast sky.
    sun_irradiance : ndarray of float64, shape (3,)
        Of a surface that faces the sun.
    cover : float
        Above 0, below 1.
    directions : ndarray of float64, shape (rows, columns, 3)
        Unit vectors, z up.
    """
    opacity, shade = _opacity(directions, cover)
    lit = sun_irradiance * 0.55 / np.pi + 0.6 * layer  # white clouds: reflect most of the sunlight
    dark = layer * 0.9 + 0.12 * sun_irradiance / np.pi
    cloud = shade[..., None] * lit + (1.0 - shade[..., None]) * dark
    clouded = (1.0 - opacity[..., None]) * sky + opacity[..., None] * cloud
    closed = float(np.clip((cover - _CLOSING) / (1.0 - _CLOSING), 0.0, 1.0))
    if closed == 0.0:
        return clouded
    return (1.0 - closed) * clouded + closed * layer * mottling(directions)[..., None]


def mottling(directions: Array) -> Array:
    """Return the relative brightness of the overcast sky's patches, mean about 1."""
    return np.asarray(np.clip(1.0 + 0.10 * _noise(directions)[0], 0.6, 1.4))


def _noise(directions: Array) -> tuple[Array, Array]:
    """Return two fields of fractal noise, mean 0, variance 1, on a level layer above; flattened to the horizon."""
    from scipy.ndimage import map_coordinates

    place = directions[..., :2] / (np.maximum(directions[..., 2], 0.0) + 0.05)[..., None]
    where = np.moveaxis(place, -1, 0) * (_NOISE_SIZE / _NOISE_PERIOD)
    first, second = (map_coordinates(_tile(seed), where, order=1, mode="grid-wrap") for seed in (_SEED, _SEED + 1))
    return first, second


@lru_cache(maxsize=2)
def _tile(seed: int) -> Array:
    """Return a tile of fractal noise, mean 0, variance 1."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((_NOISE_SIZE, _NOISE_SIZE)))
    waves = np.hypot(np.fft.fftfreq(_NOISE_SIZE)[:, None], np.fft.rfftfreq(_NOISE_SIZE)[None, :]) * _NOISE_SIZE
    spectrum *= np.where(waves >= 2.0, np.maximum(waves, 1.0) ** -1.75, 0.0)
    tile = np.fft.irfft2(spectrum, s=(_NOISE_SIZE, _NOISE_SIZE))
    return np.asarray(tile / tile.std())


def _opacity(directions: Array, cover: float) -> tuple[Array, Array]:
    """Return opacity and sunlit share of broken clouds."""
    from scipy.special import erfinv

    noise, detail = _noise(directions)
    level = float(np.sqrt(2.0) * erfinv(1.0 - 2.0 * cover))  # a share `cover` of a normal field lies above
    thickness = noise + 0.25 * detail - level
    opacity = 1.0 - np.exp(-2.2 * np.clip(thickness, 0.0, None) ** 1.3)
    shade = np.clip(1.0 - 0.55 * np.clip(thickness, 0.0, 1.6) + 0.12 * detail, 0.15, 1.0)
    fade = np.clip(directions[..., 2] / 0.05, 0.0, 1.0)
    return opacity * fade, shade
