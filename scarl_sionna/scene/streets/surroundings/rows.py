"""Rows along the road: guardrails where it is fast or bends, delineators, power lines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import shapely

from scenes_xml.generators.geometry.mesh import Mesh, merge
from scenes_xml.generators.roads.motorway import rail, rail_posts
from scenes_xml.generators.roadside import furniture, rural

from ..model import Array
from .room import disc
from .sides import STEP, Side
from .site import Site, Stand

_RAIL = 0.75
"""Distance of a guardrail's back from the edge of the carriageway [m]."""
_SHORTEST, _TERMINAL = 24.0, 8.0
"""Least length of a guardrail, and length over which its ends go down to the ground [m]."""
_BEND, _FAST = 1.0 / 300.0, 22.0
"""Guardrails of the country stand outside of sharper bends [1/m] where more is allowed than this [m/s]."""
_POST, _POST_AWAY = 50.0, (0.5, 1.4)
"""Distance of delineators from each other, and from the carriageway without and behind a guardrail [m]."""
_SPAN, _POLE_AWAY = 40.0, 5.5


class Line:
    """A line on the ground as a curve to sweep along: points at arc length, to the left, above."""

    def __init__(self, points: Array) -> None:
        self.points = points
        self.s = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))]
        self._yaw = np.unwrap(np.arctan2(*np.gradient(points[:, :2], axis=0).T[::-1]))

    def heading(self, s: npt.ArrayLike) -> Array:
        """Return the direction at `s` [rad]."""
        return np.interp(np.asarray(s, dtype=np.float64), self.s, self._yaw)

    def point(self, s: npt.ArrayLike, t: npt.ArrayLike = 0.0, h: npt.ArrayLike = 0.0) -> Array:
        """Return points (..., 3) at `s`, `t` to the left, `h` above [m]; within `_TERMINAL` of an end lower."""
        place, left, up = np.broadcast_arrays(np.asarray(s, float), np.asarray(t, float), np.asarray(h, float))
        yaw = self.heading(place)
        base = np.stack([np.interp(place, self.s, self.points[:, k]) for k in range(3)], -1)
        sunk = 0.72 * (1.0 - np.clip(np.minimum(place, self.s[-1] - place) / _TERMINAL, 0.0, 1.0)) ** 1.5
        return base + np.stack([-left * np.sin(yaw), left * np.cos(yaw), up - sunk], -1)


def add_rails(site: Site) -> None:
    """Add guardrails along motorways, and outside of the bends of fast roads of the country."""
    for side in site.sides:
        fast = side.speed is None or side.speed >= _FAST
        if side.character == "town" or not (side.character == "motorway" or fast):
            continue
        wanted = np.ones(len(side.s), dtype=bool) if side.character == "motorway" else _outside_of_bend(side)
        wanted &= ~np.array([site.is_dense(side, k) for k in range(len(side.s))])
        line = side.kerb[:, :2] + _RAIL * side.out
        free = [
            bool(side.is_open[k]) and wanted[k] and site.room.is_free(disc(line[k], 0.4)) for k in range(len(side.s))
        ]
        for low, high in _runs(np.array(free)):
            if (high - low) * STEP < _SHORTEST:
                continue
            curve = Line(site.on_ground(line[low:high]))
            s = np.union1d(np.arange(0.0, curve.s[-1], 2.0), curve.s[-1])
            posts = np.arange(1.0, curve.s[-1], 4.0)
            site.rows["GuardRail", "galvanized_steel"] += [
                rail(curve, s, 0.0, -side.sign),  # type: ignore[arg-type]  # swept as a road is
                rail_posts(curve, posts, 0.0, -side.sign),  # type: ignore[arg-type]
            ]
            site.room.take(shapely.buffer(shapely.LineString(line[low:high]), 0.4, cap_style="flat"))


def _outside_of_bend(side: Side) -> npt.NDArray[np.bool_]:
    """Return where a side lies outside of a sharp bend, with 15 m before and behind."""
    if len(side.s) < 30:
        return np.zeros(len(side.s), dtype=bool)
    yaw = np.unwrap(np.arctan2(side.out[:, 1], side.out[:, 0]))
    turn = np.convolve(np.gradient(yaw, STEP), np.ones(5) / 5.0, "same")
    sharp = -side.sign * turn > _BEND
    return np.convolve(sharp, np.ones(31), "same") > 0.5


def _runs(mask: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """Return the spans of a mask that are true."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(int), 0]))
    yield from ((int(low), int(high)) for low, high in edges.reshape(-1, 2))


def add_delineators(site: Site) -> None:
    """Add delineator posts along the roads of the country and motorways, every 50 m."""
    bsdfs = {"post": "white_plastic", "band": "black_plastic", "reflector": "reflector"}
    for side in site.sides:
        if side.character == "town":
            continue
        for way in np.arange(0.5 * _POST, side.length, _POST):
            place = side.at(way)
            feet = (side.kerb[place, :2] + away * side.out[place] for away in _POST_AWAY)
            foot = next((one for one in feet if site.room.is_free(disc(one, 0.1))), None)
            if foot is None or site.is_dense(side, place) or not side.is_open[place]:
                continue
            site.room.take(disc(foot, 0.1))
            yaw = np.arctan2(*side.along(place)[::-1]) + (0.0 if side.runs_forward else np.pi)
            site.put(
                "delineator",
                lambda: site.kit.prefab("beside_delineator", furniture.delineator(), bsdfs),
                "Pole",
                Stand(site.on_ground(foot), float(yaw)),
            )


def add_power_lines(site: Site) -> None:
    """Add overhead lines along some roads of the country."""
    bsdfs = {"pole": "timber_grey", "arm": "timber_grey", "insulators": "white_plastic"}
    done: set[str] = set()
    for number, side in enumerate(site.sides):
        if side.character != "country" or side.road in done or side.length < 3 * _SPAN:
            continue
        if site.generator(4, number).uniform() < 0.5:
            continue
        done.add(side.road)
        run: list[tuple[Array, float]] = []
        for way in np.arange(0.25 * _SPAN, side.length, _SPAN):
            place = side.at(way)
            foot = side.front[place, :2] + _POLE_AWAY * side.out[place]
            ahead = float(np.arctan2(*side.along(place)[::-1]))
            is_free = bool(side.is_open[place]) and site.room.taken(disc(foot, 0.3))
            if is_free and run:  # wires pass over no carriageway
                span = shapely.buffer(shapely.LineString([run[-1][0][:2], foot]), 1.2, cap_style="flat")
                if not site.room.is_off_roads(span):
                    _add_wires(site, run)
                    run = []
            if is_free:
                run.append((site.on_ground(foot), ahead))
                site.put(
                    "power_pole",
                    lambda: site.kit.prefab(
                        "beside_power_pole", site.kit.slim(rural.power_pole(), "arm", "pole"), bsdfs
                    ),
                    "Pole",
                    Stand(run[-1][0], ahead),
                )
            else:
                _add_wires(site, run)
                run = []
        _add_wires(site, run)


def _add_wires(site: Site, run: list[tuple[Array, float]]) -> None:
    if len(run) > 1:
        mesh = rural.wires(np.array([foot for foot, _ in run]), np.array([yaw for _, yaw in run]))
        site.rows["Pole", "iron_dark"].append(Mesh(merge([mesh]).vertices, mesh.faces))
