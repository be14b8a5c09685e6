"""Files of a nuScenes folder: lidar points with labels, radar points, and the map of the drivable surface."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import scipy.ndimage
from PIL import Image

from scarl_sionna.core.pose import CAMERA_OPTICAL_FROM_SENSOR, Pose
from scarl_sionna.core.results import Frame, ImageFrame, LidarScan
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import power_to_db
from scarl_sionna.dataset.derived.lidar_points import elevation_line, world_points
from scarl_sionna.dataset.derived.radar_points import SensedPoints
from scarl_sionna.dataset.point_clouds.nuscenes import UNKNOWN_RCS_DBSM

RADAR_FIELDS = (
    ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("dyn_prop", "i1"), ("id", "<i2"), ("rcs", "<f4"), ("vx", "<f4"),
    ("vy", "<f4"), ("vx_comp", "<f4"), ("vy_comp", "<f4"), ("is_quality_valid", "i1"), ("ambig_state", "i1"),
    ("x_rms", "i1"), ("y_rms", "i1"), ("invalid_state", "i1"), ("pdh0", "i1"), ("vx_rms", "i1"), ("vy_rms", "i1"),
)  # fmt: skip # a table
"""The 18 fields of a radar point."""
MOVING, STATIONARY, ONCOMING, AMBIGUOUS, UNAMBIGUOUS, VALID, LEAST_FALSE = 0, 1, 2, 1, 3, 0, 1

LIDAR_FROM_VEHICLE_AXES = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""nuScenes' lidar has x right, y forward, z up."""

MAP_RESOLUTION = 0.1
MAP_MARGIN = 120.0
"""Map beyond the ego poses [m]; drawings of the reader reach 57 m."""
MAP_CLOSING = 1.0
"""Gaps of the seen road narrower than this are closed [m]."""
_MAP_REACH = 60.0
_DRIVABLE = np.zeros(256, dtype=np.bool_)
_DRIVABLE[[semantic_id("Roads"), semantic_id("RoadLine")]] = True


def lidar_rows(
    frame: Frame, scans: Sequence[LidarScan], world_from_lidar: Pose
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint8], npt.NDArray[np.uint16]]:
    """Return the returns of lidars of one instant as one cloud.

    Returns
    -------
    points : ndarray of float32, shape (N, 5)
        x, y, z [m], intensity 0 to 255 (reflectance of a diffuser times the cosine of incidence, with the loss in air),
        index of the elevation line.
    semantic : ndarray of uint8, shape (N,)
    instance : ndarray of uint16, shape (N,)
    """
    lidar_from_world = world_from_lidar.inverse()
    parts = []
    for scan in scans:
        place = lidar_from_world.apply(world_points(frame, scan))
        strength = np.clip(255.0 * scan.intensity * scan.distance**2, 0.0, 255.0)
        parts.append(np.column_stack([place, strength, elevation_line(scan)]))
    return (
        np.concatenate(parts).astype(np.float32),
        np.concatenate([scan.semantic for scan in scans]),
        np.concatenate([scan.instance for scan in scans]),
    )


def radar_file(sensed: SensedPoints, radar: RadarSpec) -> bytes:
    """Return detections as a nuScenes radar file: x forward, y left; z is 0 where the array cannot tell elevation.

    An RCS that is not known is `UNKNOWN_RCS_DBSM`: readers take a cloud whose first point has a nan as empty.

    A point is ambiguous where its velocity is known modulo less than ``2 radar.unfolded_velocity``; points of no map,
    without `velocity_interval`, are written as unambiguous.

    The file ends with one byte after the last point, which the reader asks for. Without detections it holds one point
    of nan, which the reader takes for none.
    """
    points, count = sensed.points, sensed.points.num_points
    rows = np.zeros(max(count, 1), dtype=list(RADAR_FIELDS))
    if count:
        for axis, name in enumerate("xyz"):
            rows[name] = points.position[:, axis]
        for axis, name in enumerate(("vx", "vy")):
            rows[name] = points.radial_velocity * sensed.direction[:, axis]
            rows[f"{name}_comp"] = sensed.compensated_velocity * sensed.direction[:, axis]
        still = np.abs(sensed.compensated_velocity) < radar.velocity_resolution
        rows["dyn_prop"] = np.where(still, STATIONARY, np.where(sensed.compensated_velocity > 0, MOVING, ONCOMING))
        rows["id"] = np.arange(count) % 2**15
        rows["rcs"] = np.where(np.isnan(points.rcs), UNKNOWN_RCS_DBSM, power_to_db(points.rcs))
        told = points.velocity_interval
        is_told = told is None or told > 1.999 * radar.unfolded_velocity
        rows["is_quality_valid"], rows["ambig_state"] = 1, np.where(is_told, UNAMBIGUOUS, AMBIGUOUS)
        rows["invalid_state"], rows["pdh0"] = VALID, LEAST_FALSE
        snr = 10.0 ** (points.snr_db / 10.0)
        along = tone_deviation(snr) * radar.range_resolution
        across = points.range * tone_deviation(snr) * 2.0 / radar.num_virtual
        speed = tone_deviation(snr) * radar.velocity_resolution
        for name, value in (("x_rms", along), ("y_rms", across), ("vx_rms", speed), ("vy_rms", speed)):
            rows[name] = deviation_code(value)
    else:
        for name, kind in RADAR_FIELDS:
            if kind == "<f4":
                rows[name] = np.nan
    letters = ["F" if kind == "<f4" else "I" for _, kind in RADAR_FIELDS]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\n"
        "VERSION 0.7\n"
        f"FIELDS {' '.join(name for name, _ in RADAR_FIELDS)}\n"
        f"SIZE {' '.join(kind[-1] for _, kind in RADAR_FIELDS)}\n"
        f"TYPE {' '.join(letters)}\n"
        f"COUNT {' '.join('1' for _ in RADAR_FIELDS)}\n"
        f"WIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA binary\n"
    )
    return header.encode("ascii") + rows.tobytes() + b"\n"


def tone_deviation(snr: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the Cramer-Rao bound of a tone's frequency in bins, ``sqrt(6 / snr) / (2 pi)``, snr after integration.

    References
    ----------
    .. [1] D. C. Rife, R. R. Boorstyn, "Single-tone parameter estimation", IEEE Trans. Inf. Theory 20(5), 1974.
    """
    return np.sqrt(6.0 / np.maximum(np.asarray(snr, dtype=np.float64), 1e-12)) / (2.0 * np.pi)


def deviation_code(value: npt.ArrayLike) -> npt.NDArray[np.int8]:
    """Return a standard deviation [m, m/s] as the sensor's logarithmic code: 0 below 0.005, 30 at 10, 31 above."""
    steps = np.log(np.maximum(np.asarray(value, dtype=np.float64), 0.005) / 0.005) / np.log(10.0 / 0.005) * 30.0
    return np.clip(np.ceil(steps - 1e-9), 0, 31).astype(np.int8)


class DrivableMap:
    """Cells of 0.1 m where any sensor of a scene saw road, gathered frame by frame."""

    def __init__(self) -> None:
        self._cells: list[npt.NDArray[np.int32]] = []
        self._poses: list[npt.NDArray[np.float64]] = []

    def add(self, frame: Frame) -> None:
        """Gather the road that the lidars and the cameras with depth and classes of a frame see."""
        self._poses.append(frame.world_from_vehicle.position)
        for scan in frame.lidars.values():
            self._add(world_points(frame, scan)[_DRIVABLE[scan.semantic]])
        images = list(frame.images.values())
        for depth in (image for image in images if image.depth is not None):
            for labels in (image for image in images if image.semantic is not None):
                if labels.semantic.shape == depth.depth.shape and _same_pose(labels, depth):  # type: ignore[union-attr]
                    self._add(_road_points(depth, labels.semantic))  # type: ignore[arg-type]
                    break

    def origin(self) -> npt.NDArray[np.float64]:
        """Return the world position (x, y, 0) that is the map's lower left corner [m], in whole metres."""
        low = np.min(np.array(self._poses), axis=0) - MAP_MARGIN
        return np.array([np.floor(low[0]), np.floor(low[1]), 0.0])

    def save(self, path: Path) -> tuple[float, float]:
        """Write the map: 255 where road is, 0 elsewhere; x to the right, y upwards. Return width and height [m]."""
        origin = self.origin()[:2]
        high = np.max(np.array(self._poses), axis=0)[:2] + MAP_MARGIN
        width, height = np.ceil((high - origin) / MAP_RESOLUTION).astype(int)
        mask = np.zeros((height, width), dtype=np.bool_)
        for cells in self._cells:
            column, row = (cells - np.rint(origin / MAP_RESOLUTION).astype(int)).T
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            mask[height - 1 - row[inside], column[inside]] = True
        reach = max(1, round(MAP_CLOSING / MAP_RESOLUTION / 2))
        padded = np.pad(mask, reach)
        closed = scipy.ndimage.distance_transform_cdt(~padded, "chessboard") <= reach
        closed = scipy.ndimage.distance_transform_cdt(closed, "chessboard") > reach
        final = closed[reach:-reach, reach:-reach] | mask
        Image.fromarray(final.astype(np.uint8) * 255).save(path)
        return float(width * MAP_RESOLUTION), float(height * MAP_RESOLUTION)

    def _add(self, points: npt.NDArray[np.float64]) -> None:
        if len(points):
            self._cells.append(np.unique(np.floor(points[:, :2] / MAP_RESOLUTION).astype(np.int32), axis=0))


def _road_points(image: ImageFrame, semantic: npt.NDArray[np.uint8]) -> npt.NDArray[np.float64]:
    """Return the road seen in a depth image within 60 m, shape (N, 3) [m, world]."""
    assert image.depth is not None
    line, column = np.nonzero(_DRIVABLE[semantic] & (np.abs(image.depth) < _MAP_REACH))
    optical = image.spec.unproject(np.stack([column + 0.5, line + 0.5], axis=-1), image.depth[line, column])
    optical = optical[np.linalg.norm(optical, axis=1) < 2.0 * _MAP_REACH]  # a fisheye sees far beside itself
    return image.world_from_sensor.apply(optical @ CAMERA_OPTICAL_FROM_SENSOR)


def _same_pose(a: ImageFrame, b: ImageFrame) -> bool:
    return bool(
        np.array_equal(a.world_from_sensor.position, b.world_from_sensor.position)
        and np.array_equal(a.world_from_sensor.quaternion, b.world_from_sensor.quaternion)
        and a.spec.projection_key == b.spec.projection_key
    )
