"""The code of docs/reading.md and docs/formats.md runs as it is printed."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.readers.tf_data import tensorflow
from tests.drive import drive

pytestmark = pytest.mark.own_process
DOCS = Path(__file__).resolve().parents[2] / "docs"
SOURCE = drive(num_frames=4, ends=("front",), scenes=("highway",))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the dataset and the conversions that the pages name."""
    root = tmp_path_factory.mktemp("docs")
    write_dataset(root / "out", SOURCE.rig, {"highway": list(SOURCE.scenes[0])})
    for form, name in (("dca1000", "cap"), ("hdf5", "drive.h5")):
        convert(root / "out", form, root / name)
    convert(root / "out", "webdataset", root / "wds", frames_per_file=2)
    convert(root / "out", "tfrecord", root / "tfr", items=["boxes", "timestamp_ns"])
    return root


def blocks(page: str) -> list[str]:
    """Return the Python blocks of a page; the drive of the tests has one camera for all images."""
    text = (DOCS / page).read_text(encoding="utf-8")
    text = text.replace("front_center/rgb:", "front_center/camera:").replace(
        "front_center_rgb_rgb", "front_center_camera_rgb"
    )
    return re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)


def run(page: str, names: dict[str, Any], without: tuple[str, ...]) -> dict[str, Any]:
    """Run the blocks of a page one after the other, without those that need a package of another environment."""
    for number, block in enumerate(blocks(page)):
        if any(package in block for package in without):
            continue
        exec(compile(block, f"{page}, block {number}", "exec"), names)
    return names


def test_reading(folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    without = () if importlib.util.find_spec("torch") else ("torch",)
    names = run("reading.md", {"__name__": "docs"}, without)
    assert names["samples"][0]["map"].shape == (64, 128)
    assert len(names["near"]) and set(names["near"].instance) <= {2, 3}
    assert names["batch"]["adc"].shape[0] == 2
    assert names["first"].shape == (192, 128)
    assert np.isfinite(names["network"].count_params())


def test_formats(folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    tf = tensorflow()
    record = next(iter(tf.data.TFRecordDataset(str(folder / "tfr" / "highway-00000-of-00001.tfrecord"))))
    without = ("nuscenes",) if importlib.util.find_spec("webdataset") else ("nuscenes", "webdataset")
    names = run("formats.md", {"tf": tf, "record": record}, without)
    if "pairs" in names:
        assert sorted(len(boxes) for _, boxes in names["pairs"]) == [3] * 4
    frame = SOURCE.scenes[0].frames
    np.testing.assert_allclose(names["adc"], frame[3].radars["front_center/radar"].adc, rtol=1e-5)
    np.testing.assert_array_equal(names["points"], frame[3].lidars["front_center/lidar"].position)
    assert names["boxes"].shape == (3, 10)
    assert names["spectrum"][1].shape == (128, 12, 64)
