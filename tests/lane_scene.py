"""A small scene with lanes, parking places and actors of its own, for tests of scenarios."""

from __future__ import annotations

from pathlib import Path

from tests.scenes import Thing, box, plane, write_scene

LANES = """
[[lanes]]
name = "east"
width = 3.5
speed = 14.0
left = "east_2"
points = {east}
next = ["east_on"]

[[lanes]]
name = "east_on"
width = 3.5
speed = 14.0
points = {east_on}

[[lanes]]
name = "east_2"
width = 3.5
speed = 14.0
points = {east_2}

[[lanes]]
name = "west"
width = 3.5
speed = 14.0
points = {west}

[[lanes]]
name = "path"
kind = "walk"
width = 2.0
speed = 1.4
points = {path}

[[parking]]
position = [30.0, -4.0, 0.0]

[[parking]]
position = [36.0, -4.0, 0.0]
"""


def line(x0: float, x1: float, y: float) -> list[list[float]]:
    """Return points 2 m apart."""
    count = round(abs(x1 - x0) / 2.0)
    return [[x0 + (x1 - x0) * index / count, y, 0.0] for index in range(count + 1)]


def lane_scene(folder: Path, ego: bool = True) -> Path:
    """Write a straight road of 300 m.

    Two lanes to the east, one to the west, a footpath, and two actors that are known from 0 to 4 s.
    """
    times = [0.0, 2.0, 4.0]
    driving = {"kind": "waypoints", "times": times, "positions": [[10.0 * t, 0.0, 0.0] for t in times]}
    ahead = {"kind": "waypoints", "times": times, "positions": [[20.0 + 12.0 * t, 0.0, 0.0] for t in times]}
    path = write_scene(
        folder,
        instances=[
            Thing("road", plane(300.0, 40.0), "Roads", is_object=False),
            Thing("wall", plane(40.0, 10.0, (148.0, 0.0, 5.0), (-1, 0, 0)), "Wall"),
        ],
        actors=[
            *([Thing("ego", box([4.0, 1.6, 1.2], [0, 0, 0.8]), "Car", trajectory=driving)] if ego else []),
            Thing("ahead", box([4.0, 1.6, 1.4], [0, 0, 0.7]), "Car", "steel", trajectory=ahead),
        ],
        ego="ego" if ego else None,
    )
    lanes = LANES.format(
        east=line(-150.0, 50.0, 0.0),
        east_on=line(50.0, 146.0, 0.0),
        east_2=line(-150.0, 146.0, 3.5),
        west=line(146.0, -150.0, 7.0),
        path=line(-60.0, 60.0, -6.0),
    )
    toml = folder / "scene.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + lanes, encoding="utf-8")
    return path
