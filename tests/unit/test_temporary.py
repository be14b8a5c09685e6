"""Temporary folders of killed processes are removed by the next process that makes one, and nothing else is."""

from __future__ import annotations

import errno
import os
import signal
import tempfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from scarl_sionna.batch import driver
from scarl_sionna.cli import app
from scarl_sionna.core.errors import OutputError
from scarl_sionna.core.temporary import temporary_folder


def test_what_a_killed_process_left_is_removed_and_nothing_else(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    process = os.fork()
    if process == 0:
        with temporary_folder() as folder:
            (folder / "sky.exr").write_text("a sky")
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(process, 0)
    (left,) = tmp_path.iterdir()
    prefix = left.name.split(str(process))[0]
    others = [
        f"{prefix}{os.getppid()}_running1",
        f"{prefix}notes",
        "scarl_sionna_elsewhere_999999999_x",
        f"my_{prefix}999999999_x",
        f"{prefix}999999999_a.b",
    ]
    for name in others:
        (tmp_path / name).mkdir()
    (tmp_path / f"{prefix}999999999_file").write_text("a file")
    with temporary_folder() as mine:
        assert mine.parent == tmp_path and not left.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*others, f"{prefix}999999999_file"])


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EFBIG])
def test_a_full_temporary_folder_is_told_with_its_remedy(tmp_path, monkeypatch, number: int) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with (
        pytest.raises(OutputError, match=rf"the temporary folder {tmp_path}: .*; free some space there, or set TMPDIR"),
        temporary_folder(),
    ):
        raise OSError(number, os.strerror(number))  # a write has no path
    assert not list(tmp_path.iterdir())


def test_a_temporary_folder_that_cannot_be_made_is_told(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "lost"))
    with pytest.raises(OutputError, match="cannot write the temporary folder .*lost"), temporary_folder():
        pass


def test_a_file_beside_the_temporary_folder_is_not_blamed_on_it(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with pytest.raises(PermissionError, match="scene.xml"), temporary_folder():
        raise PermissionError(errno.EACCES, "Permission denied", "scene.xml")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (
            OSError(errno.ENOSPC, "No space left on device", "/data/x"),
            "cannot write /data/x: No space left on device; ",
        ),
        (
            OSError(errno.EFBIG, "File too large"),
            "File too large; free some space, or choose another disk (--out, TMPDIR)",
        ),
        (OSError(errno.EROFS, "Read-only file system", "/data/x"), "cannot use /data/x: Read-only file system; choose"),
        (
            PermissionError(errno.EACCES, "Permission denied", "/data/x"),
            "cannot use /data/x: Permission denied; choose",
        ),
    ],
)
def test_an_error_of_the_disk_ends_a_command_in_one_line(tmp_path: Path, monkeypatch, error, message: str) -> None:
    def fails(*arguments: object, **options: object) -> None:
        raise error

    monkeypatch.setattr(driver, "plan_export", fails)
    arguments = ["export", "highway_guardrail", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2 and result.stderr.splitlines()[-1].startswith("error: ") and message in result.stderr
    assert "Traceback" not in result.stderr
    assert CliRunner().invoke(app, ["--debug", *arguments]).exception is error


def test_another_error_of_the_system_is_none_of_the_disk(tmp_path: Path, monkeypatch) -> None:
    def fails(*arguments: object, **options: object) -> None:
        raise ConnectionResetError(errno.ECONNRESET, "Connection reset by peer")

    monkeypatch.setattr(driver, "plan_export", fails)
    result = CliRunner().invoke(app, ["export", "highway_guardrail", "--out", str(tmp_path / "out")])
    assert isinstance(result.exception, ConnectionResetError)
