"""The rule of ownership: every instance has one solver, and a mirror no coherent one beside it."""

from __future__ import annotations

import json

import pytest

from scarl_sionna.core.errors import InputTypeError, ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.plan import Reflection
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, OwnershipError, Share, solve_paths
from scarl_sionna.radar.channel.compose.hybrid import DoubleCountError, _check_chains
from scarl_sionna.radar.channel.compose.plan import resolve
from tests.scenes import Thing, box, plane, write_scene


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = [
        Thing("ground", plane(64.0, 64.0), "Roads"),
        Thing("van", box((4, 2, 2), (15, 1, 1.25)), "Car", "steel"),
        Thing("car", box((4, 2, 1), (15, -4, 1)), "Car", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("plan"), things)).at(0.0)


def test_names_ids_classes_and_the_rest_are_resolved(state) -> None:
    plan = resolve(ChannelPlan((Share("sbr", ("Car",)), Share("raycast")), mirrors=(1,)), state.world)
    assert plan.owned == ((2, 3), (1,)) and plan.mirrors == (1,)
    assert resolve(ChannelPlan((Share("raycast", ("van", 3, "van")),)), state.world).owned == ((2, 3),)
    lit = resolve(ChannelPlan((Share("sbr", ("Car",), lit=("car",)), Share("raycast"))), state.world)
    assert lit.owned == ((2, 3), (1,)) and lit.lit == ((3,), (1,))


@pytest.mark.parametrize(
    ("shares", "mirrors", "name", "owners"),
    [
        ((Share("sbr", ("van",)), Share("raycast", ("van",))), (), "van", ("'sbr' (share 0)", "'raycast' (share 1)")),
        ((Share("sbr", ("van",)), Share("sbr", ("Car",))), (), "van", ("'sbr' (share 0)", "'sbr' (share 1)")),
        ((Share("raycast"), Share("raycast")), (), "ground", ("'raycast' (share 0)", "'raycast' (share 1)")),
        ((Share("sbr", ("ground",)),), ("ground",), "ground", ("'sbr'", "the mirrors ('sionna')")),
        ((Share("sbr"),), ("ground",), "ground", ("'sbr'", "the mirrors ('sionna')")),
    ],
)
def test_a_second_owner_is_refused(state, shares, mirrors, name, owners) -> None:
    with pytest.raises(OwnershipError, match=f"'{name}' is given to") as caught:
        solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "hybrid", plan=ChannelPlan(shares, mirrors))
    assert caught.value.instance == name and caught.value.owners == owners


def test_a_mirror_may_have_a_rough_part(state) -> None:
    assert resolve(ChannelPlan((Share("raycast"),), ("ground",)), state.world).owned == ((1, 2, 3),)


def test_weights_of_reflections_are_resolved_and_checked(state) -> None:
    over = Reflection(("van", 3), ("ground",), ((0.25,), (1.0,)))
    (seen,) = resolve(
        ChannelPlan((Share("sbr", ("Car",), reflections=(over,)),), ("ground",)), state.world
    ).reflections[0]
    assert seen == ((2, 3), (1,), {(2, 1): 0.25})
    assert over.only({3}) == Reflection((3,), ("ground",), ((1.0,),)) and Reflection(**over.to_dict()) == over
    with pytest.raises(ParameterRangeError, match="2 rows of 1"):
        Reflection(("van", 3), ("ground",), ((0.25,),))
    with pytest.raises(ParameterRangeError, match="0 to 1"):
        Reflection(("van",), ("ground",), ((1.5,),))


def test_bad_plans_are_refused(state) -> None:
    with pytest.raises(UnknownNameError, match="solver of objects.*mirrors"):
        Share("sionna", ("van",))
    with pytest.raises(UnknownNameError, match="did you mean 'van'"):
        resolve(ChannelPlan((Share("sbr", ("vann",)),)), state.world)
    with pytest.raises(ParameterRangeError, match="write \\('name',\\)"):
        Share("sbr", "van")
    with pytest.raises(ParameterRangeError, match="random phases"):
        Share("raycast", ("van",), through_mirrors=True)
    with pytest.raises(ParameterRangeError, match="lit given for 'raycast'|'raycast'.*whose bodies bounce"):
        Share("raycast", ("van",), lit=("van",))
    with pytest.raises(ParameterRangeError, match=r"'car'.*instances of the share \(share 0\)"):
        resolve(ChannelPlan((Share("sbr", ("van",), lit=("car",)),)), state.world)
    with pytest.raises(UnknownNameError, match="SbrSettings.instances is an unknown field"):
        Share("sbr", ("van",), {"instances": ["car"]})
    with pytest.raises(ParameterRangeError, match="mirror_depth"):
        ChannelPlan((), mirror_depth=9)
    with pytest.raises(ParameterRangeError, match="'van'.*a ScattererModel for every instance"):
        plan = ChannelPlan((Share("scatterers", ("van",), {"models": {"car": None}}),))
        solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "hybrid", plan=plan)
    with pytest.raises(InputTypeError, match="a ChannelPlan"):
        solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "hybrid", plan=["van"])
    with pytest.raises(UnknownNameError, match="field of a ChannelPlan 'sbr'"):
        solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "hybrid", plan={"sbr": ["van"]})


def test_a_chain_that_two_solvers_give_is_found(state) -> None:
    paths = solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "raycast", num_rays=500)
    with pytest.raises(DoubleCountError, match=r"chain \(\d+, 2\)"):
        _check_chains([paths, paths.select(slice(0, 3))])


def test_a_chain_over_two_mirror_faces_is_two_echoes_and_over_one_of_them_one(state) -> None:
    paths = solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "raycast", num_rays=500)
    left, right, plain = ((0,), ()), ((1,), ()), ((), ())
    _check_chains([paths, paths, paths], [left, right, left[::-1]])
    for faces in ([left, right, left], [left, plain], [plain, left], [plain, plain]):
        with pytest.raises(DoubleCountError, match="over the mirror faces"):
            _check_chains([paths] * len(faces), faces)


def test_diagnostics_are_plain_and_name_what_nobody_computes(state) -> None:
    plan = ChannelPlan((Share("raycast", ("van",), {"num_rays": 5_000}, reason="test"),))
    paths = solve_paths(state, RadarSpec(), Pose([0, 0, 0.5]), "hybrid", plan=plan)
    reported = json.loads(json.dumps(paths.diagnostics))
    assert {entry["instance"] for entry in reported["left_out"]} == {"ground", "car"}
    (row,) = reported["solvers"]
    assert row["instances"] == ["van"] and row["num_paths"] == paths.num_paths > 0
    assert row["reason"] == "test" and row["power_dbm"] < 0.0 and reported["seconds"]["raycast: objects"] > 0.0
    assert set(paths.instance[:, 0]) == {2}


def test_who_finds_the_chains_of_mirrors_is_one_of_two() -> None:
    assert ChannelPlan((), chains="images").to_dict()["chains"] == "images"
    with pytest.raises(ParameterRangeError, match="chains = 'rays'.*'sionna' or 'images'"):
        ChannelPlan((), chains="rays")
