"""Rows of results in files, plain and compressed."""

from __future__ import annotations

import lzma
from pathlib import Path

import pytest

from benchmarks.row_files import append_rows, read_rows, write_rows

DATA = Path(__file__).parents[2] / "docs/figures/data"


@pytest.mark.parametrize("name", ["rows.jsonl", "rows.jsonl.xz"])
def test_rows_come_back_as_they_were_added(tmp_path, name: str) -> None:
    file = tmp_path / name
    assert read_rows(file) == []
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
