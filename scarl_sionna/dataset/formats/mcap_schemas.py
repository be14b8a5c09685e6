"""JSON schemas of the messages of an MCAP file: Foxglove's types by name, and two of our own."""

from __future__ import annotations

from typing import Any

NUMBER_TYPES = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "f4": 7, "f8": 8}
"""Foxglove's code of a number type, by NumPy's."""

_NUMBER, _INTEGER, _TEXT, _FLAG = {"type": "number"}, {"type": "integer"}, {"type": "string"}, {"type": "boolean"}
_BYTES = {"type": "string", "contentEncoding": "base64"}


def _object(**properties: object) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


_TIME = _object(sec=_INTEGER, nsec=_INTEGER)
_VECTOR = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object(position=_VECTOR, orientation=_QUATERNION)
_COLOR = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_ANY = {"type": "object"}

SCHEMAS: dict[str, dict[str, Any]] = {
    "foxglove.FrameTransforms": _object(
        transforms=_list(
            _object(
                timestamp=_TIME, parent_frame_id=_TEXT, child_frame_id=_TEXT, translation=_VECTOR, rotation=_QUATERNION
            )
        )
    ),
    "foxglove.CompressedImage": _object(timestamp=_TIME, frame_id=_TEXT, data=_BYTES, format=_TEXT),
    "foxglove.CameraCalibration": _object(
        timestamp=_TIME,
        frame_id=_TEXT,
        width=_INTEGER,
        height=_INTEGER,
        distortion_model=_TEXT,
        D=_list(_NUMBER),
        K=_list(_NUMBER),
        R=_list(_NUMBER),
        P=_list(_NUMBER),
    ),
    "foxglove.PointCloud": _object(
        timestamp=_TIME,
        frame_id=_TEXT,
        pose=_POSE,
        point_stride=_INTEGER,
        fields=_list(_object(name=_TEXT, offset=_INTEGER, type=_INTEGER)),
        data=_BYTES,
    ),
    "foxglove.SceneUpdate": _object(
        deletions=_list(_object(timestamp=_TIME, type=_INTEGER, id=_TEXT)),
        entities=_list(
            _object(
                timestamp=_TIME,
                frame_id=_TEXT,
                id=_TEXT,
                lifetime=_TIME,
                frame_locked=_FLAG,
                metadata=_list(_object(key=_TEXT, value=_TEXT)),
                cubes=_list(_object(pose=_POSE, size=_VECTOR, color=_COLOR)),
                arrows=_list(_ANY),
                spheres=_list(_ANY),
                cylinders=_list(_ANY),
                lines=_list(_ANY),
                triangles=_list(_ANY),
                texts=_list(_ANY),
                models=_list(_ANY),
            )
        ),
    ),
    "scarl.Scene": _object(timestamp=_TIME, scene=_TEXT, frame=_INTEGER, seed=_INTEGER),
    "scarl.RadarFrame": _object(
        timestamp=_TIME,
        frame_id=_TEXT,
        shape=_list(_INTEGER),
        dtype=_TEXT,
        axes=_list(_TEXT),
        scale=_NUMBER,
        unit=_TEXT,
        data=_BYTES,
    ),
    "scarl.PolarImage": _object(
        timestamp=_TIME,
        rows=_TEXT,
        azimuth_rad=_list(_NUMBER),
        time_s=_list(_NUMBER),
        columns=_TEXT,
        first_range_m=_NUMBER,
        range_step_m=_NUMBER,
        floor_dbm=_NUMBER,
        step_db=_NUMBER,
    ),
}
"""Schema of each message type, without its title."""
