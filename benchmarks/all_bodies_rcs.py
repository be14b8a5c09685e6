"""RCS of every body against aspect beside measured values: one figure, and a table of medians.

python benchmarks/all_bodies_rcs.py     docs/figures/rcs_all_bodies.webp; prints the table of docs/actors.md

The runs are those that `python benchmarks/measured_rcs.py measure` keeps: people on foot at 3.4 m, standing and walking
looks together, two-wheelers at 10 m, vehicles in the far field.
"""

from __future__ import annotations

import csv
import itertools
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks import measured_rcs as runs
from benchmarks.measured_rcs import AGES, BELGIOVANE, JRC, SCHUBERT, VEHICLES

Array = npt.NDArray[np.float64]
SECTORS = np.arange(0.0, 181.0, 30.0)
"""Edges of the sectors of aspect, 0: front [deg]."""
COLORS = (-20.0, 25.0)
"""Ends of the scale [dBsm]."""
MEASURED_CARS = ("car_dBsm", "car_abadpour_left_dBsm", "car_abadpour_right_dBsm")
SOURCES = {
    "car_dBsm": "car, Wengerter's table", "car_abadpour_left_dBsm": "car, KIT, left side",
    "car_abadpour_right_dBsm": "car, KIT, right side", "bicyclist_dBsm": "cyclist, Wengerter's table",
    "motorbike_geary_dBsm": "motorcycle, Geary",
}  # fmt: skip # a table


@dataclass(frozen=True)
class Line:
    """A line of the figure: a body, or what was measured of its like.

    `level` [dBsm] at `aspect` [deg], 0: front, 180: rear. `span` is what was measured of its kind over aspect [dBsm],
    `means` the measured means or medians.
    """

    name: str
    aspect: Array
    level: Array
    measured: bool = False
    span: tuple[float, float] | None = None
    means: tuple[float, float] | None = None

    @property
    def sectors(self) -> Array:
        """Median in each sector [dBsm]; NaN where none was looked at."""
        pairs = itertools.pairwise(SECTORS)
        found = [self.level[(self.aspect >= low) & (self.aspect <= high)] for low, high in pairs]
        return np.array([np.median(one) if len(one) else np.nan for one in found])


def measured_lines() -> dict[str, Line]:
    """Return what was measured against aspect, by its column."""
    with runs.MEASURED.open(encoding="utf-8") as file:
        entries = list(csv.DictReader(line for line in file if not line.startswith("#")))
    aspect = np.array([float(one["aspect_deg"]) for one in entries])
    return {
        key: Line(name, aspect, np.array([float(one[key]) for one in entries]), True) for key, name in SOURCES.items()
    }


def belgiovane() -> Line:
    """Return the measured means of a cyclist by sector."""
    aspect = 0.5 * (SECTORS[:-1] + SECTORS[1:])
    level = [next(value for (low, high), value in BELGIOVANE if low <= one < high) for one in aspect]
    return Line("cyclist, Belgiovane and Chen", aspect, np.array(level), True)


def body(rows: Any, model: str, **beside: Any) -> Line:
    """Return all looks at a body by ray solvers: light, the saloon in detail."""
    detail = "detailed" if model == "saloon" else "light"
    chosen = [one for one in rows if one["model"] == model and one["detail"] == detail and one["method"] != "raycast"]
    azimuth = np.concatenate([one["azimuth_deg"] for one in chosen])
    level = np.concatenate([one["rcs_dbsm"] for one in chosen])
    return Line(model, np.minimum(azimuth, 360.0 - azimuth), level, **beside)


def lines(rows: Any) -> list[Line]:
    """Return all lines, bodies that are alike and what was measured of them together."""
    held = measured_lines()
    means = [value for pair in JRC.values() for value in pair]
    person = {"span": (SCHUBERT[0], SCHUBERT[2]), "means": (min(means), max(means))}
    adults = [model for model, age in AGES.items() if age >= 16]
    alike = ("adult_man", "adult_woman", "standing_adult", "waving_woman")
    found = [body(rows, model, **person) for model in (*adults, *alike)]
    found += [body(rows, model) for model in AGES if model not in adults]
    found += [body(rows, model) for model in (*runs.PEOPLE, *runs.ON_FOOT) if model not in alike]
    cyclists = [held["bicyclist_dBsm"], belgiovane()]
    riders = {
        "bicycle": spans(cyclists), "cargo_bike": spans(cyclists), "motorcycle": spans([held["motorbike_geary_dBsm"]]),
    }  # fmt: skip # a table
    found += [body(rows, model, **riders.get(model, {})) for model in runs.TWO_WHEELERS]
    cars = spans([held[key] for key in MEASURED_CARS])
    found += [*cyclists, held["motorbike_geary_dBsm"]]
    found += [body(rows, model, **cars) for model in runs.CARS] + [held[key] for key in MEASURED_CARS]
    return found + [body(rows, model) for model in VEHICLES[5:]]


def spans(of: list[Line]) -> dict[str, tuple[float, float]]:
    """Return the span of what was measured, and of its medians [dBsm]."""
    every = np.concatenate([one.level for one in of])
    medians = [float(np.median(one.level)) for one in of]
    return {"span": (float(every.min()), float(every.max())), "means": (min(medians), max(medians))}


def draw(all_lines: list[Line]) -> None:
    """Draw the sectors of every line, and beside them how its levels are spread."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 12.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.25))
    table = np.array([one.sectors for one in all_lines])
    extent = (0.0, 180.0, len(all_lines) - 0.5, -0.5)
    image = left.imshow(table, aspect="auto", extent=extent, vmin=COLORS[0], vmax=COLORS[1], cmap="viridis")
    for number, one in enumerate(all_lines):
        for middle, value in zip(0.5 * (SECTORS[:-1] + SECTORS[1:]), table[number], strict=True):
            dark = "k" if value > 8.0 else "w"
            left.text(middle, number, "" if np.isnan(value) else f"{value:.0f}", color=dark, ha="center", va="center",
                      fontsize=6)  # fmt: skip # one text
        if one.span is not None:
            right.barh(number, np.ptp(one.span), 0.96, one.span[0], color="C3", alpha=0.12, lw=0)
        if one.means is not None:
            right.barh(number, max(np.ptp(one.means), 0.4), 0.96, one.means[0], color="C3", alpha=0.35, lw=0)
        color = "C3" if one.measured else "C0"
        low, median, high = np.percentile(one.level, [10, 50, 90])
        right.plot([low, high], [number] * 2, color=color, lw=1.5)
        right.plot(median, number, "|", color=color, ms=8, mew=2)
        right.plot(runs.mean_of(one.level), number, "o", color=color, ms=3.5)
    left.set_yticks(range(len(all_lines)), [one.name for one in all_lines], fontsize=7)
    for label, one in zip(left.get_yticklabels(), all_lines, strict=True):
        label.set_color("C3" if one.measured else "k")
    left.set(xticks=SECTORS, xlabel="aspect [deg], 0: front", title="median in sectors of 30 deg [dBsm]")
    right.plot([], [], "C0", label="10 to 90 % of looks; bar: median; dot: mean of powers")
    right.plot([], [], "C3", label="the same of what was measured")
    right.fill_between([], [], color="C3", alpha=0.35, lw=0, label="measured means (people) or medians over aspect")
    right.fill_between([], [], color="C3", alpha=0.12, lw=0, label="measured span over aspect")
    right.set(xlim=(-30.0, 55.0), xlabel="RCS at 77 GHz [dBsm]", title="all looks")
    right.grid(alpha=0.3)
    right.legend(fontsize=6.5, loc="center right")
    figure.colorbar(image, ax=left, location="bottom", shrink=0.8, pad=0.01)
    figure.savefig(runs.ROOT / "docs/figures/rcs_all_bodies.webp", dpi=90, pil_kwargs={"quality": 60, "method": 6})


def print_table(all_lines: list[Line]) -> None:
    """Print the levels of every body, and what was measured of its kind; people of all ages have a table of theirs."""
    print("| body | looks | 10 % | median | 90 % | mean of powers | median 10 deg and more off the axes | measured |")
    print("|---|---|---|---|---|---|---|---|")
    for one in all_lines:
        if one.measured or one.name in AGES:
            continue
        low, median, high = np.percentile(one.level, [10, 50, 90])
        off = np.median(one.level[np.abs((one.aspect + 45.0) % 90.0 - 45.0) > 10.0])
        beside = "-" if one.means is None else " to ".join(f"{value:.1f}" for value in sorted({*one.means}))
        values = f"{low:.1f} | **{median:.1f}** | {high:.1f} | {runs.mean_of(one.level):.1f} | {off:.1f}"
        print(f"| `{one.name}` | {len(one.level)} | {values} | {beside} |")


def main() -> None:
    all_lines = lines(json.loads(runs.DATA.read_text(encoding="utf-8")))
    draw(all_lines)
    print_table(all_lines)


if __name__ == "__main__":
    main()
