"""What options of `ss.detect` find on streets with traffic, point by point, and what they cost.

    python benchmarks/detection_points.py frames                         a line of JSON a frame and option; goes on
    python benchmarks/detection_points.py table --write docs/detection.md

The frames are those of `benchmarks/detection.py`, and so are *found*, *false* and *in footprints*. There thresholds are
compared on one set of points; here every option makes points of its own.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from benchmarks.detection import GROUPS, RADAR, STRONG_DB, boxes_of, frames, objects_of, observed
from benchmarks.detection_tables import FALSE_BELOW, Stored
from benchmarks.harness import machine, write_block
from benchmarks.row_files import append_rows, read_rows, rows_so_far

RESULTS = Path("docs/figures/data/detection_points.jsonl")
OPTIONS: dict[str, dict[str, Any]] = {
    "default": {},
    "per_beam=True": {"per_beam": True},
    "per_beam=True, pfa=1e-7": {"per_beam": True, "pfa": 1e-7},
}


def lines_of(place: str, number: int) -> list[dict[str, Any]]:
    """Return what every option finds in a frame."""
    state, mount, paths, cube = observed(place, number)
    rda = ss.range_doppler_angle(cube, RADAR)
    owners = ss.label_cells(rda.range_doppler, paths, state, "sidelobes")
    objects, _ = objects_of(state, mount, owners, rda.range_doppler.noise_power)
    out = []
    for name, options in OPTIONS.items():
        cpu = time.process_time()
        points = ss.detect(rda, **options)
        cpu = time.process_time() - cpu
        labels = ss.label_points(points, paths, RADAR, state)
        table = {
            "objects": objects,
            "own": np.zeros((0, 2), dtype=np.int64),
            "point_cell": np.arange(points.num_points),
            "point_xy": mount.pose.apply(points.position)[:, :2],
            "point_range": points.range,
            "instance": labels.instance,
            "boxes": boxes_of(state, objects),
        }
        stored = Stored(table, {name: np.zeros(points.num_points)})
        strong = [row for row in stored.found(name, 0) if row[2] >= STRONG_DB]
        inside = [row[2] for row in stored.in_boxes(name, 0)]
        line = {"place": place, "frame": number, "option": name, "points": points.num_points, "cpu": round(cpu, 2)}
        line |= {"false": int(np.sum(labels.explained < FALSE_BELOW)), "inside": [sum(inside), len(inside)]}
        for group in GROUPS:
            line[group] = [sum(row[3] for row in strong if row[0] == group), sum(row[0] == group for row in strong)]
        out.append({**line, "machine": machine()})
    return out


def block(lines: list[dict[str, Any]]) -> str:
    """Return the table of the page."""
    places: dict[str, set[int]] = {}
    for line in lines:
        places.setdefault(line["place"], set()).add(line["frame"])
    named = ", ".join(f"`{place}` {len(numbers)}" for place, numbers in places.items())
    rows = [
        f"Frames: {named}; {lines[0]['machine']}.",
        "",
        f"| option | points a frame | false | {' | '.join(GROUPS)} | own, of points in footprints | CPU s a frame |",
        "|---" * (5 + len(GROUPS)) + "|",
    ]
    for name in OPTIONS:
        mine = [line for line in lines if line["option"] == name]
        mean = {key: np.mean([line[key] for line in mine]) for key in ("points", "false", "cpu")}
        totals = {key: np.sum([line[key] for line in mine], axis=0) for key in (*GROUPS, "inside")}
        found = " | ".join(f"{totals[group][0]} of {totals[group][1]}" for group in GROUPS)
        inside = f"{totals['inside'][0]} of {totals['inside'][1]}"
        rows.append(
            f"| `{name}` | {mean['points']:.0f} | {mean['false']:.1f} | {found} | {inside} | {mean['cpu']:.1f} |"
        )
    return "\n".join(rows)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("frames", "table"))
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.what == "frames":
        known = {(line["place"], line["frame"]) for line in rows_so_far(RESULTS)}
        for place, number in frames():
            if (place, number) not in known:
                append_rows(RESULTS, *lines_of(place, number))
        return
    text = block(read_rows(RESULTS))
    print(text)
    if arguments.write:
        write_block(arguments.write, "points", text)


if __name__ == "__main__":
    main()
