"""Chart and table of benchmarks/whole_streets.py."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harness import write_block

KINDS = {"field": "random fields of bodies", "street": "frames of the ready scenes"}
TOLERANCE = {"auto 3 dB": 3.0, "auto 1 dB": 1.0, "auto 0.3 dB": 0.3}


def kept(row: dict[str, Any]) -> float:
    """Return the error that 90 % of the objects keep [dB]."""
    errors = np.abs(list(row["error_db"].values()))
    return float(np.quantile(errors, 0.9, method="inverted_cdf")) if len(errors) else 0.0


def write(page: Path, results: Path) -> None:
    """Draw the chart and renew the marked block of a page."""
    lines = [json.loads(line) for line in results.read_text(encoding="utf-8").splitlines()]
    draw(lines, page.parent / "figures" / "accuracy_streets.webp")
    write_block(page, "streets", report(lines))


def draw(lines: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw the error that 90 % of the objects keep against processor time, a point a problem and method."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    methods = list(dict.fromkeys(method for line in lines for method in line["methods"]))
    figure, axes = plt.subplots(1, len(KINDS), figsize=(10.5, 4.2), sharey=True, layout="constrained")
    for place, (kind, title) in zip(axes, KINDS.items(), strict=True):
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
        some = [line for line in lines if line["kind"] == kind]
        if not some:
            continue
        seeds = sorted(line["seed"] for line in some)
        command = f"python benchmarks/whole_streets.py {kind} 0:{seeds[-1] + 1}"
        whole = len(seeds) == seeds[-1] + 1
        which = f"0 to {seeds[-1]}" if whole else ", ".join(map(str, seeds))
        text += [
            f"{len(some)} {title} (seeds {which}); `{command}`, {some[-1]['machine']}.",
            "",
            "| method | error that 90 % of the objects keep, median of the problems [dB] | 90th percentile "
            "| tolerance met | not met and `met` true | CPU, median [s] | at most twice the cheapest sufficient |",
            "|---|---|---|---|---|---|---|",
        ]
        text += [_line(some, method) for method in some[0]["methods"]] + [""]
    return "\n".join(text).rstrip()


def _line(some: Sequence[dict[str, Any]], method: str) -> str:
    rows = [line["methods"][method] for line in some]
    errors, cpu = np.array([kept(row) for row in rows]), np.array([row["cpu"] for row in rows])
    cells = [method, f"{np.median(errors):.2f}", f"{np.quantile(errors, 0.9):.2f}"]
    tolerance = TOLERANCE.get(method)
    if tolerance is None:
        cells += ["", "", f"{np.median(cpu):.1f}", ""]
        return "| " + " | ".join(cells) + " |"
    good = errors <= tolerance
    silent = sum(row["met"] for row, ok in zip(rows, good, strict=True) if not ok)
    cheap = [_is_cheap(line, method, tolerance) for line, ok in zip(some, good, strict=True) if ok]
    cells += [f"{good.sum()} of {len(rows)}", str(silent), f"{np.median(cpu):.1f}", f"{sum(cheap)} of {len(cheap)}"]
    return "| " + " | ".join(cells) + " |"


def _is_cheap(line: dict[str, Any], method: str, tolerance: float) -> bool:
    enough = [row["cpu"] for row in line["methods"].values() if kept(row) <= tolerance]
    return bool(line["methods"][method]["cpu"] <= 2.0 * min(enough))
