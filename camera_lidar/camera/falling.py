"""Drops and flakes in the air near the camera: streaks over the image, by their size, speed and the exposure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose, Twist
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.drop_sizes import (
    RAIN_POWER,
    RAIN_SIZES,
    SNOW_FALL_SPEED,
    SNOW_SIZES,
    SNOW_SOLID,
    terminal_speed,
)
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.engine.rays.shelter import is_sheltered
from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

DEFAULT_EXPOSURE = 0.01
"""Exposure in which streaks form where the camera has none of its own [s]: common by day in rain."""
LEAST_COVER = 0.02
"""A drop that covers less of a pixel, over its whole streak, is part of the haze."""
LARGEST_IMAGE = 3.0
"""A drop as wide as this [px] is so near the lens that it is out of focus; it is left out."""
MOST_DROPS = 400_000
STEPS = 32
"""Places along a streak."""
DROP_RADIANCE = 0.94
"""Of a drop over that of the sky behind its wide view: K. Garg, S. K. Nayar, "Vision and rain", Int. J. Comput. Vis.
75(1), 2007."""
FLAKE_RADIANCE = 0.85
"""Of a flake over that of the sky: a white diffuser that is lit from all sides (engineering estimate)."""


@dataclass(frozen=True)
class _Kind:
    """One kind of drop or flake.

    Exponential distribution N0 exp(-slope D) of diameters [m] above the smallest, speed of fall, and radiance over the
    sky's.
    """

    number: float
    slope: float
    smallest: float
    swelling: float
    radiance: float


def _kinds(weather: Weather) -> list[_Kind]:
    """Return what falls, with sizes as for the radar.

    Marshall and Palmer 1948 for rain; Sekhon and Srivastava 1970, over melted diameters, for snow.
    """
    kinds = []
    if weather.rain_rate > 0.0:
        number, slope = RAIN_SIZES["marshall_palmer"]
        kinds.append(_Kind(number, slope * weather.rain_rate**RAIN_POWER, 0.5e-3, 1.0, DROP_RADIANCE))
    if weather.snow_rate > 0.0:
        number, number_power, slope, slope_power = SNOW_SIZES
        number, slope = number * weather.snow_rate**number_power, slope * weather.snow_rate**slope_power
        kinds.append(_Kind(number, slope, 0.3e-3, SNOW_SOLID[weather.snow] ** (-1.0 / 3.0), FLAKE_RADIANCE))
    return kinds


def add_falling(
    radiance: npt.NDArray[np.float32],
    state: WorldState,
    spec: CameraSpec,
    world_from_sensor: Pose,
    sensor_twist: Twist,
    rng: np.random.Generator,
) -> npt.NDArray[np.float32]:
    r"""Return the image with the streaks of the weather's rain and snow over it.

    Parameters
    ----------
    radiance : ndarray of float32, shape (height, width, 3)
    state : scarl_sionna.engine.world.WorldState
        Its weather; where nothing falls the image comes back as it is.
    spec : CameraSpec
        Its exposure time draws the streaks, `DEFAULT_EXPOSURE` if it is 0.
    world_from_sensor : Pose
        Sensor frame (x forward, y left, z up).
    sensor_twist : Twist
        Drops fall relative to the moving camera.
    rng : numpy.random.Generator

    Notes
    -----
    A drop of the diameter D at the depth z is :math:`f D / z` pixels wide; its image, spread over the streak, is
    blended as

    .. math:: L' = (1 - A) L + A \, c L_\text{sky}, \quad A = \frac{\pi}{4} (f D / z)^2 / n_\text{streak}

    with c of Garg and Nayar for drops. Drops behind a surface are hidden, and none fall below a roof. Those that cover
    less than `LEAST_COVER` of a pixel are part of the haze. *Not modelled*: lamps at night in drops, drops on the lens,
    defocus.
    """
    weather = state.world.weather
    cover = np.zeros(spec.height * spec.width)
    bright = np.zeros_like(cover)
    for kind in _kinds(weather):
        own = _cover(kind, state, spec, world_from_sensor, sensor_twist, rng)
        cover += own
        bright += kind.radiance * own
    if not cover.any():
        return radiance
    opacity = -np.expm1(-cover)
    color = (bright / np.maximum(cover, 1e-30))[:, None] * np.asarray(state.airlight)
    shape = (spec.height, spec.width, 1)
    alpha = opacity.reshape(shape)
    return (radiance * (1.0 - alpha) + alpha * color.reshape(spec.height, spec.width, 3)).astype(np.float32)


def _cover(
    kind: _Kind,
    state: WorldState,
    spec: CameraSpec,
    pose: Pose,
    twist: Twist,
    rng: np.random.Generator,
) -> Array:
    """Return the optical depth of streaks in every pixel, flat."""
    weather, focal = state.world.weather, float(spec.intrinsics[0, 0])
    point, diameter = _drops(kind, spec, focal, rng)
    world = pose.apply(point @ CAMERA_OPTICAL_FROM_SENSOR)
    sight = world - pose.position
    distance = np.linalg.norm(sight, axis=1)
    free = np.full(len(distance), np.inf)
    if len(distance):
        hits = state.cast(pose.position, sight / distance[:, None], max_distance=float(distance.max()))
        free[hits.ray] = hits.distance
    seen = distance < free
    seen[seen] = ~is_sheltered(state, world[seen])
    point, diameter = point[seen], diameter[seen]
    speed = _fall_speed(kind, diameter)
    velocity = weather.turbulence * rng.standard_normal((len(point), 3))
    velocity += np.stack([np.full(len(speed), weather.wind[0]), np.full(len(speed), weather.wind[1]), -speed], axis=1)
    relative = (velocity - twist.linear) @ pose.rotation @ CAMERA_OPTICAL_FROM_SENSOR.T
    exposure = spec.exposure_time or DEFAULT_EXPOSURE
    time = ((np.arange(STEPS) + 0.5) / STEPS - 0.5) * exposure
    track = point[:, None, :] + relative[:, None, :] * time[:, None]
    pixel, depth = spec.project(track.reshape(-1, 3))
    weight = (np.pi / 4.0 * (focal * diameter[:, None] / np.maximum(track[..., 2], 0.05)) ** 2 / STEPS).ravel()
    valid = np.isfinite(pixel).all(axis=1) & (depth > 0.05)
    return _splat(pixel[valid], weight[valid], spec)


def _fall_speed(kind: _Kind, diameter: Array) -> Array:
    if kind.radiance == FLAKE_RADIANCE:
        return np.full(len(diameter), SNOW_FALL_SPEED)
    return np.maximum(terminal_speed(diameter), 0.5)


def _drops(kind: _Kind, spec: CameraSpec, focal: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return random drops in view, in the optical frame [m], and their diameters [m]."""
    mean = kind.smallest + 1.0 / kind.slope
    density = kind.number / kind.slope * np.exp(-kind.slope * kind.smallest)
    deepest = focal * 2.5 * mean * kind.swelling * np.sqrt(np.pi / 4.0 / LEAST_COVER)
    half = np.array([spec.width, spec.height]) / 2.0 / focal * 1.1
    volume = 4.0 * half[0] * half[1] * deepest**3 / 3.0
    number = int(rng.poisson(min(density * volume, MOST_DROPS)))
    deepest *= min(1.0, MOST_DROPS / (density * volume)) ** (1.0 / 3.0)
    depth = deepest * np.cbrt(rng.random(number))
    aside = (2.0 * rng.random((number, 2)) - 1.0) * half * depth[:, None]
    diameter = (kind.smallest + rng.exponential(1.0 / kind.slope, number)) * kind.swelling
    size = focal * diameter / np.maximum(depth, 1e-6)
    kept = (size < LARGEST_IMAGE) & (np.pi / 4.0 * size**2 > LEAST_COVER)
    return np.concatenate([aside, depth[:, None]], axis=1)[kept], diameter[kept]


def _splat(pixel: Array, weight: Array, spec: CameraSpec) -> Array:
    """Return weights shared out over the four pixels around each place, flat."""
    place = pixel - 0.5
    corner = np.floor(place).astype(np.int64)
    part = place - corner
    cover = np.zeros(spec.height * spec.width)
    for du in (0, 1):
        for dv in (0, 1):
            column, row = corner[:, 0] + du, corner[:, 1] + dv
            share = (part[:, 0] if du else 1.0 - part[:, 0]) * (part[:, 1] if dv else 1.0 - part[:, 1])
            inside = (column >= 0) & (column < spec.width) & (row >= 0) & (row < spec.height)
            index = row[inside] * spec.width + column[inside]
            cover += np.bincount(index, weights=(weight * share)[inside], minlength=cover.size)
    return cover
