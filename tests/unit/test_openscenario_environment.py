"""Light and weather that a storyboard changes during its run, held to the instants at which it does so."""

from __future__ import annotations

import warnings

import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScenarioError
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scenario.spec.light import lighting_at
from tests import openscenario_files as files


def environment(inside: str) -> str:
    return (
        f'<GlobalAction><EnvironmentAction><Environment name="e">{inside}</Environment></EnvironmentAction>'
        "</GlobalAction>"
    )


def clock(text: str, goes_on: bool = False) -> str:
    return f'<TimeOfDay animation="{str(goes_on).lower()}" dateTime="2024-06-21T{text}"/>'


def sky(inside: str, more: str = "") -> str:
    return f"<Weather{more}>{inside}</Weather>"


def fall(kind: str, rate: float) -> str:
    return f'<Precipitation precipitationType="{kind}" precipitationIntensity="{rate!r}"/>'


def loaded(
    folder, first: str, *events: tuple[float | str, str], stop: float = 10.0, speed: float = 10.0
) -> ss.ScenarioSpec:
    """Return a drive along +x from 20 m on; each event has its trigger, or the time of it [s]."""
    group = files.group(
        "",
        *(
            files.event(action, files.after(when) if isinstance(when, float) else when, f"event_{number}")
            for number, (when, action) in enumerate(events)
        ),
    )
    actions = first + files.init("Ego", files.on_lane(20.0), speed)
    path = files.written(folder, files.scenario(files.vehicle("Ego"), actions, group if events else "", stop))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # friction has no effect
        return ss.ScenarioSpec.load(path)


def test_weather_changes_when_the_storyboard_says(tmp_path) -> None:
    """Fog stays while it begins to rain at 120 m, reached after 10 s; what is not stated again stays as it was."""
    reached = files.of_entity("Ego", '<TraveledDistanceCondition value="100"/>')
    found = loaded(
        tmp_path,
        environment(sky('<Fog visualRange="300"/>')),
        (reached, environment(sky(fall("rain", 12.0)) + '<RoadCondition frictionScaleFactor="1" wetness="moist"/>')),
        (14.0, environment(sky('<Fog visualRange="90000"/>' + fall("dry", 0.0)))),
        stop=20.0,
    )
    assert found.weather == Weather(visibility=300.0) and found.lighting is None
    assert [one.time for one in found.changes] == pytest.approx([10.0, 14.0], abs=1e-5)
    assert found.changes[0].weather == Weather(visibility=300.0, rain_rate=12.0, wetness=0.3)
    assert found.changes[1].weather == Weather(wetness=0.3)
    assert all(one.lighting is None for one in found.changes)


def test_the_time_of_day_is_another_one_from_a_time_on(tmp_path) -> None:
    """Clouds that were stated stay; what is stated within a millisecond of the start is that of the start."""
    found = loaded(
        tmp_path,
        environment(clock("12:00:00") + sky("", ' fractionalCloudCover="eightOktas"')),
        (0.0, environment(clock("13:00:00"))),
        (3.0, environment(clock("22:30:00"))),
    )
    assert found.lighting == lighting_at(13.0, 173, cloud_cover=1.0)
    assert [one.time for one in found.changes] == pytest.approx([3.0], abs=1e-5)
    assert found.changes[0].lighting == lighting_at(22.5, 173, cloud_cover=1.0)
    assert found.changes[0].weather is None


def test_light_follows_a_clock_that_goes_on_in_steps_of_a_minute(tmp_path) -> None:
    """From 20:00:30 at the start: at 60 s it is 20:01:30, at 120 s 20:02:30; one that stands changes nothing."""
    found = loaded(tmp_path, environment(clock("20:00:30", True)), stop=150.0, speed=2.0)
    assert [one.time for one in found.changes] == [60.0, 120.0]
    for minutes, light in enumerate((found.lighting, *(one.lighting for one in found.changes))):
        assert light == lighting_at(20.0 + (minutes + 0.5) / 60.0, 173)
    assert loaded(tmp_path, environment(clock("20:00:30")), stop=150.0, speed=2.0).changes == ()


def test_snow_needs_frost_whenever_it_begins(tmp_path) -> None:
    warm = environment(sky("", ' temperature="293.15"'))
    with pytest.raises(ScenarioError, match="snow at 20 degrees Celsius") as told:
        loaded(tmp_path, warm, (2.0, environment(sky(fall("snow", 1.0)))))
    assert told.value.line
    cold = loaded(tmp_path, "", (2.0, environment(sky(fall("snow", 1.0)))))
    assert cold.weather is None
    assert cold.changes[0].weather == Weather(snow_rate=1.0, temperature_celsius=0.0)


def test_what_begins_after_the_end_is_no_change(tmp_path) -> None:
    assert loaded(tmp_path, "", (12.0, environment(sky('<Fog visualRange="90"/>')))).changes == ()


def test_a_catalog_of_another_name_is_found_by_its_file(tmp_path) -> None:
    """As esmini's own catalog of environments, which is called VehicleCatalog inside."""
    (tmp_path / "places").mkdir()
    (tmp_path / "places" / "EnvironmentCatalog.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="" author=""/>'
        f'<Catalog name="VehicleCatalog"><Environment name="wet">{sky(fall("rain", 8.0))}</Environment></Catalog>'
        "</OpenSCENARIO>"
    )
    reference = '<CatalogReference catalogName="EnvironmentCatalog" entryName="wet"/>'
    action = f"<GlobalAction><EnvironmentAction>{reference}</EnvironmentAction></GlobalAction>"
    text = files.scenario(
        files.vehicle("Ego"),
        files.init("Ego", files.on_lane(20.0), 5.0),
        files.group("", files.event(action, files.after(2.0))),
        catalogs='<EnvironmentCatalog><Directory path="places"/></EnvironmentCatalog>',
    )
    with pytest.warns(match="is called 'VehicleCatalog', and taken for 'EnvironmentCatalog' by the name of its file"):
        found = ss.ScenarioSpec.load(files.written(tmp_path, text))
    assert [one.weather for one in found.changes] == [Weather(rain_rate=8.0)]
