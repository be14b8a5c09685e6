"""Traces of ASAM OSI, ``.osi``: ground truth decoded by the numbers of its fields, without any package.

A trace is messages of Protocol Buffers one after the other, each behind its length of four bytes, the lowest first.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from scarl_sionna.core.errors import TrajectoryFileError
from scarl_sionna.core.untrusted.files import MEGABYTE, open_regular

MOST_BYTES = 2000 * MEGABYTE
"""Size of a trace on the disk [bytes]; it is read message by message."""
LARGEST_MESSAGE = 64 * 2**20
"""A message that says that it is larger is refused [bytes]."""

_VARINT, _DOUBLE, _BYTES, _FLOAT = 0, 1, 2, 5
_SIZES = {_DOUBLE: 8, _FLOAT: 4}
_KINDS = ("unknown", "other", "vehicle", "pedestrian", "animal")
_CLASSES = (
    "unknown", "other", "small_car", "compact_car", "car", "luxury_car", "delivery_van", "heavy_truck", "semitrailer",
    "trailer", "motorbike", "bicycle", "bus", "tram", "train", "wheelchair", "semitractor", "standup_scooter",
    "micromobility_device", "work_machine", "watercraft", "aircraft", "land_vehicle",
)  # fmt: skip # a table
"""Names of MovingObject.Type and of VehicleClassification.Type by number."""

Triple = tuple[float, float, float]


class TracedObject(NamedTuple):
    """A moving object as a message has it: centre of its box [m], roll, pitch, yaw [rad], None where it has none."""

    number: int
    kind: str
    position: Triple
    angles: Triple
    velocity: Triple | None
    yaw_rate: float
    height: float


class TracedTruth(NamedTuple):
    """A ground truth: its time [s], the number of the host vehicle, and who moves."""

    time: float
    host: int | None
    objects: tuple[TracedObject, ...]


def read_trace(path: Path) -> Iterator[TracedTruth]:
    """Yield the ground truths of an ``.osi`` trace of GroundTruth or of SensorView.

    Which of them is told by the name of the file (``gt`` or ``sv`` between underlines, as OSI has it), else by the
    fields of the messages.

    Raises
    ------
    TrajectoryFileError
        If the file is not there, or no such trace; `row` is the message, from 1.

    References
    ----------
    .. [1] ASAM OSI 3.8, osi_groundtruth.proto, osi_sensorview.proto, osi_object.proto, osi_common.proto; the numbers of
       fields are the same in all of OSI 3.
    """
    words = path.stem.lower().split("_")
    is_view = True if "sv" in words else False if "gt" in words else None
    for row, raw in enumerate(_messages(path), 1):
        try:
            fields = list(_fields(raw))
            if is_view is None and (told := {number for number, _ in fields} & {5, 7}):
                is_view = 5 not in told
            if is_view:
                inner = next((value for number, value in fields if number == 7), None)
                if inner is None:
                    raise ValueError("a SensorView without global_ground_truth")
                fields = list(_fields(_bytes(inner)))
            yield _truth(fields)
        except ValueError as error:
            remedy = "give a trace of GroundTruth or SensorView (OSI 3)"
            raise TrajectoryFileError(f"message {row} cannot be read ({error})", path, remedy) from error


def _messages(path: Path) -> Iterator[memoryview]:
    """Yield the bytes of each message."""
    remedy = "give a whole .osi trace, each message behind its length"
    try:
        with open_regular(path, MOST_BYTES) as file:
            row = 0
            while head := file.read(4):
                row += 1
                size = struct.unpack("<I", head)[0] if len(head) == 4 else 0
                if size > LARGEST_MESSAGE:
                    said = f"message {row} says that it has {size} bytes, at most {LARGEST_MESSAGE} are read"
                    raise TrajectoryFileError(said, path, remedy)
                raw = file.read(size)
                if len(head) < 4 or len(raw) < size:
                    raise TrajectoryFileError(f"ends within message {row}", path, remedy)
                yield memoryview(raw)
    except OSError as error:
        raise TrajectoryFileError(f"cannot be read ({error.strerror or error})", path, remedy) from error


def _fields(raw: memoryview) -> Iterator[tuple[int, int | float | memoryview]]:
    """Yield number and value of each field of a message.

    Raises
    ------
    ValueError
        If the bytes are no message.
    """
    at = 0
    while at < len(raw):
        key, at = _varint(raw, at)
        number, wire = key >> 3, key & 7
        if number == 0:
            raise ValueError("a field has the number 0")
        if wire == _VARINT:
            value, at = _varint(raw, at)
            yield number, value
            continue
        if wire == _BYTES:
            size, at = _varint(raw, at)
        elif wire in _SIZES:
            size = _SIZES[wire]
        else:
            raise ValueError(f"field {number} has the unknown wire type {wire}")
        if at + size > len(raw):
            raise ValueError(f"field {number} goes on beyond the message")
        part = raw[at : at + size]
        at += size
        yield number, part if wire == _BYTES else struct.unpack("<d" if wire == _DOUBLE else "<f", part)[0]


def _varint(raw: memoryview, at: int) -> tuple[int, int]:
    """Return a number of seven bits a byte, and where it ends."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(raw):
            raise ValueError("it ends within a number")
        value |= (raw[at] & 0x7F) << shift
        at += 1
        if raw[at - 1] < 0x80:
            return value & (2**64 - 1), at
    raise ValueError("a number of more than ten bytes")


def _bytes(value: object) -> memoryview:
    if not isinstance(value, memoryview):
        raise ValueError("a number where a message should be")  # of the file, not of a caller
    return value


def _table(value: object) -> dict[int, int | float | memoryview]:
    """Return the fields of a message by number, of repeated ones the last."""
    return dict(_fields(_bytes(value)))


def _whole(table: dict[int, int | float | memoryview], number: int) -> int:
    value = table.get(number, 0)
    if not isinstance(value, int):
        raise ValueError(f"field {number} is no whole number")
    return value


def _real(table: dict[int, int | float | memoryview], number: int) -> float:
    value = table.get(number, 0.0)
    if not isinstance(value, float):
        raise ValueError(f"field {number} is no floating point number")
    return value


def _triple(value: object) -> Triple:
    table = _table(value)
    return _real(table, 1), _real(table, 2), _real(table, 3)


def _truth(fields: list[tuple[int, int | float | memoryview]]) -> TracedTruth:
    time, host, objects = 0.0, None, []
    for number, value in fields:
        if number == 2:
            stamp = _table(value)
            seconds = _whole(stamp, 1)
            time = (seconds - 2**64 if seconds >= 2**63 else seconds) + 1e-9 * _whole(stamp, 2)
        elif number == 3:
            host = _whole(_table(value), 1)
        elif number == 5:
            objects.append(_object(value))
    return TracedTruth(time, host, tuple(objects))


def _object(value: object) -> TracedObject:
    table = _table(value)
    base = _table(table.get(2, memoryview(b"")))
    kind = _name(_KINDS, _whole(table, 3))
    if kind == "vehicle" and 6 in table:
        kind = f"vehicle.{_name(_CLASSES, _whole(_table(table[6]), 1))}"
    return TracedObject(
        _whole(_table(table.get(1, memoryview(b""))), 1),
        kind,
        _triple(base.get(2, memoryview(b""))),
        _triple(base.get(3, memoryview(b""))),
        _triple(base[4]) if 4 in base else None,
        _triple(base[6])[2] if 6 in base else 0.0,
        _triple(base[1])[2] if 1 in base else 0.0,
    )


def _name(names: tuple[str, ...], number: int) -> str:
    return names[number] if number < len(names) else "other"
