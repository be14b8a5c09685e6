"""Furniture of streets in towns: lamps, limits of speed, bus stops, benches, bins."""

from __future__ import annotations

import numpy as np

from scenes_xml.generators.geometry.mesh import Mesh, box, merge
from scenes_xml.generators.kit import Prefab, SceneKit
from scenes_xml.generators.roadside import bus_stop, furniture, garden
from scenes_xml.generators.roadside.bicycle_stand import parked_bicycle

from ..building.signs import limit_face
from ..model import Array
from .room import disc, rectangle
from .sides import Side
from .site import Site, Stand

_LAMPS, _LAMP_AWAY, _SIGN_AWAY = 30.0, 0.55, 0.75
_WIDE = 1.8
"""Pavements of less carry nothing [m]."""
_ROOMY = 2.6
"""Pavements from this width on have benches and bins at their back [m]."""
_STOPS = (260.0, 520.0)
_METAL = {"back": "sign_back", "pole": "galvanized_steel"}
_NARROW = 2.0
"""Pavements from this width on have bicycles at their back [m]."""
_AT_THE_BACK = ((0.2, "bench", 1.0), (0.33, "litter_bin", 0.3))
"""Least share that is not reached, thing, and half its length [m]; the others are bicycles."""
_BINS = ("bin_black", "bin_blue", "bin_yellow", "bin_green")


def _walk_width(side: Side, place: int) -> float:
    return float(np.linalg.norm((side.walk - side.kerb)[place, :2]))


def _by_the_kerb(site: Site, side: Side, place: int, away: float) -> tuple[Array, bool]:
    """Return a place on the pavement by the kerb, or behind it where that is narrow, and whether it is on it."""
    on_walk = _walk_width(side, place) >= _WIDE
    if on_walk:
        foot = side.kerb[place, :2] + away * side.out[place]
        return np.array([*foot, side.walk[place, 2]]), True
    return site.on_ground(side.front[place, :2] + away * side.out[place]), False


def add_lamps(site: Site) -> None:
    """Add lamp posts every 30 m, on both sides in turn, in towns and villages."""
    for number, side in enumerate(site.sides):
        if side.character == "motorway":
            continue
        start = (0.25 if side.sign > 0 else 0.75) * _LAMPS + float(site.generator(5, number).uniform(-2.0, 2.0))
        for way in np.arange(start, side.length, _LAMPS):
            place = side.at(way)
            is_dense = site.is_dense(side, place)
            where, on_walk = _by_the_kerb(site, side, place, _LAMP_AWAY)
            if side.character == "country" and not is_dense:
                continue
            if not side.is_open[place] or not site.room.taken(disc(where, 0.16), on_walk):
                continue
            small = is_dense and side.character == "town"
            site.put(
                "street_lamp" if small else "lamp_post",
                lambda small=small: _lamp(site.kit, small),  # type: ignore[misc]
                "Pole",
                Stand(where, side.yaw(place) + 0.5 * np.pi),
            )


def _lamp(kit: SceneKit, small: bool) -> Prefab:
    parts = furniture.street_lamp() if small else furniture.lamp_post(7.5, 1.6)
    metal = "black_plastic" if small else "galvanized_steel"
    bsdfs = {"pole": metal, "head": "sign_back", "glass": "lamp_glass"}
    return kit.prefab(f"beside_lamp_{int(small)}", kit.slim(parts, "head", "pole"), bsdfs)


def add_limits(site: Site) -> None:
    """Add signs of the limits of speed that the file states, where each road begins."""
    for side in site.sides:
        travels = side.sign < 0 if side.runs_forward else side.sign > 0
        value = None if side.speed is None else 3.6 * side.speed
        if not travels or value is None or side.length < 30.0 or abs(value - 10.0 * round(value / 10.0)) > 1.0:
            continue
        text = f"{10.0 * round(value / 10.0):.0f}"
        place = side.at(9.0 if side.runs_forward else side.length - 9.0)
        where, on_walk = _by_the_kerb(site, side, place, _SIGN_AWAY)
        if not side.is_open[place] or not site.room.taken(disc(where, 0.36), on_walk):
            continue
        ahead = float(np.arctan2(*side.along(place)[::-1])) + (0.0 if side.runs_forward else np.pi)
        site.put(f"limit_{text}", lambda text=text: _limit(site.kit, text), "TrafficSign", Stand(where, ahead))  # type: ignore[misc]


def _limit(kit: SceneKit, text: str) -> Prefab:
    parts = kit.slim(furniture.sign("round", 2.3), "back", "pole")
    return kit.prefab(f"beside_limit_{text}", parts, {"face": limit_face(kit, text), **_METAL})


def add_bus_stops(site: Site) -> None:
    """Add shelters with their posts along streets of towns."""
    for number, side in enumerate(site.sides):
        generator = site.generator(6, number)
        way = float(generator.uniform(40.0, _STOPS[0]))
        while side.character == "town" and way < side.length - 10.0:
            place = side.at(way)
            yaw = side.yaw(place) - 0.5 * np.pi
            width = _walk_width(side, place)
            away = width - 0.1 if width >= 3.6 else width + 1.9
            foot = side.kerb[place, :2] + away * side.out[place]
            plan = rectangle(foot, yaw, (-2.4, 2.4), (-1.8, 0.25))
            if side.is_open[place] and site.room.taken(plan, width >= 3.6):
                where = np.array([*foot, side.walk[place, 2]]) if width >= 3.6 else site.on_ground(foot)
                site.put("shelter", lambda: _shelter(site.kit), "Static", Stand(where, yaw))
                post, on_walk = _by_the_kerb(site, side, min(place + 4, len(side.s) - 1), _SIGN_AWAY)
                if site.room.taken(disc(post, 0.3), on_walk):
                    site.put("stop_post", lambda: _post(site.kit), "TrafficSign", Stand(post, yaw))
                way += float(generator.uniform(*_STOPS))
            else:
                way += 10.0


def _shelter(kit: SceneKit) -> Prefab:
    bsdfs = {"frame": "grey_steel", "glass": "shelter_glass", "roof": "grey_steel", "bench": "door_wood"}
    return kit.prefab("beside_shelter", bus_stop.shelter(), {**bsdfs, "poster": "poster"})


def _post(kit: SceneKit) -> Prefab:
    bsdfs = {"pole": "galvanized_steel", "flag": "sign_bus_stop", "board": "white_plastic"}
    return kit.prefab("beside_stop_post", kit.slim(bus_stop.post(), "board", "pole"), bsdfs)


def add_small_things(site: Site) -> None:
    """Add benches and litter bins at the back of pavements, and waste bins before houses."""
    for number, side in enumerate(site.sides):
        if side.character == "motorway":
            continue
        generator = site.generator(7, number)
        for way in np.arange(12.0, side.length, 17.0):
            place, chance = side.at(way + generator.uniform(-5.0, 5.0)), float(generator.uniform())
            color = _BINS[generator.integers(len(_BINS))]
            if not side.is_open[place] or not site.is_dense(side, place):
                continue
            yaw = side.yaw(place) + 0.5 * np.pi
            width = _walk_width(side, place)
            if width >= _NARROW and chance < (0.5 if width >= _ROOMY else 0.25):
                foot = np.array([*(side.walk[place, :2] - 0.45 * side.out[place]), side.walk[place, 2]])
                things = [one[1:] for one in _AT_THE_BACK if chance < one[0] and width >= _ROOMY]
                kind, half = things[0] if things else ("bicycle", 1.0)
                if site.room.taken(rectangle(foot, yaw, (-half, half), (-0.3, 0.3)), on_walk=True):
                    semantic = "Bicycle" if kind == "bicycle" else "Static"
                    site.put(kind, lambda kind=kind: _small(site.kit, kind), semantic, Stand(foot, yaw))  # type: ignore[misc]
            elif chance > 0.7:
                foot = side.front[place, :2] + 0.5 * side.out[place]
                if site.room.taken(disc(foot, 0.45)):
                    make = lambda: _small(site.kit, "waste_bin")  # noqa: E731
                    colors = {"tub": color, "lid": color}
                    stand = Stand(site.on_ground(foot), side.yaw(place), 1.0, colors)
                    site.put("waste_bin", make, "Static", stand)


def _small(kit: SceneKit, kind: str) -> Prefab:
    if kind == "bench":
        return kit.prefab("beside_bench", furniture.bench(), {"wood": "door_wood", "frame": "black_plastic"})
    if kind == "litter_bin":
        can = [box((0.4, 0.4, 0.75), (0.0, 0.0, 0.55)), box((0.08, 0.08, 0.4), (0.0, 0.0, 0.1))]
        body = merge([Mesh(part.vertices, part.faces) for part in can])
        return kit.prefab("beside_litter_bin", {"can": body}, {"can": "paint_green"})
    if kind == "bicycle":
        parts = parked_bicycle(kit.is_light)
        return kit.prefab("beside_bicycle", parts, {name: name for name in parts})
    bsdfs = {"tub": "bin_black", "lid": "bin_black", "wheels": "tyre_rubber"}
    return kit.prefab("beside_waste_bin", garden.bin_on_wheels(), bsdfs)
