"""Build the actor models.

``python -m scenes_xml.actors.build [model ...]`` writes XML, actor.toml and packed meshes of each.

Everything follows from the numbers in this package; a second run gives the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..packing import write_packed
from . import cars, cycles, heavy
from .model import Model, write_model

MODELS: dict[str, Callable[[], Model]] = {
    **{name: partial(cars.build, name) for name in cars.SHAPES},
    "van": heavy.make_van,
    "box_van": heavy.make_box_van,
    "lorry": heavy.make_lorry,
    "bus": heavy.make_bus,
    "coach": heavy.make_coach,
    "tram": heavy.make_tram,
    **cycles.MODELS,
}
"""Name of each model -> the function that makes it."""


def build(name: str, folder: Path) -> None:
    """Write a model into `folder`."""
    write_model(MODELS[name](), folder)


if __name__ == "__main__":
    chosen = sys.argv[1:] or list(MODELS)
    unknown = sorted(set(chosen) - set(MODELS))
    if unknown:
        raise SystemExit(f"no actor model {', '.join(unknown)}; choose from {', '.join(MODELS)}")
    for model in chosen:
        write_packed(Path(__file__).resolve().parent / model, partial(build, model))
