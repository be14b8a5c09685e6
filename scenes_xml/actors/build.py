"""Build the actor models: ``python -m scenes_xml.actors.build [model ...]`` writes XML, meshes and actor.toml of each.

Everything follows from the numbers in this package; a second run gives the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from . import cars, cycles, heavy, people
from .model import Model, write_model

MODELS: dict[str, Callable[[], Model]] = {
    **{name: partial(cars.build, name) for name in cars.SHAPES},
    "van": heavy.make_van,
    "lorry": heavy.make_lorry,
    "bus": heavy.make_bus,
    **people.MODELS,
    **cycles.MODELS,
}
"""Name of each model -> the function that makes it."""


def build(name: str, folder: Path | None = None) -> Path:
    """Write a model into `folder` (left out: its place in this package) and return the folder."""
    target = folder or Path(__file__).resolve().parent / name
    write_model(MODELS[name](), target)
    return target


if __name__ == "__main__":
    chosen = sys.argv[1:] or list(MODELS)
    unknown = sorted(set(chosen) - set(MODELS))
    if unknown:
        raise SystemExit(f"no actor model {', '.join(unknown)}; choose from {', '.join(MODELS)}")
    for model in chosen:
        print(build(model))
