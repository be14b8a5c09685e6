"""Light and weather that change during a drive: every sensor sees those of its time, to the byte."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ParameterRangeError, ScenarioNameError, ScenarioValueError
from scarl_sionna.core.specs.conditions import Conditions
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.dataset.statistics.groups import weather_name
from scarl_sionna.fusion import Rig
from scarl_sionna.scenario.spec.light import lighting_at
from tests import exports
from tests.weather_street import street

pytestmark = pytest.mark.filterwarnings("ignore:the echo of 90 %")
FOG, RAIN, NIGHT = Weather.preset("fog"), Weather(rain_rate=30.0), Lighting.preset("night")
RIG = Rig("front", tuple(replace(one, vehicle_from_sensor=ss.Pose([2.5, 0.0, 1.0])) for one in exports.RIG.sensors))
CHANGES = (Conditions(time=1.0, weather=FOG), Conditions(time=2.0, lighting=NIGHT, weather=RAIN))


@pytest.fixture(scope="module")
def dry(tmp_path_factory):
    return street(tmp_path_factory.mktemp("street")).with_lighting("day")


def bytes_of(world, time):
    frame = ss.observe(world, RIG, time, seed=3)
    image, scan, radar = (frame.results[f"front/{kind}"] for kind in ("camera", "lidar", "radar"))
    return [np.ascontiguousarray(one).tobytes() for one in (image.rgb, scan.intensity, radar.adc)]


def test_sensors_see_the_conditions_of_their_time(dry) -> None:
    """A frame has the bytes of a world in which the conditions of its time hold all the time, in any order."""
    world = dry.with_changes(CHANGES)
    fixed = {0.99: dry, 1.0: dry.with_weather(FOG), 2.0: dry.with_lighting(NIGHT).with_weather(RAIN)}
    seen = {time: bytes_of(world, time) for time in (2.0, 0.99, 1.0)}
    for time, other in fixed.items():
        assert seen[time] == bytes_of(other, time), time
    assert all(a != b for a, b in zip(bytes_of(dry, 1.0), seen[1.0], strict=True))  # and each sensor sees the fog


def test_one_optical_twin_is_kept(dry) -> None:
    world = dry.with_changes(CHANGES)
    states = [world.at(time) for time in (0.5, 1.5, 2.5)]
    for state in states:
        state.optical_scene()
    last = world.at(2.6).world
    assert last is states[-1].world
    assert [bool(state.world._twins.get("optical")) for state in (*states[1:-1], world.at(2.6))] == [True, True]
    world.at(1.5)
    assert "optical" not in last._twins


def test_what_changes_no_surface_and_no_light_keeps_the_optical_twin(dry) -> None:
    world = dry.with_changes([Conditions(time=1.0, weather=Weather(wind=(4.0, 0.0)))])
    first = world.at(0.5).world.twin("optical")
    later = world.at(1.5).world
    assert later.weather.wind == (4.0, 0.0) and later._twins["optical"] is first


def test_a_world_that_is_changed_keeps_what_still_holds(dry) -> None:
    world = dry.with_changes(CHANGES)
    night = world.with_lighting("night")
    assert [one.time for one in night.changes] == [1.0, 2.0]
    assert night.at(2.5).world.weather == RAIN and night.at(0.5).world.lighting.sun_elevation_deg < 0.0
    assert world.with_weather("snow").at(2.5).world.weather.snow_rate > 0.0
    moved = world.with_motion({"car_ahead": dry.actor("car_ahead").trajectory})
    assert moved.at(1.5).world.weather == FOG
    assert "2: at 1 s, 2 s" in str(world)
    with pytest.raises(ParameterRangeError, match=r"1 s after 2 s.*times that rise"):
        dry.with_changes(CHANGES[::-1])


def test_a_scenario_states_changes() -> None:
    drive = ss.ScenarioSpec(
        changes=[{"time": 2.0, "weather": "rain"}, {"time": 5.0, "lighting": {"time_of_day": "18:30"}}]
    )
    assert ss.ScenarioSpec(**drive.to_dict()) == drive
    assert drive.changes[0].weather == Weather.preset("rain")
    assert drive.changes[1].lighting == lighting_at(18.5)
    with pytest.raises(ScenarioValueError, match=r"changes\[1\].time = 2 s does not come after"):
        ss.ScenarioSpec(changes=[{"time": 2.0, "weather": "rain"}] * 2)
    with pytest.raises(ScenarioValueError, match=r"changes\[0\].*a lighting, a weather or both"):
        ss.ScenarioSpec(changes=[{"time": 2.0}])
    with pytest.raises(ScenarioNameError, match=r"changes\[0\].weather: unknown weather 'rian'"):
        ss.ScenarioSpec(changes=[{"time": 2.0, "weather": "rian"}])


def test_statistics_count_the_weather_of_each_frame() -> None:
    stored = ss.ScenarioSpec(
        weather="fog", changes=[{"time": 2.0, "lighting": "night"}, {"time": 3.0, "weather": {"rain_rate": 7.0}}]
    ).to_dict()
    assert [weather_name(stored, time) for time in (0.0, 2.5, 3.0)] == ["fog", "fog", "rain 7 mm/h"]
