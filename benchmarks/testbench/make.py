"""Make the problems of the test bench: meshes, descriptions and reference results that need nothing of this project.

    python benchmarks/testbench/make.py [--out FOLDER]

References are the closed forms and quadratures of `tests/oracles`, a method of moments (`tests/data/rcs`) and the
measured ranges of docs/validation.md. Nothing here comes from the simulator itself.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.validation.rows import read
from benchmarks.validation.sources import SOURCES
from tests.oracles import fresnel, link, multipath, rcs, two_ray, waveforms
from tests.oracles.near_field_po import rectangle_transfer
from tests.scenes import ball, plane

HERE = Path(__file__).resolve().parent
FREQUENCY = 77e9
WAVELENGTH = rcs.WAVELENGTH_77
BALL = 0.05
"""Radius of the ball [m]: 40 wavelengths around, few enough triangles to keep."""
RCS_UNIT, GAIN_UNIT = "dBsm", "dB"
GAIN = "power gain between isotropic vertical antennas of one place, all echoes added with their phases"
RCS = "monostatic far-field radar cross section; columns: direction from the target to the radar, from +z and from +x"


@dataclass(frozen=True)
class Problem:
    """A problem: its description as it is written, its meshes, and the rows of its reference."""

    name: str
    title: str
    asked: str
    unit: str
    source: str
    rows: Sequence[Mapping[str, Any]]
    kind: str = "level"
    meshes: Mapping[str, trimesh.Trimesh] = field(default_factory=dict)
    more: Mapping[str, Any] = field(default_factory=dict)


def text(value: Any) -> Any:
    """Return a number in as few digits as the reference has, anything else as it is."""
    return f"{value:.7g}" if isinstance(value, float) else value


def write(problem: Problem, folder: Path) -> None:
    """Write one problem."""
    folder = folder / problem.name
    folder.mkdir(parents=True, exist_ok=True)
    described = {key: getattr(problem, key) for key in ("name", "title", "kind", "asked", "unit", "source")} | dict(
        problem.more
    )
    (folder / "problem.json").write_text(json.dumps(described, indent=1) + "\n", encoding="utf-8")
    for name, mesh in problem.meshes.items():
        mesh.export(folder / f"{name}.ply")
    with (folder / "reference.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(["case", *(key for key in problem.rows[0] if key != "case")])
        for number, row in enumerate(problem.rows):
            table.writerow([row.get("case", number), *(text(value) for key, value in row.items() if key != "case")])


def decibels(value: Any) -> Any:
    """Return ten times the common logarithm."""
    return 10.0 * np.log10(value)


def cut(
    theta: Iterable[float], phi: Iterable[float], values: Iterable[float], tolerance: float
) -> list[dict[str, Any]]:
    """Return the rows of a cut: angles [deg], reference and tolerance [dB]."""
    return [
        {"theta_deg": float(t), "phi_deg": float(p), "value": float(value), "tolerance": tolerance}
        for t, p, value in zip(theta, phi, values, strict=True)
    ]


def target(mesh: trimesh.Trimesh, **more: Any) -> dict[str, Any]:
    """Return meshes and description of a perfectly conducting body alone."""
    return {
        "meshes": {"target": mesh},
        "more": {
            "frequency_hz": FREQUENCY,
            "polarisation": "VV",
            "objects": [{"mesh": "target.ply", "material": "perfect conductor"}],
            **more,
        },
    }


def unit(shape: tuple[Any, Any], scale: float) -> trimesh.Trimesh:
    """Return one of the oracles' unit meshes, scaled."""
    return trimesh.Trimesh(np.array(shape[0]) * scale, shape[1], process=False)


def cross_sections() -> list[Problem]:
    """Return bodies of closed forms, many wavelengths large."""
    angles = [angle for angle in rcs.PLATE_DEG if angle <= 5]
    plate = cut(angles, [0.0] * len(angles), rcs.PLATE_DBSM[: len(angles)], 0.5)
    off = np.array(rcs.CYLINDER_DEG)
    exact = decibels(rcs.cylinder_physical_optics(0.05, 0.5, WAVELENGTH, np.radians(off)))
    boresight = float(np.degrees(np.arccos(1 / np.sqrt(3))))
    sphere = float(decibels(np.pi * BALL**2 * rcs.mie_sphere(2 * np.pi * BALL / WAVELENGTH)))
    views = [(90.0, 0.0), (90.0, 17.0), (70.0, 40.0), (50.0, 100.0), (30.0, 200.0), (10.0, 300.0)]
    side = trimesh.creation.cylinder(radius=0.05, height=0.5, sections=128)
    return [
        Problem("plate", "Square plate of 0.1 m, normal +z", RCS, RCS_UNIT, "physical optics: Ruck et al., 1970", plate,
                **target(unit(rcs.PLATE_MESH, 0.1))),
        Problem("cylinder", "Cylinder along z, radius 0.05 m, height 0.5 m, at broadside and beside it", RCS, RCS_UNIT,
                "physical optics, exact integral of the round side and the cap (Abramowitz, Stegun, 12.1.7)",
                cut(90.0 - off, [20.0] * len(off), exact, 0.5), **target(side)),
        Problem("sphere", "Sphere of radius 0.05 m in 1,280 triangles", RCS, RCS_UNIT, "Mie's series",
                cut(*zip(*views, strict=True), [sphere] * len(views), 1.0), **target(ball(BALL, subdivisions=3))),
        Problem("trihedral", "Triangular trihedral of legs of 0.1 m along +x, +y, +z, azimuth cut through boresight",
                RCS, RCS_UNIT, "geometrical optics: Knott et al., Radar Cross Section, section 6.4",
                cut([boresight] * 4, rcs.TRIHEDRAL_AZIMUTH_DEG[:4], rcs.TRIHEDRAL_AZIMUTH_DBSM[:4], 1.0),
                **target(unit(rcs.TRIHEDRAL_MESH, 0.1))),
        Problem("dihedral", "Dihedral of two plates of 0.1 m, seam on z, at boresight", RCS, RCS_UNIT,
                "geometrical optics: Knott et al., Radar Cross Section, section 6.4",
                cut([90.0], [45.0], [rcs.DIHEDRAL_DBSM], 0.5), **target(unit(rcs.DIHEDRAL_MESH, 0.1))),
    ]  # fmt: skip # a table


def full_wave() -> list[Problem]:
    """Return small bodies of 3 wavelengths by a method of moments, within 15 dB of their largest echo."""
    source = "method of moments (EFIE, RWG functions), two meshes within 0.1 dB at the peak"
    found = []
    for name, title, shape, cuts in (
        ("plate", "Square plate of 3 wavelengths, normal +z", rcs.PLATE_MESH, ("phi0", "phi45")),
        ("dihedral", "Dihedral of two plates of 3 wavelengths", rcs.DIHEDRAL_MESH, ("az", "el")),
        ("trihedral", "Trihedral of legs of 3 wavelengths", rcs.TRIHEDRAL_MESH, ("az", "el")),
    ):
        rows = []
        for which in cuts:
            of_cut = rcs.table(f"mom_{name}3lam_{which}")
            level = of_cut["vv_dBlam2"] + decibels(WAVELENGTH**2)
            chosen = np.flatnonzero(level > level.max() - 15.0)[::6]
            rows += cut(of_cut["theta_deg"][chosen], of_cut["phi_deg"][chosen], level[chosen], 2.0)
        found.append(
            Problem(f"mom_{name}", title, RCS, RCS_UNIT, source, rows, **target(unit(shape, 3.0 * WAVELENGTH)))
        )
    return found


def near_plate() -> Problem:
    """Return a plate in whose near field the radar is."""
    size = 0.3
    rows = []
    for angle in (0.0, 0.3, 0.6, 1.0, 1.7):
        turned = np.radians(angle)
        radar = 10.0 * np.array([np.cos(turned), np.sin(turned), 0.0])
        corner = np.array([0.0, -size / 2, -size / 2])
        field_ = rectangle_transfer(corner, [0, size, 0], [0, 0, size], radar, WAVELENGTH, np.array([0.0, 0.0, 1.0]))
        rows.append({"radar_x_m": radar[0], "radar_y_m": radar[1], "radar_z_m": 0.0,
                     "value": float(2.0 * decibels(abs(field_))), "tolerance": 0.5})  # fmt: skip # a table
    return Problem(
        "near_plate",
        "Square plate of 0.3 m, normal +x, in the origin; its far field begins at 46 m",
        GAIN,
        GAIN_UNIT,
        "physical optics near the plate, by Gauss-Legendre quadrature",
        rows,
        **target(plane(size, size, normal=(1, 0, 0))),
    )


GROUND = 3.18 - 0.1j
"""Permittivity of asphalt."""
BAND = np.linspace(76.5e9, 77.5e9, 41)
RADAR_HEIGHT, POST_RADIUS, POST_HEIGHT = 0.5, 0.03, 0.8


def post_on_ground() -> Problem:
    """Return a post that stands on a smooth ground."""
    rows = []
    for distance in (8.0, 12.0, 18.0, 25.0, 35.0, 50.0, 70.0):
        power = abs(two_ray.post_by_image_theory(distance, POST_RADIUS, POST_HEIGHT, RADAR_HEIGHT, GROUND, BAND)) ** 2
        rows.append({"distance_m": distance, "value": float(decibels(power.mean())), "tolerance": 1.0})
    post = trimesh.creation.cylinder(radius=POST_RADIUS, height=POST_HEIGHT, sections=96)
    post.apply_translation([0.0, 0.0, POST_HEIGHT / 2])
    more = {
        "band_hz": [float(BAND[0]), float(BAND[-1])],
        "polarisation": "VV",
        "objects": [
            {"mesh": "ground.ply", "material": "ground"},
            {"mesh": "post.ply", "material": "perfect conductor"},
        ],
        "materials": {"ground": {"permittivity": [GROUND.real, GROUND.imag], "surface": "smooth"}},
        "radar": f"at (distance_m, 0, {RADAR_HEIGHT}), looks along -x",
    }
    return Problem(
        "post_on_ground",
        "Round metal post of 0.8 m on a smooth ground: direct echo and ground bounces",
        GAIN + ", of those that touch the post; mean over the band",
        GAIN_UNIT,
        "image theory with Fresnel's coefficients, physical optics of the post",
        rows,
        meshes={"post": post, "ground": plane(256.0, 64.0)},
        more=more,
    )


def ghosts() -> Problem:
    """Return a ball beside a metal wall: the target and its ghosts."""
    position = np.array([20.0, -1.0, 0.0])
    image = multipath.mirrored(position, (0, 1, 0), 4.0)
    near, far = (float(np.linalg.norm(point)) for point in (position, image))

    rows = []
    for case, there, back, ways in (
        ("target", near, near, 1),
        ("one way over the wall", near, far, 2),
        ("both ways over the wall", far, far, 1),
    ):
        # the ball's front lies a radius before its middle, on either way
        level = ways * WAVELENGTH * BALL / 2.0 / (4.0 * np.pi * (there - BALL) * back)
        distance = (there + back) / 2.0 - BALL
        rows.append({"case": case, "range_m": distance, "value": float(2.0 * decibels(level)), "tolerance": 1.0})
    more = {
        "frequency_hz": FREQUENCY,
        "polarisation": "VV",
        "objects": [
            {"mesh": "wall.ply", "material": "perfect conductor"},
            {"mesh": "ball.ply", "material": "perfect conductor"},
        ],
        "radar": "in the origin, looks along +x",
    }
    return Problem(
        "wall_ghosts",
        "Ball of radius 0.05 m at (20, -1, 0) m, metal wall at y = 4 m: target and ghosts",
        GAIN + ", of those that touch the ball within 0.15 m of the range of the column",
        GAIN_UNIT,
        "image theory, geometrical optics of the ball",
        rows,
        meshes={"wall": plane(64.0, 32.0, (16, 4, 0), (0, -1, 0)), "ball": ball(BALL, position, 3)},
        more=more,
    )


def slabs() -> Problem:
    """Return large panels at normal incidence, whose mirror image is the radar itself."""
    rows = []
    for name, permittivity, thickness in (
        ("glass", fresnel.ITU_GLASS, 0.004),
        ("plastic", 2.35 - 0.002j, 0.003),
        ("concrete", fresnel.ITU_CONCRETE, 0.2),
    ):
        for distance in (5.0, 20.0):
            reflected = abs(fresnel.reflection(permittivity, 0.0, thickness)[0]) ** 2
            image = (WAVELENGTH / (4.0 * np.pi * 2.0 * distance)) ** 2
            rows.append(
                {
                    "case": f"{name} {distance:g} m",
                    "permittivity_real": permittivity.real,
                    "permittivity_imag": permittivity.imag,
                    "thickness_m": thickness,
                    "distance_m": distance,
                    "value": float(decibels(reflected * image)),
                    "tolerance": 0.5,
                }
            )
    return Problem(
        "slabs",
        "Panel of 8 m in the plane x = 0, from +x at normal incidence",
        GAIN + ", within 0.02 m of the distance",
        GAIN_UNIT,
        "coefficient of a layer between air (Born, Wolf, section 1.6), image theory",
        rows,
        meshes={"panel": plane(8.0, 8.0, normal=(1, 0, 0))},
        more={"frequency_hz": FREQUENCY, "polarisation": "VV", "radar": "at (distance_m, 0, 0), looks along -x"},
    )


WAVEFORM = {
    "start_frequency_hz": 76.5e9,
    "slope_hz_per_s": 20e12,
    "sample_rate_hz": 10e6,
    "first_sample_s": 5e-6,
    "num_samples": 64,
    "chirp_interval_s": 60e-6,
    "num_chirps": 4,
    "transmitters_m": [[0.0, 0.0, 0.0]],
    "receivers_m": [[0.0, 0.02, 0.0], [0.0, 0.022, 0.0]],
}
TARGETS = (  # position [m] and velocity [m/s] at time 0, strength of the echo there
    ([12.0, 1.0, 0.3], [-15.0, 2.0, 0.0], 1.0),
    ([25.0, -4.0, 0.0], [30.0, 10.0, 0.0], 0.5),
)


def raw_data() -> Problem:
    """Return samples of two moving points by the exact retarded delay."""
    starts = np.arange(WAVEFORM["num_chirps"]) * WAVEFORM["chirp_interval_s"]
    ts = WAVEFORM["first_sample_s"] + np.arange(WAVEFORM["num_samples"]) / WAVEFORM["sample_rate_hz"]
    sender = WAVEFORM["transmitters_m"][0]
    rows = []
    for number, receiver in enumerate(WAVEFORM["receivers_m"]):
        samples = np.zeros((len(starts), len(ts)), complex)
        for position, velocity, strength in TARGETS:
            carriers = np.full(len(starts), WAVEFORM["start_frequency_hz"])
            one = waveforms.dechirped(
                position, velocity, starts, ts, carriers, WAVEFORM["slope_hz_per_s"], (sender, receiver)
            )
            samples += strength * one
        rows += [
            {"case": f"{number}/{chirp}/{sample}", "real": float(value.real), "imag": float(value.imag)}
            for chirp, row in enumerate(samples)
            for sample, value in enumerate(row)
        ]
    targets = [{"position_m": p, "velocity_m_s": v, "strength": s} for p, v, s in TARGETS]
    return Problem(
        "raw_data",
        "Samples of a linear FMCW radar, two points that move at constant velocity",
        "samples after the mixer, cases receiver/chirp/sample; a point's strength is its amplitude at time 0 over that "
        "of its round trip to the origin, and falls with both ways; one common complex factor is free",
        "dB of what differs",
        "phase of the transmitted ramp at the exact retarded delay, extended precision",
        rows,
        kind="complex",
        more={"tolerance_db": -40.0, "level_tolerance_db": 0.5, "waveform": WAVEFORM, "targets": targets},
    )


RAIN = {("H", 5.0): 3.5931193, ("H", 25.0): 11.405363, ("V", 5.0): 3.5199798, ("V", 25.0): 10.987983}
"""Attenuation by polarisation and rate of rain [mm/h] at 77 GHz [dB/km]."""


def budgets() -> list[Problem]:
    """Return the radar equation with noise, and rain."""
    power, gain, frequency, figure, rate, samples, chirps = 10 ** (1.2 - 3), 10.0, FREQUENCY, 10**1.2, 20e6, 512, 256
    rows = []
    for distance in (10.0, 50.0, 100.0, 200.0):
        received = link.received_power(power, gain, frequency, 10.0, distance)
        ratio = received / link.noise_power(rate, figure) * samples * chirps
        rows.append({"distance_m": distance, "value": float(decibels(ratio)), "tolerance": 0.3})
    rain = [
        {"rain_mm_h": rate_, "polarisation": pol, "way_m": 200.0, "value": value * 0.4, "tolerance": 0.05}
        for (pol, rate_), value in RAIN.items()
    ]
    radar = {"tx_power_dbm": 12.0, "gain_db": 10.0, "noise_figure_db": 12.0, "sample_rate_hz": rate,
             "num_samples": samples, "num_chirps": chirps, "rcs_m2": 10.0}  # fmt: skip # a table
    return [
        Problem("noise", "Point target of 10 m2 in free space over thermal noise",
                "ratio of signal to noise in the cell of the target after a Fourier transform of samples and chirps "
                "without a window, one receiver with complex samples", "dB", "radar equation; k T0 B F at 290 K", rows,
                more={"frequency_hz": frequency, "radar": radar}),
        Problem("rain", "Loss of an echo from a distance in rain", "two-way loss by the rain alone over the way", "dB",
                "Recommendation ITU-R P.838-3, computed by the package itur", rain, more={"frequency_hz": frequency}),
    ]  # fmt: skip # a table


def measured() -> Problem:
    """Return the measured ranges of docs/validation.md to which nothing of ours was fitted."""
    rows = [
        {
            "case": row["name"],
            "quantity": row["quantity"],
            "unit": row["unit"],
            "low": row["low"],
            "high": row["high"],
            "source": SOURCES[row["source"]].citation,
        }
        for row in read()
        if "quantity" in row and row["basis"] == "held out"
    ]
    return Problem(
        "measured",
        "What others measured: grounds, people, vehicles, panels, weather, motion, radar boards",
        "the quantity of each case, in its unit; docs/validation.md says how ours was computed",
        "way outside",
        "see each case",
        rows,
        kind="range",
    )


def problems() -> list[Problem]:
    """Return all problems."""
    return [
        *cross_sections(),
        *full_wave(),
        near_plate(),
        post_on_ground(),
        ghosts(),
        slabs(),
        raw_data(),
        *budgets(),
        measured(),
    ]


def main() -> None:
    """Write all problems."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=HERE / "problems")
    out = parser.parse_args().out
    for problem in problems():
        write(problem, out)
        print(problem.name, len(problem.rows), "cases")


if __name__ == "__main__":
    main()
