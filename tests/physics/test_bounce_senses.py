"""Bounces between a wide flat side and a narrow or curved body: both senses are those of image theory."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.compose.expected_error import mean_power
from scarl_sionna.radar.channel.sbr import senses
from tests.scenes import Thing, ball, box, write_scene

pytestmark = pytest.mark.filterwarnings("ignore::scarl_sionna.ScarlWarning")

RADAR = ss.RadarSpec(azimuth_fov_deg=160.0, elevation_fov_deg=60.0)
POSE = Pose([0.0, 0.0, 0.8])
PLACE = (16.0, 0.0, 0.8)
SIDE = box((12.0, 0.2, 3.6), (8.0, 4.1, 0.8))
KNOBS = {"max_phase": 0.5, "max_depth": 2, "floor_db": None}


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
