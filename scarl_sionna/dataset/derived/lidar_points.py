"""Lidar returns at the frame's instant: the sensor's own motion during a scan taken out."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from scarl_sionna.core.results import Frame, LidarScan


def world_points(frame: Frame, scan: LidarScan) -> npt.NDArray[np.float64]:
    """Return the returns of a scan in the world [m], shape (num_points, 3).

    A position that refers to the shot's own time (no `deskew`) is taken from where the sensor was then: the vehicle
    goes on with its twist during the scan. What moves in the world stays where its shot met it.
    """
    if scan.spec.deskew or scan.time is None or not np.any(scan.time):
        return scan.world_from_sensor.apply(scan.position)
    vehicle, twist, time = frame.world_from_vehicle.position, frame.vehicle_twist, scan.time.astype(np.float64)[:, None]
    turned = Rotation.from_rotvec(time * twist.angular)
    offset = scan.world_from_sensor.apply(scan.position) - vehicle
    return vehicle + time * twist.linear + turned.apply(offset)


def elevation_line(scan: LidarScan) -> npt.NDArray[np.int64]:
    """Return the elevation line of every return, 0 is the lowest, shape (num_points,)."""
    row, _ = scan.spec.scan.cells()
    return scan.spec.num_elevation - 1 - row[scan.shot]
