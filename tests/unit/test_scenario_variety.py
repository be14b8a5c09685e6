"""A seed draws variant, hour, day and weather of a scenario: the same in every process, each by itself, counted."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ScenarioError
from scarl_sionna.core.specs.weather import WEATHER_PRESETS, Weather
from scarl_sionna.scenario.drawn import drawn, drawn_text, num_distinct
from scarl_sionna.scenario.spec.light import lighting_at
from scarl_sionna.scenario.spec.scenario import ScenarioSpec

DRAWS = {"variant": 20, "hour": ["06:00", "21:59"], "weather": {"clear": 3, "rain": 1}}


def spec(seed: int = 0, **randomization: object) -> ScenarioSpec:
    return ScenarioSpec(scene="roundabout", seed=seed, num_frames=2, randomization=randomization or DRAWS)


def test_values_stand_in_place_of_the_ranges() -> None:
    one, found = drawn(spec(3))
    assert one.variant == found["variant"] in range(20)
    hours, minutes = map(int, found["hour"].split(":"))
    assert 6 <= hours < 22
    assert one.lighting == lighting_at(hours + minutes / 60.0)
    assert one.weather == Weather.preset(found["weather"])
    assert drawn(one) == (one, {}) and one.randomization.variant is None
    assert drawn(spec(3)) == (one, found)
    plain = ScenarioSpec(scene="roundabout", seed=3)
    assert drawn(plain)[0] is plain


def test_another_process_draws_the_same() -> None:
    code = (
        "import json; from tests.unit.test_scenario_variety import spec; from scarl_sionna.scenario.drawn import drawn;"
        "print(json.dumps([drawn(spec(seed))[1] for seed in range(5)]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [drawn(spec(seed))[1] for seed in range(5)]


def test_one_draw_does_not_change_another() -> None:
    for seed in range(20):
        whole = drawn(spec(seed))[1]
        for name, value in DRAWS.items():
            assert drawn(spec(seed, **{name: value}))[1] == {name: whole[name]}


def test_draws_have_the_stated_shares() -> None:
    """1,000 seeds; 5 standard deviations of a binomial number."""
    count = 1000
    found = [drawn(spec(seed))[1] for seed in range(count)]
    variants = Counter(one["variant"] for one in found)
    assert set(variants) == set(range(20))
    assert all(abs(n - count / 20) < 5.0 * np.sqrt(count / 20 * 0.95) for n in variants.values())
    rain = sum(one["weather"] == "rain" for one in found)
    assert abs(rain - count / 4) < 5.0 * np.sqrt(count * 3 / 16)
    hours = np.array([int(one["hour"][:2]) for one in found])
    assert set(hours) == set(range(6, 22))
    assert np.abs(np.bincount(hours, minlength=24)[6:22] - count / 16).max() < 5.0 * np.sqrt(count / 16)


@pytest.mark.parametrize(
    ("randomization", "count"),
    [
        (DRAWS, 20 * 960 * 2),
        ({"variant": "draw"}, 100),
        ({"variant": [3, 5, 9]}, 3),
        ({"hour": "draw"}, 1440),
        ({"hour": ["22:00", "02:00"]}, 241),
        ({"hour": [12, 12]}, 1),
        ({"hour": [6, 7], "day_of_year": [172, 181]}, 61 * 10),
        ({"hour": [12, 12], "day_of_year": [335, 59]}, 90),
        ({"weather": True}, len(WEATHER_PRESETS)),
        ({}, 1),
    ],
)
def test_the_number_of_combinations_is_exact(randomization: dict, count: int) -> None:
    """The stated number, and for the small ones that of what is found."""
    one = ScenarioSpec(scene="roundabout", randomization=randomization)
    assert num_distinct(one) == count
    if 1 < count <= 100:
        kinds = {json.dumps(drawn(one.with_(seed=seed))[1]) for seed in range(12 * count)}
        assert len(kinds) == count


def test_hours_through_midnight() -> None:
    hours = {int(drawn(spec(seed, hour=["23:00", "01:00"]))[1]["hour"][:2]) for seed in range(200)}
    assert hours == {23, 0, 1}


def test_values_of_a_weather_between_two() -> None:
    found = [
        drawn(spec(seed, weather=["clear", {"preset": "rain", "rain_rate": [2.0, 50.0], "share": 3}]))[1]["weather"]
        for seed in range(2000)
    ]
    rates = np.array([one["rain_rate"] for one in found if one != "clear"])
    assert abs(len(rates) - 1500) < 5.0 * np.sqrt(375)
    assert 2.0 <= rates.min() < 2.1 and 47.0 < rates.max() <= 50.0
    assert np.mean(rates < 10.0) == pytest.approx(0.5, abs=5 * 0.5 / np.sqrt(1500))  # evenly in the logarithm


def test_ranges_move_no_other_draw() -> None:
    """Neither another range of hours the day, nor a range of the rain the visibility."""
    fog = {"preset": "clear", "visibility": [100, 1000]}
    for seed in range(20):
        days = {drawn(spec(seed, hour=hours, day_of_year=[1, 365]))[1]["day_of_year"] for hours in ([12, 12], [6, 22])}
        assert len(days) == 1
        sights = {
            drawn(spec(seed, weather=[one]))[1]["weather"]["visibility"] for one in (fog, {**fog, "rain_rate": [1, 50]})
        }
        assert len(sights) == 1


def test_days_through_the_new_year() -> None:
    days = {drawn(spec(seed, hour=[12, 12], day_of_year=[363, 2]))[1]["day_of_year"] for seed in range(100)}
    assert days == {363, 364, 365, 1, 2}
    days = {drawn(spec(seed, hour=[12, 12], day_of_year=[366, 2]))[1]["day_of_year"] for seed in range(100)}
    assert days == {366, 1, 2}


def test_the_sun_of_a_drawn_hour_is_that_of_the_place() -> None:
    place = {"latitude_deg": -33.0, "north_deg": 0.0}
    light = drawn(spec(hour=[12, 12], day_of_year=[172, 172], **place))[0].lighting
    assert light == lighting_at(12.0, 172, **place) and light.sun_elevation_deg == pytest.approx(33.6, abs=0.1)


def test_what_else_the_light_states_stays() -> None:
    one = ScenarioSpec(lighting={"cloud_cover": 0.7, "turbidity": 5.0}, randomization={"hour": ["12:00", "12:00"]})
    light, noon = drawn(one)[0].lighting, lighting_at(12.0)
    assert light is not None and (light.cloud_cover, light.turbidity) == (0.7, 5.0)
    assert (light.sun_elevation_deg, light.exposure) == (noon.sun_elevation_deg, noon.exposure)


def test_the_line_of_the_command_counts_them() -> None:
    assert drawn_text([ScenarioSpec()]) == ""
    text = drawn_text([spec(3)])
    assert text.startswith("seed 3 draws variant ") and text.endswith("one of 38,400 combinations")
    kinds = {json.dumps(drawn(spec(seed))[1]) for seed in range(100)}
    assert f"{len(kinds)} distinct combinations of 38,400" in drawn_text([spec(seed) for seed in range(100)])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("variant: 3\nrandomization: {variant: draw}", "stands beside `randomization.variant`"),
        ("weather: rain\nrandomization: {weather: draw}", "stands beside `randomization.weather`"),
        ("lighting: {time_of_day: '12:00', latitude_deg: -33}\nrandomization: {hour: [10, 11]}", "which draws the sun"),
        ("randomization: {variant: 1}", "variant"),
        ("randomization: {hour: [5, 25]}", "hour"),
        ("randomization: {hour: 5}", "hour"),
        ("randomization: {day_of_year: [1, 9]}", "an `hour` with a `day_of_year`"),
        ("randomization: {weather: [hail]}", "unknown weather 'hail'"),
        ("randomization: {weather: [{preset: rain, rain_rate: [9, 3]}]}", "smaller to a larger"),
        ("randomization: {weather: [{preset: snow, rain_rate: [1, 300]}]}", "rain_rate"),
        ("randomization: {weather: []}", "weather"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_its_line(tmp_path, text: str, said: str) -> None:
    file = tmp_path / "one.yaml"
    file.write_text(text + "\n")
    with pytest.raises(ScenarioError, match=said) as caught:
        ScenarioSpec.load(file)
    assert caught.value.problems[0].line in (1, 2)


def test_a_drive_is_built_and_kept_with_what_was_drawn(tmp_path) -> None:
    """World, configuration of the dataset, and the file of the scenario, which keeps the ranges."""
    from scarl_sionna.batch.plan import scene_configuration
    from scarl_sionna.scenario.compose import compose

    one = spec(seed=2, variant=[0, 1], hour=["06:00", "21:59"], weather={"clear": 3, "rain": 1})
    found = drawn(one)[1]
    composition = compose(one)
    assert composition.document.info["drawn"] == found == composition.drawn
    stated = scene_configuration(one)
    assert stated["drawn"] == found and stated.get("variant", 0) == found["variant"]
    assert stated["lighting"]["sun_elevation_deg"] == composition.spec.lighting.sun_elevation_deg
    one.save(tmp_path / "one.yaml")
    assert ScenarioSpec.load(tmp_path / "one.yaml") == one
    assert "drawn" not in scene_configuration(ScenarioSpec(scene="roundabout", num_frames=2))


def test_the_example_draws_and_the_page_counts_it() -> None:
    """`examples/varied_drive.yaml`; the line of the command stands on docs/scenarios.md."""
    root = Path(__file__).parents[2]
    example = ScenarioSpec.load(root / "examples" / "varied_drive.yaml")
    assert num_distinct(example) == 100 * 1080 * 365 * 4
    text = drawn_text([example.with_(seed=seed) for seed in range(1000)])
    assert text in (root / "docs" / "scenarios.md").read_text()
