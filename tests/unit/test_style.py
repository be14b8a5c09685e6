"""Gates of style that no linter has: exceptions from the formatter state their reason."""

from __future__ import annotations

import io
import re
import subprocess
import tokenize
from pathlib import Path

import pytest

REPO = Path(__file__).resolve().parents[2]

_EXCEPTION = re.compile(r"#\s*fmt:\s*(skip|off)\b")
_WITH_REASON = re.compile(r"#\s*fmt:\s*(skip|off)\s*#\s*\S")


def without_reason(code: str) -> list[int]:
    """Return the lines of a module that take themselves out of the formatter and do not say why."""
    if not _EXCEPTION.search(code):  # most modules: tokens take seconds
        return []
    tokens = tokenize.generate_tokens(io.StringIO(code).readline)
    comments = [token for token in tokens if token.type == tokenize.COMMENT]
    found = [token for token in comments if _EXCEPTION.search(token.string) and not _WITH_REASON.search(token.string)]
    return [token.start[0] for token in found]


def test_the_gate_sees_an_exception_without_a_reason() -> None:
    assert without_reason("a = 1  # fmt: skip\nb = 2  # fmt: skip # a table\n# fmt: off\n") == [1, 3]
    assert without_reason('text = "# fmt: skip"\n') == []


def test_exceptions_from_the_formatter_state_their_reason() -> None:
    listed = subprocess.run(["git", "ls-files", "*.py"], capture_output=True, text=True, cwd=REPO, check=False)
    if listed.returncode != 0:
        pytest.skip("no checkout of git")
    names = [name for name in listed.stdout.split() if (REPO / name).exists()]
    found = {name: without_reason((REPO / name).read_text(encoding="utf-8")) for name in names}
    assert len(names) > 500
    assert not {name: lines for name, lines in found.items() if lines}
