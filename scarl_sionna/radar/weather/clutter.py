"""Echoes of what is in the air, rain, snow and spray.

A volume full of drops stands there as point paths of random amplitude and exact mean power.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.special import ndtri

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import DEFAULT_ACCURACY
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.weather_echoes import DEFAULT_WEATHER_ECHOES
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.core.units import dbm_to_watt
from scarl_sionna.engine.rays.shelter import is_sheltered, is_under_cover
from scarl_sionna.engine.spray import SprayCloud, spray_clouds
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.radar.points import point_targets
from scarl_sionna.scene.materials.dielectrics import CELSIUS
from scarl_sionna.signal.antenna import two_way_gain
from scarl_sionna.signal.link import radar_gain
from scarl_sionna.signal.noise import angle_cell_noise_power

from .attenuation import attenuate, weather_attenuation
from .cells import Rows, Scatter, direction_steps, even_draws, gaussian_cells, range_rows
from .hydrometeors import spray
from .mean_clutter import GRID_DEG, ClutterBudget, clutter_budget, falling, gain_cells

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

VOLUME_INTERACTION = 16
"""Kind of interaction written for a scatterer in the air; its instance is 0, since it belongs to no object."""
_FINEST = 8
"""Of these cells there are at most as many in 1 deg, two in a direction of the lattice: arrays of up to 0.25 deg."""
_LEAST_GAIN = 1e-9
"""Two-way gain over the largest below which a direction counts nothing; 1e-8 of the power at most is there."""
_FALL_CLASSES = 8
"""Classes of speeds of fall, of the same part of the echo each; a class is 1 m/s wide at most, seen from above."""


@dataclass(frozen=True)
class VolumeSampling:
    """Which points stand for the drops of a volume.

    Attributes
    ----------
    reach : float or None
        Points lie within [m]; None: that of :func:`.mean_clutter.clutter_budget`.
    num_points : int
        About so many at most; a volume of more cells is thinned, the weakest first.
    nearest : float
        None nearer than this [m].
    floor_db : float
        Cells weaker than this over the noise of a range-Doppler-angle cell are drawn at random [dB].
    """

    reach: float | None = None
    num_points: int = DEFAULT_WEATHER_ECHOES.num_points
    nearest: float = DEFAULT_WEATHER_ECHOES.nearest
    floor_db: float = DEFAULT_ACCURACY.channel_floor_db


def volume_clutter(
    weather: Weather,
    radar: RadarSpec,
    mount: Mount | Pose,
    rng: np.random.Generator,
    state: WorldState | None = None,
    sampling: VolumeSampling | None = None,
) -> RadarPaths:
    r"""Return the echoes of rain and snow as paths of points, without the air's attenuation.

    Parameters
    ----------
    weather : Weather
    radar : RadarSpec
    mount : Mount or Pose
        Of the radar; a bare pose (`world_from_radar`) stands still.
    rng : numpy.random.Generator
    state : WorldState, optional
        What hides the points behind it, and below what none fall; free space if left out.
    sampling : VolumeSampling, optional
        How far, and how many points; the defaults if left out.

    Returns
    -------
    RadarPaths
        Of depth 1, instance 0, class 0 and interaction `VOLUME_INTERACTION`; none where the reach is 0.

    Notes
    -----
    The volume is a lattice of cells of range, direction and radial velocity as large as the radar's resolution, a point
    in each (:func:`.cells.gaussian_cells`). Its mean power is that of its part of the volume that is in sight
    (:func:`.mean_clutter.mean_clutter_power`); its amplitude is circular normal: many drops, fully developed speckle.
    So a range-Doppler-angle cell is normal with an even mean, and the mean power of any part of the volume is exact.
    Velocities are those of the wind, its turbulence (normal, each axis) and the fall of the drops' sizes by what they
    send back, less the radar's own.

    *Not modelled*: multipath of the rain's echo over the ground, depolarisation, correlation of turbulence, the second
    order of a point's range within a frame, which would cost 60 times as much and only change which random numbers a
    cell gets.
    """
    mount = Mount.of(mount)
    sampling = sampling or VolumeSampling()
    limit = clutter_budget(weather, radar).reach if sampling.reach is None else sampling.reach
    if limit <= sampling.nearest or not (drops := falling(weather, radar.center_frequency)):
        return RadarPaths.empty(mount.pose)
    rows, width = range_rows(radar.range_resolution, sampling.nearest, limit, rng)
    eta = sum(item.reflectivity for item in drops)
    loss = 10.0 ** (-weather_attenuation(weather, radar.center_frequency, radar.array.polarization) * rows / 5e3)
    link = dbm_to_watt(radar.front_end.tx_power_dbm) * radar_gain(radar.wavelength, 1.0)
    strength = link * eta * width / rows**2
    weakest = 10.0 ** (sampling.floor_db / 10.0) * angle_cell_noise_power(radar)
    scatter = _scatter(weather, radar, mount, limit, rng, state)
    cells = gaussian_cells(scatter, radar, Rows(rows, strength * loss), weakest, sampling.num_points, rng)
    direction = mount.pose.rotate(cells.direction)
    place = mount.pose.position + cells.distance[:, None] * direction
    gain = two_way_gain(radar.array, cells.direction)
    power = cells.power / np.interp(cells.distance, rows, loss)
    sigma = power * cells.distance**4 / (link * gain)
    falls = slice(None) if state is None else ~is_sheltered(state, place)
    # a point stands for all drops of its cell, whose directions stay when each of them has left it: it keeps its own
    velocity = mount.twist.linear + cells.velocity[:, None] * direction
    points = point_targets(place[falls], velocity[falls], sigma[falls], radar, mount)
    return _as_clutter(points, _speckle(rng, len(place))[falls])


def _scatter(
    weather: Weather,
    radar: RadarSpec,
    mount: Mount,
    reach: float,
    rng: np.random.Generator,
    state: WorldState | None,
) -> Scatter:
    """Return what falls, seen along directions, random within cells of the pattern."""
    fine = tuple(
        int(np.clip(np.ceil(2.0 * np.radians(GRID_DEG) / step), 1, _FINEST)) for step in direction_steps(radar)
    )
    azimuth, elevation, weight = gain_cells(radar.array, (fine[0], fine[1]))
    row, column = np.nonzero(weight > _LEAST_GAIN * weight.max())
    jitter = (rng.random((2, len(row))) - 0.5) * np.radians(GRID_DEG)
    phi, theta = azimuth[row] + jitter[0] / fine[0], elevation[column] + jitter[1] / fine[1]
    local = np.stack([np.cos(phi) * np.cos(theta), np.sin(phi) * np.cos(theta), np.sin(theta)], axis=1)
    direction = mount.pose.rotate(local)
    free = np.full(len(row), np.inf) if state is None else _free_way(state, mount.pose.position, direction, reach)
    drops = falling(weather, radar.center_frequency)
    eta = sum(item.reflectivity for item in drops)
    classes = [item.fall_classes(_FALL_CLASSES) for item in drops]
    speed = np.concatenate([speeds for speeds, _ in classes])
    share = np.concatenate([shares * item.reflectivity / eta for item, (_, shares) in zip(drops, classes, strict=True)])
    air = np.array([*weather.wind, 0.0]) - mount.twist.linear
    velocity = (direction @ air)[:, None] - direction[:, 2:] * speed
    return Scatter(local, weight[row, column], free, velocity, share, weather.turbulence)


def spray_clutter(
    state: WorldState,
    radar: RadarSpec,
    mount: Mount | Pose,
    rng: np.random.Generator,
    num_points: int = DEFAULT_WEATHER_ECHOES.points_per_cloud,
    nearest: float = DEFAULT_WEATHER_ECHOES.nearest,
) -> RadarPaths:
    """Return the echoes of the spray behind vehicles as paths of points of random amplitude, see :class:`SprayCloud`.

    Sources, parameters and result are those of :func:`volume_clutter`; `num_points` is the number of points of one
    cloud, `nearest` the distance [m] from which on drops count. The points of a cloud share its whole cross-section,
    the integral of its reflectivity, by the radar equation [1]_; they fill it and the spread of the radial velocity
    evenly, so that few of them make a cell speckle.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, section 7.6.
    """
    mount = Mount.of(mount)
    pose = mount.pose
    blocks = [RadarPaths.empty(pose)]
    speckle = [np.zeros(0, dtype=np.complex128)]
    for cloud in spray_clouds(state):
        center = cloud.world_from_cloud.position
        if np.linalg.norm(center - pose.position) - cloud.length > radar.max_range:
            continue
        drops = spray(
            cloud.water_content,
            cloud.drop_diameter,
            radar.center_frequency,
            state.world.weather.temperature_celsius + CELSIUS,
        )
        draws = even_draws(num_points, 4, rng)
        place, sight, distance = _in_cloud(cloud, pose, draws)
        fade = np.exp(place[:, 0] / cloud.decay_length)
        volume = cloud.decay_length * (1.0 - math.exp(-cloud.length / cloud.decay_length)) * cloud.width * cloud.height
        sigma = np.full(num_points, drops.reflectivity * volume / num_points)
        motion = cloud.speed * fade[:, None] * cloud.world_from_cloud.rotation[:, 0]
        motion = motion + state.world.weather.turbulence * ndtri(draws[:, 3:]) * sight
        amplitude = _speckle(rng, num_points)
        kept = (distance > nearest) & _in_sight(state, pose, sight, distance)
        blocks.append(
            point_targets(pose.position + (distance[:, None] * sight)[kept], motion[kept], sigma[kept], radar, mount)
        )
        speckle.append(amplitude[kept])
    return _as_clutter(RadarPaths.concatenate(blocks), np.concatenate(speckle))


def through_weather(
    paths: RadarPaths,
    state: WorldState,
    radar: RadarSpec,
    rng: np.random.Generator | None,
    radar_twist: Twist | None = None,
    settings: RadarSettings | None = None,
) -> RadarPaths:
    """Return the paths of a scene as they are in its weather.

    Attenuated, with the echoes of rain, snow and spray behind them; those of a separate receiver only attenuated.

    Parameters
    ----------
    paths : RadarPaths
        From :func:`scarl_sionna.solve_paths` for this state.
    state : WorldState
        Its ``world.weather`` is taken; in a clear one the paths come back as they are.
    radar : RadarSpec
    rng : numpy.random.Generator or None
        Of the drops' places and speckle; None leaves their echoes out.
    radar_twist : Twist, optional
        As given to the solver; that of the paths if left out.
    settings : RadarSettings, optional
        Its `weather_echoes`, and of its `accuracy` the floor below which echoes of the air are left out.

    Returns
    -------
    RadarPaths
        ``diagnostics["weather"]`` says what was done and what was left out, with its power.

    Raises
    ------
    ParameterRangeError
        If the paths are in the weather already, as those of :func:`scarl_sionna.network_paths` are.
    """
    weather: Weather = state.world.weather
    if weather.is_clear:
        return paths
    if "weather" in paths.diagnostics:
        raise ParameterRangeError("paths", "in their weather already", "paths of solve_paths", "take them as they are")
    air = weather
    ends = (paths.world_from_tx, *(() if paths.is_monostatic else (paths.world_from_rx,)))
    if (weather.rain_rate or weather.snow_rate) and all(is_under_cover(state, end.position) for end in ends):
        air = weather.with_(rain_rate=0.0, snow_rate=0.0)
    values = tuple(weather_attenuation(air, radar.center_frequency, name) for name in ("V", "H"))  # type: ignore[arg-type]
    report: dict[str, Any] = {
        "attenuation_db_per_km": dict(zip("VH", values, strict=True)),
        "under_cover": air != weather,
    }
    blocks = [paths]
    if not paths.is_monostatic:
        report["left_out"] = "echoes of what falls: they are computed for one radar that sends and receives"
    elif rng is not None:
        settings = settings or RadarSettings()
        knobs = settings.weather_echoes
        budget = clutter_budget(weather, radar, settings=settings)
        floor = settings.accuracy.channel_floor_db
        sampling = VolumeSampling(budget.reach, knobs.num_points, knobs.nearest, floor)
        mount = Mount(paths.world_from_tx, radar_twist or paths.tx_twist)
        volume = volume_clutter(weather, radar, mount, rng, state, sampling)
        clouds = spray_clutter(state, radar, mount, rng, knobs.points_per_cloud, knobs.nearest)
        blocks += [volume, clouds]
        report |= _report(budget, volume, clouds, floor)
    diagnostics = {**paths.diagnostics, "weather": report}
    whole = RadarPaths.concatenate(blocks, diagnostics)
    return attenuate(whole, radar, (values[0], values[1]))


def _report(budget: ClutterBudget, volume: RadarPaths, clouds: RadarPaths, floor_db: float) -> Mapping[str, Any]:
    floor = f"at most {floor_db:g} dB over the noise of a range-Doppler-angle cell"
    left = "nothing falls" if math.isinf(budget.reflectivity_db) else f"beyond {budget.reach:.1f} m: {floor}"
    return {
        "clutter_points": volume.num_paths,
        "clutter_reach": budget.reach,
        "clutter_reflectivity_db": budget.reflectivity_db,
        "clutter_snr_db_at_5_10_20_50_m": budget.snr_db,
        "spray_points": clouds.num_paths,
        "left_out": left,
    }


def _in_cloud(cloud: SprayCloud, pose: Pose, draws: Array) -> tuple[Array, Array, Array]:
    """Return places in a cloud's frame by its density, and the directions and distances of them from the radar."""
    tail = 1.0 - math.exp(-cloud.length / cloud.decay_length)
    place = np.stack(
        [
            cloud.decay_length * np.log1p(-draws[:, 0] * tail),
            (draws[:, 1] - 0.5) * cloud.width,
            draws[:, 2] * cloud.height,
        ],
        axis=1,
    )
    sight = cloud.world_from_cloud.apply(place) - pose.position
    distance = np.linalg.norm(sight, axis=1)
    return place, sight / np.maximum(distance, 1e-9)[:, None], distance


def _speckle(rng: np.random.Generator, number: int) -> npt.NDArray[np.complex128]:
    """Return circular normal amplitudes of mean power 1."""
    parts = rng.standard_normal((2, number)) * math.sqrt(0.5)
    return np.asarray(parts[0] + 1j * parts[1])


def _in_sight(state: WorldState, pose: Pose, direction: Array, distance: Array) -> npt.NDArray[np.bool_]:
    """Return whether points are nearer than the first surface in their direction."""
    return np.asarray(distance < _free_way(state, pose.position, direction, float(distance.max(initial=0.0))))


def _free_way(state: WorldState, origin: Array, direction: Array, reach: float) -> Array:
    """Return the distance of the first surface in each direction, infinite where there is none within a reach [m]."""
    free = np.full(len(direction), np.inf)
    if len(direction):
        hits = state.cast(origin, direction, max_distance=reach)
        free[hits.ray] = hits.distance
    return free


def _as_clutter(points: RadarPaths, speckle: npt.NDArray[Any]) -> RadarPaths:
    """Return point targets as scatterers of the air: with random amplitudes, of no instance."""
    return replace(
        points,
        a=points.a * speckle[:, None, None],
        length_acceleration=np.zeros(points.num_paths),
        linear_motion=np.ones(points.num_paths, dtype=np.bool_),
        instance=np.zeros_like(points.instance),
        interaction=np.full_like(points.interaction, VOLUME_INTERACTION),
    )
