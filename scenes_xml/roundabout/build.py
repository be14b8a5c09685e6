"""Build the scene: ``python -m scenes_xml.roundabout.build`` writes XML, scene.toml, meshes and textures.

Everything follows from the numbers in this package and the variant; a second run gives the same bytes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..generators.kit import SceneKit
from ..generators.roads.drive import drive, joined
from ..generators.roads.ground import Ground
from ..generators.roads.walkways import walk_lanes
from ..packing import write_packed
from . import layout as at
from . import static, things

NAME = "roundabout"
TIMES = np.arange(0.0, 8.0 + 1e-9, 0.2)


def build(folder: Path, variant: int = 0, detail: str = "detailed") -> None:
    """Write the whole scene into `folder`."""
    p = at.plan(variant)
    generator = np.random.default_rng(7100 + variant)
    table = {
        "name": NAME,
        "title": "Roundabout",
        "description": (
            "A roundabout of one lane with four arms, islands and zebra crossings, "
            "houses behind hedges around it; the ego car drives "
            "in from the west while a car goes round ahead of it, a van waits, a bicycle leaves and people cross."
        ),
        "license": "Apache-2.0",
        "source": f"built by scenes_xml/{NAME}/build.py",
        "seed": variant,
        "ego": "ego",
    }
    kit = SceneKit(folder, table, detail, seed=300, view=((-47.0, -1.9, 1.2), (0.0, -1.9, 1.2)))
    ground = static.add_ground(kit, p)
    things.add_things(kit, p, ground, generator)
    kit.lanes += at.lanes(p) + walk_lanes(static.walkways(p), ground)
    _actors(kit, p, ground)
    kit.write()


def _actors(kit: SceneKit, p: at.Plan, ground: Ground) -> None:
    """Add the default traffic: everything keeps to its lane."""
    lines = at.drive_lines(p)

    def route(*names: str) -> np.ndarray:
        return joined(*(lines[name] for name in names))

    through = route(
        "west_in", "west_entry", "ring_after_west", "ring_south", "ring_after_south", "east_exit", "east_out"
    )
    entry = float(np.linalg.norm(np.diff(lines["west_in"], axis=0), axis=1).sum())
    for name, model, colour, way, speeds, start in (
        ("ego", "saloon", None, through, ((0.0, 9.5), (2.6, 6.6), (5.0, 6.6), (8.0, 8.0)), entry - 21.0),
        ("car_ahead", "suv", None, through, ((0.0, 6.4), (3.0, 6.8), (8.0, 9.0)), entry + 9.0),
        (
            "van_waiting",
            "van",
            None,
            route("south_in", "south_entry", "ring_after_south"),
            ((0.0, 5.0), (1.9, 0.0), (5.6, 0.0), (8.0, 3.0)),
            None,
        ),
        (
            "car_leaving",
            "small_car",
            None,
            route("ring_after_north", "west_exit", "west_out"),
            ((0.0, 7.0), (8.0, 10.5)),
            1.0,
        ),
        (
            "bicycle",
            "bicycle",
            None,
            route("ring_after_east", "north_exit", "north_out"),
            ((0.0, 4.6), (8.0, 4.8)),
            2.0,
        ),
    ):
        if start is None:
            first = float(np.linalg.norm(np.diff(lines["south_in"], axis=0), axis=1).sum())
            start = first - 2.8 - 5.0 * 0.95
        positions, yaw = drive(way, TIMES, speeds, start, ground)
        kit.actor(name, model, TIMES, positions, colour, yaw)
    ways = static.walkways(p)
    for name, model, way, start, speed in (
        ("walker_crossing", "adult_woman", ways["cross_south"][::-1], 0.1, 1.25),
        ("walker_pavement", "adult_man", ways["walk_south_c"][::-1], 40.0, 1.4),
    ):
        positions, yaw = drive(way, TIMES, ((0.0, speed),), start, ground, 0.5)
        kit.actor(name, model, TIMES, positions, None, yaw)


if __name__ == "__main__":
    write_packed(Path(__file__).resolve().parent, build)
