"""Thin layers let waves through: what is behind a sheet comes back with the layer's transmission, twice."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from benchmarks.corner_range import corner
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.radar.optics.faces.panes import pane_parts
from scarl_sionna.scene.materials.fresnel import transmission
from scarl_sionna.scene.materials.table import builtin_materials
from scarl_sionna.scene.motion.trajectory import WaypointTrajectory
from tests.kernels import kernels
from tests.scenes import Material, Thing, box, plane, write_scene

RADAR = ss.RadarSpec(elevation_fov_deg=120.0)
SETTINGS = SbrSettings(floor_db=None)
MATERIALS = {
    "sheet": Material(radio="plastic"),
    "glass": Material(radio="car_glass"),
    "cloth": Material(radio="clothing"),
}
PLATE = Thing("target", plane(0.1, 0.1, (10, 0, 0), (-1, 0, 0)), "Static", "steel")
TABLE_ERROR = 1e-3
"""Relative: linear interpolation of the coefficients, and the plate's width of 0.6 deg over which the angle changes."""


def tilted(distance: float, angle_deg: float, material: str = "sheet", name: str = "pane") -> Thing:
    angle = np.radians(angle_deg)
    return Thing(name, plane(2.0, 2.0, (distance, 0, 0), (-np.cos(angle), np.sin(angle), 0)), "Static", material)


def solved(folder, things, receiver=None, pose=None, **knobs):
    """Return the paths over the target."""
    world = ss.load_scene(write_scene(folder, things, materials=MATERIALS))
    settings = SETTINGS.with_(**knobs)
    where = pose or ss.Pose()
    paths = ss.solve_paths(
        world.at(0.0), RADAR, where, method="sbr", settings=settings, instances=["target"], receiver=receiver
    )
    return world, paths


def signal(paths):
    """Return the coherent sum, shape (2, 2)."""
    length = np.linalg.norm(paths.tx_point - paths.world_from_tx.position, axis=1)
    length = length + np.linalg.norm(paths.rx_point - paths.world_from_rx.position, axis=1)
    return np.einsum("nij,n->ij", paths.a, np.exp(-2j * np.pi / RADAR.wavelength * length))


@pytest.mark.parametrize("material", ["sheet", "glass", "cloth"])
@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 50.0])
def test_a_plate_behind_a_sheet(tmp_path, material, angle_deg) -> None:
    """VV is TE and HH is TM for a sheet that is turned about the vertical: T^2 each, amplitude and phase.

    Both ways lose what the sheet scatters, 1 - S^2 of the power: 0.8 dB for clothing.
    """
    free = signal(solved(tmp_path / "free", [PLATE])[1])
    world, paths = solved(tmp_path / "behind", [PLATE, tilted(5.0, angle_deg, material)])
    layer = world.materials[MATERIALS[material].radio]
    te, tm = transmission(layer, RADAR.center_frequency, np.cos(np.radians(angle_deg)))
    ratio = signal(paths) / free
    coherent = 1.0 - layer.scattering_coefficient**2
    assert abs(ratio[0, 0] - coherent * te**2) < TABLE_ERROR
    assert abs(ratio[1, 1] - coherent * tm**2) < TABLE_ERROR


def test_what_scatters_most_of_what_passes_is_no_pane(tmp_path) -> None:
    """A leaf takes 13 dB there and back by reflection and loss, and 14 dB by what it scatters."""
    material = Material(radio="foliage")
    world = ss.load_scene(write_scene(tmp_path, [tilted(5.0, 0.0, "leaf")], materials={"leaf": material}))
    found = [pane_parts(world.at(0.0), RADAR.center_frequency, loss).tolist() for loss in (20.0, 27.0, 28.5)]
    assert found == [[], [], [0]]


def test_3_mm_of_plastic_cost_1_4_db(tmp_path) -> None:
    """The figure of the issue; without panes nothing is left of it."""
    free = signal(solved(tmp_path / "free", [PLATE])[1])[0, 0]
    behind = signal(solved(tmp_path / "behind", [PLATE, tilted(5.0, 0.0)])[1])[0, 0]
    assert 20.0 * np.log10(abs(behind / free)) == pytest.approx(-1.36, abs=0.02)
    assert solved(tmp_path / "shut", [PLATE, tilted(5.0, 0.0)], pane_loss_db=None)[1].num_paths == 0


def test_two_sheets_and_one_that_is_drawn_twice(tmp_path) -> None:
    free = signal(solved(tmp_path / "free", [PLATE])[1])[0, 0]
    once = signal(solved(tmp_path / "one", [PLATE, tilted(5.0, 0.0)])[1])[0, 0] / free
    other = tilted(6.0, 0.0, name="other")
    twice = signal(solved(tmp_path / "two", [PLATE, tilted(5.0, 0.0), other])[1])[0, 0] / free
    assert abs(twice - once**2) < TABLE_ERROR
    mesh = tilted(5.0, 0.0).mesh
    doubled = trimesh.Trimesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]), process=False)
    drawn = signal(solved(tmp_path / "drawn", [PLATE, Thing("pane", doubled, "Static", "sheet")])[1])[0, 0] / free
    assert abs(drawn - once) < TABLE_ERROR


def test_one_kernel_for_any_number_of_sheets(tmp_path) -> None:
    """A kernel of fields takes a second to compile; nothing new is compiled for the second sheet."""
    sheets = [tilted(5.0, 0.0), tilted(6.0, 0.0, name="other")]
    with kernels() as found:
        solved(tmp_path / "one", [PLATE, *sheets[:1]])
        known = found(least=1000)
        solved(tmp_path / "two", [PLATE, *sheets])
        assert found(least=1000) == known != set()


@pytest.mark.parametrize("distance", [0.05, 9.9])
def test_a_corner_in_its_cover(tmp_path, distance) -> None:
    """Three bounces behind a sheet right before the radar, or 10 cm before the corner: the same loss as a plate's."""
    mesh = corner(0.08)
    mesh.apply_transform(trimesh.geometry.align_vectors(np.ones(3), (-1.0, 0.0, 0.0)))
    mesh.apply_translation((10.0 + 0.05, 0.0, 0.0))
    target = Thing("target", mesh, "Static", "steel")
    free = signal(solved(tmp_path / "free", [target])[1])[0, 0]
    paths = solved(tmp_path / "behind", [target, tilted(distance, 0.0)])[1]
    assert paths.depth.max() == 3
    assert 20.0 * np.log10(abs(signal(paths)[0, 0] / free)) == pytest.approx(-1.36, abs=0.05)


def test_what_is_half_behind_a_sheet_is_cut_at_its_edge(tmp_path) -> None:
    """Half of the plate in the open, half behind: the mean of both."""
    free = signal(solved(tmp_path / "free", [PLATE])[1])[0, 0]
    whole = signal(solved(tmp_path / "whole", [PLATE, tilted(9.99, 0.0)])[1])[0, 0]
    half = Thing("pane", plane(2.0, 2.0, (9.99, 1.0, 0.0), (-1, 0, 0)), "Static", "sheet")
    assert abs(signal(solved(tmp_path / "half", [PLATE, half])[1])[0, 0] - (free + whole) / 2.0) < 0.01 * abs(free)


def test_each_leg_of_a_bistatic_pair_has_its_own_panes(tmp_path) -> None:
    """A sheet before the transmitter only: T once."""
    pose, receiver = ss.Pose([0.0, -1.0, 0.0]), ss.Pose([0.0, 1.0, 0.0])
    pane = Thing("pane", plane(1.0, 1.0, (5.0, -0.6, 0.0), (-1, 0, 0)), "Static", "sheet")
    signals = [
        signal(solved(tmp_path / name, things, receiver, pose)[1])[0, 0]
        for name, things in (("free", [PLATE]), ("behind", [PLATE, pane]))
    ]
    assert 20.0 * np.log10(abs(signals[1] / signals[0])) == pytest.approx(-1.36 / 2.0, abs=0.05)


def test_concrete_and_steel_stay_shut(tmp_path) -> None:
    for material in ("grey", "steel"):
        wall = Thing("wall", box((0.01, 2.0, 2.0), (5.0, 0.0, 0.0)), "Static", material)
        assert solved(tmp_path / material, [PLATE, wall])[1].num_paths == 0


def test_a_car_is_not_seen_through_its_own_windows_but_others_are(tmp_path) -> None:
    """The inside of a car is no model of one: by default its own panes stay shut, with `own_panes` they do not."""
    way = WaypointTrajectory([0.0, 1.0], [[12.0, 0.0, 0.0], [13.0, 0.0, 0.0]])
    scene = write_scene(tmp_path, [Thing("ground", plane(60.0, 60.0), "Roads", "grey", is_object=False)])
    state = ss.stage(str(scene), [ss.StagedActor("car", "saloon", way, detail="light")]).at(0.0)
    pose = ss.Pose([0.0, 0.0, 1.2])
    shut, default, seen = (
        ss.solve_paths(
            state, RADAR, pose, method="sbr", instances=["car"], settings=SETTINGS.with_(max_depth=1, **knobs)
        )
        for knobs in ({"pane_loss_db": None}, {}, {"own_panes": True})
    )
    assert np.array_equal(shut.a, default.a)
    assert seen.num_paths > 1.2 * shut.num_paths


@pytest.mark.parametrize(("material", "seen"), [("sheet", True), ("steel", False)])
def test_auto_looks_through_a_sheet_as_the_tracing_does(tmp_path, material, seen) -> None:
    """What is behind plastic is planned, charged and computed; its echo is that of `sbr` alone."""
    things = [PLATE, tilted(5.0, 10.0, material)]
    state = ss.load_scene(write_scene(tmp_path, things, materials=MATERIALS)).at(0.0)
    paths = ss.solve_paths(state, RADAR, ss.Pose(), method="auto", max_distance=40.0)
    choice = next(one for one in paths.diagnostics["choices"] if one["instance"] == "target")
    assert (choice["visible_share"] > 0.9) == seen
    assert (choice["tubes"] > 0) == seen
    target = next(number for number, info in state.world.instances.items() if info.name == "target")
    assert bool((paths.instance[:, 0] == target).any()) == seen


@pytest.mark.parametrize(("material", "seen"), [("sheet", True), ("steel", False)])
def test_a_ground_bounce_passes_a_sheet(tmp_path, material, seen) -> None:
    """The last leg over a mirror may cross a pane, that of the object itself may not."""
    ground = Thing("ground", plane(64.0, 32.0, (0, 0, -1.0)), "Roads", "steel", is_object=False)
    pane = Thing("pane", plane(0.6, 2.0, (9.0, 0, -0.1), (-1, 0, 0)), "Static", material)
    state = ss.load_scene(write_scene(tmp_path, [PLATE, pane, ground], materials=MATERIALS)).at(0.0)
    paths = ss.solve_paths(state, RADAR, ss.Pose(), method="auto", max_distance=40.0)
    number = {info.name: key for key, info in state.world.instances.items()}
    over = (paths.instance == number["ground"]).any(axis=1) & (paths.instance == number["target"]).any(axis=1)
    assert bool(over.any()) == seen


def test_over_a_mirror_a_sheet_takes_its_transmission_behind_it_and_all_before_it(tmp_path) -> None:
    """A sheet across the ground bounce alone, as far from the plate as from the radar; VV is TM."""
    ground = Thing("ground", plane(64.0, 32.0, (0, 0, -1.0)), "Roads", "steel", is_object=False)
    share = ss.Share("sbr", ("target",), SETTINGS, through_mirrors=True)
    plan = ss.ChannelPlan((share,), ("ground",), echoes=False)

    def bounces(name: str, *more: Thing) -> list[float]:
        """Return the amplitudes of the plate over the ground one way, the other way, and both ways."""
        state = ss.load_scene(write_scene(tmp_path / name, [PLATE, ground, *more], materials=MATERIALS)).at(0.0)
        paths = ss.solve_paths(state, RADAR, ss.Pose(), "hybrid", plan=plan, max_distance=40.0)
        found = []
        for chain in ([2, 1, -1], [1, 2, -1], [2, 1, 2]):
            own = paths.select((paths.instance[:, :3] == chain).all(axis=1))
            found.append(abs(own.a[:, 0, 0] @ np.exp(-2j * np.pi / RADAR.wavelength * own.length)))
        return found

    def sheet(distance: float) -> Thing:
        return Thing("pane", plane(0.6, 0.6, (distance, 0, -0.45), (-1, 0, 0)), "Static", "sheet")

    free, before, behind = bounces("free"), bounces("before", sheet(1.0)), bounces("behind", sheet(9.0))
    layer = builtin_materials()["plastic"]
    _, tm = transmission(layer, RADAR.center_frequency, 5.0 / np.sqrt(26.0))
    kept = float(abs(tm)) * np.sqrt(1.0 - layer.scattering_coefficient**2)
    assert np.divide(behind, free) == pytest.approx([kept, kept, kept**2], rel=0.02) and kept < 0.95
    assert min(free) > 0.0 and before == [0.0, 0.0, 0.0]
