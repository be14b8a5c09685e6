"""Error and time of bodies drawn with flat faces, over the angle at which faces count as curved and the fineness.

Run: ``python benchmarks/curved_faces.py``, two minutes on two quiet cores.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.rcs import load_body, rcs
from tests.oracles import rcs as oracle

FREQUENCY = 77e9
LAMBDA = SPEED_OF_LIGHT / FREQUENCY
KNOBS = [(0.0, 0.05), (35.0, 0.5), (35.0, 0.2), (35.0, 0.1), (35.0, 0.05), (35.0, 0.02)]


def posts():
    """Yield name, body, theta, phi and exact level [dBsm] of posts broadside, and of balls from all sides."""
    for radius in (0.05, 0.13, 0.4):
        for sections in (12, 14, 24):
            body = load_body(trimesh.creation.cylinder(radius=radius, height=1.0, sections=sections))
            exact = 10 * np.log10(oracle.cylinder_physical_optics(radius, 1.0, LAMBDA, 0.0))
            phi = np.linspace(0.0, 2.0 * np.pi / sections, 17)
            yield f"post {radius:g} m, {sections} sides", body, np.full(17, np.pi / 2.0), phi, exact
    rng = np.random.default_rng(1)
    theta, phi = np.arccos(rng.uniform(-1.0, 1.0, 20)), rng.uniform(0.0, 2.0 * np.pi, 20)
    exact = 10 * np.log10(np.pi * 0.15**2)
    yield "ball 0.15 m, icosphere, 320 faces", load_body(trimesh.creation.icosphere(2, radius=0.15)), theta, phi, exact
    ball = trimesh.creation.uv_sphere(radius=0.15, count=[12, 12])
    yield f"ball 0.15 m, 12 meridians, {len(ball.faces)} faces", load_body(ball), theta, phi, exact


def second_bounce() -> None:
    """Print the error of a post of 14 sides that stands on a plate, where half of the double bounces meet it first."""

    def body(sections):
        post = trimesh.creation.cylinder(radius=0.05, height=0.5, sections=sections).apply_translation([0, 0, 0.25])
        corners = 0.6 * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
        return load_body(trimesh.util.concatenate([post, trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)])]))

    phi, theta = np.linspace(0.0, 2.0 * np.pi / 14, 9), np.radians(75.0)
    exact = 10 * np.log10(rcs(body(360), FREQUENCY, theta, phi))
    for crease in (0.0, 35.0):
        found = rcs(body(14), FREQUENCY, theta, phi, settings=SbrSettings(crease_angle_deg=crease))
        error = 10 * np.log10(found) - exact
        print(f"post of 14 sides on a plate, {crease:g} deg: {error.min():+.1f} to {error.max():+.1f} dB")


def main() -> None:
    print("| body | " + " | ".join(f"{crease:g} deg, {phase:g} rad" for crease, phase in KNOBS) + " |")
    print("|---" * (len(KNOBS) + 1) + "|")
    for name, body, theta, phi, exact in posts():
        cells = []
        for crease, phase in KNOBS:
            settings = SbrSettings(crease_angle_deg=crease, surface_phase=phase)
            rcs(body, FREQUENCY, theta[:1], phi[:1], settings=settings)
            start = time.process_time()
            error = 10 * np.log10(rcs(body, FREQUENCY, theta, phi, settings=settings)) - exact
            spent = (time.process_time() - start) / len(theta)
            cells.append(f"{error.min():+.2f} to {error.max():+.2f}, {1e3 * spent:.0f} ms")
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    second_bounce()


if __name__ == "__main__":
    main()
