"""Frames a shard where none are asked for: by the frames of a dataset, and those of a dataset that is there."""

from __future__ import annotations

from pathlib import Path

import pytest

from scarl_sionna.batch import ExportSettings, export
from scarl_sionna.batch.estimate import estimate
from scarl_sionna.batch.plan import plan_export
from scarl_sionna.core.errors import OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.store.manifest import BACKUP, MANIFEST, DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.remote import RemoteFolder, RemoteTarget
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from tests.exports import contents, scenario_files
from tests.frames import RIG, assert_same, make_frame

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


def without_manifest(out: Path) -> None:
    for name in (MANIFEST, BACKUP):
        (out / name).unlink()


@pytest.mark.parametrize(("length", "frames"), [(2, 7), (8, 7), (5, 6), (20, 1)])
@pytest.mark.parametrize("layout", ["packed", "files"])
def test_records_tell_the_length_where_the_manifest_is_lost(tmp_path: Path, length: int, frames: int, layout) -> None:
    options = StoreOptions(shard_frames=length, layout=layout)
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES[:frames]}, options=options)
    before = contents(out)
    without_manifest(out)
    write_dataset(out, RIG.to_dict(), {"a": FRAMES[:frames]}, options=StoreOptions(layout=layout))
    assert contents(out) == before


def test_other_lengths_and_configurations_are_refused_still(tmp_path: Path) -> None:
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=8))
    without_manifest(out)
    for stated in ({"options": StoreOptions(shard_frames=3)}, {"configuration": {"seed": 1}}):
        with pytest.raises(OutputError, match="another configuration"):
            write_dataset(out, RIG.to_dict(), {"a": FRAMES}, **stated)
    write_dataset(out, RIG.to_dict(), {"a": FRAMES}, overwrite=True)
    assert open_dataset(out).plan.options.shard_frames == 3


def to_memory(out: Path, url: str) -> RemoteTarget:
    target = RemoteTarget(url)
    for name, data in contents(out).items():
        target.write(name, data)
    return target


def test_records_in_a_store_tell_the_length(tmp_path: Path) -> None:
    """Shards of 8 frames passed for those of 3: their records were not looked at."""
    out = write_dataset(tmp_path / "out", RIG.to_dict(), {"a": FRAMES}, options=StoreOptions(shard_frames=8))
    before = contents(out)
    without_manifest(out)
    target = to_memory(out, "memory://lengths")
    for plan, overwrite in ((ScenePlan("a", 7, {"seed": 1}), False), (ScenePlan("a", 7), False)):
        folder = RemoteFolder(
            target.url, DatasetPlan(RIG.to_dict(), (plan,)), overwrite=overwrite, scratch=tmp_path / "scratch"
        )
        if plan.configuration:
            with pytest.raises(OutputError, match="another configuration"), folder:
                pass
        else:
            with folder:
                assert folder.is_finished("a", 0) and folder.look().options.shard_frames == 8
                folder.finalize()
    assert {name: target.read(name) for name in target.walk()} == before
    plan = DatasetPlan(RIG.to_dict(), (ScenePlan("a", 7, {"seed": 1}),))
    for name in (MANIFEST, BACKUP):
        target.remove(name)
    with RemoteFolder(target.url, plan, overwrite=True, scratch=tmp_path / "scratch") as folder:
        assert not any(folder.rows["a"]) and not [name for name in target.walk() if name.startswith("shards/")]


@pytest.mark.parametrize("place", ["folder", "store"])
def test_a_dry_run_forecasts_shards_as_long_as_those_there(tmp_path: Path, place: str) -> None:
    """Six frames into shards of eight: one shard, and where it is overwritten two."""
    (path,) = scenario_files(tmp_path / "s", one=6)
    scenario, out = ScenarioSpec.load(path), tmp_path / "out"
    export([scenario.with_(num_frames=1)], out, ExportSettings(options=StoreOptions(shard_frames=8)))
    where = str(out) if place == "folder" else to_memory(out, "memory://forecast").url
    plan = plan_export([scenario], StoreOptions())
    assert [estimate(plan, where, ExportSettings(overwrite=overwrite)).num_files for overwrite in (False, True)] == [
        4 + 2,
        4 + 4,
    ]


def test_a_frame_is_the_same_in_shards_of_any_length(tmp_path: Path) -> None:
    """Files and hashes are not, and the default length goes by the frames of all drives: docs/export.md."""
    rig, longer = RIG.to_dict(), [make_frame(index) for index in range(16)]
    alone = open_dataset(write_dataset(tmp_path / "alone", rig, {"a": longer[:12]}))
    both = open_dataset(write_dataset(tmp_path / "both", rig, {"a": longer[:12], "b": longer}))
    assert (alone.plan.options.shard_frames, both.plan.options.shard_frames) == (3, 7)
    for one, other in zip(alone.scene("a"), both.scene("a"), strict=True):
        assert_same(one.to_frame(), other.to_frame())
    assert alone.plan.scene_hash("a") != both.plan.scene_hash("a") == alone.plan.scene_hash("a", 7)
