"""Where mirror multipath breaks.

Float32 far away, small motion, near field, order of paths, full buffers, small mirrors.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sionna import SionnaSettings
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine import variant
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths.tracing import trace_paths
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.channel import PathBufferOverflowError, solve_paths
from scarl_sionna.radar.channel.multipath.legs import legs_of
from scarl_sionna.radar.channel.multipath.station import EndPoints, Station
from scarl_sionna.radar.point_scatterers import PointScatterers
from scarl_sionna.radar.points import solve_points
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.oracles import multipath as oracle
from tests.scenes import Thing, ball, box, plane, write_scene

RADAR = RadarSpec().with_(pattern=IsotropicPattern(), bandwidth=150e6)
FEW = {"num_samples": 20_000}
REPO = Path(__file__).resolve().parents[2]


def lengths(paths, radar=RADAR) -> np.ndarray:
    return PathGeometry.of(paths, radar).center_length()


@pytest.fixture(autouse=True, scope="module")
def radio_variant():
    """Stay in one variant: each switch takes longer than a solve."""
    with variant.radio():
        yield


def oblique_wall(y: float) -> Thing:
    """A wall in the plane 3 x + 4 y = const, through coordinates that float32 holds exactly."""
    mesh = plane(1.0, 1.0)
    corners = [(-128, 96 + y, -64), (384, -288 + y, -64), (384, -288 + y, 64), (-128, 96 + y, 64)]
    mesh.vertices = np.array(corners, dtype=np.float64)
    return Thing("wall", mesh, "Wall", "steel")


def street(folder):
    """Ground, a wall beside it, and a box."""
    things = [
        Thing("ground", plane(256.0, 256.0), "Roads", "steel"),
        Thing("wall", plane(32.0, 256.0, (64, 5, 8), (0, -1, 0)), "Wall", "steel"),
        Thing("hut", box((4, 4, 4), (40, -8, 2)), "Building", "steel"),
    ]
    return load_scene(write_scene(folder, things)).at(0.0)


def test_path_length_at_200_m_is_exact(tmp_path) -> None:
    state = load_scene(write_scene(tmp_path, [oblique_wall(250.0)])).at(0.0)
    normal, offset = np.array([0.6, 0.8, 0.0]), 0.8 * 250.0  # 0.6 x + 0.8 y = 200
    start, target = np.array([0.123, -0.456, 0.789]), np.array([30.321, 1.654, -2.987])
    points = PointScatterers([target], np.zeros((1, 3)), 1.0)
    paths = solve_points(state, RADAR, Pose(start), points, environment=True, max_distance=500.0, **FEW)
    echo = 2.0 * (offset - normal @ start)
    there = [np.linalg.norm(target - start), np.linalg.norm(oracle.mirrored(target, normal, offset) - start)]
    expected = [echo, 2 * there[0], sum(there), sum(there), 2 * there[1]]
    assert min(echo, there[1]) > 380.0
    # Bar: 1e-6 m. Rounding: 800 m * 2.2e-16 and a few operations; the engine's own float32 is 2e-5 m off.
    assert np.abs(lengths(paths) - expected).max() < 1e-11


def test_small_motion_turns_the_phase_and_no_path_flickers(tmp_path) -> None:
    """The radar moves in steps of a twentieth wavelength.

    Its echo crosses the edge between the wall's two triangles.
    """
    state = street(tmp_path)
    target = np.array([30.0, -1.0, 1.5])
    points = PointScatterers([target], np.zeros((1, 3)), 1.0)
    diagonal = np.array([64.0, 1.0, 8.0])  # the wall's centre, where its diagonal passes, seen at right angles
    step = RADAR.wavelength / 20.0
    solves = [
        solve_points(state, RADAR, Pose(diagonal + [step * (k - 12.5), 0, 0]), points, environment=True, **FEW)
        for k in range(26)
    ]
    first = solves[0]
    assert first.num_paths >= 10
    for paths in solves:
        assert np.array_equal(paths.instance, first.instance) and np.array_equal(paths.interaction, first.interaction)
    turned = np.diff([lengths(paths) for paths in solves], axis=0)
    # Straight motion: no step is longer than two steps of the radar, and from step to step the change grows by at most
    # 2 * 2 step^2 / R with R > 1 m: 2e-7 m. A jump to another plane would be larger than 1e-3 m.
    assert np.abs(turned).max() < 2.0 * step * (1 + 1e-9)
    assert np.abs(np.diff(turned, axis=0)).max() < 4.0 * step**2
    amplitude = np.array([paths.a for paths in solves])
    assert np.abs(np.diff(amplitude, axis=0)).max() < 1e-2 * np.abs(amplitude).max()


@pytest.mark.slow
def test_near_field_of_every_antenna(tmp_path) -> None:
    """One solve from the centre of a 1 m array against one solve for each pair of antennas, walls 5 m away."""
    wall = Thing("wall", plane(32.0, 64.0, (5, 0, 0), (-1, 0, 0)), "Wall", "steel")
    state = load_scene(write_scene(tmp_path, [wall, Thing("side", oblique_wall(6.25).mesh, "Wall", "steel")])).at(0.0)
    tx, rx = ((0, -0.5, 0), (0, 0.5, 0.25)), ((0, 0.5, 0), (0.1, 0.05, -0.5))
    radar = RADAR.with_(tx_positions=tx, rx_positions=rx)
    points = PointScatterers([[3.0, 2.0, 0.5]], np.zeros((1, 3)), 1.0)
    few = {**FEW, "max_depth": 1}
    geometry = PathGeometry.of(solve_points(state, radar, Pose(), points, environment=True, **few), radar)
    single = RADAR.with_(tx_positions=((0, 0, 0),), rx_positions=((0, 0, 0),))
    for i, transmitter in enumerate(tx):
        for j, receiver in enumerate(rx):
            alone = solve_points(
                state, single, Pose(transmitter), points, receiver=Pose(receiver), environment=True, **few
            )
            direct = alone.depth == 0  # between two antennas there is a line of sight, from one to itself there is none
            expected = lengths(alone.select(~direct), single)
            assert direct.sum() == 1 and len(expected) == 2 + 3 * 3
            phase = oracle.WAVENUMBER * np.abs(geometry.length(i, j) - expected)
            assert phase.max() < 1e-9  # bar 1e-3 rad: image points are the same ones, only rounding is left


def test_amplitudes_agree_with_the_engine(tmp_path) -> None:
    """Spreading, Jones matrices and materials against Sionna RT's own float32 field."""
    things = [
        Thing("ground", plane(256.0, 256.0), "Roads", "steel"),
        Thing("wall", oblique_wall(15.0).mesh, "Wall", "grey"),
    ]
    table = builtin_materials()
    flat = table["concrete"].with_(roughness_rms=0.0)  # the engine knows no heights
    state = load_scene(write_scene(tmp_path, things), MaterialTable([*table.values(), flat])).at(0.0)
    start, target = np.array([0.0, 0.0, 1.0]), np.array([12.0, -1.0, 2.5])
    settings = SionnaSettings(max_depth=3, num_samples=50_000, max_num_paths=10_000)
    traced = trace_paths(state, start, [target], settings)
    ends = EndPoints(target[None], np.zeros((1, 3)), np.eye(3))
    legs = legs_of(state, traced, Station(start, np.zeros(3), np.eye(3)), ends, 77e9)
    assert len(legs.length) == len(traced.target) >= 4
    ours = legs.transfer * (RADAR.wavelength / (4 * np.pi * legs.length))[:, None, None]
    scale = np.abs(traced.a).max(axis=(1, 2))
    # Float32: 1e-7 of each of some tens of operations, and angles from float32 vertices; concrete is 10 cm thick there
    # and a half space here: 60 dB of loss in it, 1e-6.
    assert (np.abs(ours - traced.a).max(axis=(1, 2)) / scale).max() < 2e-4


def _digest(folder: str) -> str:
    state = street(Path(folder))
    points = PointScatterers([[30, -1, 1.5], [20, 2, 0.5]], np.zeros((2, 3)), 1.0)
    digest = hashlib.sha256()
    for options in ({}, {"diffuse": True}):
        paths = solve_points(state, RADAR, Pose([0, 0, 0.5]), points, environment=True, **FEW, **options)
        for value in vars(paths).values():
            if isinstance(value, np.ndarray):
                digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


@pytest.mark.slow  # of all methods: test_determinism.py
def test_same_bytes_twice_and_in_two_processes(tmp_path) -> None:
    here = _digest(str(tmp_path / "a"))
    assert here == _digest(str(tmp_path / "b"))
    code = f"from tests.stability.test_multipath import _digest; print(_digest({str(tmp_path / 'c')!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=REPO, check=True)
    assert done.stdout.split()[-1] == here


def test_a_full_buffer_is_reported(tmp_path) -> None:
    state = street(tmp_path)
    with pytest.raises(PathBufferOverflowError, match="max_num_paths = 1 candidates.*raise max_num_paths"):
        solve_paths(state, RADAR, Pose([0, 0, 0.5]), "sionna", max_num_paths=1, **FEW)
    with pytest.warns(ScarlWarning, match="max_num_paths = 1 candidates"):
        paths = solve_paths(state, RADAR, Pose([0, 0, 0.5]), "sionna", max_num_paths=1, on_overflow="warn", **FEW)
    assert paths.diagnostics["overflow"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = solve_paths(state, RADAR, Pose([0, 0, 0.5]), "sionna", **FEW)
    assert not whole.diagnostics["overflow"] and whole.num_paths > paths.num_paths
    assert 1 < whole.diagnostics["num_candidates"] < 1000


def test_small_and_curved_mirrors_are_warned_of(tmp_path) -> None:
    # A 10 cm plate at 10 m: the zone is 2 sqrt(lambda 5 m) = 0.28 m across; its mirror echo is 6 dB too strong.
    plate = Thing("plate", plane(0.1, 0.1, (10, 0, 0), (-1, 0, 0)), "Static", "steel")
    state = load_scene(write_scene(tmp_path / "plate", [plate])).at(0.0)
    with pytest.warns(
        ScarlWarning, match=r"'plate': a flat face of 0\.1 m where the zone is 0\.28 m.*method='sbr'"
    ) as caught:
        paths = solve_paths(state, RADAR, Pose(), "sionna", max_depth=1)
    assert paths.num_paths == 1 and len(caught) == 1 and paths.diagnostics["num_small_mirrors"] == 1
    # A ball of flat faces of 0.15 m, seen at 8 m: a face whose normal points at the radar is a mirror of the wrong
    # size.
    sphere = Thing("sphere", ball(1.0, (4, 0, 0), subdivisions=3), "Static", "steel")
    state = load_scene(write_scene(tmp_path / "ball", [sphere])).at(0.0)
    normal = state._triangles.normal[0]
    facing = Pose(state._triangles.corners[0].mean(axis=0) + 8.0 * normal)
    with pytest.warns(ScarlWarning, match="'sphere'.*curvature"):
        solve_paths(state, RADAR, facing, "sionna", max_depth=1)


def test_coincident_surfaces_reflect_once(tmp_path) -> None:
    """A road marking in the plane of the road, and one 4 mm above it."""
    for name, height in (("flush", 0.0), ("above", 2.0**-8)):
        things = [
            Thing("ground", plane(64.0, 64.0), "Roads", "steel"),
            Thing("marking", plane(4.0, 4.0, (5, 0, height)), "RoadLine", "steel"),
        ]
        state = load_scene(write_scene(tmp_path / name, things)).at(0.0)
        points = PointScatterers([[10, 0, 0.5]], np.zeros((1, 3)), 1.0)
        paths = solve_points(state, RADAR, Pose([0, 0, 0.5]), points, **FEW)
        assert paths.depth.tolist() == [1, 2, 2, 3]
        assert abs(lengths(paths)[3] / 2 - np.hypot(10, 1 - 2 * height)) < 1e-9
