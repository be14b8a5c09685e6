# ruff: noqa: B905 - zip has no strict before Python 3.10
"""Score the answers of a radar simulator to the problems beside this file. Needs Python 3.8 or newer, nothing else.

    python score.py ANSWERS [ANSWERS ...] [--markdown] [--problems FOLDER] [--cases PROBLEM]

ANSWERS is a folder with one file `PROBLEM.csv` for each problem that was tried and, if one likes, `about.json` with
"simulator", "version", "machine", "note" and "seconds" (by problem). README.md says what is asked and how.
"""

import argparse
import csv
import json
import math
import statistics
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
NOTHING_DB = 60.0
"""Error of a case without an answer, and the largest that is counted [dB]."""


class AnswerError(ValueError):
    """A file of answers that cannot be scored."""


def read_table(path):
    """Return the rows of a CSV file as dictionaries; lines that begin with # are skipped."""
    try:
        with open(path, newline="", encoding="utf-8") as stream:
            rows = csv.DictReader(line for line in stream if not line.startswith("#"))
            return list(rows)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise AnswerError(f"{path}: cannot be read: {error}") from error


def read_problem(folder):
    """Return a problem: its description, with the rows of its reference under "rows"."""
    problem = json.loads((folder / "problem.json").read_text(encoding="utf-8"))
    problem["rows"] = read_table(folder / "reference.csv")
    return problem


def number(path, row, column):
    """Return a number of a row; an empty one is none."""
    text = (row.get(column) or "").strip()
    try:
        return float(text) if text else math.nan
    except ValueError:
        raise AnswerError(f"{path}: case {row.get('case')!r}: {column} = {text!r} is no number") from None


def read_answers(path, problem):
    """Return the answers by case; cases that the problem does not have, and cases given twice, are refused."""
    rows = read_table(path)
    columns = ("real", "imag") if problem["kind"] == "complex" else ("value",)
    known = {row["case"] for row in problem["rows"]}
    found = {}
    for row in rows:
        case = (row.get("case") or "").strip()
        if case not in known:
            raise AnswerError(
                f"{path}: case {case!r} is none of {problem['name']}'s; the columns are case,{','.join(columns)}"
            )
        if case in found:
            raise AnswerError(f"{path}: case {case!r} stands there twice")
        found[case] = tuple(number(path, row, column) for column in columns)
    return found


def level_error(row, values):
    """Return the error of a case [in the problem's unit] against a value, or the way to a measured range."""
    value = values[0] if values else math.nan
    if math.isnan(value):
        return NOTHING_DB
    if row.get("value"):
        return min(abs(value - float(row["value"])), NOTHING_DB)
    low, high = (float(row[key]) if row[key] else side * math.inf for key, side in (("low", -1), ("high", 1)))
    return min(max(low - value, value - high, 0.0), NOTHING_DB)


def signal_error(rows, answers):
    """Return the power of what is left after the best common complex factor, over that of the reference [dB].

    The signs of time dependence and of the mixer's output are a matter of taste, so conjugates count as well.
    """
    reference = [complex(float(row["real"]), float(row["imag"])) for row in rows]
    given = [complex(*answers.get(row["case"], (math.nan, math.nan))) for row in rows]
    if any(math.isnan(value.real) or math.isnan(value.imag) for value in given):
        return NOTHING_DB, math.nan
    energy = sum(abs(value) ** 2 for value in reference)
    best, level = NOTHING_DB, math.nan
    for one in (given, [value.conjugate() for value in given]):
        own = sum(abs(value) ** 2 for value in one)
        if own == 0.0:
            continue
        inner = sum(value.conjugate() * other for value, other in zip(one, reference))
        left = max(1.0 - abs(inner) ** 2 / own / energy, 1e-30)
        error = 10.0 * math.log10(left)
        if error < best:
            best, level = error, 10.0 * math.log10(own / energy)
    return best, level


def score(problem, answers):
    """Return the cases, how many of them are within their tolerance, and the errors."""
    rows = problem["rows"]
    if problem["kind"] == "complex":
        error, level = signal_error(rows, answers)
        good = error <= problem["tolerance_db"] and abs(level) <= problem["level_tolerance_db"]
        return {"cases": 1, "within": int(good), "median": error, "worst": error, "errors": {"all": error}}
    errors = {row["case"]: level_error(row, answers.get(row["case"])) for row in rows}
    within = [errors[row["case"]] <= float(row.get("tolerance") or 0.0) for row in rows]
    return {
        "cases": len(rows),
        "within": sum(within),
        "median": statistics.median(errors.values()),
        "worst": max(errors.values()),
        "errors": errors,
    }


def read_about(folder):
    """Return what a folder says of itself."""
    path = folder / "about.json"
    try:
        about = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    except (OSError, ValueError) as error:
        raise AnswerError(f"{path}: cannot be read: {error}") from error
    if not isinstance(about, dict):
        raise AnswerError(f"{path}: an object is expected")
    return {"simulator": folder.name, "seconds": {}, **about}


def score_folder(folder, problems):
    """Return the score of each problem that a folder answers, None of the others."""
    if not folder.is_dir():
        raise AnswerError(f"{folder}: there is no such folder")
    names = {problem["name"] for problem in problems}
    strange = sorted(path.name for path in folder.glob("*.csv") if path.stem not in names)
    if strange:
        raise AnswerError(f"{folder}: {', '.join(strange)}: no such problem; there are {', '.join(sorted(names))}")
    found = {}
    for problem in problems:
        path = folder / f"{problem['name']}.csv"
        found[problem["name"]] = score(problem, read_answers(path, problem)) if path.exists() else None
    return found


def table(problems, folders, scores, abouts, markdown):
    """Return the table of all folders as lines."""
    head = ["problem", "cases", "unit", *(str(about["simulator"]) for about in abouts)]
    body = []
    for problem in problems:
        name = problem["name"]
        cells = [name, str(1 if problem["kind"] == "complex" else len(problem["rows"])), problem["unit"]]
        for found, about in zip(scores, abouts):
            one = found[name]
            cells.append("-" if one is None else summary(one, about["seconds"].get(name)))
        body.append(cells)
    totals = ["all", str(sum(int(row[1]) for row in body)), ""]
    for found in scores:
        tried = [one for one in found.values() if one]
        totals.append(f"{sum(one['within'] for one in tried)} of {sum(one['cases'] for one in tried)} tried")
    body.append(totals)
    widths = [max(len(row[k]) for row in [head, *body]) for k in range(len(head))]
    lines = [" | ".join(cell.ljust(width) for cell, width in zip(row, widths)) for row in [head, *body]]
    if not markdown:
        return [line.rstrip() for line in lines]
    rule = "|".join("---" for _ in head)
    return [f"| {lines[0]} |", f"|{rule}|", *(f"| {line} |" for line in lines[1:])]


def summary(one, seconds):
    """Return a score in a few words: cases within, median and worst error, seconds."""
    text = f"{one['within']}, {one['median']:.2f} / {one['worst']:.2f}"
    return text if seconds is None else f"{text}, {seconds:.3g} s"


def main(arguments=None):
    """Print the table; the exit status is 2 where answers cannot be scored."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("answers", nargs="+", type=Path, help="folders of answers")
    parser.add_argument("--problems", type=Path, default=HERE / "problems", help="folder of the problems")
    parser.add_argument("--markdown", action="store_true", help="print the table in Markdown")
    parser.add_argument("--cases", metavar="PROBLEM", help="print the error of every case of a problem, too")
    given = parser.parse_args(arguments)
    problems = [read_problem(path.parent) for path in sorted(given.problems.glob("*/problem.json"))]
    if not problems:
        print(f"error: {given.problems} holds no problems", file=sys.stderr)
        return 2
    if given.cases and given.cases not in {problem["name"] for problem in problems}:
        print(f"error: there is no problem {given.cases!r}", file=sys.stderr)
        return 2
    try:
        scores = [score_folder(folder, problems) for folder in given.answers]
        abouts = [read_about(folder) for folder in given.answers]
    except AnswerError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("cases within their tolerance, median / worst error, seconds of the process where given; - is not tried")
    print("\n".join(["", *table(problems, given.answers, scores, abouts, given.markdown)]))
    if given.cases:
        for found, about in zip(scores, abouts):
            one = found[given.cases]
            print(f"\n{given.cases}, {about['simulator']}:", "not tried" if one is None else "")
            for case, error in (one["errors"] if one else {}).items():
                print(f"  {case}: {error:.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
