"""Write docs/validation.md and its figure from the rows.

python benchmarks/validation/page.py [--figure]
"""

from __future__ import annotations

import argparse
import io
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.validation.rows import ASSUMED_DB, ASSUMED_SHARE, ROOT, THEMES, read
from benchmarks.validation.sources import SOURCES

PAGE = ROOT / "docs/validation.md"
FIGURE = ROOT / "docs/figures/validation.png"
TITLES = {
    "ground": "Ground",
    "people": "People and cycles",
    "vehicles": "Cars",
    "layers": "Layers and materials",
    "weather": "Weather",
    "motion": "Motion",
    "front_end": "Front end",
    "captures": "Recordings of a real radar",
}
NOTHING = {
    "sigma0 of concrete, gravel, wet, icy and snowy roads; anything at 76 to 81 GHz; HH": "abstracts only",
    "two-ray fading, guardrails, poles, signs, manhole covers, bridges": "no measured number at 77 GHz was found; "
    "closed forms stand in [accuracy](accuracy.md)",
    "lorries and buses in dBsm; children": "no measured number at 77 GHz was found",
    "corridors of test targets (ISO 19206), bulletins of Euro NCAP": "not public, or not found, but for a cyclist from "
    "behind",
    "people at 24 GHz (-5.6 to -3.8 dBsm, JRC)": "the materials have no data there; the simulator refuses",
    "0.5 mm of water on a radome (2 to 4 dB), snow and ice on it (5 to 15 dB)": "the text that states it has no source",
    "azimuth resolution of TI's cascade": "its definition was not found",
    "micro-Doppler spans of walkers and wheels": "no measured number was found; against kinematics in "
    "[micro-Doppler](micro_doppler.md)",
    "RadarScenes' RCS and points per object against range, misses of nuScenes": "asks for a dataset of the simulator: "
    "`scarl-sionna stats` sets them [side by side](statistics.md)",
}


def figures(rows: Iterable[dict[str, Any]]) -> tuple[int, int]:
    """Return how many rows there are and how many lie within."""
    rows = list(rows)
    return len(rows), sum(row["within"] for row in rows)


def span(row: dict[str, Any]) -> str:
    """Return the measured range as text."""
    mark = {"stated": "", "between": "", "assumed": " *"}[row["spread"]]
    if row["low"] is None:
        return f"up to {row['high']:g}{mark}"
    if row["high"] is None:
        return f"from {row['low']:g}{mark}"
    return f"{row['low']:g} to {row['high']:g}{mark}"


def section(theme: str, lines: list[dict[str, Any]]) -> list[str]:
    """Return the section of a theme."""
    cost = next(line for line in lines if "cpu_s" in line)
    rows = [line for line in lines if "cpu_s" not in line]
    count, within = figures(rows)
    text = [
        f"## {TITLES[theme]}",
        "",
        f"{within} of {count} within. `python benchmarks/validation/{theme}.py`, {cost['cpu_s']:.0f} CPU seconds.",
        "",
        "| quantity | source | measured | ours | | kind | remarks |",
        "|---|---|---|---|---|---|---|",
    ]
    remarks: dict[str, int] = {}
    for row in rows:
        shown = row["quantity"] + ("" if row["unit"] == "1" else f" [{row['unit']}]")
        mark = "within" if row["within"] else "**outside**"
        cells = [remarks.setdefault(remark(row, key), len(remarks) + 1) for key in ("note", "why") if key in row]
        cells = [shown, row["source"], span(row), f"{row['ours']:g}", mark, row["basis"], ", ".join(map(str, cells))]
        text.append(f"| {' | '.join(cells)} |")
    return [*text, "", *(f"{number}. {words}." for words, number in remarks.items()), ""]


def remark(row: dict[str, Any], key: str) -> str:
    """Return a row's note, or its cause in words that say so."""
    return f"*Outside*: {row[key]}" if key == "why" else f"{row[key][0].upper()}{row[key][1:]}"


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table of counts."""
    text = ["| kind | rows | within | share |", "|---|---|---|---|"]
    for basis in ("held out", "bound", "fitted"):
        count, within = figures(row for row in rows if row["basis"] == basis)
        text.append(f"| {basis} | {count} | {within} | {100.0 * within / max(count, 1):.0f} % |")
    count, within = figures(rows)
    return [*text, f"| all | {count} | {within} | {100.0 * within / max(count, 1):.0f} % |"]


def page(lines: list[dict[str, Any]]) -> str:
    """Return the text of the page."""
    rows = [line for line in lines if "cpu_s" not in line]
    costs = [line for line in lines if "cpu_s" in line]
    used = [name for name in SOURCES if any(row["source"] == name for row in rows)]
    assumed = sum(row["spread"] == "assumed" for row in rows)
    text = [
        "# Held against the measured world",
        "",
        "Every row sets a published figure beside what the simulator gives in the same arrangement, also where it is "
        "bad. The page is made by",
        "`make validation` from `docs/figures/data/validation.jsonl`; `pytest "
        "tests/unit/test_validation_page.py` holds "
        "page, rows and code together.",
        "",
        *summary(rows),
        "",
        "- **held out**: nothing of ours was fitted to this source. This is the line that counts; the bar is 80 %.",
        "- **bound**: held out, but one limit, or a span so wide that most answers pass.",
        "- **fitted**: something of ours was fitted to this source or to what it rests on; the notes say what.",
        "",
        "*Range.* What the source states; from the least to the largest where several figures are compared; and where "
        "one number alone was found, marked `*`,",
        f"that number and {ASSUMED_DB:g} dB to each side, or {100.0 * ASSUMED_SHARE:g} % of it for what is no level "
        f"({assumed} rows, deviations in the notes). Many figures were read second hand: read the original "
        f"before citing "
        "one.",
        "What lies outside, and why, stands below each table, by experiments with one thing changed "
        "(`python benchmarks/validation/experiments.py`); what follows for a user stands in "
        "[limits](limits.md#against-measurements).",
        "",
        f"*Cost.* {sum(line['cpu_s'] for line in costs):.0f} CPU seconds in all, on {costs[0]['machine']}.",
        "",
        "![Rows as places in their range](figures/validation.png)",
        "",
        "Each mark is a row: 0 is the lower, 1 the upper limit of the measured range; triangles lie beyond the "
        "picture.",
        "",
    ]
    for theme in THEMES:
        own = [line for line in lines if line["theme"] == theme]
        if own:
            text += section(theme, own)
    text += ["## Nothing to compare with", "", "| what | why |", "|---|---|"]
    text += [*(f"| {what} | {why} |" for what, why in NOTHING.items()), ""]
    text += ["## Sources", "", "| key | what | kind | read |", "|---|---|---|---|"]
    text += [f"| {name} | {s.citation} | {s.kind} | {s.read} |" for name in used for s in [SOURCES[name]]]
    return "\n".join(text) + "\n"


def draw(rows: list[dict[str, Any]]) -> None:
    """Draw where each row with two limits lies in its range."""
    from matplotlib.figure import Figure
    from PIL import Image

    rows = [row for row in rows if row["low"] is not None and row["high"] is not None]
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    axes = figure.add_subplot()
    colours = {"held out": "C0", "bound": "0.6", "fitted": "C1"}
    axes.axvspan(0.0, 1.0, color="C2", alpha=0.15, lw=0)
    themes = [theme for theme in THEMES if any(row["theme"] == theme for row in rows)]
    for number, theme in enumerate(themes):
        own = [row for row in rows if row["theme"] == theme]
        for place, row in enumerate(own):
            x = (row["ours"] - row["low"]) / (row["high"] - row["low"])
            y = len(themes) - number - 0.35 + 0.7 * (place + 0.5) / len(own)
            marker = "o" if -1.5 <= x <= 2.5 else (">" if x > 0 else "<")
            axes.plot(min(max(x, -1.45), 2.45), y, marker, color=colours[row["basis"]], ms=4)
    for basis, colour in colours.items():
        axes.plot([], [], "o", color=colour, ms=4, label=basis)
    axes.set(xlim=(-1.5, 2.5), xlabel="place in the measured range (0: lower, 1: upper limit)")
    axes.set_yticks([len(themes) - n for n in range(len(themes))], [TITLES[theme] for theme in themes], fontsize=8)
    axes.legend(fontsize=7, loc="upper right")
    axes.grid(axis="x", alpha=0.3)
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=72)
    Image.open(drawn).convert("RGB").quantize(16).save(FIGURE, optimize=True)  # a third of the size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", action="store_true", help="draw docs/figures/validation.png, too")
    lines = read()
    PAGE.write_text(page(lines), encoding="utf-8")
    if parser.parse_args().figure:
        draw([line for line in lines if "cpu_s" not in line])


if __name__ == "__main__":
    main()
