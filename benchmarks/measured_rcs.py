"""RCS of every body over aspect, of people over their gait too, beside what was measured at 76 to 81 GHz.

python benchmarks/measured_rcs.py measure [--only adult_man ...]   writes docs/figures/data/measured_rcs.json, 30 min
python benchmarks/measured_rcs.py table                            the tables of docs/actors.md
python benchmarks/measured_rcs.py figures                          docs/figures/rcs_people.webp, rcs_road_users.webp

People are looked at as in the JRC's measurement: 3.4 m away, the antenna 0.8 m high, VV, mean over azimuth and band, by
`sbr` in an empty world. Each has 16 looks, one in each equal sector of azimuth, at directions of its own, so that the
mean of a group does not hang on the same few: the 32 stand in 8 and walk in 8, at the light level; four models stand in
16, in detail and light, and so do others on foot, light. Two-wheelers at 10 m over 36 azimuths, vehicles in the far
field (`ss.rcs`) from slightly below the middle, the saloon in detail over 72, others light, cars over 18, others over
36.
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
from benchmarks.actor_rcs import SETTINGS as FAR_SETTINGS
from benchmarks.actor_rcs import VEHICLES
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT, power_to_db
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.rcs import actor_parts, load_body, scattering_matrix
from scarl_sionna.scenario.motion.bodies import ActorBody, usual_pace
from scarl_sionna.scene.actors.model import person_ages
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
LOOKS = 16
"""At each of the people."""
CYCLE = (0.0, 0.25, 0.5, 0.75)
"""Times in the gait, in parts of the two steps that it repeats after."""
PEOPLE = ("adult_man", "adult_woman", "standing_adult", "child")
ON_FOOT = ("standing_child", "sitting_man", "waving_woman", "wheelchair", "pram", "dog")
TWO_WHEELERS = ("bicycle", "cargo_bike", "scooter", "motorcycle")
CARS = VEHICLES[:5]
AGES = person_ages()


def azimuths(count: int, seed: int = 77) -> npt.NDArray[np.float64]:
    """Return one azimuth in each of `count` equal sectors [rad]."""
    return 2.0 * np.pi * (np.arange(count) + np.random.default_rng(seed).uniform(size=count)) / count


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
    """Return the runs of a person who stands: in detail, light, and by the class."""
    phi, rows = azimuths(LOOKS, 100 + PEOPLE.index(model)), []
    for method, detail in (("sbr", "detailed"), ("sbr", "light"), ("raycast", "detailed")):
        start = time.process_time()
        world = alone(model, detail, StaticTrajectory(Pose()), folder)
        level = seen(world, 0.0, method, 3.4, 0.8, phi)
        rows.append(row(model, detail, method, -1.0, phi, level, time.process_time() - start))
    return rows


def of_all_ages(model: str, folder: Path) -> list[Any]:
    """Return the runs of one of the people, light: standing, and walking, some azimuths at each time of the gait."""
    seed = 200 + list(AGES).index(model)
    phi, start = azimuths(LOOKS // 2, seed), time.process_time()
    level = seen(alone(model, "light", StaticTrajectory(Pose()), folder), 0.0, "sbr", 3.4, 0.8, phi)
    rows = [row(model, "light", "sbr", -1.0, phi, level, time.process_time() - start)]
    speed = SPEED * usual_pace(ActorBody.of(ss.read_actor_model(model)))
    walk = WaypointTrajectory([0.0, 10.0], [[0.0, 0.0, 0.0], [10.0 * speed, 0.0, 0.0]])
    world = alone(model, "light", walk, folder)
    period = 1.0 / next(joint for joint in world.actor("it").joints if hasattr(joint, "gait")).gait.cadence(speed)
    phi = azimuths(LOOKS // 2, 1000 + seed)
    for number, gait in enumerate(CYCLE):
        own, start = phi[number :: len(CYCLE)], time.process_time()
        level = seen(world, 4.0 + gait * period, "sbr", 3.4, 0.8, own)
        rows.append(row(model, "light", "sbr", gait, own, level, time.process_time() - start))
    return rows


def on_foot(model: str, folder: Path) -> list[Any]:
    """Return the run of another body that moves on foot or is pushed, light, at rest."""
    phi, start = azimuths(LOOKS, 300 + ON_FOOT.index(model)), time.process_time()
    level = seen(alone(model, "light", StaticTrajectory(Pose()), folder), 0.0, "sbr", 3.4, 0.8, phi)
    return [row(model, "light", "sbr", -1.0, phi, level, time.process_time() - start)]


def cyclist(model: str, folder: Path) -> list[Any]:
    """Return the runs of a two-wheeler with its rider, 10 m away."""
    phi, rows = azimuths(36), []
    for method in ("sbr", "raycast"):
        start = time.process_time()
        level = seen(alone(model, "light", StaticTrajectory(Pose()), folder), 0.0, method, 10.0, 0.8, phi)
        rows.append(row(model, "light", method, -1.0, phi, level, time.process_time() - start))
    return rows


def vehicle(model: str) -> list[Any]:
    """Return the far field of a vehicle, VV."""
    detail, count = ("detailed", 72) if model == "saloon" else ("light", 18 if model in CARS else 36)
    actor = ss.StagedActor("it", model, StaticTrajectory(Pose()), detail=detail)
    body, phi = load_body(actor_parts(ss.stage("highway_guardrail", [actor]), "it")), azimuths(count)
    start = time.process_time()
    s = scattering_matrix(body, 77e9, np.radians(90.6), phi, settings=FAR_SETTINGS)
    level = power_to_db(4.0 * np.pi * np.abs(s[:, 0, 0]) ** 2)
    return [row(model, detail, "rcs", -1.0, phi, level, time.process_time() - start)]


def measure(only: list[str]) -> None:
    """Run what is asked for, and write it into the file beside what is there."""
    rows = json.loads(DATA.read_text(encoding="utf-8")) if DATA.exists() else []
    with tempfile.TemporaryDirectory() as folder:
        for model in only or [*PEOPLE, *AGES, *ON_FOOT, *TWO_WHEELERS, *VEHICLES]:
            kinds = {PEOPLE: people, tuple(AGES): of_all_ages, ON_FOOT: on_foot, TWO_WHEELERS: cyclist}
            run = next((function for names, function in kinds.items() if model in names), None)
            new = run(model, Path(folder)) if run else vehicle(model)
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
    """Print the tables: models in detail and other road users, then the people one by one."""
    print("| model, by | mean [dBsm] | mean of decibels | 10 % | median | 90 % |\n|---|---|---|---|---|---|")
    rows = json.loads(DATA.read_text(encoding="utf-8"))
    for one in rows:
        if one["model"] not in AGES:
            by = {"sbr": f"`sbr`, {one['detail']}", "raycast": "class (`raycast`)", "rcs": f"`ss.rcs`, {one['detail']}"}
            print(f"| `{one['model']}`, {by[one['method']]} | {statistics(one['rcs_dbsm'])} |")
    for name, levels in groups(rows).items():
        print(f"| {name}, light | {statistics(levels)} |")
    print("\n| model | stands: mean | median | 10 to 90 % | walks: mean | median | 10 to 90 % |")
    print("|---|---|---|---|---|---|---|")
    for model in AGES:
        cells = []
        for level in (stands(rows, model), walks(rows, model)):
            low, median, high = np.percentile(level, [10, 50, 90])
            cells += [beside_measured(mean_of(level)), f"{median:.1f}", f"{low:.1f} to {high:.1f}"]
        print(f"| `{model}` | {' | '.join(cells)} |")


def mean_of(level: Any) -> float:
    """Return the mean of the powers [dBsm]."""
    return float(power_to_db(np.mean(10.0 ** (np.asarray(level) / 10.0))))


def beside_measured(mean: float) -> str:
    """Return a mean [dBsm] as text, bold where it is outside the measured means of adults."""
    means = [value for pair in JRC.values() for value in pair]
    return f"{mean:.1f}" if min(means) <= mean <= max(means) else f"**{mean:.1f}**"


def stands(rows: Any, model: str) -> list[float]:
    """Return the levels of one of the people who stands [dBsm]."""
    return [v for one in rows if one["model"] == model and one["gait"] < 0.0 for v in one["rcs_dbsm"]]


def walks(rows: Any, model: str) -> list[float]:
    """Return the levels of one of the people who walks, over azimuth and gait [dBsm]."""
    return [v for one in rows if one["model"] == model and one["gait"] >= 0.0 for v in one["rcs_dbsm"]]


def groups(rows: Any) -> dict[str, list[float]]:
    """Return the levels of all adults and of all children, standing and walking [dBsm]."""
    found: dict[str, list[float]] = {}
    for name, is_child in (("adults", False), ("children under 16", True)):
        for does, levels in (("stand", stands), ("walk", walks)):
            models = [model for model, age in AGES.items() if (age < 16) == is_child]
            found[f"{len(models)} {name} {does}"] = [v for model in models for v in levels(rows, model)]
    return found


def pick(rows: Any, model: str, method: str, detail: str) -> Any:
    """Return the run of a body at rest."""
    return next(
        one
        for one in rows
        if (one["model"], one["method"], one["detail"]) == (model, method, detail) and one["gait"] < 0.0
    )


def draw_people(rows: Any) -> None:
    """Draw all people over aspect, and of each mean and spread, standing and walking, beside measured ranges."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 7.4), layout="constrained")
    top, below = figure.subplots(2, 1)
    means = [value for pair in JRC.values() for value in pair]
    for axes in (top, below):
        axes.axhspan(min(means), max(means), color="C3", alpha=0.25, lw=0, label="measured means of adults (JRC)")
        axes.axhspan(SCHUBERT[0], SCHUBERT[2], color="C3", alpha=0.07, lw=0, label="measured span (Schubert)")
        axes.grid(alpha=0.3)
        axes.set(ylabel="RCS [dBsm]", ylim=(-26, 8))
    for number, (model, age) in enumerate(AGES.items()):
        color = "C2" if age < 16 else "C0"
        still, moving = stands(rows, model), walks(rows, model)
        one = pick(rows, model, "sbr", "light")
        top.plot(one["azimuth_deg"], one["rcs_dbsm"], color=color, lw=0.5, alpha=0.5)
        for level, shift, marker in ((still, -0.12, "o"), (moving, 0.22, "^")):
            shade = color if shift < 0.0 else "0.35"
            below.plot([number + shift] * 2, np.percentile(level, [10, 90]), color=shade, lw=1.2)
            below.plot(number + shift, np.median(level), "_", color=shade, ms=7)
            below.plot(number + shift, mean_of(level), marker, color=shade, ms=4)
    for model, marker in (("adult_man", "o"), ("adult_woman", "s"), ("standing_adult", "v"), ("child", "^")):
        one = pick(rows, model, "sbr", "detailed")
        label = f"{model}, detailed"
        top.plot(
            one["azimuth_deg"], one["rcs_dbsm"], marker, color="C2" if model == "child" else "k", ms=3, label=label
        )
    top.plot([], [], color="C0", lw=0.8, label="adults, light, standing, each")
    top.plot([], [], color="C2", lw=0.8, label="children, the same")
    below.plot([], [], "o-", color="C0", ms=4, label="stands: mean of powers, median (bar), 10 to 90 %")
    below.plot([], [], "^-", color="0.35", ms=4, label="walks, over azimuth and gait")
    top.set(xlabel="azimuth [deg], 0: front", xlim=(0, 360))
    below.set_xticks(range(len(AGES)), AGES, rotation=90, fontsize=7)
    for axes in (top, below):
        axes.legend(fontsize=7, loc="lower right", ncols=2)
    figure.savefig(ROOT / "docs/figures/rcs_people.webp", dpi=90, pil_kwargs={"quality": 60, "method": 6})


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
    figure.savefig(ROOT / "docs/figures/rcs_road_users.webp", dpi=80, pil_kwargs={"quality": 50, "method": 6})


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
        draw_road_users(rows)


if __name__ == "__main__":
    main()
