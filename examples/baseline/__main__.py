"""Trains and tests the networks of docs/baseline.md on a dataset and writes the tables.

The same command goes on where it was stopped: what stands in FOLDER/outcomes.jsonl is not done again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from scarl_sionna.core.errors import ScarlError

from .data import INPUTS, read_samples
from .experiments import FRAMES, NUM_RUNS, experiments, finished, run_experiments
from .figure import draw
from .tables import Results, markdown

STOPPED = 130
"""Exit status after Ctrl-C."""


def main() -> int:
    """Read a dataset once, run the experiments that are not done yet, and write tables and figure."""
    options = _parser().parse_args()
    try:
        _run(options)
    except ScarlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"stopped, go on with the same command; finished trainings are kept in {options.out}", file=sys.stderr)
        return STOPPED
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m examples.baseline", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("datasets", type=Path, nargs="+", metavar="DATASET", help="made with a rig of this folder")
    parser.add_argument("--out", type=Path, default=Path("baseline_out"), metavar="FOLDER", help="of the results")
    parser.add_argument("--steps", type=_count, default=300, help="batches of 8 frames in each training (300)")
    parser.add_argument("--runs", type=_count, default=NUM_RUNS, help=f"trainings of each kind ({NUM_RUNS})")
    parser.add_argument("--inputs", nargs="+", choices=INPUTS, default=INPUTS, help="what the networks see (all)")
    parser.add_argument(
        "--frames", nargs="+", choices=FRAMES, default=FRAMES, help="which frames they learn from (each of these)"
    )
    parser.add_argument("--tables", action="store_true", help="train nothing, write the tables of what is done")
    return parser


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return value


def _run(options: argparse.Namespace) -> None:
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "outcomes.jsonl"
    samples = read_samples(*options.datasets)
    if not options.tables:
        chosen = [
            one
            for one in experiments(samples.methods, options.runs)
            if one.inputs in options.inputs and one.frames in options.frames
        ]
        run_experiments(samples, chosen, file, options.steps, lambda text: print(text, flush=True))
    results = Results(samples, finished(samples, file))
    text = markdown(results)
    (options.out / "tables.md").write_text(text, encoding="utf-8")
    draw(samples, results, options.out / "baseline.png")
    print(text)


if __name__ == "__main__":
    sys.exit(main())
