"""Questions to foreign libraries, asked in a process of their own."""

from __future__ import annotations

import subprocess
import sys

TIMEOUT = 60.0
"""Longest time that a probing process may take [s]; a cold disk needs about one."""


def run_probe(code: str, *arguments: str) -> list[str]:
    """Run code in a process of its own, so that a crash in a foreign library cannot end ours.

    Return the words it printed.
    """
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-S", "-c", code, *arguments],
            capture_output=True,
            text=True,
            timeout=TIMEOUT,
            stdin=subprocess.DEVNULL,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return []
    return done.stdout.split() if done.returncode == 0 else []
