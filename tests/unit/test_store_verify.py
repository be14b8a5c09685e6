"""verify finds every planted fault, repair removes what is damaged, the next export makes it again.

And nothing leads out.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from scarl_sionna.core.errors import DatasetError, OutputError
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from tests.exports import contents
from tests.frames import RIG, assert_same, make_frame

FRAMES = [make_frame(index) for index in range(7)]
OPTIONS = StoreOptions(shard_frames=3, layout="files")
ADC = "arrays/a/radar/adc/c/1/0/0/0/0"
PNG = "images/a/front/camera/rgb/000004.png"
RECORD = "shards/a/000001.json"


def make(out: Path) -> Path:
    return write_dataset(out, RIG.to_dict(), {"a": FRAMES}, options=OPTIONS)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp("verify") / "out")


@pytest.fixture
def damaged(whole, tmp_path) -> Path:
    """Return a copy to damage."""
    shutil.copytree(whole, tmp_path / "out")
    return tmp_path / "out"


def flip(name: str, position: float = 0.5) -> Callable[[Path], None]:
    def damage(out: Path) -> None:
        data = bytearray((out / name).read_bytes())
        data[int(position * (len(data) - 1))] ^= 0x10
        (out / name).write_bytes(data)

    return damage


def cut(name: str) -> Callable[[Path], None]:
    return lambda out: os.truncate(out / name, (out / name).stat().st_size // 2)


def remove(name: str) -> Callable[[Path], None]:
    return lambda out: (out / name).unlink()


def swap(first: str, second: str) -> Callable[[Path], None]:
    def damage(out: Path) -> None:
        data = [(out / name).read_bytes() for name in (first, second)]
        (out / first).write_bytes(data[1])
        (out / second).write_bytes(data[0])

    return damage


def edit(name: str, change: Callable[[dict], None]) -> Callable[[Path], None]:
    def damage(out: Path) -> None:
        data = json.loads((out / name).read_text())
        data.pop("checksum", None)  # a manifest as it was before there was one
        change(data)
        (out / name).write_text(json.dumps(data))

    return damage


def stray(name: str) -> Callable[[Path], None]:
    return lambda out: (out / name).write_text("who am I?")


def link_out(out: Path) -> None:
    (out / PNG).unlink()
    (out / PNG).symlink_to("/etc/passwd")


FAULTS = {
    "a byte of a radar shard": (flip(ADC), ADC, "checksum is wrong"),
    "the first byte of an index": (flip(ADC, 1.0), ADC, "checksum is wrong"),
    "a truncated shard": (cut(ADC), ADC, "bytes"),
    "a lost shard": (
        remove("arrays/a/front/lidar/position/c/2/0/0"),
        "arrays/a/front/lidar/position/c/2/0/0",
        "not there",
    ),
    "a byte of an image": (flip(PNG), PNG, "checksum is wrong"),
    "a lost image": (remove(PNG), PNG, "is not there"),
    "two images that changed places": (swap(PNG, PNG.replace("4.png", "5.png")), PNG, "bytes|checksum is wrong"),
    "a link out of the dataset": (link_out, PNG, "leads out of the dataset to /etc/passwd"),
    "a lost record": (remove(RECORD), RECORD, "stands in the manifest and is not there"),
    "a record that is no JSON": (cut(RECORD), RECORD, "the record of a shard is damaged"),
    "a record of fewer frames": (edit(RECORD, lambda d: d["frames"].pop()), RECORD, "holds the frames"),
    "a record of another configuration": (
        edit(RECORD, lambda d: d.update(configuration="0" * 64)),
        RECORD,
        "made with another configuration",
    ),
    "a record that leads out": (
        edit(RECORD, lambda d: d["files"].update({"../../../etc/passwd": [1, "x"]})),
        RECORD,
        "could lead out of the dataset",
    ),
    "a record with an absolute path": (
        edit(RECORD, lambda d: d["files"].update({"/etc/passwd": [1, "x"]})),
        RECORD,
        "could lead out of the dataset",
    ),
    "a record that names a file of no shard": (
        edit(RECORD, lambda d: d["files"].update({"README.md": [1, "x"]})),
        "README.md",
        "no place for data of a shard",
    ),
    "a checksum in the manifest": (
        edit("manifest.json", lambda d: d["shards"]["a"][1].__setitem__(0, "0" * 64)),
        RECORD,
        "not that of the manifest",
    ),
    "a count in the manifest": (
        edit("manifest.json", lambda d: d["shards"]["a"][1].__setitem__(1, 2)),
        "manifest.json",
        "not what follows",
    ),
    "units in the metadata of an array": (
        edit("arrays/a/front/lidar/distance/zarr.json", lambda d: d["attributes"].update(units="km")),
        "arrays/a/front/lidar/distance/zarr.json",
        "not what the schema says",
    ),
    "lost metadata of an array": (
        remove("arrays/a/radar/adc/zarr.json"),
        "arrays/a/radar/adc/zarr.json",
        "is not there",
    ),
    "a picture of a frame that its shard does not hold": (
        edit(RECORD, lambda d: d["files"].pop(PNG)),
        PNG,
        "belongs to no finished shard",
    ),
    "a lost card": (remove("README.md"), "README.md", "is not there"),
    "a lost manifest": (remove("manifest.json"), "manifest.json", "its copy manifest.backup.json is whole"),
    "a manifest that is cut": (cut("manifest.json"), "manifest.json", "its copy manifest.backup.json is whole"),
    "a copy of the manifest that is cut": (cut("manifest.backup.json"), "manifest.backup.json", "cannot read"),
}


@pytest.mark.some(7)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found_and_repaired(damaged, whole, fault) -> None:
    damage, name, what = FAULTS[fault]
    damage(damaged)
    found = verify(damaged)
    assert not found.ok
    import re

    assert any(item.name == name and re.search(what, item.what) for item in found.faults), found.faults
    verify(damaged, repair=True)
    left = verify(damaged)
    assert left.ok, left.faults
    make(damaged)  # the export makes what is missing
    assert contents(damaged) == contents(whole)
    assert verify(damaged).complete


def test_a_whole_dataset_has_no_fault(whole) -> None:
    found = verify(whole)
    assert (found.faults, found.num_frames, found.num_planned, found.complete) == ([], 7, 7, True)
    sizes = sum(
        len(data)
        for name, data in contents(whole).items()
        if not name.endswith(("zarr.json", "README.md", "manifest.backup.json"))
    )
    records = sum(path.stat().st_size for path in whole.glob("shards/a/??????.json"))
    assert found.num_bytes == sizes - records - (whole / "manifest.json").stat().st_size


def test_only_the_damaged_shard_is_made_again(damaged) -> None:
    flip(ADC)(damaged)
    found = verify(damaged, repair=True)
    assert found.removed == [("a", 1)]
    assert [frame.index for frame in open_dataset(damaged)] == [0, 1, 2, 6]


def test_reading_a_damaged_chunk_is_an_error_and_the_rest_reads_on(damaged) -> None:
    flip(ADC, 0.1)(damaged)  # in the chunk of the shard's first frame
    dataset = open_dataset(damaged)
    with pytest.raises(DatasetError, match=rf"{ADC} cannot be read: a chunk is damaged.*verify --repair"):
        _ = dataset[3].radar["radar"].adc
    for index in (0, 4, 5, 6):
        assert_same(dataset[index].to_frame(), FRAMES[index])
    cut(ADC)(damaged)
    with pytest.raises(DatasetError, match="damaged or cut"):
        _ = open_dataset(damaged)[4].radar["radar"].adc
    (damaged / ADC).unlink()
    with pytest.raises(DatasetError, match="is not there"):
        _ = open_dataset(damaged)[4].radar["radar"].adc


def test_no_dataset_a_newer_one_and_another_format(whole, tmp_path) -> None:
    for place in (tmp_path, tmp_path / "none", f"file://{tmp_path}"):
        with pytest.raises(DatasetError, match=r"no dataset here.*give the folder that"):
            open_dataset(place)
    manifest = json.loads((whole / "manifest.json").read_text())
    for change, message in (
        ({"schema_version": 99}, "schema version 99 is newer than 3.*update scarl-sionna"),
        ({"schema_version": "soon"}, "newer"),
        ({"format": "other"}, "not a dataset of scarl-sionna"),
        ({"scenes": None}, "is damaged"),
    ):
        (tmp_path / "manifest.json").write_text(json.dumps({**manifest, **change}))
        with pytest.raises(DatasetError, match=message):
            open_dataset(tmp_path)
    (tmp_path / "manifest.json").write_text("{")
    with pytest.raises(DatasetError, match="cannot read manifest.json"):
        open_dataset(tmp_path)
    with pytest.raises(DatasetError, match="cannot open this address"):
        open_dataset("nowhere://bucket/dataset")


def test_a_newer_dataset_is_not_written_to(damaged) -> None:
    edit("manifest.json", lambda data: data.update(schema_version=99))(damaged)
    before = contents(damaged)
    with pytest.raises(OutputError, match="schema version 99 is newer"):
        make(damaged)
    assert contents(damaged) == before


@pytest.mark.parametrize("name", ["../../etc", "/etc", "a/../..", "~"])
def test_a_manifest_that_leads_out_is_not_followed(damaged, name) -> None:
    def rename_scene(data: dict) -> None:
        for table in (data["scenes"], data["configuration"]["scenes"], data["shards"]):
            table[name] = table.pop("a")

    def rename_sensor(data: dict) -> None:
        data["configuration"]["rig"]["sensors"][0]["name"] = name

    original = (damaged / "manifest.json").read_text()
    for change in (rename_scene, rename_sensor):
        (damaged / "manifest.json").write_text(original)
        edit("manifest.json", change)(damaged)
        with pytest.raises(DatasetError, match=r"could lead out of the dataset and is not followed; do not trust"):
            open_dataset(damaged)


def test_a_folder_that_links_out_is_not_followed(damaged, tmp_path) -> None:
    secret = tmp_path / "secret"
    shutil.move(damaged / "images" / "a" / "front", secret)
    (damaged / "images" / "a" / "front").symlink_to(secret)
    frame = open_dataset(damaged)[0]
    with pytest.raises(DatasetError, match="leads out of the dataset"):
        _ = frame.image["front/camera"].rgb
    assert not verify(damaged).ok
    verify(damaged, repair=True)
    assert len(list(secret.rglob("*.png"))) == 7 * 5  # repair removes nothing outside


def test_verify_waits_for_no_export_that_runs(damaged) -> None:
    flip(ADC)(damaged)
    with DatasetFolder(damaged, DatasetPlan(RIG.to_dict(), (ScenePlan("a", 7),), OPTIONS)):
        assert not verify(damaged).ok
        with pytest.raises(OutputError, match="is in use"):
            verify(damaged, repair=True)
