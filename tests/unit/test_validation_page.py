"""docs/validation.md is made of its rows; every row has a source, and verdicts follow from figures."""

from __future__ import annotations

import pytest

from benchmarks.validation import front_end, ground, layers, weather
from benchmarks.validation.page import PAGE, page
from benchmarks.validation.rows import THEMES, Row, around, read, share
from benchmarks.validation.sources import SOURCES

LINES = read()
ROWS = [line for line in LINES if "cpu_s" not in line]


def test_the_page_is_what_the_generator_makes_of_the_rows() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(LINES)


def test_every_theme_says_what_it_cost_and_on_which_machine() -> None:
    for theme in THEMES:
        (cost,) = (line for line in LINES if line["theme"] == theme and "cpu_s" in line)
        assert 0.0 < cost["cpu_s"] < 900.0 and "numpy" in cost["machine"]


def test_there_are_forty_rows_with_sources_and_no_name_twice() -> None:
    assert len(ROWS) >= 40
    assert len({row["name"] for row in ROWS}) == len(ROWS)
    for row in ROWS:
        assert SOURCES[row["source"]].citation and SOURCES[row["source"]].read, row["name"]
        assert row["low"] is not None or row["high"] is not None, row["name"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["name"])
def test_the_verdict_follows_from_the_figures(row) -> None:
    above = row["low"] is None or row["ours"] >= row["low"]
    below = row["high"] is None or row["ours"] <= row["high"]
    assert row["within"] == (above and below)
    assert ("why" in row) == (not row["within"]), "what lies outside names its cause, and nothing else does"
    assert row["basis"] in ("held out", "bound", "fitted") and row["spread"] in ("stated", "between", "assumed")
    assert "note" in row or row["basis"] != "fitted", "what was fitted is said"


@pytest.mark.parametrize(
    "made",
    [ground.law, layers.bumpers, layers.permittivities, weather.attenuation, weather.echo, front_end.device],
    ids=lambda made: f"{made.__module__.split('.')[-1]}.{made.__name__}",
)
def test_cheap_rows_come_out_as_they_stand(made) -> None:
    kept = {row["name"]: row for row in ROWS}
    found = made()
    assert len(found) >= 3
    for row in found:
        stands = kept[row.name]
        assert (row.low, row.high, row.source, row.unit) == tuple(
            stands[key] for key in ("low", "high", "source", "unit")
        )
        assert row.ours == pytest.approx(stands["ours"], rel=2e-3, abs=0.011), row.name  # the last digit written


def test_limits_belong_to_the_range() -> None:
    def within(ours: float, low: float | None, high: float | None) -> bool:
        return Row("name", "what", "jrc", "dB", low, high, "stated", "held out", ours).within

    assert within(1.0, 1.0, 2.0) and within(2.0, 1.0, 2.0) and within(-9.0, None, 2.0) and within(9.0, 1.0, None)
    assert not within(0.99, 1.0, 2.0) and not within(2.01, None, 2.0)


def test_ranges_of_single_numbers() -> None:
    assert (around(-12.0)["low"], around(-12.0)["high"]) == (-15.0, -9.0)
    assert (share(-2.0)["low"], share(-2.0)["high"]) == (-2.2, -1.8)
