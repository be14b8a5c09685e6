"""Drives on the lanes of a map, for tests: the longest route, and a scenario whose ego follows it."""

from __future__ import annotations

import scarl_sionna as ss
from scarl_sionna.scene.lanes import LaneNetwork


def longest_route(network: LaneNetwork) -> list[str]:
    """Return the longest of the routes that always take the first, or always the last, way on."""
    found: list[list[str]] = []
    for lane in network.of_kind("drive"):
        for choice in (0, -1):
            route = [lane.name]
            while (further := network[route[-1]].next) and further[choice] not in route and len(route) < 60:
                route.append(further[choice])
            found.append(route)
    return max(found, key=lambda route: sum(network[name].length for name in route))


def drive(
    scene: str, route: list[str], duration: float, speed: float, *actors: dict, variant: int = 0
) -> ss.ScenarioSpec:
    """Return a scenario in which the ego follows a route; `variant` is the seed of a map's surroundings."""
    motion = {"kind": "route", "lanes": route, "start": 6.0, "speed": speed}
    return ss.ScenarioSpec(
        scene=scene, variant=variant, duration=duration, frame_rate=1.0, ego={"trajectory": motion}, actors=list(actors)
    )


def stays_on_its_lanes(world, network: LaneNetwork, route: list[str], stop: float) -> bool:
    """Return whether no side of the ego, a saloon of 1.9 m, leaves its lane by more than 0.3 m in any second."""
    time = 0.0
    while time < stop:
        place = world.at(time).actor_pose("ego").position
        away, lane = min(((network[name].nearest(place)[1], network[name]) for name in route), key=lambda pair: pair[0])
        if away + 0.95 >= 0.5 * lane.width + 0.3:
            return False
        time += 1.0
    return True
