"""docs/report.md says what the pages say from which it takes its figures."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.validation.rows import read

DOCS = Path(__file__).resolve().parents[2] / "docs"
REPORT = (DOCS / "report.md").read_text(encoding="utf-8")
SAME = (
    ("sbr.md", "physical optics by quadrature | 0.010 dB", "exact PO integral by quadrature | 0.010 dB"),
    ("sbr.md", "trihedral of 0.1 m, boresight | closed form | +0.12 dB", "/ (3 lambda^2) | +0.12 dB"),
    ("accuracy.md", "| Mie | 0.06 to 0.11 dB", "0.06 to 0.11 dB; error falls as h^2"),
    ("accuracy.md", "64 cases | closed form | 5e-7 dB", "Two-ray, 64 cases; nulls | 0.1 dB; 0.1 % | 5e-7 dB"),
    ("accuracy.md", "at most 0.71 / 0.80 dB", "| car | 1 dB | 0.71 dB |"),
    ("accuracy.md", "exponential law: 2 | 2.00 to 2.01", "2.00, 2.01, 2.01"),
    ("radar_signal.md", "below -59 dB", "are below -59 dB"),
    ("performance_synthesis.md", "-93.5 dB; lone path -85.9 dB", "| 0.0001 | -93.5 | -85.9 |"),
    ("performance.md", "512 by 256 samples within 70 m/s take 0.37 s", "| 1 s | 0.37 s |"),
    ("baseline.md", "46 % on maps and 39 % on points", "| car | 128 | 46 (39 to 51) | 39 (33 to 45) |"),
    ("limits.md", "floor agrees within 0.6 dB", "floors are right within 0.6 dB"),
)
"""Page, what the report says, and what the page says."""


@pytest.mark.parametrize(("page", "said", "source"), SAME, ids=[said for _, said, _ in SAME])
def test_a_figure_stands_on_its_page(page: str, said: str, source: str) -> None:
    assert said in REPORT and source in (DOCS / page).read_text(encoding="utf-8")


def test_the_count_of_measured_rows_is_that_of_the_rows() -> None:
    rows = [line for line in read() if "cpu_s" not in line]
    for basis in ("held out", "bound", "fitted"):
        chosen = [row for row in rows if row["basis"] == basis]
        assert f"| {basis} | {len(chosen)} | {sum(row['within'] for row in chosen)} |" in REPORT
    held = [row["within"] for row in rows if row["basis"] == "held out"]
    abstract = " ".join(REPORT.partition("## Abstract")[2].partition("\n## ")[0].split())
    assert f"Of {len(held)} published measurements to which nothing was fitted, {sum(held)} contain" in abstract
    assert f"{100.0 * sum(held) / len(held):.0f} %." in REPORT and f"{len(rows)} published figures" in REPORT
    outside = [row["theme"] for row in rows if row["basis"] == "held out" and not row["within"]]
    assert f"({outside.count('vehicles')} of the {len(outside)} rows outside)" in REPORT


def test_the_count_of_the_test_bench_is_that_of_its_page() -> None:
    page = (DOCS / "testbench.md").read_text(encoding="utf-8")
    tried = re.search(r"\| all +\| \d+ +\| +\| (\d+) of (\d+) tried +\| (\d+) of (\d+) tried", page)
    assert tried is not None
    a, b, c, d = tried.groups()
    assert f"in {a} of {b}, Sionna RT's solver alone in {c} of the {d} that it can try" in REPORT
    within = [re.search(rf"mom_{name} +\| (\d+) +\| dBsm +\| (\d+),", page) for name in ("dihedral", "trihedral")]
    cases, kept = (sum(int(match[k]) for match in within if match) for k in (1, 2))
    assert f"{kept} of {cases} directions within the tolerance" in REPORT


def test_the_cost_of_the_levels_is_that_of_the_table() -> None:
    page = (DOCS / "accuracy.md").read_text(encoding="utf-8")
    table = page[page.index("begin field levels") : page.index("end field levels")]
    rows = [re.search(rf"\(`auto`, {level} dB\) \| \d+ \| (\d+) \|.*\| (\d+) \|", table) for level in (3, 1)]
    objects, seconds = ([int(match[k]) for match in rows if match] for k in (1, 2))
    assert "{} and {} CPU seconds".format(*seconds) in REPORT and "{} and {} of 260".format(*objects) in REPORT


def test_links_to_pages_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([a-z_]+\.md)", REPORT):
        assert (DOCS / target).is_file(), target
