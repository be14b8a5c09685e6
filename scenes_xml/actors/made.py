"""Models that are not packed: they are made by their scripts on first use, in a fraction of a second."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

NAMES = ("articulated_lorry", "box_van", "bus", "cargo_bike", "coach", "lorry", "tram", "van")


@lru_cache(maxsize=1)
def key() -> str:
    """Return a hash of all that shapes a model."""
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256((here / "bodies" / "files.xz").read_bytes())
    generators = here.parent / "generators"
    rooms = (
        here,
        here / "bodies",
        generators,
        *(generators / room for room in ("geometry", "people", "vehicles", "vehicles/cars", "vehicles/cycles")),
    )
    for file in sorted(file for room in rooms for file in room.glob("*.py")):
        digest.update(file.relative_to(here.parent).as_posix().encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


def build(name: str, folder: Path) -> None:
    """Write a model into `folder`."""
    from .build import build

    build(name, folder)
