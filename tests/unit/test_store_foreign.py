"""Nothing of the user's is ever touched.

Foreign files stay byte for byte, and where they stand in the way nothing begins.
"""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.cli import app
from scarl_sionna.core.errors import OutputError, ScarlWarning
from scarl_sionna.dataset import StoreOptions, open_dataset, write_dataset
from scarl_sionna.dataset.store.card import is_card, unmarked_card
from scarl_sionna.dataset.store.layout import Layout
from scarl_sionna.dataset.store.manifest import DatasetPlan, ScenePlan
from scarl_sionna.dataset.store.writer import DatasetFolder
from scarl_sionna.dataset.verify import verify
from tests.frames import RIG, make_frame

FRAMES = [make_frame(index) for index in range(5)]
OPTIONS = StoreOptions(shard_frames=2, layout="files")
PNG = "images/a/front/camera/rgb/000002.png"
OF_THE_USER = {
    ".git/config": "[core]",
    ".git/objects/00/11": "blob",
    ".gitignore": "*.png",
    ".partial_notes_1": "half a thesis",
    "notes.txt": "years of work",
    "images/holiday.png": "beach",
    "images/a/front/camera/rgb/mine.png": "a picture beside ours",
    "images/a/front/camera/rgb/000099.png": "of no frame of the plan",
    "images/a/front/camera/rgb/7.png": "not as we number",
    "images/a/thumbnails/rgb/000001.png": "of no sensor",
    "images/a/front/camera/mask/000001.png": "an image that no camera gives",
    "images/mine/front/camera/rgb/000001.png": "of no scene",
    "arrays/a/mine.npy": "an array",
    "arrays/a/mine/zarr.json": "a group of mine",
    "arrays/a/radar/adc/c/77/0/0/0/0": "of no shard",
    "shards/a/notes.json": "a note",
    "shards/a/000099.json": "of no shard",
    "src/manifest.json": "{}",
    ".work/mine/note": "a note",
    ".work/a/000000/mine.pack": "a note",
    ".locks/mine": "a note",
}


def make(out: Path, frames: int = 5, name: str = "a", overwrite: bool = False, seed: int = 0) -> Path:
    configuration = {"seed": seed}
    return write_dataset(
        out, RIG.to_dict(), {name: FRAMES[:frames]}, options=OPTIONS, configuration=configuration, overwrite=overwrite
    )


def plant(out: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).write_text(text)


def tree(out: Path) -> dict[str, bytes | str | None]:
    """Return all that is in a folder: bytes of files, targets of links, None for folders."""
    return {
        path.relative_to(out).as_posix(): os.readlink(path)
        if path.is_symlink()
        else path.read_bytes()
        if path.is_file()
        else None
        for path in out.rglob("*")
    }


def ours(out: Path) -> dict[str, bytes | str | None]:
    """Return the files of the dataset."""
    return {
        name: data
        for name, data in tree(out).items()
        if data is not None and name not in OF_THE_USER and not name.startswith(".locks")
    }


def assert_the_users_files_are_there(out: Path) -> None:
    assert {name: (out / name).read_text() for name in OF_THE_USER} == OF_THE_USER


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    return make(tmp_path_factory.mktemp("foreign") / "out")


@pytest.fixture
def mixed(whole, tmp_path) -> Path:
    """Return a dataset in a git repository, among all kinds of files of its user."""
    shutil.copytree(whole, tmp_path / "out")
    plant(tmp_path / "out", OF_THE_USER)
    return tmp_path / "out"


def test_foreign_files_in_a_dataset_survive_a_resumed_export(mixed, whole) -> None:
    (mixed / "shards/a/000001.json").unlink()
    (mixed / PNG).unlink()
    make(mixed)
    assert_the_users_files_are_there(mixed)
    assert ours(mixed) == ours(whole)


@pytest.mark.some(1)
@pytest.mark.parametrize("lost", [(), ("manifest.json",), ("manifest.json", "manifest.backup.json")])
def test_foreign_files_in_a_dataset_survive_overwrite(mixed, tmp_path, lost) -> None:
    for name in lost:
        (mixed / name).unlink()
    make(mixed, frames=3, overwrite=True, seed=7)
    assert_the_users_files_are_there(mixed)
    assert ours(mixed) == ours(make(tmp_path / "fresh", frames=3, seed=7))  # nothing of the old one is left


def test_foreign_files_in_a_dataset_survive_repair_and_are_no_fault(mixed, whole) -> None:
    found = verify(mixed)
    assert found.complete
    assert set(found.foreign) == {name for name in OF_THE_USER if name.split("/")[0] in ("arrays", "images", "shards")}
    for damage in (PNG, "shards/a/000000.json", "arrays/zarr.json", "README.md", "manifest.json"):
        (mixed / damage).unlink()
        assert not verify(mixed, repair=True).ok
        assert_the_users_files_are_there(mixed)
    make(mixed)
    assert_the_users_files_are_there(mixed)
    assert ours(mixed) == ours(whole)


FOREIGN_FOLDERS = {
    "a fresh repository": ({"README.md": "# My project", ".git/config": "[core]"}, "README.md"),
    "a card with words of the user": ({"README.md": None}, "README.md"),
    "source code with a manifest": ({"manifest.json": '{"name": "my app"}', "src/main.js": "code"}, "manifest.json"),
    "a manifest that is a list": ({"manifest.json": "[1, 2]"}, "manifest.json"),
    "source code with a copy of a manifest": ({"manifest.backup.json": "{}"}, "manifest.backup.json"),
    "a damaged manifest of somebody": ({"manifest.json": "{"}, "manifest.json"),
    "folders of other things": ({"shards/db/000000.json": "{}", "src/a.py": "code"}, "shards"),
    "pictures": ({"images/holiday.png": "beach"}, "images"),
    "arrays": ({"arrays/a/zarr.json": '{"zarr_format": 3}'}, "arrays"),
    "a log": ({"export.log": "of something else"}, "export.log"),
    "a thesis": ({"thesis.doc": "years of work"}, "thesis.doc"),
    "a contact sheet": ({"contact_sheet.png": "of my photographs"}, "contact_sheet.png"),
    "a file where a folder belongs": ({"images": "a list of images"}, "images"),
    "work of somebody": ({".work": "a file"}, ".work"),
}  # fmt: skip # a table


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("case", FOREIGN_FOLDERS)
def test_a_foreign_folder_is_refused_and_not_a_byte_of_it_changes(tmp_path, whole, case, overwrite) -> None:
    files, named = FOREIGN_FOLDERS[case]
    out = tmp_path / "out"
    plant(
        out,
        {name: (whole / name).read_text() + "My words.\n" if text is None else text for name, text in files.items()},
    )
    before = tree(out)
    with pytest.raises(OutputError, match=rf"holds other files \(.*{named}.*they are kept"):
        make(out, overwrite=overwrite)
    assert tree(out) == before


def test_a_folder_of_hidden_files_is_no_foreign_folder(tmp_path, whole) -> None:
    hidden = {".git/config": "[core]", ".gitignore": "*.png"}
    plant(tmp_path / "out", hidden)
    make(tmp_path / "out")
    assert {name: (tmp_path / "out" / name).read_text() for name in hidden} == hidden
    assert verify(tmp_path / "out").complete


@pytest.mark.some(4)
@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("name", ["README.md", "manifest.json", "manifest.backup.json", "export.log"])
def test_a_file_of_the_users_in_the_place_of_ours_stops_the_export_before_it_begins(mixed, name, overwrite) -> None:
    (mixed / name).write_text('{"mine": 1}')
    (mixed / "shards/a/000001.json").unlink()
    before = tree(mixed)
    with pytest.raises(OutputError, match=rf"holds other files \({name}\) where files of the dataset belong"):
        make(mixed, overwrite=overwrite)
    assert tree(mixed) == before


def test_repair_leaves_a_readme_and_a_log_of_the_users(mixed) -> None:
    plant(mixed, {"README.md": "# My data", "export.log": "mine"})
    (mixed / PNG).unlink()
    verify(mixed, repair=True)
    assert ((mixed / "README.md").read_text(), (mixed / "export.log").read_text()) == ("# My data", "mine")
    assert_the_users_files_are_there(mixed)
    found = verify(mixed)
    assert found.ok and "README.md" in found.foreign


def in_place(kind: str, path: Path) -> None:
    if kind == "file":
        path.write_text("mine")
    elif kind == "folder":
        path.mkdir()
        (path / "inside").write_text("mine")
    else:
        path.symlink_to("/tmp")


@pytest.mark.some(4)
@pytest.mark.parametrize("kind", ["file", "folder", "link"])
@pytest.mark.parametrize(
    "name", ["images/b/front/camera/rgb/000001.png", "shards/b/000000.json", "arrays/b/radar/adc/zarr.json"]
)
def test_what_has_the_name_of_a_file_to_come_stops_an_added_scene(mixed, name, kind) -> None:
    (mixed / name).parent.mkdir(parents=True)
    in_place(kind, mixed / name)
    before = tree(mixed)
    with pytest.raises(OutputError, match=f"{name}.* where files of the dataset belong"):
        make(mixed, name="b")
    assert tree(mixed) == before


@pytest.mark.some(4)
@pytest.mark.parametrize("name", ["images", "images/b", "arrays/b/radar", "images/b/front/camera/rgb", ".work/b"])
@pytest.mark.parametrize("kind", ["file", "link"])
def test_what_stands_where_a_folder_belongs_stops_an_added_scene(mixed, name, kind) -> None:
    if name == "images":
        shutil.move(mixed / name, mixed / "elsewhere")
    (mixed / name).parent.mkdir(parents=True, exist_ok=True)
    in_place(kind, mixed / name)
    before = tree(mixed)
    with pytest.raises(OutputError, match=f"{name}.* where files of the dataset belong"):
        make(mixed, name="b")
    assert tree(mixed) == before


def test_more_frames_do_not_replace_a_picture_of_the_users(tmp_path) -> None:
    out = make(tmp_path / "out", frames=2)
    (out / "images/a/front/camera/rgb/000003.png").write_text("mine")
    before = tree(out)
    with pytest.raises(OutputError, match=r"rgb/000003\.png\) where files of the dataset belong"):
        make(out, frames=4)
    assert tree(out) == before
    make(out, frames=3)  # frame 3 is not asked for


def test_a_folder_in_the_place_of_a_file_of_an_old_scene_stays(mixed) -> None:
    for name in (PNG, "shards/a/000001.json"):
        (mixed / name).unlink(missing_ok=True)
    in_place("folder", mixed / PNG)
    with pytest.raises(OutputError, match=r"000002\.png is a folder where a file of the dataset belongs; it is kept"):
        make(mixed)
    assert (mixed / PNG / "inside").read_text() == "mine"
    shutil.rmtree(mixed / PNG)
    make(mixed)
    assert verify(mixed).complete


LOSSES = [
    ["shards"], ["shards/a"], ["arrays"], ["arrays/a"], ["images"], ["images/a"], ["arrays", "images"],
    ["shards", "arrays", "images"], ["shards/a/000000.json", "shards/a/000001.json", "shards/a/000002.json"],
    ["arrays/a/zarr.json", "shards/a"],
]  # fmt: skip # a table


@pytest.mark.some(2)
@pytest.mark.parametrize("lost", LOSSES, ids=" ".join)
def test_repair_of_a_scene_that_lost_all_of_its_shards(whole, tmp_path, lost) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    for name in lost:
        shutil.rmtree(out / name) if (out / name).is_dir() else (out / name).unlink()
    assert not verify(out).ok
    repaired = verify(out, repair=True)
    assert repaired.removed == [("a", 0), ("a", 1), ("a", 2)]
    left = verify(out)
    assert (left.ok, left.foreign, left.num_frames) == (True, [], 0), left
    make(out)
    assert ours(out) == ours(whole)


@pytest.mark.some(1)
@pytest.mark.parametrize(
    "name",
    [
        PNG,
        "shards/a/000001.json",
        "shards/a/000001.frames.json",
        "arrays/a/radar/adc/c/1/0/0/0/0",
        "arrays/a/radar/adc/zarr.json",
        "manifest.json",
        "manifest.backup.json",
    ],
)
def test_repair_of_an_empty_folder_in_the_place_of_a_file(whole, tmp_path, name) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    (out / name).unlink()
    (out / name).mkdir()
    assert not verify(out).complete
    verify(out, repair=True)
    assert verify(out).ok
    make(out)
    assert ours(out) == ours(whole)


@pytest.mark.some(1)
@pytest.mark.parametrize("name", [PNG, "shards/a/000001.json"])
def test_repair_keeps_a_folder_with_something_in_it(whole, tmp_path, name) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    (out / name).unlink()
    in_place("folder", out / name)
    found = verify(out, repair=True)
    assert (out / name / "inside").read_text() == "mine"
    assert f"{name}/ (a folder where a file belongs)" in found.foreign


@pytest.mark.some(1)
@pytest.mark.parametrize("name", ["images", "shards/a"])
def test_repair_names_a_file_in_the_place_of_a_folder(whole, tmp_path, name) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    shutil.rmtree(out / name)
    (out / name).write_text("mine")
    before = tree(out)
    with pytest.raises(OutputError, match=rf"holds other files \({name}\) where files of the dataset belong"):
        verify(out, repair=True)
    assert tree(out) == before | {".locks": None} | {key: b"" for key in tree(out) if key.endswith(".lock")}
    (out / name).unlink()
    verify(out, repair=True)
    make(out)
    assert ours(out) == ours(whole)


@pytest.mark.some(1)
@pytest.mark.parametrize("damage", [None, "", "{", '{"format": "scarl-dataset", "schema_version": 1}'])
def test_a_lost_manifest_is_read_from_its_copy_and_put_back(whole, tmp_path, damage) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    assert (out / "manifest.json").read_bytes() == (out / "manifest.backup.json").read_bytes()
    (out / "manifest.json").unlink()
    if damage is not None:
        (out / "manifest.json").write_text(damage)
    with pytest.warns(
        ScarlWarning, match=r"manifest\.json.*read from its copy manifest\.backup\.json.*verify --repair"
    ):
        dataset = open_dataset(out)
    assert len(dataset) == 5
    found = verify(out)
    assert [fault.name for fault in found.faults] == ["manifest.json"]
    with pytest.raises(OutputError, match="seed: 0 there, 7 asked for"):
        make(out, seed=7)
    verify(out, repair=True)
    assert verify(out).complete and ours(out) == ours(whole)


def test_a_dataset_without_a_copy_of_the_manifest_gets_one(whole, tmp_path) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    (out / "manifest.backup.json").unlink()
    assert verify(out).complete  # of a version that wrote none
    verify(out, repair=True)
    assert ours(out) == ours(whole)


def test_a_card_from_before_cards_had_a_mark_is_ours(whole, tmp_path) -> None:
    out = tmp_path / "out"
    shutil.copytree(whole, out)
    old = unmarked_card(json.loads((out / "manifest.json").read_text()))
    assert is_card(out / "README.md") and (out / "README.md").read_text().startswith(old)
    (out / "README.md").write_text(old)
    assert verify(out).complete
    make(out)
    assert ours(out) == ours(whole)
    (out / "README.md").write_bytes(
        (whole / "README.md").read_bytes().replace(b"\n", b"\r\n")
    )  # as git may check it out
    make(out)


def test_verify_tells_an_unfinished_export_from_a_damaged_one(whole, tmp_path) -> None:
    out, runner = tmp_path / "out", CliRunner()
    plan = DatasetPlan(RIG.to_dict(), (ScenePlan("a", 5, {"seed": 0}),), OPTIONS)
    shutil.copytree(whole, out)
    rows = (out / "manifest.json").read_text()
    shutil.rmtree(out)
    make(out, frames=2)
    with DatasetFolder(out, plan):  # it runs: planned are 5 frames, shard 1 is on its way
        for source in sorted(whole.rglob("*")):
            name = source.relative_to(whole).as_posix()
            if source.is_file() and Layout(plan).shard_of(name) == ("a", 1):
                (out / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source, out / name)
                found = verify(out) if name.endswith(("000002.png", ".json")) else None
                assert found is None or (found.ok and not found.complete and not found.foreign), found
        assert (len(found.unfinished), found.num_frames) == (1, 4)  # the record, that the manifest does not know
        done = runner.invoke(app, ["verify", str(out)])
        assert done.exit_code == 3 and "whole, not complete" in done.stdout.splitlines()[-1], done.stdout
    make(out)
    assert (out / "manifest.json").read_text() == rows
    assert runner.invoke(app, ["verify", str(out)]).exit_code == 0
    (out / PNG).write_bytes(b"")
    assert runner.invoke(app, ["verify", str(out)]).exit_code == 1
    assert runner.invoke(app, ["verify", str(tmp_path)]).exit_code == 2
