"""ASAM OSI beside a session: ground truth in, sensor data out, over a socket or as traces. Needs the extra ``osi``."""

from __future__ import annotations

import socket
import struct
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import SimulatorError
from scarl_sionna.core.packages import require
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, ObjectState
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.scenario.traffic.recorded.osi import moving_states

from .motion import ActorPose
from .session import Session

Message = Any
"""A message of betterosi."""
LARGEST = 64 * 2**20
"""A message that says that it is larger is refused [bytes]."""
_HEADER = struct.Struct("<I")
_VERSION = (3, 8, 0)
_KINDS = {"Car": "CAR", "Truck": "HEAVY_TRUCK", "Bus": "BUS", "Train": "TRAIN", "Motorcycle": "MOTORBIKE"}
_KINDS |= {"Bicycle": "BICYCLE"}
_AXLE_SHARE = 0.295
"""How far the rear axle is behind the middle of a vehicle, of its length: cars of this package have 0.29 to 0.30."""
_WHEEL_RADIUS = {"Truck": 0.5, "Bus": 0.5}
_CAR_WHEEL = 0.33
"""Height of the axle of all other vehicles [m]."""


def osi_poses(
    truth: Message, types: Mapping[str, str] | None = None, ego: str | None = None, ego_name: str = "ego"
) -> dict[str, ActorPose]:
    """Return what `Session.step` takes from a GroundTruth message.

    Parameters
    ----------
    truth : betterosi.GroundTruth
    types : mapping of str to str, optional
        Actor models by kind, as ``{"vehicle.car": "suv"}``; else ``scenario.traffic.recorded.osi.MODELS``.
    ego : str, optional
        Number of the scene's own `ego_name`; None: the message's host vehicle. The others are called by their numbers.
    ego_name : str

    Returns
    -------
    dict of str to ActorPose

    Raises
    ------
    TrajectoryFileError
        If a number is not finite.
    """
    if ego is None and truth.has_field("host_vehicle_id"):
        ego = str(truth.host_vehicle_id.value)
    found = {}
    for one in moving_states(truth):
        twist = None
        if one.velocity is not None:
            angular = np.array([0.0, 0.0, one.yaw_rate])
            twist = Twist(Twist(one.velocity, angular).velocity_at(one.foot.position - one.centre.position), angular)
        is_ego = one.name == ego
        found[ego_name if is_ego else one.name] = ActorPose(one.foot, twist, None if is_ego else one.model(types))
    return found


def osi_ground_truth(frame: Frame, host: str = "ego", axles: Mapping[str, float] | None = None) -> Message:
    """Return the truth about a frame's objects as a GroundTruth message.

    Parameters
    ----------
    frame : Frame
    host : str
        Name of the host vehicle among its objects.
    axles : mapping of str to float, optional
        x of the rear axle from the middle of the body by the name of the object [m], as `rear_axle` of actor models;
        of others it is -0.295 of their length, an estimate.

    Returns
    -------
    betterosi.GroundTruth
        Actors are moving objects, all else is stationary; numbers are our instances, names stand in
        ``source_reference``. A session gives the number of a body that is free again to the next actor that takes it:
        there, the name tells who it is. Of rates the yaw rate alone is written. Vehicles bear `bbcenter_to_rear`; the
        height of an axle is an estimate: 0.5 m of lorries and buses, 0.33 m of others.
    """
    osi = require("betterosi", "osi")
    truth = osi.GroundTruth(version=_version(osi), timestamp=_timestamp(osi, frame.timestamp_ns))
    for item in frame.objects:
        if item.is_actor:
            truth.moving_object.append(_moving(osi, item, axles))
        else:
            base = osi.BaseStationary(**_box(osi, item))
            truth.stationary_object.append(osi.StationaryObject(id=osi.Identifier(value=item.instance), base=base))
        if item.name == host:
            truth.host_vehicle_id = osi.Identifier(value=item.instance)
    return truth


def _moving(osi: Any, item: ObjectState, axles: Mapping[str, float] | None) -> Message:  # noqa: ANN401  # the package
    name = SEMANTIC_CLASSES[item.semantic]
    types = osi.MovingObject.Type
    base = osi.BaseMoving(
        velocity=_vector(osi, item.twist.linear),
        orientation_rate=osi.Orientation3d(yaw=float(item.twist.angular[2])),
        **_box(osi, item),
    )
    called = osi.ExternalReference(reference="scarl-sionna", type="name", identifier=[item.name])
    moving = osi.MovingObject(id=osi.Identifier(value=item.instance), base=base, source_reference=[called])
    if name in ("Pedestrian", "Rider"):
        moving.type = types.PEDESTRIAN
    else:
        moving.type = types.VEHICLE
        kinds = osi.MovingObject.VehicleClassification.Type
        kind = getattr(kinds, _KINDS.get(name, "OTHER"))
        moving.vehicle_classification = osi.MovingObject.VehicleClassification(type=kind)
        rear = _vector(osi, _rear_axle(item, axles))
        moving.vehicle_attributes = osi.MovingObject.VehicleAttributes(bbcenter_to_rear=rear)
    return moving


def _rear_axle(item: ObjectState, axles: Mapping[str, float] | None) -> npt.NDArray[np.float64]:
    """Return the middle of a vehicle's rear axle in the axes of its box, from the box's centre, shape (3,) [m]."""
    length, _, height = (float(size) for size in item.size)
    wheel = min(_WHEEL_RADIUS.get(SEMANTIC_CLASSES[item.semantic], _CAR_WHEEL), 0.5 * height)
    return np.array([(axles or {}).get(item.name, -_AXLE_SHARE * length), 0.0, wheel - 0.5 * height])


def _world_from_host(frame: Frame, host: str, axles: Mapping[str, float] | None) -> Pose:
    """Return the pose of OSI's vehicle frame: at the middle of the rear axle; without a host that of the rig."""
    for item in frame.objects:
        if item.name == host:
            return item.world_from_box.compose(Pose(_rear_axle(item, axles)))
    return frame.world_from_vehicle


def _box(osi: Any, item: ObjectState) -> dict[str, Message]:  # noqa: ANN401
    length, width, height = (float(size) for size in item.size)
    pose = item.world_from_box
    return {
        "dimension": osi.Dimension3d(length=length, width=width, height=height),
        "position": _vector(osi, pose.position),
        "orientation": _orientation(osi, pose),
    }


def _orientation(osi: Any, pose: Pose) -> Message:  # noqa: ANN401
    turn = pose.rotation
    yaw, roll = np.arctan2(turn[1, 0], turn[0, 0]), np.arctan2(turn[2, 1], turn[2, 2])
    return osi.Orientation3d(yaw=float(yaw), pitch=float(np.arcsin(np.clip(-turn[2, 0], -1.0, 1.0))), roll=float(roll))


def _vector(osi: Any, values: Iterable[float]) -> Message:  # noqa: ANN401
    x, y, z = (float(value) for value in values)
    return osi.Vector3d(x=x, y=y, z=z)


def _timestamp(osi: Any, time_ns: int) -> Message:  # noqa: ANN401
    return osi.Timestamp(seconds=time_ns // 10**9, nanos=time_ns % 10**9)


def _version(osi: Any) -> Message:  # noqa: ANN401
    major, minor, patch = _VERSION
    return osi.InterfaceVersion(version_major=major, version_minor=minor, version_patch=patch)


def osi_sensor_data(
    frame: Frame, host: str = "ego", pfa: float = 1e-6, axles: Mapping[str, float] | None = None
) -> Message:
    """Return the detections of a frame's radars as one SensorData message, with the truth as its sensor view.

    Parameters
    ----------
    frame : Frame
    host : str
        Name of the host vehicle.
    pfa : float
        Probability of false alarm of the detections.
    axles : mapping of str to float, optional
        As of :func:`osi_ground_truth`.

    Returns
    -------
    betterosi.SensorData
        ``feature_data.radar_sensor`` in the order of the frame's radars, numbered from 0; positions in the sensor's
        frame; radial velocities over ground, positive towards the sensor [1]_. Mounting positions are in the host's
        frame by ISO 8855, whose origin is the middle of its rear axle (`bbcenter_to_rear` of the truth from the
        centre of its box); of a rig without a host they are in the rig's. Images and lidar points are left out.

    References
    ----------
    .. [1] ASAM OSI 3.8, osi_featuredata.proto: RadarDetection, SensorDetectionHeader; osi_object.proto:
           MovingObject.VehicleAttributes.
    """
    osi = require("betterosi", "osi")
    time = _timestamp(osi, frame.timestamp_ns)
    truth, host_from_world = osi_ground_truth(frame, host, axles), _world_from_host(frame, host, axles).inverse()
    features = osi.FeatureData(version=_version(osi))
    for number, radar in enumerate(frame.radars.values()):
        sensed = sensed_points(frame, radar, pfa)
        points = sensed.points
        place = host_from_world.compose(radar.world_from_sensor)
        header = osi.SensorDetectionHeader(
            measurement_time=time,
            cycle_counter=frame.index,
            mounting_position=osi.MountingPosition(
                position=_vector(osi, place.position), orientation=_orientation(osi, place)
            ),
            number_of_valid_detections=points.num_points,
            sensor_id=osi.Identifier(value=number),
        )
        x, y, z = points.position.T.astype(np.float64)
        distance = np.sqrt(x**2 + y**2 + z**2)
        detections = [
            osi.RadarDetection(
                position=osi.Spherical3d(distance=float(r), azimuth=float(a), elevation=float(e)),
                radial_velocity=float(-v),
                rcs=None if np.isnan(size) else float(size),  # a field that is not known is left out
                snr=float(snr),
            )
            for r, a, e, v, size, snr in zip(
                distance,
                np.arctan2(y, x),
                np.arcsin(np.clip(z / np.maximum(distance, 1e-9), -1.0, 1.0)),
                sensed.compensated_velocity,
                power_to_db(points.rcs),
                points.snr_db,
                strict=True,
            )
        ]
        features.radar_sensor.append(osi.RadarDetectionData(header=header, detection=detections))
    view = osi.SensorView(version=_version(osi), timestamp=time, global_ground_truth=truth)
    return osi.SensorData(version=_version(osi), timestamp=time, feature_data=features, sensor_view=[view])


def send_osi(connection: socket.socket, message: Message) -> None:
    """Send a message: its length, four bytes with the lowest first as in ``.osi`` traces, and itself."""
    raw = message.to_binary()
    connection.sendall(_HEADER.pack(len(raw)) + raw)


def receive_osi(connection: socket.socket, kind: type) -> Message | None:
    """Return the next message, of a class of betterosi; None when the other side has closed.

    Raises
    ------
    SimulatorError
        If the stream ends within a message, one is larger than :data:`LARGEST`, or is not of this kind.
    """
    head = _received(connection, _HEADER.size)
    if not head:
        return None
    (size,) = _HEADER.unpack(head)
    if size > LARGEST:
        raise SimulatorError(f"an OSI message of {size} bytes is announced, more than {LARGEST}: is it length-framed?")
    raw = _received(connection, size)
    if len(raw) < size:
        raise SimulatorError("the OSI stream ended within a message")
    try:
        return kind.from_binary(raw)  # type: ignore[attr-defined]
    except ValueError as error:
        raise SimulatorError(f"not an OSI message of the kind {kind.__name__} ({error})") from error


def _received(connection: socket.socket, size: int) -> bytes:
    """Return so many bytes, none at the end of the stream.

    Raises
    ------
    SimulatorError
        If it ends within a length.
    """
    parts, left = [], size
    while left and (part := connection.recv(min(left, 65536))):
        parts.append(part)
        left -= len(part)
    if left and size == _HEADER.size and parts:
        raise SimulatorError("the OSI stream ended within the length of a message")
    return b"".join(parts)


def serve_osi(
    session: Session,
    connection: socket.socket,
    types: Mapping[str, str] | None = None,
    sensor_view: bool = False,
    axles: Mapping[str, float] | None = None,
) -> Iterator[Frame]:
    """Step a session by the messages of a connection and answer each by one SensorData; yields the frames.

    Parameters
    ----------
    session : Session
        Its vehicle is the message's host vehicle.
    connection : socket
        Connected. It ends when the other side closes.
    types : mapping of str to str, optional
        As of :func:`osi_poses`.
    sensor_view : bool
        Messages are SensorView, with the truth in ``global_ground_truth``; else GroundTruth.
    axles : mapping of str to float, optional
        As of :func:`osi_ground_truth`.

    Raises
    ------
    SimulatorError
        As of :func:`receive_osi`.
    ScarlError
        What `Session.step` raises; nothing is answered then.
    """
    osi = require("betterosi", "osi")
    host = session.vehicle if isinstance(session.vehicle, str) else "ego"
    while (message := receive_osi(connection, osi.SensorView if sensor_view else osi.GroundTruth)) is not None:
        truth = message.global_ground_truth if sensor_view else message
        time = truth.timestamp.seconds + 1e-9 * truth.timestamp.nanos
        frame = session.step(time, osi_poses(truth, types, ego_name=host))
        send_osi(connection, osi_sensor_data(frame, host, axles=axles))
        yield frame


def write_osi_trace(
    frames: Iterable[Frame],
    path: str | Path,
    host: str = "ego",
    sensor_view: bool = False,
    axles: Mapping[str, float] | None = None,
) -> Path:
    """Write the truth of frames as a trace, ``.osi`` or ``.mcap`` by the name's end.

    Parameters
    ----------
    frames : iterable of Frame
        In the order of time.
    path : str or Path
        ``.osi`` traces should have ``gt`` or ``sv`` in their name, as OSI has it: ``run_gt.osi``.
    host : str
        Name of the host vehicle.
    sensor_view : bool
        SensorView messages around the ground truth.
    axles : mapping of str to float, optional
        As of :func:`osi_ground_truth`.

    Raises
    ------
    MissingPackageError
        If betterosi is not installed.
    """
    osi = require("betterosi", "osi")
    with osi.Writer(str(path)) as writer:
        for frame in frames:
            truth = osi_ground_truth(frame, host, axles)
            if sensor_view:
                truth = osi.SensorView(
                    version=_version(osi),
                    timestamp=truth.timestamp,
                    global_ground_truth=truth,
                    host_vehicle_id=truth.host_vehicle_id,
                )
            writer.add(truth)
    return Path(path)
