"""A dataset in archives: read as it is, whole or in part, taken out again byte for byte, and no damage is silent."""

from __future__ import annotations

import json
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.core.results import Frame
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.archive import archive_dataset, restore_dataset
from scarl_sionna.dataset.store.files import LocalFiles
from scarl_sionna.dataset.verify import verify
from tests.drive import drive
from tests.exports import contents

SOURCE = drive(num_frames=5, ends=("front",), scenes=("lane", "street"))
SHARD_FRAMES = 2
SCENES = {scene.name: scene.frames for scene in SOURCE.scenes}
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(
        tmp_path_factory.mktemp("plain") / "ds", SOURCE.rig, SCENES, options=StoreOptions(SHARD_FRAMES, layout="files")
    )


@pytest.fixture
def archives(plain: Path, tmp_path: Path) -> Path:
    calls: list[tuple[int, int]] = []
    out = archive_dataset(plain, tmp_path / "archives", on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 6) for k in range(1, 7)]
    return out


def values(frame: Frame) -> dict[str, np.ndarray]:
    """Return all numbers of a frame by name."""
    found = {"pose": frame.world_from_vehicle.position, "boxes": np.array([item.size for item in frame.objects])}
    for name, result in frame.results.items():
        found |= {f"{name}/{key}": value for key, value in vars(result).items() if isinstance(value, np.ndarray)}
    return found


def same(one: Frame, other: Frame) -> bool:
    mine, theirs = values(one), values(other)
    return mine.keys() == theirs.keys() and all(
        np.array_equal(mine[name], theirs[name], equal_nan=mine[name].dtype.kind in "fc") for name in mine
    )


# -- the same dataset ------------------------------------------------------------------------------------------------


def test_one_file_a_shard_and_every_frame_is_the_same(plain, archives) -> None:
    files = [path.relative_to(archives).as_posix() for path in archives.rglob("*") if path.is_file()]
    assert sum(name.startswith(("archives/lane/", "archives/street/")) for name in files) == 6  # 2 scenes, 3 shards
    assert len(files) == 6 + 5  # archives/dataset.zip, archived.json, README.md, two marks of an exporter
    assert len([path for path in plain.rglob("*") if path.is_file()]) > 100
    one, other = open_dataset(plain), open_dataset(archives)
    assert len(one) == len(other) == 10 and one.manifest == other.manifest
    for mine, theirs in zip(one, other, strict=True):
        assert same(mine.to_frame(), theirs.to_frame())
    assert one.splits == other.splits and other.scene("lane").array("timestamp_ns").tolist() == [
        frame.timestamp_ns for frame in SCENES["lane"]
    ]


def test_what_comes_out_is_what_went_in(plain, archives, tmp_path) -> None:
    back = restore_dataset(archives, tmp_path / "back")
    assert contents(back) == contents(plain)
    assert verify(back).complete
    with pytest.raises(OutputError, match="is there"):
        restore_dataset(archives, back)
    with pytest.raises(DatasetError, match="is not in archives"):
        restore_dataset(plain, tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_any_zip_program_takes_single_files_out(plain, archives) -> None:
    names = set()
    for path in archives.rglob("*.zip"):
        with zipfile.ZipFile(path) as archive:
            assert archive.testzip() is None
            for name in archive.namelist():
                assert archive.read(name) == (plain / name).read_bytes()
                names.add(name)
    assert names == set(contents(plain))
    picture = "images/lane/front_center/camera/rgb/000003.png"
    with zipfile.ZipFile(archives / "archives" / "lane" / "000001.zip") as archive:
        assert archive.read(picture) == (plain / picture).read_bytes()


def test_the_same_dataset_gives_the_same_bytes(plain, archives, tmp_path) -> None:
    again = archive_dataset(plain, tmp_path / "again")
    for path in archives.rglob("*.zip"):
        assert (again / path.relative_to(archives)).read_bytes() == path.read_bytes()


def test_only_what_is_asked_for_is_read(archives, monkeypatch) -> None:
    """One array of one frame: the index, the tables of two archives, and the array itself."""
    read: list[int] = []
    whole = LocalFiles.read

    def counted(self: LocalFiles, name: str, start: int | None = None, stop: int | None = None) -> bytes:
        data = whole(self, name, start, stop)
        read.append(len(data))
        return data

    monkeypatch.setattr(LocalFiles, "read", counted)
    monkeypatch.setattr("scarl_sionna.dataset.store.archives._TAIL", 2**13)
    assert open_dataset(archives).scene("street")[4].lidar[LIDAR].distance.size
    size = sum(path.stat().st_size for path in archives.rglob("*.zip"))
    assert sum(read) < size / 5
    assert len(read) < 20


def test_zarr_reads_archives(plain, archives) -> None:
    group, expected = (open_dataset(place).scene("lane").group[f"{RADAR}/adc"] for place in (archives, plain))
    assert group.metadata == expected.metadata
    np.testing.assert_array_equal(group[1:5, 0, :3], expected[1:5, 0, :3])


def test_threads_and_other_readers(archives) -> None:
    from scarl_sionna.dataset.readers.samples import FrameSamples

    dataset = open_dataset(archives)
    with ThreadPoolExecutor(4) as pool:
        frames = list(pool.map(lambda index: dataset[index % 10].to_frame(), range(40)))
    assert all(same(frames[index], frames[index % 10]) for index in range(40))
    samples = FrameSamples(archives, [f"{CAMERA}:rgb", "boxes"])
    np.testing.assert_array_equal(samples[0][f"{CAMERA}:rgb"], SCENES["lane"][0].images[CAMERA].rgb)


def test_archives_behind_an_address(archives) -> None:
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    for path in archives.rglob("*"):
        if path.is_file():
            memory.pipe_file(f"/drive/{path.relative_to(archives).as_posix()}", path.read_bytes())
    dataset = open_dataset("memory://drive")
    assert same(dataset[7].to_frame(), open_dataset(archives)[7].to_frame())
    memory.rm("/drive", recursive=True)


# -- damage ----------------------------------------------------------------------------------------------------------


def test_no_flipped_bit_is_silent(archives) -> None:
    """Every bit flip is named, or in bytes that nobody reads (heads of files, which stand in the table, too)."""
    whole = [frame.to_frame() for frame in open_dataset(archives)]
    rng = np.random.default_rng(3)
    files = [path for path in sorted(archives.rglob("*")) if path.suffix == ".zip" or path.name == "archived.json"]
    named = 0
    for _ in range(60):
        path = files[rng.integers(len(files))]
        data = bytearray(path.read_bytes())
        place = rng.integers(len(data))
        data[place] ^= 1 << rng.integers(8)
        kept = path.read_bytes()
        path.write_bytes(bytes(data))
        try:
            assert all(same(one, other.to_frame()) for one, other in zip(whole, open_dataset(archives), strict=True))
        except DatasetError:
            named += 1
        finally:
            path.write_bytes(kept)
    assert named > 40


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), "is not there"),
        (lambda path: path.write_bytes(path.read_bytes()[:-100]), "bytes that were written"),
        (lambda path: path.write_bytes(path.read_bytes()[:-4] + b"abcd"), "damaged"),
        (lambda path: path.write_bytes(b"\0" * path.stat().st_size), "damaged"),
    ],
)
def test_a_lost_or_cut_archive_is_named(archives, change, message) -> None:
    change(archives / "archives" / "lane" / "000001.zip")
    dataset = open_dataset(archives)
    assert dataset.scene("lane")[0].timestamp_ns == 0  # the others are read
    with pytest.raises(DatasetError, match=message) as error:
        dataset.scene("lane")[2].to_frame()
    assert "archives/lane/000001.zip" in str(error.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 2}, "newer than 1"),
        ({"shards": {"lane": "many"}}, "is damaged"),
        ({"shard_frames": 0}, "is damaged"),
        ({"shards": {"../lane": [1]}}, "could lead out"),
        ({"common": -1}, "is damaged"),
        ({"format": "zip"}, "is damaged"),
    ],
)
def test_an_index_that_cannot_be_is_refused(archives, changes, message) -> None:
    data = {**json.loads((archives / "archived.json").read_text()), **changes}
    (archives / "archived.json").write_text(json.dumps(data))
    with pytest.raises(DatasetError, match=message):
        open_dataset(archives)


@pytest.mark.parametrize("how", ["compressed", "leads out"])
def test_archives_of_somebody_else_are_refused(archives, how) -> None:
    path = archives / "archives" / "lane" / "000000.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED if how == "compressed" else zipfile.ZIP_STORED) as archive:
        archive.writestr("../evil" if how == "leads out" else "shards/lane/000000.json", b"0" * 1000)
    data = json.loads((archives / "archived.json").read_text())
    data["shards"]["lane"][0] = path.stat().st_size
    (archives / "archived.json").write_text(json.dumps(data))
    with pytest.raises(DatasetError, match="lead out" if how == "leads out" else "compressed"):
        open_dataset(archives)[0].to_frame()
    with pytest.raises(DatasetError):
        restore_dataset(archives, archives.parent / "back")
    assert [item.name for item in archives.parent.iterdir()] == ["archives"]


# -- commands and refusals -------------------------------------------------------------------------------------------


def test_verify_reads_archives_and_repairs_none(archives) -> None:
    found = verify(archives)
    assert found.complete and found.num_frames == 10 and found.num_files > 100 and not found.foreign
    path = archives / "archives" / "street" / "000002.zip"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))
    found = verify(archives)
    assert not found.ok and {(fault.scene, fault.shard) for fault in found.faults} == {("street", 2)}
    with pytest.raises(DatasetError, match="cannot be repaired"):
        verify(archives, repair=True)


def test_what_cannot_be_is_refused(plain, archives, tmp_path) -> None:
    with pytest.raises(DatasetError, match="in archives already"):
        archive_dataset(archives, tmp_path / "x")
    with pytest.raises(DatasetError, match="no dataset here"):
        archive_dataset(tmp_path, tmp_path / "x")
    with pytest.raises(OutputError):  # an export does not write beside archives
        write_dataset(archives, SOURCE.rig, SCENES, options=StoreOptions(SHARD_FRAMES, layout="files"))
    with pytest.raises(OutputError, match="is there"):
        archive_dataset(plain, archives)
    (archives / "thesis.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"thesis\.txt"):
        archive_dataset(plain, archives, overwrite=True)
    (archives / "thesis.txt").unlink()
    archive_dataset(plain, archives, overwrite=True)
    assert not (tmp_path / "x").exists()


def test_an_unfinished_or_damaged_dataset_is_not_archived(plain, archives, tmp_path) -> None:
    back = restore_dataset(archives, tmp_path / "back")
    picture = back / "images/lane/front_center/camera/rgb/000003.png"
    picture.write_bytes(picture.read_bytes()[:-1])
    with pytest.raises(DatasetError, match=r"000003\.png is not what was written"):
        archive_dataset(back, tmp_path / "x")
    manifest = json.loads((back / "manifest.json").read_text())
    manifest["shards"]["street"][2] = None
    del manifest["checksum"]  # as before there was one
    (back / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(DatasetError, match="shard 2 of street is not finished"):
        archive_dataset(back, tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_the_command(plain, tmp_path) -> None:
    def call(*arguments: object):
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    done = call("archive", plain, tmp_path / "a")
    assert done.exit_code == 0, done.output
    assert call("info", tmp_path / "a").output.startswith(f"Dataset {tmp_path / 'a'}: 10 frames")
    assert call("verify", tmp_path / "a").exit_code == 0
    assert call("archive", tmp_path / "a", tmp_path / "b", "--restore").exit_code == 0
    assert contents(tmp_path / "b") == contents(plain)
    assert call("archive", tmp_path / "a", tmp_path / "c", "--restore", "--overwrite").exit_code == 2
    assert call("archive", tmp_path / "nothing", tmp_path / "c").exit_code == 2
