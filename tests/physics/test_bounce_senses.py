"""Bounces between a wide flat side and a narrow or curved body, and there and back: those of image theory."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.band_mean import mean_power
from scarl_sionna.radar.channel.sbr import senses
from tests.scenes import DEFAULT_MATERIALS, Material, Thing, ball, box, write_scene

pytestmark = pytest.mark.filterwarnings("ignore::scarl_sionna.ScarlWarning")

RADAR = ss.RadarSpec(azimuth_fov_deg=160.0, elevation_fov_deg=60.0)
POSE = Pose([0.0, 0.0, 0.8])
PLACE = (16.0, 0.0, 0.8)
SIDE = box((12.0, 0.2, 3.6), (8.0, 4.1, 0.8))
KNOBS = {"max_phase": 0.5, "max_depth": 2, "floor_db": None}
THERE_AND_BACK = (1, 2, 1)
SIDES = ("Wall", "Truck")
"""The first is a mirror of `hybrid`, the second is not."""
MATERIALS = {**DEFAULT_MATERIALS, "smooth": Material(radio="glass")}


def turned_box() -> trimesh.Trimesh:
    """Return a box whose face looks to the middle between the radar and the side's point of reflection."""
    turn = trimesh.transformations.rotation_matrix(0.5 * np.arctan(0.5), (0.0, 0.0, 1.0))
    return trimesh.creation.box((0.3, 0.3, 0.6), trimesh.transformations.translation_matrix(PLACE) @ turn)


def post() -> trimesh.Trimesh:
    mesh = trimesh.creation.cylinder(radius=0.1, height=1.6, sections=16)
    mesh.apply_translation(PLACE)
    return mesh


BODIES = {"ball": ball(0.3, PLACE, 4), "post": post(), "box": turned_box()}


def senses_db(folder, mesh: trimesh.Trimesh, side_class: str) -> tuple[float, float]:
    """Return the power of side then body, and of body then side [dB of the transmitted]."""
    things = [Thing("side", SIDE, side_class, "steel"), Thing("body", mesh, "Static", "steel")]
    state = load_scene(write_scene(folder, things)).at(0.0)
    if side_class == "Wall":
        plan = ChannelPlan((Share("sbr", ("body",), KNOBS, through_mirrors=True),), ("side",), echoes=False)
        paths = solve_paths(state, RADAR, POSE, "hybrid", plan=plan, max_distance=30.0)
    else:
        paths = solve_paths(state, RADAR, POSE, "sbr", sbr=KNOBS, max_distance=30.0)
    found = []
    for chain in ((1, 2), (2, 1)):
        rows = np.flatnonzero((paths.depth == 2) & (paths.instance[:, :2] == chain).all(axis=1))
        power = mean_power(paths, RADAR, rows, np.zeros(len(rows), dtype=np.int64), 1, 64)[0]
        found.append(10.0 * float(np.log10(max(power, 1e-30))))
    return found[0], found[1]


@pytest.mark.parametrize("body", BODIES)
def test_both_senses_are_those_of_the_side_as_a_mirror(tmp_path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A ball and a post were 5 to 7 dB too weak from the body to the side, a box was not there at all."""
    mirror = senses_db(tmp_path / "wall", BODIES[body], "Wall")
    assert mirror[0] == pytest.approx(mirror[1], abs=1e-9)
    found = senses_db(tmp_path / "lorry", BODIES[body], "Truck")
    assert found[1] == pytest.approx(found[0], abs=1e-6)
    assert found[0] == pytest.approx(mirror[0], abs=1.2)
    monkeypatch.setattr(senses, "WIDER", np.inf)
    as_traced = senses_db(tmp_path / "traced", BODIES[body], "Truck")
    assert as_traced[0] == pytest.approx(found[0], abs=1e-9)
    assert abs(as_traced[1] - mirror[1]) > 4.0


def test_facets_send_no_images_of_their_own(tmp_path) -> None:
    """A ball of 1,280 faces: one facet's flat image was 18 dB stronger than the ball's in the side."""
    place = (10.6, -0.3, 0.8)
    turned = trimesh.creation.box(
        (13.0, 0.2, 3.0), trimesh.transformations.rotation_matrix(np.radians(-7.2), (0, 0, 1))
    )
    turned.apply_translation((9.9, 4.5, 0.8))
    senses_of = {}
    for name in SIDES:
        things = [Thing("side", turned, name, "steel"), Thing("body", ball(0.5, place, 3), "Static", "steel")]
        state = load_scene(write_scene(tmp_path / name, things)).at(0.0)
        paths = solve_paths(state, RADAR, POSE, "auto", channel_tolerance_db=3.0, max_distance=30.0)
        chains = ((1, 2), (2, 1))
        rows = [(paths.depth == 2) & (paths.instance[:, :2] == chain).all(axis=1) for chain in chains]
        senses_of[name] = [mean_db(paths.select(some)) for some in rows]
    assert senses_of["Truck"] == pytest.approx(senses_of["Wall"], abs=0.5)


def test_a_side_that_ends_before_its_mirror_point_sends_nothing_on(tmp_path) -> None:
    """Facets of a post did, 7 Fresnel units beyond the end of the side, more than the side itself sends."""
    far = box((5.0, 0.2, 3.6), (12.5, 4.1, 0.8))
    things = [Thing("side", far, "Truck", "steel"), Thing("body", post(), "Static", "steel")]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solve_paths(state, RADAR, POSE, "sbr", sbr=KNOBS, max_distance=30.0)
    between = (paths.depth == 2) & (paths.instance[:, 0] != paths.instance[:, 1])
    assert mean_db(paths.select(between)) < -160.0


def there_and_back(folder, things, side_class: str, material: str = "steel", pose: Pose = POSE) -> ss.RadarPaths:
    """Return the paths side, body, side: by image theory if the side is a wall."""
    things = [Thing("side", SIDE, side_class, material), *things]
    state = load_scene(write_scene(folder, things, materials=MATERIALS)).at(0.0)
    knobs = KNOBS | {"max_depth": 3}
    if side_class == "Wall":
        plan = ChannelPlan((Share("sbr", ("body",), knobs, through_mirrors=True),), ("side",), echoes=False)
        paths = solve_paths(state, RADAR, pose, "hybrid", plan=plan, max_distance=30.0)
    else:
        paths = solve_paths(state, RADAR, pose, "sbr", sbr=knobs, max_distance=30.0)
    return paths.select((paths.depth == 3) & (paths.instance[:, :3] == THERE_AND_BACK).all(axis=1))


def mean_db(paths: ss.RadarPaths) -> float:
    group = np.zeros(paths.num_paths, dtype=np.int64)
    return 10.0 * float(np.log10(max(mean_power(paths, RADAR, np.arange(len(group)), group, 1, 64)[0], 1e-30)))


@pytest.mark.parametrize("body", BODIES)
def test_there_and_back_over_a_side_is_that_over_a_mirror(tmp_path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The body is in the middle of the chain: it was 5 dB too strong, 15 dB too weak, and not there at all."""
    things = [Thing("body", BODIES[body], "Static", "steel")]
    mirror = there_and_back(tmp_path / "wall", things, "Wall")
    found = there_and_back(tmp_path / "lorry", things, "Truck")
    assert mean_db(found) == pytest.approx(mean_db(mirror), abs=0.2)
    assert (found.interaction[:, 1] == mirror.interaction[0, 1]).all() and not found.filled("random_phase").any()
    assert set(found.semantic.tolist()) == {semantic_id("Truck")}
    monkeypatch.setattr(senses, "WIDER", np.inf)
    assert abs(mean_db(there_and_back(tmp_path / "traced", things, "Truck")) - mean_db(mirror)) > 4.0


def in_phase(paths: ss.RadarPaths, later: float = 0.0) -> np.ndarray:
    """Return the sum of the fields at the middle of the band, some seconds later by their rates."""
    wavenumber = 2.0 * np.pi * RADAR.center_frequency / 299_792_458.0
    length = paths.length + later * paths.length_rate
    return np.einsum("nij,n->ij", paths.a, np.exp(-1j * wavenumber * length))


def test_all_polarisations_go_there_and_back(tmp_path) -> None:
    """A radar on its side by 30 deg, and a side of glass, which takes more off one polarisation than off the other."""
    roll = trimesh.transformations.rotation_matrix(np.radians(30.0), (1.0, 0.0, 0.0))[:3, :3]
    pose = Pose.from_rotation(POSE.position, roll)
    things = [Thing("body", post(), "Static", "steel")]
    mirror, found = (
        in_phase(there_and_back(tmp_path / name, things, name, material="smooth", pose=pose)) for name in SIDES
    )
    assert np.abs(found - mirror).max() < 0.03 * np.abs(mirror).max()
    assert abs(mirror[0, 1]) > 0.1 * np.abs(mirror).max()
    assert found[0, 1] == pytest.approx(found[1, 0], rel=1e-9)


def test_what_rough_bodies_scatter_goes_there_and_back(tmp_path) -> None:
    """Off the specular ring of a rough rod that alone is there, with a random phase."""
    lean = trimesh.transformations.rotation_matrix(0.3, (1.0, -0.7, 0.0))
    mesh = trimesh.creation.cylinder(0.06, height=0.5, sections=24)
    mesh.apply_transform(trimesh.transformations.translation_matrix((10.0, 1.0, 1.1)) @ lean)
    things = [Thing("body", mesh, "Static", "grey")]
    power = []
    for paths in (there_and_back(tmp_path / name, things, name) for name in SIDES):
        rough = paths.a[paths.filled("random_phase")]
        power.append(np.einsum("nij,nij->ij", rough, rough.conj()).real)
    np.testing.assert_allclose(power[1], power[0], rtol=0.01)


def test_rates_there_and_back_are_those_of_the_length(tmp_path) -> None:
    """The phase of a ball 0.1 ms later; by the wrong rate it would be off by radians."""
    later, knobs = 1e-4, KNOBS | {"max_depth": 3}
    trajectory = {"kind": "constant_twist", "position": list(PLACE), "velocity": [30.0, 5.0, 2.0]}
    actors = [Thing("body", ball(0.3, subdivisions=4), "Car", "steel", trajectory)]
    world = load_scene(write_scene(tmp_path, [Thing("side", SIDE, "Truck", "steel")], actors))
    one, other = (solve_paths(world.at(t), RADAR, POSE, "sbr", sbr=knobs, max_distance=30.0) for t in (0.0, later))
    one, other = (
        paths.select((paths.depth == 3) & (paths.instance[:, :3] == THERE_AND_BACK).all(axis=1))
        for paths in (one, other)
    )
    np.testing.assert_array_equal(one.filled("tx_velocity"), one.filled("rx_velocity"))
    np.testing.assert_array_equal(one.tx_point, one.rx_point)
    turned = np.angle(in_phase(one, later)[0, 0] / in_phase(one)[0, 0])
    assert abs(turned) > 0.5
    assert abs(in_phase(other)[0, 0] / in_phase(one, later)[0, 0] - 1.0) < 0.05


def test_the_reverse_has_the_ends_exchanged(tmp_path) -> None:
    """Directions, polarisation, rate and what scatters: labels go by the body, which is met first then."""
    trajectory = {"kind": "constant_twist", "position": list(PLACE), "velocity": [3.0, 2.0, 0.0]}
    things = [Thing("side", SIDE, "Truck", "steel")]
    actors = [Thing("body", ball(0.3, subdivisions=4), "Car", "steel", trajectory)]
    state = load_scene(write_scene(tmp_path, things, actors)).at(0.0)
    paths = solve_paths(state, RADAR, POSE, "sbr", sbr=KNOBS, max_distance=30.0)
    one, other = (
        paths.select((paths.depth == 2) & (paths.instance[:, :2] == chain).all(axis=1)) for chain in ((1, 2), (2, 1))
    )
    assert one.num_paths == other.num_paths > 100
    first, second = np.lexsort(one.tx_point.T), np.lexsort(other.rx_point.T)
    np.testing.assert_array_equal(one.tx_point[first], other.rx_point[second])
    np.testing.assert_array_equal(one.a[first], other.a[second].transpose(0, 2, 1))
    np.testing.assert_array_equal(one.length_rate[first], other.length_rate[second])
    np.testing.assert_array_equal(one.filled("rx_velocity")[first], other.filled("tx_velocity")[second])
    assert (one.interaction[:, 1] == other.interaction[:, 0]).all()
    assert set(one.semantic.tolist()) == {semantic_id("Car")} and not other.filled("random_phase").any()
    assert set(other.semantic.tolist()) == {semantic_id("Truck")}
