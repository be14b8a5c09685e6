"""Answers of this project, each by the public call that a user would take, with its defaults.

    python benchmarks/testbench/adapters/scarl.py ANSWERS [PROBLEM ...]

CPU seconds are those of the process with the compilation of kernels, and without the import of packages.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))

import scarl_sionna as ss
from benchmarks.harness import machine
from benchmarks.testbench.adapters.answers import run
from benchmarks.validation.rows import read as read_rows
from scarl_sionna.core.specs.radar.pattern import IsotropicPattern
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.core.units import SPEED_OF_LIGHT, VACUUM_PERMITTIVITY
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.antenna import PathGeometry
from scarl_sionna.radar.weather.attenuation import weather_attenuation
from scarl_sionna.scene.materials.table import MaterialTable, RadioMaterial, builtin_materials
from scarl_sionna.signal.noise import cell_noise_power
from tests.scenes import Material, Thing, write_scene

Rows = Sequence[Mapping[str, str]]
RADAR = ss.RadarSpec().with_(start_frequency=77e9 - 150e6, pattern=IsotropicPattern(), elevation_fov_deg=90.0)
"""Isotropic antennas; the middle of the ramp is at 77 GHz."""
ORIGIN = ((0.0, 0.0, 0.0),)
NOTHING_DB = -300.0
"""Where there is no echo."""


def column(rows: Rows, name: str) -> Any:
    """Return a column as numbers."""
    return np.array([float(row[name]) for row in rows])


def decibels(power: Any) -> list[float]:
    """Return decibels of powers."""
    return [float(value) for value in 10.0 * np.log10(np.maximum(power, 1e-30))]


def mesh_of(folder: Path, name: str) -> trimesh.Trimesh:
    """Return a mesh as it stands in the file."""
    return trimesh.load(folder / f"{name}.ply", process=False)


def cross_section(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `ss.rcs`."""
    theta, phi = np.radians(column(rows, "theta_deg")), np.radians(column(rows, "phi_deg"))
    return decibels(ss.rcs(mesh_of(folder, "target"), described["frequency_hz"], theta, phi, described["polarisation"]))


def state_of(things: Sequence[Thing], own: RadioMaterial | None = None) -> Any:
    """Return a small world; `own` is the radio material of things whose material is "own"."""
    table = MaterialTable([*builtin_materials().values(), *([own] if own else [])])
    with tempfile.TemporaryDirectory() as folder:
        path = write_scene(Path(folder), things, materials={"own": Material(radio=own.name)} if own else None)
        return load_scene(path, table).at(0.0)


def material(permittivity: complex, thickness: float | None = None) -> RadioMaterial:
    """Return a smooth material of a permittivity at 77 GHz."""
    conductivity = -permittivity.imag * 2.0 * np.pi * 77e9 * VACUUM_PERMITTIVITY
    return RadioMaterial(
        name="own",
        relative_permittivity=permittivity.real,
        conductivity=conductivity,
        thickness=thickness,
        source="the test bench",
        uncertainty="none",
    )


def gain(
    state: Any, pose: ss.Pose, frequencies: Any, touched: str | None = None, gate: tuple[float, float] | None = None
) -> float:
    """Return the power gain [dB] by `auto`, mean over frequencies, of the paths that touch an instance within a gate.

    `gate` is the middle and the half width of the ranges to look at [m].
    """
    paths = ss.solve_paths(state, RADAR, pose)
    if touched:
        number = next(info.instance for info in state.world.instances.values() if info.name == touched)
        paths = paths.select((paths.instance == number).any(axis=1))
    if gate:
        paths = paths.select(np.abs(PathGeometry.of(paths, RADAR).center_length() / 2.0 - gate[0]) < gate[1])
    if not paths.num_paths:
        return NOTHING_DB
    length = PathGeometry.of(paths, RADAR).center_length()
    wave = 2.0 * np.pi * np.atleast_1d(frequencies) / SPEED_OF_LIGHT
    return decibels(np.mean(np.abs(np.exp(-1j * np.outer(wave, length)) @ paths.a[:, 0, 0]) ** 2, keepdims=True))[0]


def near_plate(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `auto`."""
    state = state_of([Thing("target", mesh_of(folder, "target"), "TrafficSign", "steel")])
    places = np.stack([column(rows, f"radar_{axis}_m") for axis in "xyz"], axis=1)
    return [
        gain(state, ss.Pose.from_euler(place, yaw=np.arctan2(-place[1], -place[0])), described["frequency_hz"])
        for place in places
    ]


def post_on_ground(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `auto`."""
    things = [
        Thing("ground", mesh_of(folder, "ground"), "Roads", "own", is_object=False),
        Thing("post", mesh_of(folder, "post"), "Pole", "steel"),
    ]
    state = state_of(things, material(complex(*described["materials"]["ground"]["permittivity"])))
    band = np.linspace(*described["band_hz"], 41)
    return [
        gain(state, ss.Pose.from_euler([distance, 0.0, 0.5], yaw=np.pi), band, "post")
        for distance in column(rows, "distance_m")
    ]


def wall_ghosts(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `auto`, gated by range."""
    things = [
        Thing("wall", mesh_of(folder, "wall"), "Wall", "steel", is_object=False),
        Thing("ball", mesh_of(folder, "ball"), "Static", "steel"),
    ]
    state = state_of(things)
    return [
        gain(state, ss.Pose(), described["frequency_hz"], "ball", (distance, 0.15))
        for distance in column(rows, "range_m")
    ]


def slabs(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `auto`."""
    found = []
    for row in rows:
        own = material(
            complex(float(row["permittivity_real"]), float(row["permittivity_imag"])), float(row["thickness_m"])
        )
        state = state_of([Thing("panel", mesh_of(folder, "panel"), "Wall", "own", is_object=False)], own)
        distance = float(row["distance_m"])
        pose = ss.Pose.from_euler([distance, 0.0, 0.0], yaw=np.pi)
        found.append(gain(state, pose, described["frequency_hz"], gate=(distance, 0.02)))
    return found


def raw_data(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[complex]:
    """Answer by `ss.point_targets` and `ss.synthesize`."""
    form = described["waveform"]
    sampled = form["num_samples"] / form["sample_rate_hz"]
    ramp = form["first_sample_s"] + sampled
    radar = ss.RadarSpec().with_(
        start_frequency=form["start_frequency_hz"],
        bandwidth=form["slope_hz_per_s"] * ramp,
        ramp_time=ramp,
        idle_time=form["chirp_interval_s"] - ramp,
        adc_start_time=form["first_sample_s"],
        sampling_frequency=form["sample_rate_hz"],
        num_samples=form["num_samples"],
        num_chirps=form["num_chirps"],
        tx_positions=tuple(map(tuple, form["transmitters_m"])),
        rx_positions=tuple(map(tuple, form["receivers_m"])),
        pattern=IsotropicPattern(),
    )
    positions = np.array([target["position_m"] for target in described["targets"]])
    velocities = np.array([target["velocity_m_s"] for target in described["targets"]])
    strengths = np.array([target["strength"] for target in described["targets"]])
    # a strength is the amplitude over that of the round trip, so the cross section falls as the fourth power of range
    sections = (strengths * np.linalg.norm(positions, axis=1) ** 2) ** 2
    scale = np.sqrt(
        10.0 ** (radar.front_end.tx_power_dbm / 10.0 - 3.0) * radar.wavelength**2 / (4.0 * np.pi) ** 3
    )  # of a strength of one
    samples = ss.synthesize(ss.point_targets(positions, velocities, sections, radar, ss.Pose()), radar) / scale
    return [complex(samples[tuple(map(int, row["case"].split("/")))]) for row in rows]


def noise(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by `ss.point_targets`, `ss.synthesize` and the noise of a cell."""
    asked = described["radar"]
    radar = ss.RadarSpec().with_(
        num_samples=asked["num_samples"],
        num_chirps=asked["num_chirps"],
        ramp_time=asked["num_samples"] / asked["sample_rate_hz"],
        idle_time=0.0,
        tx_power_dbm=asked["tx_power_dbm"],
        noise_figure_db=asked["noise_figure_db"],
        pattern=IsotropicPattern(gain_dbi=asked["gain_db"]),
        tx_positions=ORIGIN,
        rx_positions=ORIGIN,
    )
    found = []
    for distance in column(rows, "distance_m"):
        paths = ss.point_targets([[distance, 0.0, 0.0]], [[0.0] * 3], asked["rcs_m2"], radar, ss.Pose())
        power = np.mean(np.abs(ss.synthesize(paths, radar).astype(np.complex128)) ** 2)
        found.append(float(10.0 * np.log10(power / cell_noise_power(radar, "rect"))))
    return found


def rain(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by the attenuation that every path of a radar gets."""
    found = []
    for row in rows:
        weather = Weather(rain_rate=float(row["rain_mm_h"]), gases=False)
        one_way = weather_attenuation(weather, described["frequency_hz"], row["polarisation"])  # type: ignore[arg-type]
        found.append(2.0 * one_way * float(row["way_m"]) / 1e3)
    return found


def measured(folder: Path, described: Mapping[str, Any], rows: Rows) -> list[float]:
    """Answer by what `make validation` found last: its scripts take minutes."""
    known = {row["name"]: row["ours"] for row in read_rows() if "ours" in row}
    return [float(known[row["case"]]) for row in rows]


SOLVERS = {
    **dict.fromkeys(
        ("plate", "cylinder", "sphere", "trihedral", "dihedral", "mom_plate", "mom_dihedral", "mom_trihedral"),
        cross_section,
    ),
    "near_plate": near_plate,
    "post_on_ground": post_on_ground,
    "wall_ghosts": wall_ghosts,
    "slabs": slabs,
    "raw_data": raw_data,
    "noise": noise,
    "rain": rain,
    "measured": measured,
}

if __name__ == "__main__":
    run(__doc__, SOLVERS, {"simulator": "scarl-sionna", "version": ss.__version__, "machine": machine()})
