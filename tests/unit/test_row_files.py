"""Rows of results in files, plain and compressed."""

from __future__ import annotations

import lzma
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import pytest

from benchmarks import detection_tables
from benchmarks.row_files import append_rows, put_row, read_rows, rows_so_far, write_rows

DATA = Path(__file__).parents[2] / "docs/figures/data"


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.jsonl.xz"])
def test_rows_come_back_as_they_were_added(tmp_path, name: str) -> None:
    file = tmp_path / name
    assert rows_so_far(file) == []
    append_rows(file, {"seed": 1, "name": "Straße"})
    append_rows(file, {"seed": 2}, {"seed": 3})
    assert [row["seed"] for row in read_rows(file)] == [1, 2, 3]
    write_rows(file, reversed(read_rows(file)))
    assert read_rows(file)[-1] == {"seed": 1, "name": "Straße"}
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_compressed_file_has_the_bytes_of_the_plain_one(tmp_path) -> None:
    for name in ("rows.jsonl", "rows.jsonl.xz"):
        write_rows(tmp_path / name, [{"seed": 1}, {"seed": 2}])
    assert lzma.decompress((tmp_path / "rows.jsonl.xz").read_bytes()) == (tmp_path / "rows.jsonl").read_bytes()


def test_all_rows_of_the_pages_can_be_read() -> None:
    for file in DATA.glob("*.jsonl*"):
        assert read_rows(file), file.name


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.jsonl.xz"])
def test_a_file_that_is_not_there_is_not_a_file_without_rows(tmp_path, name: str) -> None:
    with pytest.raises(FileNotFoundError, match=name):
        read_rows(tmp_path / name)


@pytest.mark.parametrize(
    ("module", "argument"),
    [("street_curves", "--out"), ("whole_streets", "--out"), ("jumps", "--out"), ("many_frames", "--report")],
)
def test_tables_of_a_mistyped_name_replace_nothing(tmp_path, monkeypatch, module: str, argument: str) -> None:
    """Nor is there a figure."""
    page = tmp_path / "page.md"
    page.write_text("".join(f"<!-- {name} -->\nkept\n<!-- end -->\n" for name in ("places", "streets", "jumps")))
    (tmp_path / "figures").mkdir()
    before = page.read_text()
    writing = ["--write", str(page)] if argument == "--out" else []
    monkeypatch.setattr("sys.argv", [module, argument, str(tmp_path / "mistyped.jsonl.xz"), *writing])
    with pytest.raises(FileNotFoundError):
        import_module(f"benchmarks.{module}").main()
    assert page.read_text() == before and not list((tmp_path / "figures").iterdir())


def test_detection_tables_from_a_wrong_folder_replace_nothing(tmp_path, monkeypatch) -> None:
    page = tmp_path / "page.md"
    page.write_text("kept")
    for name in ("STORE", "RESULTS"):
        monkeypatch.setattr(detection_tables, name, tmp_path / "nothing")
    with pytest.raises(FileNotFoundError):
        detection_tables.write_tables(page)
    assert page.read_text() == "kept"


def _add(path: Path, first: int) -> None:
    for number in range(first, first + 20):
        append_rows(path, {"seed": number})


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.jsonl.xz"])
def test_runs_at_once_lose_no_rows(tmp_path, name: str) -> None:
    context = get_context("fork")
    runs = [context.Process(target=_add, args=(tmp_path / name, first)) for first in (0, 100)]
    for run in runs:
        run.start()
    for run in runs:
        run.join(60.0)
        assert run.exitcode == 0
    seeds = [row["seed"] for row in read_rows(tmp_path / name)]
    assert sorted(seeds) == [*range(20), *range(100, 120)]


def test_a_row_is_put_in_place_of_the_one_before(tmp_path) -> None:
    """Rows that another run has added meanwhile stay."""
    file = tmp_path / "rows.jsonl.xz"
    for seed, value in ((3, "a"), (1, "b"), (3, "c")):
        put_row(file, {"seed": seed, "value": value}, "seed")
    assert read_rows(file) == [{"seed": 1, "value": "b"}, {"seed": 3, "value": "c"}]
