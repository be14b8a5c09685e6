"""2D maps of a lidar scan: in its own range view, and in the image plane of a camera (SCaRL, section 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.camera import CameraSpec

from ..camera.projection import camera_optical_from_world


@dataclass(frozen=True, eq=False)
class LidarMaps:
    """Returns on a grid, upright like an image: row 0 at the top, column 0 at the left. Empty cells: inf, NaN, 0.

    Attributes
    ----------
    distance : ndarray of float32, shape (height, width)
        Along the lidar's ray [m]; inf where empty.
    depth : ndarray of float32, shape (height, width)
        Along the forward axis [m]: of the lidar in its range view, of the camera in the camera's image; inf where
        empty.
    radial_velocity : ndarray of float32, shape (height, width)
        As the lidar measured it, positive = opening [m/s]; NaN where empty.
    intensity : ndarray of float32, shape (height, width)
        0 where empty.
    semantic : ndarray of uint8, shape (height, width)
        0 (Unlabeled) where empty.
    instance : ndarray of uint16, shape (height, width)
        0 where empty.
    row : ndarray of int32, shape (height, width)
        Row of the scan that the cell shows; -1 where empty.
    """

    distance: npt.NDArray[np.float32]
    depth: npt.NDArray[np.float32]
    radial_velocity: npt.NDArray[np.float32]
    intensity: npt.NDArray[np.float32]
    semantic: npt.NDArray[np.uint8]
    instance: npt.NDArray[np.uint16]
    row: npt.NDArray[np.int32]

    @property
    def filled(self) -> npt.NDArray[np.bool_]:
        """Which cells hold a return."""
        return self.row >= 0


def range_view(scan: LidarScan) -> LidarMaps:
    """Return the maps in the lidar's own view, shape `scan.spec.scan.grid_shape`: (num_elevation, num_azimuth).

    Row 0 is the highest elevation and column 0 the azimuth farthest to the left, whatever the firing order; of several
    returns in a cell the nearest shows. A scan without a grid of its own (Risley, table) is binned over its field of
    view.
    """
    shape = scan.spec.scan.grid_shape
    shot_row, shot_column = scan.spec.scan.cells()
    cell = (shot_row * shape[1] + shot_column)[scan.shot]
    cell, row = _nearest(cell, scan.distance, shape)
    return _fill(scan, cell, row, scan.position[row, 0], shape)


def camera_maps(scan: LidarScan, spec: CameraSpec, world_from_camera: Pose, radius_px: int = 0) -> LidarMaps:
    """Project a scan into the image of a camera; where returns share a pixel the nearest to the camera wins.

    Parameters
    ----------
    scan : LidarScan
    spec : CameraSpec
    world_from_camera : Pose
        Sensor frame of the camera (x forward, y left, z up).
    radius_px : int
        A return fills the square of 2 * radius_px + 1 pixels around its own, for display; 0: its pixel only.

    Returns
    -------
    LidarMaps
        Shape (height, width), in the projection of the camera's images with its lens; depth is along the optical axis.

    Notes
    -----
    Points go from the lidar's frame by `world_from_sensor` into the world, from there into `camera_optical`, and
    through the lens, as in SCaRL, section 2.2. Positions of a rolling scan stand in the frames of their shots, so that
    it shows its skew; with ``spec.deskew`` (or after :func:`camera_lidar.lidar.deskew`) static things stand where the
    camera sees them at the timestamp.

    *Not modelled*: what the camera does not see although the lidar does. From another place than the camera's, a return
    behind an edge shows between the returns of the nearer surface.
    """
    if radius_px < 0:
        raise ParameterRangeError("radius_px", radius_px, ">= 0 px")
    optical_from_lidar = camera_optical_from_world(world_from_camera).compose(scan.world_from_sensor)
    point = optical_from_lidar.apply(scan.position)
    pixel, depth = spec.project(point)
    row = np.flatnonzero(np.isfinite(pixel).all(axis=-1))
    # a return counts where it is seen up to half a footprint outside of the image
    with_border = (pixel[row] >= -radius_px) & (pixel[row] < np.array([spec.width, spec.height]) + radius_px)
    row = row[with_border.all(axis=-1)]
    centre = np.floor(pixel[row]).astype(np.int64)
    steps = np.arange(-radius_px, radius_px + 1)
    offset = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(1, -1, 2)
    footprint = centre[:, None, :] + offset
    row = np.repeat(row, offset.shape[1])
    u, v = footprint.reshape(-1, 2).T
    inside = (u >= 0) & (u < spec.width) & (v >= 0) & (v < spec.height)
    row, cell = row[inside], (v * spec.width + u)[inside]
    cell, kept = _nearest(cell, np.linalg.norm(point[row], axis=-1), (spec.height, spec.width))
    row = row[kept]
    return _fill(scan, cell, row, depth[row], (spec.height, spec.width))


def _nearest(
    cell: npt.NDArray[np.int64], distance: npt.NDArray[np.floating], shape: tuple[int, int]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return the cells that are filled, rising, and the entry with the smallest distance in each (z-buffer)."""
    far_first = np.argsort(-distance, kind="stable")
    nearest = np.full(shape[0] * shape[1], -1, dtype=np.int64)
    nearest[cell[far_first]] = far_first  # of repeated indices the last one, so the nearest, stays
    filled = np.flatnonzero(nearest >= 0)
    return filled, nearest[filled]


def _fill(
    scan: LidarScan,
    cell: npt.NDArray[np.int64],
    row: npt.NDArray[np.int64],
    depth: npt.NDArray[np.floating],
    shape: tuple[int, int],
) -> LidarMaps:
    """Write rows of a scan into cells, each cell at most once."""

    def grid(values: npt.NDArray, empty: float) -> npt.NDArray:
        out = np.full(shape[0] * shape[1], empty, dtype=values.dtype)
        out[cell] = values
        return out.reshape(shape)

    return LidarMaps(
        distance=grid(scan.distance[row], np.inf),
        depth=grid(depth.astype(np.float32), np.inf),
        radial_velocity=grid(scan.radial_velocity[row], np.nan),
        intensity=grid(scan.intensity[row], 0.0),
        semantic=grid(scan.semantic[row], 0),
        instance=grid(scan.instance[row], 0),
        row=grid(row.astype(np.int32), -1),
    )
