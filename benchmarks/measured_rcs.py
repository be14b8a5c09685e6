"""RCS of people, cyclists, cars and lorries over aspect and gait, beside what was measured at 76 to 81 GHz.

python benchmarks/measured_rcs.py measure [--only adult_man ...]   writes docs/figures/data/measured_rcs.json, 20 min
python benchmarks/measured_rcs.py table                            the table of docs/actors.md
python benchmarks/measured_rcs.py figures          docs/figures/rcs_people.png, rcs_ages.png, rcs_road_users.png

People are looked at as in the JRC's measurement: 3.4 m away, the antenna 0.8 m high, VV, mean over azimuth and band, by
`sbr` in an empty world. Two-wheelers at 10 m, vehicles in the far field (`ss.rcs`) from slightly below the middle.
"""

from __future__ import annotations

import argparse
import csv
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, power_to_db
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.rcs import actor_parts, load_body, scattering_matrix
from scarl_sionna.scene.motion.trajectory import StaticTrajectory, Trajectory, WaypointTrajectory
from tests.scenes import Thing, plane, write_scene

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs/figures/data/measured_rcs.json"
MEASURED = ROOT / "examples/calibration_data/car_rcs_77ghz.csv"
JRC = {
    "summer shirt": (-6.07, -6.86),
    "rain coat, PVC on polyester": (-3.51, -4.82),
    "rain coat, PVC on nylon": (-5.22, -6.59),
    "winter parka": (-5.43, -6.43),
}
"""Mean RCS [dBsm] of two adults, 76 to 81 GHz, VV, over azimuth and band (Fortuny-Guasch and Chareau, JRC EUR 25762 EN,
2013, secondary)."""
SCHUBERT = (-16.6, -6.6, 0.0)
"""Least, mean and largest RCS [dBsm] of a person over a full turn (Schubert, Kunert, Menzel, IRS 2013, secondary)."""
BELGIOVANE = (((0.0, 30.0), -11.57), ((30.0, 60.0), -13.24), ((60.0, 120.0), -8.10), ((120.0, 150.0), -13.24))
BELGIOVANE += (((150.0, 180.0), -11.57),)
"""Bicycle with rider [dBsm] by sectors of aspect (Belgiovane and Chen, EuCAP 2016, secondary)."""
BAND = np.linspace(-1e9, 1e9, 9)
SPEED = 1.3
CYCLE = (0.0, 0.25, 0.5, 0.75)
"""Times in the gait, in parts of the two steps that it repeats after."""
PEOPLE = ("adult_man", "adult_woman", "standing_adult", "child")
AGES = ("girl_3", "boy_4", "girl_5", "boy_6", "girl_7", "boy_8", "girl_9", "boy_10", "man_22", "woman_34", "man_38")
AGES += ("woman_52",)
"""People of all ages that stand, light, 24 azimuths."""
FAR_SETTINGS = SbrSettings(ray_spacing=16.0, edge_spacing=8.0, bisections=5)


def azimuths(count: int) -> npt.NDArray[np.float64]:
    """Return one azimuth in each of `count` equal sectors [rad]."""
    return 2.0 * np.pi * (np.arange(count) + np.random.default_rng(77).uniform(size=count)) / count


def alone(model: str, detail: str, trajectory: Trajectory, folder: Path) -> ss.World:
    """Return an otherwise empty world with an actor in it."""
    speck = Thing("speck", plane(0.02, 0.02, centre=(0.0, 0.0, -500.0)), "Static", "steel")
    return ss.stage(write_scene(folder, [speck]), [ss.StagedActor("it", model, trajectory, detail=detail)])


def seen(
    world: ss.World, moment: float, method: str, distance: float, height: float, phi: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the RCS of the actor [dBsm] at each azimuth, VV, mean over the band."""
    radar = RadarSpec(azimuth_fov_deg=80.0, elevation_fov_deg=80.0)
    state = world.at(moment)
    middle = state.actor_pose("it").position
    found = []
    for angle in phi:
        place = middle + [distance * np.cos(angle), distance * np.sin(angle), height - middle[2]]
        pose = Pose.from_euler(place, yaw=np.pi + angle)
        settings = {"settings": SbrSettings(floor_db=None)} if method == "sbr" else {}
        paths = solve_paths(state, radar, pose, method=method, **settings)
        if method == "raycast":
            power = float(np.sum(np.abs(paths.a[:, 0, 0]) ** 2))
        else:
            length = sum(np.linalg.norm(p - place, axis=1) for p in (paths.tx_point, paths.rx_point))
            wave = 2.0 * np.pi * (radar.center_frequency + BAND) / SPEED_OF_LIGHT
            power = float(np.mean(np.abs(np.exp(-1j * np.outer(wave, length)) @ paths.a[:, 0, 0]) ** 2))
        found.append(power * (4.0 * np.pi) ** 3 * distance**4 / radar.wavelength**2)
    return power_to_db(np.array(found))


def row(model: str, detail: str, method: str, gait: float, phi: npt.NDArray[np.float64], level: Any, cpu: float) -> Any:
    """Return what is kept of a run."""
    order = np.argsort(phi)
    return {
        "model": model, "detail": detail, "method": method, "gait": gait, "cpu_s": round(cpu / len(phi), 2),
        "azimuth_deg": np.round(np.degrees(phi[order]), 1).tolist(), "rcs_dbsm": np.round(level[order], 2).tolist(),
    }  # fmt: skip # a table


def people(model: str, folder: Path) -> list[Any]:
    """Return the runs of a person: standing, over azimuth, and walking, over azimuth and gait."""
    phi, rows = azimuths(36), []
    for method, detail in (("sbr", "detailed"), ("sbr", "light"), ("raycast", "detailed")):
        start = time.process_time()
        world = alone(model, detail, StaticTrajectory(Pose()), folder)
        level = seen(world, 0.0, method, 3.4, 0.8, phi)
        rows.append(row(model, detail, method, -1.0, phi, level, time.process_time() - start))
    if model in ("adult_man", "adult_woman"):
        walk = WaypointTrajectory([0.0, 10.0], [[0.0, 0.0, 0.0], [10.0 * SPEED, 0.0, 0.0]])
        world = alone(model, "light", walk, folder)
        step = next(joint for joint in world.actor("it").joints if hasattr(joint, "gait"))
        period = 1.0 / step.gait.cadence(SPEED)
        phi = azimuths(24)
        for gait in CYCLE:
            start = time.process_time()
            level = seen(world, 4.0 + gait * period, "sbr", 3.4, 0.8, phi)
            rows.append(row(model, "light", "sbr", gait, phi, level, time.process_time() - start))
    return rows


def standing(model: str, folder: Path) -> list[Any]:
    """Return the run of a person who stands, light, over azimuth."""
    phi, start = azimuths(24), time.process_time()
    level = seen(alone(model, "light", StaticTrajectory(Pose()), folder), 0.0, "sbr", 3.4, 0.8, phi)
    return [row(model, "light", "sbr", -1.0, phi, level, time.process_time() - start)]


def cyclist(model: str, folder: Path) -> list[Any]:
    """Return the runs of a two-wheeler with its rider, 10 m away."""
    phi, rows = azimuths(72), []
    for method in ("sbr", "raycast"):
        start = time.process_time()
        level = seen(alone(model, "light", StaticTrajectory(Pose()), folder), 0.0, method, 10.0, 0.8, phi)
        rows.append(row(model, "light", method, -1.0, phi, level, time.process_time() - start))
    return rows


def vehicle(model: str) -> list[Any]:
    """Return the far field of a vehicle, VV."""
    detail = "detailed" if model == "saloon" else "light"
    actor = ss.StagedActor("it", model, StaticTrajectory(Pose()), detail=detail)
    body, phi = load_body(actor_parts(ss.stage("highway_guardrail", [actor]), "it")), azimuths(72)
    start = time.process_time()
    s = scattering_matrix(body, 77e9, np.radians(90.6), phi, settings=FAR_SETTINGS)
    level = power_to_db(4.0 * np.pi * np.abs(s[:, 0, 0]) ** 2)
    return [row(model, detail, "rcs", -1.0, phi, level, time.process_time() - start)]


def measure(only: list[str]) -> None:
    """Run what is asked for, and write it into the file beside what is there."""
    rows = json.loads(DATA.read_text(encoding="utf-8")) if DATA.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        for model in only or [*PEOPLE, *AGES, "bicycle", "saloon", "lorry"]:
            if model in PEOPLE:
                new = people(model, Path(folder))
            elif model in AGES:
                new = standing(model, Path(folder))
            else:
                new = cyclist(model, Path(folder)) if model == "bicycle" else vehicle(model)
            rows = [one for one in rows if one["model"] != model] + new
            DATA.write_text("[\n" + ",\n".join(json.dumps(one) for one in rows) + "\n]\n", encoding="utf-8")
            for one in new:
                print(model, one["method"], one["detail"], one["gait"], one["cpu_s"], statistics(one["rcs_dbsm"]))


def statistics(level: Any) -> str:
    """Return mean (of the powers), and 10, 50 and 90 % of levels [dBsm] as cells of a table."""
    mean = float(power_to_db(np.mean(10.0 ** (np.asarray(level) / 10.0))))
    low, median, high = np.percentile(level, [10, 50, 90])
    return f"**{mean:.1f}** | {np.mean(level):.1f} | {low:.1f} | {median:.1f} | {high:.1f}"


def table() -> None:
    """Print the table."""
    print("| model, by | mean [dBsm] | mean of decibels | 10 % | median | 90 % |\n|---|---|---|---|---|---|")
    rows = json.loads(DATA.read_text(encoding="utf-8"))
    walking: dict[str, list[float]] = {}
    for one in rows:
        if one["gait"] >= 0.0:
            walking.setdefault(one["model"], []).extend(one["rcs_dbsm"])
            continue
        by = {"sbr": f"`sbr`, {one['detail']}", "raycast": "class (`raycast`)", "rcs": f"`ss.rcs`, {one['detail']}"}
        print(f"| `{one['model']}`, {by[one['method']]} | {statistics(one['rcs_dbsm'])} |")
    for model, level in walking.items():
        print(f"| `{model}`, `sbr`, light, walking, {len(CYCLE)} times of the gait | {statistics(level)} |")


def pick(rows: Any, model: str, method: str, detail: str) -> Any:
    """Return the run of a body at rest."""
    return next(
        one
        for one in rows
        if (one["model"], one["method"], one["detail"]) == (model, method, detail) and one["gait"] < 0.0
    )


def draw_people(rows: Any) -> None:
    """Draw the distributions over azimuth and gait beside the measured means."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.5, 1.0])
    for model, colour in (("adult_man", "C0"), ("adult_woman", "C1"), ("standing_adult", "C2")):
        one = pick(rows, model, "sbr", "detailed")
        left.plot(one["azimuth_deg"], one["rcs_dbsm"], "o-", ms=3, lw=0.8, color=colour, label=f"{model}, sbr")
        right.plot(*_cumulative(one["rcs_dbsm"]), color=colour, lw=1.2, label=f"{model}, stands")
    one = pick(rows, "adult_man", "raycast", "detailed")
    left.plot(one["azimuth_deg"], one["rcs_dbsm"], "k--", lw=1.0, label="adult_man, class (raycast)")
    for number, gait in enumerate(CYCLE):
        level = [v for o in rows if o["gait"] == gait for v in o["rcs_dbsm"]]
        label = f"man and woman walk, {gait:g} of the gait, light"
        right.plot(*_cumulative(level), color=f"{0.2 + 0.18 * number:.2f}", lw=0.8, label=label)
    means = [value for pair in JRC.values() for value in pair]
    for axes, band in ((left, left.axhspan), (right, right.axhspan)):
        band(min(means), max(means), color="C3", alpha=0.25, lw=0, label="measured means (JRC)")
        axes.axhline(SCHUBERT[0], color="C3", ls=":", lw=1.0, label="measured span (Schubert)")
        axes.axhline(SCHUBERT[2], color="C3", ls=":", lw=1.0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7, loc="lower right")
    left.set(xlabel="azimuth [deg], 0: front", ylabel="RCS [dBsm]", xlim=(0, 360), ylim=(-30, 8))
    right.set(xlabel="share of azimuths below", xlim=(0, 1))
    figure.savefig(ROOT / "docs/figures/rcs_people.png", dpi=80)


def draw_ages(rows: Any) -> None:
    """Draw the RCS of people of all ages over aspect and its distribution, beside the measured ranges of adults."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=[1.5, 1.0])
    found = {model: [one for one in rows if one["model"] == model] for model in AGES}
    means = [value for pair in JRC.values() for value in pair]
    for axes, band in ((left, left.axhspan), (right, right.axhspan)):
        band(min(means), max(means), color="C3", alpha=0.25, lw=0, label="measured means of adults (JRC)")
        axes.axhline(SCHUBERT[0], color="C3", ls=":", lw=1.0, label="measured span (Schubert)")
        axes.axhline(SCHUBERT[2], color="C3", ls=":", lw=1.0)
        axes.grid(alpha=0.3)
    for model, (one,) in ((model, runs) for model, runs in found.items() if runs):
        is_child = int(model.rpartition("_")[2]) < 16
        style = {"color": "C2" if is_child else "C0", "lw": 0.8, "alpha": 0.8}
        if model in ("girl_5", "boy_10", "man_22", "woman_52"):
            marker = {"girl_5": "o", "boy_10": "s", "man_22": "^", "woman_52": "v"}[model]
            left.plot(one["azimuth_deg"], one["rcs_dbsm"], marker=marker, ms=3, **style, label=model)
        right.plot(*_cumulative(one["rcs_dbsm"]), **style)
    right.plot([], [], color="C0", label="adults, each")
    right.plot([], [], color="C2", label="children, each")
    left.set(xlabel="azimuth [deg], 0: front", ylabel="RCS [dBsm]", xlim=(0, 360), ylim=(-25, 6))
    right.set(xlabel="share of azimuths below", xlim=(0, 1))
    left.legend(fontsize=7, loc="lower right")
    right.legend(fontsize=7, loc="lower right")
    figure.savefig(ROOT / "docs/figures/rcs_ages.png", dpi=72)


def _cumulative(level: Any) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    return (np.arange(len(level)) + 0.5) / len(level), np.sort(level)


def _fold(one: Any) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return aspects 0 to 180 deg, and levels, of both sides of a body."""
    azimuth = np.asarray(one["azimuth_deg"])
    return np.minimum(azimuth, 360.0 - azimuth), np.asarray(one["rcs_dbsm"])


def draw_road_users(rows: Any) -> None:
    """Draw person, cyclist, car and lorry over aspect beside what was measured."""
    from matplotlib.figure import Figure

    with MEASURED.open(encoding="utf-8") as file:
        cars = list(csv.DictReader(line for line in file if not line.startswith("#")))
    aspect = [float(entry["aspect_deg"]) for entry in cars]
    figure = Figure(figsize=(10.0, 7.0), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True).ravel()
    runs = (
        ("adult_man", "sbr", "detailed", "person"),
        ("bicycle", "sbr", "light", "bicycle with rider"),
        ("saloon", "rcs", "detailed", "car"),
        ("lorry", "rcs", "light", "lorry"),
    )
    for axes, (model, method, detail, title) in zip(panels, runs, strict=True):
        where, level = _fold(pick(rows, model, method, detail))
        axes.plot(where, level, ".", color="C0", ms=4, alpha=0.6, label=f"{model}, {detail}, {method}")
        edges = np.arange(0.0, 181.0, 30.0)
        medians = [np.median(level[(where >= a) & (where < a + 30.0)]) for a in edges[:-1]]
        axes.stairs(medians, edges, baseline=None, color="C0", lw=1.5, label="median of 30 deg")
        axes.set(title=title, ylabel="RCS [dBsm]", xlim=(0, 180))
        axes.grid(alpha=0.3)
    means = [value for pair in JRC.values() for value in pair]
    panels[0].axhspan(min(means), max(means), color="C3", alpha=0.3, lw=0, label="means over azimuth, JRC 2013")
    panels[0].axhspan(SCHUBERT[0], SCHUBERT[2], color="C3", alpha=0.1, lw=0, label="span, Schubert et al. 2013")
    for (low, high), value in BELGIOVANE:
        panels[1].plot((low, high), (value, value), color="C3", lw=2.0, label="Belgiovane and Chen" * (low == 0.0))
    bicycles = [float(entry["bicyclist_dBsm"]) for entry in cars]
    panels[1].plot(aspect, bicycles, "s", color="C1", ms=4, label="quoted by Wengerter")
    for key, label, mark in (
        ("car_dBsm", "car, Wengerter", "s"),
        ("car_abadpour_left_dBsm", "KIT, left", "<"),
        ("car_abadpour_right_dBsm", "KIT, right", ">"),
    ):
        panels[2].plot(aspect, [float(entry[key]) for entry in cars], mark, ms=4, color="C1", label=label)
    panels[3].text(120.0, 2.0, "nothing measured at 77 GHz at hand", ha="center", fontsize=8)
    panels[0].set_ylim(-20.0, 4.0)
    for axes in panels:
        axes.legend(fontsize=7, loc="upper right" if axes is panels[1] else "lower left")
    for axes in panels[2:]:
        axes.set_xlabel("aspect [deg], 0: front")
    figure.savefig(ROOT / "docs/figures/rcs_road_users.png", dpi=80)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("measure", "table", "figures"))
    parser.add_argument("--only", nargs="*", default=[])
    arguments = parser.parse_args()
    if arguments.what == "measure":
        measure(arguments.only)
    elif arguments.what == "table":
        table()
    else:
        rows = json.loads(DATA.read_text(encoding="utf-8"))
        draw_people(rows)
        draw_ages(rows)
        draw_road_users(rows)


if __name__ == "__main__":
    main()
