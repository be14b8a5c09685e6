"""COCO and YOLO folders: pycocotools reads masks and boxes back, and YOLO's boxes are COCO's."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

from scarl_sionna.core.errors import DatasetError, OutputError, ParameterRangeError, ScarlWarning
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset import write_dataset
from scarl_sionna.dataset.formats import convert
from scarl_sionna.dataset.formats.labelled.coco import export_coco, run_lengths
from scarl_sionna.dataset.formats.labelled.objects import COCO_CLASSES, image_objects
from scarl_sionna.dataset.formats.labelled.yolo import NAMES, export_yolo
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from tests.drive import drive

SOURCE = replace(
    drive(num_frames=3, ends=("front", "back"), scenes=("lane", "street")),
    splits={"train": ["lane"], "val": ["street"]},
)
CAMERA = "front_center/camera"
MIN_PIXELS = 4


@pytest.fixture(scope="module")
def coco_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    calls: list[tuple[int, int]] = []
    out = tmp_path_factory.mktemp("coco") / "out"
    export_coco(SOURCE, out, image_format="png", min_pixels=MIN_PIXELS, on_progress=lambda *state: calls.append(state))
    assert calls == [(k, 6) for k in range(1, 7)]
    return out


def test_pycocotools_reads_masks_boxes_and_images(coco_folder) -> None:
    coco_module = pytest.importorskip("pycocotools.coco")
    compared = 0
    for split, scene in (("train", SOURCE.scenes[0]), ("val", SOURCE.scenes[1])):
        coco = coco_module.COCO(str(coco_folder / "annotations" / f"instances_{split}.json"))
        assert len(coco.getImgIds()) == 6  # two cameras, three frames
        for entry in coco.loadImgs(coco.getImgIds()):
            frame = next(frame for frame in scene if frame.index == entry["scarl_frame"])
            image = frame.images[entry["scarl_camera"]]
            pixels = np.asarray(Image.open(coco_folder / "images" / split / entry["file_name"]))
            np.testing.assert_array_equal(pixels, image.rgb)
            found = coco.loadAnns(coco.getAnnIds(imgIds=entry["id"]))
            instances = {item["scarl_instance"] for item in found}
            for item in frame.objects[1:]:
                mask = image.instance == item.instance
                name = SEMANTIC_CLASSES[item.semantic]
                assert (item.instance in instances) == (name in COCO_CLASSES and mask.sum() >= MIN_PIXELS)
            for item in found:
                mask = image.instance == item["scarl_instance"]
                np.testing.assert_array_equal(coco.annToMask(item), mask)
                assert item["area"] == mask.sum()
                np.testing.assert_allclose(coco_module.maskUtils.toBbox(coco.annToRLE(item)), item["bbox"])
                assert coco.loadCats(item["category_id"])[0]["name"] in ("car", "person")
                compared += 1
    assert compared > 6


def test_perfect_detections_score_one(coco_folder) -> None:
    coco_module, evaluation = pytest.importorskip("pycocotools.coco"), pytest.importorskip("pycocotools.cocoeval")
    truth = coco_module.COCO(str(coco_folder / "annotations" / "instances_train.json"))
    guesses = [
        {"image_id": a["image_id"], "category_id": a["category_id"], "bbox": a["bbox"], "score": 0.9}
        for a in truth.dataset["annotations"]
    ]
    run = evaluation.COCOeval(truth, truth.loadRes(guesses), "bbox")
    run.evaluate()
    run.accumulate()
    run.summarize()
    assert run.stats[0] == pytest.approx(1.0)
    for guess in guesses:
        guess["bbox"] = [0.0, 0.0, 1.0, 1.0]
    run = evaluation.COCOeval(truth, truth.loadRes(guesses), "bbox")
    run.evaluate()
    run.accumulate()
    run.summarize()
    assert run.stats[0] == pytest.approx(0.0)


def test_annotations_have_numbers_of_their_own_over_all_splits(coco_folder) -> None:
    tables = [json.loads(path.read_text()) for path in sorted((coco_folder / "annotations").iterdir())]
    for name in ("images", "annotations"):
        numbers = [row["id"] for table in tables for row in table[name]]
        assert len(set(numbers)) == len(numbers) and min(numbers) == 1
    assert tables[0]["categories"] == tables[1]["categories"]
    assert [row["name"] for row in tables[0]["categories"]] == list(NAMES)


@pytest.mark.parametrize("first", [False, True])
def test_run_lengths_are_those_of_the_library(first) -> None:
    mask_module = pytest.importorskip("pycocotools.mask")
    mask = np.random.default_rng(1).random((7, 5)) < 0.4
    mask[0, 0] = first
    counts = run_lengths(mask)
    assert sum(counts) == mask.size and sum(counts[1::2]) == mask.sum()
    coded = mask_module.frPyObjects({"size": [7, 5], "counts": counts}, 7, 5)
    np.testing.assert_array_equal(mask_module.decode(coded), mask)


def test_boxes_of_yolo_are_those_of_coco(coco_folder, tmp_path) -> None:
    export_yolo(SOURCE, tmp_path / "yolo", image_format="png", min_pixels=MIN_PIXELS)
    about = yaml.safe_load((tmp_path / "yolo" / "data.yaml").read_text())
    assert (about["train"], about["val"]) == ("images/train", "images/val")
    assert about["names"] == dict(enumerate(NAMES))
    compared = 0
    for split in ("train", "val"):
        table = json.loads((coco_folder / "annotations" / f"instances_{split}.json").read_text())
        names = {row["id"]: row["name"] for row in table["categories"]}
        for entry in table["images"]:
            image = tmp_path / "yolo" / "images" / split / entry["file_name"]
            assert image.read_bytes() == (coco_folder / "images" / split / entry["file_name"]).read_bytes()
            label = tmp_path / "yolo" / "labels" / split / f"{image.stem}.txt"
            rows = [line.split() for line in label.read_text().splitlines()]
            theirs = [row for row in table["annotations"] if row["image_id"] == entry["id"]]
            assert [about["names"][int(row[0])] for row in rows] == [names[row["category_id"]] for row in theirs]
            scale = np.array([entry["width"], entry["height"]])
            for row, other in zip(rows, theirs, strict=True):
                centre, size = np.array(row[1:3], float) * scale, np.array(row[3:], float) * scale
                np.testing.assert_allclose([*(centre - size / 2), *size], other["bbox"], atol=2e-4)  # six digits
                compared += 1
    assert compared > 6


@pytest.mark.parametrize(
    ("splits", "train", "val", "told"),
    [
        (
            ("val", "test"),
            "val",
            "val",
            {"'train': data.yaml names those of images/val .* is trained with"},
        ),
        (
            ("test", "train"),
            "train",
            "train",
            {"'val': data.yaml names those of images/train .* is validated on"},
        ),
        (
            ("test",),
            "test",
            "test",
            {
                "'train': data.yaml names those of images/test .* is trained with what it is tested on",
                "'val': data.yaml names those of images/test .* is validated on what it is tested on",
            },
        ),
    ],
)
def test_splits_that_lack_still_are_named_for_a_trainer(tmp_path, splits, train, val, told) -> None:
    scenes = SOURCE.scenes[: len(splits)]
    named = {split: [scene.name] for split, scene in zip(splits, scenes, strict=True)}
    with pytest.warns(ScarlWarning) as caught:
        export_yolo(FrameSource(SOURCE.rig, scenes, named), tmp_path / "yolo")
    texts = [str(item.message) for item in caught if "of the split" in str(item.message)]
    assert len(texts) == len(told) and all(any(re.search(text, item) for item in texts) for text in told)
    about = yaml.safe_load((tmp_path / "yolo" / "data.yaml").read_text())
    assert (about["train"], about["val"]) == (f"images/{train}", f"images/{val}")


def test_an_instance_image_of_another_camera_with_the_same_view_serves(tmp_path) -> None:
    frame = SOURCE.scenes[0].frames[0]
    whole = frame.images[CAMERA]
    nothing = {"rgb": None, "depth": None, "semantic": None, "instance": None}
    split = {
        "front/rgb": replace(whole, **{**nothing, "rgb": whole.rgb}),
        "front/labels": replace(
            whole,
            **{**nothing, "instance": whole.instance},
            object_occlusion=np.array([math.nan, 0.25, 0.5, 0.0], np.float32),
            object_truncation=np.array([math.nan, 0.125, 0.0, 0.0], np.float32),
        ),
    }
    found = image_objects(replace(frame, results=split), "front/rgb")
    assert [item.item.name for item in found] == [item.item.name for item in image_objects(frame, CAMERA)]
    assert (found[0].occlusion, found[0].truncation) == (0.25, 0.125)
    moved = replace(split["front/labels"], world_from_sensor=frame.images["back_center/camera"].world_from_sensor)
    other = replace(frame, results={**split, "front/labels": moved})
    with pytest.raises(DatasetError, match="no instance image with the view of front/rgb"):
        export_coco(FrameSource(SOURCE.rig, [SceneFrames("x", [other])]), tmp_path / "x")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", ["coco", "yolo"])
def test_what_cannot_be_is_refused_and_leaves_nothing(tmp_path, form) -> None:
    with pytest.raises(ParameterRangeError, match="image_format"):
        convert(SOURCE, form, tmp_path / "x", image_format="gif")
    with pytest.raises(ParameterRangeError, match="min_pixels"):
        convert(SOURCE, form, tmp_path / "x", min_pixels=0)
    with pytest.raises(ParameterRangeError, match="no frames"):
        convert(FrameSource(SOURCE.rig, []), form, tmp_path / "x")
    blind = replace(SOURCE.scenes[0].frames[0], results={})
    with pytest.raises(ParameterRangeError, match="without RGB camera"):
        convert(FrameSource(SOURCE.rig, [SceneFrames("x", [blind])]), form, tmp_path / "x")
    assert not list(tmp_path.iterdir())
    convert(SOURCE.subset(["lane"], 1), form, tmp_path / "x")
    with pytest.raises(OutputError, match="is there"):
        convert(SOURCE, form, tmp_path / "x")


def test_a_stored_dataset_gives_the_same_labels(coco_folder, tmp_path) -> None:
    place = write_dataset(tmp_path / "ds", SOURCE.rig, {"lane": list(SOURCE.scenes[0])})
    convert(place, "coco", tmp_path / "out", image_format="png", min_pixels=MIN_PIXELS)
    ours, theirs = (
        json.loads((folder / "annotations" / "instances_train.json").read_text())
        for folder in (tmp_path / "out", coco_folder)
    )
    assert ours == theirs
