"""CPU time of parts of a frame in this checkout against another one, in turn, in one run.

    git worktree add --detach ../before COMMIT
    python benchmarks/side_by_side.py ../before [--rounds 2] [--repeats 5] [--fresh] PART ...

The parts are those of ``benchmarks/parts.py``, whose code is this checkout's for both. Each round starts a process of
the one and one of the other checkout. Printed are the medians over the rounds, the ratios, and whether the results have
the same bytes. ``--fresh``: with an empty kernel cache for each process, so that the first call compiles everything.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from harness import machine

HERE = Path(__file__).resolve().parents[1]


def run(checkout: Path, part: str, repeats: int, fresh: bool) -> dict[str, Any]:
    """Return what `parts.py` finds for a part with the library of a checkout."""
    with tempfile.TemporaryDirectory() as home:
        environment = os.environ | {"PYTHONPATH": str(checkout)} | ({"HOME": home} if fresh else {})
        command = [sys.executable, str(HERE / "benchmarks" / "parts.py"), "--json", "--repeats", str(repeats), part]
        done = subprocess.run(command, env=environment, cwd=checkout, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="the other checkout")
    parser.add_argument("parts", nargs="+", metavar="PART")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--fresh", action="store_true")
    args = parser.parse_args()
    print(machine(), "\n\n| part | first, CPU [s] | warm, CPU [s] | ratio | main thread [s] | wall [s] | same bytes |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for part in args.parts:
        rounds = [
            [run(where, part, args.repeats, args.fresh) for where in (args.before.resolve(), HERE)]
            for _ in range(args.rounds)
        ]
        cells = [part]
        for key in ("cold_cpu", "cpu", "thread", "wall"):
            old, new = np.median([[found[key] for found in pair] for pair in rounds], axis=0).tolist()
            cells.append(f"{old:.3g} to {new:.3g}")
            if key == "cpu":
                cells.append(f"{new / old:.2f}")
        cells.append("yes" if len({tuple(found["digests"]) for pair in rounds for found in pair}) == 1 else "no")
        print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
