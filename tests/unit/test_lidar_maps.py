"""2D maps: orientation, nearest wins, borders."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from camera_lidar.lidar.maps import camera_maps, range_view
from camera_lidar.lidar.pattern import shot_directions
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.results import LidarScan
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.lidar.spec import LidarSpec

SPEC = LidarSpec(azimuth_fov_deg=(-30, 30), elevation_fov_deg=(-10, 10), num_azimuth=3, num_elevation=2)
CAMERA = CameraSpec(width=100, height=60, horizontal_fov_deg=90.0)  # focal length 50 px


def make_scan(position: Any, spec: LidarSpec = SPEC, shot: Any = None, pose: Pose | None = None) -> LidarScan:
    """Return a scan of given points; intensity, velocity, class and instance count the rows from 1."""
    position = np.asarray(position, dtype=np.float32).reshape(-1, 3)
    number = np.arange(1, len(position) + 1)
    return LidarScan(
        spec=spec,
        world_from_sensor=pose or Pose(),
        shot=np.asarray(number - 1 if shot is None else shot, dtype=np.int32),
        position=position,
        distance=np.linalg.norm(position, axis=-1).astype(np.float32),
        radial_velocity=number.astype(np.float32),
        intensity=number.astype(np.float32),
        cos_incidence=np.ones(len(number), np.float32),
        normal=np.zeros_like(position),
        semantic=number.astype(np.uint8),
        instance=number.astype(np.uint16),
    )


def test_range_view_is_upright() -> None:
    maps = range_view(make_scan(shot_directions(SPEC) * 10.0))
    # shots 1 2 3 run from right to left on the low line, 4 5 6 on the high one
    assert maps.instance.tolist() == [[6, 5, 4], [3, 2, 1]]
    assert maps.filled.all()
    assert np.allclose(maps.distance, 10.0, rtol=1e-6)  # float32
    assert np.allclose(maps.depth[0, 1], 10.0 * np.cos(np.radians(10.0)), rtol=1e-6)


def test_range_view_is_the_same_for_a_scan_that_runs_to_the_right() -> None:
    spec = SPEC.with_(azimuth_fov_deg=(30, -30))
    maps = range_view(make_scan(shot_directions(spec) * 10.0, spec))
    assert maps.instance.tolist() == [[4, 5, 6], [1, 2, 3]]


def test_empty_cells_say_so() -> None:
    maps = range_view(make_scan([[10.0, 0.0, 0.0]], shot=[1]))
    assert maps.filled.sum() == 1 and maps.filled[1, 1]
    empty = ~maps.filled
    assert np.isinf(maps.distance[empty]).all() and np.isinf(maps.depth[empty]).all()
    assert np.isnan(maps.radial_velocity[empty]).all()
    assert not maps.intensity[empty].any() and not maps.semantic[empty].any() and not maps.instance[empty].any()
    assert (maps.row[empty] == -1).all()


def test_the_nearest_return_wins_a_pixel_in_any_order() -> None:
    points = [[20.0, 0.0, 0.0], [10.0, 0.0, 0.0], [30.0, 0.0, 0.0]]
    for order in ([0, 1, 2], [2, 1, 0], [1, 0, 2]):
        maps = camera_maps(make_scan(np.array(points)[order]), CAMERA, Pose())
        assert maps.filled.sum() == 1
        assert maps.depth[30, 50] == 10.0 and maps.row[30, 50] == order.index(1)


def test_projection_uses_both_poses() -> None:
    # a lidar 1 m to the left of the camera that looks to the left sees a point 5 m ahead of it, so 6 m left of the
    # camera
    lidar = Pose.from_euler([0.0, 1.0, 0.0], yaw=np.pi / 2)
    camera = Pose.from_euler([0.0, 0.0, 0.0], yaw=np.pi / 4)
    scan = make_scan([[5.0, 6.0 - 0.5, 0.0]], pose=lidar)  # world: (-5.5, 6, 0)
    assert not camera_maps(scan, CAMERA, camera).filled.any()  # behind the camera's left edge
    scan = make_scan([[5.0, -6.0, 0.0]], pose=lidar)  # world: (6, 6, 0): on the camera's axis
    maps = camera_maps(scan, CAMERA.with_(width=101, height=61), camera)
    assert maps.filled[30, 50] and maps.filled.sum() == 1
    assert np.isclose(maps.depth[30, 50], 6.0 * np.sqrt(2.0), rtol=1e-6)  # float32
    assert np.isclose(maps.distance[30, 50], np.sqrt(61.0), rtol=1e-6)  # along the lidar's ray


def test_points_behind_and_beside_the_camera_are_left_out() -> None:
    maps = camera_maps(make_scan([[-10.0, 0.0, 0.0], [1.0, 5.0, 0.0], [0.0, 1.0, 0.0]]), CAMERA, Pose())
    assert not maps.filled.any()


def test_a_footprint_is_a_square_cut_at_the_border_and_respects_depth() -> None:
    spec = CAMERA.with_(width=101, height=61)
    maps = camera_maps(make_scan([[10.0, 0.0, 0.0]]), spec, Pose(), radius_px=1)
    assert maps.filled.sum() == 9 and maps.filled[29:32, 49:52].all()
    focal = spec.intrinsics[0, 0]
    corner = [10.0, 10.0 * 50.4 / focal, 10.0 * 30.4 / focal]  # the top-left pixel
    assert camera_maps(make_scan([corner]), spec, Pose(), radius_px=1).filled.sum() == 4
    one_px = 20.0 / focal
    maps = camera_maps(make_scan([[10.0, 0.0, 0.0], [20.0, -one_px, 0.0]]), spec, Pose(), radius_px=1)
    assert maps.instance[30, 48:54].tolist() == [0, 1, 1, 1, 2, 0]
    with pytest.raises(ParameterRangeError):
        camera_maps(make_scan([corner]), spec, Pose(), radius_px=-1)


def test_an_empty_scan_gives_empty_maps() -> None:
    scan = make_scan(np.zeros((0, 3)))
    assert not range_view(scan).filled.any()
    assert not camera_maps(scan, CAMERA, Pose(), radius_px=2).filled.any()


@pytest.mark.parametrize(
    "lens", [{"model": "brown_conrady", "k1": -0.2, "k2": 0.03, "p1": 1e-3}, {"model": "kannala_brandt", "k1": -0.02}]
)
def test_points_go_through_the_cameras_lens(lens: dict[str, Any]) -> None:
    spec = CAMERA.with_(lens=lens)
    pixel = np.array([[10.5, 8.5], [50.5, 30.5], [88.5, 51.5]])
    optical = spec.rays(pixel) * [[10.0], [12.0], [20.0]]
    sensor = optical @ np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    maps = camera_maps(make_scan(sensor), spec, Pose())
    row, column = np.floor(pixel[:, ::-1].T).astype(int)
    assert maps.filled.sum() == 3 and maps.instance[row, column].tolist() == [1, 2, 3]
    assert np.allclose(maps.depth[row, column], optical[:, 2], rtol=1e-5)  # float32
    straight = camera_maps(make_scan(sensor), CAMERA, Pose())
    assert straight.instance[8, 10] == 0  # without the lens it falls elsewhere


def test_several_returns_of_a_shot_show_the_nearest_in_the_range_view() -> None:
    along = shot_directions(SPEC)
    scan = make_scan(np.concatenate([along[1:2] * 5.0, along[1:2] * 20.0, along[4:5] * 7.0]), shot=[1, 1, 4])
    maps = range_view(scan)
    assert maps.instance.tolist() == [[0, 3, 0], [0, 1, 0]]
