"""Micro-Doppler of a pedestrian and a cyclist against their kinematic models: limbs, envelope, wheels."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from benchmarks.micro_doppler import BELOW_DB, LEGS, SPEED_UP, WINDOW, cyclist, radar_of, tyres, walker
from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose
from scarl_sionna.radar.micro_doppler import Spectrogram, part_of_paths, spectrograms, surface_motion, window_half_width
from scarl_sionna.radar.points import point_targets
from scarl_sionna.scene.motion.gait import SEGMENTS
from tests.actor_scenes import actor_world
from tests.scenes import Thing, box, write_scene


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    return walker(tmp_path_factory.mktemp("walker"), columns=16, looks=2, detail="light", num_rays=8_000)


@pytest.fixture(scope="module")
def riding(tmp_path_factory):
    return cyclist(tmp_path_factory.mktemp("cyclist"), columns=10, looks=3, detail="light", num_rays=12_000)


def test_limbs_of_a_walker(walking):
    """Correlation over 0.99 with the analytic velocities of the limbs, which no part of the radar chain knows."""
    assert walking.pooled(SEGMENTS) > 0.99
    for limb in ("foot", "lower_leg"):
        for side in ("left", "right"):
            assert walking.correlation(f"{side}_{limb}") > 0.99
    # An unbiased estimate: torso and head, 100 to 500 hits each, have a speckle error of spread / sqrt(looks) = 0.04
    # m/s
    for segment in ("torso", "head"):
        assert walking.rms(segment) < 0.05


def test_envelope_of_a_walker(walking):
    """The edge of the whole spectrogram follows the fastest point of the body, the swinging foot's."""
    edge, exact = walking.edges("whole")[:, 0], walking.extremes["whole"][:, 0]
    assert np.corrcoef(edge, exact)[0, 1] > 0.99
    assert np.abs(edge - exact).max() < 0.6  # one line of 0.31 m/s, and what a foot gains in 6.4 ms at 50 m/s2: 0.3 m/s


@pytest.mark.slow
def test_pedalling_legs(riding):
    """At a constant speed, so that nothing but the pedalling is correlated.

    What a correlation lacks to 1 is speckle and goes as 1 / looks: 0.0034 with ten (docs/micro_doppler.md), 0.011 with
    three.
    """
    assert riding.pooled([f"{side}_{part}" for side in ("left", "right") for part in LEGS]) > 0.98
    for side in ("left", "right"):
        assert riding.correlation(f"{side}_foot") > 0.998
        assert riding.rms(f"{side}_foot") < 0.06


def test_tyre_spans_zero_to_twice_the_speed(tmp_path):
    rolling = tyres(tmp_path, columns=10, detail="light", num_rays=12_000)
    edges, exact = rolling.edges("wheel_front_tyre"), rolling.extremes["wheel_front_tyre"]
    speed = 3.0 + SPEED_UP * rolling.spectra["whole"].time
    # The fastest triangle is the highest, with its middle a little nearer to the axle than the tyre's surface is; it is
    # up to half a step of the tyre's segments off the top, 1 - cos(step / 2) of its half of the speed less.
    tyre = trimesh.load(ss.read_actor_model("bicycle").path.parent / "meshes/wheel_front_tyre_light.ply", process=False)
    middle = (tyre.triangles_center - tyre.bounds.mean(axis=0))[:, [0, 2]]
    reach, radius = np.hypot(*middle.T), np.ptp(tyre.bounds[:, 2]) / 2.0
    angles = np.sort(np.arctan2(*middle[reach > reach.max() - 1e-3].T))
    step = np.diff(angles, append=angles[0] + 2.0 * np.pi).max()
    way = np.array([12.0 * np.cos(np.radians(20.0)) - 0.54, 12.0 * np.sin(np.radians(20.0)), 0.9 - 0.68])
    top = -(1.0 + reach.max() / radius) * speed * way[0] / np.linalg.norm(way)
    np.testing.assert_allclose(
        exact[:, 0], top, rtol=0.5 * (1.0 - np.cos(step / 2.0)) + 0.001
    )  # the radar sees the top 0.1 % differently
    bottom = top * (1.0 - reach.max() / radius) / (1.0 + reach.max() / radius)
    np.testing.assert_allclose(exact[:, 1], bottom, atol=speed.max() * (1.0 - np.cos(step / 2.0)) + 0.01)
    assert np.corrcoef(edges[:, 0], exact[:, 0])[0, 1] > 0.999
    # a line's width, 0.31 m/s, either way: which point of the rim rays meet is left to chance
    np.testing.assert_allclose(edges[:, 0], exact[:, 0], atol=0.31)


def test_a_part_sees_only_its_own(tmp_path):
    """The spectrum of a group is that of a target that consists of the group, behind what hides it."""
    motion = {"kind": "constant_twist", "position": [0.0, 0.0, 0.0], "velocity": [5.0, 0.0, 0.0]}
    world = actor_world(tmp_path, "bicycle", motion, "light")
    radar, pose = radar_of(64, 1e-4, 10.0, 12.0), Pose.from_euler([12.0, 0.0, 0.9], yaw=np.pi)
    frame = [part for part, name in enumerate(world.parts.name) if name == "it_frame"]
    found = spectrograms(world, radar, pose, [0.0], {"frame": frame, "none": []}, num_rays=4_000)
    assert found["frame"].mean_velocity()[0] == pytest.approx(-5.0, abs=0.05)
    assert np.isnan(found["none"].mean_velocity()[0]) and np.isnan(found["none"].edges()).all()
    state = world.at(0.0)
    beside = point_targets(np.array([[0.0, 3.0, 1.0]]), np.zeros((1, 3)), 1.0, radar, pose)
    assert part_of_paths(beside, state).tolist() == [-1]  # a point in the air
    motion = surface_motion(world, 0.0, pose, frame)
    np.testing.assert_allclose(motion.radial_velocity, -5.0, rtol=0.01)
    assert 0.0 < motion.in_view.sum() < motion.area.sum()
    assert np.isnan(motion.mean_velocity([])) and motion.extremes(frame)[1] < -4.95


def test_columns_are_solved_at_their_times_and_looks_are_averaged(tmp_path):
    """Without looks each column is one solve at its own time; with looks, the mean of those at the sums of both."""
    target = Thing(
        "target",
        box((0.3, 0.3, 0.3)),
        trajectory={"kind": "constant_twist", "position": [8.0, 0.0, 0.0], "velocity": [2.0, 0.0, 0.0]},
    )
    world = ss.load_scene(write_scene(tmp_path, [], [target]))
    radar, asked = radar_of(16, 1e-4, 4.0, 12.0), []

    def place(time: float) -> Pose:
        asked.append(time)
        return Pose()

    plain = spectrograms(world, radar, place, [0.25, 0.5], num_rays=2_000)["whole"]
    assert asked == [0.25, 0.5] and plain.time.tolist() == [0.25, 0.5]
    looked = spectrograms(world, radar, place, [0.25], looks=(0.0, 0.25), num_rays=2_000)["whole"]
    assert asked[2:] == [0.25, 0.5]
    np.testing.assert_allclose(looked.power[0], plain.power.mean(axis=0), rtol=1e-9)
    assert not np.allclose(plain.power[0], plain.power[1], rtol=0.1, atol=0.0)  # so that the mean tells them apart
    assert plain.mean_velocity() == pytest.approx([2.0, 2.0], abs=0.05)


def test_edges_and_half_width_of_one_line():
    """A point at constant speed: the mean is its speed, the edges less the half width are its speed."""
    radar = radar_of(64, 1e-4, 10.0, 10.0)
    pose, speed = Pose(), -2.345
    paths = point_targets(np.array([[8.0, 0.0, 0.0]]), np.array([[speed, 0.0, 0.0]]), 1.0, radar, pose)
    from scarl_sionna.radar.micro_doppler import _spectrum
    from scarl_sionna.signal.processing import doppler_axis

    power = _spectrum(paths, radar, 512, WINDOW)
    line = Spectrogram(np.zeros(1), doppler_axis(radar, 512), power[None])
    assert line.mean_velocity()[0] == pytest.approx(speed, abs=2e-3)
    half = window_half_width(radar, BELOW_DB, WINDOW)
    np.testing.assert_allclose(
        line.edges(BELOW_DB)[0], [speed - half, speed + half], atol=0.01
    )  # a bin of 0.038 m/s, interpolated
    with pytest.raises(ParameterRangeError, match="side lobes of a hann"):
        window_half_width(radar, BELOW_DB, "hann")
    with pytest.raises(ParameterRangeError, match="below_db"):
        line.edges(-3.0)
