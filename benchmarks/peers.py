"""What other simulators publish of themselves, beside closed forms and ours: the table of docs/testbench.md.

python benchmarks/peers.py [--write docs/testbench.md]      2 CPU seconds

Only figures that were read where they are published. RadarSimPy's are those that its own test of `sim_rcs` holds it to,
tests/test_module_sim_rcs.py at commit e665fe2: a plate of 5 m (models/plate5x5.stl), one ray in a wavelength.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from benchmarks.harness import write_block
from scarl_sionna.core.units import SPEED_OF_LIGHT

SIDE = 5.0
"""Of the plate [m], which looks along x."""


class Published(NamedTuple):
    """A figure of RadarSimPy: frequency [Hz], azimuths of transmitter and receiver [deg], RCS and its tolerance."""

    frequency: float
    incident: float
    observed: float
    dbsm: float
    tolerance: float


FIGURES = (
    Published(1e9, 0.0, 0.0, 48.3, 0.15),
    Published(3e9, 0.0, 0.0, 59.2, 0.15),
    Published(1e9, 30.0, -30.0, 47.0, 1.5),
    Published(1e9, 30.0, -24.0, 34.0, 1.5),
    Published(1e9, 30.0, 65.0, 6.0, 1.5),
)
"""Vertical polarisation; tolerances are those of NumPy's `assert_almost_equal` with the decimals stated there."""


def closed_form(figure: Published) -> float:
    """Return the RCS of the plate by physical optics in closed form [dBsm], V across the plane of incidence.

    4 pi A^2 / lambda^2 cos^2(incidence) sinc^2(k a (sin i + sin s) / 2).
    """
    wavelength = SPEED_OF_LIGHT / figure.frequency
    incident, observed = np.radians([figure.incident, figure.observed])
    phase = np.pi * SIDE / wavelength * (np.sin(incident) + np.sin(observed))
    field = SIDE**2 / wavelength * np.cos(incident) * np.sinc(phase / np.pi)
    return float(10.0 * np.log10(4.0 * np.pi * field**2))


def ours(figure: Published) -> float:
    """Return the same by `ss.rcs` [dBsm]."""
    half = SIDE / 2.0
    corners = [[0.0, y, z] for y, z in ((-half, -half), (half, -half), (half, half), (-half, half))]
    plate = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    upright, incident, observed = np.pi / 2.0, np.radians(figure.incident), np.radians(figure.observed)
    sigma = ss.rcs(plate, figure.frequency, upright, incident, theta_s=upright, phi_s=observed)
    return float(10.0 * np.log10(sigma))


def table() -> str:
    """Return the table."""
    lines = [
        "| plate of 5 m, V | closed form [dBsm] | RadarSimPy, published [dBsm] | off | `ss.rcs` [dBsm] | off |",
        "|---|---|---|---|---|---|",
    ]
    for one in FIGURES:
        exact, here = closed_form(one), ours(one)
        where = "along the normal" if one.incident == one.observed else f"{one.incident:g} to {one.observed:g} deg"
        lines.append(
            f"| {1e-9 * one.frequency:g} GHz, {where} | {exact:.2f} | {one.dbsm:g} +- {one.tolerance:g} | "
            f"{one.dbsm - exact:+.1f} dB | {here:.2f} | {here - exact:+.2f} dB |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", type=Path, metavar="PAGE")
    page = parser.parse_args().write
    if page is None:
        print(table())
    else:
        write_block(page, "peers", table())
