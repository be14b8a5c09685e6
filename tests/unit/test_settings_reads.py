"""Settings without effect on the paths of a method: refused as keywords, warned of in whole settings."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import BudgetError, ParameterRangeError, ScarlWarning
from scarl_sionna.core.settings.radar import METHODS, RadarSettings
from scarl_sionna.core.settings.reads import OF_FRAMES, READS, unread
from scarl_sionna.core.spec import Spec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, plan_channel, solve_paths
from tests.scenes import Material, Thing, ball, plane, write_scene

RADAR = ss.RadarSpec(elevation_fov_deg=90.0)
POSE = ss.Pose([0.0, 0.0, 0.7])
CORE = str(Path(sys.modules[Spec.__module__].__file__).parent)
PARTS = ("accuracy", "auto", "mirrors", "raycast", "sionna", "sbr", "scatterers")
PLAN = ChannelPlan(
    (Share("sbr", ("ball",)), Share("raycast", ("road",)), Share("scatterers", ("car",))),
    ("road",),
    chains="images",
)


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = [
        Thing("road", plane(30.0, 20.0, (12, 0, 0)), "Roads", "asphalt", is_object=False),
        Thing("ball", ball(0.1, (8, 1, 0.6), 2), "Static", "steel"),
        Thing("car", ball(0.2, (9, -2, 0.6), 1), "Car", "steel"),
    ]
    materials = {"asphalt": Material(radio="asphalt")}
    return load_scene(write_scene(tmp_path_factory.mktemp("reads"), things, [], materials=materials)).at(0.0)


def watched(spec: Spec, seen: set[str], name: str = "") -> Spec:
    """Return a specification that notes which fields the solvers take from it; its copies do not."""
    kind = type(spec)

    class Watched(kind):  # type: ignore[misc, valid-type]
        def __getattribute__(self, field: str) -> object:
            if field in kind.model_fields and not sys._getframe(1).f_code.co_filename.startswith(CORE):
                seen.add(f"{name}.{field}" if name else field)
            return super().__getattribute__(field)

        def with_(self, **changes: object) -> Spec:
            if name:  # a part that is changed a little is still read
                seen.update(f"{name}.{field}" for field in self.model_fields_set)
            return kind(**{**{field: getattr(self, field) for field in self.model_fields_set}, **changes})

    return Watched(**{field: getattr(spec, field) for field in spec.model_fields_set})


def taken(state, method: str) -> set[str]:
    """Return which settings solves by a method take, a small one and one over its budget."""
    seen: set[str] = set()
    full = RadarSettings(
        raycast={"num_rays": 2_000}, scatterers={"models": {"car": "tr38901:car"}}, sionna={"num_samples": 2_000}
    )
    for budget in (120.0, 1e-9):
        accuracy = ss.Accuracy(cpu_budget=budget, over_budget="coarsen", channel_tolerance_db=6.0)
        whole = full.with_(accuracy=accuracy)
        parts = {name: watched(getattr(whole, name), seen, name) for name in PARTS}
        plan = {"plan": PLAN} if method == "hybrid" else {}
        top: set[str] = set()
        settings = watched(RadarSettings(method=method, **parts, **plan), top)
        try:
            solve_paths(state, RADAR, POSE, settings=settings)
        except BudgetError:
            assert budget < 1.0
        seen |= top & {"instances", "plan"}
    return seen


@pytest.mark.filterwarnings("ignore::scarl_sionna.core.errors.ScarlWarning")
@pytest.mark.parametrize("method", METHODS)
def test_the_table_of_what_methods_read_is_what_solves_take_from_their_settings(state, method: str) -> None:
    found, table = taken(state, method), READS[method]
    assert {name for name in found if not {name, name.partition(".")[0]} & table} == set()
    parts = {name.partition(".")[0] for name in found}
    assert {name for name in table if "." in name} <= found
    assert {name for name in table & {*PARTS, "instances", "plan"} if name not in parts} == set()


def test_tables_name_settings_that_there_are() -> None:
    for name in OF_FRAMES.union(*READS.values()):
        part, _, field = name.partition(".")
        assert part in RadarSettings.model_fields
        assert not field or field in type(getattr(RadarSettings(), part)).model_fields


@pytest.mark.parametrize(
    ("method", "fields", "remedy"),
    [
        ("auto", {"instances": ["ball"]}, "choose method 'raycast' or 'sbr'"),
        ("auto", {"max_phase": 0.1}, r"auto=AutoSettings\(levels=...\); or choose method 'sbr' or 'hybrid'"),
        ("auto", {"floor_db": None}, "AutoSettings"),
        ("auto", {"sbr": ss.SbrSettings(edge_diffraction=True)}, "AutoSettings"),
        ("auto", {"sbr": {"max_depth": 2}}, "AutoSettings"),
        ("raycast", {"reciprocal": False}, "choose method 'auto' or 'sbr' or 'hybrid'"),
        ("auto", {"over_budget": "coarsen"}, "choose method 'sbr' or 'hybrid'"),
        ("auto", {"plan": PLAN}, "choose method 'hybrid'"),
        ("auto", {"noise": False}, r"Radar\(radar, settings\)"),
        ("sbr", {"num_rays": 100}, "choose method 'auto' or 'raycast' or 'hybrid'"),
        ("sbr", {"channel_tolerance_db": 3.0}, "choose method 'auto'"),
        ("sbr", {"look_share": 0.1}, "choose method 'auto' or 'hybrid'"),
        ("raycast", {"tube_budget": 100}, "choose method 'auto'"),
        ("sionna", {"instances": ["ball"]}, "choose method 'raycast' or 'sbr'"),
        ("scatterers", {"num_rays": 100}, "raycast"),
        ("hybrid", {"tube_budget": 100}, "choose method 'auto'"),
    ],
)
def test_a_keyword_without_effect_is_refused(state, method: str, fields: dict, remedy: str) -> None:
    (name,) = fields
    with pytest.raises(ParameterRangeError, match=rf"^{name} = .*with method '{method}' settings of .*{remedy}"):
        solve_paths(state, RADAR, POSE, method, **fields)
    with pytest.raises(ParameterRangeError, match=f"^{name} = "):
        solve_paths(state, RADAR, POSE, settings=RadarSettings(method=method), **fields)


def test_so_are_settings_of_another_solver_and_keywords_of_a_plan(state) -> None:
    with pytest.raises(ParameterRangeError, match="AutoSettings"):
        solve_paths(state, RADAR, POSE, "auto", settings=ss.SbrSettings(max_phase=0.1))
    with pytest.raises(ParameterRangeError, match="AutoSettings"):
        plan_channel(state, RADAR, POSE, max_phase=0.1)
    with pytest.raises(ParameterRangeError, match="raycast"):
        ss.point_targets([[5, 0, 0]], [[0, 0, 0]], [1.0], RADAR, POSE, state=state, num_rays=100)


def test_whole_settings_warn_of_what_has_no_effect(state) -> None:
    settings = RadarSettings(sbr=ss.SbrSettings(edge_diffraction=True, max_phase=0.1), instances=("ball",))
    with pytest.warns(ScarlWarning, match=r"^instances, sbr.max_phase, sbr.edge_diffraction: no effect .*'auto'"):
        solve_paths(state, RADAR, POSE, settings=settings.with_(raycast={"num_rays": 2_000}))
    assert unread(settings.with_(sbr=ss.SbrSettings(reciprocal=False), instances=None)) == []  # crossed antennas
    assert unread(settings.with_(method="sbr")) == []
    assert unread(RadarSettings(method="hybrid", plan=PLAN, accuracy=ss.Accuracy(tube_budget=7))) == []  # planned by
    assert unread(settings.with_(method="raycast")) == ["sbr.max_phase", "sbr.edge_diffraction"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("quality", ["draft", "full"])
def test_presets_and_what_frames_read_are_without_a_warning(method: str, quality: str) -> None:
    settings = RadarSettings.preset(quality).changed(
        method, noise=False, cell_labels=False, synthesis_tolerance=1e-6, num_blocks=2, pane_share=0.5
    )
    assert unread(settings) == []


def test_the_settings_of_a_part_choose_its_method(state) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", ScarlWarning)
        few = solve_paths(state, RADAR, POSE, settings=ss.RaycastSettings(num_rays=20_000))
    assert few.diagnostics["method"] == "raycast"
    assert few.diagnostics["num_rays"] == pytest.approx(20_000, rel=0.01)  # whole rows and columns
