"""A process that runs the tests of one file after another, for a test worker that holds much."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helper_process import HelperProcess
from tests.own_process import WITHOUT

FILES = {
    "passes": "import os\ndef test_it(): print(os.getpid(), file=open(os.environ['PIDS'], 'a'))\n",
    "fails": "def test_it(): assert False, 'as it should'\n",
    "crashes": "import os\ndef test_it(): os.abort()\n",
}


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / f"test_{name}.py").write_text(text)
    return tmp_path


def _run(helper: HelperProcess, folder: Path, name: str) -> str:
    arguments = ["-q", *WITHOUT, "-c", "/dev/null", str(folder / f"test_{name}.py")]
    return helper.run(arguments, {"PIDS": str(folder / "pids")}, folder / f"{name}.txt")


def _pids(folder: Path) -> list[str]:
    return (folder / "pids").read_text().split()


def test_files_are_run_in_one_process_until_it_crashes(files: Path) -> None:
    helper = HelperProcess(full=1e12)
    assert [_run(helper, files, name) for name in ("passes", "fails", "passes")] == ["0", "1", "0"]
    assert _run(helper, files, "crashes") == "-6"
    assert _run(helper, files, "passes") == "0"
    first, second, third = _pids(files)
    assert first == second != third
    assert "as it should" in (files / "fails.txt").read_text()
    assert "Abort" in (files / "crashes.txt").read_text()


def test_a_full_process_ends(files: Path) -> None:
    helper = HelperProcess(full=1.0)
    assert [_run(helper, files, "passes") for _ in range(2)] == ["0", "0"]
    assert len(set(_pids(files))) == 2
