"""The node example without ROS: what it takes from odometry, and what it makes of a frame."""

from __future__ import annotations

from types import SimpleNamespace as Fields

import numpy as np
import pytest

from examples.ros_node import PFA, actor_pose, cloud_fields, scan_rows
from scarl_sionna.dataset.derived.radar_points import sensed_points
from tests.drive import drive


def test_odometry_has_its_velocities_in_the_vehicles_axes() -> None:
    half = np.sqrt(0.5)  # a quarter turn to the left
    pose = Fields(position=Fields(x=1.0, y=2.0, z=0.0), orientation=Fields(w=half, x=0.0, y=0.0, z=half))
    twist = Fields(linear=Fields(x=5.0, y=0.0, z=0.0), angular=Fields(x=0.0, y=0.0, z=0.2))
    told = actor_pose(Fields(pose=Fields(pose=pose), twist=Fields(twist=twist)))
    assert told.twist is not None
    np.testing.assert_allclose(told.twist.linear, [0.0, 5.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(told.twist.angular, [0.0, 0.0, 0.2], atol=1e-12)


def test_a_frame_becomes_a_scan_and_a_cloud() -> None:
    frame = next(iter(drive(num_frames=1, ends=("front",)).scenes[0]))
    name = next(iter(frame.radars))
    points = sensed_points(frame, frame.radars[name], PFA).points
    rows, cloud = scan_rows(frame, name), cloud_fields(frame, name)
    assert len(rows) == cloud["width"] == points.num_points > 0
    first = rows[0]
    left = first["range"] * np.cos(first["elevation"]) * np.sin(first["azimuth"])
    assert left == pytest.approx(points.position[0, 1], abs=1e-3)
    assert [key for key, _ in cloud["fields"]][:3] == ["x", "y", "z"] and len(cloud["data"]) == cloud["row_step"]
    read = np.frombuffer(cloud["data"], "<f4").reshape(points.num_points, -1)
    np.testing.assert_allclose(read[:, :3], points.position, rtol=1e-6)
