"""A type checker agrees with the README: what users are shown to write has no error in their editor."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]
PAGES = ("README.md", "docs/getting_started.md", "docs/session.md", "docs/tracking.md")
SESSION = """
import numpy as np
import scarl_sionna as ss
from typing import Any
state: ss.WorldState
world: ss.World
radar: ss.RadarSpec
cube: Any
adc: Any
paths: ss.RadarPaths
rng: np.random.Generator
mount: Any
pose: ss.Pose
rig: ss.Rig
"""


@pytest.mark.slow  # the checker reads all of the package
def test_the_pages_pass(tmp_path) -> None:
    files = []
    for page in PAGES:
        blocks = re.findall(r"```python\n(.*?)```", (REPO / page).read_text(encoding="utf-8"), flags=re.DOTALL)
        assert blocks
        files.append(tmp_path / f"page_{Path(page).stem.lower()}.py")
        files[-1].write_text(SESSION + "\n".join(blocks), encoding="utf-8")
    allowed = ["no-redef", "import-not-found", "import-untyped", "no-untyped-call", "no-untyped-def", "var-annotated"]
    options = [f"--disable-error-code={code}" for code in allowed]
    command = [sys.executable, "-m", "mypy", "--config-file", REPO / "pyproject.toml", "--follow-imports=silent"]
    done = subprocess.run([*command, *options, *files], capture_output=True, text=True, cwd=REPO, check=False)
    assert done.returncode == 0, done.stdout
