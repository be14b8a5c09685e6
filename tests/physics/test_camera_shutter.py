"""A rolling shutter: rows are seen one after the other, against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from camera_lidar import Camera
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import ImageFrame
from scarl_sionna.core.specs.camera import BrownConrady, CameraSpec
from scarl_sionna.engine.load import load_scene
from tests.scenes import Material, Thing, plane, write_scene

READOUT = 0.02
"""[s]"""
SPEED = 25.0
"""Of the board to the left, or of the camera to the right [m/s]."""
DISTANCE = 10.0
SPEC = CameraSpec(
    width=160,
    height=90,
    horizontal_fov_deg=70.0,
    samples_per_pixel=4,
    denoise=False,
    images=("rgb", "depth", "semantic", "instance", "normal", "flow"),
    readout_time=READOUT,
    num_readout_bands=90,
)


def observe(folder: Path, spec: CameraSpec, *, camera_moves: bool = False) -> ImageFrame:
    """Look at a board of 2 m, higher than the image, whose middle is straight ahead at the frame's time."""
    velocity = (0.0, 0.0 if camera_moves else SPEED, 0.0)
    motion = {"kind": "constant_twist", "position": (DISTANCE, 0.0, 0.0), "velocity": velocity}
    board = Thing("board", plane(20.0, 2.0, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "Car", "dark", trajectory=motion)
    behind = Thing("behind", plane(1.0, 1.0, (-50.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    state = load_scene(write_scene(folder, [behind], [board], {"dark": Material((0.03, 0.03, 0.03))})).at(0.0)
    twist = Twist(linear=np.array([0.0, -SPEED, 0.0])) if camera_moves else Twist()
    return Camera(spec).observe(state, Mount(Pose(), twist), np.random.default_rng(0))


def on_board(spec: CameraSpec, time: np.ndarray) -> np.ndarray:
    """Return which pixels' centres look at the board, rows at their times [s]; shape (height, width)."""
    focal, middle = spec.intrinsics[0, 0], spec.width / 2.0
    column = np.arange(spec.width) + 0.5
    centre = middle - focal * SPEED * time / DISTANCE
    return np.abs(column - centre[:, None]) < focal / DISTANCE


def row_times(spec: CameraSpec) -> np.ndarray:
    return READOUT * ((np.arange(spec.height) + 0.5) / spec.height - 0.5)


@pytest.mark.parametrize("camera_moves", [False, True])
def test_rows_are_seen_at_their_own_times(tmp_path: Path, camera_moves: bool) -> None:
    """The board leans: every pixel of every row as the closed form says, in RGB and in the labels."""
    frame = observe(tmp_path, SPEC, camera_moves=camera_moves)
    expected = on_board(SPEC, row_times(SPEC))
    np.testing.assert_array_equal(frame.instance > 0, expected)
    shift = np.argmax(expected[0]) - np.argmax(expected[-1])
    assert shift == pytest.approx(SPEC.intrinsics[0, 0] * SPEED * READOUT / DISTANCE * 89 / 90, abs=1.0)  # 5.6 px
    np.testing.assert_allclose(frame.depth[expected], DISTANCE, rtol=1e-6)
    np.testing.assert_allclose(frame.normal[expected], np.broadcast_to([-1.0, 0.0, 0.0], frame.normal[expected].shape))
    # what the surface moves within the flow's interval is the same in all rows
    flow = SPEC.intrinsics[0, 0] * SPEED * SPEC.flow_interval / DISTANCE
    np.testing.assert_allclose(
        frame.flow[expected], np.broadcast_to([-flow, 0.0], frame.flow[expected].shape), atol=2e-5
    )
    sky, board = frame.rgb[~expected].mean(), frame.rgb[expected].mean()
    assert sky - board > 100.0
    border = expected != np.roll(expected, 1, axis=1)
    border |= np.roll(border, -1, axis=1)
    np.testing.assert_array_equal((frame.rgb.mean(axis=-1) < (sky + board) / 2.0)[~border], expected[~border])


def test_bands_are_as_far_off_as_documented(tmp_path: Path) -> None:
    spec = SPEC.with_(num_readout_bands=7, images=("instance",))
    frame = observe(tmp_path, spec)
    border = np.linspace(0, spec.height, 8).round()
    middle = np.repeat((border[1:] + border[:-1]) / 2.0, np.diff(border).astype(int))
    time = READOUT * (middle / spec.height - 0.5)
    np.testing.assert_array_equal(frame.instance > 0, on_board(spec, time))
    assert np.abs(time - row_times(spec)).max() <= READOUT / (2 * 7)


def test_more_bands_than_rows_and_a_lens_that_distorts(tmp_path: Path) -> None:
    """Bands see the rays of the whole image: of a still scene the image is that of a global shutter."""
    lens = BrownConrady(k1=-0.2, k2=0.02)
    spec = SPEC.with_(height=5, num_readout_bands=64, lens=lens, images=("depth", "instance"))
    still = {"kind": "constant_twist", "position": (6.0, 0.4, 0.0), "velocity": (0.0, 0.0, 0.0)}
    board = Thing("board", plane(0.2, 2.0, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), "Car", trajectory=still)
    behind = Thing("behind", plane(1.0, 1.0, (-50.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    state = load_scene(write_scene(tmp_path, [behind], [board])).at(0.0)
    rolling, at_once = (
        Camera(one).observe(state, Mount(Pose(), Twist()), np.random.default_rng(0))
        for one in (spec, spec.with_(readout_time=0.0))
    )
    assert 0.0 < (at_once.instance > 0).mean() < 1.0
    np.testing.assert_array_equal(rolling.instance, at_once.instance)
    np.testing.assert_allclose(rolling.depth, at_once.depth, rtol=1e-6)
