"""Contact sheet: maps and marks lie where the targets are, left is left, and a suite may lack sensors."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import scarl_sionna.dataset.contact_sheet as sheet
from scarl_sionna.core.errors import OutputError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, ImageFrame, ObjectState, RadarFrame
from scarl_sionna.core.specs.camera import CameraSpec
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.converter import quantize
from tests.frames import make_frame

RADAR = RadarSpec().with_(num_chirps=64, num_samples=128)
RADAR_POSE = Pose.from_euler([3.0, 1.0, 0.8], yaw=0.3)
VEHICLE_TWIST = Twist([8.0, 1.0, 0.0], [0.0, 0.0, 0.2])


def car(distance: float, azimuth_deg: float, speed: float) -> ObjectState:
    """Return a small object at a place in the radar frame that moves along the line of sight, seen from the world."""
    azimuth = np.radians(azimuth_deg)
    ray = RADAR_POSE.rotate([np.cos(azimuth), np.sin(azimuth), 0.0])
    pose = Pose(RADAR_POSE.position + distance * ray)
    return ObjectState("car", 7, 14, pose, np.full(3, 1e-3), Twist(speed * ray), True)


def radar_frame(item: ObjectState) -> Frame:
    """Return a frame with the noiseless signal of the object as a point."""
    own = Twist(VEHICLE_TWIST.velocity_at(RADAR_POSE.position), VEHICLE_TWIST.angular)
    position, velocity = item.world_from_box.position[None], item.twist.linear[None]
    paths = point_targets(position, velocity, np.array([100.0]), RADAR, Mount(RADAR_POSE, own))
    codes, scale, _ = quantize(synthesize(paths, RADAR, rng=None), RADAR)
    result = RadarFrame(RADAR, RADAR_POSE, codes, scale)
    return Frame(0, 0, 0, Pose(), VEHICLE_TWIST, {"front/radar": result}, (item,))


def complete_frame() -> Frame:
    """Return a frame with a camera, a lidar and a radar in one suite."""
    frame, parts = radar_frame(car(12.0, 35.0, 3.0)), make_frame().results
    results = {"front/camera": parts["front/camera"], "front/lidar": parts["front/lidar"], **frame.results}
    return Frame(0, 0, 0, Pose(), VEHICLE_TWIST, results, frame.objects)


@pytest.mark.parametrize(
    ("distance", "azimuth_deg", "speed"), [(12.0, 35.0, 3.0), (31.0, -20.0, -9.0), (20.0, 0.0, 15.0)]
)
def test_the_mark_of_an_object_is_at_its_peak_in_both_maps(distance, azimuth_deg, speed) -> None:
    item = car(distance, azimuth_deg, speed)
    frame = radar_frame(item)
    maps = sheet.radar_maps(frame.radars["front/radar"])
    mark = sheet._in_radar(item, frame, frame.radars["front/radar"])
    # nearest point of the 1 mm box
    assert mark[0] == pytest.approx(distance, abs=2e-3)
    assert mark[2] == pytest.approx(azimuth_deg, abs=0.01)
    row, column = np.unravel_index(np.argmax(maps.range_doppler_dbm), maps.range_doppler_dbm.shape)
    # the strongest cell is the nearest one: within half a bin, and a tenth for the scale error of the Doppler axis
    assert abs(maps.radial_velocity[row] - mark[1]) <= 0.6 * RADAR.velocity_resolution
    assert abs(maps.range[column] - mark[0]) <= 0.6 * RADAR.range_resolution
    row, column = np.unravel_index(np.argmax(maps.range_azimuth_dbm), maps.range_azimuth_dbm.shape)
    assert abs(maps.range[row] - mark[0]) <= 0.6 * RADAR.range_resolution
    # half a step of the 128 directions, uniform in sine, at up to 35 deg, and near field of a 6 cm array: 0.1 deg
    assert abs(np.degrees(maps.azimuth[column]) - mark[2]) <= np.degrees(1.0 / 128 / np.cos(np.radians(35.0))) + 0.1


def test_the_mark_of_a_fast_object_is_at_its_folded_echo() -> None:
    item = car(20.0, 0.0, 3.6 * RADAR.unambiguous_velocity)
    frame = radar_frame(item)
    maps = sheet.radar_maps(frame.radars["front/radar"])
    _, velocity, _ = sheet._in_radar(item, frame, frame.radars["front/radar"])
    assert velocity > RADAR.unambiguous_velocity
    row = np.argmax(maps.range_doppler_dbm.max(axis=1))
    assert sheet._on_axis(velocity, maps.radial_velocity) == pytest.approx(
        maps.radial_velocity[row], abs=0.6 * RADAR.velocity_resolution
    )
    assert sheet._on_axis(3.0, np.zeros(1)) == 0.0


def test_what_is_beyond_the_radars_range_is_told() -> None:
    frame = radar_frame(car(12.0, 35.0, 3.0))
    last = sheet.radar_maps(frame.radars["front/radar"]).range[-1]
    for max_range, told in ((0.9 * last, 0), (2.0 * last, 2)):
        axes = sheet.contact_sheet(frame, max_range=max_range).axes
        assert sum("beyond" in text.get_text() for axis in axes for text in axis.texts) == told


def test_no_mark_outside_the_radars_view() -> None:
    item = car(12.0, 75.0, 0.0)
    frame = radar_frame(item)
    assert sheet._in_radar(item, frame, frame.radars["front/radar"]) is None


def test_left_is_left_in_every_panel(monkeypatch, tmp_path) -> None:
    drawn: list[Figure] = []
    save = Figure.savefig
    monkeypatch.setattr(Figure, "savefig", lambda self, *a, **k: (drawn.append(self), save(self, *a, **k)))
    sheet.write_contact_sheet(complete_frame(), tmp_path / "sheet.png")
    panels = {axis.get_title(loc="left"): axis for axis in drawn[0].axes}
    for title in ("Lidar depth map", "Range-azimuth map"):
        left, right = panels[title].get_xlim()
        assert left > right, title  # azimuth falls to the right
    labels = [text.get_text().replace("\N{MINUS SIGN}", "-") for text in panels["RGB camera"].get_xticklabels()]
    places = panels["RGB camera"].get_xticks()
    assert [label for _, label in sorted(zip(places, labels, strict=True))] == sorted(labels, key=float, reverse=True)


def test_angle_ticks_are_at_the_pixels_of_these_angles() -> None:
    spec = CameraSpec(width=200, height=100, horizontal_fov_deg=90.0)
    axis = Figure().subplots()
    axis.imshow(np.zeros((100, 200)))
    sheet._angle_axes(axis, spec)
    by_label = {text.get_text(): place for place, text in zip(axis.get_xticks(), axis.get_xticklabels(), strict=True)}
    # K: u = 100 - 100 tan(azimuth); imshow puts the centre of the first pixel, u = 0.5, at 0
    assert by_label["20"] == pytest.approx(99.5 - 100 * np.tan(np.radians(20.0)))
    assert by_label["0"] == pytest.approx(99.5)


def test_all_panels_and_size(tmp_path) -> None:
    path = tmp_path / "sheet.png"
    sheet.write_contact_sheet(complete_frame(), path, title="t", dpi=50)
    with Image.open(path) as image:
        assert image.size == (800, 345)
        assert np.ptp(np.array(image.convert("L"))) > 200


def test_the_same_frame_gives_the_same_bytes(tmp_path) -> None:
    frame = radar_frame(car(12.0, 35.0, 3.0))
    for name in "ab":
        sheet.write_contact_sheet(frame, tmp_path / name, dpi=40)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_suite_without_some_sensors_leaves_their_panels_empty(tmp_path) -> None:
    spec = CameraSpec(width=4, height=2, images=("rgb",))
    camera = ImageFrame(spec, Pose(), rgb=np.zeros((2, 4, 3), np.uint8))
    sheet.write_contact_sheet(Frame(0, 0, 0, Pose(), Twist(), {"a": camera}, ()), tmp_path / "sheet.png", dpi=40)
    assert (tmp_path / "sheet.png").exists()


def test_a_path_that_cannot_be_written(tmp_path) -> None:
    with pytest.raises(OutputError, match="choose a folder"):
        sheet.write_contact_sheet(radar_frame(car(12.0, 0.0, 3.0)), tmp_path / "none" / "sheet.png", dpi=40)
