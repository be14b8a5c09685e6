"""Where physical optics on a scene breaks or must refuse.

Small motion, far targets, options, size, grazing, determinism.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import warnings

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, PlacementError, ScarlWarning, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.sbr import DEFAULT_SBR, SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.optics.patches import PatchSize, split
from tests.oracles import rcs as oracle
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=60.0)
ALL = SbrSettings(floor_db=None)


def _signal(paths) -> complex:
    center = paths.world_from_tx.position
    length = sum(np.linalg.norm(point - center, axis=1) for point in (paths.tx_point, paths.rx_point))
    return complex(np.sum(paths.a[:, 0, 0] * np.exp(-2j * np.pi * RADAR.center_frequency / SPEED_OF_LIGHT * length)))


def _digest(paths) -> str:
    names = ("tx_point", "rx_point", "inner_length", "a", "length_rate", "instance", "interaction", "depth", "semantic")
    return hashlib.sha256(b"".join(np.ascontiguousarray(getattr(paths, name)).tobytes() for name in names)).hexdigest()


def _corner() -> trimesh.Trimesh:
    vertices, faces = oracle.TRIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.3, faces, process=False)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.75 * np.pi, (0, 0, 1)))
    return mesh


@pytest.mark.some(1)
@pytest.mark.parametrize("moving", ["target", "radar"])
@pytest.mark.parametrize("shape", ["corner", "box", "ball"])
def test_small_motion_makes_no_doppler_floor(tmp_path, shape, moving) -> None:
    """Chirps traced one by one in steps of a 20th of a wavelength at 100 m.

    a line in Doppler, and no floor above -60 dB.
    """
    meshes = {"corner": _corner(), "box": box((1, 1.8, 1.4)), "ball": trimesh.creation.icosphere(3, 0.5)}
    trajectory = {"kind": "constant_twist", "position": [100.0, 0, 0], "velocity": [1.0, 0, 0]}
    world = load_scene(write_scene(tmp_path, actors=[Thing("target", meshes[shape], "Static", "steel", trajectory)]))
    step, count = RADAR.wavelength / 20, 48
    chirps, lengths = [], []
    for index in range(count):
        moved = index * step
        state, x = (world.at(moved), 0.0) if moving == "target" else (world.at(0.0), -moved)
        chirps.append(_signal(solve_paths(state, RADAR, Pose([x, 0, 0.05]), method="sbr", settings=ALL)))
        lengths.append(100.0 + moved)
    expected = np.exp(-4j * np.pi * RADAR.center_frequency / SPEED_OF_LIGHT * np.array(lengths))
    still = np.array(chirps) * expected.conj()
    # The line of sight turns by less than 1e-6 rad and 1/R^2 changes by 1e-4 over 12.5 mm: a phase and level that drift
    # slowly, so the 60 dB of the bar are asked beyond 10 bins, where the window is below -110 dB.
    assert np.ptp(np.unwrap(np.angle(still))) < 0.1
    spectrum = np.abs(np.fft.fft(still * np.blackman(count) ** 2))
    bins = np.abs((np.arange(count) + count // 2) % count - count // 2)
    assert 20 * np.log10(spectrum[bins > 10].max() / spectrum[0]) < -60.0


@pytest.mark.slow  # of all methods: test_determinism.py
def test_same_bytes_twice_and_in_another_process(tmp_path) -> None:
    path = write_scene(
        tmp_path, [Thing("corner", _corner(), "Static", "steel"), Thing("box", box((1, 1, 1), (2, 1, 0)))]
    )
    pose = Pose([-20.0, 0, 0.05])
    first, second = (_digest(solve_paths(load_scene(path).at(0.0), RADAR, pose, method="sbr")) for _ in range(2))
    code = (
        "from tests.stability.test_sbr_channel import _digest, solve_paths, load_scene, RADAR, Pose\n"
        f"print(_digest(solve_paths(load_scene({str(path)!r}).at(0.0), RADAR, Pose([-20.0, 0, 0.05]), method='sbr')))"
    )
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()[-1]
    assert first == second == other


def test_far_corner_keeps_its_level(tmp_path) -> None:
    """300 m away and 300 m from the world's origin: what float32 distances would turn into noise."""
    vertices, faces = oracle.TRIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.1, faces, process=False)
    far = float(ss.rcs(mesh, RADAR.center_frequency, np.arccos(1 / 3**0.5), np.pi / 4))
    corner = np.array([212.0, 212.0, 0.0])
    mesh.apply_translation(corner)
    state = load_scene(write_scene(tmp_path, [Thing("corner", mesh, "Static", "steel")])).at(0.0)
    pose = Pose.from_euler(corner + 300.0 / 3**0.5, yaw=1.25 * np.pi, pitch=np.arcsin(1 / 3**0.5))
    paths = solve_paths(state, RADAR, pose, method="sbr", settings=ALL, max_distance=400.0)
    wavelength = SPEED_OF_LIGHT / RADAR.center_frequency
    found = np.abs(_signal(paths)) ** 2 * (4 * np.pi) ** 3 * 300.0**4 / wavelength**2
    # Vertices in float32 are up to 8e-6 m off at 212 m: 0.026 rad each, some 0.02 dB and a tilt of 1e-4 rad between
    # plates of 0.1 m; metal loses 0.013 dB in three bounces.
    assert 10 * np.log10(found / far) == pytest.approx(0.0, abs=0.1)


def test_a_wall_hides_and_half_a_wall_hides_half(tmp_path) -> None:
    plate = Thing("plate", plane(1.0, 1.0, (10, 0, 0), (-1, 0, 0)), "Static", "steel")
    areas = {}
    for name, centre in (("whole", (5, 0, 0)), ("half", (5, 1.0, 0)), ("none", (5, 9.0, 0))):
        wall = Thing("wall", plane(4.0 if name == "whole" else 2.0, 4.0, (0, 0, 0), (0, 0, 1)), "Wall", "steel")
        wall.mesh.vertices = wall.mesh.vertices[:, [2, 0, 1]] + centre
        state = load_scene(write_scene(tmp_path / name, [plate, wall])).at(0.0)
        paths = solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_depth=1), instances=["plate"])
        areas[name] = np.abs(paths.a[:, 0, 0]).sum() if paths.num_paths else 0.0
    assert areas["whole"] == 0.0
    # Without interference (the sum of moduli) light is proportional to the area up to the phase within the patches,
    # which the edge's cuts change by the share of the patches along it: some 5 % of half the plate.
    assert areas["half"] == pytest.approx(areas["none"] / 2, rel=0.1)


def test_options_outside_of_their_range_are_refused(tmp_path) -> None:
    state = load_scene(write_scene(tmp_path, [Thing("box", box((2, 2, 2), (10, 0, 0)), "Static", "steel")])).at(0.0)
    with pytest.raises(UnknownNameError, match="instance 'car'.*box"):
        solve_paths(state, RADAR, Pose(), method="sbr", instances=["car"])
    with pytest.raises(UnknownNameError, match="setting of method 'sbr' 'rx_twist'"):
        solve_paths(state, RADAR, Pose(), method="sbr", rx_twist=Twist(np.ones(3)))
    with pytest.raises(ParameterRangeError, match="max_patches"):
        solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_patches=10))
    with pytest.raises(ParameterRangeError, match="max_distance"):
        solve_paths(state, RADAR, Pose(), method="sbr", max_distance=0.0)
    with pytest.raises(PlacementError, match="box"):
        solve_paths(state, RADAR, Pose([10, 0, 0]), method="sbr")


def test_nothing_in_view_gives_no_paths_and_ground_is_named_as_left_out(tmp_path) -> None:
    things = [
        Thing("box", box((2, 2, 2), (-10, 0, 0)), "Static", "steel"),
        Thing("ground", plane(100, 100, (0, 0, -2)), "Roads", is_object=False),
    ]
    paths = solve_paths(load_scene(write_scene(tmp_path, things)).at(0.0), RADAR, Pose(), method="sbr")
    assert paths.num_paths == 0 and paths.a.shape == (0, 2, 2)
    assert paths.diagnostics["left_out"] == ["ground"]


def test_warnings_outside_of_validity(tmp_path) -> None:
    small = load_scene(
        write_scene(tmp_path / "a", [Thing("bolt", box((0.008,) * 3, (3, 0, 0)), "Static", "steel")])
    ).at(0.0)
    with pytest.warns(ScarlWarning, match="smaller than 3 wavelengths, such as 'bolt'"):
        solve_paths(small, RADAR, Pose(), method="sbr", settings=ALL)
    grazed = load_scene(
        write_scene(tmp_path / "b", [Thing("floor", plane(2, 2, (10, 0, -0.5)), "Static", "steel")])
    ).at(0.0)
    with pytest.warns(ScarlWarning, match="grazing"):
        solve_paths(grazed, RADAR, Pose(), method="sbr", settings=ALL)
    fine = load_scene(
        write_scene(tmp_path / "c", [Thing("sign", plane(1, 1, (10, 0, 0), (-1, 0, 0)), "Static", "steel")])
    ).at(0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solve_paths(fine, RADAR, Pose(), method="sbr", settings=ALL)


def test_what_the_floor_drops_is_below_it_even_in_phase(tmp_path) -> None:
    state = load_scene(write_scene(tmp_path, [Thing("ball", trimesh.creation.icosphere(3, 0.5), "Static", "grey")])).at(
        0.0
    )
    pose = Pose([-60.0, 0, 0])
    every = solve_paths(state, RADAR, pose, method="sbr", settings=ALL)
    kept = solve_paths(state, RADAR, pose, method="sbr", settings=ALL.with_(floor_db=20.0))
    reported = kept.diagnostics["floor"]
    assert 0 < reported["num_dropped"] == every.num_paths - kept.num_paths
    assert reported["in_phase_to_noise_db"] <= 20.0
    assert np.isin(np.abs(kept.a[:, 0, 0]), np.abs(every.a[:, 0, 0])).all()


def test_slivers_are_cut_into_few_pieces_that_cover_them() -> None:
    corners = np.array([[[10, 0, 0], [10, 0, 2.0], [10, 1e-3, 2.0]], [[9, 0, 0], [9, 3, 0], [9, 0, 3.0]]])
    size = PatchSize.of(RADAR, DEFAULT_SBR)
    pieces, rows = split(corners, np.zeros((2, 3)), np.zeros(3), size, 10**6)
    assert size.excess(pieces, np.zeros((2, 3)), rows, np.zeros(3)).max() <= 1.0

    def area(triangles):
        sides = triangles[:, 1:] - triangles[:, :1]
        return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2

    # Sums of hundreds of areas in float64.
    assert np.bincount(rows, area(pieces)) == pytest.approx(area(corners), rel=1e-12)
    needed = 2.0 / size.length(np.array([10.0]))[0]
    assert np.count_nonzero(rows == 0) < 4 * needed


def test_many_tubes_are_about_as_many_as_asked_and_change_nothing(tmp_path) -> None:
    vertices, faces = oracle.TRIHEDRAL_MESH
    mesh = trimesh.Trimesh(np.array(vertices) * 0.2, faces, process=False)
    state = load_scene(write_scene(tmp_path, [Thing("corner", mesh, "Static", "steel")])).at(0.0)
    pose = Pose.from_euler(np.full(3, 50.0 / 3**0.5), yaw=1.25 * np.pi, pitch=np.arcsin(1 / 3**0.5))
    few = solve_paths(state, RADAR, pose, method="sbr", settings=ALL)
    many = solve_paths(state, RADAR, pose, method="sbr", settings=ALL.with_(num_tubes=20_000))
    # The number is reckoned from areas and sides, right within 1.5 over triangles of all shapes; here all three are
    # alike.
    assert 10_000 < many.diagnostics["num_tubes"][1] < 40_000
    assert few.diagnostics["num_tubes"][1] < 1000
    # What differs is the error of the coarser run: its parts depart from a linear phase by integration_phase at most.
    assert abs(_signal(many) / _signal(few)) == pytest.approx(1.0, abs=2 * DEFAULT_SBR.integration_phase)
    with pytest.raises(ParameterRangeError, match="max_patches"):
        solve_paths(state, RADAR, pose, method="sbr", settings=ALL.with_(num_tubes=10_000, max_patches=1000))


def test_parts_far_smaller_than_the_tubes_are_found(tmp_path) -> None:
    """Tubes start on the faces themselves: a bolt of 1 cm on a wall 60 m away is among the paths, wherever it is."""
    bolt = Thing("bolt", box((0.01, 0.012, 0.014), (60.0, 0.7312, 0.413)), "Static", "steel")
    wall = Thing("wall", plane(4, 3, (60.5, 0, 0), (-1, 0, 0)), "Wall", "steel")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)  # smaller than 3 wavelengths
        paths = solve_paths(
            load_scene(write_scene(tmp_path, [bolt, wall])).at(0.0), RADAR, Pose(), method="sbr", settings=ALL
        )
    direct = paths.select((paths.instance[:, 0] == 1) & (paths.depth == 1))
    area = np.abs(direct.a[:, 0, 0]).sum() * 4 * np.pi * 60.0**2
    # Its front is 1.2 by 1.4 cm, 3 wavelengths: seen 0.7 deg off its normal, the phase over it takes below 1 % of the
    # area.
    assert area == pytest.approx(0.012 * 0.014, rel=0.03)


def test_mirrors_that_send_everything_away_give_no_second_bounce(tmp_path) -> None:
    """The last bounce looks only for faces that are turned to the radar; a floor behind a tilted plate is not."""
    plate = Thing("plate", plane(0.5, 0.5, (10, 0, 0), (-1, 0, 1)), "Static", "steel")
    ceiling = Thing("ceiling", plane(8, 8, (10, 0, 2), (0.3, 0, -1)), "Static", "steel")
    state = load_scene(write_scene(tmp_path, [plate, ceiling])).at(0.0)
    paths = solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_depth=2))
    deeper = solve_paths(state, RADAR, Pose(), method="sbr", settings=ALL.with_(max_depth=3))
    assert not np.any((paths.depth == 2) & (paths.instance[:, 0] == 1))
    assert np.array_equal(paths.a, deeper.select(deeper.depth <= 2).a)
