"""Build the actor models.

``python -m scenes_xml.actors.build [model ...]`` writes XML, actor.toml and packed meshes of each that is packed.

Everything follows from the numbers in this package; a second run gives the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ..packing import write_packed
from . import cars, cycles, heavy, made
from .model import Model, write_model

MODELS: dict[str, Callable[[], Model]] = {
    **{name: partial(cars.build, name) for name in cars.SHAPES},
    "van": heavy.make_van,
    "box_van": heavy.make_box_van,
    "lorry": heavy.make_lorry,
    "articulated_lorry": heavy.make_articulated_lorry,
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
    packed = [name for name in MODELS if name not in made.NAMES]
    chosen = sys.argv[1:] or packed
    unknown = sorted(set(chosen) - set(packed))
    if unknown:
        raise SystemExit(f"no packed actor model {', '.join(unknown)}; choose from {', '.join(packed)}")
    for model in chosen:
        write_packed(Path(__file__).resolve().parent / model, partial(build, model))
