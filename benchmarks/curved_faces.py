"""Error and time of bodies drawn with flat faces, over the angle at which faces count as curved and the fineness.

Run: ``python benchmarks/curved_faces.py [uneven]``, two minutes on two quiet cores; `uneven` is of ellipses instead.
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


def uneven() -> None:
    """Print the error of elliptic posts and ellipsoids over the number of their sides, median / largest."""
    wavenumber = 2.0 * np.pi / LAMBDA
    phi = np.linspace(0.0, np.pi / 2.0, 73)
    for a, b in ((0.13, 0.13), (0.15, 0.1), (0.2, 0.1)):
        exact = wavenumber * (a * b) ** 2 / ((a * np.cos(phi)) ** 2 + (b * np.sin(phi)) ** 2) ** 1.5
        posts = [trimesh.creation.cylinder(radius=1.0, height=1.0, sections=sides) for sides in (12, 14, 16, 24)]
        _row(f"post {a:g} x {b:g} m", posts, (a, b, 1.0), (np.full(73, np.pi / 2.0), phi), exact)
    rng = np.random.default_rng(3)
    phi, theta = rng.uniform(0.0, 2.0 * np.pi, 60), np.arccos(rng.uniform(-0.5, 0.5, 60))
    balls = [trimesh.creation.uv_sphere(radius=1.0, count=[sides, sides]) for sides in (12, 14, 16, 24)]
    balls += [trimesh.creation.icosphere(times) for times in (2, 3)]
    for size in ((0.15, 0.15, 0.15), (0.25, 0.2, 0.15), (0.5, 0.3, 0.2)):
        towards = np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
        square = sum((axis * part) ** 2 for axis, part in zip(size, towards, strict=True))
        _row(f"ellipsoid {size} m", balls, size, (theta, phi), np.pi * np.prod(size) ** 2 / square**2)


def _row(name, meshes, size, aspect, exact) -> None:
    cells = []
    for mesh in meshes:
        body = trimesh.Trimesh(mesh.vertices * np.array(size), mesh.faces, process=False)
        error = np.abs(10.0 * np.log10(rcs(body, FREQUENCY, *aspect) / exact))
        cells.append(f"{np.median(error):.2f} / {error.max():.2f}")
    print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    if "uneven" in sys.argv[1:]:
        uneven()
        return
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
