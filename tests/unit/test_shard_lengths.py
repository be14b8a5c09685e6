"""Frames a shard where none are asked for: by the frames of a dataset, and those of a dataset that is there."""

from __future__ import annotations

from pathlib import Path

import pytest

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.core.errors import OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import contents, scenario_files
from tests.frames import RIG, make_frame

FRAMES = [make_frame(index) for index in range(7)]


@pytest.mark.parametrize(
    ("frames", "length"),
    [((1,), 3), ((6,), 3), ((15,), 3), ((16,), 4), ((8, 16), 6), ((32,), 8), ((200,) * 700, 8)],
)
def test_a_quarter_of_the_frames_but_three_to_eight(frames: tuple[int, ...], length: int) -> None:
    scenes = tuple(ScenePlan(f"s{number:03d}", count) for number, count in enumerate(frames))
    assert DatasetPlan(RIG.to_dict(), scenes).options.shard_frames == length
    asked = DatasetPlan(RIG.to_dict(), scenes, StoreOptions(shard_frames=5))
    assert asked.options.shard_frames == 5 and not asked.has_free_shards


def test_two_workers_share_six_frames() -> None:
    plan = DatasetPlan(RIG.to_dict(), (ScenePlan("a", 6),))
    assert [len(plan.scenes[0].shard_range(shard, plan.options)) for shard in range(2)] == [3, 3]
    assert plan.scenes[0].num_shards(plan.options) == 2


@pytest.mark.parametrize("length", [2, 8])
def test_a_dataset_goes_on_in_shards_as_long_as_its_own(tmp_path: Path, length: int) -> None:
    """Those of before had eight frames a shard; one that grows keeps what it has."""
    options = StoreOptions(shard_frames=length)
    whole = write_dataset(tmp_path / "whole", RIG.to_dict(), {"a": FRAMES}, options=options)
    begun = write_dataset(tmp_path / "begun", RIG.to_dict(), {"a": FRAMES[:5]}, options=options)
    write_dataset(begun, RIG.to_dict(), {"a": FRAMES})
    assert contents(begun) == contents(whole)
    assert open_dataset(begun).plan.options.shard_frames == length


def test_what_is_overwritten_or_asked_for_otherwise_does_not(tmp_path: Path) -> None:
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=8))
    with pytest.raises(OutputError, match="shard_frames"):
        write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=3))
    write_dataset(out, RIG.to_dict(), {"a": FRAMES}, overwrite=True)
    assert open_dataset(out).plan.options.shard_frames == 3


def test_jobs_of_an_array_agree(tmp_path: Path) -> None:
    """Also when one that comes later would choose otherwise, because it knows of more frames."""
    few, more = (DatasetPlan(RIG.to_dict(), (ScenePlan("a", count),)) for count in (6, 100))
    with (
        DatasetFolder(tmp_path / "out", few, part="0_of_2"),
        DatasetFolder(tmp_path / "out", more, part="1_of_2") as two,
    ):
        assert two.plan.options.shard_frames == 3 and len(two.rows["a"]) == 34


def test_an_export_goes_on_with_a_dataset_of_before(tmp_path: Path) -> None:
    (path,) = scenario_files(tmp_path / "s", one=4)
    scenario, out = ScenarioSpec.load(path), tmp_path / "out"
    export([scenario.with_(num_frames=1)], out, ExportSettings(options=StoreOptions(shard_frames=8)))
    report = export([scenario], out)
    assert (report.num_frames, report.num_kept) == (4, 1)
    assert [path.name for path in sorted(out.glob("shards/one/*.zip"))] == ["000000.zip"]
