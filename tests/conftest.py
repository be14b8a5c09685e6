"""Options and environment of the whole test suite."""

from __future__ import annotations

import os

os.environ["MPLBACKEND"] = "Agg"  # no test opens a window

import pytest
from hypothesis import settings

settings.register_profile(
    "ci", derandomize=True
)  # the same examples in every run, so that a failure is the change's own
if os.environ.get("CI"):
    settings.load_profile("ci")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--run-slow", action="store_true", help="also run the tests that are marked slow")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--run-slow"):
        return
    skip = pytest.mark.skip(reason="slow: runs with --run-slow")
    for item in items:
        if "slow" in item.keywords:
            item.add_marker(skip)
