"""Maps and scenarios of other projects, from folders: how long they take to load, and whether they drive.

``python benchmarks/others.py maps FOLDER|FILE ...`` prints a row for each map (.xodr, .osm, .net.xml, .json): length of
its lanes to drive on [km], number of lanes, CPU seconds to the loaded scene with an empty cache, and those a
kilometre, findings; how long a car drives its longest route (60 s) and at what speed (13 m/s, slower where a corner
asks for it), how far it comes out of its lane [m], and the radar paths of a frame by ``auto``.
``python benchmarks/others.py scenarios FOLDER ...`` prints a row for each .xosc: entities, what it ends with or why it
is refused, CPU seconds. ``--map FILE`` gives scenarios a map that theirs does not name as a file.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import scarl_sionna as ss
from scarl_sionna.core.errors import ScarlError, ScenarioValueError
from scarl_sionna.core.settings.radar import RadarSettings
from scarl_sionna.scenario.openscenario import SUFFIX
from scarl_sionna.scenario.openscenario.drive import read_drive
from scarl_sionna.scene.document.find import MAP_SUFFIXES
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.simulation import load_world
from tests.street_drives import drive, longest_route

DURATION, FASTEST, HALF_WIDTH = 60.0, 13.0, 0.95
RADAR = RadarSettings(method="auto", accuracy={"channel_tolerance_db": 3.0, "tube_budget": 20_000})


def main() -> None:
    """Print the rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=("maps", "scenarios"))
    parser.add_argument("places", nargs="+", type=Path)
    parser.add_argument("--map", type=Path, help="of scenarios whose own is no file")
    parser.add_argument("--load-only", action="store_true", help="of maps: neither drive nor radar")
    given = parser.parse_args()
    endings = MAP_SUFFIXES if given.what == "maps" else (SUFFIX,)
    for file in sorted(one for place in given.places for one in _files(place, endings)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                row = _map_row(file, given.load_only) if given.what == "maps" else _scenario_row(file, given.map)
            except ScarlError as error:
                row = f"{type(error).__name__}: {str(error).replace(str(file), file.name)[:300]}"
        print(f"| `{file.name}` | {row} |", flush=True)


def _files(place: Path, endings: tuple[str, ...]) -> list[Path]:
    return [place] if place.is_file() else [one for one in place.iterdir() if one.name.endswith(endings)]


def _map_row(file: Path, load_only: bool) -> str:
    """Return kilometres and number of lanes, CPU seconds and those a kilometre of lane, and what the drive gives."""
    with tempfile.TemporaryDirectory() as cache:
        os.environ["SCARL_CACHE_DIR"] = cache
        before = os.times()
        world = ss.load_scene(file)
        after = os.times()
        spent = sum(after[:4]) - sum(before[:4])  # with netconvert's
        network = world.document.lanes
        assert network is not None
        length = sum(lane.length for lane in network.of_kind("drive")) / 1000.0
        found = len(world.document.info.get("findings", ()))
        row = f"{length:.2f} | {len(network.lanes)} | {spent:.1f} | {spent / max(length, 1e-9):.1f} | {found}"
        return row if load_only else f"{row} | {_driven(file, network)}"


def _driven(file: Path, network: LaneNetwork) -> str:
    """Return seconds driven and the speed, how far out of the lane, and the radar paths with their CPU seconds."""
    route = longest_route(network)
    length = sum(network[name].length for name in route)
    if length < 40.0:
        return f"no route of 40 m ({length:.0f} m) | | "
    seconds, speed = min(DURATION, (length - 20.0) / 1.0), FASTEST
    while True:
        speed = min(speed, (length - 20.0) / seconds)
        try:
            world = load_world(drive(str(file), route, seconds, speed))
            break
        except ScenarioValueError:  # too fast for a corner
            speed *= 0.5
            if speed < 1.0:
                raise
    out = max(_out(world, network, route, float(when)) for when in np.arange(0.0, seconds - 1.0, 1.0))
    state = world.at(1.0)
    before = time.process_time()
    paths = ss.solve_paths(
        state, ss.RadarSpec.preset("awr1843boost"), state.mount("ego", ss.Pose([2.4, 0.0, 0.6])), settings=RADAR
    )
    return f"{seconds:.0f}, {speed:.1f} | {out:.2f} | {len(paths.a)}, {time.process_time() - before:.1f} s"


def _out(world: ss.World, network: LaneNetwork, route: list[str], time: float) -> float:
    """Return how far a side of the car is out of its lane [m]."""
    place = world.at(time).actor_pose("ego").position
    away, lane = min(((network[name].nearest(place)[1], network[name]) for name in route), key=lambda pair: pair[0])
    return max(float(away + HALF_WIDTH - 0.5 * lane.width), 0.0)


def _scenario_row(file: Path, map_file: Path | None) -> str:
    before = time.process_time()
    found = read_drive(file, map_file)
    spent = time.process_time() - before
    return f"{len(found.entities)} | {found.run.stop:.1f} s: {found.run.reason} | {spent:.1f}"


if __name__ == "__main__":
    main()
