"""ScenarioSpec: instants, files, and what it refuses."""

from __future__ import annotations

import pytest

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scenario.spec.scenario import ScenarioSpec


def test_times_start_at_the_start_and_follow_the_frame_rate() -> None:
    assert ScenarioSpec(num_frames=3, frame_rate=20.0, start_time=1.0).times == (1.0, 1.05, 1.1)


@pytest.mark.parametrize("suffix", ["yaml", "json"])
def test_a_file_gives_the_scenario_back(tmp_path, suffix) -> None:
    scenario = ScenarioSpec(
        scene="street_canyon", rig="scarl", num_frames=7, frame_rate=12.5, seed=2**40, quality="full"
    )
    scenario.save(tmp_path / f"s.{suffix}")
    assert ScenarioSpec.load(tmp_path / f"s.{suffix}") == scenario


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"num_frames": 0}, "num_frames"),
        ({"num_frames": -3}, "num_frames"),
        ({"frame_rate": 0.0}, "frame_rate"),
        ({"frame_rate": float("nan")}, "frame_rate"),
        ({"start_time": float("inf")}, "start_time"),
        ({"seed": -1}, "seed"),
        ({"quality": "best"}, "'draft' or 'full'"),
        ({"scene": ""}, "scene"),
        ({"speed": 3}, "speed"),
    ],
)
def test_bad_values_are_refused(changes, message) -> None:
    with pytest.raises(ParameterRangeError, match=message):
        ScenarioSpec(**changes)


@pytest.mark.parametrize("text", ["- 1", "num_frames: [", "num_frames: 0", "color: red", "1: 2"])
def test_a_bad_file_is_refused(tmp_path, text) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(text)
    with pytest.raises(ParameterRangeError):
        ScenarioSpec.load(path)
    with pytest.raises(ParameterRangeError, match="scenario file"):
        ScenarioSpec.load(tmp_path / "none.yaml")
