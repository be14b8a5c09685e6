"""WebDataset shards, read with the `webdataset` package itself."""

from __future__ import annotations

import json
import tarfile
from dataclasses import replace

import numpy as np
import pytest

from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError, UnknownNameError
from scarl_sionna.dataset import open_dataset, write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.dataset.formats.webdataset import export_webdataset
from tests.drive import drive

SOURCE = replace(
    drive(num_frames=3, ends=("front",), scenes=("lane", "street", "park")),
    splits={"train": ["lane", "street"], "val": ["park"]},
)
RADAR, CAMERA, LIDAR = "front_center/radar", "front_center/camera", "front_center/lidar"
ITEMS = {
    "adc": f"{RADAR}:adc_int",
    "map": f"{RADAR}:range_doppler",
    "rgb": f"{CAMERA}:rgb",
    "depth": f"{CAMERA}:depth",
    "points": f"{LIDAR}:points",
    "boxes": "boxes",
    "time": "timestamp_ns",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("wds") / "out"
    export_webdataset(SOURCE, out, ITEMS, frames_per_file=4, on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 9) for k in range(1, 10)]
    return out


def test_the_library_reads_every_item_as_it_was(folder) -> None:
    wds = pytest.importorskip("webdataset")
    assert sorted(path.name for path in folder.glob("*.tar")) == [
        "train-000000.tar",
        "train-000001.tar",
        "val-000000.tar",
    ]
    urls = f"{folder}/train-{{000000..000001}}.tar"
    found = list(wds.WebDataset(urls, shardshuffle=False).decode("rgb8"))
    frames = [(scene.name, frame) for scene in SOURCE.scenes[:2] for frame in scene]
    assert [sample["__key__"] for sample in found] == [f"{name}/{frame.index:06d}" for name, frame in frames]
    for sample, (name, frame) in zip(found, frames, strict=True):
        np.testing.assert_array_equal(sample["adc.npy"], frame.radars[RADAR].adc_int)
        assert sample["adc.npy"].dtype == np.int16
        np.testing.assert_array_equal(sample["rgb.png"], frame.images[CAMERA].rgb)
        np.testing.assert_array_equal(sample["depth.npy"], frame.images[CAMERA].depth)
        np.testing.assert_array_equal(sample["points.npy"][:, :3], frame.lidars[LIDAR].position)
        assert sample["boxes.npy"].shape == (3, 10)
        assert sample["map.npy"].dtype == np.float32
        assert int(sample["time.npy"]) == frame.timestamp_ns
        assert sample["json"] == {"scene": name, "frame": frame.index, "timestamp_ns": frame.timestamp_ns}


def test_batches_of_the_library(folder) -> None:
    wds = pytest.importorskip("webdataset")
    chain = wds.WebDataset(f"{folder}/val-000000.tar", shardshuffle=False).decode("rgb8")
    batches = list(chain.to_tuple("rgb.png", "map.npy").batched(2))
    assert [len(batch[0]) for batch in batches] == [2, 1]
    assert np.asarray(batches[0][0]).shape == (2, *SOURCE.scenes[0].frames[0].images[CAMERA].rgb.shape)


def test_the_info_names_shards_items_and_rig(folder) -> None:
    info = json.loads((folder / "dataset_info.json").read_text())
    assert info["shards"] == {"train": ["train-000000.tar", "train-000001.tar"], "val": ["val-000000.tar"]}
    assert info["items"]["rgb"] == "rgb.png" and info["items"]["adc"] == "adc.npy"
    assert info["splits"] == {"train": ["lane", "street"], "val": ["park"]}
    assert info["rig"]["name"] == "drive"


def test_files_of_a_sample_follow_each_other_and_bytes_repeat(folder, tmp_path) -> None:
    with tarfile.open(folder / "train-000000.tar") as archive:
        keys = [member.name.partition(".")[0] for member in archive]
    assert keys == sorted(keys) and len(set(keys)) == 4
    export_webdataset(SOURCE, tmp_path / "again", ITEMS, frames_per_file=4)
    for path in folder.glob("*.tar"):
        assert (tmp_path / "again" / path.name).read_bytes() == path.read_bytes()


def test_all_items_of_a_stored_dataset_and_one_split(tmp_path) -> None:
    wds = pytest.importorskip("webdataset")
    scenes = {scene.name: list(scene) for scene in SOURCE.scenes[:1]}
    place = write_dataset(tmp_path / "ds", SOURCE.rig, scenes)
    convert(place, "webdataset", tmp_path / "out")
    (sample, *_) = wds.WebDataset(f"{tmp_path}/out/train-000000.tar", shardshuffle=False).decode("rgb8")
    stored = open_dataset(place)[0]
    np.testing.assert_array_equal(sample["front_center_radar_adc_int.npy"], stored.radar[RADAR].adc_int)
    np.testing.assert_array_equal(sample["front_center_camera_rgb.png"], stored.image[CAMERA].rgb)
    np.testing.assert_array_equal(sample["front_center_camera_instance.npy"], stored.image[CAMERA].instance)
    convert(SOURCE.subset(splits=["val"]), "webdataset", tmp_path / "val", items=["boxes"])
    assert [path.name for path in (tmp_path / "val").glob("*.tar")] == ["val-000000.tar"]


def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path) -> None:
    with pytest.raises(ParameterRangeError, match="frames_per_file"):
        export_webdataset(SOURCE, tmp_path / "x", frames_per_file=0)
    with pytest.raises(ParameterRangeError, match="no frames"):
        export_webdataset(FrameSource(SOURCE.rig, []), tmp_path / "x")
    with pytest.raises(ParameterRangeError, match="a name of its own"):
        export_webdataset(SOURCE, tmp_path / "x", {"a b": "boxes", "a/b": "box_semantic"})
    with pytest.raises(UnknownNameError):
        export_webdataset(SOURCE, tmp_path / "x", ["box"])
    with pytest.raises(ParameterRangeError, match="ends the key"):
        export_webdataset(FrameSource(SOURCE.rig, [replace(SOURCE.scenes[0], name="a.b")]), tmp_path / "x")
    less = replace(SOURCE.scenes[0].frames[1], results={})
    broken = FrameSource(SOURCE.rig, [SceneFrames("x", [SOURCE.scenes[0].frames[0], less])])
    with pytest.raises(DatasetError, match="has no sensor"):
        export_webdataset(broken, tmp_path / "x", ITEMS)
    assert not list(tmp_path.iterdir())
    export_webdataset(SOURCE, tmp_path / "x", ["boxes"])
    with pytest.raises(OutputError, match="is there"):
        export_webdataset(SOURCE, tmp_path / "x", ["boxes"])
    export_webdataset(SOURCE, tmp_path / "x", ["boxes"], overwrite=True)
