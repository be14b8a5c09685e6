"""Tables of `benchmarks/detection.py`: recall and precision of thresholds from the stored frames."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.detection import (
    AROUND,
    GROUPS,
    LOG_PFA,
    MARGIN,
    RANGES,
    RESULTS,
    STORE,
    STRONG_DB,
    Variant,
    frames,
    group_of,
)
from benchmarks.harness import machine, write_block
from benchmarks.row_files import read_rows, write_rows

NOMINAL = int(np.argmin(np.abs(LOG_PFA + 6.0)))
FALSE_BELOW = 0.5
EITHER = {
    "ca, range or doppler": (Variant("ca", "range"), Variant("ca", "doppler")),
    "go, range or doppler": (Variant("go", "range"), Variant("go", "doppler")),
    "os, range or doppler": (Variant("os", "range"), Variant("os", "doppler")),
    "osgo, range or doppler": (Variant("osgo", "range"), Variant("osgo", "doppler")),
}
"""Cells that one of two thresholds takes."""
SHOWN = (
    str(AROUND),
    str(Variant("ca", "range")),
    str(Variant("ca", "doppler")),
    "ca, range or doppler",
    str(Variant("ca", "both", (2, 2), (2, 3))),
    str(Variant("ca", "both", (3, 3), (3, 4))),
    str(Variant("go")),
    str(Variant("go", "range")),
    "go, range or doppler",
    str(Variant("so")),
    str(Variant("os")),
    str(Variant("os", rank=0.5)),
    str(Variant("os", "range")),
    str(Variant("os", "doppler")),
    "os, range or doppler",
    str(Variant("osgo")),
    str(Variant("osgo", "range")),
    "osgo, range or doppler",
)
BY_RANGE = (str(AROUND), str(Variant("ca", "range")), "ca, range or doppler", str(Variant("os")))


@dataclass(frozen=True)
class Stored:
    """A stored frame, with the rates of all thresholds by name."""

    table: dict[str, np.ndarray]
    rates: dict[str, np.ndarray]

    @classmethod
    def read(cls, path: Path) -> Stored:
        """Return the frame of a file."""
        with np.load(path) as file:
            table = {name: file[name] for name in file.files}
        rates = {str(name): row for name, row in zip(table["variants"], table["rate"], strict=True)}
        for name, both in EITHER.items():
            rates[name] = np.minimum(*(rates[str(one)] for one in both))
        return cls(table, rates)

    def point_rate(self, name: str) -> np.ndarray:
        """Return from which rate on each point is there."""
        return self.rates[name][self.table["point_cell"]]

    def found(self, name: str, index: int) -> list[tuple[str, float, float, bool, bool]]:
        """Return group, range, SNR of every road user, and whether a point and an own cell of it is found."""
        there = self.table["instance"][self.point_rate(name) <= index]
        taken = self.rates[name] <= index
        rows, own = [], self.table["own"]
        for row, (instance, semantic, distance, snr) in enumerate(self.table["objects"]):
            cells = own[own[:, 0] == row, 1]
            rows.append((group_of(int(semantic)), distance, snr, bool((there == instance).any()), taken[cells].any()))
        return rows

    def in_boxes(self, name: str, index: int) -> list[tuple[str, float, bool]]:
        """Return group and range of every point in a road user's footprint, and whether it is that one's."""
        rows = []
        for number in np.flatnonzero(self.point_rate(name) <= index):
            nearest, owner = np.inf, -1
            for row, (x, y, ahead_x, ahead_y, length, width) in enumerate(self.table["boxes"]):
                away = self.table["point_xy"][number] - [x, y]
                turned = np.abs([away @ [ahead_x, ahead_y], away @ [-ahead_y, ahead_x]])
                outside = float(np.linalg.norm(np.maximum(turned - np.array([length, width]) / 2.0, 0.0)))
                if outside < min(nearest, MARGIN):
                    nearest, owner = outside, row
            if owner >= 0:
                instance, semantic, _, _ = self.table["objects"][owner]
                own = self.table["instance"][number] == instance
                rows.append((group_of(int(semantic)), self.table["point_range"][number], bool(own)))
        return rows


def _count(stored: list[Stored], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return false points and all points a frame at every rate."""
    false, total = np.zeros(len(LOG_PFA) + 1), np.zeros(len(LOG_PFA) + 1)
    for frame in stored:
        rate = frame.point_rate(name)
        false += np.bincount(rate[frame.table["explained"] < FALSE_BELOW], minlength=len(false))
        total += np.bincount(rate, minlength=len(total))
    return np.cumsum(false)[:-1] / len(stored), np.cumsum(total)[:-1] / len(stored)


def _at(stored: list[Stored], name: str, index: int) -> dict[str, Any]:
    """Return what a threshold finds at one rate."""
    false, total = _count(stored, name)
    line = {"log_pfa": float(LOG_PFA[index]), "false": round(false[index], 2), "points": round(total[index], 1)}
    rows = [row for frame in stored for row in frame.found(name, index) if row[2] >= STRONG_DB]
    for group in GROUPS:
        mine = [row for row in rows if row[0] == group]
        line[group] = [sum(row[3] for row in mine), sum(bool(row[4]) for row in mine), len(mine)]
    return line


def compare(stored: list[Stored], name: str) -> dict[str, Any]:
    """Return the line of one threshold: at 1e-6, and at the false points of the window all around."""
    limit = _count(stored, str(AROUND))[0][NOMINAL]
    false = _count(stored, name)[0]
    few = np.flatnonzero(false <= limit)
    line: dict[str, Any] = {"threshold": name, "frames": len(stored), "nominal": _at(stored, name, NOMINAL)}
    line["equal"] = _at(stored, name, int(few[-1])) if len(few) else None
    if name in BY_RANGE:
        line["by_range"] = _by_range(stored, name)
    return line


def _by_range(stored: list[Stored], name: str) -> dict[str, list[list[int]]]:
    """Return for every group and class of range: found, of strong ones; own points, of points in its footprints."""
    found = [row for frame in stored for row in frame.found(name, NOMINAL) if row[2] >= STRONG_DB]
    inside = [row for frame in stored for row in frame.in_boxes(name, NOMINAL)]
    out: dict[str, list[list[int]]] = {}
    for group in GROUPS:
        out[group] = []
        for low, high in zip(RANGES, (*RANGES[1:], np.inf), strict=True):
            near = [row[3] for row in found if row[0] == group and low <= row[1] < high]
            held = [row[2] for row in inside if row[0] == group and low <= row[1] < high]
            out[group].append([sum(near), len(near), sum(held), len(held)])
    return out


def _share(found: int, count: int) -> str:
    return f"{found} of {count}" if count else "-"


def block(lines: list[dict[str, Any]]) -> str:
    """Return the tables of the page."""
    known = {line["threshold"]: line for line in lines}
    head = "people | two-wheelers | vehicles"
    rows = [
        f"{lines[0]['frames']} frames, {lines[0]['machine']}. Road users found, of those of {STRONG_DB:g} dB and more: "
        "by a point (in brackets: by a cell of their own over the threshold).",
        "",
        f"| threshold at 1e-6 | false points a frame | of all points | {head} | at equal false points | {head} |",
        "|---" * 10 + "|",
    ]
    for name in SHOWN:
        line = known[name]
        nominal, equal = line["nominal"], line["equal"]
        cells = [f"{nominal[group][0]} ({nominal[group][1]}) of {nominal[group][2]}" for group in GROUPS]
        same = ["none has so few", "", "", ""]
        if equal:
            level = [f"{equal[group][0]} ({equal[group][1]})" for group in GROUPS]
            same = [f"10^{equal['log_pfa']:g}", *level]
        share = 100.0 * nominal["false"] / nominal["points"]
        numbers = f"{nominal['false']:.1f} | {share:.1f} % of {nominal['points']:.0f}"
        rows.append(f"| {name} | {numbers} | {' | '.join(cells)} | {' | '.join(same)} |")
    ranges = [f"{low:g} to {high:g} m" for low, high in pairwise(RANGES)] + [f"from {RANGES[-1]:g} m"]
    rows += ["", "At 1e-6 by range; recall of what has 13 dB and more, precision of points in footprints:", ""]
    rows += [f"| threshold | class | | {' | '.join(ranges)} |", "|---" * (3 + len(ranges)) + "|"]
    for name in BY_RANGE:
        for group, values in known[name]["by_range"].items():
            recall = " | ".join(_share(*value[:2]) for value in values)
            precision = " | ".join(_share(*value[2:]) for value in values)
            rows += [f"| {name} | {group} | recall | {recall} |", f"| | | precision | {precision} |"]
    return "\n".join(rows)


def write_tables(page: Path | None) -> None:
    """Compare all thresholds over the stored frames, keep the lines, and print or write the tables."""
    paths = [STORE / f"{place}_{number}.npz" for place, number in frames()]
    stored = [Stored.read(path) for path in paths if path.exists()]
    if stored:
        lines = [{**compare(stored, name), "machine": machine()} for name in stored[0].rates]
        write_rows(RESULTS, lines)
    text = block(read_rows(RESULTS))
    if page is None:
        print(text)
    else:
        write_block(page, "detection", text)
