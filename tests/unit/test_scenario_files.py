"""Scenario files: what they hold, the same bytes from Python and YAML, and errors that name the line."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from scarl_sionna.core.errors import (
    ParameterRangeError,
    ScarlError,
    ScenarioError,
    ScenarioFileError,
    ScenarioKeyError,
    ScenarioNameError,
    ScenarioValueError,
    UnknownNameError,
)
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scenario.spec.actors import ActorSpec, EgoSpec, JitterSpec, RandomizationSpec, TrafficSpec
from scarl_sionna.scenario.spec.light import lighting_at, sun_at
from scarl_sionna.scenario.spec.motion import AccelerateSpec, BrakeSpec, RouteSpec, ShiftSpec, StaticSpec, WaypointsSpec
from scarl_sionna.scenario.spec.named import scenario_of
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

FULL = """\
scene: highway_guardrail
variant: 2
detail: light
duration: 3.0
frame_rate: 20.0
start_time: 0.5
seed: 7
name: cut_in
split: val
rig: front
lighting: night
weather: {preset: rain, rain_rate: 12.5}
ego:
  model: saloon
  variant: red
  trajectory: {kind: route, lanes: [east], start: 12.0, speed: 8.0}
actors:
  - name: other
    model: suv
    colors: {paint: [0.1, 0.2, 0.3]}
    detail: detailed
    trajectory:
      kind: route
      lanes: [east_2, east_3]
      offset: 0.2
      events:
        - {kind: accelerate, time: 1.0, speed: 14.0}
        - {kind: shift, time: 1.5, duration: 2.5, by: -3.5}
        - {kind: brake, time: 4, deceleration: 7.5}
  - name: man
    model: adult_man
    trajectory: {kind: waypoints, positions: [[0, -4], [0, 4, 0.1]], speed: 1.4, depart: 1.0}
  - {name: parked, model: van, trajectory: {kind: static, parking: 3, yaw_deg: 180}}
keep_default_actors: true
traffic: {density: 12, mix: {saloon: 2, lorry: 1}, pedestrians: 4, parked: 0.5}
randomization: {colors: true, placements: {along: 1.5}, traffic: false}
collisions: warn
"""


def full() -> ScenarioSpec:
    """Return the scenario of FULL, made in Python."""
    return ScenarioSpec(
        scene="highway_guardrail",
        variant=2,
        detail="light",
        num_frames=60,
        frame_rate=20.0,
        start_time=0.5,
        seed=7,
        name="cut_in",
        split="val",
        rig="front",
        lighting=Lighting.preset("night"),
        weather=Weather.preset("rain").with_(rain_rate=12.5),
        ego=EgoSpec(model="saloon", variant="red", trajectory=RouteSpec(lanes=("east",), start=12.0, speed=8.0)),
        actors=(
            ActorSpec(
                name="other",
                model="suv",
                colors={"paint": (0.1, 0.2, 0.3)},
                detail="detailed",
                trajectory=RouteSpec(
                    lanes=("east_2", "east_3"),
                    offset=0.2,
                    events=(
                        AccelerateSpec(time=1.0, speed=14.0),
                        ShiftSpec(time=1.5, duration=2.5, by=-3.5),
                        BrakeSpec(time=4.0, deceleration=7.5),
                    ),
                ),
            ),
            ActorSpec(
                name="man",
                model="adult_man",
                trajectory=WaypointsSpec(positions=((0.0, -4.0), (0.0, 4.0, 0.1)), speed=1.4, depart=1.0),
            ),
            ActorSpec(name="parked", model="van", trajectory=StaticSpec(parking=3, yaw_deg=180.0)),
        ),
        keep_default_actors=True,
        traffic=TrafficSpec(density=12.0, mix={"saloon": 2.0, "lorry": 1.0}, pedestrians=4, parked=0.5),
        randomization=RandomizationSpec(colors=True, placements=JitterSpec(along=1.5), traffic=False),
        collisions="warn",
    )


def write(folder: Path, text: str, name: str = "drive.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_noise_goes_by_the_name_of_the_drive_or_of_its_file(tmp_path) -> None:
    path = write(tmp_path, "scene: tunnel\n", "my drive.yaml")
    read = ScenarioSpec.load(path)
    assert read.noise_name == read.resolved().noise_name == pickle.loads(pickle.dumps(read)).noise_name == "my_drive"
    assert scenario_of(str(path)).noise_name == read.with_(seed=2).noise_name == "my_drive"
    assert read.with_(name="x").noise_name == "x" and read.with_(name="x", noise_of="y").noise_name == "y"
    assert ScenarioSpec(scene="tunnel").noise_name == "tunnel"
    for saved, noise in ((read, "rain"), (read.with_(noise_of=read.noise_name), "my_drive")):
        saved.save(tmp_path / "rain.yaml")
        assert ScenarioSpec.load(tmp_path / "rain.yaml").noise_name == noise


def test_python_and_yaml_say_the_same_in_the_same_bytes(tmp_path) -> None:
    read, made = ScenarioSpec.load(write(tmp_path, FULL)), full()
    assert read == made and hash(read) == hash(made)
    assert read.to_json() == made.to_json()
    read.save(tmp_path / "a.yaml")
    made.save(tmp_path / "b.yaml")
    assert (tmp_path / "a.yaml").read_bytes() == (tmp_path / "b.yaml").read_bytes()
    ScenarioSpec.load(tmp_path / "a.yaml").save(tmp_path / "c.yaml")
    assert (tmp_path / "a.yaml").read_bytes() == (tmp_path / "c.yaml").read_bytes()
    made.save(tmp_path / "a.json")
    assert ScenarioSpec.load(tmp_path / "a.json") == made


def test_a_scenario_goes_to_another_process_with_its_lines(tmp_path) -> None:
    scenario = ScenarioSpec.load(write(tmp_path, FULL))
    again = pickle.loads(pickle.dumps(scenario))
    assert again == scenario and again.place("actors", 1, "model").line == 31


def test_duration_is_the_other_way_to_say_the_number_of_frames() -> None:
    assert ScenarioSpec(duration=3.0, frame_rate=20.0).num_frames == 60
    assert (
        ScenarioSpec(duration=0.3, frame_rate=10.0).num_frames == 3
    )  # 0.3 * 10 is 3.0000000000000004 or 2.9999999999999996
    assert ScenarioSpec(duration=0.31, frame_rate=10.0).num_frames == 4  # frames at 0, 0.1, 0.2, 0.3 s
    assert ScenarioSpec(num_frames=7).duration == 0.7
    assert ScenarioSpec(num_frames=7).with_(duration=2.0).num_frames == 20
    assert ScenarioSpec(duration=7.0).with_(num_frames=2).duration == 0.2
    assert ScenarioSpec(duration=1.0) == ScenarioSpec(num_frames=10)
    with pytest.raises(ScenarioValueError, match="duration.*num_frames"):
        ScenarioSpec(duration=1.0, num_frames=10)


def test_default_actors_stay_unless_others_are_given() -> None:
    assert ScenarioSpec().keeps_actors
    assert not ScenarioSpec(traffic={"density": 3.0}).keeps_actors
    assert ScenarioSpec(traffic={"density": 3.0}, keep_default_actors=True).keeps_actors
    assert not ScenarioSpec(keep_default_actors=False).keeps_actors


def test_lighting_by_name_by_values_and_by_the_clock() -> None:
    assert ScenarioSpec(lighting="dusk").lighting == Lighting.preset("dusk")
    wet = ScenarioSpec(lighting={"preset": "dusk", "wetness": 0.5}).lighting
    assert wet == Lighting.preset("dusk").with_(wetness=0.5)
    assert ScenarioSpec(lighting={"turbidity": 4.0}).lighting == Lighting(turbidity=4.0)
    noon, evening, midnight = (ScenarioSpec(lighting={"time_of_day": hour}).lighting for hour in ("12:00", "18:30", 0))
    assert noon == lighting_at(12.0) and evening == lighting_at(18.5)
    assert noon.sun_elevation_deg > 35.0 > 5.0 > evening.sun_elevation_deg > midnight.sun_elevation_deg
    assert not noon.headlamps and evening.headlamps and midnight.street_lamps
    assert noon.exposure < evening.exposure < midnight.exposure
    assert noon.lit_windows == 0.0 < midnight.lit_windows < evening.lit_windows


def test_the_sun_stands_where_almanacs_have_it() -> None:
    # at noon the elevation is 90 - latitude + declination: 23.45 deg at the solstice, 0 at the equinox (Cooper: within
    # 0.4 deg)
    assert sun_at(12.0, 172, 50.0) == pytest.approx((63.45, 180.0), abs=0.01)
    assert sun_at(12.0, 80, 50.0) == pytest.approx((40.0, 180.0), abs=0.5)
    # at an equinox it rises in the east at 6 and sets in the west at 18, everywhere
    for latitude in (0.0, 35.0, 60.0):
        assert sun_at(6.0, 81, latitude) == pytest.approx((0.0, 90.0), abs=0.5)
        assert sun_at(18.0, 81, latitude) == pytest.approx((0.0, 270.0), abs=0.5)


def test_the_time_of_day_may_stand_without_quotes(tmp_path) -> None:
    path = write(tmp_path, "lighting: {time_of_day: 18:30}\nseed: 1_0\n".replace("1_0", "10"))
    assert ScenarioSpec.load(path).lighting == lighting_at(18.5)  # YAML 1.1 would read 1110


BAD = [
    ("scene: a\nsceen: b\n", ScenarioKeyError, 2, "sceen", "did you mean 'scene'"),
    ("scene: a\nduration: -2\n", ScenarioValueError, 2, "duration", "greater than 0 \\[s\\]"),
    ("frame_rate: 10 Hz\n", ScenarioValueError, 1, "frame_rate", "write 10: numbers are in Hz"),
    ("lighting: nigth\n", ScenarioNameError, 1, "lighting", "did you mean 'night'"),
    ("\nlighting:\n  preset: nigth\n", ScenarioNameError, 3, "lighting.preset", "did you mean 'night'"),
    ("lighting:\n  time_of_day: 25:00\n", ScenarioValueError, 2, "lighting.time_of_day", "time of day"),
    ("lighting:\n  time_of_day: 12:00\n  wet: 1\n", ScenarioKeyError, 3, "lighting.wet", "wetness"),
    ("weather:\n  rain_rate: heavy\n", ScenarioValueError, 2, "weather.rain_rate", "a number \\[mm/h\\]"),
    ("weather:\n  preset: rainn\n", ScenarioNameError, 2, "weather.preset", "did you mean 'rain'"),
    ("ego:\n  modle: van\n", ScenarioKeyError, 2, "ego.modle", "did you mean 'model'"),
    ("ego:\n  trajectory:\n    kind: rout\n", ScenarioValueError, 3, "ego.trajectory.kind", "did you mean 'route'"),
    ("ego:\n  trajectory:\n    lanes: [a]\n", ScenarioKeyError, 2, "ego.trajectory", "lacks `kind`"),
    (
        "ego:\n  trajectory: {kind: route, lanes: [a],\n    speed: 50 km/h}\n",
        ScenarioValueError,
        3,
        "ego.trajectory.speed",
        "write 13.8889: numbers are in m/s",
    ),
    (
        "actors:\n  - model: van\n    trajectory: {kind: static, parking: 0}\n",
        ScenarioKeyError,
        2,
        "actors[0].name",
        "is missing",
    ),
    (
        "actors:\n  - {name: a, model: van, trajectory: {kind: static, parking: 0}}\n  - name: a\n    model: van\n"
        "    trajectory: {kind: static, parking: 1}\n",
        ScenarioValueError,
        3,
        "actors[1].name",
        "another actor",
    ),
    (
        "actors:\n- name: a\n  model: van\n  trajectory:\n    kind: route\n    lanes: [x]\n    events:\n"
        "    - {kind: brake, time: 1}\n    - {kind: shift, time: soon, by: 3}\n",
        ScenarioValueError,
        9,
        "actors[0].trajectory.events[1].time",
        "a number \\[s\\]",
    ),
    (
        "actors:\n- name: a\n  model: van\n  trajectory:\n    kind: waypoints\n    speed: "
        "3\n    positions:\n    - [0, 0]\n"
        "    - [1, east]\n",
        ScenarioValueError,
        9,
        "actors[0].trajectory.positions[1][1]",
        "a number \\[m\\]",
    ),
    (
        "actors:\n- name: a\n  model: van\n  mesh: {file: a.ply}\n  trajectory: {kind: static, parking: 0}\n",
        ScenarioValueError,
        2,
        "actors[0]",
        "one of `model`, `mesh` and `body`",
    ),
    ("traffic:\n  density: 10\n  source: fcd\n", ScenarioValueError, 1, "traffic", "`file`"),
    (
        "randomization:\n  placements:\n    along: -1\n",
        ScenarioValueError,
        3,
        "randomization.placements.along",
        "0 \\[m\\]",
    ),
    ("seed: 1\nscene: a\nseed: 2\n", ScenarioKeyError, 3, "seed", "first in line 1"),
    ("1: 2\n", ScenarioKeyError, 1, "1", "keys are words"),
    ("- 1\n", ScenarioValueError, 1, "", "no mapping"),
    ("scene: a\nactors: [\n", ScenarioFileError, 3, "", "not valid YAML"),
    ("scene: a\n\tseed: 1\n", ScenarioFileError, 2, "", "not valid YAML"),
    ("actors: &a [*a]\n", ScenarioFileError, 1, "", "not valid YAML"),
]


@pytest.mark.parametrize(("text", "kind", "line", "key", "message"), BAD, ids=[row[3] or row[4] for row in BAD])
def test_a_bad_file_is_refused_at_its_line(tmp_path, text, kind, line, key, message) -> None:
    path = write(tmp_path, text)
    with pytest.raises(kind, match=message) as caught:
        ScenarioSpec.load(path)
    error = caught.value
    assert isinstance(error, ScenarioError) and isinstance(error, ParameterRangeError)
    assert (error.line, error.key, error.file) == (line, key, str(path))
    assert error.column >= 1
    assert f"drive.yaml, line {line}" in str(error)


def test_names_are_name_errors_that_keep_what_is_known(tmp_path) -> None:
    with pytest.raises(UnknownNameError) as caught:
        ScenarioSpec.load(write(tmp_path, "lighting: nigth\n"))
    assert caught.value.kind == "lighting" and "night" in caught.value.known


def test_all_that_is_wrong_is_told_at_once_in_the_order_of_the_lines(tmp_path) -> None:
    text = (
        "weather: {rain: 3}\nscene: a\nego:\n  modle: van\nactors:\n- name: 3b\n  model: van\n  trajectory: "
        "{kind: static}\nspeed: 3\n"
    )
    with pytest.raises(ScenarioError) as caught:
        ScenarioSpec.load(write(tmp_path, text))
    error = caught.value
    assert [(one.line, one.key) for one in error.problems] == [
        (1, "weather.rain"),
        (4, "ego.modle"),
        (6, "actors[0].name"),
        (8, "actors[0].trajectory"),
        (9, "speed"),
    ]
    assert error is error.problems[0]
    assert "5 problems" in str(error) and all(one.text in str(error) for one in error.problems)


def test_a_file_that_is_not_there(tmp_path) -> None:
    with pytest.raises(ScenarioFileError, match="scenario file = .* cannot be read"):
        ScenarioSpec.load(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioFileError, match="scenario file = .* cannot be read"):
        ScenarioSpec.load(tmp_path / "binary.yaml")


def test_a_scenario_made_in_python_names_the_key() -> None:
    with pytest.raises(ScenarioKeyError, match="scenario: actors\\[0\\].trajectory.lane: unknown key 'lane'") as caught:
        ScenarioSpec(actors=[{"name": "a", "model": "van", "trajectory": {"kind": "route", "lanes": ["x"], "lane": 3}}])
    assert caught.value.file is None and caught.value.line is None


def test_anchors_and_merged_keys_keep_their_lines(tmp_path) -> None:
    text = (
        "actors:\n- &a\n  name: a\n  model: van\n  trajectory: {kind: static, parking: 0}\n- <<: *a\n  name: b\n  "
        "colour: 3\n"
    )
    with pytest.raises(ScenarioKeyError) as caught:
        ScenarioSpec.load(write(tmp_path, text))
    assert (caught.value.line, caught.value.key) == (8, "actors[1].colour")


def test_changed_keys_lose_their_lines(tmp_path) -> None:
    scenario = ScenarioSpec.load(write(tmp_path, FULL))
    assert scenario.place("rig").line == 10
    changed = scenario.with_(rig="scarl")
    assert changed.place("rig").line is None and changed.place("seed").line == 7


def test_files_are_found_beside_the_scenario(tmp_path, monkeypatch) -> None:
    (tmp_path / "tables").mkdir()
    write(tmp_path, "x", "tables/a.csv")
    scenario = ScenarioSpec.load(write(tmp_path, "seed: 1\n"))
    monkeypatch.chdir("/")
    assert scenario.find("tables/a.csv").read_text() == "x"
    assert ScenarioSpec().find("a.csv") == Path("a.csv")


def test_every_error_is_one_of_the_projects() -> None:
    assert issubclass(ScenarioError, ScarlError)
