"""Environments of programs that read our files in tests: made by scripts/client_env.sh, kept in .clients/."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[1]
CLIENTS = REPO / "tests" / "clients"


def client_python(name: str, config: pytest.Config) -> Path:
    """Return the interpreter of an environment; the slow run makes it if it is not there, any other skips the test."""
    folder = REPO / ".clients" / name
    if not (folder / ".packages").exists() and not config.getoption("--run-slow"):
        pytest.skip(f"no environment .clients/{name}: scripts/client_env.sh {name} makes it, and so does --run-slow")
    made = subprocess.run(
        ["bash", REPO / "scripts" / "client_env.sh", name], capture_output=True, text=True, timeout=1800, check=False
    )
    if made.returncode:
        pytest.skip(f"environment {name} cannot be made here: {made.stderr.strip()[-300:]}")
    return folder / "bin" / "python"


def run_client(python: Path, script: str, *arguments: object, timeout: float = 600.0) -> str:
    """Run a script of tests/clients and return what it prints; its errors fail the test."""
    done = subprocess.run(
        [python, CLIENTS / script, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout
