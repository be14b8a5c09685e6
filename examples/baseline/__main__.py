"""Trains and tests the networks of docs/baseline.md on a dataset and prints the tables.

python -m examples.baseline DATASET ... [--out FOLDER] [--steps 300] [--runs 3]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .data import read_samples
from .experiments import NUM_RUNS, experiments, read_outcomes, run_experiments
from .figure import draw
from .tables import Results, markdown


def main() -> None:
    """Read a dataset once, run the experiments that are not done yet, and write tables and figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("baseline_out"), help="folder of the results")
    parser.add_argument("--steps", type=int, default=300, help="batches of 8 frames in each training")
    parser.add_argument("--runs", type=int, default=NUM_RUNS, help="trainings of each kind")
    parser.add_argument("--only", default="", help="experiments whose text has this in it")
    options = parser.parse_args()

    options.out.mkdir(parents=True, exist_ok=True)
    samples = read_samples(*options.datasets)
    chosen = [one for one in experiments(samples.methods, options.runs) if options.only in str(one)]
    run_experiments(samples, chosen, options.out / "outcomes.jsonl", options.steps)
    results = Results(samples, read_outcomes(options.out / "outcomes.jsonl"))
    text = markdown(results)
    (options.out / "tables.md").write_text(text, encoding="utf-8")
    draw(samples, results, options.out / "baseline.png")
    print(text)


if __name__ == "__main__":
    main()
