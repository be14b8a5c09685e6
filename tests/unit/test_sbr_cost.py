"""What physical optics on a scene will cost is found out before it starts, and a solve over its budget does not."""

from __future__ import annotations

import json
import warnings

import numpy as np
import pytest

from scarl_sionna.core.errors import BudgetError, ScarlWarning
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.memory import forget_peak, resident_bytes
from scarl_sionna.radar.channel import ChannelPlan, Share, plan_channel, solve_paths
from scarl_sionna.radar.channel.compose.budget import affordable_tubes
from scarl_sionna.radar.channel.sbr import cost as sbr_cost
from scarl_sionna.radar.channel.sbr import solve as sbr_solve
from scarl_sionna.radar.channel.sbr.bodies import Bodies
from scarl_sionna.radar.channel.sbr.cost import SAMPLES, SolveCost, coarser, solve_cost
from scarl_sionna.radar.channel.sbr.tracing import first_faces, tracer_between
from tests.scenes import Thing, ball, box, plane, write_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory

RADAR = RadarSpec(elevation_fov_deg=120.0)
POSE = Pose([0.0, 0.0, 0.5])
UNLIMITED = {"cpu_budget": None, "memory_budget": None}


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    """Return a street of parts that differ: a wall of some ten thousand patches, corners, a ball of small faces."""
    things = [
        Thing("ground", plane(64.0, 32.0), "Roads", "steel", is_object=False),
        Thing("wall", plane(12.0, 4.0, (10, 4, 2), (0, -1, 0)), "Wall", "steel"),
        Thing("kerb", box((6.0, 0.5, 0.4), (8.0, -2.0, 0.25)), "Static", "steel"),
        Thing("ball", ball(0.3, (6.0, 0.0, 0.7), subdivisions=5), "Static", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("cost"), things)).at(0.0)


def bodies_of(state, **fields) -> Bodies:
    settings = RadarSettings().changed("sbr", **fields)
    chosen = [number for number, info in state.world.instances.items() if info.is_object]
    return Bodies(state, RADAR, settings, chosen)


def test_the_expected_numbers_are_those_of_the_solve(state, monkeypatch) -> None:
    """A sample is a part of all first tubes: of 1,024, numbers of this spread come within some 10 %."""
    traced = []
    radiated = sbr_solve.radiated
    monkeypatch.setattr(
        sbr_solve, "radiated", lambda near, tubes, way: traced.extend(map(len, tubes)) or radiated(near, tubes, way)
    )
    paths = solve_paths(state, RADAR, POSE, "sbr")
    stations = sbr_solve.stations_of(RADAR, state.as_mount(POSE))
    found = solve_cost(bodies_of(state), stations)
    assert found.sampled == SAMPLES and found.first_tubes > 4 * SAMPLES
    assert found.tubes == pytest.approx(sum(paths.diagnostics["num_tubes"].values()), rel=0.15)
    assert found.patches == pytest.approx(sum(traced), rel=0.2)
    assert solve_cost(bodies_of(state), stations) == found  # no chance in it
    assert paths.diagnostics["estimate"] == found.report()


def test_a_small_solve_is_not_sampled_and_costs_no_more_than_it_says(state) -> None:
    paths = solve_paths(state, RADAR, POSE, "sbr", instances=("kerb",), max_depth=1)
    estimate = paths.diagnostics["estimate"]
    assert estimate["sampled"] == 0
    assert estimate["tubes"] > sum(paths.diagnostics["num_tubes"].values()) > 0


def test_a_sample_stands_evenly_for_all_first_tubes(state) -> None:
    bodies, stations = bodies_of(state), sbr_solve.stations_of(RADAR, state.as_mount(POSE))
    with bodies.active():
        tracer, face = tracer_between(bodies, stations), first_faces(bodies, stations)
        whole = np.concatenate([tubes.face[:, 0] for tubes in tracer._starts(face)])
        some, stands_for = tracer.sample(tracer.first_tubes(face), 4 * SAMPLES)
    assert len(some) * stands_for == pytest.approx(len(whole), rel=0.05)
    part = bodies.faces.part
    bodies_met, count = np.unique(part[whole], return_counts=True)
    found = np.array([np.count_nonzero(part[some.face[:, 0]] == body) for body in bodies_met]) * stands_for
    np.testing.assert_allclose(found, count, rtol=0.1)


def test_a_whole_highway_is_refused_before_it_takes_memory() -> None:
    """Default settings, three bounces: tens of millions of patches, and more memory than many machines have."""
    state = load_scene("highway_guardrail").at(0.5)
    radar = RadarSpec.preset("awr1843boost")
    mount = state.mount("ego", Pose([2.36, 0.0, 0.8]))
    solve_paths(state, radar, mount, "sbr", instances=("car_ahead",), max_depth=1)  # what loading takes is not counted
    before = resident_bytes()[0]
    forget_peak()
    with pytest.raises(
        BudgetError, match=r"CPU s and .* GiB .*patches.*cpu_budget = 120 s.*over_budget='coarsen'"
    ) as error:
        solve_paths(state, radar, mount, "sbr")
    cost = error.value.cost
    assert cost["patches"] > 1e7 and cost["memory_gib"] > 4.0 and cost["cpu_seconds"] > 120.0
    if before:
        assert resident_bytes()[1] - before < 2**30 / 2


def test_over_a_budget_the_first_coarser_level_within_it_is_taken(state) -> None:
    stations = sbr_solve.stations_of(RADAR, state.as_mount(POSE))
    levels = AutoSettings().levels
    expected = [solve_cost(bodies_of(state, sbr=coarser(SbrSettings(), level)), stations) for level in levels]
    own = solve_cost(bodies_of(state), stations)
    seconds = [cost.cpu_seconds for cost in expected]
    assert seconds == sorted(seconds) and seconds[-1] < own.cpu_seconds
    budget = (seconds[1] + seconds[2]) / 2.0  # between the levels of 3 and 1 dB
    fields = {"cpu_budget": budget, "memory_budget": None}
    with pytest.raises(BudgetError, match=f"cpu_budget = {budget:g} s"):
        solve_paths(state, RADAR, POSE, "sbr", **fields)
    with pytest.warns(ScarlWarning, match=r"is expected to take .* CPU s .* the level of 3 dB"):
        paths = solve_paths(state, RADAR, POSE, "sbr", over_budget="coarsen", **fields)
    assert SbrSettings(**paths.diagnostics["settings"]) == coarser(SbrSettings(), levels[1])
    assert paths.diagnostics["estimate"]["cpu_seconds"] == pytest.approx(seconds[1], abs=0.01)
    with pytest.raises(BudgetError, match="at the coarsest level it is still"):
        solve_paths(state, RADAR, POSE, "sbr", over_budget="coarsen", cpu_budget=seconds[0] / 10.0)


def test_a_level_that_makes_nothing_coarser_is_not_said_to(state) -> None:
    coarse = coarser(SbrSettings(), AutoSettings().levels[0]).with_(bisections=None, corner_share=1.0)
    level = AutoSettings().levels[0].with_(bisections=24)
    work = sbr_cost.Work(bodies_of(state, sbr=coarse), sbr_solve.stations_of(RADAR, state.as_mount(POSE)))
    tight = Accuracy(cpu_budget=1e-6, memory_budget=None, over_budget="coarsen")
    with pytest.raises(BudgetError) as error:
        sbr_cost.affordable([work], tight, [level])
    assert "coarsest level" not in str(error.value)


def test_coarser_knobs_are_nowhere_finer_and_keep_the_bounces() -> None:
    own, level = SbrSettings(max_depth=2, max_phase=1.2, return_angle=0.1, max_turn=None), AutoSettings().levels[1]
    assert level.max_phase > own.max_phase
    found = coarser(own, level)
    assert (found.max_depth, found.max_phase, found.max_turn, found.return_angle) == (2, level.max_phase, None, 0.1)
    assert coarser(found, AutoSettings().levels[-1]) == found
    coarsest = AutoSettings().levels[0]
    found = coarser(own, coarsest)
    assert (found.corner_share, found.bisections) == (coarsest.corner_share, coarsest.bisections) == (0.5, 6)
    assert coarser(own.with_(corner_share=1.0, bisections=3), coarsest).bisections == 3


def test_budgets_change_no_path_of_what_is_within_them(state) -> None:
    paths, free = solve_paths(state, RADAR, POSE, "sbr"), solve_paths(state, RADAR, POSE, "sbr", **UNLIMITED)
    for name in ("a", "tx_point", "rx_point", "length_rate", "instance"):
        assert getattr(paths, name).tobytes() == getattr(free, name).tobytes()


def test_more_rows_than_expected_stop_a_solve(state, monkeypatch) -> None:
    monkeypatch.setattr(sbr_cost, "BYTES_OF_PATCH", 1e-3)
    monkeypatch.setattr(sbr_cost, "MOST_OF_ONE", 0.0)
    solve_paths(state, RADAR, POSE, "sbr", memory_budget=0.6)
    count = solve_paths(state, RADAR, POSE, "sbr", **UNLIMITED).num_paths
    monkeypatch.setattr(sbr_cost, "BYTES_OF_PATCH", 2.0**31 / count)
    with pytest.raises(BudgetError, match=r"so far = .* rows"):
        solve_paths(state, RADAR, POSE, "sbr", memory_budget=0.6)


def test_a_plan_by_hand_counts_ways_over_mirrors_and_patches_of_their_pairs(state) -> None:
    knobs = SbrSettings(max_depth=1)

    def refused(**fields) -> dict[str, float]:
        plan = ChannelPlan((Share("sbr", ("ball",), knobs, **fields),), ("ground",), echoes=False)
        with pytest.raises(BudgetError) as error:
            solve_paths(state, RADAR, POSE, "hybrid", plan=plan, cpu_budget=1e-3)
        return error.value.cost

    straight, mirrored = refused(), refused(through_mirrors=True)
    assert mirrored["tubes"] == pytest.approx(2 * straight["tubes"], rel=1e-3)  # straight and over the ground
    assert mirrored["patches"] == pytest.approx(3 * straight["patches"], rel=1e-3)  # over it there, back, and both


def test_no_work_is_refused_for_a_bound(state) -> None:
    """What one way costs at most is within a budget that two, in three pairs, are not: they are sampled first."""
    share = Share("sbr", ("kerb",), SbrSettings(max_depth=1), through_mirrors=True)
    plan = ChannelPlan((share,), ("ground",), echoes=False)

    def estimate(**fields) -> dict[str, float]:
        return solve_paths(state, RADAR, POSE, "hybrid", plan=plan, **fields).diagnostics["estimate"]

    most = estimate(**UNLIMITED)
    alone = SolveCost(tubes=most["tubes"] / 2.0, patches=most["patches"] / 3.0)
    assert most["sampled"] == 0
    budget = alone.times(1.5, 2.0).cpu_seconds
    assert alone.cpu_seconds < budget < most["cpu_seconds"]
    found = estimate(cpu_budget=budget, memory_budget=None)
    assert found["sampled"] == SAMPLES and found["cpu_seconds"] <= budget


def test_a_plan_by_hand_is_made_coarser_too(state) -> None:
    number = next(number for number, info in state.world.instances.items() if info.name == "kerb")
    stations = sbr_solve.stations_of(RADAR, state.as_mount(POSE))

    def seconds(knobs: SbrSettings) -> float:
        return solve_cost(Bodies(state, RADAR, RadarSettings(sbr=knobs), [number]), stations).cpu_seconds

    budget = (seconds(coarser(SbrSettings(), AutoSettings().levels[0])) + seconds(SbrSettings())) / 2.0
    plan = ChannelPlan((Share("sbr", ("kerb",), SbrSettings()),), echoes=False)
    with pytest.warns(ScarlWarning, match="is expected to take"):
        paths = solve_paths(state, RADAR, POSE, "hybrid", plan=plan, cpu_budget=budget, over_budget="coarsen")
    assert paths.diagnostics["plan"]["shares"][0]["settings"]["max_phase"] > SbrSettings().max_phase
    assert paths.diagnostics["estimate"]["cpu_seconds"] <= budget < seconds(SbrSettings())


def test_auto_spends_no_more_than_any_budget_and_says_which(state) -> None:
    whole = plan_channel(state, RADAR, POSE, **UNLIMITED)
    assert {"tubes", "cpu_seconds", "memory_gib", "tolerance_db", "expected_error_db"} == set(whole.predicted)
    of_optics = AutoSettings().tubes.seconds  # without planning, clutter and second look, which `predicted` has
    half = of_optics * whole.predicted["tubes"] / 2.0
    plan = plan_channel(state, RADAR, POSE, cpu_budget=half)
    assert of_optics * plan.predicted["tubes"] <= half
    assert plan.predicted["cpu_seconds"] < whole.predicted["cpu_seconds"]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solve_paths(state, RADAR, POSE, cpu_budget=half / 20.0)
    assert any("raise Accuracy.cpu_budget" in str(one.message) for one in caught)
    memory = affordable_tubes(Accuracy(tube_budget=10**9, cpu_budget=None, memory_budget=1.0))
    assert memory[1] == "memory_budget" and SolveCost(patches=memory[0]).memory_gib == pytest.approx(1.0, rel=1e-6)
    assert affordable_tubes(Accuracy()) == (Accuracy().tube_budget, "tube_budget")


def test_files_of_earlier_versions_have_no_such_budgets() -> None:
    assert not {"cpu_budget", "memory_budget", "over_budget"} & set(json.loads(Accuracy().model_dump_json()))
    changed = Accuracy(cpu_budget=None, over_budget="coarsen")
    assert Accuracy(**json.loads(changed.model_dump_json())) == changed
