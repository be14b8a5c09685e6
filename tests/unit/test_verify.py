"""What method="auto" computes finer after its first solve, what it learns of that, and what it may cost."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.core.mount import Mount
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.plan import ChannelPlan, Share
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.antennas.element import AntennaElement
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.paths.tracing import DIFFUSE
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose import verify
from scarl_sionna.radar.channel.compose.auto import _missed, _planned
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from scarl_sionna.radar.channel.compose.expected_error import levels_db, reverse_doubts
from scarl_sionna.radar.channel.compose.verify import _chain, _Work, met
from scarl_sionna.radar.channel.sbr import senses
from scarl_sionna.radar.optics.tubes import returning
from tests.oracles.rcs import TRIHEDRAL_MESH
from tests.scenes import Thing, ball, box, plane, write_scene

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
    much = {} if fields.get("method") == "hybrid" else MUCH
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScarlWarning)
        return solve_paths(state, RADAR, POSE, **{**much, **fields})


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


def right_angle(folder: Path):
    """Two plates at a right angle: what is lit on the one bounces off the other."""
    things = [
        Thing("corner", plane(2.0, 2.0, (21, 1, 1), (-1, -1, 0)), "Static", "steel"),
        Thing("van", plane(2.0, 2.0, (21, -1, 1), (-1, 1, 0)), "Static", "steel"),
    ]
    return load_scene(write_scene(folder, things)).at(0.0)


def test_what_is_lit_of_a_share_has_the_same_paths_as_in_the_whole(tmp_path) -> None:
    state = right_angle(tmp_path)
    settings = SbrSettings(max_phase=3.0, integration_phase=0.2, edge_share=1.0, floor_db=None)
    whole, part = traced(state, settings), traced(state, settings, lit=("corner",))
    own = whole.select(whole.instance[:, 0] == 1)
    assert part.num_paths == own.num_paths > 0 and (own.instance == 2).any()
    assert (whole.instance[:, 0] == 2).any()
    for name in ("a", "tx_point", "rx_point", "instance"):
        assert getattr(part, name).tobytes() == getattr(own, name).tobytes(), name


def test_the_finest_level_begins_one_coarser_and_all_is_computed_at_it(state) -> None:
    paths = solved(state, channel_tolerance_db=0.3)
    assert (paths.diagnostics["level_db"], paths.diagnostics["first_level_db"]) == (0.3, 1.0)
    assert paths.diagnostics["num_refined"] == 2
    for number, name in ((1, "corner"), (2, "van")):
        levels = [power_db(traced(state, sbr_settings(LEVELS[one])), number) for one in (0.3, 1.0)]
        assert power_db(paths, number) == pytest.approx(levels[0], abs=1e-6), name
        row = rows(paths)[name]
        assert row["second_look_db"] == pytest.approx(abs(levels[0] - levels[1]), abs=0.1), name
        assert row["expected_error_db"] >= AutoSettings().errors.difference * row["second_look_db"] - 0.05


def test_other_levels_are_taken_at_once(state) -> None:
    paths = solved(state, channel_tolerance_db=1.0, auto={"errors": {"median": 100.0}, "refine_share": 0.0})
    assert paths.diagnostics["level_db"] == paths.diagnostics["first_level_db"] == 1.0
    assert paths.diagnostics["num_refined"] == 0 and not paths.diagnostics["met"]
    whole = traced(state, sbr_settings(LEVELS[1.0]))
    for number in (1, 2):
        assert power_db(paths, number) == pytest.approx(power_db(whole, number), abs=1e-6)


def test_bounces_are_compared_with_their_reverse_at_coarse_levels_only(tmp_path) -> None:
    state = right_angle(tmp_path)

    def doubted(errors: dict[str, float]) -> list[str]:
        paths = solved(state, channel_tolerance_db=1.0, auto={"errors": {"doubt_share": 0.0, **errors}})
        return [name for name, row in rows(paths).items() if row["doubt_db"]]

    assert doubted({"doubted_from_db": 1.0}) and not doubted({})


def test_the_first_solve_can_be_that_of_the_plan(state) -> None:
    plan = plan_channel(state, RADAR, POSE, channel_tolerance_db=0.3, **MUCH)
    whole = solved(state, channel_tolerance_db=0.3, auto={"coarse_first": False, "refine_share": 0.0})
    by_plan = solved(state, method="hybrid", plan=plan)
    assert whole.a.tobytes() == by_plan.a.tobytes() and whole.diagnostics["num_looked_at"] == 0
    assert whole.diagnostics["second_look_tubes"] == 0
    both = solved(state, channel_tolerance_db=0.3, auto={"refine_share": 0.0})
    assert 0 < both.diagnostics["second_look_tubes"] <= both.diagnostics["predicted"]["tubes"]


def test_what_no_probe_saw_is_not_looked_at_for_nothing(state, monkeypatch) -> None:
    """Tubes find what was planned to be hidden: a second look at it costs at least as many as have come back."""
    fields = {"channel_tolerance_db": 6.0, "auto": {"look_share": 0.0}}
    monkeypatch.setattr(verify, "num_tubes_of", lambda *_: 0)
    paths = solved(state, **fields)
    assert paths.num_paths and paths.diagnostics["num_looked_at"] == 0
    looked = solved(state, **{**fields, "auto": {"look_share": 1.0}}).diagnostics
    assert looked["num_looked_at"] == 2 and looked["second_look_tubes"] >= paths.num_paths


def test_beyond_the_level_asked_for_objects_are_computed_only_if_that_is_hoped_to_be_enough(state) -> None:
    plain = solved(state, channel_tolerance_db=3.0, refine_share=0.0)
    expected = max(row["expected_error_db"] for row in rows(plain).values() if row["expected_error_db"])
    fit = AutoSettings().errors
    odds = (1.0 / fit.confidence - 1.0) ** (1.0 / fit.tail)  # of one object alone
    median = 3.0 * odds / expected
    paths = solved(state, channel_tolerance_db=3.0, auto={"errors": {"median": 1.3 * median}, "refine_share": 4.0})
    finer = traced(state, sbr_settings(LEVELS[1.0]))
    refined = [name for name, row in rows(paths).items() if row["refined"]]
    assert refined and paths.diagnostics["num_refined"] == len(refined)
    for number, name in ((1, "corner"), (2, "van")):
        wanted = finer if name in refined else plain
        assert power_db(paths, number) == pytest.approx(power_db(wanted, number), abs=1e-6), name
    unpaid = solved(state, channel_tolerance_db=3.0, auto={"errors": {"median": 1.3 * median}, "refine_share": 0.0})
    assert unpaid.diagnostics["num_refined"] == 0 and not unpaid.diagnostics["met"]
    vain = solved(state, channel_tolerance_db=3.0, auto={"errors": {"median": 1e4}, "refine_share": 4.0})
    assert vain.diagnostics["num_refined"] == 0 and not vain.diagnostics["met"]


def test_at_the_coarsest_level_the_look_is_finer_and_its_paths_are_taken(state) -> None:
    paths = solved(state, channel_tolerance_db=6.0, look_share=4.0)
    plain = solved(state, channel_tolerance_db=6.0, look_share=0.0)
    row = rows(paths)["corner"]
    finer, coarse = power_db(traced(state, sbr_settings(LEVELS[3.0])), 1), power_db(plain, 1)
    assert row["refined"] and power_db(paths, 1) == pytest.approx(finer, abs=1e-6)
    assert row["second_look_db"] == pytest.approx(abs(finer - coarse), abs=0.01) and abs(finer - coarse) > 0.03


def test_a_budget_pays_for_what_is_computed_finer(state) -> None:
    tubes = plan_channel(state, RADAR, POSE, channel_tolerance_db=0.3, **MUCH).predicted["tubes"]
    coarser = solved(state, channel_tolerance_db=0.3, tube_budget=int(0.9 * tubes)).diagnostics
    assert coarser["level_db"] == coarser["first_level_db"] == 1.0 and coarser["num_looked_at"] == 0
    seconds = tubes * AutoSettings().tubes.seconds
    strict = {"refine_share": 0.0}
    refined = [
        solved(state, channel_tolerance_db=0.3, auto=strict, cpu_budget=(1.0 + more) * seconds).diagnostics
        for more in (1e-6, 2.0)
    ]
    for found, more in zip(refined, (1e-6, 2.0), strict=True):
        first = plan_channel(state, RADAR, POSE, channel_tolerance_db=1.0, **MUCH).predicted["tubes"]
        assert found["second_look_tubes"] <= (1.0 + more) * tubes - first
    assert refined[0]["num_refined"] < refined[1]["num_refined"] == 2


def test_what_bounces_both_ways_is_as_strong_either_way_and_a_lack_of_one_is_a_doubt(tmp_path) -> None:
    """Two plates at a right angle: reciprocity holds; of which one way is taken away by half, by hand."""
    state = right_angle(tmp_path)
    paths = traced(state, SbrSettings(max_phase=1.0, integration_phase=0.1, floor_db=None))
    whole = reverse_doubts(paths, RADAR, (1, 2), (1, 2))
    assert set(whole) == {1, 2} and max(whole.values()) < 0.1
    assert reverse_doubts(paths, RADAR, (1, 2), (1,)) == {}  # the other way was not traced
    there = paths.select((paths.instance[:, 0] == 1) & (paths.instance[:, 1] == 2))
    half = np.where((paths.instance[:, 0] == 1) & (paths.instance[:, 1] == 2), 0.5, 1.0)
    found = reverse_doubts(replace(paths, a=paths.a * half[:, None, None]), RADAR, (1, 2), (1, 2))
    field = power_db(there, 1) - 20.0 * np.log10(2.0)  # what is lacking is half of that way's field
    for number in (1, 2):
        echo = power_db(replace(paths, a=paths.a * half[:, None, None]), number)
        assert found[number] == pytest.approx(20 * np.log10(1 + 10 ** ((field - echo) / 20)), rel=0.05)
    crossed = RADAR.with_(rx_elements=(AntennaElement(polarization="H"),))  # the field of the other polarisations
    turned = (half * paths.a[:, 0, 0])[:, None, None] * np.array([[0.0, 1.0], [1.0, 0.0]])
    other = reverse_doubts(replace(paths, a=turned), crossed, (1, 2), (1, 2))
    assert other == pytest.approx(found, rel=1e-9)


@pytest.mark.own_process  # beside what a worker has already, it would pass the bound of memory
def test_a_ball_seen_in_a_sign_is_found_by_its_reverse_and_computed_finer(tmp_path, monkeypatch) -> None:
    """With patches of 3 rad and as few rays as were asked before whether a tube comes back, parts of it are missed.

    Both senses as they are traced, as faces that are alike have them.
    """
    things = [
        Thing("corner", plane(0.921, 0.809, (22.487, 1.805, 1.255), (-0.946, -0.262, -0.034)), "TrafficSign", "steel"),
        Thing("van", ball(0.372, (10.633, -3.913, 0.365), 5), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    fine = SbrSettings(max_phase=0.4, integration_phase=0.05, edge_share=0.0625, sheet_share=0.05, max_depth=2)
    true = power_db(traced(state, fine), 1)  # 0.16 dB above that of five bounces
    assert abs(power_db(solved(state, channel_tolerance_db=3.0, refine_share=0.0), 1) - true) < 1.3
    monkeypatch.setattr(returning, "FINER", 1.0)
    monkeypatch.setattr(senses, "WIDER", np.inf)
    coarse = LEVELS[3.0].with_(max_phase=3.0, integration_phase=0.2, return_angle=0.8, sheet_share=0.15)
    levels = tuple(coarse if level is LEVELS[3.0] else level for level in LEVELS.values())
    rules = {"levels": levels, "errors": {"doubt_share": 1.0, "confidence": 0.95}}
    settled, unpaid = (
        solved(state, channel_tolerance_db=3.0, auto={**rules, "refine_share": share}) for share in (2.0, 0.0)
    )
    assert abs(power_db(unpaid, 1) - true) > 4.0 and abs(power_db(settled, 1) - true) < 1.3
    assert rows(settled)["corner"]["refined"] and not rows(unpaid)["corner"]["refined"]
    assert rows(unpaid)["corner"]["doubt_db"] > 3.0 and rows(unpaid)["corner"]["expected_error_db"] > 3.0
    assert settled.diagnostics["second_look_tubes"] < 2.0 * settled.diagnostics["predicted"]["tubes"]


def test_an_object_of_which_hardly_anything_is_seen_is_computed_finer(tmp_path) -> None:
    """A van behind a wall but for 5 cm of its edge."""
    things = [
        Thing("wall", box((0.2, 6.0, 4.0), (15, -1.93, 1.5)), "Static", "steel"),
        Thing("van", box((4, 2, 2), (22, 0.49, 1.25)), "Car", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    paths = solved(state, channel_tolerance_db=3.0, refine_share=1.0)
    row = rows(paths)["van"]
    assert 0.0 < row["visible_share"] * AutoSettings().num_probes < 5.5
    other = solved(state, channel_tolerance_db=3.0, refine_share=1.0, few_probes=0)
    assert row["refined"] and not rows(other)["van"]["refined"]


def test_what_is_taken_from_a_finer_solve_keeps_the_reverse_of_tubes_from_others(tmp_path) -> None:
    """A ball beside a lorry: from the ball to the lorry is the reverse of tubes on the lorry, which is not lit."""
    things = [
        Thing("lorry", box((12.0, 0.2, 3.6), (14.0, 4.1, 0.6)), "Truck", "steel"),
        Thing("ball", ball(0.3, (22.0, 0.0, 0.6), 4), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    settings = RadarSettings().changed("auto", channel_tolerance_db=3.0, **MUCH)
    view, chosen, plan = _planned(state, RADAR, Mount.of(POSE), settings)
    before = solved(state, method="hybrid", plan=plan)
    work = _Work(view, chosen, plan, before)
    finer = work._traced([2], LEVELS[1.0])
    work._take(finer, [2], LEVELS[1.0])

    def bounces(paths):
        return paths.select((paths.depth == 2) & (paths.instance[:, :2] == (2, 1)).all(axis=1))

    was, found = bounces(before), bounces(work.result.paths)
    assert not bounces(finer).num_paths
    np.testing.assert_array_equal(found.a, was.a)
    assert (found.interaction[:, 0] == DIFFUSE).all()


@pytest.mark.parametrize(("expected", "tolerance", "stated"), [(1.004, 1.0, "1.01"), (1.3, 1.0, "1.3"), (0.3, 0.3, "")])
def test_an_error_over_the_tolerance_is_stated_so_and_with_a_remedy_that_there_is(
    monkeypatch, expected: float, tolerance: float, stated: str
) -> None:
    monkeypatch.setattr(verify, "kept_error", lambda *_: expected)
    settings = RadarSettings(accuracy=Accuracy(channel_tolerance_db=tolerance))
    view = SimpleNamespace(rules=settings.auto, settings=settings)
    kept = met([], {}, view)
    assert kept["met"] == (kept["expected_error_db"] <= tolerance) == (not stated)
    for level in LEVELS.values():
        text = _missed(kept, SimpleNamespace(level=level), view)
        assert text.startswith("the echo of 90 %") == bool(stated)
        assert f"within {stated} dB, the tolerance is {tolerance:g} dB; " in text or not stated
        if stated and level.tolerance_db <= tolerance:
            assert ("ask for a finer one" in text) == (level.tolerance_db > 0.3)
            assert ("no finer level is tested" in text) == (level.tolerance_db == 0.3)


def test_as_many_of_the_bright_objects_keep_the_tolerance(state) -> None:
    """Nineteen weak objects that are right do not make up for the one bright one of two that is not."""
    view = SimpleNamespace(rules=AutoSettings(), settings=SimpleNamespace(accuracy=Accuracy(channel_tolerance_db=3.0)))
    item = SimpleNamespace(expected_db=60.0, is_coherent=True, info=SimpleNamespace(is_object=True))
    choices = [
        SimpleNamespace(item=SimpleNamespace(**vars(item), number=k), over_budget=False, method="sbr", without=None)
        for k in range(22)
    ]
    errors = {number: 0.1 for number in range(22)} | {0: 100.0}
    weak = dict.fromkeys(range(2, 22), 12.0)
    assert met(choices, errors, view, weak | {0: 12.0, 1: 50.0})["num_counted"] == 22
    assert met(choices, errors, view)["met"]
    assert not met(choices, errors, view, weak | {0: 50.0, 1: 50.0})["met"]
    assert met(choices, errors, view, dict.fromkeys(range(22), 5.0))["num_counted"] == 1  # but for its error too weak


def test_what_is_taken_from_a_finer_solve_is_there_once_with_what_only_its_reverse_traces(tmp_path) -> None:
    """Two plates at a right angle over a road: (road, b, a) is the reverse of (a, b, road), where a is lit."""
    things = [
        Thing("road", plane(64.0, 16.0, (30, 0, 0)), "Roads", "steel", is_object=False),
        Thing("a", plane(2.0, 2.0, (21, 1, 1.1), (-1, -1, 0)), "Static", "steel"),
        Thing("b", plane(2.0, 2.0, (21, -1, 1.1), (-1, 1, 0)), "Static", "steel"),
    ]
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    settings = RadarSettings().changed(
        "auto", channel_tolerance_db=3.0, auto={"look_share": 0.0, "refine_share": 0.0}, **MUCH
    )
    view, chosen, plan = _planned(state, RADAR, Mount.of(POSE), settings)
    before = solved(state, method="hybrid", plan=plan)
    numbers = {state.world.instances[number].name: number for number in state.world.instances}
    a, b = numbers["a"], numbers["b"]
    work = _Work(view, chosen, plan, before)
    work._take(work._traced([a], LEVELS[1.0]), [a], LEVELS[1.0])
    shares = tuple(replace(share, settings=sbr_settings(LEVELS[1.0])) for share in plan.shares if share.solver == "sbr")
    finer = solved(state, method="hybrid", plan=replace(plan, shares=shares))

    def strength(paths, number):
        return levels_db(paths, RADAR, [a, b])[number]

    assert strength(work.result.paths, b) == pytest.approx(strength(before, b), abs=1e-9)
    assert strength(work.result.paths, a) == pytest.approx(strength(finer, a), abs=0.3)
    reversed_ones = before.instance[(before.instance[:, 0] == numbers["road"]) & (before.instance[:, 1] == a)]
    assert any(_chain(row)[:3] == (numbers["road"], a, b) for row in reversed_ones)  # it is there to be lost
