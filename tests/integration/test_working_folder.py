"""What is opened or written by a relative path stays the same when the program changes its working folder."""

from __future__ import annotations

import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.encoding import StoreOptions, encode_frame
from scarl_sionna.dataset.formats.output import whole_folder, whole_output_file
from scarl_sionna.dataset.readers.samples import FrameSamples
from scarl_sionna.dataset.store.files import absolute_place
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from tests.drive import AllFrames, drive

SOURCE = drive(num_frames=2, ends=("front",))
FRAMES = AllFrames(SOURCE)
CAMERA = "front_center/camera"


@pytest.fixture
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("elsewhere")


@pytest.mark.parametrize("layout", ["packed", "files"])
def test_a_dataset_opened_by_a_relative_path_is_read_from_another_folder(
    tmp_path, monkeypatch, elsewhere, layout: Literal["packed", "files"]
) -> None:
    monkeypatch.chdir(tmp_path)
    scenes = {scene.name: list(scene) for scene in SOURCE.scenes}
    write_dataset("ds", SOURCE.rig, scenes, options=StoreOptions(1, layout=layout))
    dataset, samples = ss.open_dataset("ds"), FrameSamples("ds", {"depth": f"{CAMERA}:depth"})
    sent = pickle.dumps(dataset), pickle.dumps(samples)
    monkeypatch.chdir(elsewhere)  # a worker in another folder
    depth = samples[1]["depth"]
    assert dataset[1].timestamp_ns == FRAMES[1].timestamp_ns
    np.testing.assert_array_equal(dataset[1].image[CAMERA].depth, depth)
    np.testing.assert_array_equal(pickle.loads(sent[0])[1].image[CAMERA].depth, depth)
    np.testing.assert_array_equal(pickle.loads(sent[1])[1]["depth"], depth)
    assert str(tmp_path) in repr(dataset)


def test_a_dataset_that_is_written_by_a_relative_path_stays_in_one_folder(tmp_path, monkeypatch, elsewhere) -> None:
    monkeypatch.chdir(tmp_path)
    plan = DatasetPlan(SOURCE.rig, (ScenePlan("street", 2, {}),), StoreOptions(1))
    with DatasetFolder("ds", plan) as folder, ThreadPoolExecutor(1) as pool:
        for index in range(2):
            with folder.shard("street", index) as shard:
                monkeypatch.chdir(elsewhere)
                shard.add(encode_frame(FRAMES[index], plan.options, pool))
                shard.commit()
        folder.finalize()
    assert len(ss.open_dataset(tmp_path / "ds")) == 2
    assert not list(elsewhere.iterdir())


def test_a_conversion_by_a_relative_path_stays_in_one_folder(tmp_path, monkeypatch, elsewhere) -> None:
    monkeypatch.chdir(tmp_path)
    with whole_folder("out", {"format": "of a test"}) as folder:
        monkeypatch.chdir(elsewhere)
        (folder / "a.txt").write_text("a")
    monkeypatch.chdir(tmp_path)
    with whole_output_file("out.bin", False, lambda path: True) as path:
        monkeypatch.chdir(elsewhere)
        path.write_text("b")
    assert (tmp_path / "out" / "a.txt").read_text() == "a" and (tmp_path / "out.bin").read_text() == "b"
    assert not list(elsewhere.iterdir())


def test_a_capture_opened_by_a_relative_path_is_read_from_another_folder(tmp_path, monkeypatch, elsewhere) -> None:
    values = np.random.default_rng(1).integers(-90, 90, (256, 8, 64, 2))
    (tmp_path / "part1").mkdir()
    np.save(tmp_path / "part1" / "0.npy", values[..., 0] + 1j * values[..., 1])
    monkeypatch.chdir(tmp_path)
    capture = ss.read_capture("part1", "raddet_adc")
    monkeypatch.chdir(elsewhere)
    assert capture[0].adc.shape == (8, 64, 256)


def test_addresses_stay_as_they_are() -> None:
    assert absolute_place("s3://bucket/data") == "s3://bucket/data"
    assert absolute_place("zip::https://host/data.zip") == "zip::https://host/data.zip"
    assert absolute_place("data") == os.path.join(os.getcwd(), "data")
