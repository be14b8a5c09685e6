"""Precision and recall of the detector's thresholds on six scenes with traffic, at equal false points.

    python benchmarks/detection.py frames                    solve the 18 frames; goes on where it stopped
    python benchmarks/detection.py table                     compare the thresholds, a line of JSON each
    python benchmarks/detection.py table --write docs/detection.md

A frame is solved once. Every local maximum of its map, with its directions, is labelled by `ss.label_points`; then each
threshold says from which false-alarm rate on it takes the maximum. What is kept of a frame is that table
(`build/detection`), so that other thresholds and counts need no paths again.

*False*: what all paths together explain is less than half of a point's power (`PointLabels.explained`). *Own a cell*:
an object has more than half of the power in a cell of the range-Doppler map, and the strongest such cell gives its SNR
(of one channel, before beamforming). *Found*: a point is labelled with the object.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import scipy.ndimage

sys.path.insert(0, str(Path(__file__).parents[1]))

import scarl_sionna as ss
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.scenario.compose import build_world
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.signal.detection.threshold import Statistic, TrainingWindow, exceeds

STORE = Path("build/detection")
RESULTS = Path("docs/figures/data/detection.jsonl")
RADAR = ss.RadarSpec()
TRAFFIC = {
    "density": 25,
    "mix": {"saloon": 3, "small_car": 2, "van": 1, "lorry": 1, "motorcycle": 2},
    "pedestrians": 10,
    "cyclists": 4,
}
PLACES: dict[str, tuple[str, dict[str, Any]]] = {
    "urban_crossing": ("town_traffic", {}),
    "signalised_crossing": ("stop_at_the_lights", {}),
    "suburban_street": ("backing_out_of_a_drive", {}),
    "roundabout": ("roundabout_entry", {}),
    "country_road": ("oncoming_overtaker", {"pedestrians": 0}),
    "parking_garage": ("car_park_search", {"density": 5, "parked": 0.7}),
}
TIMES = (0.5, 2.0, 3.5)
GROUPS = {
    "people": ("Pedestrian",),
    "two-wheelers": ("Rider", "Motorcycle", "Bicycle"),
    "vehicles": ("Car", "Truck", "Bus", "Train"),
}
LOG_PFA = np.arange(-12.0, -2.9, 0.25)
"""Decades at which thresholds are tried."""
FLOOR = 2.0
"""Cells below this power over the thermal noise are left out: in noise alone, 12 channels need 2.1 at 1e-3."""
RANGES = (0.0, 20.0, 40.0, 60.0)
STRONG_DB = 13.0
MARGIN = 0.5
"""Points this far from an object's box, seen from above, are taken for the object's [m]."""


@dataclass(frozen=True)
class Variant:
    """A threshold; half-widths in cells (Doppler, range)."""

    kind: str
    along: str = "both"
    guard: tuple[int, int] = (3, 3)
    training: tuple[int, int] = (6, 8)
    rank: float = 0.75

    def __str__(self) -> str:
        rank = f", rank {self.rank:g}" if self.kind.startswith("os") else ""
        return f"{self.kind}, {self.along}, guard {self.guard}, training {self.training}{rank}"


AROUND = Variant("ca")
VARIANTS = (
    *(Variant(kind, along) for kind in ("ca", "go", "so", "os", "osgo") for along in ("both", "range", "doppler")),
    *(Variant("os", along, rank=rank) for along in ("both", "range", "doppler") for rank in (0.25, 0.5)),
    *(Variant("ca", "both", guard, training) for guard, training in (((2, 2), (2, 3)), ((3, 3), (3, 4)))),
    *(Variant("so", "both", guard, training) for guard, training in (((2, 2), (2, 3)), ((3, 3), (3, 4)))),
    Variant("os", "both", (3, 3), (3, 4)),
    *(Variant("os", "both", (3, 3), (12, 12), rank) for rank in (0.25, 0.5)),
    *(Variant(kind, "range", (3, 3), (6, 16)) for kind in ("so", "os")),
    *(Variant(kind, "doppler", (3, 3), (cells, 8)) for kind in ("ca", "so", "os") for cells in (12, 24)),
    *(Variant("os", "doppler", (3, 3), (cells, 8), rank) for cells in (24, 60) for rank in (0.25, 0.5)),
)


def frames() -> Iterator[tuple[str, int]]:
    """Yield place and number of every frame, the first of each place before the second of any."""
    for number in range(len(TIMES)):
        for place in PLACES:
            yield place, number


def group_of(semantic: int) -> str:
    """Return the group of road users of a class, empty for all others."""
    return next((name for name, classes in GROUPS.items() if SEMANTIC_CLASSES[semantic] in classes), "")


def observed(place: str, number: int) -> tuple[Any, ss.Mount, Any, np.ndarray]:
    """Return state, mount, paths and cube of one frame."""
    preset, change = PLACES[place]
    world = build_world(ScenarioSpec.preset(preset).with_(traffic=TRAFFIC | change, seed=1))
    state = world.at(world.time_range[0] + TIMES[number])
    mount = state.mount(world.ego, ss.Rig.front()["front_center/radar"].vehicle_from_sensor)
    paths = ss.solve_paths(state, RADAR, mount)
    return state, mount, paths, ss.virtual_cube(ss.synthesize(paths, RADAR, rng=np.random.default_rng(number)), RADAR)


def solve(place: str, number: int) -> dict[str, np.ndarray]:
    """Return the table of one frame: objects, points, and from which rate on each threshold takes each cell."""
    state, mount, paths, cube = observed(place, number)
    rda = ss.range_doppler_angle(cube, RADAR)
    rd = rda.range_doppler
    owners = ss.label_cells(rd, paths, state, "sidelobes")
    objects, own = objects_of(state, mount, owners, rd.noise_power)
    high = FLOOR * rd.noise_power
    peaks = np.flatnonzero(rd.power == scipy.ndimage.maximum_filter(rd.power, size=3, mode=("wrap", "nearest")))
    points = ss.detect(rda, RADAR, pfa=0.9, guard=(0, 0), training=(1, 1))  # all local maxima
    place_of = _cell_of(points, rd, peaks)
    chosen = rd.power.reshape(-1)[place_of] > high
    points = type(points)(**{item.name: getattr(points, item.name)[chosen] for item in fields(points)})
    place_of, own = place_of[chosen], own[rd.power.reshape(-1)[own[:, 1]] > high]
    labels = ss.label_points(points, paths, RADAR, state)
    cells = np.unique(np.concatenate([place_of, own[:, 1]]))
    return {
        "objects": objects,
        "own": np.stack([own[:, 0], np.searchsorted(cells, own[:, 1])], axis=1),
        "point_cell": np.searchsorted(cells, place_of),
        "point_range": points.range,
        "point_xy": mount.pose.apply(points.position)[:, :2],
        "point_snr": points.snr_db,
        "instance": labels.instance,
        "explained": labels.explained,
        "is_ghost": labels.is_ghost,
        "semantic": labels.semantic,
        "boxes": boxes_of(state, objects),
        "rate": np.stack([_rates(rd, cells, variant) for variant in VARIANTS]),
        "variants": np.array([str(variant) for variant in VARIANTS]),
    }


def objects_of(state: Any, mount: ss.Mount, owners: Any, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return road users (instance, class, range, SNR in own cells; -inf for none), and their own cells (row, cell)."""
    power = owners.power.reshape(-1)
    entry = owners.entry_share * power[owners.cell] / noise
    rows, own = [], []
    for item in state.boxes():
        if not group_of(item.semantic) or item.name == state.world.ego:
            continue
        mine = np.zeros(power.size)
        chosen = owners.entry_instance == item.instance
        np.add.at(mine, owners.cell[chosen], entry[chosen])
        held = np.flatnonzero((mine > 0.5 * power / noise) & (mine > 1.0))
        snr = 10.0 * np.log10(mine[held].max()) if len(held) else -np.inf
        distance = np.linalg.norm(item.world_from_box.position - mount.pose.position)
        own += [(len(rows), cell) for cell in held]
        rows.append((item.instance, item.semantic, distance, snr))
    return np.array(rows).reshape(-1, 4), np.array(own, dtype=np.int64).reshape(-1, 2)


def boxes_of(state: Any, objects: np.ndarray) -> np.ndarray:
    """Return the footprints of objects in the world: centre x, y, direction x, y, length, width."""
    known = {item.instance: item for item in state.boxes()}
    rows = []
    for number in objects[:, 0].astype(int):
        item = known[number]
        ahead = item.world_from_box.apply(np.array([1.0, 0.0, 0.0])) - item.world_from_box.position
        rows.append([*item.world_from_box.position[:2], *ahead[:2], *item.size[:2]])
    return np.array(rows).reshape(-1, 6)


def _cell_of(points: Any, rd: Any, peaks: np.ndarray) -> np.ndarray:
    """Return the flat cell of every point: the local maximum nearest to its range and velocity."""
    num_doppler, num_range = rd.data.shape[1:]
    row = (points.radial_velocity - rd.radial_velocity[0]) / (rd.radial_velocity[1] - rd.radial_velocity[0])
    column = points.range / (rd.range[1] - rd.range[0])
    peak_row, peak_column = np.divmod(peaks, num_range)
    out = np.zeros(len(row), dtype=np.int64)
    for number in range(len(row)):
        away = (peak_row - row[number] + num_doppler / 2) % num_doppler - num_doppler / 2
        out[number] = peaks[np.argmin(away**2 + (peak_column - column[number]) ** 2)]
    return out


def _rates(rd: Any, cells: np.ndarray, variant: Variant) -> np.ndarray:
    """Return the index into `LOG_PFA` from which on each cell stands out; its length where none suffices."""
    window = TrainingWindow.of(rd, variant.guard, variant.training, variant.along)
    statistic = Statistic(variant.kind, variant.along, variant.rank)
    power = rd.power.astype(np.float64)
    row, column = np.divmod(cells, power.shape[1])
    low, high = np.zeros(len(cells), dtype=np.int64), np.full(len(cells), len(LOG_PFA))
    while (low < high).any():
        middle = (low + high) // 2
        for index in np.unique(middle[low < high]):
            mine = np.flatnonzero((middle == index) & (low < high))
            out = exceeds(window, power, (row[mine], column[mine]), len(rd.data), 10.0 ** LOG_PFA[index], statistic)
            high[mine[out]] = index
            low[mine[~out]] = index + 1
    return low.astype(np.uint8)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("frames", "table"))
    parser.add_argument("--seconds", type=float, default=1e9, help="begin no further frame after so many")
    parser.add_argument("--write", type=Path, metavar="PAGE")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.what == "frames":
        start = time.monotonic()
        STORE.mkdir(parents=True, exist_ok=True)
        for place, number in frames():
            path = STORE / f"{place}_{number}.npz"
            if path.exists() or time.monotonic() - start > arguments.seconds:
                continue
            cpu = time.process_time()
            table = solve(place, number)
            np.savez_compressed(path, **table)
            print(place, number, f"{len(table['instance'])} maxima, {time.process_time() - cpu:.0f} CPU s", flush=True)
        return
    from benchmarks.detection_tables import write_tables

    write_tables(arguments.write)


if __name__ == "__main__":
    main()
