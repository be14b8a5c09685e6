"""Every number of the radar settings names its chart, goes through every door, and enters a dataset's fingerprint."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, get_args

import pytest

import scarl_sionna as ss
from scarl_sionna.cli.options import ScenarioOptions
from scarl_sionna.core.errors import ScarlError
from scarl_sionna.core.settings.auto import SbrLevel
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.core.spec import Spec
from scarl_sionna.fusion import Rig
from scarl_sionna.radar.channel.compose.choose import level_of
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import RIG

REASONS = (
    r"docs/\w+\.md|not charted|changes no result|None: once a frame|half of the longest length|is an error|"
    r"as in SbrSettings"
)
"""What a description must say: a chart, that there is none, or why the number is no trade."""
OF_A_KIND = {"seed", "num_tubes", "pane_directions"}
"""Choices of randomness, parts whose class cites the chart, and a count that is asked for."""


def numbers(kind: type[Spec], path: str = "") -> Iterator[tuple[str, str]]:
    """Yield the paths of the numeric fields of settings and of their parts, with what is said of each."""
    for name, info in kind.model_fields.items():
        inner = info.annotation
        if isinstance(inner, type) and issubclass(inner, Spec):
            yield from numbers(inner, f"{path}{name}.")
        elif {int, float} & {inner, *get_args(inner)} and inner is not bool:
            yield f"{path}{name}", info.description or ""


@pytest.mark.parametrize(("path", "text"), list(numbers(RadarSettings)))
def test_every_number_cites_its_chart(path: str, text: str) -> None:
    assert path.rpartition(".")[2] in OF_A_KIND or re.search(REASONS, text), (path, text)


NEW = {
    "auto.too_near": 2.5,
    "auto.carrier_near": 2.5,
    "auto.mirror_classes": ["Wall"],
    "mirrors.max_mirrors": 3,
    "raycast.cells_per_resolution": 1.0,
    "weather_echoes.num_points": 700,
    "warn_at.pane_share": 0.5,
}


def read(settings: Any, path: str) -> Any:
    for name in path.split("."):
        settings = getattr(settings, name)
    return list(settings) if isinstance(settings, tuple) else settings


@pytest.mark.parametrize(("path", "value"), NEW.items())
def test_every_door_leads_to_the_same_rig(path: str, value: Any, tmp_path) -> None:
    shown = str(value).replace("'", "")
    spec = ScenarioOptions(further=(f"radar.{path}={shown}",)).apply(ScenarioSpec())
    assert spec.radar is not None and read(spec.radar, path) == value
    nested: Any = value
    for name in reversed(path.split(".")):
        nested = {name: nested}
    assert RadarSettings(**nested) == spec.radar
    spec.save(tmp_path / "drive.yaml")
    assert ScenarioSpec.load(tmp_path / "drive.yaml").radar == spec.radar
    rig = RIG.with_radar(spec.radar)
    radar = "front/radar"
    assert read(rig[radar].settings, path) == value
    assert rig.to_dict() != RIG.to_dict()  # what a dataset's fingerprint is made of
    assert Rig.from_dict(rig.to_dict())[radar].settings == rig[radar].settings


def test_an_own_level_takes_the_error_of_bounces_that_was_measured_at_its_tolerance() -> None:
    level = SbrLevel(tolerance_db=6.0, max_phase=1.0, integration_phase=0.1, edge_share=0.25, max_depth=2)
    found = [level.with_(tolerance_db=db).error_of_bounces for db in (20.0, 6.0, 4.0, 3.0, 1.0, 0.5, 0.3, 0.1)]
    assert found == [1.0, 1.0, 1.0, 0.06, 0.05, 0.05, 0.02, 0.02]
    assert level.with_(bounce_error=0.0).error_of_bounces == 0.0
    assert SbrLevel(**level.with_(tolerance_db=3.0).model_dump()).error_of_bounces == 0.06


def test_levels_fall_and_what_is_finer_than_the_last_is_refused() -> None:
    level = SbrLevel(tolerance_db=1.0, max_phase=1.0, integration_phase=0.1, edge_share=0.25, max_depth=2)
    with pytest.raises(ScarlError, match="fall"):
        ss.AutoSettings(levels=(level.with_(tolerance_db=0.5), level))
    with pytest.raises(ScarlError, match="fall"):
        ss.AutoSettings(levels=())
    rules = ss.AutoSettings(levels=(level, level.with_(tolerance_db=0.5, max_phase=0.3)))
    assert [level_of(tolerance, rules).max_phase for tolerance in (5.0, 1.0, 0.9)] == [1.0, 1.0, 0.3]
    with pytest.raises(ScarlError, match="at least 0.5 dB"):
        level_of(0.4, rules)
