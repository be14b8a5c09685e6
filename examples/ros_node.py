"""A ROS 2 node that steps a session: odometry of the ego in, radar scans and points out. Needs ROS 2 with radar_msgs.

python -m examples.ros_node SCENE        (in a shell with ROS 2's environment; never run by us, who have no ROS)

Subscribes ``/odom`` (nav_msgs/Odometry, the ego in the world of the scene); publishes ``/<radar>/scan``
(radar_msgs/RadarScan) and ``/<radar>/points`` (sensor_msgs/PointCloud2) with the time of the odometry.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

import scarl_sionna as ss
from scarl_sionna.dataset.formats.recording import detection_columns, packed, scan_columns
from scarl_sionna.fusion.rig import SensorMount

RADAR = "front/radar"
PFA = 1e-6
_FLOAT32 = 7  # of sensor_msgs/PointField


def actor_pose(odometry: Any) -> ss.ActorPose:  # noqa: ANN401  # a message of ROS
    """Return the ego of nav_msgs/Odometry: pose in the world, velocities in the vehicle's own axes."""
    place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    pose = ss.Pose([place.x, place.y, place.z], [turn.w, turn.x, turn.y, turn.z])
    own, rate = odometry.twist.twist.linear, odometry.twist.twist.angular
    linear, angular = (pose.rotate(np.array([part.x, part.y, part.z])) for part in (own, rate))
    return ss.ActorPose(pose, ss.Twist(linear, angular))


def scan_rows(frame: ss.Frame, name: str) -> list[dict[str, float]]:
    """Return the fields of each radar_msgs/RadarReturn; its azimuth is positive to the left."""
    fields = scan_columns(detection_columns(frame, frame.radars[name], PFA))
    return [dict(zip(fields, map(float, row), strict=True)) for row in zip(*fields.values(), strict=True)]


def cloud_fields(frame: ss.Frame, name: str) -> dict[str, Any]:
    """Return the fields of sensor_msgs/PointCloud2 but the header; `fields` as pairs of name and offset."""
    rows = packed(detection_columns(frame, frame.radars[name], PFA))
    size = rows.dtype.itemsize
    described: Mapping[str, Any] = rows.dtype.fields or {}
    return {
        "height": 1,
        "width": len(rows),
        "fields": [(key, int(value[1])) for key, value in described.items()],
        "is_bigendian": False,
        "point_step": size,
        "row_step": size * len(rows),
        "data": rows.tobytes(),
        "is_dense": True,
    }


def main(scene: str = "highway_guardrail") -> None:
    """Run the node until it is interrupted."""
    import rclpy
    from nav_msgs.msg import Odometry
    from radar_msgs.msg import RadarReturn, RadarScan
    from sensor_msgs.msg import PointCloud2, PointField

    fast = ss.RadarSettings.of("raycast", num_rays=50_000, cell_labels=False)
    spec = ss.RadarSpec.preset("awr1843boost").with_(num_chirps=64, num_samples=128)
    rig = ss.Rig("ros", (SensorMount(RADAR, "radar", spec, ss.Pose([2.36, 0.0, 0.8]), fast),))
    rclpy.init()
    node = rclpy.create_node("scarl_sionna")
    scans = node.create_publisher(RadarScan, f"/{RADAR}/scan", 10)
    clouds = node.create_publisher(PointCloud2, f"/{RADAR}/points", 10)
    first: list[float] = []
    with ss.Session(scene, rig, ss.SessionSettings(rates={"front/*": 10.0})) as session:

        def step(message: Odometry) -> None:
            now = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
            first.append(now)
            del first[1:]
            frame = session.step(now - first[0], {"ego": actor_pose(message)})
            if RADAR not in frame.radars:
                return
            header = message.header
            header.frame_id = RADAR
            scans.publish(RadarScan(header=header, returns=[RadarReturn(**row) for row in scan_rows(frame, RADAR)]))
            cloud = cloud_fields(frame, RADAR)
            cloud["fields"] = [PointField(name=n, offset=o, datatype=_FLOAT32, count=1) for n, o in cloud["fields"]]
            clouds.publish(PointCloud2(header=header, **cloud))

        node.create_subscription(Odometry, "/odom", step, 10)
        try:
            rclpy.spin(node)
        finally:
            node.destroy_node()
            rclpy.shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:2])
