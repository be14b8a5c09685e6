"""Traces of ASAM OSI read without a package: values, both kinds of message, damage, and other people's readers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import TrajectoryFileError
from scarl_sionna.scenario.motion.tables import read_table
from scarl_sionna.scenario.traffic.people import person_for
from scarl_sionna.scenario.traffic.planned import Conversion
from scarl_sionna.scenario.traffic.recorded.osi import about_trace, read_ground_truth, read_osi
from tests.osi_traces import DELIVERY_VAN, PEDESTRIAN, Moving, message, truth, view, write_trace

TIMES = [100.0 + 0.1 * step for step in range(31)]


def drive() -> list[bytes]:
    """The host drives east at 10 m/s, a van 20 m ahead at 8 m/s, a woman crosses at 1.2 m/s."""
    return [
        truth(
            time,
            [
                Moving(7, (10.0 * (time - 100.0), -1.75, 0.75), velocity=(10.0, 0.0, 0.0), yaw_rate=0.0),
                Moving(9, (20.0 + 8.0 * (time - 100.0), -1.75, 1.1), size=(5.2, 2.0, 2.2), vehicle=DELIVERY_VAN),
                Moving(2**40, (50.0, 3.0 + 1.2 * (time - 100.0), 0.9), np.pi / 2, kind=PEDESTRIAN, vehicle=None),
            ],
            host=7,
        )
        for time in TIMES
    ]


@pytest.mark.parametrize("name", ["run_gt_120.osi", "drive.osi", "run_sv.osi", "view.osi"])
def test_who_moves_is_read_as_it_was_written(tmp_path: Path, name: str) -> None:
    messages = [view(one) for one in drive()] if "v" in name.split(".")[0].replace("drive", "") else drive()
    path = write_trace(tmp_path / name, messages)
    instants = list(read_ground_truth(path))
    np.testing.assert_allclose([one.time for one in instants], TIMES, atol=1e-9)
    for time, instant in zip(TIMES, instants, strict=True):
        host, van, woman = instant.states
        assert instant.host == "7" and [one.name for one in instant.states] == ["7", "9", str(2**40)]
        assert [host.kind, van.kind, woman.kind] == ["vehicle.compact_car", "vehicle.delivery_van", "pedestrian"]
        np.testing.assert_allclose(van.foot.position, [20.0 + 8.0 * (time - 100.0), -1.75, 0.0], atol=1e-12)
        np.testing.assert_allclose(woman.centre.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
        assert host.velocity is not None and host.velocity.tolist() == [10.0, 0.0, 0.0] and van.velocity is None
    assert about_trace(path) == (pytest.approx(100.0), pytest.approx(103.0), "7")


def test_a_trace_becomes_traffic_and_tracks(tmp_path: Path) -> None:
    path = write_trace(tmp_path / "drive.osi", drive())
    actors = {one.name: one for one in read_osi(path, conversion=Conversion(types={"vehicle.delivery_van": "lorry"}))}
    assert {name: one.model for name, one in actors.items()} == {
        "7": "small_car",
        "9": "lorry",
        str(2**40): person_for(str(2**40), height=1.5),
    }
    twist = actors["9"].trajectory.twist(101.5)
    np.testing.assert_allclose(twist.linear, [8.0, 0.0, 0.0], atol=1e-3)
    tracks = read_table(path)
    assert set(tracks) == {"ego", "9", str(2**40)}
    np.testing.assert_allclose(tracks["ego"].pose(101.5).position, [15.0, -1.75, 0.0], atol=1e-3)


def test_other_fields_and_missing_ones(tmp_path: Path) -> None:
    """A body whose message says only where it is; times before 1970; a rate; a turned box."""
    bare = message((2, message((1, -2), (2, 500_000_000))), (5, message((2, message((2, message((1, 3.0))))))))
    turned = truth(5.0, [Moving(1, (1.0, 2.0, 1.0), 0.5, pitch=-0.1, yaw_rate=0.25, size=(4.0, 2.0, 2.0))])
    first, second = read_ground_truth(write_trace(tmp_path / "a_gt.osi", [bare, turned]))
    assert first.time == -1.5 and first.host is None
    (one,) = first.states
    assert (one.name, one.kind, one.velocity, one.height) == ("0", "unknown", None, 0.0)
    assert one.centre.position.tolist() == [3.0, 0.0, 0.0]
    (one,) = second.states
    assert one.yaw_rate == 0.25
    np.testing.assert_allclose(
        one.centre.rotation[:, 0], [np.cos(0.1) * np.cos(0.5), np.cos(0.1) * np.sin(0.5), np.sin(0.1)]
    )


NOT_FINITE = truth(0.0, [Moving(3, (float("nan"), 0.0, 0.0))])
HEAD = struct.Struct("<I")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "holds no message"),
        (HEAD.pack(9) + b"abc", "ends within message 1"),
        (b"\x01\x00", "ends within message 1"),
        (HEAD.pack(2**31), "message 1 says that it has 2147483648 bytes"),
        (HEAD.pack(3) + b"\xff\xff\xff", "message 1 cannot be read .*ends within a number"),
        (HEAD.pack(2) + b"\x2a\x09", "field 5 goes on beyond the message"),
        (HEAD.pack(2) + b"\x13\x00", "unknown wire type 3"),
        (HEAD.pack(2) + b"\x10\x01", "a number where a message should be"),
        (HEAD.pack(len(NOT_FINITE)) + NOT_FINITE, "message 1: moving object 3 has a number that is not finite"),
        (2 * (HEAD.pack(len(drive()[0])) + drive()[0]), "message 2 is of 100 s, the one before of 100 s"),
        (HEAD.pack(len(truth(0.0, ()))) + truth(0.0, ()), "no moving object"),
    ],
)
def test_damage_is_told_with_the_message(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "bad_gt.osi"
    path.write_bytes(content)
    with pytest.raises(TrajectoryFileError, match=said):
        about_trace(path)
        read_osi(path)
    with pytest.raises(TrajectoryFileError, match="cannot be read"):
        read_osi(tmp_path / "none.osi")


def test_no_cut_of_a_trace_is_taken_for_whole(tmp_path: Path) -> None:
    """Every cut within the last message is refused, every changed byte is read or refused by a typed error."""
    whole = write_trace(tmp_path / "a_gt.osi", drive()[:2]).read_bytes()
    path, first = tmp_path / "b_gt.osi", len(drive()[0]) + 4
    for cut in range(first + 1, len(whole), 7):
        path.write_bytes(whole[:cut])
        with pytest.raises(TrajectoryFileError, match="ends within message 2"):
            read_osi(path)
    rng = np.random.default_rng(0)
    for _ in range(300):
        changed = bytearray(whole)
        changed[rng.integers(len(whole))] = rng.integers(256)
        path.write_bytes(changed)
        try:
            about_trace(path)
        except TrajectoryFileError:
            continue


def test_protocol_buffers_themselves_read_the_same(tmp_path: Path) -> None:
    """The writer of these tests is held to Google's reader, given names and numbers of OSI's files."""
    pytest.importorskip("google.protobuf")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    kinds = {"double": 1, "int64": 3, "uint64": 4, "uint32": 13}
    tables = {
        "Vector3d": {"x": (1, "double"), "y": (2, "double"), "z": (3, "double")},
        "Orientation3d": {"roll": (1, "double"), "pitch": (2, "double"), "yaw": (3, "double")},
        "Timestamp": {"seconds": (1, "int64"), "nanos": (2, "uint32")},
        "Identifier": {"value": (1, "uint64")},
        "BaseMoving": {"position": (2, "Vector3d"), "orientation": (3, "Orientation3d"), "velocity": (4, "Vector3d")},
        "VehicleClassification": {"type": (1, "uint32")},
        "MovingObject": {
            "id": (1, "Identifier"),
            "base": (2, "BaseMoving"),
            "type": (3, "uint32"),
            "vehicle_classification": (6, "VehicleClassification"),
        },
        "GroundTruth": {
            "timestamp": (2, "Timestamp"),
            "host_vehicle_id": (3, "Identifier"),
            "moving_object": (5, "MovingObject"),
        },
    }
    file = descriptor_pb2.FileDescriptorProto(name="osi.proto", package="osi", syntax="proto2")
    for name, fields in tables.items():
        made = file.message_type.add(name=name)
        for field, (number, kind) in fields.items():
            label = 3 if field == "moving_object" else 1
            of = {"type": kinds[kind]} if kind in kinds else {"type": 11, "type_name": f".osi.{kind}"}
            made.field.add(name=field, number=number, label=label, **of)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    ground_truth = message_factory.GetMessageClass(pool.FindMessageTypeByName("osi.GroundTruth"))
    path = write_trace(tmp_path / "drive_gt.osi", drive())
    for raw, instant in zip(drive(), read_ground_truth(path), strict=True):
        other = ground_truth.FromString(raw)
        assert other.timestamp.seconds + 1e-9 * other.timestamp.nanos == instant.time
        assert str(other.host_vehicle_id.value) == instant.host
        for one, mine in zip(other.moving_object, instant.states, strict=True):
            place = one.base.position
            assert [place.x, place.y, place.z] == mine.centre.position.tolist() and str(one.id.value) == mine.name
            assert one.base.orientation.yaw == pytest.approx(mine.centre.yaw)


def test_betterosi_reads_the_same(tmp_path: Path) -> None:
    osi = pytest.importorskip("betterosi")
    path = write_trace(tmp_path / "drive_gt.osi", drive())
    others = list(osi.read(str(path), return_ground_truth=True))
    assert len(others) == len(TIMES)
    for other, instant in zip(others, read_ground_truth(path), strict=True):
        for one, mine in zip(other.moving_object, instant.states, strict=True):
            place = one.base.position
            assert [place.x, place.y, place.z] == mine.centre.position.tolist() and str(one.id.value) == mine.name
