"""A road of one plane with two cars of one box each, one behind the other.

The smallest scene in which weather has all to do.
"""

from __future__ import annotations

from pathlib import Path

from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from tests.scenes import Thing, box, plane, write_scene

SPEED = 18.0
"""Of both cars [m/s], along +x."""


def street(folder: Path) -> World:
    """Write the scene into a folder and load it; the middle of the car ahead is 19 m in front of that of the ego."""
    road = Thing("road", plane(400.0, 60.0), "Roads", is_object=False)
    body = box((4.2, 1.8, 1.3), (0.0, 0.0, 0.85))
    cars = [
        Thing(
            name,
            body,
            "Car",
            "white",
            {"kind": "waypoints", "times": [0.0, 4.0], "positions": [[x, 0.0, 0.0], [x + 4.0 * SPEED, 0.0, 0.0]]},
        )
        for name, x in (("ego", 0.0), ("car_ahead", 19.0))
    ]
    return load_scene(write_scene(folder, [road], cars, ego="ego"))
