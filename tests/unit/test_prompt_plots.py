"""Plots: what is where, in which unit, within 60 dB, and on the axes that were given."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Wedge

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, PlacementError, ScarlError, UnknownNameError
from scarl_sionna.core.prompt import frames
from scarl_sionna.core.prompt.axes import power_limits
from tests.drive import drive
from tests.frames import make_frame
from tests.lane_scene import lane_scene

REPO = Path(__file__).resolve().parents[2]
RADAR = ss.RadarSpec().with_(num_chirps=64, num_samples=128)
PLACE = np.array([20.0 * np.cos(0.2), 20.0 * np.sin(0.2), 0.0])
VELOCITY = -4.0 * PLACE / 20.0  # closing at 4 m/s


@pytest.fixture(autouse=True)
def _close_figures() -> Any:
    yield
    plt.close("all")


@pytest.fixture(scope="module")
def paths() -> ss.RadarPaths:
    return ss.point_targets([PLACE, [40.0, -9.0, 0.0]], [VELOCITY, [0.0, 0.0, 0.0]], [10.0, 1.0], RADAR, ss.Pose())


@pytest.fixture(scope="module")
def rda(paths: ss.RadarPaths) -> Any:
    adc = ss.synthesize(paths, RADAR, rng=np.random.default_rng(0))
    return ss.range_doppler_angle(ss.virtual_cube(adc, RADAR), RADAR)


@pytest.fixture(scope="module")
def frame() -> ss.Frame:
    return drive(num_frames=1).scenes[0].frames[0]


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    return ss.load_scene(lane_scene(tmp_path_factory.mktemp("scene")))


def _mesh(axis: Axes) -> QuadMesh:
    (mesh,) = [item for item in axis.collections if isinstance(item, QuadMesh)]
    return mesh


def _labels(axis: Axes) -> str:
    """Return all that is written about an axis, with the label of its colour bar."""
    bars = [child.get_ylabel() for child in axis.child_axes]
    return " | ".join([axis.get_xlabel(), axis.get_ylabel(), *bars])


def _peak(axis: Axes) -> tuple[float, float]:
    """Return x and y of the strongest cell of a map of line axes."""
    mesh = _mesh(axis)
    corners = mesh.get_coordinates()
    row, column = np.unravel_index(int(np.argmax(mesh.get_array())), mesh.get_array().shape)
    return corners[row : row + 2, column : column + 2].reshape(-1, 2).mean(axis=0)


def test_a_range_doppler_map_has_the_target_in_its_place(rda: Any) -> None:
    axis = rda.range_doppler.plot()
    velocity, distance = _peak(axis)
    # half a cell of 0.8 m/s and 0.5 m
    assert velocity == pytest.approx(-4.0, abs=0.4) and distance == pytest.approx(20.0, abs=0.25)
    assert all(unit in _labels(axis) for unit in ("[m/s]", "[m]", "[dBm]"))
    low, high = _mesh(axis).get_clim()
    assert high - low == pytest.approx(60.0) and high == pytest.approx(np.max(_mesh(axis).get_array()))


def test_maps_stop_where_asked(rda: Any) -> None:
    axis = rda.range_doppler.plot(max_range=30.0, dynamic_range_db=40.0)
    low, high = _mesh(axis).get_clim()
    assert high - low == pytest.approx(40.0)
    assert axis.get_ylim()[1] <= 30.0 + 0.25  # half a cell
    with pytest.raises(ParameterRangeError, match="dynamic_range_db = 0"):
        rda.range_doppler.plot(dynamic_range_db=0.0)


def test_a_radar_map_is_one_of_places(rda: Any) -> None:
    axis = rda.plot()
    assert axis.get_aspect() == 1.0
    mesh = _mesh(axis)
    strongest = mesh.get_coordinates().reshape(-1, 2)[int(np.argmax(mesh.get_array()))]
    # a gouraud mesh has its values at its corners; a cell of 0.5 m and 0.03 in the sine of azimuth, 0.7 m at 20 m
    np.testing.assert_allclose(strongest, PLACE[[1, 0]], atol=0.6)
    left, right = axis.get_xlim()
    assert left > right  # left is left
    assert all(unit in _labels(axis) for unit in ("x, forward [m]", "y, to the left [m]", "[dBm]"))


def test_a_radar_map_shows_the_directions_of_the_field_of_view_and_no_others(rda: Any) -> None:
    border = np.radians(RADAR.azimuth_fov_deg / 2.0)
    azimuth = np.array([-1.2 * border, -border, -0.5, 0.0, 0.5, border, 1.2 * border])
    few = replace(rda, azimuth=azimuth, data=rda.data[:, :, : len(azimuth)])
    corners = _mesh(few.plot()).get_coordinates()
    shown = np.arctan2(corners[-1, :, 0], corners[-1, :, 1])  # a gouraud mesh has its values at its corners
    np.testing.assert_allclose(shown, azimuth[1:-1], atol=1e-9)  # the borders themselves count


def test_other_views_of_a_radar_map(rda: Any) -> None:
    axis = rda.plot("range_azimuth")
    azimuth, distance = _peak(axis)
    assert azimuth == pytest.approx(np.degrees(0.2), abs=1.2) and distance == pytest.approx(20.0, abs=0.25)
    assert axis.get_xlim()[0] > axis.get_xlim()[1] and "azimuth [deg]" in _labels(axis)
    np.testing.assert_allclose(_peak(rda.plot("range_doppler")), (-4.0, 20.0), atol=0.4)
    with pytest.raises(UnknownNameError, match="did you mean 'range_azimuth'"):
        rda.plot("range_azimut")


def test_detections_stand_where_they_are(rda: Any) -> None:
    points = ss.detect(rda)
    axis = points.plot()
    drawn = next(item for item in axis.collections if isinstance(item, PathCollection))
    np.testing.assert_array_equal(drawn.get_offsets(), points.position[:, [1, 0]])
    np.testing.assert_array_equal(drawn.get_array(), points.radial_velocity)
    assert axis.get_aspect() == 1.0 and "radial velocity [m/s]" in _labels(axis)


def test_paths_over_range_and_from_above(paths: ss.RadarPaths) -> None:
    axis = paths.plot()
    drawn = next(item for item in axis.collections if isinstance(item, PathCollection))
    by_range = drawn.get_offsets()[np.argsort(drawn.get_offsets()[:, 0])]
    np.testing.assert_allclose(by_range[:, 0], [20.0, 41.0], rtol=1e-12)  # (40, -9) is 41 m away
    gain = 10.0 * np.log10(
        RADAR.wavelength**2 * np.array([10.0, 1.0]) / ((4 * np.pi) ** 3 * np.array([20.0, 41.0]) ** 4)
    )
    np.testing.assert_allclose(by_range[:, 1], gain + 10.0 * np.log10(2.0), atol=1e-9)  # V and H together
    assert "[m]" in _labels(axis) and "[dB]" in _labels(axis) and "[m/s]" in _labels(axis)
    above = paths.plot("map", dynamic_range_db=90.0)
    places = next(item for item in above.collections if isinstance(item, PathCollection)).get_offsets()
    np.testing.assert_allclose(sorted(places.tolist()), sorted([[-9.0, 40.0], PLACE[[1, 0]].tolist()]), atol=1e-9)
    assert above.get_aspect() == 1.0
    weak = paths.plot("map", dynamic_range_db=5.0)  # the second is 10 + 40 log(41 / 20) = 22 dB weaker
    assert len(next(item for item in weak.collections if isinstance(item, PathCollection)).get_offsets()) == 1
    with pytest.raises(UnknownNameError, match="view"):
        paths.plot("above")


def test_a_mirrored_path_is_seen_along_its_arrival() -> None:
    """A radar that faces a wall at x = 10 sees its own echo there: length 20, at 10 m, straight ahead."""
    wall = np.array([[-1.0, 0.0, 0.0, 20.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    one = ss.point_targets([[1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0]], 1.0, RADAR, ss.Pose([0.0, 0.0, 0.0]))
    from dataclasses import replace

    echo = replace(one, rx_image=wall[None])
    np.testing.assert_allclose(echo.length, [20.0])
    np.testing.assert_allclose(echo.apparent_points, [[10.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(one.length, [2.0 * np.sqrt(2.0)])
    np.testing.assert_allclose(one.apparent_points, [[1.0, 1.0, 0.0]], atol=1e-12)


def test_images_and_lidar(frame: ss.Frame) -> None:
    image = next(iter(frame.images.values()))
    for kind in ("rgb", "depth", "semantic", "instance"):
        axis = image.plot(kind)
        assert axis.get_title() == kind and "[px]" in _labels(axis)
    assert "depth [m]" in _labels(image.plot("depth"))
    with pytest.raises(UnknownNameError, match="did you mean 'rgb'"):
        image.plot("rgbb")
    full = next(iter(make_frame(0).images.values()))
    assert "[px]" in _labels(full.plot("flow")) and full.plot("normal").get_title() == "normal"
    scan = next(iter(frame.lidars.values()))
    axis = scan.plot()
    drawn = next(item for item in axis.collections if isinstance(item, PathCollection))
    np.testing.assert_array_equal(drawn.get_offsets(), scan.position[:, [1, 0]])
    assert axis.get_aspect() == 1.0 and "[m/s]" in _labels(axis)
    assert "[dB]" in _labels(scan.plot("intensity")) and "[m]" in _labels(scan.plot("height"))
    with pytest.raises(UnknownNameError, match="did you mean 'intensity'"):
        scan.plot("intensty")


def test_a_frame_is_a_contact_sheet(frame: ss.Frame) -> None:
    sheet = frame.plot(title="street", max_range=60.0)
    assert isinstance(sheet, Figure) and len(sheet.axes) >= 6
    assert "street" in sheet.get_suptitle() and "front_center" in sheet.get_suptitle()
    assert "back_center" in frame.plot(suite="back_center").get_suptitle()
    with pytest.raises(UnknownNameError, match="did you mean 'back_center'"):
        frame.plot(suite="back_centre")


def test_a_frame_without_its_drawer_says_so(frame: ss.Frame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames._Known, "plot", None)
    with pytest.raises(ScarlError, match=r"import scarl_sionna\.dataset"):
        frame.plot()


def test_a_world_from_above(world: ss.World) -> None:
    axis = world.plot(time=1.0, rig=ss.Rig.front())
    assert axis.get_aspect() == 1.0 and _labels(axis).startswith("x [m] | y [m]")
    boxes = [patch for patch in axis.patches if isinstance(patch, Polygon)]
    centres = [tuple(np.round(patch.get_xy()[:4].mean(axis=0), 6)) for patch in boxes[::2]]  # a nose after each box
    assert centres == [(10.0, 0.0), (32.0, 0.0)]  # 10 m/s, and 20 m + 12 m/s
    lengths = [np.ptp(patch.get_xy()[:, 0]) for patch in boxes[::2]]
    np.testing.assert_allclose(lengths, [4.0, 4.0], atol=1e-6)
    fans = [patch for patch in axis.patches if isinstance(patch, Wedge)]
    assert {tuple(fan.center) for fan in fans} == {(12.36, 0.0)}  # the suite at x = 2.36 m of the ego vehicle
    assert sorted(round(fan.theta2 - fan.theta1) for fan in fans) == [90, 120, 120]  # camera, lidar, radar
    assert len([line for line in axis.lines if line.get_linestyle() == "--"]) == 5  # lanes
    assert {text.get_text() for text in axis.texts} >= {"ego", "ahead"}
    assert len(world.plot(time=1.0).patches) == 4  # without a rig: boxes and noses


def test_a_part_of_a_world(world: ss.World) -> None:
    axis = world.plot(extent=(-20.0, 40.0, -10.0, 10.0))
    assert axis.get_xlim() == (-20.0, 40.0) and axis.get_ylim() == (-10.0, 10.0)
    with pytest.raises(ParameterRangeError, match="rising"):
        world.plot(extent=(40.0, -20.0, -10.0, 10.0))


def test_a_world_without_ego_has_no_rig(tmp_path: Path) -> None:
    world = ss.load_scene(lane_scene(tmp_path, ego=False))
    assert isinstance(world.plot(), Axes)
    with pytest.raises(PlacementError, match="no ego vehicle"):
        world.plot(rig=ss.Rig.front())


def test_plots_go_onto_axes_that_are_given(rda: Any, paths: ss.RadarPaths, frame: ss.Frame, world: ss.World) -> None:
    image, scan = next(iter(frame.images.values())), next(iter(frame.lidars.values()))
    plots = [rda.plot, rda.range_doppler.plot, ss.detect(rda).plot, paths.plot, image.plot, scan.plot, world.plot]
    _, axes = plt.subplots(2, 4)
    before = plt.get_fignums()
    for axis, plot in zip(axes.flat, plots, strict=False):
        assert plot(ax=axis) is axis
        assert axis.has_data()
    assert plt.get_fignums() == before


def test_limits_of_powers() -> None:
    assert power_limits(np.array([-80.0, -20.0]), 60.0) == (-80.0, -20.0)


def test_results_do_not_import_matplotlib() -> None:
    code = (
        "import sys\nfrom scarl_sionna.core import results\nfrom scarl_sionna.signal import angle, detection\n"
        "from scarl_sionna.radar import paths\nprint('matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True)
    assert done.stdout.strip() == "False"


def test_a_preview_holds_sensors_paths_and_points(world: ss.World, rda: Any) -> None:
    state = world.at(1.0)
    rig = ss.Rig.front()
    mount = rig["front_center/radar"].vehicle_from_sensor
    echoes = ss.point_targets([[30.0, 0.0, 0.5]], [[0.0, 0.0, 0.0]], 1.0, RADAR, state.mount("ego", mount))
    detections = ss.detect(rda)
    view = world.preview(rig, echoes, detections, time=1.0)
    scene, *drawn = [item for item, _ in view._objects]
    sensors, boresights, lines, points = drawn
    place = np.array([12.36, 0.0, 0.8])
    np.testing.assert_allclose(sensors.geometry.attributes["position"].array, np.tile(place, (5, 1)), atol=1e-5)
    np.testing.assert_allclose(
        boresights.geometry.positions[:, 1] - boresights.geometry.positions[:, 0],
        np.tile([2.0, 0, 0], (5, 1)),
        atol=1e-5,
    )
    np.testing.assert_allclose(lines.geometry.positions, [[place, [30.0, 0.0, 0.5]]], atol=1e-5)
    expected = state.actor_pose("ego").compose(mount).apply(detections.position)
    np.testing.assert_allclose(points.geometry.attributes["position"].array, expected, atol=1e-4)  # float32 at 50 m
    assert {"radar", "lidar", "camera"} <= set(view._legend_labels)
    # the car ahead stands where it is at that time: its roof at 20 + 12 m
    vertices = scene.geometry.attributes["position"].array
    assert np.isclose(vertices, [34.0, 0.8, 1.4], atol=1e-3).all(axis=1).any()


def test_a_preview_takes_points_of_the_world_and_scans(world: ss.World, frame: ss.Frame, rda: Any) -> None:
    view = world.preview(points=np.array([[1.0, 2.0, 3.0]]))
    np.testing.assert_allclose(view._objects[-1][0].geometry.attributes["position"].array, [[1.0, 2.0, 3.0]])
    scan = next(iter(frame.lidars.values()))
    cloud = world.preview(points=scan)._objects[-1][0].geometry.attributes["position"].array
    np.testing.assert_allclose(cloud, scan.world_from_sensor.apply(scan.position), atol=1e-4)
    with pytest.raises(ParameterRangeError, match="its pose is needed"):
        world.preview(points=ss.detect(rda))
    with pytest.raises(ParameterRangeError, match="num_points, 3"):
        world.preview(points=np.zeros(3))
    with pytest.raises(TypeError, match="give ss.detect"):
        world.preview(points=[1, 2, 3])  # type: ignore[arg-type]
