"""Traces of ASAM OSI written by the numbers of OSI's fields, by nothing of the package."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

VEHICLE, PEDESTRIAN = 2, 3
COMPACT_CAR, DELIVERY_VAN = 3, 6


@dataclass(frozen=True)
class Moving:
    """A moving object: centre of its box [m], heading [rad], velocity [m/s], length, width, height [m]."""

    number: int
    position: Sequence[float]
    yaw: float = 0.0
    velocity: Sequence[float] | None = None
    size: Sequence[float] = (4.5, 1.8, 1.5)
    kind: int = VEHICLE
    vehicle: int | None = COMPACT_CAR
    pitch: float = 0.0
    yaw_rate: float | None = None


def varint(value: int) -> bytes:
    out = bytearray()
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*out, value])


def message(*fields: tuple[int, int | float | bytes]) -> bytes:
    """Whole numbers as varints, others as doubles, bytes as messages within."""
    out = b""
    for number, value in fields:
        if isinstance(value, bytes):
            out += varint(number << 3 | 2) + varint(len(value)) + value
        elif isinstance(value, float):
            out += varint(number << 3 | 1) + struct.pack("<d", value)
        else:
            out += varint(number << 3) + varint(value % 2**64)
    return out


def vector(values: Sequence[float]) -> bytes:
    return message(*((axis, float(value)) for axis, value in enumerate(values, 1)))


def moving(one: Moving) -> bytes:
    length, width, height = one.size
    base = [(1, vector((length, width, height))), (2, vector(one.position)), (3, vector((0.0, one.pitch, one.yaw)))]
    base += [(4, vector(one.velocity))] if one.velocity is not None else []
    base += [(6, vector((0.0, 0.0, one.yaw_rate)))] if one.yaw_rate is not None else []
    fields = [(1, message((1, one.number))), (2, message(*base)), (3, one.kind)]
    fields += [(6, message((1, one.vehicle)))] if one.vehicle is not None else []
    return message(*fields, (99, b"of a later version"))


def truth(time: float, objects: Iterable[Moving], host: int | None = None) -> bytes:
    """A GroundTruth, with the version and a stationary object, which nobody reads."""
    nanos = round(1e9 * time)
    stamp = message((1, nanos // 10**9), (2, nanos % 10**9))
    fields = [(1, message((1, 3), (2, 8), (3, 0))), (2, stamp), (4, message((1, message((1, 4)))))]
    fields += [(3, message((1, host)))] if host is not None else []
    return message(*fields, *((5, moving(one)) for one in objects))


def view(ground_truth: bytes) -> bytes:
    """A SensorView around it."""
    return message((1, message((1, 3))), (3, message((1, 1))), (7, ground_truth))


def write_trace(path: Path, messages: Iterable[bytes]) -> Path:
    path.write_bytes(b"".join(struct.pack("<I", len(one)) + one for one in messages))
    return path
