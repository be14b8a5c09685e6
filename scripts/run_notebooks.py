"""Run the notebooks from top to bottom and write copies with their outputs; those in the repository stay without.

python scripts/run_notebooks.py [--out build/notebooks] [NAME ...]
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

import nbclient
import nbformat

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
TIMEOUT = 600
"""For one cell [s]."""


def main() -> None:
    """Run the notebooks that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="start of a notebook's name; default: all")
    parser.add_argument("--out", type=Path, default=FOLDER.parent / "build" / "notebooks")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for path in sorted(FOLDER.glob("*.ipynb")):
        if options.names and not path.stem.startswith(tuple(options.names)):
            continue
        notebook = nbformat.read(path, as_version=4)
        started = perf_counter()
        nbclient.NotebookClient(notebook, timeout=TIMEOUT, resources={"metadata": {"path": str(FOLDER)}}).execute()
        nbformat.write(notebook, options.out / path.name)
        print(f"| {path.stem} | {perf_counter() - started:.0f} s |", flush=True)


if __name__ == "__main__":
    main()
