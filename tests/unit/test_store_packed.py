"""The layout of two files a shard: the same frames as with a file for each image, and no silent damage."""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zarr
from PIL import Image
from typer.testing import CliRunner

from scarl_sionna.batch.estimate import _num_files
from scarl_sionna.cli import app
from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError, ScarlWarning
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.archive import archive_dataset
from scarl_sionna.dataset.repack import repack_dataset
from scarl_sionna.dataset.store.files import LocalFiles
from scarl_sionna.dataset.store.records import ShardRecord
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from tests.exports import contents
from tests.frames import RIG, assert_same, make_frame

FRAMES = [make_frame(index) for index in range(5)]
OPTIONS = StoreOptions(shard_frames=2)
SCENES = {"a": FRAMES, "b": FRAMES[:2]}
PICTURE = "images/a/front/camera/rgb/000003.png"


@pytest.fixture(scope="module")
def packed(tmp_path_factory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("packed") / "out", RIG.to_dict(), SCENES, options=OPTIONS)


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Path:
    options = StoreOptions(shard_frames=2, layout="files")
    return write_dataset(tmp_path_factory.mktemp("plain") / "out", RIG.to_dict(), SCENES, options=options)


@pytest.fixture
def damaged(packed, tmp_path) -> Path:
    """Return a copy to damage."""
    shutil.copytree(packed, tmp_path / "out")
    return tmp_path / "out"


def test_two_files_a_shard_and_every_frame_is_the_same(packed) -> None:
    shards = {f"shards/{scene}/00000{n}" for scene, count in (("a", 3), ("b", 1)) for n in range(count)}
    ours = {"manifest.json", "manifest.backup.json", "README.md"}
    assert contents(packed).keys() == ours | {f"{name}.{kind}" for name in shards for kind in ("json", "zip")}
    dataset = open_dataset(packed)
    assert len(dataset) == 7 and dataset.manifest.schema_version == 3
    for position, frame in enumerate([*FRAMES, *FRAMES[:2]]):
        assert_same(dataset[position].to_frame(), frame)
    found = verify(packed)
    assert found.complete and not found.foreign and (found.num_frames, found.num_files) == (7, 4)


def test_any_zip_program_takes_single_pictures_out(packed, plain) -> None:
    """The members have the names and the bytes that they have as files."""
    files = {name: data for name, data in contents(plain).items() if not name.endswith(("zarr.json", "README.md"))}
    members = {}
    for path in packed.glob("shards/*/*.zip"):
        with zipfile.ZipFile(path) as archive:
            assert archive.testzip() is None
            members |= {name: archive.read(name) for name in archive.namelist()}
    assert members == {name: data for name, data in files.items() if name.count("/") > 1 and not _is_record(name)}
    with zipfile.ZipFile(packed / "shards/a/000001.zip") as archive:
        image = Image.open(io.BytesIO(archive.read(PICTURE)))
    np.testing.assert_array_equal(np.array(image), FRAMES[3].images["front/camera"].rgb)


def _is_record(name: str) -> bool:
    return name.startswith("shards/") and name.count(".") == 1


def test_repacked_is_what_an_export_with_that_layout_makes(packed, plain, tmp_path) -> None:
    for source, layout, expected in ((packed, "files", plain), (plain, "packed", packed)):
        out = tmp_path / layout
        called = CliRunner().invoke(app, ["repack", str(source), str(out), "--layout", layout])
        assert called.exit_code == 0, called.output
        assert contents(out) == contents(expected)
    with pytest.raises(DatasetError, match="has the layout 'packed' already"):
        repack_dataset(packed, tmp_path / "x", "packed")
    (tmp_path / "packed" / "shards" / "a" / "000002.json").unlink()
    repack_dataset(plain, tmp_path / "packed", "packed")  # goes on where it was
    assert contents(tmp_path / "packed") == contents(packed)
    called = CliRunner().invoke(app, ["repack", str(packed), str(tmp_path / "y"), "--layout", "tar"])
    assert called.exit_code == 2 and "packed or files" in called.output
    assert not (tmp_path / "x").exists() and not (tmp_path / "y").exists()


def test_zarr_and_xarray_read_slices(packed) -> None:
    scene = open_dataset(packed).scene("a")
    expected = np.stack([frame.radars["radar"].adc_int for frame in FRAMES])
    np.testing.assert_array_equal(scene.group["radar/adc"][1:4, :, 2:5], expected[1:4, :, 2:5])
    assert scene.group["front/lidar/distance"].attrs["units"] == "m"
    members = {name: item for name, item in scene.group.members(max_depth=None) if isinstance(item, zarr.Array)}
    assert len(members) == 3 + 11 + 8 + 1 + 17 + 11
    for name, array in members.items():
        np.testing.assert_array_equal(array[4], scene.read_array(4, name))
    again = pickle.loads(pickle.dumps(scene.group.store))
    np.testing.assert_array_equal(zarr.open_group(again, mode="r")["radar/adc"][4], expected[4])
    with pytest.raises(ValueError, match="read.only"):
        scene.group["radar/adc"][0] = 0
    xarray = pytest.importorskip("xarray")
    with xarray.open_zarr(scene.zarr_place(), group="radar", consolidated=False) as opened:
        assert opened["adc"].dims == ("frame", "receiver", "chirp", "sample", "iq")
        np.testing.assert_array_equal(opened["adc"][2], expected[2])


def test_a_picture_is_read_alone(packed, monkeypatch) -> None:
    read: dict[str, int] = {}
    whole = LocalFiles.read

    def counted(self: LocalFiles, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        data = whole(self, name, start, stop)
        read[name] = read.get(name, 0) + len(data)
        return data

    monkeypatch.setattr(LocalFiles, "read", counted)
    dataset = open_dataset(packed)
    picture = dataset.scene("a").read_image(3, "front/camera", "rgb")
    assert picture is not None and dataset.scene("a").read_file(PICTURE) == picture
    record = ShardRecord.parse((packed / "shards/a/000001.json").read_bytes())
    assert read["shards/a/000001.zip"] == 2 * len(picture) + record.files["shards/a/000001.frames.json"][0]


def test_more_frames_later_give_the_same_bytes_as_at_once(packed, tmp_path) -> None:
    out = tmp_path / "out"
    write_dataset(out, RIG.to_dict(), {"a": FRAMES[:3]}, options=OPTIONS)
    assert verify(out).complete
    write_dataset(out, RIG.to_dict(), {"b": FRAMES[:2]}, options=OPTIONS)
    write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=OPTIONS)
    assert contents(out) == contents(packed)


def test_the_other_layout_is_refused_and_overwritten_on_request(plain, packed, tmp_path) -> None:
    out = tmp_path / "out"
    shutil.copytree(plain, out)
    with pytest.raises(OutputError, match="storage.layout: 'files' there, 'packed' asked for"):
        write_dataset(out, RIG.to_dict(), SCENES, options=OPTIONS)
    assert contents(out) == contents(plain)
    (out / "images" / "mine.png").write_text("mine")
    write_dataset(out, RIG.to_dict(), SCENES, options=OPTIONS, overwrite=True)
    assert contents(out) == contents(packed) | {"images/mine.png": b"mine"}
    (out / "images" / "mine.png").unlink()
    write_dataset(out, RIG.to_dict(), SCENES, options=StoreOptions(shard_frames=2, layout="files"), overwrite=True)
    assert contents(out) == contents(plain)
    with pytest.raises(ParameterRangeError, match="layout"):
        StoreOptions(layout="zip")  # type: ignore[arg-type]
    with pytest.raises(DatasetError, match="two files a shard already"):
        archive_dataset(packed, tmp_path / "x")


# -- damage (flipped bits: test_reader_damage.py) ---------------------------------------------------------------------


@pytest.mark.parametrize("how", ["cut", "lost", "record", "a folder"])
def test_a_damaged_shard_is_named_repaired_and_made_again(damaged, packed, how) -> None:
    place = damaged / "shards" / "a" / ("000001.json" if how == "record" else "000001.zip")
    data = place.read_bytes()
    place.unlink()
    if how == "a folder":
        place.mkdir()
    elif how != "lost":
        place.write_bytes(data[: len(data) // 2])
    with pytest.raises(DatasetError, match=rf"000001\.({'json' if how == 'record' else 'zip'})"):
        open_dataset(damaged).scene("a").frame(2).to_frame()
    assert_same(open_dataset(damaged)[4].to_frame(), FRAMES[4])
    found = verify(damaged, repair=True)
    assert not found.ok and found.removed == [("a", 1)]
    assert verify(damaged).ok and not verify(damaged).complete
    write_dataset(damaged, RIG.to_dict(), SCENES, options=OPTIONS)
    assert contents(damaged) == contents(packed)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda record: record["files"][PICTURE].pop(), "has no place"),
        (lambda record: record["files"][PICTURE].__setitem__(2, 10**9), "has no place"),
        (lambda record: record["files"][PICTURE].__setitem__(2, -1), "is damaged"),
        (lambda record: record["bundle"].__setitem__(0, "../evil.zip"), "could lead out"),
        (lambda record: record.pop("bundle"), "has no place"),
        (lambda record: record["bundle"].__setitem__(0, "shards/b/000000.zip"), "checksum"),
    ],
)
def test_a_record_that_cannot_be_is_refused(damaged, change, message) -> None:
    path = damaged / "shards" / "a" / "000001.json"
    record = json.loads(path.read_text())
    change(record)
    del record["checksum"]
    path.write_text(json.dumps(record))
    found = verify(damaged)
    assert any(message in str(fault) and fault.shard == 1 for fault in found.faults), found.faults


def test_a_record_in_the_wrong_place_costs_no_other_shard(damaged, packed) -> None:
    shutil.copy(damaged / "shards" / "b" / "000000.json", damaged / "shards" / "a" / "000000.json")
    found = verify(damaged, repair=True)
    assert any("is no file of shard 0 of a, whose record names it" in str(fault) for fault in found.faults)
    assert found.removed == [("a", 0)]
    assert_same(open_dataset(damaged).scene("b").frame(1).to_frame(), FRAMES[1])
    assert verify(damaged).ok
    write_dataset(damaged, RIG.to_dict(), SCENES, options=OPTIONS)
    assert contents(damaged) == contents(packed)


def lose(root: Path, names: str) -> None:
    for name in names.split():
        (root / name).unlink()


@pytest.mark.parametrize("lost", ["", "shards/a/000001.zip", "shards/a/000001.zip manifest.json manifest.backup.json"])
def test_a_shard_whose_zip_file_is_gone_is_made_again_with_a_warning(damaged, packed, lost) -> None:
    os.truncate(damaged / "shards" / "a" / "000001.zip", 1000)
    lose(damaged, lost)
    with pytest.warns(ScarlWarning, match=r"size that was written: shards/a/000001\.zip; .* not finished") as caught:
        write_dataset(damaged, RIG.to_dict(), SCENES, options=OPTIONS)
    assert len(caught) == 1
    assert contents(damaged) == contents(packed)
    assert verify(damaged).complete


def test_a_zip_file_that_goes_while_others_are_made_is_told_at_the_end(damaged) -> None:
    lose(damaged, "shards/b/000000.zip")
    plan = open_dataset(damaged).plan
    with pytest.warns(ScarlWarning) as caught, DatasetFolder(damaged, plan) as folder:
        lose(damaged, "shards/a/000001.zip")
        folder.finalize()
    first, second = (str(item.message) for item in caught)
    assert "was written: shards/b/000000.zip; " in first
    assert "was written: shards/a/000001.zip; " in second and "an export of their drives makes them again" in second
    assert [row is None for row in folder.rows["a"]] == [False, True, False]


def test_a_shard_of_single_files_of_which_one_is_gone_is_made_again_with_a_warning(plain, tmp_path) -> None:
    shutil.copytree(plain, tmp_path / "out")
    lose(tmp_path / "out", PICTURE)
    with pytest.warns(ScarlWarning, match=rf"{PICTURE}; shard 1 of a is made again$"):
        write_dataset(tmp_path / "out", RIG.to_dict(), SCENES, options=StoreOptions(shard_frames=2, layout="files"))
    assert contents(tmp_path / "out") == contents(plain)


def test_a_scene_that_moves_to_another_split_is_told(damaged) -> None:
    plan = open_dataset(damaged).plan
    scenes = tuple(replace(scene, split="test" if scene.name == "b" else scene.split) for scene in plan.scenes)
    with (
        pytest.warns(ScarlWarning, match=r"'b' moves from 'train' to 'test'$"),
        DatasetFolder(damaged, replace(plan, scenes=scenes)) as folder,
    ):
        folder.finalize()
    assert open_dataset(damaged).splits == {"train": ["a"], "val": [], "test": ["b"]}


# -- numbers ---------------------------------------------------------------------------------------------------------


def test_the_forecast_of_files_is_the_number_of_files(packed, plain, tmp_path) -> None:
    from concurrent.futures import ThreadPoolExecutor
    from types import SimpleNamespace

    from scarl_sionna.dataset.encoding import encode_frame

    for place, layout in ((packed, "packed"), (plain, "files")):
        options = StoreOptions(shard_frames=2, layout=layout)  # type: ignore[arg-type]
        with ThreadPoolExecutor(1) as pool:
            frame = encode_frame(FRAMES[4], options, pool)
        plan = SimpleNamespace(dataset=open_dataset(place).plan)
        there = len(contents(place)) + 1  # the log of an export
        assert _num_files(plan, frame) == there  # type: ignore[arg-type]


def test_140_000_frames_are_35_004_files() -> None:
    """At the default options, in 700 scenes of 200 frames; the forecast is held to real datasets above."""
    from concurrent.futures import ThreadPoolExecutor
    from types import SimpleNamespace

    from scarl_sionna.dataset.encoding import encode_frame
    from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan

    options = StoreOptions()
    with ThreadPoolExecutor(1) as pool:
        frame = encode_frame(FRAMES[0], options, pool)
    scenes = tuple(ScenePlan(f"s{number:03d}", 200) for number in range(700))
    plan = SimpleNamespace(dataset=DatasetPlan(RIG.to_dict(), scenes, options))
    assert _num_files(plan, frame) == 35_004  # type: ignore[arg-type]
