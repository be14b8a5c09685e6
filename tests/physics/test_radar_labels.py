"""Labels on radar data against geometry, image theory and the synthesis of each instance alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths.tracing import DIFFUSE, REFRACTION, SPECULAR
from scarl_sionna.fusion import Rig
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.labels.labels import label_cells, label_paths, label_points
from scarl_sionna.radar.link import received_power
from scarl_sionna.radar.point_scatterers import POINT_INTERACTION
from scarl_sionna.radar.points import point_targets
from scarl_sionna.radar.sensor import Radar
from scarl_sionna.radar.synthesis import synthesize
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.detection import RadarPoints, detect
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from tests.scenes import Thing, plane, write_scene

SMALL = RadarSpec().with_(num_chirps=32, num_samples=64, bandwidth=300e6, pattern=IsotropicPattern())
TIME = 0.5


def free_space(radar: RadarSpec, count: int, seed: int):
    """Return paths of random points that move, a third to each of three instances."""
    rng = np.random.default_rng(seed)
    distance, azimuth = rng.uniform(2.0, 0.9 * radar.max_range, count), rng.uniform(-0.9, 0.9, count)
    points = np.stack([distance * np.cos(azimuth), distance * np.sin(azimuth), rng.uniform(-1, 1, count)], axis=1)
    velocity = rng.uniform(-1.0, 1.0, (count, 3)) * 0.9 * radar.unambiguous_velocity
    paths = point_targets(points, velocity, rng.exponential(1.0, count) * distance**4, radar, Pose())
    paths.instance[:] = 1 + np.arange(count)[:, None] % 3
    return paths


def a_map(paths, radar, **options):
    return range_doppler(virtual_cube(synthesize(paths, radar), radar), radar, **options)


@pytest.mark.some(4)
@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
@pytest.mark.parametrize("window", ["rect", "hann", "blackmanharris"])
@pytest.mark.parametrize("padding", [1, 2])
def test_the_spread_is_the_synthesis_within_the_main_lobe(multiplexing: str, window: str, padding: int) -> None:
    radar = SMALL.with_(multiplexing=multiplexing)
    paths = free_space(radar, 1, seed=3)
    rd = a_map(paths, radar, window=window, num_range_bins=64 * padding, num_doppler_bins=32 * padding)
    found, expected = label_cells(rd, paths), label_cells(rd, paths, method="synthesis")
    inside = found.power > 0.0
    lobe = {"rect": 2, "hann": 4, "blackmanharris": 8}[window] * padding
    assert (lobe - 1) ** 2 <= inside.sum() <= (lobe + 1) ** 2
    # the centre's place for all channels (6 mm of 0.5 m) and migration (3 cm, symmetric), over the peak: below 1e-3 of
    # its power
    assert np.abs(found.power - expected.power)[inside].max() < 1e-3 * expected.power.max()
    assert expected.power.argmax() == found.power.argmax()


@pytest.mark.parametrize("method", ["spread", "synthesis"])
def test_shares_of_a_cell_sum_to_one(method) -> None:
    paths = free_space(SMALL, 60, seed=1)
    labels = label_cells(a_map(paths, SMALL), paths, method=method)
    total = np.bincount(labels.cell, weights=labels.entry_share, minlength=labels.instance.size)
    filled = labels.power.ravel() > 0.0
    np.testing.assert_allclose(total[filled], 1.0, rtol=1e-12)
    assert not total[~filled].any() and not labels.instance.ravel()[~filled].any()
    row, column = np.unravel_index(labels.power.argmax(), labels.power.shape)
    shares = labels.shares(row, column)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares[int(labels.instance[row, column]), False] == pytest.approx(float(labels.share[row, column]), rel=1e-6)
    assert max(shares.values()) == pytest.approx(float(labels.share[row, column]), rel=1e-6)


@pytest.mark.slow
def test_the_spread_agrees_with_the_synthesis_of_each_instance() -> None:
    paths = free_space(SMALL, 300, seed=2)
    rd = a_map(paths, SMALL)
    found, expected = label_cells(rd, paths), label_cells(rd, paths, method="synthesis")
    # hann's sidelobes, -31 dB and below, are what the spread leaves out: cells within 20 dB of the peak are above them
    strong = expected.power > 0.01 * expected.power.max()
    assert strong.sum() > 300
    assert (found.instance == expected.instance)[strong].mean() > 0.97
    assert np.sqrt(np.mean((found.share - expected.share)[strong] ** 2)) < 0.05
    clear = strong & (expected.share > 0.8)
    assert clear.sum() > 100 and (found.instance == expected.instance)[clear].all()


def test_the_cells_of_hann_windows_sum_to_more_than_what_is_received() -> None:
    """By Parseval, N sum(w^2) / (sum w)^2 an axis: 1.5 each for long windows, here 1.55 and 1.52."""
    paths = free_space(SMALL, 1, seed=3)
    found = label_cells(a_map(paths, SMALL, window="hann"), paths, method="synthesis")
    received = float(np.mean(np.abs(synthesize(paths, SMALL)) ** 2))
    assert found.power.sum() / received == pytest.approx(2.25, rel=0.06)


def test_the_powers_of_objects_are_floating_point_numbers_also_of_nothing(tmp_path) -> None:
    path = write_scene(tmp_path, instances=[Thing("wall", plane(4.0, 4.0, (20.0, 0.0, 0.0), (-1, 0, 0)), "Wall")])
    sensor = Radar(SMALL, RadarSettings(noise=False, method="raycast", raycast={"num_rays": 500}))
    frame = sensor.observe(load_scene(path).at(0.0), Mount(Pose()), np.random.default_rng(0))
    assert frame.object_power.dtype == frame.object_ghost_power.dtype == np.float64
    assert frame.object_power.max() > 0.0 and not frame.object_ghost_power.any()


def test_equal_phases_and_opposite_phases_of_one_instance() -> None:
    """Two points a quarter of a wavelength apart cancel, half a wavelength apart add: the share follows the field."""
    radar = SMALL.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    quarter = 299792458.0 / radar.center_frequency / 4.0
    for apart, gain in ((quarter, 0.0), (2 * quarter, 4.0)):
        points = [[10.0, 0.0, 0.0], [10.0 + apart, 0.0, 0.0], [10.0, 0.0, 0.0]]
        paths = point_targets(points, np.zeros((3, 3)), 1.0, radar, Pose())
        paths.instance[:, 0] = (1, 1, 2)
        labels = label_cells(a_map(paths, radar), paths)
        share = labels.shares(*np.unravel_index(labels.power.argmax(), labels.power.shape))
        assert share[2, False] == pytest.approx(1.0 / (1.0 + gain), abs=0.01)


def test_a_target_beyond_the_unambiguous_velocity_is_labelled_where_it_comes_out() -> None:
    radar = SMALL.with_(multiplexing="tdm")
    velocity = 1.7 * radar.unambiguous_velocity
    paths = point_targets([[12.0, 3.0, 0.0]], [[velocity, 0.0, 0.0]], 1.0, radar, Pose())
    rd = a_map(paths, radar)
    assert label_cells(rd, paths).power.argmax() == rd.power.argmax()


@pytest.fixture(scope="module")
def wall(tmp_path_factory):
    """Return a metal wall y = 4 m as in notebooks/11_multipath_and_ghosts.ipynb."""
    thing = Thing("wall", plane(32.0, 256.0, (64, 4.0, 0), (0, -1, 0)), "Wall", "steel")
    with variant.radio():
        yield load_scene(write_scene(tmp_path_factory.mktemp("wall"), [thing])).at(0.0)


TARGET, VELOCITY, WALL_Y = np.array([30.0, -1.0, 0.0]), np.array([-10.0, 0.5, 0.0]), 4.0


def ghosts(wall, radar):
    return point_targets([TARGET], [VELOCITY], 10.0, radar, Pose(), state=wall, num_samples=20_000)


def test_paths_over_a_wall_are_ghosts_and_name_the_wall(wall) -> None:
    paths = ghosts(wall, SMALL)
    labels = label_paths(paths, wall)
    number = next(number for number, info in wall.world.instances.items() if info.name == "wall")
    target = paths.instance[0, 0]
    assert (labels.instance == target).all() and target != number
    assert labels.is_ghost.tolist() == [False, True, True, True]
    assert [row[row >= 0].tolist() for row in labels.mirror] == [[], [number], [number], [number, number]]


def test_detected_ghosts_are_labelled_as_ghosts(wall) -> None:
    radar = RadarSpec().with_(num_chirps=128, bandwidth=600e6, pattern=IsotropicPattern())
    paths = ghosts(wall, radar)
    cube = virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(0)), radar)
    rda = range_doppler_angle(cube, radar)
    points = detect(rda, radar, training=(2, 3))
    labels = label_points(points, paths, radar, wall)
    image = np.linalg.norm(TARGET * [1, -1, 1] + [0, 2 * WALL_Y, 0])
    direct = np.linalg.norm(TARGET)
    # image theory: the target, two coincident ghosts half way, the ghost at the image
    for distance, ghost in ((direct, False), ((direct + image) / 2, True), (image, True)):
        near = np.flatnonzero(np.abs(points.range - distance) < 0.6 * radar.range_resolution)
        assert len(near), distance
        row = near[0]  # the strongest
        assert labels.is_ghost[row] == ghost, distance
        assert labels.instance[row] == paths.instance[0, 0]
        assert labels.share[row] == pytest.approx(1.0)
        assert (labels.mirror[row] > 0) == ghost
        # noise, and paths' sidelobes of the window, -31 dB in power and 6 % in field
        assert labels.explained[row] == pytest.approx(1.0, abs=0.15)
    cells = label_cells(rda.range_doppler, paths, wall)
    column = np.rint(np.array([direct, image]) / radar.range_resolution).astype(int)
    row = [np.abs(rda.radial_velocity - v).argmin() for v in (paths.length_rate[0] / 2, paths.length_rate[3] / 2)]
    assert cells.ghost_share[row[0], column[0]] < 0.3 and cells.ghost_share[row[1], column[1]] > 0.7


def test_noise_alone_has_no_label() -> None:
    paths = point_targets([[10.0, 0.0, 0.0]], np.zeros((1, 3)), 1.0, SMALL, Pose())
    none = paths.select(np.zeros(0, dtype=int))
    adc = synthesize(none, SMALL, rng=np.random.default_rng(1))
    rda = range_doppler_angle(virtual_cube(adc, SMALL), SMALL)
    points = detect(rda, SMALL, pfa=0.02)
    assert points.num_points > 5
    for empty in (label_points(points, none, SMALL), label_points(points, paths, SMALL)):
        alone = empty.instance == 0
        assert alone.mean() > 0.8  # few fall on the target's main lobe
        assert not empty.share[alone].any() and not empty.is_ghost.any() and (empty.mirror == -1).all()
    assert label_cells(rda.range_doppler, none).power.max() == 0.0


def test_panes_and_one_body_are_direct_and_another_body_is_multipath() -> None:
    paths = point_targets([[10.0, 0.0, 0.0]] * 4, np.zeros((4, 3)), 1.0, SMALL, Pose())
    chains = {
        (REFRACTION, 5): (POINT_INTERACTION, 7),
        (SPECULAR, 7): (DIFFUSE, 7),
        (SPECULAR, 5): (DIFFUSE, 7),
        (DIFFUSE, 6): (SPECULAR, 5),
    }
    kind, number = (np.array([[first[k], last[k]] for first, last in chains.items()], np.int32) for k in (0, 1))
    depth = np.full(4, 2, np.int32)
    labels = label_paths(replace(paths, interaction=kind, instance=number, depth=depth))
    assert labels.is_ghost.tolist() == [False, False, True, True]
    assert labels.instance.tolist() == [7, 7, 7, 6]
    assert labels.mirror.tolist() == [[-1, -1], [-1, -1], [5, -1], [5, -1]]


def test_an_unknown_method_is_told() -> None:
    paths = free_space(SMALL, 3, seed=0)
    with pytest.raises(ParameterRangeError, match="'spread' or 'synthesis'"):
        label_cells(a_map(paths, SMALL), paths, method="guess")


def test_mirror_reflections_alone(tmp_path) -> None:
    """A plate that faces the radar's image in a wall is seen by wall, plate, wall.

    The plate's ghost, though no point scatters.
    """
    things = [
        Thing("wall", plane(60.0, 60.0, (0, WALL_Y, 0), (0, -1, 0)), "Wall", "steel"),
        Thing("plate", plane(3.0, 3.0, (10, 0, 0), (-10, 2 * WALL_Y, 0)), "Car", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solve_paths(state, SMALL, Pose(), "sionna", max_depth=3)
    labels = label_paths(paths, state)
    number = {info.name: number for number, info in state.world.instances.items()}
    single = paths.depth == 1
    assert paths.instance[single, 0].tolist() == [number["wall"]]  # seen at normal incidence
    assert labels.instance[single].tolist() == [number["wall"]] and not labels.is_ghost[single].any()
    there_and_back = (paths.instance == [number["wall"], number["plate"], number["wall"]]).all(axis=1)
    row = int(np.flatnonzero(there_and_back)[0])
    assert labels.is_ghost[row] and labels.instance[row] == number["plate"]
    assert labels.semantic[row] == semantic_id("Car") and paths.semantic[row] == semantic_id("Wall")
    assert labels.mirror[row].tolist() == [number["wall"], number["wall"], -1]


@pytest.fixture(scope="module")
def highway():
    """Return state, radar and paths of the highway as SCaRL's ray casting sees it from the ego car's front."""
    world = load_scene("highway_guardrail")
    state = world.at(TIME)
    radar = RadarSpec()
    vehicle = state.actor_pose(world.ego)
    mount = Rig.front("draft")["front_center/radar"].vehicle_from_sensor
    pose = vehicle.compose(mount)
    twist = Twist(state.actor_twist(world.ego).velocity_at(pose.position - vehicle.position))
    return state, radar, pose, twist, solve_paths(state, radar, Mount(pose, twist), "raycast", num_rays=100_000)


def test_highway_cells_where_the_car_ahead_stands_are_the_cars(highway) -> None:
    """The box and the speed of the car, of the scene's own ground truth, say where its cells are."""
    state, radar, pose, twist, paths = highway
    rd = a_map(paths, radar)
    labels = label_cells(rd, paths, state)
    assert not labels.entry_is_ghost.any()  # ray casting has single scattering only
    car = next(item for item in state.boxes() if item.name == "car_ahead")
    offset = car.world_from_box.position - pose.position
    velocity = (car.twist.linear - twist.linear) @ offset / np.linalg.norm(offset)
    # the rear half of the car faces us; it opens, which nothing that stands still does
    rear = np.linalg.norm(offset) - car.size[0] / 2.0
    row = np.abs(rd.radial_velocity - velocity).argmin()
    column = np.abs(rd.range - rear).argmin()
    assert velocity > 2.0 * radar.velocity_resolution
    near = np.s_[row - 1 : row + 2, column - 1 : column + 3]
    assert (labels.instance[near] == car.instance).all()
    assert (labels.semantic[near] == semantic_id("Car")).all() and labels.share[near].min() > 0.95
    # and nowhere else: its cells lie within its box, and two cells more of the windows' main lobe
    mine = np.argwhere(labels.instance == car.instance)
    distance = rd.range[mine[:, 1]]
    reach = np.linalg.norm(car.size) / 2.0 + 2.0 * radar.range_resolution
    assert np.abs(distance - np.linalg.norm(offset)).max() < reach


def test_highway_detections_have_the_label_of_the_box_they_lie_in(highway) -> None:
    state, radar, pose, _, paths = highway
    cube = virtual_cube(synthesize(paths, radar, rng=np.random.default_rng(0)), radar)
    rda = range_doppler_angle(cube, radar)
    points = detect(rda, radar)
    labels = label_points(points, paths, radar, state)
    assert points.num_points > 20
    for name in ("car_ahead", "oncoming"):
        box = next(item for item in state.boxes() if item.name == name)
        local = box.world_from_box.inverse().apply(pose.apply(points.position))
        # the radar has no elevation; half a range cell and 2 deg of azimuth around the box
        slack = np.array(
            [radar.range_resolution, np.radians(2.0) * np.linalg.norm(box.world_from_box.position - pose.position)]
        )
        inside = (np.abs(local[:, :2]) < box.size[:2] / 2.0 + slack).all(axis=1)
        mine = labels.instance == box.instance
        strongest = np.flatnonzero(mine)
        assert len(strongest) and inside[strongest[0]], name
        assert labels.semantic[strongest[0]] == box.semantic
        assert labels.share[strongest[0]] > 0.5
    assert np.median(labels.explained) == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("fraction", [0.9, -0.9])
def test_moving_targets_of_one_cell_are_told_apart_by_their_direction_in_tdm(fraction: float) -> None:
    """Two instances at one range and velocity.

    The beam sees each alone only if the motion between transmitters is removed.
    """
    radar = RadarSpec().with_(
        multiplexing="tdm", num_chirps=64, bandwidth=150e6, num_samples=128, pattern=IsotropicPattern()
    )
    velocity = fraction * radar.unambiguous_velocity
    # The beams of 12 elements half a wavelength apart are zero at steps of 1/6 in the sine of the azimuth
    azimuth = np.arcsin([-1.0 / 12.0, 1.0 / 12.0])
    unit = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(2)], axis=1)
    paths = point_targets(40.0 * unit, velocity * unit, [10.0, 10.0], radar, Pose())
    paths.instance[:, 0] = (1, 2)
    middle = radar.num_tx * radar.num_chirps * radar.waveform.chirp_interval / 2.0
    power = received_power(paths, radar) * (40.0 / (40.0 + velocity * middle)) ** 4  # a map has that of mid-frame
    zero = np.zeros(2)
    points = RadarPoints(40.0 * unit, np.full(2, 40.0), azimuth, zero, np.full(2, velocity), power, zero, zero)
    labels = label_points(points, paths, radar)
    assert labels.instance.tolist() == [1, 2]
    # Left in, the phase of 54 deg a transmitter turns the beam by half its width. The wavefront's curvature, k (1 cm)^2
    # / (2 40 m) = 0.002 rad, keeps the other target from vanishing in the beam's zero: 1e-3 of its field, twice that in
    # the power of both.
    assert labels.explained == pytest.approx([1.0, 1.0], abs=4e-3)
    assert labels.share.min() > 1.0 - 4e-6


def test_classes_are_found_among_the_paths_without_a_state() -> None:
    """A path's class is that of its last instance.

    The target behind a mirror, and the mirror itself where a path ends on it.
    """
    paths = point_targets([[10.0, 0.0, 0.0]] * 3, np.zeros((3, 3)), 1.0, SMALL, Pose())
    labels = label_paths(
        replace(
            paths,
            instance=np.array([[5, 7], [7, -1], [5, -1]], np.int32),
            interaction=np.array([[SPECULAR, POINT_INTERACTION], [POINT_INTERACTION, -1], [SPECULAR, -1]], np.int32),
            depth=np.array([2, 1, 1], np.int32),
            semantic=np.array([14, 14, 3], np.uint8),
        )
    )
    assert labels.instance.tolist() == [7, 7, 5]
    assert labels.semantic.tolist() == [14, 14, 3]
