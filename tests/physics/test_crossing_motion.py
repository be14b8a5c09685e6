"""Frames in which things cross the view: every antenna pair has its own rate; directions and strengths move.

Points against a wave followed back in time, antennas moving and turning (tests/oracles/crossing.py); bodies, mirrors
and gains against paths traced anew at single chirps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.paths import RadarPaths, bend_of
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import point_targets, solve_points
from scarl_sionna.radar.synthesis import groups, synthesize
from scarl_sionna.radar.synthesis.blocks import later
from scarl_sionna.radar.synthesis.motion import PathMotion
from scarl_sionna.signal.angle import range_doppler_angle
from scarl_sionna.signal.processing import virtual_cube
from tests.oracles.crossing import crossing_signal, turned
from tests.oracles.fmcw import C, beat_phase
from tests.scenes import Thing, box, plane, write_scene

PARTS = {"pattern": IsotropicPattern(), "tx_power_dbm": 30.0, "bandwidth": 150e6, "num_samples": 256}
ENDS = {
    "ideal": {"tx_positions": ((0.0, -0.0078, 0.0), (0.0, 0.0078, 0.0))},
    "tdm": {"tx_positions": ((0.0, -0.0078, 0.0), (0.0, 0.0, 0.0019), (0.0, 0.0078, 0.0))},
}
RX = ((0.0, -0.003, 0.0), (0.0, 0.003, 0.0))
BOUND_DB = 20.0 * np.log10(Accuracy().motion_tolerance + Accuracy().synthesis_tolerance)
"""What the settings promise, -59 dB; the bar is -40 dB."""
RADARS = {
    "at rest": Twist(),
    "moving": Twist([20.0, 3.0, 0.0]),
    "turning": Twist([10.0, 1.0, 0.0], [0.02, -0.03, 0.6]),
}


def ends_of_the_array(multiplexing: str) -> RadarSpec:
    """A radar of 256 chirps with the outermost antennas of the default one."""
    return RadarSpec().with_(**PARTS, multiplexing=multiplexing, rx_positions=RX, **ENDS[multiplexing])


def error_db(radar, point, velocity, mount, accuracy: Accuracy | None = None) -> float:
    """Largest error of a point's signal over its peak, of the four outermost pairs.

    Over every eighth chirp and sample, and the last ones: motion is smooth from one to the next.
    """
    paths = point_targets([point], [velocity], 1.0, radar, mount)
    signal = synthesize(paths, radar, accuracy=accuracy or Accuracy())
    strength = np.sqrt(1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10)) * np.abs(paths.a[0, 0, 0]) * (point @ point)
    chirps, samples = (np.append(np.arange(0, n, 8), n - 1) for n in (radar.num_chirps, radar.num_samples))
    ts = samples / radar.sample_rate
    worst = 0.0
    for tx in (0, radar.num_tx - 1):
        start = chirps * radar.doppler_interval + radar.tx_delay(tx)
        for rx in range(2):
            exact = crossing_signal(
                point,
                velocity,
                mount.twist.linear,
                mount.twist.angular,
                mount.pose.rotate(radar.tx_array[tx]),
                mount.pose.rotate(radar.rx_array[rx]),
                strength,
                radar.waveform.start_frequency,
                radar.waveform.chirp_slope,
                start[:, None] + ts,
                ts,
            )
            found = signal[rx, tx :: radar.num_tx][np.ix_(chirps, samples)]
            worst = max(worst, np.abs(found - exact).max() / np.abs(exact).max())
    return 20.0 * np.log10(worst)


@pytest.fixture(params=["as planned", "series only"])
def forced(request, monkeypatch):
    """The plain sum, which few paths go to, or the series in time, which many do."""
    if request.param == "series only":
        monkeypatch.setattr(groups, "DIRECT_COST", np.inf)
    return request.param


@pytest.mark.some(1)
@pytest.mark.parametrize("motion", RADARS)
@pytest.mark.parametrize("multiplexing", ENDS)
def test_a_point_in_any_motion_is_the_exact_retarded_signal(forced, multiplexing: str, motion: str) -> None:
    radar, mount = ends_of_the_array(multiplexing), Mount(Pose.from_euler([0.0, 0.0, 0.0], yaw=0.1), RADARS[motion])
    for distance in (3.0, 10.0, 100.0):
        point = distance * np.array([np.cos(0.3), -np.sin(0.3), 0.1])
        for speed in (0.0, 1.0, 8.0, 30.0, 70.0) if forced == "as planned" else (1.0, 30.0, 70.0):
            for direction in ((0.3, 0.95, 0.0), (-0.7, 0.7, 0.0), -point / np.linalg.norm(point)):
                velocity = speed * np.asarray(direction)
                found = error_db(radar, point, velocity, mount)
                assert found < BOUND_DB, (distance, speed, direction)


def test_many_points_share_few_terms_within_the_bound(monkeypatch) -> None:
    """A group of all motions at once: every point alone, through the transforms of all."""
    monkeypatch.setattr(groups, "DIRECT_COST", np.inf)
    radar, rng = ends_of_the_array("tdm"), np.random.default_rng(4)
    count = 60
    distance, azimuth = rng.uniform(3.0, 110.0, count), rng.uniform(-1.0, 1.0, count)
    points = distance[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(count)], axis=1)
    velocities = rng.normal(0.0, 15.0, (count, 3))
    paths = point_targets(points, velocities, distance**4, radar, Mount(Pose(), RADARS["turning"]))
    for index in range(0, count, 12):
        alone = np.zeros_like(paths.a)
        alone[index] = paths.a[index]
        fast = synthesize(replace(paths, a=alone), radar)
        exact = synthesize(paths.select([index]), radar, method="direct")
        assert 20.0 * np.log10(np.abs(fast - exact).max() / np.abs(exact).max()) < BOUND_DB


@pytest.mark.parametrize("count", [1, 40])
def test_linear_motion_has_a_rate_of_every_pair_and_no_more(count: int) -> None:
    """SCaRL's own motion, as `raycast` has it: (L + L' t) / (c + L' / 2) with the length and the rate of each pair."""
    radar, mount = ends_of_the_array("tdm"), Mount(Pose(), RADARS["turning"])
    point, velocity = np.array([8.0, -2.0, 0.3]), np.array([3.0, 25.0, -1.0])
    paths = point_targets([point], [velocity], 1.0, radar, mount).select(np.zeros(count, dtype=np.int64))
    paths = replace(paths, linear_motion=np.ones(count, dtype=bool), length_acceleration=np.zeros(count))
    signal = synthesize(paths, radar) / count
    strength = np.sqrt(1e-3 * 10 ** (radar.front_end.tx_power_dbm / 10)) * np.abs(paths.a[0, 0, 0]) * (point @ point)
    ts = np.arange(radar.num_samples) / radar.sample_rate
    for tx, rx in ((0, 1), (2, 0)):
        ends = radar.tx_array[tx], radar.rx_array[rx]
        distances = [np.linalg.norm(point - end) for end in ends]
        rate = 0.0
        for end, distance in zip(ends, distances, strict=True):
            relative = velocity - mount.twist.linear - np.cross(mount.twist.angular, end)
            rate += (point - end) @ relative / distance
        time = (np.arange(radar.num_chirps) * radar.doppler_interval + radar.tx_delay(tx))[:, None] + ts
        delay = (sum(distances) + rate * time) / (C + rate / 2.0)
        phase = np.mod(beat_phase(radar.waveform.start_frequency, radar.waveform.chirp_slope, delay, ts), 2.0 * np.pi)
        exact = strength / np.prod(distances) * np.exp(1j * phase)
        assert np.abs(signal[rx, tx :: radar.num_tx] - exact).max() < 1e-4 * np.abs(exact).max()


def test_what_rates_of_the_array_centre_cost() -> None:
    """30 m/s sideways at 10 m: the signal is off by decibels, and so is every pair's rate."""
    radar, mount = ends_of_the_array("ideal"), Mount(Pose())
    point, velocity = np.array([10.0, 0.0, 0.0]), np.array([0.0, 30.0, 0.0])
    assert error_db(radar, point, velocity, mount, Accuracy(motion_tolerance=None)) > -12.0
    assert error_db(radar, point, velocity, mount) < BOUND_DB


@pytest.mark.some(1)
@pytest.mark.parametrize("multiplexing", ["ideal", "tdm"])
def test_the_direction_is_that_of_mid_frame(multiplexing: str) -> None:
    radar = RadarSpec().with_(pattern=IsotropicPattern(), multiplexing=multiplexing, num_samples=64, bandwidth=40e6)
    point, velocity = np.array([10.0, -3.0, 0.0]), np.array([0.0, 30.0, 0.0])
    if multiplexing == "tdm":  # 10 m/s: more is folded
        velocity = velocity / 3.0
    paths = point_targets([point], [velocity], 1.0, radar, Pose())
    middle = point + velocity * radar.doppler_interval * radar.num_chirps / 2.0

    def azimuth(accuracy: Accuracy) -> float:
        cube = virtual_cube(synthesize(paths, radar, accuracy=accuracy), radar)
        rda = range_doppler_angle(cube, radar, num_azimuth=1024)
        best = np.unravel_index(rda.data.argmax(), rda.data.shape)
        return np.degrees(rda.azimuth[best[2]])

    truth = np.degrees(np.arctan2(middle[1], middle[0]))
    moved = np.degrees(np.arctan2(middle[1], middle[0]) - np.arctan2(point[1], point[0]))
    assert moved > 0.7
    assert abs(azimuth(Accuracy(motion_tolerance=None)) - truth) > 0.6 * moved
    # half a bin of the sine is 1e-3: 0.06 deg
    assert azimuth(Accuracy()) == pytest.approx(truth, abs=0.1)


def at_chirps(solve, radar: RadarSpec, chirps, accuracy: Accuracy) -> float:
    """Largest difference of a frame's chirps from paths solved anew at those, over the frame's peak [dB].

    `solve` gives the paths at a time; within one ramp they move by the same description.
    """
    whole = synthesize(solve(0.0), radar, accuracy=accuracy)
    single, worst = radar.with_(num_chirps=1), 0.0
    for chirp in chirps:
        for tx in range(radar.num_tx):
            ramp = chirp * radar.num_tx + tx
            time = chirp * radar.doppler_interval + radar.tx_delay(tx)
            # the single chirp's own transmitters start later by their delays: only the one that starts now is compared
            fresh = synthesize(later(solve(time), -radar.tx_delay(tx)), single, accuracy=accuracy)[:, tx]
            worst = max(worst, float(np.abs(fresh - whole[:, ramp]).max()))
    return 20.0 * np.log10(worst / np.abs(whole).max())


def moved_mount(pose: Pose, twist: Twist, time: float) -> Mount:
    axes = np.stack([turned(axis, twist.angular, time) for axis in pose.rotation.T], axis=1)
    return Mount(Pose.from_rotation(pose.position + twist.linear * time, axes), twist)


@pytest.mark.some(1)
@pytest.mark.parametrize("multiplexing", ENDS)
def test_ghosts_of_a_moving_wall_seen_by_a_turning_radar(tmp_path, multiplexing: str) -> None:
    wall = Thing(
        "truck",
        plane(60.0, 40.0, (0, 0, 0), (0, -1, 0)),
        "Truck",
        "steel",
        {"kind": "constant_twist", "position": [10, 4, 0], "velocity": [3, -2, 0], "angular_velocity_z": 0.0},
    )
    world = load_scene(write_scene(tmp_path, actors=[wall]))
    radar = ends_of_the_array(multiplexing)
    pose, twist = Pose.from_euler([0.0, 0.0, 0.5], yaw=0.1), Twist([15.0, 1.0, 0.0], [0.0, 0.0, 0.4])
    target, motion = np.array([12.0, -1.0, 0.8]), np.array([-4.0, 9.0, 0.0])

    def solve(time: float) -> RadarPaths:
        points = PointScatterers([target + motion * time], [motion], 1e5)  # about as strong as the wall
        mount = moved_mount(pose, twist, time)
        options = {"num_samples": 4000, "max_depth": 2, "refraction": False}
        return solve_points(world.at(1.0 + time), radar, mount, points, environment=True, **options)

    now = solve(0.0)
    assert now.num_paths >= 5 and now.is_mirror_chain.any()
    assert at_chirps(solve, radar, (1, 128, 255), Accuracy()) < BOUND_DB + 6.0  # paths add up
    assert at_chirps(solve, radar, (255,), Accuracy(motion_tolerance=None)) > -25.0


@pytest.mark.some(1)
@pytest.mark.parametrize("motion", ["body", "radar"])
def test_patches_of_a_body_that_crosses(tmp_path, motion: str) -> None:
    """Small patches: each keeps its own pattern over a frame, which what moves across turns (docs/sbr.md)."""
    speed = 12.0 if motion == "body" else 0.0
    trajectory = {"kind": "constant_twist", "position": [10, -2, 0], "velocity": [0, speed, 0]}
    trajectory["angular_velocity_z"] = 0.0
    body = Thing("body", box((0.05, 0.04, 0.03)), "Car", "steel", trajectory)
    world = load_scene(write_scene(tmp_path, actors=[body]))
    radar = ends_of_the_array("ideal").with_(num_samples=64)
    twist = Twist() if motion == "body" else Twist([20.0, -12.0, 0.0], [0.0, 0.0, 0.3])

    def solve(time: float, max_phase: float = 1e-3) -> RadarPaths:
        mount = moved_mount(Pose(), twist, time)
        knobs = {"floor_db": None, "max_phase": max_phase, "max_turn": None}
        return solve_paths(world.at(time), radar, mount, "sbr", **knobs)

    now = solve(0.0)
    assert now.num_paths > 500 and np.isfinite(now.tx_velocity).all()
    assert at_chirps(solve, radar, (1, 64, 128, 255), Accuracy()) < -40.0
    # patches as large as the body's faces: above -20 dB with the patterns of the frame's start
    assert at_chirps(lambda time: solve(time, 0.2), radar, (128,), Accuracy()) < -35.0
    assert at_chirps(solve, radar, (255,), Accuracy(motion_tolerance=None)) > -25.0


def crossing_error_db(folder, mesh, speed: float, distance: float, radar: RadarSpec, **knobs: object) -> float:
    """Largest error over a frame of a body that passes sideways, against solves at single chirps with finer patches."""
    trajectory = {"kind": "constant_twist", "position": [distance, 0.3, 0], "velocity": [0, speed, 0]}
    trajectory["angular_velocity_z"] = 0.0
    folder.mkdir(exist_ok=True)
    world = load_scene(write_scene(folder, actors=[Thing("body", mesh, "Car", "steel", trajectory)]))

    def solve(time: float) -> RadarPaths:
        own = knobs if time == 0.0 else {"max_phase": 0.1, "max_turn": 0.2}
        return solve_paths(world.at(time), radar, moved_mount(Pose(), Twist(), time), "sbr", floor_db=None, **own)

    return at_chirps(solve, radar, (64, 128, 255), Accuracy())


@pytest.mark.some(2)
@pytest.mark.parametrize("pattern", ["isotropic", "default"])
@pytest.mark.parametrize("multiplexing", ENDS)
@pytest.mark.parametrize("distance", [3.0, 5.0, 10.0])
def test_default_patches_follow_what_crosses(tmp_path, distance: float, multiplexing: str, pattern: str) -> None:
    """Up to 70 m/s sideways: -37 dB with transfers of the frame's start, 3 m; -22 dB with gains of it, too."""
    radar = ends_of_the_array(multiplexing).with_(num_samples=64)
    radar = radar if pattern == "isotropic" else radar.with_(pattern=RadarSpec().array.pattern)
    for speed in (10.0, 30.0, 50.0, 70.0):
        found = crossing_error_db(tmp_path / f"{speed:g}", box((0.05, 0.04, 0.03)), speed, distance, radar)
        assert found < -50.0, speed  # -54.5 dB at 3 m, 70 m/s and TDM, whose frame lasts three times as long


@pytest.mark.some(1)
@pytest.mark.parametrize("multiplexing", ENDS)
@pytest.mark.parametrize(("speed", "distance"), [(30.0, 3.0), (70.0, 3.0), (70.0, 10.0)])
def test_default_patches_of_a_plate_that_crosses(tmp_path, speed: float, distance: float, multiplexing: str) -> None:
    """-34 dB at 70 m/s and 3 m with transfers of the frame's start."""
    mesh = plane(0.1, 0.08, (0, 0, 0), (-1, 0.05, 0.02))
    radar = ends_of_the_array(multiplexing).with_(num_samples=64)
    assert crossing_error_db(tmp_path, mesh, speed, distance, radar) < -40.0


@pytest.mark.some(1)
@pytest.mark.parametrize("speed", [30.0, 70.0])
def test_patches_of_the_levels_of_auto_that_cross(tmp_path, speed: float) -> None:
    """Patches that motion turns by 1 rad, as at 1 dB, and by 2: their patterns follow, too, to second order."""
    radar = ends_of_the_array("ideal").with_(num_samples=64)
    coarse = {"max_phase": 1.0, "integration_phase": 0.02, "max_turn": 1.0}
    assert crossing_error_db(tmp_path / "1", box((0.05, 0.04, 0.03)), speed, 3.0, radar, **coarse) < -50.0
    assert crossing_error_db(tmp_path / "2", box((0.05, 0.04, 0.03)), speed, 3.0, radar, max_turn=2.0) < -35.0


@pytest.mark.parametrize("speed", [10.0, 30.0, 70.0])
def test_gains_follow_directions_over_a_frame(forced, speed: float) -> None:
    """A point, the default pattern: with the gains of the frame's start -31 dB at 30 m/s and 3 m, -22 dB at 70 m/s."""
    for multiplexing in ENDS:
        radar = ends_of_the_array(multiplexing).with_(num_samples=64, pattern=RadarSpec().array.pattern)
        for distance in (3.0, 5.0, 10.0):

            def solve(time: float, distance: float = distance, radar: RadarSpec = radar) -> RadarPaths:
                place = [[distance, 0.3 + speed * time, 0.0]]
                return point_targets(place, [[0.0, speed, 0.0]], 1.0, radar, Pose())

            assert at_chirps(solve, radar, (64, 128, 255), Accuracy()) < BOUND_DB


def test_a_scene_at_rest_has_the_same_patches_with_and_without_motion(tmp_path) -> None:
    body = Thing("body", box((0.5, 0.4, 0.3), (6.0, 0.0, 0.0)), "Car", "steel")
    state = load_scene(write_scene(tmp_path, [body])).at(0.0)
    radar = ends_of_the_array("ideal")
    one, other = (solve_paths(state, radar, Pose(), "sbr", max_turn=turn) for turn in (0.25, None))
    assert np.array_equal(one.rx_point, other.rx_point) and np.array_equal(one.a, other.a)
    moving = solve_paths(state, radar, Mount(Pose(), Twist([0.0, 10.0, 0.0])), "sbr", max_turn=0.25)
    assert moving.num_paths > 5 * one.num_paths


@pytest.mark.parametrize("time", [0.4e-3, -2e-3])
def test_paths_moved_on_are_the_same_motion_from_then_on(time: float) -> None:
    """Points, a path of mirrors and one in linear motion, a radar that moves and turns: lengths of every pair agree."""
    radar = ends_of_the_array("ideal")
    mount = Mount(Pose.from_euler([1.0, 2.0, 0.5], yaw=0.4), RADARS["turning"])
    paths = point_targets([[9.0, 1.0, 0.2], [5.0, 3.0, 1.0]] * 2, [[1.0, 30.0, -2.0]] * 4, 1.0, radar, mount)
    image = np.full((4, 3, 4), np.nan)
    image[1] = [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 14.0], [0.0, 0.0, 1.0, 0.0]]  # of a wall at y = 7 m
    paths = replace(paths, rx_image=image, linear_motion=np.array([False, False, True, False]))
    way, speed = paths.end_vectors()[0][[1]], paths.rx_velocity[[1]]
    rate, bend = paths.length_rate.copy(), np.array([3.0, bend_of(way, speed)[0], 0.0, 5.0])
    rate[1] = np.sum(way * speed) / np.linalg.norm(way)
    unknown = np.array([True, True, True, False])[:, None]
    paths = replace(
        paths,
        tx_velocity=np.where(unknown, paths.tx_velocity, np.nan),
        rx_velocity=np.where(unknown, paths.rx_velocity, np.nan),
        length_rate=rate,
        length_acceleration=bend,
    )
    moved = later(paths, time)
    assert moved.length[2] == pytest.approx(paths.length[2] + time * paths.length_rate[2], abs=1e-12)
    change = time * paths.length_rate[3] + 2.5 * time**2
    assert moved.length[3] == pytest.approx(paths.length[3] + change, abs=1e-12)
    first, second = (PathMotion.of(item.select([0, 1]), radar) for item in (paths, moved))
    after = np.array([0.0, 1e-3, 5e-3])
    for tx in range(2):
        for rx in range(2):
            expected, found = first.ends(tx, rx, after + time), second.ends(tx, rx, after)
            assert found.length == pytest.approx(expected.length, abs=1e-12)
            assert found.strength * second.amplitude == pytest.approx(expected.strength * first.amplitude, rel=1e-10)
