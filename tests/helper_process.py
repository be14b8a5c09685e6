"""A second process of a test worker that holds much: it runs the tests of further files, until it is full, too.

A process for each file would import the engine and compile its kernels anew each time, five seconds of CPU time. Such
a process reads a request a line from its standard input, runs pytest, and answers with the bytes that it still holds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from scarl_sionna.engine.memory import release_memory, resident_bytes
from tests.children import with_parent

REPO = Path(__file__).resolve().parents[1]


class HelperProcess:
    """The process, started by the first request and after each end.

    Parameters
    ----------
    full : float
        It ends after a request that leaves it with more memory than this [bytes].
    """

    def __init__(self, full: float) -> None:
        self.full = full
        self._process: subprocess.Popen[str] | None = None

    def run(self, arguments: Sequence[str], environment: dict[str, str], printed: Path) -> str:
        """Run pytest and return how it ended: its exit status, or what became of the process."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "tests.helper_process"],
                cwd=REPO,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
                **with_parent(),
            )
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        request = {"arguments": [*arguments], "environment": environment, "printed": str(printed)}
        try:
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
            answer = process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        status, held = json.loads(answer) if answer else (None, self.full)
        if held >= self.full:
            self._process = None
            process.communicate()  # the end of its input is the end of the process
        return str(process.returncode) if status is None else str(status)


def main() -> None:
    """Answer requests until the input ends."""
    with os.fdopen(os.dup(1), "w") as answers:
        for line in sys.stdin:
            request = json.loads(line)
            os.environ.update(request["environment"])
            output = os.open(request["printed"], os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            for descriptor in (1, 2):
                os.dup2(output, descriptor)
            os.close(output)
            status = pytest.main(request["arguments"])
            sys.stdout.flush()
            release_memory()
            answers.write(json.dumps([int(status), resident_bytes()[0]]) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
