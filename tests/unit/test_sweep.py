"""Sweeps over seeds and fields, splits, and a plan that jobs share."""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.batch import ExportSettings, Sweep, estimate, export, one_call
from scarl_sionna.batch import plan as planning
from scarl_sionna.batch.plan import plan_export
from scarl_sionna.batch.sweep import parse_seeds
from scarl_sionna.cli.main import app
from scarl_sionna.cli.options import ScenarioOptions
from scarl_sionna.core.errors import ExportError, InputTypeError, ParameterRangeError, ScarlWarning, UnknownNameError
from scarl_sionna.dataset import open_dataset
from scarl_sionna.dataset.encoding import StoreOptions
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import contents, scenario_files


@pytest.mark.parametrize(
    ("text", "seeds"),
    [("0:4", (0, 1, 2, 3)), ("0:10:4", (0, 4, 8)), ("3,7,9", (3, 7, 9)), ("5", (5,)), ("0:2,9", (0, 1, 9))],
)
def test_seeds(text: str, seeds: tuple[int, ...]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "a", "3:1", "0:5:0", "-1", "0:1000000000", "1:2:3:4", "1.5"])
def test_seeds_that_are_none(text: str) -> None:
    with pytest.raises(ParameterRangeError, match="seeds"):
        parse_seeds(text)


def test_all_combinations_have_names_of_their_own() -> None:
    base = ScenarioSpec(scene="tunnel", name="x")
    grid = {"weather": ["rain", "clear"], "radar.raycast.num_rays": [1000, 5000]}
    drives = Sweep(range(3), grid).apply([base])
    assert len({drive.scene_name for drive in drives}) == len(drives) == 3 * 2 * 2
    assert drives[0].scene_name == "x_s000000_weather-rain_num_rays-1000"
    assert [drive.seed for drive in drives[::4]] == [0, 1, 2]
    assert {drive.radar.raycast.num_rays for drive in drives if drive.radar} == {1000, 5000}
    tables = Sweep((), {"weather": [{"rain_rate": 1.0}, {"rain_rate": 9.0}]}).apply([base])
    assert [drive.scene_name for drive in tables] == ["x_weather-0", "x_weather-1"]
    assert Sweep().apply([base]) == [base]


def test_what_cannot_be_swept() -> None:
    base = ScenarioSpec(scene="tunnel")
    with pytest.raises(UnknownNameError, match="unknown field of ScenarioSpec 'wether'"):
        Sweep((), {"wether": ["rain"]}).apply([base])
    with pytest.raises(ParameterRangeError, match="drives = 200000"):
        Sweep(range(100_000), {"variant": [0, 1]}).apply([base])
    with pytest.raises(ParameterRangeError, match="splits"):
        Sweep((), {}, (0.8, 0.1, 0.2))
    with pytest.raises(ParameterRangeError, match="one of them twice"):
        Sweep((1, 1))
    with pytest.raises(ParameterRangeError, match="values of weather = one of them twice"):
        Sweep((), {"weather": ["rain", "fog", "rain"]})


BASE = ScenarioSpec(scene="tunnel", name="x")


def swept(*texts: str) -> list[ScenarioSpec]:
    """Return the drives of ``--set`` with some texts."""
    single, grid = ScenarioOptions(further=texts).divided()
    return Sweep((), grid).apply([single.apply(BASE)])


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("weather={preset: rain, rain_rate: 3},{preset: rain, rain_rate: 30}", [3.0, 30.0]),
        ("weather=rain,{preset: rain, rain_rate: 30}", [10.0, 30.0]),
        ("weather={preset: rain, rain_rate: 3}, clear", [3.0, 0.0]),
        ("weather={preset: rain, rain_rate: 3}", [3.0]),
        ("weather=rain", [10.0]),
        ("weather.rain_rate=1, 2", [1.0, 2.0]),
    ],
)
def test_values_in_braces_are_several_too(text: str, values: list[float]) -> None:
    assert [drive.weather.rain_rate if drive.weather else 0.0 for drive in swept(text)] == values


def test_lists_and_quoted_texts_are_one_value() -> None:
    assert swept("radar.instances=[car, wall]")[0].radar.instances == ("car", "wall")  # type: ignore[union-attr]
    assert [drive.radar.instances for drive in swept("radar.instances=[car],[car, wall]") if drive.radar] == [
        ("car",),
        ("car", "wall"),
    ]
    assert swept("rig='a,b.yaml'")[0].rig == "a,b.yaml"


def test_the_time_of_day_is_set_as_in_a_file() -> None:
    assert swept("lighting.time_of_day=18:30") == swept('lighting={time_of_day: "18:30"}')
    late, noon = swept("lighting.time_of_day=20:30,12")
    assert late.lighting.headlamps and not noon.lighting.headlamps  # type: ignore[union-attr]
    cloudy = swept("lighting.cloud_cover=0.9", "lighting.time_of_day=20:30")[0]
    assert (cloudy.lighting.cloud_cover, cloudy.lighting.headlamps) == (0.9, True)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (("weather=rain,clear", "weather=fog"), "--set = weather twice is not allowed .*--set weather=a,b"),
        (("variant=1", " variant =2"), "variant twice"),
        (("weather=rain,rain",), "values of weather = one of them twice"),
        (("weather=[rain,clear]",), r"for a drive of each value: --set 'weather=rain,clear'"),
        (("weather={preset: rain",), "a value as in YAML"),
        (("lighting.day_of_year=172",), 'give all of it: --set .lighting={time_of_day: "18:30", day_of_year: 172}'),
        (("weather.preset=rain",), "set weather=rain"),
        (("lighting.time_of_day=25:00",), "is not a time of day"),
    ],
)
def test_what_set_refuses(texts: tuple[str, ...], message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        swept(*texts)


@pytest.mark.parametrize(
    ("fields", "radar", "text", "message"),
    [
        ({"weather": "rain"}, {}, "weather=fog", "--set = weather beside --weather is not allowed"),
        ({}, {"tolerance_db": 3.0}, "radar.accuracy.channel_tolerance_db=1,2", "beside --tolerance-db"),
    ],
)
def test_what_an_option_says_is_not_set_once_more(fields, radar, text: str, message: str) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ScenarioOptions(fields, radar, (text,)).divided()
    ScenarioOptions(dict.fromkeys(fields), dict.fromkeys(radar), (text,)).divided()


def test_splits_keep_variants_together_and_stay_when_seeds_are_added() -> None:
    base = ScenarioSpec(scene="tunnel", name="x")
    shares = (0.7, 0.2, 0.1)
    drives = Sweep(range(3000), {"weather": ["rain", "clear"]}, shares).apply([base])
    by_seed: dict[int, set[str]] = defaultdict(set)
    for drive in drives:
        by_seed[drive.seed].add(drive.split)
    assert all(len(splits) == 1 for splits in by_seed.values())
    counts = Counter(drive.split for drive in drives[::2])
    for split, share in zip(("train", "val", "test"), shares, strict=True):
        # binomial with n = 3000: five standard deviations
        assert abs(counts[split] - 3000 * share) < 5.0 * (3000 * share * (1.0 - share)) ** 0.5
    few = Sweep(range(10), {}, shares).apply([base])
    assert [{drive.split} for drive in few] == [by_seed[seed] for seed in range(10)]
    assert {drive.split for drive in Sweep(range(50), {}, (0.0, 1.0, 0.0)).apply([base])} == {"val"}


@pytest.fixture
def drive(tmp_path) -> ScenarioSpec:
    (path,) = scenario_files(tmp_path / "in", one=2)
    return ScenarioSpec.load(path)


def test_a_plan_is_computed_once(drive, tmp_path, monkeypatch) -> None:
    drives = Sweep(range(3)).apply([drive])
    plan_file, computed = tmp_path / "plan.json", []
    compute = planning.scene_configuration
    monkeypatch.setattr(planning, "scene_configuration", lambda one: computed.append(one.seed) or compute(one))
    plain = plan_export(drives, StoreOptions())
    assert computed == [0, 1, 2]
    for expected in ([0, 1, 2], []):
        computed.clear()
        assert plan_export(drives, StoreOptions(), plan_file=plan_file).dataset == plain.dataset
        assert computed == expected
    plan_export(Sweep(range(4)).apply([drive]), StoreOptions(), plan_file=plan_file)
    assert computed == [3]
    computed.clear()
    plan_export(Sweep((2,)).apply([drive.with_(frame_rate=20.0)]), StoreOptions(), plan_file=plan_file)
    assert computed == [2]  # of another scenario


def test_drives_with_the_same_noise_that_do_not_say_so_are_told(drive, tmp_path, recwarn) -> None:
    plain = {name: value for name, value in drive.to_dict().items() if name != "name"}
    (tmp_path / "drive.yaml").write_text(json.dumps(plain))
    unnamed = ScenarioSpec.load(tmp_path / "drive.yaml")
    named = unnamed.with_(name="drive")
    assert named.scene_name != unnamed.scene_name and named.noise_name == unnamed.noise_name == "drive"
    for others in ([named.with_(seed=5)], [named.with_(noise_of="drive")], [named.with_(name="other")]):
        plan_export([unnamed, *others], StoreOptions())
    assert not [item for item in recwarn if "noise" in str(item.message)]
    shown = rf"'{unnamed.scene_name}', 'drive' have the same noise: all of seed 0, and drawn by the name 'drive'"
    with pytest.warns(ScarlWarning, match=shown):
        plan_export([unnamed, named], StoreOptions())


def test_a_plan_of_other_versions_or_none_is_refused(drive, tmp_path) -> None:
    plan_file = tmp_path / "plan.json"
    plan_export([drive], StoreOptions(), plan_file=plan_file)
    data = json.loads(plan_file.read_text())
    plan_file.write_text(json.dumps({**data, "software": {"numpy": "0.1"}}))
    with pytest.raises(ParameterRangeError, match="versions that are installed now"):
        plan_export([drive], StoreOptions(), plan_file=plan_file)
    plan_file.write_text('{"format": []}')
    with pytest.raises(ParameterRangeError, match="a plan of an export"):
        plan_export([drive], StoreOptions(), plan_file=plan_file)


def test_jobs_with_one_plan_give_the_bytes_of_one_job(drive, tmp_path) -> None:
    drives = Sweep(range(2), {}, (0.5, 0.0, 0.5)).apply([drive])
    export(drives, tmp_path / "whole")
    for part in range(2):
        settings = ExportSettings(part=(part, 2), plan_file=tmp_path / "plan.json")
        export(drives, tmp_path / "parts", settings)
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


def test_files_that_changed_since_the_plan_stop_the_job(drive, tmp_path) -> None:
    plan_file = tmp_path / "plan.json"
    plan_export([drive], StoreOptions(), plan_file=plan_file)
    scene = Path(drive.scene).parent / "scene.toml"
    scene.write_text(scene.read_text().replace("10.0", "11.0", 1))
    with pytest.raises(ExportError, match="is not what the plan file says"):
        export([drive], tmp_path / "out", ExportSettings(plan_file=plan_file))


def test_the_forecast_counts_the_files(tmp_path) -> None:
    scenarios = [ScenarioSpec.load(path) for path in scenario_files(tmp_path / "in", one=3, two=1)]
    settings = ExportSettings(options=StoreOptions(shard_frames=2))
    forecast = estimate(plan_export(scenarios, settings.options), tmp_path / "out", settings)
    export(scenarios, tmp_path / "out", settings)
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file() and ".locks" not in path.parts]
    assert forecast.num_files == len(files)
    assert f"files:  {len(files)}" in str(forecast)


def test_the_command_sweeps(tmp_path) -> None:
    (path,) = scenario_files(tmp_path / "in", one=1)
    options = ["--seeds", "0:2", "--set", "frame_rate=10,50", "--splits", "0.5,0.5,0", "--plan", str(tmp_path / "p")]
    done = CliRunner().invoke(app, ["export", str(path), "--out", str(tmp_path / "out"), *options])
    assert done.exit_code == 0, done.output
    dataset = open_dataset(tmp_path / "out")
    assert len(dataset) == 4
    assert dataset.scenes == [f"one_s00000{seed}_frame_rate-{rate}" for seed in range(2) for rate in (10, 50)]
    wrong = CliRunner().invoke(app, ["demo", "--set", "weather=rain,clear", "--out", str(tmp_path / "demo")])
    assert wrong.exit_code == 2 and "only export takes several" in wrong.output


def test_progress_as_a_callback_and_as_a_bar(drive, tmp_path, capsys) -> None:
    seen: list[tuple[int, int]] = []
    one_call.export(drive, tmp_path / "called", on_progress=lambda done, total: seen.append((done, total)))
    assert seen == [(0, 2), (1, 2), (2, 2)]
    one_call.export(drive, tmp_path / "drawn", on_progress="bar")
    assert "2/2" in capsys.readouterr().out
    with pytest.raises(InputTypeError, match='a function or "bar"'):
        one_call.export(drive, tmp_path / "none", on_progress=3)  # type: ignore[arg-type]
