"""From the motion that a scenario states to a trajectory; what cannot be is an error at its line."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import (
    ParameterRangeError,
    ScarlError,
    ScenarioError,
    ScenarioFileError,
    ScenarioNameError,
    ScenarioPlace,
    ScenarioValueError,
    TrajectoryFileError,
    UnknownNameError,
)
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scenario.openscenario import SUFFIX
from scarl_sionna.scenario.randomize import Jitter
from scarl_sionna.scenario.spec.light import name_error
from scarl_sionna.scenario.spec.motion import (
    AccelerateSpec,
    BrakeSpec,
    ConstantTwistSpec,
    ParkSpec,
    RouteSpec,
    ShiftSpec,
    StaticSpec,
    StopSpec,
    TableSpec,
    TrajectorySpec,
    WaypointsSpec,
)
from scarl_sionna.scenario.traffic.planned import Conversion
from scarl_sionna.scenario.traffic.recorded.nuscenes import nuscenes_motion
from scarl_sionna.scene.lanes import Lane, LaneNetwork, ParkingPlace
from scarl_sionna.scene.motion.trajectory import (
    ConstantTwistTrajectory,
    StaticTrajectory,
    Trajectory,
)

from .bodies import ActorBody
from .ground import GroundLine, shifted_way
from .on_foot import GAIT
from .parking import Manoeuvre, park
from .paths import PathTrajectory
from .profiles import SpeedProfile
from .routes import Route
from .shifts import PlaceOf, shifts_of
from .tables import SUFFIXES, TableTrack, read_table, table_tracks
from .waypoints import is_on_foot, through

Array = npt.NDArray[np.float64]

MARGIN = 0.5
"""How long a motion goes on after the last frame where its path allows it [s]: sensors look at instants within a
frame."""
_REST = 0.1
"""How far from the end of a lane people stop [m]."""


@dataclass(frozen=True)
class Setting:
    """What a motion is made in: the lanes of the scene, the instants of the frames, where files are found."""

    scene: str
    network: LaneNetwork | None
    first: float
    last: float
    find: Callable[[str], Path]

    @property
    def street(self) -> Path | None:
        """The OpenDRIVE map that the scene is made of; None where it is made of none."""
        return self.find(self.scene) if self.scene.endswith(".xodr") else None

    @property
    def start(self) -> float:
        """Time at which `start` and `speed` of a route hold: 0, or the first frame where that is earlier [s]."""
        return min(0.0, self.first)

    def lane(self, name: str, place: ScenarioPlace) -> Lane:
        """Return a lane; an unknown one is an error at a place."""
        if self.network is None:
            raise ScenarioNameError(
                f"scene '{self.scene}' has no lanes", place, "give waypoints or another scene", kind="lane", known=[]
            )
        try:
            return self.network[name]
        except UnknownNameError as error:
            raise name_error(error, place) from None

    def ground(self, point: Sequence[float]) -> Array:
        """Return a point (3,); one without a height gets that of the nearest lane, or 0 where there are none."""
        if len(point) == 3:
            return np.array(point, dtype=np.float64)
        height = 0.0
        if self.network is not None and self.network.lanes:
            near = [(lane.nearest(point), lane) for lane in self.network.lanes]
            (way, _), lane = min(near, key=lambda item: item[0][1])
            height = float(lane.at(way)[2])
        return np.array([point[0], point[1], height])


def trajectory_of(
    spec: TrajectorySpec, name: str, body: ActorBody, setting: Setting, place: PlaceOf, jitter: Jitter | None = None
) -> Trajectory:
    """Return the trajectory that a specification states.

    Parameters
    ----------
    spec : TrajectorySpec
    name : str
        Of the actor.
    body : ActorBody
        Its measures.
    setting : Setting
    place : callable
        Returns the place of a key of the specification.
    jitter : Jitter, optional
        How far the placement is off what is stated.

    Raises
    ------
    ScenarioError
        If a name is unknown, a file is not readable, or the motion is not possible.
    """
    moved = jitter or Jitter()
    try:
        if isinstance(spec, RouteSpec):
            return _route(spec, name, body, setting, place, moved)
        if isinstance(spec, WaypointsSpec):
            return _waypoints(spec, name, body, setting, moved)
        if isinstance(spec, ConstantTwistSpec):
            return _constant_twist(spec, setting, moved)
        if isinstance(spec, StaticSpec):
            return _static(spec, setting, place, moved)
        if isinstance(spec, ParkSpec):
            return _park(spec, name, body, setting, place)
        return _table(spec, name, body, setting, place)
    except ScenarioError:
        raise
    except UnknownNameError as error:
        raise name_error(error, place()) from error
    except ParameterRangeError as error:
        raise ScenarioValueError(str(error), place(), value=error.value) from error


def _route(spec: RouteSpec, name: str, body: ActorBody, setting: Setting, place: PlaceOf, jitter: Jitter) -> Trajectory:
    lanes = [setting.lane(lane, place("lanes", index)) for index, lane in enumerate(spec.lanes)]
    for index in range(1, len(lanes)):
        if lanes[index].name not in lanes[index - 1].next:
            known = sorted(lanes[index - 1].next)
            raise ScenarioNameError(
                f"lane '{lanes[index].name}' does not continue '{lanes[index - 1].name}' (that is continued by: "
                f"{', '.join(known) or 'none'})",
                place("lanes", index),
                value=lanes[index].name,
                kind="lane",
                known=known,
            )
    whole = sum(lane.length for lane in lanes)
    start = min(max(spec.start + jitter.along, body.length / 2.0), whole)
    if spec.start > whole:
        raise ScenarioValueError(
            f"= {spec.start:g} is beyond the lanes' end at {whole:.4g} m", place("start"), value=spec.start
        )
    start = spec.start if jitter.along == 0.0 else start
    room = max(lanes[0].width - body.width, 0.0) / 2.0
    offset = spec.offset
    if jitter.lateral != 0.0:
        offset = float(np.clip(spec.offset + jitter.lateral, min(-room, spec.offset), max(room, spec.offset)))
    speed = lanes[0].speed if spec.speed is None else spec.speed
    begin = setting.start if spec.since is None else spec.since
    for index, event in enumerate(spec.events):
        if isinstance(event, StopSpec) and event.at > whole:
            raise ScenarioValueError(
                f"= {event.at:g} is beyond the lanes' end at {whole:.4g} m",
                place("events", index, "at"),
                "name more lanes, or stop before",
                value=event.at,
            )
    profile = _profile(spec, speed, start, begin, place)
    shifts = shifts_of(spec, profile, start, begin, body, place)
    assert setting.network is not None  # its lanes were found
    route = Route(setting.network, spec.lanes, offset, shifts)

    def along(speeds: SpeedProfile, duration: float | None) -> PathTrajectory:
        return route.trajectory(start, speeds, model=body, duration=duration, start_time=begin, name=name)

    duration = setting.last + MARGIN - begin
    try:
        return along(profile, duration)
    except ParameterRangeError:
        if body.motion == "walk" and profile.final_speed > 0.0:  # people stop where their way ends
            return along(profile.stop_at(whole - start - _REST, *GAIT), duration)
        return along(profile, None)  # as far as the lanes go


def _profile(spec: RouteSpec, speed: float, start: float, begin: float, place: PlaceOf) -> SpeedProfile:
    """Return the speed over time that the events make."""
    profile = SpeedProfile(speed)
    for index, event in enumerate(spec.events):
        if isinstance(event, ShiftSpec):
            continue
        if isinstance(event, StopSpec):
            try:
                profile = profile.stop_at(event.at - start, event.deceleration, event.jerk)
            except ParameterRangeError as error:
                raise ScenarioValueError(
                    f"= {event.at:g} is too near to stop at: {error}", place("events", index, "at"), value=event.at
                ) from error
            continue
        wait = event.time - begin - profile.duration
        if wait < -1e-9:
            raise ScenarioValueError(
                f"= {event.time:g} s is before the event before it ends, at {begin + profile.duration:.4g} s",
                place("events", index, "time"),
                value=event.time,
            )
        profile = profile.hold(max(wait, 0.0))
        if isinstance(event, BrakeSpec):
            if event.speed > profile.final_speed:
                raise ScenarioValueError(
                    f"= {event.speed:g} m/s is faster than the {profile.final_speed:.4g} m/s before it",
                    place("events", index, "speed"),
                    "use an event of kind accelerate",
                    value=event.speed,
                )
            profile = profile.reach(event.speed, event.deceleration, event.jerk)
        elif isinstance(event, AccelerateSpec):
            if event.speed < profile.final_speed:
                raise ScenarioValueError(
                    f"= {event.speed:g} m/s is slower than the {profile.final_speed:.4g} m/s before it",
                    place("events", index, "speed"),
                    "use an event of kind brake",
                    value=event.speed,
                )
            profile = profile.reach(event.speed, event.acceleration, event.jerk)
    return profile


def _waypoints(spec: WaypointsSpec, name: str, body: ActorBody, setting: Setting, jitter: Jitter) -> Trajectory:
    points = np.array([setting.ground(point) for point in spec.positions])
    step = next((part for part in np.diff(points[:, :2], axis=0) if np.linalg.norm(part) > 1e-3), np.array([1.0, 0.0]))
    span, ground = (setting.start, setting.last + MARGIN), None if spec.ground is None else GroundLine(spec.ground)
    shift = _shifted(jitter, float(np.arctan2(step[1], step[0])))
    if np.any(shift) and ground is not None:
        points = points + shift
        points[:, 2] = ground(points[:, :2])
    elif np.any(shift):  # on the ground of the stated way, which has kerbs where it has them
        points, stated = shifted_way(points, shift)
        ground = stated if is_on_foot(body) else None
    return through(spec, points, body, span, name, ground)


def _constant_twist(spec: ConstantTwistSpec, setting: Setting, jitter: Jitter) -> Trajectory:
    vx, vy, _ = spec.velocity
    yaw = float(np.arctan2(vy, vx)) if spec.yaw_deg is None else float(np.radians(spec.yaw_deg))
    turn = float(np.radians(jitter.yaw_deg))
    velocity = Pose.from_euler(np.zeros(3), yaw=turn).rotate(np.array(spec.velocity))
    pose = Pose.from_euler(setting.ground(spec.position) + _shifted(jitter, yaw), yaw=yaw + turn)
    return ConstantTwistTrajectory(pose, Twist(velocity, np.array([0.0, 0.0, spec.angular_velocity_z])))


def _static(spec: StaticSpec, setting: Setting, place: PlaceOf, jitter: Jitter) -> Trajectory:
    yaw = float(np.radians(spec.yaw_deg))
    if spec.position is not None:
        position = setting.ground(spec.position)
    elif spec.parking is not None:
        chosen = _parking_place(spec.parking, setting, place)
        position, yaw = np.array(chosen.position), yaw + float(np.radians(chosen.yaw_deg))
    else:
        lane = setting.lane(str(spec.lane), place("lane"))
        if spec.start > lane.length:
            raise ScenarioValueError(
                f"= {spec.start:g} is beyond the lane's end at {lane.length:.4g} m", place("start")
            )
        heading = float(lane.chord_headings[int(np.searchsorted(lane.distances[1:-1], spec.start))])
        position = lane.at(spec.start) + spec.offset * np.array([-np.sin(heading), np.cos(heading), 0.0])
        yaw += heading
    return StaticTrajectory(
        Pose.from_euler(position + _shifted(jitter, yaw), yaw=yaw + float(np.radians(jitter.yaw_deg)))
    )


def _parking_place(number: int, setting: Setting, place: PlaceOf) -> ParkingPlace:
    places = () if setting.network is None else setting.network.parking
    if number >= len(places):
        has = f"has {len(places)}, from 0 to {len(places) - 1}" if places else "has none"
        raise ScenarioNameError(
            f"no parking place {number}: scene '{setting.scene}' {has}",
            place("parking"),
            value=number,
            kind="parking place",
            known=[str(one) for one in range(len(places))],
        )
    return places[number]


def _park(spec: ParkSpec, name: str, body: ActorBody, setting: Setting, place: PlaceOf) -> Trajectory:
    lane = setting.lane(spec.lane, place("lane"))
    if spec.parking is not None:
        chosen = _parking_place(spec.parking, setting, place)
        where = Pose.from_euler(chosen.position, yaw=float(np.radians(chosen.yaw_deg)))
    else:
        assert spec.position is not None
        where = Pose.from_euler(setting.ground(spec.position), yaw=float(np.radians(spec.yaw_deg)))
    what = Manoeuvre(spec.way, spec.nose, spec.speed, spec.street_speed, spec.since, spec.approach)
    return park(where, lane, what, body, (setting.start, setting.last + MARGIN), name)


def _table(spec: TableSpec, name: str, body: ActorBody, setting: Setting, place: PlaceOf) -> Trajectory:
    path, wanted = setting.find(spec.file), spec.id or name
    if path.is_dir():
        return _recorded(spec, path, wanted, body, setting, place)
    if path.suffix.lower() == SUFFIX and path.is_file():
        from scarl_sionna.scenario.openscenario.actors import entity_tracks

        tracks: Mapping[str, Trajectory | TableTrack] = entity_tracks(path, setting.street)
    else:
        tracks = tracks_of(path, setting.network, place("file"))
    if wanted not in tracks:
        error = UnknownNameError("track", wanted, tracks)
        raise name_error(error, place("id") if spec.id else place("file"))
    found = tracks[wanted]
    if not isinstance(found, TableTrack):
        return found
    try:
        return found.motion(body)
    except TrajectoryFileError as error:
        raise ScenarioFileError(str(error), place("file"), value=str(path)) from error


def _recorded(
    spec: TableSpec, path: Path, wanted: str, body: ActorBody, setting: Setting, place: PlaceOf
) -> Trajectory:
    """Return a motion of nuScenes' tables: the vehicle that takes it drives its way."""
    try:
        return nuscenes_motion(path, spec.sequence, wanted, body, Conversion(setting.network))
    except UnknownNameError as error:
        key = "sequence" if error.kind == "sequence" else "id" if spec.id else "file"
        raise name_error(error, place(key)) from error
    except TrajectoryFileError as error:
        raise ScenarioFileError(str(error), place("file"), value=str(path)) from error


def tracks_of(
    path: Path, network: LaneNetwork | None, place: ScenarioPlace
) -> dict[str, Trajectory] | dict[str, TableTrack]:
    """Return what a file holds, by id: trajectories, or the samples of a table, which any body can drive along."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ScenarioFileError(f"'{path}' cannot be read ({error.strerror})", place, value=str(path)) from error
    try:
        return _read(str(path), hash(content), network)
    except ScenarioError:
        raise
    except ScarlError as error:
        raise ScenarioFileError(str(error), place, value=str(path)) from error


@lru_cache(maxsize=8)
def _read(path: str, content: int, network: LaneNetwork | None) -> dict[str, Trajectory] | dict[str, TableTrack]:
    """Return the tracks of a file; `content` is a hash of its bytes, so that a changed file is read again."""
    if Path(path).suffix.lower() in SUFFIXES:
        return {track.name: track for track in table_tracks(Path(path), network)}
    return read_table(path, ground=network)


def _shifted(jitter: Jitter, heading: float) -> Array:
    cos, sin = np.cos(heading), np.sin(heading)
    return np.array([jitter.along * cos - jitter.lateral * sin, jitter.along * sin + jitter.lateral * cos, 0.0])
