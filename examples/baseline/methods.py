"""Says whom `auto` computed by what in the frames of a dataset, and how far its radar is from that of `raycast` there.

python -m examples.baseline.methods DATASET ...
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import scarl_sionna as ss
from scarl_sionna.core.errors import DatasetError, ScarlError, UnknownNameError
from scarl_sionna.core.untrusted.checked import Table, Text, checked
from scarl_sionna.dataset.readers.reader import StoredFrame
from scarl_sionna.dataset.statistics.groups import GROUP_OF_SEMANTIC

from .data import FEWEST_PIXELS, FULL_SNR_DB, GRID, METHODS, NEAREST, radar_inputs
from .grid import CLASSES, PolarGrid

AROUND = (slice(-4, 3), slice(-2, 3))
"""Cells around the one of a centre, along range and sine, in which an object's strongest echo is looked for."""


@dataclass(frozen=True)
class Seen:
    """A road user in a frame: class, who computed its echo in `auto`, and its strongest echo by both methods [dB]."""

    kind: int
    computed_by: str
    snr_db: tuple[float, float]


def strongest(levels: npt.NDArray[Any], place: npt.ArrayLike, grid: PolarGrid = GRID) -> float:
    """Return the largest signal-to-noise ratio [dB] around a place [m] of a map of 0 to 1 for 0 to 60 dB."""
    row, column = np.floor(grid.coordinates(np.asarray(place)[None])[0]).astype(int)
    rows, columns = (
        slice(max(middle + around.start, 0), middle + around.stop)
        for middle, around in zip((row, column), AROUND, strict=True)
    )
    return float(levels[rows, columns].max()) * FULL_SNR_DB


class _Choice(Table):
    instance: Text
    method: Text


class _Diagnostics(Table):
    """What `auto` says of a frame."""

    choices: list[_Choice]


def chosen_methods(diagnostics: object) -> dict[str, str]:
    """Return by which method `auto` computed each object of a frame.

    Raises
    ------
    ValueError
        If that is not told there, as in datasets of old versions.
    """
    return {choice.instance: choice.method for choice in checked(_Diagnostics, diagnostics).choices}


def seen_in(frame: StoredFrame, chosen: Mapping[str, str]) -> Iterator[Seen]:
    """Yield the road users of a frame that count in the baseline; those that `auto` left out are in nobody's hands."""
    maps = [radar_inputs(frame, f"{method}/radar")[0] for method in METHODS]
    to_radar = frame.radar[f"{METHODS[0]}/radar"].world_from_sensor.inverse()
    for item in frame.labels:
        kind, place = int(GROUP_OF_SEMANTIC[item.semantic]), to_radar.apply(item.world_from_box.position)[:2]
        if kind >= 0 and item.num_pixels >= FEWEST_PIXELS and GRID.inside([place])[0] and np.hypot(*place) >= NEAREST:
            first, second = (strongest(levels, place) for levels in maps)
            yield Seen(kind, chosen.get(item.name, "left out"), (first, second))


def table(seen: Iterable[Seen]) -> str:
    """Return how many road users of each class each solver computed, and how far `auto` is above `raycast` there."""
    lines = [
        "| class | computed by | objects | apart by more than 3 dB | auto above raycast [dB] |",
        "|---|---|---|---|---|",
    ]
    groups: dict[tuple[int, str], list[float]] = {}
    for one in seen:
        groups.setdefault((one.kind, one.computed_by), []).append(one.snr_db[0] - one.snr_db[1])
    for (kind, method), apart in sorted(groups.items()):
        far = sum(abs(value) > 3.0 for value in apart)
        span = f"{min(apart):.1f} to {max(apart):.1f}, median {np.median(apart):.1f}"
        lines.append(f"| {CLASSES[kind]} | {method} | {len(apart)} | {far} | {span} |")
    return "\n".join(lines)


def main() -> int:
    """Print the table of datasets that have both radars."""
    parser = argparse.ArgumentParser(
        prog="python -m examples.baseline.methods",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "datasets", type=Path, nargs="+", metavar="DATASET", help="made with examples/baseline/rig.yaml"
    )
    try:
        print(table(_all(parser.parse_args().datasets)))
    except ScarlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _all(places: Iterable[Path]) -> Iterator[Seen]:
    for place in places:
        dataset = ss.open_dataset(place)
        for method in METHODS:
            if f"{method}/radar" not in dataset.sensors:
                raise UnknownNameError(
                    "sensor", f"{method}/radar", dataset.sensors, "make it with examples/baseline/rig.yaml"
                )
        sensor = f"{METHODS[0]}/radar"
        for name in dataset.scenes:
            for frame in dataset.scene(name):
                try:
                    chosen = chosen_methods(frame.radar[sensor].diagnostics)
                except ValueError as error:
                    raise DatasetError(
                        f"scene {name}, frame {frame.index}: {sensor!r} does not tell by what each object was "
                        f"computed: {error}",
                        place,
                        "export it anew with this version",
                    ) from None
                yield from seen_in(frame, chosen)


if __name__ == "__main__":
    sys.exit(main())
