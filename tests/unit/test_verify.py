"""The second look of method="auto": what it measures, what it computes anew, and what it may cost."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from tests.oracles.rcs import TRIHEDRAL_MESH
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec()
POSE = Pose([0.0, 0.0, 0.6])
LEVELS = {level.tolerance_db: level for level in AutoSettings().levels}
MUCH = {"tube_budget": 10**9, "num_rays": 2_000}


def corner() -> trimesh.Trimesh:
    turned = trimesh.geometry.align_vectors(np.ones(3) / np.sqrt(3.0), [-1.0, 0.3, 0.2])[:3, :3]
    mesh = trimesh.Trimesh(0.08 * np.array(TRIHEDRAL_MESH[0]) @ turned.T, TRIHEDRAL_MESH[1], process=False)
    mesh.apply_translation([18.0, 1.0, 0.8])
    return mesh


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """A small corner far off its axis, which coarse tubes cut badly, and a box in which it can be seen."""
    things = [
        Thing("corner", corner(), "TrafficSign", "steel"),
        Thing("van", box((4, 2, 2), (22, -2.5, 1.25)), "Car", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("verify"), things)).at(0.0)


def solved(state, **fields):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        return solve_paths(state, RADAR, POSE, **{**MUCH, **fields})


def traced(state, settings, lit=()):
    plan = ChannelPlan((Share("sbr", ("corner", "van"), settings, lit=lit),))
    return solved(state, method="hybrid", plan=plan)


def power_db(paths, number: int) -> float:
    """Mean power over the band of the paths that meet an object first, by the sum itself."""
    own = paths.select(paths.instance[:, 0] == number)
    share = (np.arange(400) + 0.5) / 400
    frequency = RADAR.center_frequency + (share - 0.5) * RADAR.sampled_bandwidth
    field = np.exp(-2j * np.pi / SPEED_OF_LIGHT * np.outer(frequency, own.length)) @ own.a[:, 0, 0]
    return float(10.0 * np.log10(np.average(np.abs(field) ** 2, weights=np.sin(np.pi * share) ** 4)))


def rows(paths) -> dict[str, dict]:
    return {row["instance"]: row for row in paths.diagnostics["choices"]}


def test_what_is_lit_of_a_share_has_the_same_paths_as_in_the_whole(tmp_path) -> None:
    """Two plates at a right angle: what is lit on the one bounces off the other."""
    things = [
        Thing("corner", plane(2.0, 2.0, (21, 1, 1), (-1, -1, 0)), "Static", "steel"),
        Thing("van", plane(2.0, 2.0, (21, -1, 1), (-1, 1, 0)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    settings = SbrSettings(max_phase=3.0, integration_phase=0.2, edge_share=1.0, floor_db=None)
    whole, part = traced(state, settings), traced(state, settings, lit=("corner",))
    own = whole.select(whole.instance[:, 0] == 1)
    assert part.num_paths == own.num_paths > 0 and (own.instance == 2).any()
    assert (whole.instance[:, 0] == 2).any()
    for name in ("a", "tx_point", "rx_point", "instance"):
        assert getattr(part, name).tobytes() == getattr(own, name).tobytes(), name


@pytest.mark.parametrize(("tolerance", "other"), [(3.0, 6.0), (1.0, 3.0)])
def test_the_second_look_is_what_the_next_coarser_level_differs_by(state, tolerance: float, other: float) -> None:
    paths = solved(state, channel_tolerance_db=tolerance, look_share=1.0, refine_share=0.0)
    for number, name in ((1, "corner"), (2, "van")):
        levels = [power_db(traced(state, sbr_settings(LEVELS[one])), number) for one in (tolerance, other)]
        row = rows(paths)[name]
        assert row["second_look_db"] == pytest.approx(abs(levels[0] - levels[1]), abs=0.1), name
        assert row["expected_error_db"] >= 1.33 * row["second_look_db"] - 0.02
    if tolerance == 3.0:
        assert rows(paths)["corner"]["second_look_db"] > 0.2  # it is there to be seen


def test_it_costs_no_more_than_its_share_and_can_be_left_out(state) -> None:
    plan = plan_channel(state, RADAR, POSE, channel_tolerance_db=1.0, **MUCH)
    none = solved(state, channel_tolerance_db=1.0, look_share=0.0, refine_share=0.0)
    by_plan = solved(state, method="hybrid", plan=plan)
    assert none.a.tobytes() == by_plan.a.tobytes() and none.diagnostics["num_looked_at"] == 0
    tubes = none.diagnostics["predicted"]["tubes"]
    found = {}
    for share in (0.01, 0.1, 1.0):
        looked = solved(state, channel_tolerance_db=1.0, look_share=share, refine_share=0.0).diagnostics
        found[share] = looked["num_looked_at"]
        assert looked["second_look_tubes"] <= share * tubes
    assert found[0.01] <= found[0.1] <= found[1.0] == 2


def test_objects_that_may_miss_the_tolerance_are_computed_at_the_next_finer_level(state) -> None:
    """With a difference that counts for so much that the tolerance cannot be taken to be met."""
    doubt = {"look_share": 1.0, "errors": {"difference": 200.0}}
    paths = solved(state, channel_tolerance_db=3.0, auto={**doubt, "refine_share": 4.0})
    plain = solved(state, channel_tolerance_db=3.0, look_share=0.0, refine_share=0.0)
    finer = traced(state, sbr_settings(LEVELS[1.0]))
    refined = [name for name, row in rows(paths).items() if row["refined"]]
    assert "corner" in refined and paths.diagnostics["num_refined"] == len(refined)
    for number, name in ((1, "corner"), (2, "van")):
        expected = finer if name in refined else plain
        assert power_db(paths, number) == pytest.approx(power_db(expected, number), abs=1e-6), name
    unpaid = solved(state, channel_tolerance_db=3.0, auto={**doubt, "refine_share": 0.0})
    assert unpaid.diagnostics["num_refined"] == 0 and not unpaid.diagnostics["met"]


def test_at_the_coarsest_level_the_look_is_finer_and_its_paths_are_taken(state) -> None:
    paths = solved(state, channel_tolerance_db=6.0, look_share=4.0)
    plain = solved(state, channel_tolerance_db=6.0, look_share=0.0)
    row = rows(paths)["corner"]
    finer, coarse = power_db(traced(state, sbr_settings(LEVELS[3.0])), 1), power_db(plain, 1)
    assert row["refined"] and power_db(paths, 1) == pytest.approx(finer, abs=1e-6)
    assert row["second_look_db"] == pytest.approx(abs(finer - coarse), abs=0.1) and abs(finer - coarse) > 0.2


def test_what_the_budget_does_not_pay_for_is_looked_at_only_where_it_would_be_called_met(state) -> None:
    tubes = plan_channel(state, RADAR, POSE, channel_tolerance_db=1.0, **MUCH).predicted["tubes"]
    coarser, poor = (
        solved(state, channel_tolerance_db=1.0, tube_budget=int(share * tubes)).diagnostics for share in (0.9, 0.01)
    )
    assert coarser["level_db"] == 3.0 and coarser["num_looked_at"] > 0 and coarser["num_refined"] == 0
    assert poor["num_looked_at"] == 0 and not poor["met"]
    seconds = tubes * AutoSettings().tubes.seconds
    looks = [
        solved(state, channel_tolerance_db=1.0, cpu_budget=(1.0 + more) * seconds).diagnostics["num_looked_at"]
        for more in (1e-6, 1.0)
    ]
    assert looks[0] == 0 and looks[1] > 0  # of seconds nothing is left, or enough


def test_what_is_too_dear_with_its_reflection_is_compared_without_it(tmp_path) -> None:
    """A corner over a road: its look with the ground bounce is over a quarter of the solve, without it is not."""
    things = [
        Thing("road", plane(64.0, 16.0, (30, 0, 0)), "Roads", "steel", is_object=False),
        Thing("van", corner(), "Car", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solved(state, channel_tolerance_db=3.0, refine_share=0.0)
    row, tubes = rows(paths)["van"], paths.diagnostics["predicted"]["tubes"]
    assert row["mirrors"] == ["road"] and 0.0 < paths.diagnostics["second_look_tubes"] <= 0.25 * tubes
    alone = [
        power_db(
            solved(state, method="hybrid", plan=ChannelPlan((Share("sbr", ("van",), sbr_settings(LEVELS[one])),))), 2
        )
        for one in (3.0, 6.0)
    ]
    assert abs(alone[0] - alone[1]) > 0.2
    assert row["second_look_db"] == pytest.approx(abs(alone[0] - alone[1]), abs=0.1)
