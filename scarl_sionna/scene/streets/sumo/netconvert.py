"""Runs SUMO's program netconvert: in a folder, with a time limit, without looking anything up in the network."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

from scarl_sionna.core.errors import MissingPackageError, SimulatorError

LONGEST = 300.0
"""Time after which netconvert is ended [s]."""


def sumo_home() -> Path | None:
    """Return the folder of the package ``eclipse-sumo``, None where it is not installed."""
    try:
        import sumo
    except ImportError:
        return None
    home = getattr(sumo, "SUMO_HOME", None)  # a folder of this name is no package
    return None if home is None else Path(home)


def netconvert_path() -> str:
    """Return the path of netconvert: of the package ``eclipse-sumo``, or on the PATH.

    Raises
    ------
    MissingPackageError
        If there is none.
    """
    home = sumo_home()
    found = shutil.which("netconvert", path=str(home / "bin")) if home is not None else shutil.which("netconvert")
    if found is None:
        raise MissingPackageError("eclipse-sumo", "sumo")
    return found


def run_netconvert(options: Sequence[str], folder: Path, result: Path, what: str) -> None:
    """Run netconvert.

    Parameters
    ----------
    options : sequence of str
    folder : Path
        In which it runs.
    result : Path
        The file that it must have written.
    what : str
        What it is given, for messages.

    Raises
    ------
    MissingPackageError
        If it is not installed (``pip install 'scarl-sionna[sumo]'``).
    SimulatorError
        If it refuses what it is given, or takes longer than `LONGEST`.
    """
    home = sumo_home()
    environment = {**os.environ, **({"SUMO_HOME": str(home)} if home is not None else {})}
    command = [netconvert_path(), *options, "--xml-validation", "never", "--xml-validation.net", "never"]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, errors="replace", check=False,
            timeout=LONGEST, stdin=subprocess.DEVNULL,
        )  # fmt: skip # a call
    except subprocess.TimeoutExpired:
        raise SimulatorError(f"netconvert is not done with {what} after {LONGEST:g} s; give less") from None
    if done.returncode != 0 or not result.is_file():
        reasons = [line for line in (done.stderr + done.stdout).splitlines() if line.startswith("Error")]
        ended = f"ended by signal {-done.returncode}" if done.returncode < 0 else f"exit status {done.returncode}"
        raise SimulatorError(f"netconvert refuses {what}: {' '.join(reasons)[:500] or ended}")
