"""Radiance of the sky with clouds, at twilight and at night, for an environment map.

One unit of radiance of the scenes is `UNIT_LUMINANCE` cd/m2: under Mitsuba's `sunsky` (turbidity 3, sun 45 deg high) a
white horizontal diffuser has the radiance 0.36, and in nature 80.8 klx [1]_ fall on it.

References
----------
.. [1] Illuminating Engineering Society, *Recommended Practice for the Calculation of Daylight Availability*, RP-21,
   1984: clear sky 127.5 exp(-0.21 m) klx (normal) from the sun and 0.8 + 15.5 sqrt(sin h) from the sky, overcast 0.3 +
   21 sin h klx.
.. [2] CIE S 011, *Spatial Distribution of Daylight - CIE Standard General Sky*, 2003: overcast (1 + 2 sin g) / 3.
.. [3] *Explanatory Supplement to the Astronomical Almanac*, 1992, section 9.3: illuminance at twilight.
"""

from __future__ import annotations

from types import ModuleType

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.device import Device
from scarl_sionna.engine.types import MitsubaObject

from .clouds import CloudedLight, broken_clouds, mottling, through_clouds

Array = npt.NDArray[np.float64]

UNIT_LUMINANCE = 80.8e3 / np.pi / 0.36
"""Luminance of the radiance 1 [cd/m2]."""

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
"""Of linear sRGB (IEC 61966-2-1)."""

SKY_SIZE = (768, 1536)
"""Rows (zenith to nadir) and columns of the environment map."""

_TWILIGHT_DEG = np.array([-18.0, -12.0, -6.0, -3.0, -0.8, 0.0])
_TWILIGHT_LUX = np.array([6.5e-4, 8.3e-3, 3.4, 60.0, 450.0, 700.0])
"""Illuminance of the clear sky on level ground [3]."""

_ABOVE_THE_AIR_LUX = 127.5e3
"""Illuminance across the sun's rays above the air [1]."""

_CLOUD_GREY = np.array([0.95, 1.0, 1.07])

LOWEST_SUN_DEG = 1.0
"""With a lower sun the sky keeps the look that it has here: Mitsuba's model has no twilight, and is black at 0 deg."""


def twilight_factor(elevation_deg: float) -> float:
    """Return the brightness of the clear sky relative to that at sunset; 1 while the sun is up, 0 below -18 deg."""
    if elevation_deg >= 0.0:
        return 1.0
    if elevation_deg <= _TWILIGHT_DEG[0]:
        return 0.0
    return float(np.exp(np.interp(elevation_deg, _TWILIGHT_DEG, np.log(_TWILIGHT_LUX))) / _TWILIGHT_LUX[-1])


def sun_direction(lighting: Lighting) -> Array:
    """Return the unit vector (3,) towards the sun [world], not below the horizon."""
    elevation, azimuth = np.radians(max(lighting.sun_elevation_deg, 0.0)), np.radians(lighting.sun_azimuth_deg)
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


def overcast_illuminance(lighting: Lighting) -> float:
    """Return the illuminance of level ground under an overcast sky [lx], dimmed at twilight like the clear sky."""
    height = np.sin(np.radians(max(lighting.sun_elevation_deg, 0.0)))
    return float((300.0 + 21e3 * height) * twilight_factor(lighting.sun_elevation_deg))


def daylight_share(lighting: Lighting) -> float:
    r"""Return the light of sun and sky on a surface that faces the sun, over the sun's above the air.

    Parameters
    ----------
    lighting : Lighting

    Notes
    -----
    With the cloud cover c, the sun at the height h and the air mass m [4]_,

    .. math:: (1 - c) \left(e^{-0.21 m} + \frac{0.8 + 15.5 \sqrt{\sin h}}{127.5}\right)
              + c \, \frac{0.3 + 21 \sin h}{127.5}

    by the illuminances of the module's reference [1]_, those of the sky dimmed at twilight. The eye's weighting stands
    for all wavelengths: air takes less of the near infrared, and the sky sends less of it.

    References
    ----------
    .. [1] Illuminating Engineering Society, RP-21, 1984.
    .. [4] F. Kasten, A. T. Young, "Revised optical air mass tables and approximation formula", Appl. Opt. 28(22), 1989.
    """
    height = lighting.sun_elevation_deg
    sine = float(np.sin(np.radians(max(height, 0.0))))
    direct = 0.0
    if height > 0.0:
        direct = float(np.exp(-0.21 / (sine + 0.50572 * (height + 6.07995) ** -1.6364)))
    sky = (800.0 + 15.5e3 * sine**0.5) * twilight_factor(height) / _ABOVE_THE_AIR_LUX
    clouds = overcast_illuminance(lighting) / _ABOVE_THE_AIR_LUX
    return (1.0 - lighting.cloud_cover) * (direct + sky) + lighting.cloud_cover * clouds


def sky_directions() -> Array:
    """Return the unit vectors [world, z up] of the environment map's pixels, shape (rows, columns, 3).

    They are those of Mitsuba's `envmap` turned by 90 deg about x.
    """
    rows, columns = SKY_SIZE
    polar = (np.arange(rows) + 0.5) / rows * np.pi
    around = (np.arange(columns) + 0.5) / columns * 2.0 * np.pi
    sine = np.sin(polar)[:, None]
    return np.stack(
        [sine * np.sin(around), sine * np.cos(around), np.broadcast_to(np.cos(polar)[:, None], (rows, columns))],
        axis=-1,
    )


def level_illuminance(sky: Array) -> float:
    """Return the illuminance of level ground [lx] by a map of the sky, or its upper half, (rows, columns, 3)."""
    upper = SKY_SIZE[0] // 2
    polar = (np.arange(upper) + 0.5) / SKY_SIZE[0] * np.pi
    weight = np.sin(polar) * np.cos(polar) * (np.pi / SKY_SIZE[0]) * (2.0 * np.pi / SKY_SIZE[1])
    return float(weight @ sky[:upper].sum(axis=1) @ LUMINANCE_WEIGHTS) * UNIT_LUMINANCE


def clouded_light(lighting: Lighting, sky: Array, sun_irradiance: Array) -> CloudedLight:
    """Return the light of sky and sun through the lighting's clouds.

    Parameters
    ----------
    lighting : Lighting
    sky : ndarray of float64, shape (rows, columns, 3)
        Radiance of the clear sky, in the unit of the scenes; its upper half will do.
    sun_irradiance : ndarray of float64, shape (3,)
        Of a surface that faces the unhidden sun, in the unit of the scenes.
    """
    onto_ground = sun_direction(lighting)[2] * float(LUMINANCE_WEIGHTS @ sun_irradiance) * UNIT_LUMINANCE
    return through_clouds(lighting.cloud_cover, level_illuminance(sky), onto_ground, overcast_illuminance(lighting))


def sky_image(lighting: Lighting, clear: Array, sun_irradiance: Array) -> npt.NDArray[np.float32]:
    """Return the environment map.

    Parameters
    ----------
    lighting : Lighting
    clear : ndarray, shape (rows, columns, 3)
        Radiance of the clear sky without the sun's disc, in the unit of the scenes.
    sun_irradiance : ndarray, shape (3,)
        Of a surface that faces the sun, in the unit of the scenes.

    Returns
    -------
    ndarray of float32, shape (rows, columns, 3)
        Radiance, in the unit of the scenes. The sun's disc is not in it. Under clouds its light on level ground is that
        of :func:`clouded_light`.
    """
    horizon = SKY_SIZE[0] // 2
    directions = sky_directions()[:horizon]
    height = directions[..., 2]
    sky = clear[:horizon] * twilight_factor(lighting.sun_elevation_deg)
    zenith = 9.0 / (7.0 * np.pi) * overcast_illuminance(lighting) / UNIT_LUMINANCE
    grey = _CLOUD_GREY / (LUMINANCE_WEIGHTS @ _CLOUD_GREY)
    layer = (zenith * (1.0 + 2.0 * height) / 3.0)[..., None] * grey
    cover = lighting.cloud_cover
    if cover >= 1.0:
        mottled = mottling(directions)
        onto_ground = layer[..., 1] * height * np.hypot(directions[..., 0], directions[..., 1])  # sine: area of a pixel
        total = (mottled * onto_ground).sum()  # zero by night
        sky = layer * (mottled * (onto_ground.sum() / total if total > 0.0 else 1.0))[..., None]
    elif cover > 0.0:
        wanted = clouded_light(lighting, sky, sun_irradiance).sky
        sky = broken_clouds(sky, layer, sun_irradiance, cover, directions)
        given = level_illuminance(sky)
        sky = sky * (wanted / given if given > 0.0 else 1.0)
    glow = lighting.night_sky_luminance / UNIT_LUMINANCE * np.array([0.85, 1.0, 1.35])
    sky = sky + glow * (1.0 + 1.5 * np.exp(-height / 0.15))[..., None]
    below = np.broadcast_to(sky[-1].mean(axis=0), (SKY_SIZE[0] - horizon, SKY_SIZE[1], 3))  # as at the horizon
    return np.concatenate([sky, below]).astype(np.float32)


def clear_sky(mi: ModuleType, lighting: Lighting) -> tuple[Array, Array]:
    """Return the clear sky's radiance without the sun, shape (rows, columns, 3), and the sun's irradiance, shape (3,).

    In the unit of the scenes, `UNIT_LUMINANCE`. Zero below the horizon. Evaluated with Mitsuba's `sunsky` emitter; run
    it inside ``variant.optical()``. With the sun below `LOWEST_SUN_DEG` the sky keeps the look that it has there, and
    its illuminance falls evenly in its logarithm to that of sunset [3]_; :func:`twilight_factor` goes on from there.
    """
    if lighting.sun_elevation_deg <= -18.0:
        return np.zeros((*SKY_SIZE, 3)), np.zeros(3)
    toward, elevation = sun_direction(lighting), lighting.sun_elevation_deg
    base = {"type": "sunsky", "sun_direction": toward.tolist(), "turbidity": lighting.turbidity}
    lifted = sun_direction(lighting.with_(sun_elevation_deg=max(elevation, LOWEST_SUN_DEG)))
    upper = sky_directions()[: SKY_SIZE[0] // 2]
    sky = np.zeros((*SKY_SIZE, 3))
    emitter = mi.load_dict({**base, "sun_direction": lifted.tolist(), "sun_scale": 0.0})
    sky[: len(upper)] = _evaluate(mi, emitter, upper.reshape(-1, 3)).reshape(upper.shape)
    if elevation < LOWEST_SUN_DEG:
        sky *= (_TWILIGHT_LUX[-1] / level_illuminance(sky)) ** (1.0 - max(elevation, 0.0) / LOWEST_SUN_DEG)
    if elevation <= 0.0:
        return sky, np.zeros(3)
    half, count = np.radians(0.5358 / 2.0), 4000
    side = np.cross(toward, [0.0, 0.0, 1.0] if toward[2] < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    radius = half * np.sqrt((np.arange(count) + 0.5) / count)
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(count)
    offset = radius * np.cos(turn), radius * np.sin(turn)
    disc = toward + offset[0][:, None] * side + offset[1][:, None] * np.cross(toward, side)
    disc /= np.linalg.norm(disc, axis=-1, keepdims=True)
    sun = _evaluate(mi, mi.load_dict({**base, "sky_scale": 0.0}), disc)
    return sky, sun.mean(axis=0) * np.pi * half**2


def _evaluate(mi: ModuleType, emitter: MitsubaObject, directions: Array) -> Array:
    """Return the radiance that an environment emitter sends from directions, shape (n, 3)."""
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = Device(mi).single_vectors(-directions)
    return np.array(emitter.eval(interaction, True), dtype=np.float64).reshape(3, -1).T
