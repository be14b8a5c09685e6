"""Spectrogram of a body that bends, over time and velocity, against the sum over the same skin by its definition."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from scipy.spatial import cKDTree

import scarl_sionna as ss
from examples.breathing_person import Gltf
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.engine.load import load_scene, stage
from scarl_sionna.engine.world import World
from scarl_sionna.radar.micro_doppler import spectrograms
from scarl_sionna.scene.motion.trajectory import StaticTrajectory
from scarl_sionna.signal.processing import range_doppler, virtual_cube
from scarl_sionna.signal.windows import window_values
from tests.oracles import bending_arm as arm
from tests.scenes import Thing, plane, write_scene

Array = npt.NDArray[np.float64]

STEP = 9e-4
"""Of the closed form's points [m], 0.23 wavelengths: steps of 0.13 give an echo within 0.03 dB."""
SIDES = 64
"""Of a ring of the mesh, whose middles lie 0.04 mm below the skin; rings are 1 cm apart."""
BINS = 128
EYE = np.array([0.0, 0.0, 0.6])
YAWED = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From the file's axes (left, up, forward) into a world in which the body faces the radar."""


def write_arm(path: Path) -> tuple[Path, Array]:
    """Write the arm as a skinned glTF of two bones; return it and its vertices, the poles last."""
    along, radius = arm.outline(0.01)
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = [radius[:, None] * np.cos(turn), np.repeat(arm.SHOULDER - along[:, None], SIDES, axis=1)]
    poles = [[0.0, arm.SHOULDER + arm.RADIUS, 0.0], [0.0, arm.SHOULDER - arm.LENGTH - arm.RADIUS, 0.0]]
    vertices = np.concatenate([np.stack([*ring, radius[:, None] * np.sin(turn)], axis=2).reshape(-1, 3), poles])
    here, beside = np.arange(SIDES), (np.arange(SIDES) + 1) % SIDES
    faces, last = [], len(vertices) - 2
    for first in range(0, last - SIDES, SIDES):
        below = first + SIDES
        faces += [np.stack([first + here, first + beside, below + beside], axis=1)]
        faces += [np.stack([first + here, below + beside, below + here], axis=1)]
    end = last - SIDES
    faces += [np.stack([here, 0 * here + last, beside], axis=1)]
    faces += [np.stack([end + here, end + beside, 0 * here + last + 1], axis=1)]
    low = arm.share(arm.SHOULDER - vertices[:, 1])
    none = np.zeros_like(low)

    file = Gltf()
    attributes = {
        "POSITION": file.add(vertices, "VEC3"),
        "JOINTS_0": file.add(np.stack([none, none + 1.0, none, none], axis=1), "VEC4", "<u2"),
        "WEIGHTS_0": file.add(np.stack([1.0 - low, low, none, none], axis=1), "VEC4"),
    }
    bind = np.repeat(np.eye(4)[None], 2, axis=0)
    bind[:, 1, 3] = [-arm.SHOULDER, arm.ELBOW - arm.SHOULDER]
    indices = file.add(np.concatenate(faces), "SCALAR", "<u4")
    file.tables |= {
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": file.add(bind.transpose(0, 2, 1), "MAT4")}],
        "nodes": [
            {"name": "arm", "mesh": 0, "skin": 0},
            {"name": "shoulder", "translation": [0.0, arm.SHOULDER, 0.0], "children": [2]},
            {"name": "elbow", "translation": [0.0, -arm.ELBOW, 0.0]},
        ],
        "scenes": [{"nodes": [0, 1]}],
    }
    times = np.linspace(0.0, arm.PERIOD, 201)
    for node, angle in zip((1, 2), arm.angles(times), strict=True):
        zero = np.zeros_like(angle)
        file.channel(node, "rotation", times, np.stack([np.sin(-angle / 2.0), zero, zero, np.cos(angle / 2.0)], axis=1))
    return file.write(path), vertices


class Swing:
    """The arm 6 m in front of a radar, as the simulator has it and by its closed form."""

    def __init__(self, folder: Path) -> None:
        file, self.vertices = write_arm(folder / "arm.glb")
        model = ss.actor_from_body(file, materials="metal", motion="stand", smooth=True, folder=folder / "model")
        scene = load_scene(write_scene(folder / "scene", [Thing("far", plane(1.0, 1.0, (0.0, 0.0, -500.0)))]))
        place = StaticTrajectory(Pose.from_euler([6.0, 0.0, 0.0], yaw=np.pi))
        self.world: World = stage(scene, [ss.StagedActor("arm", model, place)])
        (rest,) = arm.skinned(self.vertices, 0.0)
        self.origin = 0.5 * (
            rest.min(axis=0) + rest.max(axis=0)
        )  # a model stands on the ground, its box about x = y = 0
        self.origin[1] = rest[:, 1].min()

    def placed(self, points: Array) -> Array:
        """Points in the file's axes at their places in the world."""
        return np.asarray((points - self.origin) @ YAWED.T + [6.0, 0.0, 0.0])

    def found(self, radar: ss.RadarSpec, times: Array, method: str, **fields: object) -> Array:
        """Spectrogram by the simulator [W]."""
        return spectrograms(self.world, radar, Pose(EYE), times, num_doppler_bins=BINS, method=method, **fields)[
            "whole"
        ].power

    def looked(self, radar: ss.RadarSpec, times: Array, looks: int) -> Array:
        """Mean of `raycast` over looks from places within 14 cm, so that rays meet other points [W]."""
        side = int(np.ceil(np.sqrt(looks)))

        def place(time: float) -> Pose:
            row, column = divmod(int(time / arm.PERIOD + 1e-6), side)
            shift = 0.136 / side * (np.array([column, row]) - 0.5 * (side - 1))
            return Pose(EYE + [0.0, *shift])

        knobs = {"method": "raycast", "num_rays": 20_000, "hits_per_cell": None}
        after = np.arange(looks) * arm.PERIOD
        found = spectrograms(self.world, radar, place, times, looks=after, num_doppler_bins=BINS, **knobs)
        return found["whole"].power

    def in_blocks(self, radar: ss.RadarSpec, times: Array, chirps: int) -> Array:
        """The same from raw data whose paths are solved again for blocks of chirps."""
        columns = []
        for time in times.tolist():
            paths_at = ss.retraced(self.world, radar, Pose(EYE), time, method="sbr")
            cube = virtual_cube(ss.synthesize_blocks(paths_at, radar, chirps_per_block=chirps), radar)
            columns.append(range_doppler(cube, radar, num_doppler_bins=BINS).power.astype(np.float64).sum(axis=1))
        return np.array(columns)

    def rough(self, radar: ss.RadarSpec, times: Array) -> Array:
        """Expected spectrogram of the same skin with a random phase at every point, of any scale."""
        wave, window, columns = radar.waveform, window_values("hann", radar.num_chirps), []
        for time in times:
            chirps = time + np.arange(radar.num_chirps) * radar.chirp_interval
            middle = wave.start_frequency + 0.5 * wave.bandwidth
            echo = arm.rough(chirps, self.placed, EYE, middle, 4e-3)
            columns.append((np.abs(_transform((echo * window).T)) ** 2).sum(axis=1))
        return np.array(columns)

    def exact(self, radar: ss.RadarSpec, times: Array) -> Array:
        """Spectrogram of the coherent sum over the skin, each chirp at its own time [W].

        Summed over range by Parseval's theorem.
        """
        wave = radar.waveform
        slope = wave.bandwidth / wave.ramp_time
        frequencies = wave.start_frequency + slope * np.arange(radar.num_samples) * wave.ramp_time / radar.num_samples
        scale = np.sqrt(radar.num_samples * 1e-3 * 10.0 ** (radar.front_end.tx_power_dbm / 10.0)) / (
            4.0 * np.pi
        )  # a = sqrt(P) G lambda / (4 pi) sqrt(sigma / 4 pi) / r2
        taper, window = (window_values("hann", count) for count in (radar.num_samples, radar.num_chirps))
        columns = []
        for time in times:
            chirps = time + np.arange(radar.num_chirps) * radar.chirp_interval
            echo = [scale * arm.coherent(float(t), self.placed, EYE, frequencies, STEP) for t in chirps]
            columns.append((np.abs(_transform(np.array(echo) * window[:, None])) ** 2 * taper**2).sum(axis=1))
        return np.array(columns)


def _transform(chirps: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
    """Doppler transform of rows of chirps, velocities rising: positive where the way grows."""
    return np.roll(np.fft.fftshift(np.fft.fft(chirps, BINS, axis=0), axes=0)[::-1], 1, axis=0)


def radar_of(chirps: int) -> ss.RadarSpec:
    """A radar at 77 GHz that sends a chirp every 250 us: velocities up to 3.9 m/s."""
    return ss.RadarSpec().with_(
        bandwidth=5e7,
        ramp_time=20e-6,
        idle_time=230e-6,
        num_chirps=chirps,
        num_samples=4,
        tx_positions=((0.0, 0.0, 0.0),),
        rx_positions=((0.0, 0.0, 0.0),),
        pattern=IsotropicPattern(),
        azimuth_fov_deg=10.0,
        elevation_fov_deg=14.0,
    )


def alike(one: Array, other: Array) -> float:
    """Normalised correlation of the magnitudes of two spectrograms, over time and velocity."""
    return float(np.sum(np.sqrt(one * other)) / np.sqrt(one.sum() * other.sum()))


def alike_db(one: Array, other: Array, depth_db: float = 50.0) -> float:
    """The same of their decibels above `depth_db` below each one's peak."""
    rows = [np.maximum(10.0 * np.log10(power / power.max()), -depth_db) + depth_db for power in (one, other)]
    return float(np.sum(rows[0] * rows[1]) / np.sqrt(np.sum(rows[0] ** 2) * np.sum(rows[1] ** 2)))


@pytest.fixture(scope="module")
def swing(tmp_path_factory) -> Swing:
    return Swing(tmp_path_factory.mktemp("arm"))


def test_the_skin_is_where_the_closed_form_has_it(swing):
    part = swing.world.parts.name.index("arm_arm")
    for time in (0.0, 0.31, 0.9):
        state = swing.world.at(time)
        corners = state.part_pose(part).apply(state.part_corners(part).reshape(-1, 3))
        (vertices,) = arm.skinned(swing.vertices, time)
        away, nearest = cKDTree(swing.placed(vertices)).query(corners)
        assert away.max() < 1e-6 and len(np.unique(nearest)) == len(vertices)  # vertices and keys are float32


def test_spectrogram_of_physical_optics(swing):
    """Windows of 4 ms, a solve each. Level and shape: over 50 dB, since the flash of a hanging arm is 25 dB higher."""
    radar, times = radar_of(16), np.linspace(0.0, arm.PERIOD, 5, endpoint=False)
    found, exact = swing.found(radar, times, "sbr"), swing.exact(radar, times)
    assert alike(found, exact) > 0.999
    assert alike_db(found, exact) > 0.99
    assert min(alike(*columns) for columns in zip(found, exact, strict=True)) > 0.99
    assert 10.0 * np.log10(found.sum() / exact.sum()) == pytest.approx(0.0, abs=0.1)
    other = np.roll(found, 1, axis=0)  # the comparison can fail: a quarter of a second late
    assert alike(other, exact) < 0.5 and alike_db(other, exact) < 0.95


@pytest.mark.slow
def test_long_windows_need_paths_solved_again(swing):
    """16 ms: a hand that gains 10 m/s2 turns the phase by 4 rad more than its rate has it at the window's start."""
    radar, times = radar_of(64), np.linspace(0.0, arm.PERIOD, 12, endpoint=False)[1:4]
    exact = swing.exact(radar, times)
    assert alike(swing.found(radar, times, "sbr"), exact) < 0.95
    assert alike(swing.in_blocks(radar, times, 16), exact) > 0.99


def test_spectrogram_of_rough_skin(swing):
    """`raycast` has random phases: the mean of looks goes to the sum of the powers of all points of the skin."""
    radar, times = radar_of(16), np.linspace(0.0, arm.PERIOD, 4, endpoint=False)
    exact = swing.rough(radar, times)

    found = [swing.looked(radar, times, looks) for looks in (1, 36)]
    assert alike(found[1], exact) > 0.99
    assert alike(found[0], exact) < 0.96  # one look is speckle
