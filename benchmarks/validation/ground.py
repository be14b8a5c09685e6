"""sigma0 of grounds against grazing angle and polarisation, and the statistics of their echo.

python benchmarks/validation/ground.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.validation.rows import Row, around, run, share
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.rough import Channel, coherent_share, sigma0
from scarl_sionna.scene.materials.table import builtin_materials
from tests.scenes import Material, Thing, plane, write_scene

FREQUENCY = 77e9
FITTED = "the albedo is fitted to this figure; the angle's law is not"
SHAPE = "the level is fitted to this range, its course over the angle is not (grass: a deep layer's)"
OTHERS = ("asphalt_wet", "concrete", "gravel", "grass", "snow_dry", "snow_wet")
DIFFUSE = 2
"""Kind of interaction of what a rough surface scatters."""
ENVELOPE = (10.0, 85.0)
"""Grazing angles [deg] between which the envelope is looked at; between them the law is monotonic."""


def level(name: str, grazing_deg: float, channel: Channel = "VV") -> float:
    """Return sigma0 of a material of the table [dB]."""
    found = sigma0(builtin_materials()[name], FREQUENCY, np.radians(grazing_deg), channel)
    return round(float(10.0 * np.log10(found)), 2)


def law() -> list[Row]:
    """Return the rows of the law that all solvers share."""
    rows = [
        Row("sigma0_asphalt_20deg", "sigma0 of dry asphalt, 20 deg grazing, VV", "ulaby", "dB", **around(-12.0),
            basis="fitted", ours=level("asphalt", 20.0), note=FITTED)
    ]  # fmt: skip # a table
    for name, angles, low, high in (
        ("grass", (20.0, 25.0, 30.0), -8.0, -3.0),
        ("soil", (40.0, 60.0, 80.0), -8.0, -3.0),
    ):
        rows += [
            Row(f"sigma0_{name}_{angle:g}deg", f"sigma0 of {name}, {angle:g} deg grazing, VV", "ulaby", "dB", low, high,
                "stated", "fitted", level(name, angle), SHAPE)
            for angle in angles
        ]  # fmt: skip # a table
    rows += [
        Row(f"envelope_{name}", f"sigma0 of {name}, largest over 10 to 85 deg grazing, VV and HH", "ulaby", "dB", -45.0,
            0.0, "stated", "bound", level(name, ENVELOPE[1]), "span of all terrains and angles, snow among them")
        for name in OTHERS
    ]  # fmt: skip # a table
    least = min(level(name, ENVELOPE[0], "HV") for name in ("asphalt", "soil", *OTHERS))
    rows.append(
        Row("envelope_least", "least sigma0 of all these at 10 deg, HV", "ulaby", "dB", -45.0, 0.0, "stated", "bound",
            least, "span of all terrains and angles, snow among them")
    )  # fmt: skip # a table
    return rows


def mirrors() -> list[Row]:
    """Return the rows of what soil and gravel mirror, H, from 60 to 81 deg off the normal."""
    cosine, found = np.cos(np.radians(np.linspace(60.0, 81.0, 85))), []
    for name in ("soil", "gravel"):
        material = builtin_materials()[name]
        smooth = np.abs(reflection(material, FREQUENCY, cosine)[0])
        ours = round(float(np.max(smooth * coherent_share(material, FREQUENCY, cosine))), 4)
        finer = np.arange(0.1e-3, 8e-3, 0.1e-3)
        fits = [
            1e3 * h
            for h in finer
            if 0.02
            <= np.max(smooth * coherent_share(material.with_(roughness_rms=float(h)), FREQUENCY, cosine))
            <= 0.34
        ]
        why = (
            f"the heights, an estimate of {1e3 * material.roughness_rms:g} mm: with {fits[0]:.1f} to {fits[-1]:.1f} mm "
            "it lies inside; what horns of 7 deg gather of the diffuse part besides was not read"
        )
        found.append(
            Row(f"mirror_{name}", f"reflection coefficient of {name}, largest of 60 to 81 deg from the normal, H",
                "foliage_73", "1", 0.02, 0.34, "stated", "held out", ours,
                "77 GHz; measured: dirt and gravel, all angles", "" if 0.02 <= ours <= 0.34 else why)
        )  # fmt: skip # a table
    return found


def speckle(channel: Channel, looks: int = 200) -> float:
    """Return the standard deviation over the mean of the power of range cells of grass near grazing, by `sbr`.

    Each cell is a third of a metre long, 7 to 17 m from a radar 1.5 m high (grazing 5 to 12 deg), divided by its mean
    over the looks, each another surface (`seed`).
    """
    radar = RadarSpec(azimuth_fov_deg=160.0, elevation_fov_deg=160.0)
    field = Thing("field", plane(10.0, 4.0, (12.0, 0.0, 0.0)), "Roads", "own")
    row, column = {"VV": (0, 0), "HV": (1, 0)}[channel]
    edges = np.arange(7.5, 16.5, 1.0 / 3.0)
    wave = 2.0 * np.pi * radar.center_frequency / SPEED_OF_LIGHT
    power = []
    with tempfile.TemporaryDirectory() as folder:
        world = load_scene(write_scene(Path(folder), [field], materials={"own": Material(radio="grass")}))
        for look in range(looks):
            knobs = SbrSettings(floor_db=None, max_depth=1, max_phase=1.0, seed=look)
            paths = solve_paths(world.at(0.0), radar, Pose([0.0, 0.0, 1.5]), "sbr", settings=knobs)
            rough = np.flatnonzero(paths.interaction[:, 0] == DIFFUSE)
            length = paths.length[rough]
            total = np.zeros(len(edges) + 1, complex)
            np.add.at(
                total, np.digitize(length / 2.0, edges), paths.a[rough, row, column] * np.exp(-1j * wave * length)
            )
            power.append(np.abs(total[1:-1]) ** 2)
    found = np.array(power)
    return round(float((found / found.mean(axis=0)).std()), 3)


def rows() -> list[Row]:
    """Return all rows of the theme."""
    return [
        *law(),
        *mirrors(),
        Row("speckle_grass_vv", "standard deviation over mean of the power, grass near grazing, VV", "ulaby_grazing",
            "1", **share(0.97), basis="held out", ours=speckle("VV"), note="`sbr`; 1 is an exponential power"),
        Row("speckle_grass_hv", "the same, HV", "ulaby_grazing", "1", **share(0.98), basis="held out",
            ours=speckle("HV"), note="`sbr`; 1 is an exponential power"),
    ]  # fmt: skip # a table


if __name__ == "__main__":
    run("ground", rows)
