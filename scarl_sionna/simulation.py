"""Composition root: a world and a rig give frames; a scenario names both."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import scarl_sionna.dataset  # noqa: F401  # it draws frames: Frame.plot

from .core import seeds
from .core.errors import ParameterRangeError, PlacementError
from .core.mount import Mount
from .core.pose import Pose
from .core.prompt.arguments import HOW_TO_RADAR, HOW_TO_RIG, HOW_TO_WORLD, expect, number
from .core.registry import SPEC_TYPES, Sensor, sensor_class
from .core.results import Frame
from .core.settings.radar import RadarSettings
from .core.specs.interferer import Interferer
from .core.specs.radar.spec import RadarSpec
from .fusion.labels import count_labels
from .fusion.rig import Rig, SensorMount
from .fusion.visibility import add_visibility
from .scenario.spec.scenario import ScenarioSpec
from .signal.angle import RangeDopplerAngle, range_doppler_angle

if TYPE_CHECKING:
    from .engine.world import World

OnStage = Callable[[str, float], None]
"""Called with the name of the stage that begins and how many frames are done, parts of a frame included."""

Draw = Callable[[str], float]
"""Random number from 0 to 1 of a name in a frame."""


def _ignore(stage: str, num_done: float) -> None:
    """Report nothing."""


def _sensor(mount: SensorMount) -> Sensor:
    """Return the sensor of a rig."""
    kind: Any = sensor_class(mount.kind)
    sensor: Sensor = kind(mount.spec) if mount.settings is None else kind(mount.spec, mount.settings)
    return sensor


def _with_places(mount: SensorMount, rig: Rig, carrier: Mount, time: float, draw: Draw) -> SensorMount:
    """Return a sensor whose interferers have a start, and radars of the same rig their specification and place.

    A radar leaves itself out, so that one list serves all radars of a rig.
    """
    settings = mount.settings
    if not isinstance(mount.spec, RadarSpec) or not isinstance(settings, RadarSettings) or not settings.interferers:
        return mount  # radars of other kinds refuse them
    own = _start(mount.name, rig, draw)
    known = []
    for item in settings.interferers:
        if item.sensor == mount.name:
            continue
        placed = _placed(item, rig, carrier, time)
        if item.start_time is None:
            start = _foreign_start(item, draw) if item.sensor is None else _start(item.sensor, rig, draw)
            placed = placed.with_(start_time=start - own)
        known.append(placed)
    return replace(mount, settings=settings.with_(interferers=tuple(known)))


def _start(name: str, rig: Rig, draw: Draw) -> float:
    """Return when a radar of a rig starts its frame [s]: 0 in a rig whose radars do not hear each other.

    Else drawn over the longest of the frame intervals that the lists of the rig's radars have for it.
    """
    lists = [mount.settings.interferers for mount in rig.sensors if isinstance(mount.settings, RadarSettings)]
    named = [item for items in lists for item in items if item.sensor is not None]
    if not named:
        return 0.0
    given = [item.frame_interval for item in named if item.sensor == name and item.frame_interval is not None]
    return draw(name) * max(given, default=_radar(rig, name).frame_time)


def _radar(rig: Rig, name: str) -> RadarSpec:
    other = rig[name]
    if not isinstance(other.spec, RadarSpec):
        raise ParameterRangeError("interferers.sensor", f"'{name}', a {other.kind}", "a radar of the rig")
    return other.spec


def _foreign_start(item: Interferer, draw: Draw) -> float:
    """Return when a radar that is not of the rig starts a frame [s], the same for all that hear it: by its fields."""
    assert item.radar is not None  # or a sensor is named
    return draw(json.dumps(item.model_dump(mode="json"), sort_keys=True)) * (
        item.frame_interval or item.radar.frame_time
    )


def _placed(item: Interferer, rig: Rig, carrier: Mount, time: float) -> Interferer:
    if item.sensor is None:
        return item
    when = {"start_time": item.start_time, "frame_interval": item.frame_interval}
    place = carrier.at(rig[item.sensor].vehicle_from_sensor)
    velocity = tuple(place.twist.linear.tolist())
    fixed: dict[str, Any] = {"pose": Mount.passing(place.pose, velocity, -time).pose, "velocity": velocity}
    if place.actor is not None:
        fixed = {"pose": place.actor_from_sensor, "actor": place.actor}
    return Interferer(radar=_radar(rig, item.sensor), frequency_offset=item.frequency_offset, **when, **fixed)


def observe(
    world: World,
    rig: Rig,
    time: float = 0.0,
    seed: int = 0,
    *,
    radar: RadarSettings | None = None,
    vehicle: Mount | Pose | None = None,
    index: int = 0,
    only: Collection[str] | None = None,
    on_stage: OnStage = _ignore,
) -> Frame:
    """Return what every sensor of a rig sees at one instant.

    Parameters
    ----------
    world : World
    rig : Rig
    time : float
        [s]; it is rounded to whole nanoseconds, the frame's `timestamp_ns`.
    seed : int
        Root of all random numbers, >= 0. A sensor's numbers depend on seed, timestamp, the sensor's name and, in the
        world of a scenario, the drive's (`World.with_noise_of`) only: not on the order of the sensors and not on the
        other sensors of the rig. Start times of interferers depend on these and the interferer.
    radar : RadarSettings, optional
        The fields that are set in it replace those of every radar of the rig: method, tolerance, noise and the like.
    vehicle : Mount or Pose, optional
        The vehicle that carries the rig; default: the world's ego actor. A bare pose stands still.
    index : int
        Number of the frame in its sequence.
    only : collection of str, optional
        Names of the sensors that look; the others stay in the rig, where radars may hear them. Default: all.
    on_stage : callable
        Called with each sensor's name before it works, and the part of the frame that is done.

    Returns
    -------
    Frame

    Raises
    ------
    InputTypeError
        If a name stands where a world or a rig belongs, and so on.
    UnknownNameError
        If `only` names a sensor that the rig does not have.
    PlacementError
        If the world has no ego actor and no vehicle is given, or a sensor is inside a mesh: before any of them works.
    TimeRangeError
        If the time lies outside the world's motion.
    """
    from .engine.rays.placement import check_placement
    from .engine.threads import few_threads
    from .engine.world import World

    expect("world", world, World, HOW_TO_WORLD)
    expect("rig", rig, Rig, HOW_TO_RIG)
    for name in only or ():
        rig[name]  # raises if there is none
    timestamp_ns = round(number("time", time, "give seconds: observe(world, rig, time=0.5)") * 1e9)
    timings: dict[str, float] = {}
    started = perf_counter()
    state = world.at(timestamp_ns / 1e9)
    if radar is not None:
        rig = rig.with_radar(radar)
    if vehicle is None:
        if world.ego is None:
            raise PlacementError(
                f"world '{world.name}' has no ego vehicle that carries the rig; give observe(..., vehicle=Pose(...))"
            )
        carrier = state.mount(world.ego)
    else:
        carrier = Mount.of(vehicle)
    objects = state.boxes()
    timings["world"] = perf_counter() - started

    results: dict[str, Any] = {}
    looking = rig.sensors if only is None else tuple(rig[name] for name in rig.names if name in set(only))
    with few_threads():
        for mount in looking:
            if mount.kind in SPEC_TYPES:
                check_placement(state, carrier.at(mount.vehicle_from_sensor).pose.position, f"sensor '{mount.name}'")

    drive = {"drive": world.noise_name} if world.noise_name else {}

    def draw(name: str) -> float:
        return float(seeds.generator(seed, "interferer", frame=timestamp_ns, sensor=name, **drive).uniform())

    for position, mount in enumerate(looking):
        on_stage(mount.name, position / len(looking))
        started = perf_counter()
        results[mount.name] = _sensor(_with_places(mount, rig, carrier, state.time, draw)).observe(
            state,
            carrier.at(mount.vehicle_from_sensor),
            seeds.generator(seed, mount.kind, frame=timestamp_ns, sensor=mount.name, **drive),
        )
        timings[mount.kind] = timings.get(mount.kind, 0.0) + perf_counter() - started
    started = perf_counter()
    with few_threads():
        results = add_visibility(state, objects, results)
    timings["labels"] = perf_counter() - started
    return Frame(
        index=index,
        timestamp_ns=timestamp_ns,
        seed=seed,
        world_from_vehicle=carrier.pose,
        vehicle_twist=carrier.twist,
        results=results,
        objects=count_labels(objects, results),
        timings=timings,
    )


def radar_cube(
    scene: World | str | Path = "highway_guardrail",
    radar: RadarSpec | str = "awr1843boost",
    time: float = 0.0,
    seed: int = 0,
    *,
    settings: RadarSettings | None = None,
) -> RangeDopplerAngle:
    """Return the radar cube of a scene.

    What a radar in the middle of the ego vehicle's front sees, processed to angles.

    ``ss.radar_cube().plot()`` is the shortest way to a picture. It is :func:`observe` with a rig of one radar, and
    :func:`range_doppler_angle`: noise and converter included.

    Parameters
    ----------
    scene : World, str or path
        A loaded world, or what :func:`load_scene` takes. It needs an ego vehicle.
    radar : RadarSpec or str
        Or the name of a preset.
    time : float
        [s]
    seed : int
        Root of the noise.
    settings : RadarSettings, optional
        Method, tolerance, noise and the like.

    Returns
    -------
    RangeDopplerAngle
        Power over Doppler, range and angle [W]; `range_doppler` holds the complex channels.

    Raises
    ------
    UnknownNameError
        If there is no such scene or radar.
    PlacementError
        If the world has no ego vehicle.
    TimeRangeError
        If the time lies outside the world's motion.
    """
    from .engine.load import load_scene
    from .engine.world import World

    world = scene if isinstance(scene, World) else load_scene(scene)
    spec = RadarSpec.preset(radar) if isinstance(radar, str) else radar
    expect("radar", spec, RadarSpec, HOW_TO_RADAR)
    frame = observe(world, Rig.front(radar=spec).subset("*/radar"), time, seed, radar=settings)
    return range_doppler_angle(next(iter(frame.radars.values())))


def simulate(
    world: World,
    rig: Rig,
    times: Sequence[float],
    seed: int = 0,
    *,
    radar: RadarSettings | None = None,
    skip: Collection[int] = (),
    on_stage: OnStage = _ignore,
) -> Iterator[Frame]:
    """Yield a frame for each time, one after the other, without those whose index is in `skip`.

    A frame does not depend on the frames before it. `radar` is as in :func:`observe`.
    """
    if radar is not None:
        rig = rig.with_radar(radar)
    for index, time in enumerate(times):
        if index not in skip:
            yield observe(world, rig, time, seed, index=index, on_stage=on_stage)


def resolve_rig(scenario: ScenarioSpec) -> Rig:
    """Return the scenario's rig.

    A preset or that of a file, in its quality, and with the scenario's radar settings on top.

    In a rig file, the quality stands for what the file does not state of the settings of its radars.

    Raises
    ------
    ParameterRangeError
        If the method of a radar lacks what it needs, see `RadarSettings.check_complete`.
    """
    if Path(scenario.rig).suffix in (".yaml", ".yml", ".json"):
        rig = Rig.load(scenario.find(scenario.rig)).in_quality(scenario.quality)
    else:
        rig = Rig.preset(scenario.rig, scenario.quality)
    rig = rig if scenario.radar is None else rig.with_radar(scenario.radar)
    for mount in rig.sensors:
        if isinstance(mount.settings, RadarSettings):
            mount.settings.check_complete(mount.name)
    return rig


def load_world(scenario: ScenarioSpec) -> World:
    """Return the world of a scenario, see :func:`scarl_sionna.scenario.compose.build_world`.

    Raises
    ------
    ScenarioError
        If a name is unknown, a motion does not cover all frames, or bodies overlap; it names file and line.
    """
    from .scenario.compose import build_world  # here, so that reading a scenario does not start the engine

    return build_world(scenario)
