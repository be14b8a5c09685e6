"""What recordings (MCAP, ROS bags) have in common: one clock, frames of reference, clouds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import ClosedRadarFrame, Frame, LidarScan, RadarFrame
from scarl_sionna.core.scans.radar import RadarScan
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.lidar_points import world_points
from scarl_sionna.dataset.derived.radar_points import sensed_points
from scarl_sionna.signal.detection.map_peaks import map_of_frame, peaks_of_map

from .source import FrameSource, SceneFrames

Columns = dict[str, npt.NDArray[Any]]

WORLD, VEHICLE = "world", "vehicle"
SCENE_GAP = 1_000_000_000
"""A scene begins this long after the one before it ends [ns]: a recording has one clock."""
BOX_ALPHA = 0.35
"""Opacity of boxes."""
TAKES = ("camera", "lidar", "radar", "scanning_radar", "closed_radar")
"""Kinds of sensors that have messages in a recording."""


def timed_frames(source: FrameSource, first: int | None = None) -> Iterator[tuple[SceneFrames, Frame, int]]:
    """Yield every frame with its scene and its time in the recording [ns].

    Parameters
    ----------
    source : FrameSource
    first : int, optional
        The first scene begins not before this [ns].
    """
    last = None if first is None else first - SCENE_GAP
    delay = 0
    for scene in source.scenes:
        for position, frame in enumerate(scene):
            if position == 0 and last is not None:
                delay = max(0, last + SCENE_GAP - frame.timestamp_ns)
            last = frame.timestamp_ns + delay
            yield scene, frame, last


def transforms(source: FrameSource, frame: Frame) -> Iterator[tuple[str, str, Pose]]:
    """Yield parent, child and pose (parent_from_child) of every frame of reference.

    The vehicle in the world, each sensor on the vehicle, and the optical axes of each camera (x right, y down).
    """
    yield WORLD, VEHICLE, frame.world_from_vehicle
    for name in frame.results:
        yield VEHICLE, name, source.vehicle_from_sensor(name)
    optical = Pose.from_rotation(np.zeros(3), CAMERA_OPTICAL_FROM_SENSOR.T)
    for name in frame.images:
        yield name, f"{name}/optical", optical


def lidar_columns(frame: Frame, scan: LidarScan) -> Columns:
    """Return the returns of a lidar by column, in its own axes at the frame's instant; nan: velocity not told."""
    place = scan.world_from_sensor.inverse().apply(world_points(frame, scan))
    return {
        "x": place[:, 0],
        "y": place[:, 1],
        "z": place[:, 2],
        "intensity": scan.intensity,
        "radial_velocity": scan.radial_velocity,
        "semantic": scan.semantic,
        "instance": scan.instance,
    }


def detection_columns(frame: Frame, radar: RadarFrame, pfa: float) -> Columns:
    """Return the detections of a radar by column, in its own axes."""
    sensed = sensed_points(frame, radar, pfa)
    points = sensed.points
    return {
        "x": points.position[:, 0],
        "y": points.position[:, 1],
        "z": points.position[:, 2],
        "radial_velocity": points.radial_velocity,
        "velocity_over_ground": sensed.compensated_velocity,
        "snr_db": points.snr_db,
        "rcs_dbsm": power_to_db(points.rcs),
    }


def peak_columns(radar: ClosedRadarFrame) -> Columns:
    """Return the peaks of the map of a radar without raw data by column, in its own axes."""
    points = peaks_of_map(map_of_frame(radar), radar.spec.threshold_db, radar.spec.gain_db)
    x, y, z = points.position.T
    return {"x": x, "y": y, "z": z, "radial_velocity": points.radial_velocity, "snr_db": points.snr_db}


def about_image(scan: RadarScan) -> dict[str, Any]:
    """Return what the rows, columns and codes of the image of a scanning radar stand for."""
    return {
        "rows": "azimuth, left positive, in the sensor frame",
        "azimuth_rad": scan.azimuth.tolist(),
        "time_s": scan.time.tolist(),
        "columns": "range",
        "first_range_m": float(scan.spec.range[0]),
        "range_step_m": float(scan.spec.range[1] - scan.spec.range[0]),
        "floor_dbm": float(scan.floor_dbm),
        "step_db": float(scan.spec.image_step_db),
    }


def scan_columns(detections: Columns) -> dict[str, Any]:
    """Return the fields of radar_msgs/RadarReturn of detections, in their order; azimuth is positive to the left."""
    x, y, z = (np.asarray(detections[axis], dtype=np.float64) for axis in "xyz")
    across = np.hypot(x, y)
    return {
        "range": np.hypot(across, z),
        "azimuth": np.arctan2(y, x),
        "elevation": np.arctan2(z, across),
        "doppler_velocity": detections["radial_velocity"],
        "amplitude": detections["snr_db"],
    }


def packed(columns: Mapping[str, npt.NDArray[Any]]) -> npt.NDArray[np.void]:
    """Return columns as rows of a cloud: numbers with a fraction as float32, whole ones as they are."""
    kinds = {key: v.dtype.str if v.dtype.kind in "iu" else "<f4" for key, v in columns.items()}
    rows = np.zeros(len(columns["x"]), dtype=list(kinds.items()))
    for key, values in columns.items():
        rows[key] = values
    return rows
