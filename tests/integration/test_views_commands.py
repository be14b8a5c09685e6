"""Commands `convert` and `view`, as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.dataset import StoreOptions, write_dataset
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from tests.drive import drive

SOURCE = drive(num_frames=2, ends=("front",), scenes=("lane", "street"))


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_dataset(tmp_path_factory.mktemp("cli") / "ds", SOURCE.rig, {s.name: list(s) for s in SOURCE.scenes})


def call(*arguments: object):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_convert_takes_scenes_frames_and_options(place, tmp_path) -> None:
    done = call(
        "convert",
        place,
        "nuscenes",
        tmp_path / "out",
        "--scene",
        "street",
        "--frames",
        1,
        "--option",
        "image_format=png",
        "--option",
        "raw_radar=false",
    )
    assert done.exit_code == 0, done.output
    assert "1 frames written" in done.output
    files = [path.name for path in (tmp_path / "out").rglob("*.png") if "CAM" in path.name]
    assert len(files) == 1 and files[0].startswith("street")
    scenes = json.loads((tmp_path / "out" / "v1.0-mini" / "scene.json").read_text())
    assert [scene["name"] for scene in scenes] == ["street"]
    assert not (tmp_path / "out" / "scarl_radar").exists()
    splits = json.loads((tmp_path / "out" / "v1.0-mini" / "splits.json").read_text())
    assert splits == {"train": ["street"]}


def test_an_option_is_none(place, tmp_path) -> None:
    h5py = pytest.importorskip("h5py")
    done = call("convert", place, "hdf5", tmp_path / "x.h5", "--option", "compression=none")
    assert done.exit_code == 0, done.output
    found = []
    with h5py.File(tmp_path / "x.h5") as file:
        file.visititems(lambda _, item: found.append(getattr(item, "compression", None)))
    assert found and set(found) == {None}


@pytest.mark.parametrize("form", ["hdf5", "mcap", "dca1000"])
def test_convert_to_every_form(place, tmp_path, form) -> None:
    done = call("convert", place, form, tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out").exists()
    again = call("convert", place, form, tmp_path / "out")
    assert again.exit_code == 2 and "--overwrite" in again.output
    assert call("convert", place, form, tmp_path / "out", "--overwrite").exit_code == 0


@pytest.mark.parametrize("form", ["hdf5", "mcap", "dca1000", "webdataset", "nuscenes", "openlabel", "coco", "rosbag"])
def test_a_dataset_without_frames_is_refused(tmp_path, form) -> None:
    with DatasetFolder(
        tmp_path / "ds", DatasetPlan(SOURCE.rig, (ScenePlan("street", 2, {}),), StoreOptions())
    ) as empty:
        empty.finalize()  # an export of which nothing is finished
    done = call("convert", empty.root, form, tmp_path / "out")
    assert done.exit_code == 2 and "dataset = no frames is not allowed" in done.output, done.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nuscene",), "did you mean 'nuscenes'"),
        (("mcap", "--scene", "avenue"), "unknown scene 'avenue'"),
        (("mcap", "--option", "pfa"), "name=value"),
        (("mcap", "--option", "pdf=1"), "did you mean 'pfa'"),
        (("mcap", "--option", "overwrite=true"), "unknown option"),
        (("mcap", "--frames", 0), "num_frames = 0"),
        (("mcap", "--option", "pfa=2.0"), "1e-300 <= pfa < 1"),
    ],
)
def test_mistakes_are_one_message(place, tmp_path, arguments, message) -> None:
    done = call("convert", place, arguments[0], tmp_path / "out", *arguments[1:])
    assert done.exit_code == 2
    assert message in done.output.replace("\n", " ")
    assert not list(tmp_path.iterdir())


def test_what_is_no_dataset(place, tmp_path) -> None:
    for source in (tmp_path, tmp_path / "none", place / "manifest.json"):
        done = call("convert", source, "mcap", tmp_path / "out")
        assert done.exit_code == 2
        assert "Traceback" not in done.output


def test_view_without_the_viewer_names_the_extra(place, tmp_path, monkeypatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "rerun", None)
    for options in ((), ("--save", tmp_path / "x.rrd")):
        done = call("view", place, *options)
        assert done.exit_code == 2
        assert "scarl-sionna[viewer]" in done.output.replace("\n", "")
