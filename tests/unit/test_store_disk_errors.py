"""A disk that fails (EIO) at any of the writer's syncs: a typed error, and the next run loses and doubles nothing."""

from __future__ import annotations

import errno
import json
import os
import shutil
from pathlib import Path

import pytest

from scarl_sionna.core.errors import OutputError
from scarl_sionna.dataset.verify import verify
from tests.unit.test_store_kill_points import NUM_FRAMES, contents, frames, run  # noqa: F401  # a fixture


def test_an_input_output_error_at_every_sync(frames, tmp_path, monkeypatch) -> None:  # noqa: F811  # the fixture
    real, calls, fail_at = os.fsync, 0, 0

    def fsync(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls == fail_at:
            raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fsync)
    run(tmp_path / "whole", frames)
    expected, total = contents(tmp_path / "whole"), calls
    assert total > 15
    out: Path = tmp_path / "out"
    for fail_at in range(1, total + 1):  # read by `fsync`
        calls = 0
        with pytest.raises(OutputError, match="cannot write .*Input/output error"):
            run(out, frames)
        calls = -(10**6)
        kept = {int(path.stem) for path in out.glob(".work/a/*/*.pack")}
        for path in out.glob("shards/a/??????.json"):
            kept |= set(json.loads(path.read_text())["frames"])
        assert run(out, frames) == NUM_FRAMES - len(kept), fail_at
        assert contents(out) == expected and verify(out).complete, fail_at
        shutil.rmtree(out)
    monkeypatch.setattr(os, "fsync", real)
