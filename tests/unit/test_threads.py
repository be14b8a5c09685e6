"""A process with few threads still renders and writes images."""

from __future__ import annotations

import subprocess
import sys

CODE = """
from scarl_sionna.engine.threads import limit_threads
from scarl_sionna.engine import variant
limit_threads(1)
import drjit
print(drjit.thread_count())
with variant.optical():
    import mitsuba as mi
    import numpy as np
    mi.Bitmap(np.ones((64, 64, 3), np.float32)).write({path!r})
"""


def test_a_process_with_the_fewest_threads_writes_an_image(tmp_path) -> None:
    """With a thread count of one it would hang (Mitsuba 3.9.1, Dr.Jit 1.5.0)."""
    path = tmp_path / "image.exr"
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(path=str(path))], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2"]
    assert path.stat().st_size > 0
