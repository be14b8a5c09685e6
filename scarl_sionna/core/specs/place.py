"""A place in a specification: the short form of a pose."""

from __future__ import annotations

from collections.abc import Mapping

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.spec import FieldValue


def fields_of_pose(data: FieldValue) -> FieldValue:
    """Return the fields of a specification with `position` and `quaternion` in place of a `pose` among them."""
    if isinstance(data, Mapping) and isinstance(data.get("pose"), Pose):
        pose = data["pose"]
        rest = {name: value for name, value in data.items() if name != "pose"}
        return {**rest, "position": tuple(pose.position.tolist()), "quaternion": tuple(pose.quaternion.tolist())}
    return data
