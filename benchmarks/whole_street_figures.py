"""Chart and table of benchmarks/whole_streets.py."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import write_block
from benchmarks.row_files import read_rows

KINDS = {
    "field": "random fields of bodies",
    "crowd": "crowds of vehicles",
    "street": "frames of the ready scenes",
}
TOLERANCE = {"auto 3 dB": 3.0, "auto 1 dB": 1.0, "auto 0.3 dB": 0.3}


WHOLE = 30.0
"""Reach of a whole street [m]."""


def kept(row: dict[str, Any]) -> float:
    """Return the error that 90 % of the objects keep [dB]."""
    errors = np.abs(list(row["error_db"].values()))
    return float(np.quantile(errors, 0.9, method="inverted_cdf")) if len(errors) else 0.0


def write(page: Path, results: Path) -> None:
    """Draw the chart and renew the marked block of a page."""
    lines = read_rows(results)
    draw(lines, page.parent / "figures" / "accuracy_streets.webp")
    write_block(page, "streets", report(lines))


def draw(lines: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw the error that 90 % of the objects keep against processor time, a point a problem and method."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    methods = list(dict.fromkeys(method for line in lines for method in line["methods"]))
    kinds = {kind: title for kind, title in KINDS.items() if any(line["kind"] == kind for line in lines)}
    figure, axes = plt.subplots(1, len(kinds), figsize=(10.5, 4.2), sharey=True, layout="constrained")
    for place, (kind, title) in zip(axes, kinds.items(), strict=True):
        some = [line for line in lines if line["kind"] == kind]
        for number, method in enumerate(methods):
            rows = [line["methods"][method] for line in some if method in line["methods"]]
            if not rows:
                continue
            x, y = [row["cpu"] for row in rows], [max(kept(row), 0.01) for row in rows]
            place.loglog(x, y, ".", ms=4, alpha=0.4, color=f"C{number}")
            place.loglog([np.median(x)], [np.median(y)], "o", ms=9, color=f"C{number}", label=method)
        for tolerance in TOLERANCE.values():
            place.axhline(tolerance, color="0.7", lw=0.8, zorder=0)
        place.set(title=f"{len(some)} {title}", xlabel="CPU time of a solve [s]", ylim=(0.01, 100.0))
        place.grid(alpha=0.2)
    axes[0].set_ylabel("error that 90 % of the objects keep [dB]")
    axes[0].legend(fontsize=8, loc="lower left")
    figure.savefig(file, dpi=100, pil_kwargs={"lossless": True})
    plt.close(figure)


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Return the markdown of the results."""
    text = ["![Error against CPU time, whole streets](figures/accuracy_streets.webp)", ""]
    for kind, title in KINDS.items():
        for part, some in _parts([line for line in lines if line["kind"] == kind]).items():
            text += _table(kind, f"{title}{part}", some)
    return "\n".join(text).rstrip()


def _parts(lines: Sequence[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Return whole problems, and those that are cut nearer, as what their title says more."""
    found: dict[str, list[dict[str, Any]]] = {}
    for line in lines:
        found.setdefault(", cut nearer" if line.get("reach", WHOLE) < WHOLE else "", []).append(line)
    return found


def _table(kind: str, title: str, some: Sequence[dict[str, Any]]) -> list[str]:
    seeds = sorted(line["seed"] for line in some)
    street = kind == "street"
    which = ", ".join(map(str, seeds)) if street else _runs(seeds)
    command = "street SEED:SEED+1 --tolerances 3 1" if street else f"{kind} {seeds[0]}:{seeds[-1] + 1}"
    command += " --auto-only --reach METRES" if title.endswith("nearer") else ""
    text = [
        f"{len(some)} {title} (seeds {which}); `python benchmarks/whole_streets.py {command}`, {some[-1]['machine']}.",
        "",
        "| method | error that 90 % of the objects keep, median of the problems [dB] | 90th percentile "
        "| tolerance met | not met and `met` true | CPU, median [s] | at most twice the cheapest sufficient |",
        "|---|---|---|---|---|---|---|",
    ]
    text += [_line(some, method) for method in dict.fromkeys(name for line in some for name in line["methods"])]
    return [*text, "", *(_frames(some) if kind == "street" else [])]


def _runs(seeds: Sequence[int]) -> str:
    """Return rising numbers as runs: 0 to 36, 97 to 179."""
    runs: list[list[int]] = []
    for seed in seeds:
        if runs and seed == runs[-1][-1] + 1:
            runs[-1].append(seed)
        else:
            runs.append([seed])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 1 else str(run[0]) for run in runs)


def _frames(lines: Sequence[dict[str, Any]]) -> list[str]:
    """Return a table with a row for each street and tolerance."""
    text = [
        "| frame | seed | within [m] | objects | tolerance [dB] | error that 90 % keep [dB] | largest [dB] "
        "| stated [dB] | `met` | CPU [s] | reference, CPU [s] |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for line in lines:
        reach = line.get("reach", WHOLE)
        for method, tolerance in TOLERANCE.items():
            if (row := line["methods"].get(method)) is None:
                continue
            largest = max(map(abs, row["error_db"].values()), default=0.0)
            cells = [line["name"], line["seed"], f"{reach:g}", len(row["error_db"]), f"{tolerance:g}"]
            cells += [f"{kept(row):.2f}", f"{largest:.2f}", f"{row['expected_error_db']:.2f}"]
            cells += [str(row["met"]).lower(), f"{row['cpu']:.1f}", f"{line['reference_cpu']:.0f}"]
            text.append("| " + " | ".join(map(str, cells)) + " |")
    return [*text, ""]


def _line(some: Sequence[dict[str, Any]], method: str) -> str:
    some = [line for line in some if method in line["methods"]]
    rows = [line["methods"][method] for line in some]
    errors, cpu = np.array([kept(row) for row in rows]), np.array([row["cpu"] for row in rows])
    cells = [method, f"{np.median(errors):.2f}", f"{np.quantile(errors, 0.9):.2f}"]
    tolerance = TOLERANCE.get(method)
    if tolerance is None:
        cells += ["", "", f"{np.median(cpu):.1f}", ""]
        return "| " + " | ".join(cells) + " |"
    good = errors <= tolerance
    silent = sum(row["met"] for row, ok in zip(rows, good, strict=True) if not ok)
    compared = ((line, ok) for line, ok in zip(some, good, strict=True) if "sbr 1 rad, no mirrors" in line["methods"])
    cheap = [_is_cheap(line, method, tolerance) for line, ok in compared if ok]
    cells += [f"{good.sum()} of {len(rows)}", str(silent), f"{np.median(cpu):.1f}"]
    cells += [f"{sum(cheap)} of {len(cheap)}" if cheap else ""]
    return "| " + " | ".join(cells) + " |"


def _is_cheap(line: dict[str, Any], method: str, tolerance: float) -> bool:
    enough = [row["cpu"] for row in line["methods"].values() if kept(row) <= tolerance]
    return bool(line["methods"][method]["cpu"] <= 2.0 * min(enough))
