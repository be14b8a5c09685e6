"""ASAM OSI: messages by hand and back, a session over a socket, traces written and read as motion, bad input."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import SimulatorError, TrajectoryFileError
from scarl_sionna.fusion.rig import SensorMount
from scarl_sionna.loop.osi import (
    osi_ground_truth,
    osi_poses,
    osi_sensor_data,
    receive_osi,
    send_osi,
    serve_osi,
    write_osi_trace,
)
from scarl_sionna.scenario.traffic.planned import Conversion
from scarl_sionna.scenario.traffic.recorded.osi import read_osi
from tests.scenes import Thing, box, plane, write_scene

osi = pytest.importorskip("betterosi")

EGO = {"kind": "waypoints", "times": [0, 2], "positions": [[0, 0, 0], [20, 0, 0]]}
CAR = {"kind": "waypoints", "times": [0, 1, 2], "positions": [[30, 0, 0], [24, 0, 0], [18, 0.5, 0]]}
FAST = ss.RadarSettings.of("raycast", num_rays=50_000)
RADAR = SensorMount(
    "radar", "radar", ss.RadarSpec().with_(num_chirps=64, num_samples=128), ss.Pose([2.1, 0.0, 0.8]), FAST
)
RIG = ss.Rig("one", (RADAR,))


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    path = write_scene(
        tmp_path_factory.mktemp("osi"),
        instances=[
            Thing("ground", plane(400, 400), "Roads", is_object=False),
            Thing("house", box((10, 6, 8), (50, 20, 4)), "Building"),
        ],
        actors=[
            Thing("ego", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", EGO),
            Thing("car", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", CAR),
        ],
        ego="ego",
    )
    return ss.load_scene(path)


def truth_of(time: float, *, at: float, speed: float) -> object:
    """Return a message by hand: the host drives at 10 m/s, a car stands or comes towards it, turned by half a turn."""

    def moving(number: int, x: float, yaw: float, along: float) -> object:
        kind = osi.MovingObject.VehicleClassification
        return osi.MovingObject(
            id=osi.Identifier(value=number),
            type=osi.MovingObject.Type.VEHICLE,
            vehicle_classification=kind(type=kind.Type.COMPACT_CAR),
            base=osi.BaseMoving(
                dimension=osi.Dimension3d(length=4.0, width=1.8, height=1.5),
                position=osi.Vector3d(x=x, y=0.0, z=0.75),
                orientation=osi.Orientation3d(yaw=yaw),
                velocity=osi.Vector3d(x=along),
            ),
        )

    nanos = round(1e9 * time)
    return osi.GroundTruth(
        timestamp=osi.Timestamp(seconds=nanos // 10**9, nanos=nanos % 10**9),
        host_vehicle_id=osi.Identifier(value=7),
        moving_object=[moving(7, 10.0 * time, 0.0, 10.0), moving(9, at, np.pi, speed)],
    )


def test_an_object_of_a_message_is_where_and_how_fast_it_says() -> None:
    base = osi.BaseMoving(
        dimension=osi.Dimension3d(height=2.0),
        position=osi.Vector3d(x=5.0, y=1.0, z=3.0),
        orientation=osi.Orientation3d(yaw=np.pi / 2, pitch=-0.1),  # to y, nose up: the foot is ahead of the centre
        velocity=osi.Vector3d(y=4.0),
        orientation_rate=osi.Orientation3d(yaw=0.5),
    )
    walker = osi.MovingObject(id=osi.Identifier(value=3), type=osi.MovingObject.Type.PEDESTRIAN, base=base)
    (found,) = osi_poses(osi.GroundTruth(moving_object=[walker])).values()
    assert found.body == "adult_man" and found.twist is not None
    np.testing.assert_allclose(found.pose.position, [5.0, 1.0 + np.sin(0.1), 3.0 - np.cos(0.1)], atol=1e-12)
    np.testing.assert_allclose(found.pose.rotation[:, 0], [0.0, np.cos(0.1), np.sin(0.1)], atol=1e-12)
    np.testing.assert_allclose(
        found.twist.linear, [-0.5 * np.sin(0.1), 4.0, 0.0], atol=1e-12
    )  # 0.1 m ahead, turning left


def test_truth_of_a_frame_goes_out_and_comes_in(world: ss.World) -> None:
    frame = ss.observe(world, RIG, 1.0, 0)
    raw = osi_ground_truth(frame).to_binary()
    poses = osi_poses(osi.GroundTruth.from_binary(raw))
    state = world.at(1.0)
    own = {item.instance: item for item in frame.objects if item.is_actor}
    assert set(poses) == {"ego", *(str(number) for number, item in own.items() if item.name == "car")}
    for name, told in poses.items():
        actor = "ego" if name == "ego" else "car"
        foot = state.actor_pose(actor).apply([0.0, 0.0, 0.95 - 0.75])  # the box's underside
        np.testing.assert_allclose(told.pose.position, foot, atol=1e-9)
        np.testing.assert_allclose(told.pose.rotation, state.actor_pose(actor).rotation, atol=1e-9)
        np.testing.assert_allclose(told.twist.linear, state.actor_twist(actor).linear, atol=1e-9)
    assert len(osi.GroundTruth.from_binary(raw).stationary_object) == 1


def test_a_sensor_is_mounted_where_the_host_s_box_and_axle_say(world: ss.World) -> None:
    """ISO 8855, as OSI has it: from the middle of the rear axle, which `bbcenter_to_rear` tells."""
    frame = ss.observe(world, RIG, 1.0, 0)
    for axles, x in ((None, -0.295 * 4.0), ({"ego": -1.4}, -1.4)):
        told = osi.SensorData.from_binary(osi_sensor_data(frame, axles=axles).to_binary())
        truth = told.sensor_view[0].global_ground_truth
        host = next(one for one in truth.moving_object if one.id.value == truth.host_vehicle_id.value)
        rear, at = host.vehicle_attributes.bbcenter_to_rear, told.feature_data.radar_sensor[0].header.mounting_position
        assert rear.x == pytest.approx(x) and rear.y == 0.0 and rear.z == pytest.approx(0.33 - 0.75)
        place = [getattr(host.base.position, k) + getattr(rear, k) + getattr(at.position, k) for k in "xyz"]
        np.testing.assert_allclose(place, frame.radars["radar"].world_from_sensor.position, atol=1e-6)


@pytest.mark.parametrize("sensor_view", [False, True])
def test_a_trace_has_the_axles_that_are_told(world: ss.World, tmp_path: Path, sensor_view: bool) -> None:
    frame = ss.observe(world, RIG, 1.0, 0, only=[])
    path = write_osi_trace([frame], tmp_path / "a_gt.osi", sensor_view=sensor_view, axles={"ego": -1.4})
    kind = osi.SensorView if sensor_view else osi.GroundTruth
    told = kind.from_binary(path.read_bytes()[4:])  # behind its length
    truth = told.global_ground_truth if sensor_view else told
    rear = {one.id.value: one.vehicle_attributes.bbcenter_to_rear.x for one in truth.moving_object}
    host = truth.host_vehicle_id.value
    assert rear.pop(host) == pytest.approx(-1.4) and list(rear.values()) == pytest.approx([-0.295 * 4.0])


def test_a_session_is_stepped_over_a_socket(world: ss.World) -> None:
    settings = ss.SessionSettings(bodies={"small_car": 1}, detail="light")
    here, there = socket.socketpair()
    answers = []

    def other_side() -> None:
        with there:
            for step in range(3):
                send_osi(there, truth_of(0.1 * step, at=30.0 - 0.8 * step, speed=-8.0))
                answers.append(receive_osi(there, osi.SensorData))

    client = threading.Thread(target=other_side)
    client.start()
    with here, ss.Session(world, RIG, settings) as session:
        frames = list(serve_osi(session, here))
    client.join(30.0)
    with ss.Session(world, RIG, settings) as session:
        direct = [session.step(0.1 * n, osi_poses(truth_of(0.1 * n, at=30.0 - 0.8 * n, speed=-8.0))) for n in range(3)]
    assert len(frames) == len(answers) == 3
    for mine, other, answer in zip(frames, direct, answers, strict=True):
        assert mine.results["radar"].adc_int.tobytes() == other.results["radar"].adc_int.tobytes()
        assert answer.to_binary() == osi_sensor_data(mine).to_binary()
        assert {o.name for o in mine.objects if o.is_actor} == {"ego", "9"}
    last = answers[-1].feature_data.radar_sensor[0]
    assert last.header.mounting_position.position.x == pytest.approx(2.1 + 0.295 * 4.0)  # from the rear axle
    assert last.header.mounting_position.position.z == pytest.approx(0.8 - (0.2 + 0.33))  # the box begins at 0.2 m
    strongest = max(last.detection, key=lambda one: one.snr if abs(one.radial_velocity) > 4.0 else -99.0)
    # the car's front, 2 m before its middle, from a radar 2.1 m before the ego's; it comes at 8 m/s over ground
    assert strongest.position.distance == pytest.approx(30.0 - 1.6 - 2.0 - (2.0 + 2.1), abs=1.0)
    assert strongest.radial_velocity == pytest.approx(8.0, abs=0.5)  # towards the sensor: positive


@pytest.mark.parametrize("name", ["run_gt.osi", "run_sv.osi", "run.mcap"])
def test_a_trace_is_read_as_motion(world: ss.World, tmp_path: Path, name: str) -> None:
    away = RIG.with_radar(FAST)
    frames = [ss.observe(world, away, 0.1 * step, 0, index=step, only=[]) for step in range(20)]
    path = write_osi_trace(frames, tmp_path / name, sensor_view="_sv" in name)
    actors = read_osi(path, conversion=Conversion(types={"vehicle.car": "small_car"}))
    assert [one.model for one in actors] == ["small_car"] * 2
    number = {item.name: str(item.instance) for item in frames[0].objects}
    found = {one.name: one.trajectory for one in actors}
    for actor in ("ego", "car"):
        for time in (0.3, 0.95, 1.6):
            pose = world.at(time).actor_pose(actor)
            assert np.linalg.norm(found[number[actor]].pose(time).position[:2] - pose.position[:2]) < 0.05
    assert found[number["ego"]].twist(1.0).linear == pytest.approx([10.0, 0.0, 0.0], abs=0.05)


@pytest.fixture
def pair() -> Iterator[tuple[socket.socket, socket.socket]]:
    here, there = socket.socketpair()
    with here, there:
        yield here, there


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        (b"\x05\x00", "within the length"),
        (struct.pack("<I", 9) + b"abc", "within a message"),
        (struct.pack("<I", 2**31), "announced"),
        (struct.pack("<I", 3) + b"\xff\xff\xff", "not an OSI message"),
    ],
)
def test_bad_streams_are_refused(pair: tuple[socket.socket, socket.socket], sent: bytes, said: str) -> None:
    here, there = pair
    there.sendall(sent)
    there.shutdown(socket.SHUT_WR)
    with pytest.raises(SimulatorError, match=said):
        receive_osi(here, osi.GroundTruth)


def test_bad_numbers_and_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryFileError, match="not finite"):
        osi_poses(truth_of(0.0, at=float("nan"), speed=0.0))
    for name, content in {
        "none_gt.osi": None,
        "a.txt": b"",
        "b_gt.osi": b"\x09\x00\x00\x00abc",
        "c.mcap": b"x",
    }.items():
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(TrajectoryFileError):
            read_osi(path)
