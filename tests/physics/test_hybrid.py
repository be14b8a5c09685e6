"""Several solvers at once: the sum is that of image theory, and nothing is counted twice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core import units as ss_units
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.compose.hybrid import chains_of
from scarl_sionna.radar.rcs import scattering_matrix
from scarl_sionna.radar.scatterers.model import ScattererModel
from scarl_sionna.scene.materials.table import MaterialTable, builtin_materials
from tests.oracles import multipath as oracle
from tests.oracles import rcs as rcs_oracle
from tests.scenes import Material, Thing, ball, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=120.0)
SMOOTH = builtin_materials()["asphalt"].with_(name="smooth_asphalt", scattering_coefficient=0.0, roughness_rms=0.0)
TABLE = MaterialTable([*builtin_materials().values(), SMOOTH])
MATERIALS = {"asphalt": Material(radio="smooth_asphalt"), "wall": Material(radio="concrete")}
GROUND = Thing("ground", plane(256.0, 256.0), "Roads", "asphalt")
WALL = Thing("wall", plane(64.0, 32.0, (16, 4, 0), (0, -1, 0)), "Wall", "steel")


def isotropic(rcs: float) -> ScattererModel:
    """Return one centre at the origin that scatters alike in all directions, without cross-polarisation."""
    amplitude = np.zeros((1, 2, 1, 2, 2), np.complex64)
    amplitude[..., 0, 0] = amplitude[..., 1, 1] = np.sqrt(rcs / (4 * np.pi))
    half_turn = np.array([0.0, np.pi])
    return ScattererModel(np.zeros((1, 3)), half_turn, np.zeros(1), amplitude, RADAR.center_frequency, 0.0, 0.0, np.pi)


def target(position, velocity=(0.0, 0.0, 0.0)) -> Thing:
    """Return a small ball as an actor whose frame's origin is at a position."""
    trajectory = {"kind": "constant_twist", "position": list(position), "velocity": list(velocity)}
    return Thing("target", ball(0.02, subdivisions=2), "Static", "steel", trajectory)


def scene(folder, things, actors):
    return load_scene(write_scene(folder, things, actors, materials=MATERIALS), TABLE).at(0.0)


def lengths(paths):
    there = np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)
    return there + paths.inner_length + np.linalg.norm(paths.rx_point - paths.world_from_rx.position, axis=1)


def plan(mirrors, rcs=1.0, **options):
    share = Share("scatterers", ("target",), {"models": {"target": isotropic(rcs)}}, through_mirrors=True)
    return ChannelPlan((share,), mirrors, **{"echoes": False, **options})


@pytest.mark.parametrize("polarization", ["V", "H"])
@pytest.mark.parametrize(("ground_range", "height"), [(10.0, 0.5), (30.0, 1.0), (75.0, 1.5)])
def test_two_ray_ground_is_the_closed_form(tmp_path, polarization, ground_range, height) -> None:
    state = scene(tmp_path, [GROUND], [target((ground_range, 0, height))])
    pose = Pose([0.0, 0.0, oracle.RADAR_HEIGHT])
    paths = solve_paths(state, RADAR, pose, "hybrid", plan=plan(("ground",)))
    assert paths.num_paths == 4  # direct, ground there, ground back, ground both ways
    entry = "VH".index(polarization)
    field = paths.a[:, entry, entry] * np.exp(-1j * oracle.WAVENUMBER * lengths(paths))
    # The oracle multiplies the two-way factor of each leg; free space is the path of depth 1.
    ratio_db = 20 * np.log10(abs(field.sum()) / abs(field[paths.depth == 1][0]))
    heights = oracle.GROUND_RANGES.index(ground_range)
    # single-precision amplitudes of the model, 1e-7; the table's asphalt against 3.18 - 0.1j: bar of the project 0.1 dB
    assert ratio_db == pytest.approx(oracle.TWO_RAY_DB[polarization, height][heights], abs=0.1)


def test_wall_and_ground_equal_the_exact_paths_of_a_point(tmp_path) -> None:
    """All nine pairs of ways of a moving target, the radar moving: length, rate, acceleration, level, polarisation."""
    position, velocity, own = (20.0, 1.0, 1.0), (-10.0, 0.5, 0.2), Twist([5.0, 0.0, 0.1])
    things = [GROUND, WALL]
    state = scene(tmp_path / "a", things, [target(position, velocity)])
    empty = scene(tmp_path / "b", things, [])
    # Turned about z only: "without cross-polarisation" then means the same in the axes of the model and of the radar.
    pose = Pose.from_euler([0.0, 0.0, 0.5], yaw=0.1)
    found = solve_paths(state, RADAR, Mount(pose, own), "hybrid", plan=plan(("ground", "wall"), 3.0))
    exact = ss.point_targets(
        [position], [velocity], 3.0, RADAR, Mount(pose, own), state=empty, max_depth=1, num_samples=20_000
    )
    assert found.num_paths == exact.num_paths == 9
    order = [sorted(range(9), key=lambda row, p=paths: p.instance[row].tolist()) for paths in (found, exact)]
    found, exact = found.select(order[0]), exact.select(order[1])
    assert np.array_equal(found.instance, exact.instance) and np.array_equal(found.interaction, exact.interaction)
    assert np.abs(lengths(found) - lengths(exact)).max() < 1e-12  # rounding of 40 m
    assert np.abs(found.length_rate - exact.length_rate).max() < 1e-12
    assert np.abs(found.length_acceleration - exact.length_acceleration).max() < 1e-12
    # single-precision amplitudes of the model; materials at the middle of the band instead of its start: 150 MHz of 77
    # GHz
    assert np.abs(found.a - exact.a).max() < 1e-4 * np.abs(exact.a).max()


def test_ghost_behind_a_wall_stands_where_the_oracle_says(tmp_path) -> None:
    actor = target((30, -1, 0), (-10, 0.5, 0))
    state = scene(tmp_path, [WALL], [actor])
    paths = solve_paths(state, RADAR, Pose(), "hybrid", plan=plan(("wall",)))
    assert sorted(paths.depth) == [1, 2, 2, 3]
    wanted = oracle.WALL_GHOST
    for depth, name in ((1, "direct"), (2, "type1"), (3, "type2")):
        rows = paths.select(paths.depth == depth)
        range_name = "R_direct_m" if depth == 1 else f"apparent_range_{name}_m"
        assert np.abs(lengths(rows) / 2 - wanted[range_name]).max() < 1e-9  # the printed digits; bar 1 mm
        assert np.abs(rows.length_rate / 2 - wanted[f"v_{name}_mps"]).max() < 1e-9  # bar 1e-3 m/s
    level = np.abs(paths.a[:, 0, 0])
    direct = level[paths.depth == 1][0]
    for depth, name in ((2, "amp_type1_each_rel_dB"), (3, "amp_type2_rel_dB")):
        # metal against a perfect conductor: 0.005 dB; bar 0.05 dB
        assert 20 * np.log10(level[paths.depth == depth] / direct) == pytest.approx(wanted[name], abs=0.05)


@pytest.mark.some(1)
@pytest.mark.parametrize("mirror", ["ground", "wall"])
def test_a_corner_over_a_mirror_is_its_bistatic_far_field_from_the_images(tmp_path, mirror) -> None:
    """`sbr` of the mesh through a mirror against `ss.rcs`, another tracer, at the four pairs of directions."""
    leg, distance, height = 0.02, 12.0, 0.5
    vertices, faces = rcs_oracle.TRIHEDRAL_MESH
    corner = trimesh.Trimesh(np.array(vertices) * leg, faces, process=False)
    corner.apply_transform(trimesh.geometry.align_vectors([1, 1, 1], [-1, 0, 0]))
    placed = corner.copy()
    placed.apply_translation([distance, 0.0, height])
    flat = {"ground": plane(128.0, 64.0), "wall": plane(64.0, 32.0, (0, 1.0, 0), (0, -1, 0))}[mirror]
    things = [Thing("mirror", flat, "Wall", "steel", is_object=False), Thing("corner", placed, "Static", "steel")]
    state = scene(tmp_path, things, [])
    pose = Pose([0.0, 0.0, height])
    settings = SbrSettings(floor_db=None)
    shares = (Share("sbr", ("corner",), settings, through_mirrors=True),)
    paths = solve_paths(state, RADAR, pose, "hybrid", plan=ChannelPlan(shares, ("mirror",), echoes=False))
    field = paths.a[:, 0, 0] * np.exp(-2j * np.pi * RADAR.center_frequency / ss_units.SPEED_OF_LIGHT * lengths(paths))
    # V is TM at the ground and, level with the target, TE at the wall.
    image = [0.0, 0.0, -height] if mirror == "ground" else [0.0, 2.0, height]
    index = np.sqrt(state.world.materials["metal"].at(RADAR.center_frequency))
    sine = (2 * height if mirror == "ground" else 2.0) / np.hypot(distance, 2 * height if mirror == "ground" else 2.0)
    sign = (index * sine - 1) / (index * sine + 1) if mirror == "ground" else (sine - index) / (sine + index)
    toward = [np.asarray(point) - [distance, 0.0, height] for point in (pose.position, image)]
    theta = [np.arccos(v[2] / np.linalg.norm(v)) for v in toward]
    phi = [np.arctan2(v[1], v[0]) for v in toward]
    wave = 2 * np.pi * RADAR.center_frequency / ss_units.SPEED_OF_LIGHT
    number = next(key for key, info in state.world.instances.items() if info.name == "mirror")
    last = paths.instance[np.arange(paths.num_paths), paths.depth - 1]
    for there, back in ((0, 0), (0, 1), (1, 0), (1, 1)):
        rows = ((paths.instance[:, 0] == number) == bool(there)) & ((last == number) == bool(back))
        # The way over the mirror first is the reverse of that over it last: physical optics itself keeps reciprocity to
        # 5 % only.
        i, o = min(there, back), max(there, back)
        matrix = scattering_matrix(corner, RADAR.center_frequency, theta[i], phi[i], theta_s=theta[o], phi_s=phi[o])
        far = np.linalg.norm(toward[there]), np.linalg.norm(toward[back])
        expected = matrix[0, 0] * sign ** (there + back) * np.exp(-1j * wave * sum(far)) * RADAR.wavelength
        expected /= 4 * np.pi * far[0] * far[1]
        strongest = (
            RADAR.wavelength * np.sqrt(rcs_oracle.trihedral(leg, RADAR.wavelength) / (4 * np.pi)) / (4 * np.pi * 144.0)
        )
        # Curvature over the corner: k D^2 / (4 R) = 0.03 rad with D = 3.2 cm.
        assert abs(field[rows].sum() - expected) < 0.03 * strongest, (there, back)


def test_a_screen_hides_what_is_behind_it_and_not_the_ghost(tmp_path) -> None:
    screen = Thing("screen", plane(1.0, 1.0, (15, -0.5, 0), (-1, 0, 0)), "Wall", "steel")
    actor = target((30, -1, 0))
    state = scene(tmp_path, [WALL, screen], [actor])
    paths = solve_paths(state, RADAR, Pose(), "hybrid", plan=plan(("wall",)))
    assert paths.depth.tolist() == [3]  # there and back over the wall
    in_the_way = Thing("screen", plane(1.0, 1.0, (10, 3.0, 0), (-1, 0, 0)), "Wall", "steel")
    state = scene(tmp_path / "b", [WALL, in_the_way], [actor])
    assert solve_paths(state, RADAR, Pose(), "hybrid", plan=plan(("wall",))).depth.tolist() == [1]


def test_a_wall_that_ends_before_the_reflection_point_gives_no_ghost(tmp_path) -> None:
    short = Thing("wall", plane(8.0, 8.0, (5, 4, 0), (0, -1, 0)), "Wall", "steel")  # the point is at x = 13.3 m
    state = scene(tmp_path, [short], [target((30, -1, 0))])
    assert solve_paths(state, RADAR, Pose(), "hybrid", plan=plan(("wall",))).depth.tolist() == [1]


def test_echoes_and_clutter_join_without_a_chain_in_common(tmp_path) -> None:
    back = Thing("back", plane(32.0, 32.0, (40, 0, 0), (-1, 0, 0)), "Wall", "wall")
    hut = Thing("hut", ball(1.0, (15, -6, 1)), "Building", "wall")
    state = scene(tmp_path, [GROUND, back, hut], [target((20, 1, 1.0))])
    full = ChannelPlan(
        (
            Share("raycast", settings={"num_rays": 20_000}),
            Share("scatterers", ("target",), {"models": {"target": isotropic(1.0)}}, through_mirrors=True),
        ),
        mirrors=("ground", "back"),
        sionna={"num_samples": 20_000},
    )
    pose = Pose([0.0, 0.0, 0.5])
    paths = solve_paths(state, RADAR, pose, "hybrid", plan=full)
    rows = paths.diagnostics["solvers"]
    assert [(row["solver"], row["mechanism"]) for row in rows] == [
        ("scatterers", "objects"),
        ("raycast", "objects"),
        ("sionna", "mirror chains"),
        ("scatterers", "objects through mirrors"),
    ]
    assert sum(row["num_paths"] for row in rows) == paths.num_paths and all(row["num_paths"] for row in rows)
    stop = np.cumsum([row["num_paths"] for row in rows])
    chains = [chains_of(paths.select(slice(end - row["num_paths"], end))) for end, row in zip(stop, rows, strict=True)]
    for index, one in enumerate(chains):
        assert one and not any(one & other for other in chains[:index])
    # Coherent and rough part of a mirror are two chains of it: mirrored (1) and scattered (2); the target is in one
    # share.
    number = {info.name: key for key, info in state.world.instances.items()}
    assert (number["back"], 1) in chains[2] and (number["back"], 2) in chains[1]
    assert all(number["target"] not in chain[::2] for chain in chains[1] | chains[2])
    # Each solver's own result is what the hybrid took over.
    alone = solve_paths(state, RADAR, pose, "raycast", num_rays=20_000)
    kept = alone.instance[:, 0] != number["target"]
    assert paths.a[stop[0] : stop[1]].tobytes() == alone.select(kept).a.tobytes()


@pytest.mark.slow
def test_the_same_input_gives_the_same_bytes(tmp_path) -> None:
    state = scene(tmp_path, [GROUND, WALL], [target((20, 1, 1.0))])
    both = [
        solve_paths(state, RADAR, Pose([0, 0, 0.5]), "hybrid", plan=plan(("ground", "wall"), echoes=True))
        for _ in range(2)
    ]
    for name, value in vars(both[0]).items():
        if isinstance(value, np.ndarray):
            assert value.tobytes() == getattr(both[1], name).tobytes(), name


def test_only_mirrors_are_in_the_mirror_chains(tmp_path) -> None:
    """A plate that faces the radar is no mirror of the plan.

    Its own reflection belongs to its owner, not to the chains.
    """
    back = Thing("back", plane(64.0, 64.0, (40, 0, 0), (-1, 0, 0)), "Wall", "steel")
    plate = Thing("plate", plane(4.0, 4.0, (20, 0, 0), (-1, 0, 0)), "Static", "steel")
    state = scene(tmp_path, [back, plate], [])
    number = {info.name: key for key, info in state.world.instances.items()}

    def chains(mirrors, pose):
        given = ChannelPlan((Share("raycast", settings={"num_rays": 5_000}),), mirrors, sionna={"num_samples": 20_000})
        found = solve_paths(state, RADAR, pose, "hybrid", plan=given)
        row = next(row for row in found.diagnostics["solvers"] if row["solver"] == "sionna")
        specular = found.select((found.interaction == 1).any(axis=1))
        assert specular.num_paths == row["num_paths"]
        return {tuple(path[path >= 0].tolist()) for path in specular.instance}, row["num_foreign_chains"]

    # In front of the plate all that comes straight back is the plate's; beside it, the wall's.
    assert chains(("plate",), Pose()) == ({(number["plate"],)}, 0)
    assert chains(("back",), Pose()) == (set(), 1)
    assert chains(("back",), Pose([0.0, 3.0, 0.0])) == ({(number["back"],)}, 0)
