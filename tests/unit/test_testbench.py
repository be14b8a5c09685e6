"""The test bench for radar simulators: its problems, its scores, and that it needs nothing of this project."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.testbench import make, score

ROOT = Path(__file__).resolve().parents[2]
BENCH = ROOT / "benchmarks/testbench"
PROBLEMS = [score.read_problem(path.parent) for path in sorted((BENCH / "problems").glob("*/problem.json"))]


def answer(folder: Path, problem: dict, shift: float = 0.0) -> None:
    """Write the reference itself as an answer, levels shifted."""
    folder.mkdir(exist_ok=True)
    with (folder / f"{problem['name']}.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        is_complex = problem["kind"] == "complex"
        table.writerow(["case", "real", "imag"] if is_complex else ["case", "value"])
        for row in problem["rows"]:
            if is_complex:
                value = (3.0 - 4.0j) * complex(float(row["real"]), -float(row["imag"]))  # conjugate, any factor
                table.writerow([row["case"], value.real / 5.0, value.imag / 5.0])
            else:
                middle = row.get("value") or row.get("low") or row.get("high")
                table.writerow([row["case"], float(middle) + shift])


def bench(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the scoring script without any package, from elsewhere."""
    return subprocess.run(
        [sys.executable, "-I", "-S", str(BENCH / "score.py"), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd="/",
    )


def test_the_references_score_all_and_the_script_needs_no_package(tmp_path: Path) -> None:
    for problem in PROBLEMS:
        answer(tmp_path / "perfect", problem)
    done = bench(tmp_path / "perfect")
    assert done.returncode == 0, done.stderr
    cases = sum(1 if problem["kind"] == "complex" else len(problem["rows"]) for problem in PROBLEMS)
    assert f"{cases} of {cases} tried" in done.stdout
    assert len(PROBLEMS) == 16


def test_levels_beyond_their_tolerance_do_not_count(tmp_path: Path) -> None:
    problem = next(one for one in PROBLEMS if one["name"] == "plate")
    for shift, within in ((0.49, 8), (0.51, 0), (float("nan"), 0)):
        answer(tmp_path / "shifted", problem, shift)
        found = score.score_folder(tmp_path / "shifted", [problem])["plate"]
        assert found["within"] == within
        assert found["worst"] == pytest.approx(60.0 if within == 0 and shift != shift else shift, abs=1e-6)


def test_samples_with_another_point_do_not_count() -> None:
    problem = next(one for one in PROBLEMS if one["name"] == "raw_data")
    rows = problem["rows"]
    exact = {row["case"]: (float(row["real"]), float(row["imag"])) for row in rows}
    assert score.signal_error(rows, exact)[0] < -250.0
    moved = {case: (re + 0.02, im) for case, (re, im) in exact.items()}
    error, _ = score.signal_error(rows, moved)
    assert -40.0 < error < -30.0
    found = score.score(problem, {case: (2.0 * re, 2.0 * im) for case, (re, im) in exact.items()})
    assert found["within"] == 0  # 6 dB too strong
    assert score.signal_error(rows, {})[0] == score.NOTHING_DB


def test_a_measured_range_is_open_where_it_has_no_limit() -> None:
    row = {"case": "x", "low": "", "high": "3"}
    assert score.level_error(row, (-1e9,)) == 0.0
    assert score.level_error(row, (5.0,)) == 2.0
    assert score.level_error(row, None) == score.NOTHING_DB


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("case,value\n99,1\n", "case '99' is none of plate's"),
        ("case,value\n0,1\n0,2\n", "stands there twice"),
        ("case,value\n0,loud\n", "'loud' is no number"),
        ("", None),
        ("name;value\n0;1\n", "the columns are case,value"),
    ],
)
def test_bad_answers_are_told(text: str, said: str | None, tmp_path: Path) -> None:
    (tmp_path / "plate.csv").write_text(text)
    done = bench(tmp_path)
    assert done.returncode == (0 if said is None else 2)
    assert said is None or (said in done.stderr and "plate.csv" in done.stderr)


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    assert "no such folder" in bench(tmp_path / "nowhere").stderr
    assert "there is no problem 'x'" in bench(tmp_path, "--cases", "x").stderr
    assert "holds no problems" in bench(tmp_path, "--problems", tmp_path).stderr
    (tmp_path / "plates.csv").write_text("case,value\n")
    assert "plates.csv: no such problem" in bench(tmp_path).stderr
    (tmp_path / "plates.csv").unlink()
    (tmp_path / "about.json").write_text("[]")
    assert "an object is expected" in bench(tmp_path).stderr


def test_the_problems_are_what_their_sources_give(tmp_path: Path) -> None:
    for problem in make.problems():
        make.write(problem, tmp_path)
    names = sorted(path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file())
    assert names == sorted(p.relative_to(BENCH / "problems") for p in (BENCH / "problems").rglob("*") if p.is_file())
    for name in names:
        if name.suffix != ".csv":
            assert (tmp_path / name).read_bytes() == (BENCH / "problems" / name).read_bytes(), name
            continue
        kept, made = (score.read_table(folder / name) for folder in (BENCH / "problems", tmp_path))
        for row, other in zip(kept, made, strict=True):
            for key, value in row.items():
                assert other[key] == value or float(other[key]) == pytest.approx(float(value), abs=2e-6), (name, row)


def test_the_table_of_the_docs_is_that_of_the_answers() -> None:
    page = (ROOT / "docs/testbench.md").read_text(encoding="utf-8")
    block = page.partition("<!-- begin scores -->")[2].partition("<!-- end scores -->")[0]
    done = bench("--markdown", BENCH / "answers/scarl", BENCH / "answers/sionna")
    assert block.split() == done.stdout.partition("\n\n")[2].split()


def test_our_own_answers_are_what_is_kept(tmp_path: Path) -> None:
    """The cheap ones; those of `auto` take some seconds and run with the slow tests."""
    from benchmarks.testbench.adapters import answers, scarl

    for name in ("plate", "cylinder", "dihedral", "raw_data", "noise", "rain", "measured"):
        folder, described, rows = answers.read(name)
        assert not any(key in rows[0] for key in ("value", "real", "imag"))
        answers.write(tmp_path, name, rows, scarl.SOLVERS[name](folder, described, rows))
    shutil.copy(BENCH / "answers/scarl/about.json", tmp_path)
    problems = [problem for problem in PROBLEMS if (tmp_path / f"{problem['name']}.csv").exists()]
    now, kept = (score.score_folder(place, problems) for place in (tmp_path, copied(tmp_path / "kept", problems)))
    for name, found in now.items():
        assert found["within"] == kept[name]["within"], name
        assert found["median"] == pytest.approx(kept[name]["median"], abs=0.05 if name != "raw_data" else 6.0), name


def copied(folder: Path, problems: list[dict]) -> Path:
    """Return a folder with the kept answers of some problems."""
    folder.mkdir()
    for problem in problems:
        shutil.copy(BENCH / f"answers/scarl/{problem['name']}.csv", folder)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["near_plate", "post_on_ground", "wall_ghosts", "slabs"])
def test_auto_answers_within_the_tolerance(name: str) -> None:
    from benchmarks.testbench.adapters import answers, scarl

    folder, described, rows = answers.read(name)
    problem = next(one for one in PROBLEMS if one["name"] == name)
    found = scarl.SOLVERS[name](folder, described, rows)
    given = {row["case"]: (value,) for row, value in zip(rows, found, strict=True)}
    result = score.score(problem, given)
    assert result["within"] == result["cases"], json.dumps(result["errors"])
