"""Rows of the table of docs/validation.md: a measured range, ours, and whether it lies inside.

Ranges are settled by rule before ours is computed: what the source states; from the least to the largest where several
sources or several samples are compared; and where a source gives one number alone, that number and `ASSUMED_DB` to
each side for levels, `ASSUMED_SHARE` of it for what is no level.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.harness import machine
from benchmarks.row_files import read_rows
from benchmarks.validation.sources import SOURCES

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs/figures/data/validation.jsonl"
ASSUMED_DB = 3.0
"""Half width of a range whose source gives one level alone [dB]: what the second-hand tables state of themselves."""
ASSUMED_SHARE = 0.1
"""Half width, as a share of the value, of what is no level."""
TEXTS = ("note", "why")
"""Fields that several rows share."""
DEFAULTS = {"spread": "stated", "basis": "held out", "unit": "dB"}
"""What a row has that does not say it in the file."""
THEMES = ("ground", "people", "vehicles", "layers", "weather", "motion", "front_end", "captures")

Spread = Literal["stated", "between", "assumed"]
Basis = Literal["held out", "fitted", "bound"]


@dataclass(frozen=True)
class Row:
    """A row.

    Attributes
    ----------
    name : str
        Unique.
    quantity, source, unit : str
        What; a key of `SOURCES`; the unit of all figures.
    low, high : float or None
        Measured range; None: no limit on that side.
    spread : str
        Where the range comes from: the source states it, it lies between several figures, or its width is assumed.
    basis : str
        "held out": nothing of ours was fitted to this source; "fitted": something was, `note` says what; "bound": held
        out, but one limit or a span so wide that most answers pass.
    ours : float
        What the simulator gives.
    note : str
        How, and what was fitted.
    why : str
        Of a row outside: the cause that was found, and by what.
    """

    name: str
    quantity: str
    source: str
    unit: str
    low: float | None
    high: float | None
    spread: Spread
    basis: Basis
    ours: float
    note: str = ""
    why: str = ""

    @property
    def within(self) -> bool:
        """Whether ours lies in the range; figures count as they are written."""
        return (self.low is None or self.ours >= self.low) and (self.high is None or self.ours <= self.high)

    def entry(self, theme: str) -> dict[str, Any]:
        """Return the line of the file."""
        fields = {"theme": theme, **asdict(self), "ours": float(self.ours), "within": bool(self.within)}
        return {key: value for key, value in fields.items() if value != ""}


def around(value: float) -> dict[str, Any]:
    """Return the range of a level [dB] of which the source gives one number alone."""
    return {"low": round(value - ASSUMED_DB, 2), "high": round(value + ASSUMED_DB, 2), "spread": "assumed"}


def share(value: float) -> dict[str, Any]:
    """Return the range of what is no level, of which the source gives one number alone."""
    low, high = sorted((value * (1.0 - ASSUMED_SHARE), value * (1.0 + ASSUMED_SHARE)))
    return {"low": round(low, 4), "high": round(high, 4), "spread": "assumed"}


def read() -> list[dict[str, Any]]:
    """Return all lines of the file: rows, and one of each theme that says what it cost."""
    found, texts = [], []
    for line in read_rows(RESULTS):
        texts = line.pop("texts", texts)
        line = {key: texts[value] if key in TEXTS else value for key, value in line.items()}
        found.append(line if "cpu_s" in line else {**DEFAULTS, **line})
    return found


def save(lines: list[dict[str, Any]]) -> None:
    """Write all lines; notes and causes stand once in the first line of their theme."""
    kept = []
    for theme in THEMES:
        own = [dict(line) for line in lines if line["theme"] == theme]
        texts = list(dict.fromkeys(line[key] for line in own for key in TEXTS if key in line))
        for number, line in enumerate(own):
            line.update({key: texts.index(line[key]) for key in TEXTS if key in line})
            line = {key: value for key, value in line.items() if key not in DEFAULTS or DEFAULTS[key] != value}
            kept.append({**line, "texts": texts} if number == 0 else line)
    RESULTS.write_text("".join(json.dumps(line, separators=(",", ":")) + "\n" for line in kept), encoding="utf-8")


def write(theme: str, rows: list[Row], seconds: float) -> None:
    """Replace a theme's lines in the file."""
    unknown = {row.source for row in rows} - set(SOURCES)
    if unknown or len({row.name for row in rows}) < len(rows):
        raise SystemExit(f"sources that sources.py does not have: {sorted(unknown)}, or a name twice")
    silent = [row.name for row in rows if row.within == bool(row.why)]
    if silent:
        print(f"outside without a cause, or inside with one: {', '.join(silent)}")
    cost = {"theme": theme, "cpu_s": round(seconds, 2), "machine": machine()}
    others = [line for line in read() if line["theme"] != theme]
    save([*others, cost, *(row.entry(theme) for row in rows)])


def run(theme: str, rows: Callable[[], list[Row]]) -> None:
    """Compute a theme's rows, print them and write them."""
    start = time.process_time()
    found = rows()
    write(theme, found, time.process_time() - start)
    for row in found:
        print(f"{'in ' if row.within else 'OUT'} {row.name:42} {row.low} .. {row.high} {row.unit}: {row.ours}")
