"""CAN bus of a nuScenes scene: what follows from the vehicle's motion.

References
----------
.. [1] nuScenes CAN bus expansion: messages ``pose``, ``ms_imu``, ``vehicle_monitor``, and ``route``, ``meta``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist

GRAVITY = 9.806_65
"""Standard gravity [m/s2] (CGPM 1901); an inertial sensor at rest reads it upwards."""
FOLDER = "can_bus"
Array = npt.NDArray[np.float64]


def write_can_bus(folder: Path, scene: str, times_us: Sequence[int], motion: Sequence[tuple[Pose, Twist]]) -> None:
    """Write the CAN bus files of a scene, a message a frame.

    A scene of one frame, which tells no acceleration, gets none.

    Parameters
    ----------
    folder : Path
        The reader's ``dataroot``.
    scene : str
    times_us : sequence of int
        Time of each frame [us].
    motion : sequence of (Pose, Twist)
        Pose of the vehicle on the map and its velocity in map axes, by frame.
    """
    if len(times_us) < 2:
        return
    place = folder / FOLDER
    place.mkdir(exist_ok=True)
    found = messages(times_us, motion)
    route = [pose.position[:2].tolist() for pose, _ in motion]
    for name, content in {**found, "route": route, "meta": _meta(found)}.items():
        (place / f"{scene}_{name}.json").write_text(json.dumps(content) + "\n", encoding="utf-8")


def messages(times_us: Sequence[int], motion: Sequence[tuple[Pose, Twist]]) -> dict[str, list[dict[str, Any]]]:
    """Return the messages of each kind.

    ``pose``: place on the map, velocity, acceleration and rotation in the vehicle's axes; ``ms_imu``: acceleration with
    gravity; ``vehicle_monitor``: speed [km/h] and yaw rate [deg/s]. Accelerations are differences of the velocities of
    neighbouring frames, of second order.
    """
    seconds = np.array(times_us, np.float64) * 1e-6
    linear = np.array([twist.linear for _, twist in motion])
    order: Literal[1, 2] = 2 if len(seconds) > 2 else 1
    change: Array = np.gradient(linear, seconds, axis=0, edge_order=order)
    found: dict[str, list[dict[str, Any]]] = {"ms_imu": [], "pose": [], "vehicle_monitor": []}
    for time, (pose, twist), acceleration in zip(times_us, motion, change, strict=True):
        own = pose.inverse()
        velocity, turn = own.rotate(twist.linear), own.rotate(twist.angular)
        quaternion = pose.quaternion.tolist()
        felt = own.rotate(acceleration + np.array([0.0, 0.0, GRAVITY]))
        found["ms_imu"].append(
            {"linear_accel": felt.tolist(), "q": quaternion, "rotation_rate": turn.tolist(), "utime": int(time)}
        )
        found["pose"].append(
            {
                "accel": own.rotate(acceleration).tolist(),
                "orientation": quaternion,
                "pos": pose.position.tolist(),
                "rotation_rate": turn.tolist(),
                "utime": int(time),
                "vel": velocity.tolist(),
            }
        )
        found["vehicle_monitor"].append(
            {
                "utime": int(time),
                "vehicle_speed": float(np.linalg.norm(velocity)) * 3.6,
                "yaw_rate": float(np.degrees(turn[2])),
            }
        )
    return found


def _meta(found: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Return number, rate and moments of the messages of each kind."""
    meta = {}
    for name, rows in found.items():
        span = (rows[-1]["utime"] - rows[0]["utime"]) * 1e-6
        values = {key: np.array([row[key] for row in rows], np.float64) for key in rows[0] if key != "utime"}
        moments = {
            key: {kind: getattr(np, kind)(value, axis=0).tolist() for kind in ("max", "mean", "min", "std")}
            for key, value in values.items()
        }
        meta[name] = {
            **moments,
            "message_count": len(rows),
            "message_freq": (len(rows) - 1) / span if span > 0.0 else 0.0,
            "timespan": span,
            "var_count": len(values),
        }
    return meta
