"""Answers of RadarSimPy's `sim_rcs` for bodies alone, where a user has it: it is not in the public package index.

    python benchmarks/testbench/adapters/radarsimpy.py ANSWERS [PROBLEM ...]

Written by its published signature (angles in degrees, polarisation as vectors, square metres back) and **never run**,
for want of a copy. `DENSITY` is its number of rays in a wavelength.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:] = [place for place in sys.path if Path(place or ".").resolve() != HERE]  # this file has the package's name
sys.path.insert(0, str(HERE.parents[2]))

from benchmarks.harness import machine  # noqa: E402 - after the path
from benchmarks.testbench.adapters.answers import run  # noqa: E402

DENSITY = 10.0


def cross_section(folder: Path, described: Mapping[str, Any], rows: Sequence[Mapping[str, str]]) -> list[float]:
    """Answer by `sim_rcs`, one direction at a time with V along theta-hat."""
    from radarsimpy import sim_rcs

    found = []
    for row in rows:
        theta_deg, phi_deg = float(row["theta_deg"]), float(row["phi_deg"])
        theta, phi = np.radians(theta_deg), np.radians(phi_deg)
        vertical = [np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)]
        section = sim_rcs(
            [{"model": str(folder / "target.ply")}],
            described["frequency_hz"],
            inc_phi=phi_deg,
            inc_theta=theta_deg,
            inc_pol=vertical,
            obs_pol=vertical,
            density=DENSITY,
        )
        found.append(float(10.0 * np.log10(max(float(np.squeeze(section)), 1e-30))))
    return found


SOLVERS = dict.fromkeys(
    ("plate", "cylinder", "sphere", "trihedral", "dihedral", "mom_plate", "mom_dihedral", "mom_trihedral"),
    cross_section,
)

if __name__ == "__main__":
    try:
        import radarsimpy
    except ImportError:
        sys.exit("error: the package 'radarsimpy' is not here; its makers give it at radarsimx.com")
    run(__doc__, SOLVERS, {"simulator": "RadarSimPy", "version": radarsimpy.__version__, "machine": machine()})
