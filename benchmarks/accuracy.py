"""Work-precision charts: error [dB] against time per radar frame, one curve a method over its knob.

    python benchmarks/accuracy.py PROBLEM... [--repeats 2]      run; results to docs/figures/data/accuracy_PROBLEM.json
    python benchmarks/accuracy.py --write docs/accuracy.md      draw all figures and renew the tables from the results

Problems: plate trihedral sphere two_ray wall car_near car_far highway. Error and time are those of the same call. Time:
solver and synthesis of one frame (12 channels, 256 chirps, 512 samples), median of the repeats after a cold one; CPU
seconds of all threads stand beside it.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
import warnings
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.harness import machine, write_block

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "docs" / "figures" / "data"
PROBLEMS = ("plate", "trihedral", "sphere", "two_ray", "wall", "car_near", "car_far")
ROAD_PROBLEMS = ("car_near", "car_far")
NOTHING_DB = 60.0
STYLE = {  # Okabe and Ito's colours, which the colour-blind tell apart, each with a marker of its own
    "raycast": ("#E69F00", "s"), "sionna": ("#56B4E9", "^"), "sbr": ("#009E73", "o"), "sbr, 1 rad": ("#004D38", "v"),
    "scatterers": ("#CC79A7", "D"), "scatterers + mirrors": ("#CC79A7", "D"), "hybrid": ("#D55E00", "P"),
    "auto": ("#000000", "*"),
}  # fmt: skip # a table


def run(name: str, repeats: int) -> dict[str, Any]:
    """Return the result of a problem as plain data."""
    from benchmarks import accuracy_problems, accuracy_scenes

    warnings.simplefilter("ignore")  # methods are used outside of their range on purpose
    start = time.perf_counter()
    problem = getattr(accuracy_scenes if name in ROAD_PROBLEMS else accuracy_problems, name)()
    curves = []
    for curve in problem.curves:
        points = []
        for point in curve.points:
            begin, spent = time.perf_counter(), time.process_time()
            answer = point.run()
            cold = (time.perf_counter() - begin) / problem.num_frames
            cold_cpu = (time.process_time() - spent) / problem.num_frames
            walls, cpus = [], []
            for _ in range(repeats if cold < 10.0 else 0):
                wall, cpu = time.perf_counter(), time.process_time()
                answer = point.run()
                walls.append((time.perf_counter() - wall) / problem.num_frames)
                cpus.append((time.process_time() - cpu) / problem.num_frames)
            row = {
                "label": point.label,
                "default": point.is_default,
                "error_db": round(problem.error(answer), 5),
                "cold": round(cold, 4),
                "wall": round(float(np.median(walls)) if walls else cold, 4),
                "cpu": round(float(np.median(cpus)) if cpus else cold_cpu, 4),
                "paths": int(np.mean([paths.num_paths for paths in answer])),
            }
            points.append(row)
            print(
                f"{name:10} {curve.method:20} {point.label:14} {row['error_db']:9.4f} dB  warm "
                f"{row['wall']:7.3f} s  cpu "
                f"{row['cpu']:7.3f} s  cold {row['cold']:7.3f} s  {row['paths']} paths",
                flush=True,
            )
        curves.append({"method": curve.method, "knob": curve.knob, "points": points})
    print(f"{name}: {time.perf_counter() - start:.0f} s in all", flush=True)
    return {
        "problem": name,
        "title": problem.title,
        "reference": problem.reference,
        "measure": problem.measure,
        "noise_db": round(problem.noise_db, 5),
        "num_frames": problem.num_frames,
        "curves": curves,
        "machine": machine(),
        "date": datetime.now(timezone.utc).strftime("%Y-%m-%d"),
    }


def draw(result: dict[str, Any], file: Path) -> None:
    """Draw the chart of a result."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import FuncFormatter, LogLocator

    figure, axes = plt.subplots(figsize=(7.2, 4.6), layout="constrained")
    least = max(min(point["error_db"] for curve in result["curves"] for point in curve["points"]), 1e-3)
    bottom = min(least, max(result["noise_db"], 1e-3)) / 2.0
    for curve in result["curves"]:
        color, marker = STYLE[curve["method"]]
        x = [point["wall"] for point in curve["points"]]
        y = [min(max(point["error_db"], 1e-3), NOTHING_DB) for point in curve["points"]]
        axes.loglog(x, y, "-", marker=marker, color=color, ms=7, lw=1.6, label=f"{curve['method']} ({curve['knob']})")
        for point, here, level in zip(curve["points"], x, y, strict=True):
            if point["default"]:
                axes.plot(here, level, "o", ms=15, mfc="none", mec=color, mew=1.6)
        for index in {0, len(x) - 1}:
            axes.annotate(
                curve["points"][index]["label"],
                (x[index], y[index]),
                textcoords="offset points",
                xytext=(7, 5),
                fontsize=7,
                color=color,
            )
    if result["noise_db"] > 1e-3:
        axes.axhline(result["noise_db"], color="0.4", ls="--", lw=1.2)
        axes.annotate(
            "noise of the radar, one frame",
            (0.99, result["noise_db"]),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            fontsize=8,
            color="0.3",
        )
    axes.axhline(NOTHING_DB, color="0.7", lw=0.8)
    axes.annotate(
        "60 dB or no echo",
        (0.99, NOTHING_DB),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        fontsize=8,
        color="0.4",
    )
    axes.set_ylim(bottom, 130.0)
    axes.set(xlabel="time of a radar frame, warm [s]", ylabel="error [dB]")
    axes.set_title(f"{result['title']}\n{result['measure']}", fontsize=10)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
    axes.xaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(which="major", alpha=0.35)
    axes.grid(which="minor", alpha=0.12)
    axes.plot([], [], "o", ms=13, mfc="none", mec="0.3", label="default")
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))
    figure.savefig(file, dpi=120)
    plt.close(figure)


def table(result: dict[str, Any]) -> str:
    """Return the markdown of a result."""
    lines = [
        f"![{result['title']}](figures/accuracy_{result['problem']}.png)",
        "",
        f"Reference: {result['reference']}. Error: {result['measure']}. Noise of the radar: "
        f"{result['noise_db']:.3g} dB. "
        f"`python benchmarks/accuracy.py {result['problem']}`, {result['date']}, {result['machine']}.",
        "",
        "| method | knob | setting | error [dB] | frame, warm [s] | CPU [s] | cold [s] | paths |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for curve in result["curves"]:
        for point in curve["points"]:
            label = f"**{point['label']}**" if point["default"] else point["label"]
            error = "60 or more" if point["error_db"] >= NOTHING_DB else f"{point['error_db']:.3g}"
            cpu = "" if point["cpu"] is None else f"{point['cpu']:.2f}"
            lines.append(
                f"| {curve['method']} | {curve['knob']} | {label} | {error} | "
                f"{point['wall']:.2f} | {cpu} | {point['cold']:.2f} "
                f"| {point['paths']} |"
            )
    return "\n".join(lines)


def write(page: Path) -> None:
    """Draw the figures of all results and renew the marked blocks of a page."""
    for name in PROBLEMS:
        file = DATA / f"accuracy_{name}.json"
        if not file.is_file():
            continue
        result = json.loads(file.read_text(encoding="utf-8"))
        draw(result, ROOT / "docs" / "figures" / f"accuracy_{name}.png")
        write_block(page, name, table(result))


def main() -> None:
    """Run problems, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problems", nargs="*", metavar="PROBLEM", help=", ".join(PROBLEMS))
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="draw all figures and renew the tables of this page")
    arguments = parser.parse_args()
    if unknown := sorted(set(arguments.problems) - set(PROBLEMS)):
        parser.error(f"unknown problem {unknown[0]}; known: {', '.join(PROBLEMS)}")
    DATA.mkdir(parents=True, exist_ok=True)
    for name in arguments.problems:
        result = run(name, arguments.repeats)
        (DATA / f"accuracy_{name}.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        print(table(result))
    if arguments.write is not None:
        write(arguments.write)


if __name__ == "__main__":
    main()
