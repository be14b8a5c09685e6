"""What tells how far the echo of an object is off: the formula, a second look, bounces that differ from their reverse.

    python benchmarks/expected_errors.py field 97:142         a line of JSON each, then the tables
    python benchmarks/expected_errors.py crowd 0:6
    python benchmarks/expected_errors.py street 9:12 --reach 12
    python benchmarks/expected_errors.py --report             the tables of the results so far

Each problem is solved at the levels of 6, 3 and 1 dB, all objects with all of their reflections, and compared with the
reference of `whole_streets.py`. The constants are those under which the errors found are likeliest, log-logistic about
the expected one (docs/accuracy.md, expected error).
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import minimize

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.harness import machine
from benchmarks.row_files import append_rows, read_rows, rows_so_far
from benchmarks.street_scenes import problem
from benchmarks.whole_streets import FINEST, RADAR, by_plan, echoes, name_of, reference, widest_plan
from scarl_sionna.core.settings.auto import DEFAULT_AUTO, ErrorEstimate
from scarl_sionna.radar.channel.compose.budget import sbr_settings
from scarl_sionna.radar.channel.compose.expected_error import expected_errors, levels_db, reverse_doubts

RESULTS = Path("docs/figures/data/expected_errors.jsonl.xz")
LEVELS = {f"{level.tolerance_db:g} dB": level for level in DEFAULT_AUTO.levels[:3]}
LOOKS = (("3 dB", None), ("3 dB", "6 dB"), ("1 dB", None), ("1 dB", "3 dB"))
LEAST_DB = 0.01
"""Errors are not told apart below it: that of the reference."""
KINDS = "field", "crowd", "street"
OFF_DB, DIFFERS_DB = 1.0, 2.0
Object = dict[str, Any]


def solve(kind: str, seed: int, reach: float | None) -> dict[str, Any]:
    """Return the line of one problem: of each object its error at each level, and what could tell it."""
    with problem(kind, seed) as street:
        street = replace(street, reach=street.reach if reach is None else reach)
        plan, bodies = widest_plan(street, FINEST[kind])
        truth, _ = reference(kind, seed, street, plan, bodies)
        objects: dict[str, Object] = {name: {"ref": level} for name, level in truth.items()}
        line: dict[str, Any] = {"kind": kind, "seed": seed, "name": street.name, "objects": objects, "cpu": {}}
        for label, level in LEVELS.items():
            start = time.process_time()
            paths = by_plan(street, plan, sbr_settings(level), True)
            line["cpu"][label] = round(time.process_time() - start, 2)
            apart, last, ways, bounces = (
                expected_errors(
                    paths,
                    RADAR,
                    bodies,
                    ErrorEstimate(last_bounce=of_last, way_error=of_ways),
                    level.with_(patch_error=of_all, bounce_error=of_bounces),
                )
                for of_all, of_last, of_ways, of_bounces in np.eye(4).tolist()
            )
            found, power = echoes(paths, bodies), levels_db(paths, RADAR, bodies)
            reverse = reverse_doubts(paths, RADAR, bodies, bodies)
            for number in (number for number in bodies if name_of(street, number) in objects):
                values = found[number] - truth[name_of(street, number)], power[number], apart.get(number, 99.0)
                more = tuple(column.get(number, 0.0) for column in (last, reverse, ways, bounces))
                names = "error", "power", "apart", "last", "reverse", "ways", "bounces"
                row = {name: round(value, 3) for name, value in zip(names, (*values, *more), strict=True)}
                objects[name_of(street, number)][label] = row
        return line


def _expected(objects: list[Object], label: str, look: str | None, knobs: np.ndarray) -> np.ndarray:
    """Return the medians of the errors [dB] with the constants of the formula, and of a look at another level."""

    def column(name: str) -> np.ndarray:
        return 10.0 ** (np.array([one[label].get(name, 0.0) for one in objects]) / 20.0) - 1.0

    square = (knobs[0] * column("apart")) ** 2 + (knobs[1] * column("last")) ** 2
    square += (knobs[4] * column("ways")) ** 2 + (knobs[5] * column("bounces")) ** 2
    error = 20.0 * np.log10(1.0 + np.sqrt(square))
    if look is None:
        return error
    differs = np.array([abs(one[label]["power"] - one[look]["power"]) for one in objects])
    return np.hypot(error, knobs[3] * np.minimum(differs, 60.0))


def fitted(objects: list[Object], label: str, look: str | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the likeliest constants and the medians [dB].

    The constants are of all rows, of the last bounce, the exponent, of a look, of ways and of bounces; the last two
    stay as they are of lines without their columns.
    """
    found = np.maximum(np.abs([one[label]["error"] for one in objects]), LEAST_DB)
    start = np.log([0.007, 0.05, 1.4, 0.3, 0.002, 0.007])

    def unlikely(logs: np.ndarray) -> float:
        knobs = np.exp(logs)
        ratio = found / np.maximum(_expected(objects, label, look, knobs), 1e-9)
        density = np.log(knobs[2] / found) + knobs[2] * np.log(ratio) - 2.0 * np.log1p(ratio ** knobs[2])
        return float(-density.sum() + 0.01 * np.sum((logs - start) ** 2))

    knobs = np.exp(minimize(unlikely, start, method="Nelder-Mead", options={"maxfev": 8000, "maxiter": 8000}).x)
    return knobs, _expected(objects, label, look, knobs)


def report(lines: list[dict[str, Any]]) -> str:
    """Return the tables."""
    rows = [
        "| objects | level | beside | errors found, median, nine of ten [dB] | over 1 dB | places of these by expected "
        "error | eps, kappa, exponent, ways, bounces, look | CPU [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for kind in KINDS:
        own = [line for line in lines if line["kind"] == kind]
        objects = [one for line in own for one in line["objects"].values()]
        for label, look in LOOKS if objects else ():
            knobs, expected = fitted(objects, label, look)
            found = np.abs([one[label]["error"] for one in objects])
            place = np.argsort(np.argsort(-expected)) + 1
            off = ", ".join(str(int(k)) for k in np.sort(place[found > OFF_DB]))
            cpu = sum(line["cpu"][label] + (line["cpu"][look] if look else 0.0) for line in own)
            shown = knobs[[0, 1, 2, 4, 5, 3] if look else [0, 1, 2, 4, 5]]
            text = ", ".join(f"{value:.3g}" for value in shown)
            half, most = np.quantile(found, [0.5, 0.9])
            cells = [f"{len(objects)} of {len(own)} {kind}s", label, look or "-", f"{half:.2f}, {most:.2f}"]
            rows.append("| " + " | ".join([*cells, str(int((found > OFF_DB).sum())), off, text, f"{cpu:.0f}"]) + " |")
        differs = [one for one in objects if one["3 dB"]["reverse"] > DIFFERS_DB]
        off_too = [sum(abs(one["3 dB"]["error"]) > OFF_DB for one in group) for group in (differs, objects)]
        rows.append(
            f"| {kind}s | 3 dB | {len(differs)} differ from their reverse by 2 dB | | {off_too[0]} of {off_too[1]} |"
        )
    return "\n".join(rows)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", nargs="?", choices=KINDS)
    parser.add_argument("seeds", nargs="?", default="97:142", help="first:last, the last not included")
    parser.add_argument("--reach", type=float, help="of the problem, if not its own [m]")
    parser.add_argument("--report", action="store_true", help="only the tables")
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    lines = (read_rows if arguments.report else rows_so_far)(arguments.out)
    if not arguments.report and arguments.kind is None:
        parser.error("say field, crowd or street, or --report")
    done = {(line["kind"], line["seed"]) for line in lines}
    for seed in () if arguments.report else range(*map(int, arguments.seeds.split(":"))):
        if (arguments.kind, seed) in done:
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            lines.append({**solve(arguments.kind, seed, arguments.reach), "machine": machine()})
        append_rows(arguments.out, lines[-1])
    print(report(lines))


if __name__ == "__main__":
    main()
