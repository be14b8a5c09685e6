"""Files that another change is about to mend: those for which pyproject.toml switches off both E501 and ANN401."""

from __future__ import annotations

from pathlib import Path

from scarl_sionna.core.toml_file import read_toml

REPO = Path(__file__).resolve().parents[1]


def files_in_work() -> tuple[str, ...]:
    """Return the files and folders, without the ``**`` of their patterns."""
    rules = read_toml(REPO / "pyproject.toml")["tool"]["ruff"]["lint"]["per-file-ignores"]
    named = {pattern: set(codes) for pattern, codes in rules.items() if pattern not in ("tests/**", "benchmarks/**")}
    return tuple(pattern.removesuffix("**") for pattern, codes in named.items() if {"E501", "ANN401"} <= codes)


def modules_in_work() -> tuple[str, ...]:
    """Return the same as names of modules."""
    return tuple(name.removesuffix(".py").rstrip("/").replace("/", ".") for name in files_in_work())
