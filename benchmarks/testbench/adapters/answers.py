"""What the adapters share: read problems, time and write answers."""

from __future__ import annotations

import argparse
import csv
import json
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2]))
PROBLEMS = HERE.parent / "problems"

Solver = Callable[[Path, Mapping[str, Any], Sequence[Mapping[str, str]]], Sequence[Any]]
"""From a folder, its description and its cases to the answers in the order of the cases: numbers, or complex ones."""


def read(name: str) -> tuple[Path, dict[str, Any], list[dict[str, str]]]:
    """Return folder, description and cases of a problem; the reference itself is taken out."""
    folder = PROBLEMS / name
    described = json.loads((folder / "problem.json").read_text(encoding="utf-8"))
    with (folder / "reference.csv").open(newline="", encoding="utf-8") as stream:
        rows = [{k: v for k, v in row.items() if k not in ("value", "real", "imag")} for row in csv.DictReader(stream)]
    return folder, described, rows


def write(folder: Path, name: str, rows: Sequence[Mapping[str, str]], found: Sequence[Any]) -> None:
    """Write the answers of one problem."""
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream, lineterminator="\n")
        is_complex = any(isinstance(value, complex) for value in found)
        table.writerow(["case", "real", "imag"] if is_complex else ["case", "value"])
        for row, value in zip(rows, found, strict=True):
            numbers = (value.real, value.imag) if is_complex else (value,)
            table.writerow([row["case"], *(f"{number:.6g}" for number in numbers)])


def run(description: str | None, solvers: Mapping[str, Solver], about: Mapping[str, Any]) -> None:
    """Answer all problems of a table of solvers, or those that are named, into a folder."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="folder of the answers")
    parser.add_argument("problems", nargs="*", metavar="PROBLEM", help=f"of {', '.join(solvers)}; all by default")
    given = parser.parse_args()
    unknown = sorted(set(given.problems) - set(solvers))
    if unknown:
        parser.error(f"no such problem here: {', '.join(unknown)}; there are {', '.join(solvers)}")
    given.out.mkdir(parents=True, exist_ok=True)
    path = given.out / "about.json"
    known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    seconds = dict(known.get("seconds", {}))
    for name in given.problems or solvers:
        folder, described, rows = read(name)
        start = time.process_time()
        found = solvers[name](folder, described, rows)
        seconds[name] = round(time.process_time() - start, 3)
        write(given.out, name, rows, found)
        path.write_text(json.dumps({**about, "seconds": seconds}, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {len(rows)} cases, {seconds[name]} CPU s", flush=True)
