"""Temporary folders of killed processes are removed by the next process that makes one, and nothing else is."""

from __future__ import annotations

import os
import signal
import tempfile

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
