"""Error against processor time in cut frames of the ready scenes, one panel a place, one curve a method over its knob.

    python benchmarks/street_curves.py 28:12 52:20 59:12      seed:metres, a line of JSON each
    python benchmarks/street_curves.py --write docs/accuracy.md     figure and table from the results

Problems, reference and what counts are those of benchmarks/whole_streets.py; a place is cut to some metres, so that
every method runs without a budget. `auto` runs over its four tolerances, `sbr` over the size of its patches, with ways
over the mirrors that `auto` found and without. The lower hull is that of all other methods: what costs no more than a
setting and is at least as good lies on it or below.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.accuracy import STYLE
from benchmarks.harness import ANY_COST, machine, write_block
from benchmarks.row_files import append_rows, read_rows
from benchmarks.street_scenes import Street, street
from benchmarks.whole_street_figures import kept
from benchmarks.whole_streets import PLAIN, RADAR, UNLIMITED, by_plan, reference, row_of, timed, widest_plan
from scarl_sionna.core.settings.plan import ChannelPlan
from scarl_sionna.radar.channel import solve_paths
from scarl_sionna.radar.paths import RadarPaths

RESULTS = Path("docs/figures/data/street_curves.jsonl")
TOLERANCES = (6.0, 3.0, 1.0, 0.3)
PATCHES = (3.0, 1.0, 0.4)
"""Sizes of the patches of `sbr` [rad]."""
LEAST_DB = 0.01
LOOKS = {
    "auto": STYLE["auto"],
    "sbr, mirrors": STYLE["sbr"],
    "sbr, no mirrors": STYLE["sbr, 1 rad"],
    "sionna": STYLE["sionna"],
    "raycast": STYLE["raycast"],
}


def methods(place: Street, plan: ChannelPlan) -> Iterator[tuple[str, str, Callable[[], RadarPaths]]]:
    """Yield a method, the value of its knob and a solve."""
    some: dict[str, Any] = {"max_distance": place.reach}
    solved = partial(solve_paths, place.state, RADAR, place.mount)
    for tolerance in TOLERANCES:
        knobs = {"channel_tolerance_db": tolerance, "tube_budget": UNLIMITED, **some, **ANY_COST}
        yield "auto", f"{tolerance:g} dB", partial(solved, "auto", **knobs)
    for phase in PATCHES:
        settings = PLAIN.with_(max_phase=phase, integration_phase=phase / 10.0)
        for name, ghosts in (("sbr, mirrors", True), ("sbr, no mirrors", False)):
            yield name, f"{phase:g} rad", partial(by_plan, place, plan, settings, ghosts)
    for name in ("sionna", "raycast"):
        yield name, "default", partial(solved, name, **some)


def solve(seed: int, reach: float) -> dict[str, Any]:
    """Return the line of a place."""
    place = replace(street(seed), reach=reach)
    plan, coherent = widest_plan(place, 0.3)
    level, seconds = reference("street", seed, place, plan, coherent)
    line: dict[str, Any] = {"seed": seed, "name": place.name, "reach": reach, "reference_cpu": seconds}
    line |= {"level_db": level, "curves": {}}
    for name, knob, call in methods(place, plan):
        paths, cpu = timed(call)
        row = row_of(place, paths, cpu, coherent, level)
        if name == "auto":
            row |= {key: paths.diagnostics[key] for key in ("met", "expected_error_db")}
        line["curves"].setdefault(name, {})[knob] = row
        print(line["name"], name, knob, f"{kept(row):.2f} dB, {cpu:.2f} s", flush=True)
    return {**line, "machine": machine()}


def over_hull(line: dict[str, Any], row: dict[str, Any]) -> float:
    """Return by what factor a solve takes longer than the cheapest of other methods that is as good, 0 if none is."""
    others = [other for name, curve in line["curves"].items() if name != "auto" for other in curve.values()]
    enough = [other["cpu"] for other in others if kept(other) <= max(kept(row), LEAST_DB)]
    return float(row["cpu"] / min(enough)) if enough else 0.0


def draw(lines: list[dict[str, Any]], file: Path) -> None:
    """Draw a panel a place."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, -(-len(lines) // 2), figsize=(11.0, 6.6), sharey=True, layout="constrained")
    for panel, line in zip(axes.flat, lines, strict=False):
        for name, curve in line["curves"].items():
            colour, marker = LOOKS[name]
            x = [row["cpu"] for row in curve.values()]
            y = [max(kept(row), LEAST_DB) for row in curve.values()]
            panel.loglog(x, y, marker=marker, color=colour, lw=1.0, ms=6, label=name, zorder=3 if name == "auto" else 2)
        for tolerance in TOLERANCES:
            panel.axhline(tolerance, color="0.85", lw=0.8, zorder=0)
        objects = len(line["level_db"])
        panel.set_title(f"{line['name']}, {line['reach']:g} m, {objects} objects", fontsize=9)
        panel.grid(alpha=0.2)
    for panel in axes[-1]:
        panel.set_xlabel("CPU time of a solve [s]")
    for panel in axes[:, 0]:
        panel.set_ylabel("error that 90 % keep [dB]")
    axes[0, 0].legend(fontsize=8)
    figure.savefig(file, dpi=100, pil_kwargs={"lossless": True})
    plt.close(figure)


def report(lines: list[dict[str, Any]]) -> str:
    """Return the markdown of the results."""
    which = " ".join(f"{line['seed']}:{line['reach']:g}" for line in lines)
    knobs = [(name, knob) for name, curve in lines[0]["curves"].items() for knob in curve]
    text = [
        "![Error against CPU time by place](figures/accuracy_places.webp)",
        "",
        f"`python benchmarks/street_curves.py {which}`, {lines[-1]['machine']}. Each cell: error that 90 % of the "
        "objects keep [dB], CPU [s]; of `auto` also its time over that of the cheapest setting of others that is as "
        "good, where there is one.",
        "",
        "| method | " + " | ".join(f"{line['name']}, {line['reach']:g} m" for line in lines) + " |",
        "|---" * (len(lines) + 1) + "|",
    ]
    for name, knob in knobs:
        cells = []
        for line in lines:
            row = line["curves"][name][knob]
            ratio = over_hull(line, row) if name == "auto" else 0.0
            cells.append(f"{kept(row):.2f}, {row['cpu']:.1f}" + (f" ({ratio:.2f}x)" if ratio else ""))
        text.append(f"| {name}, {knob} | " + " | ".join(cells) + " |")
    return "\n".join(text)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", metavar="SEED:METRES")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    if arguments.write is not None:
        lines = read_rows(arguments.out)
        draw(lines, arguments.write.parent / "figures" / "accuracy_places.webp")
        write_block(arguments.write, "places", report(lines))
        return
    warnings.simplefilter("ignore")
    for text in arguments.places:
        seed, reach = text.split(":")
        line = solve(int(seed), float(reach))
        append_rows(arguments.out, line)


if __name__ == "__main__":
    main()
