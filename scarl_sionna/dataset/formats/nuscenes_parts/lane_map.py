"""The map expansion of a scene: lanes, drivable area, walkways, parking places and stop lines from its lane network.

References
----------
.. [1] nuScenes map expansion 1.3, as `NuScenesMap` of nuscenes-devkit 1.2 reads it.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from shapely import Geometry, LineString, Polygon

from scarl_sionna.core.errors import ParameterRangeError, ScarlError, ScarlWarning
from scarl_sionna.core.spec import FieldValue
from scarl_sionna.scene.document.find import MAP_SUFFIXES, find_scene, scene_names
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import Lane, LaneNetwork, ParkingPlace

from .tables import token

FOLDER = "expansion"
VERSION = "1.3"
STOP_LINE_DEPTH = 0.5
"""Of the strip that stands for a stop line, along the lane [m]."""
LEAST_ON_ROAD = 0.5
"""Part of the frames in which the vehicle is on the map's lanes, below which a warning tells."""
EMPTY_LAYERS = ("road_segment", "road_block", "ped_crossing", "road_divider", "lane_divider", "traffic_light")
"""Layers that a lane network does not tell."""
_ARC_RADIUS = 10.0  # of arcs of length 0: paths here are straight from point to point
Array = npt.NDArray[np.float64]


def lanes_of(place: FieldValue, name: str) -> LaneNetwork:
    """Return the lane network of the place that a scene was simulated in.

    Parameters
    ----------
    place : str or None
        Name of a scene or path of its XML or map file; None: not told. A name that is no scene is that of a file
        without its end, as manifests have it: it is looked for in the working folder.
    name : str
        Of the scene in the dataset, for messages.

    Raises
    ------
    ParameterRangeError
        If the place is not found here or has no lanes.
    """
    remedy = "give it by lane_maps=<name, XML or map file>, convert in its folder, or leave the scene or the maps out"
    allowed = "a place that is there and has lanes"
    if not isinstance(place, str):
        raise ParameterRangeError("lane_maps", f"scene '{name}', which does not say its place", allowed, remedy)
    try:
        lanes = read_document(find_scene(_with_ending(place))).lanes
    except ScarlError as error:
        raise ParameterRangeError("lane_maps", f"scene '{name}' in '{place}': {error}", allowed, remedy) from error
    if lanes is None:
        raise ParameterRangeError("lane_maps", f"scene '{name}' in '{place}', which has no lanes", allowed, remedy)
    return lanes


def _with_ending(place: str) -> str:
    """Return a name or path of a scene; of a file in the working folder with its end."""
    endings = () if place in scene_names() else (*MAP_SUFFIXES, ".xml")
    return next((place + ending for ending in endings if Path(place + ending).is_file()), place)


def write_lane_map(path: Path, lanes: LaneNetwork, driven: Array, origin: Array, canvas: tuple[float, float]) -> None:
    """Write a lane network as a map expansion.

    Parameters
    ----------
    path : Path
    lanes : LaneNetwork
    driven : ndarray, shape (N, 2)
        Where the vehicle with the sensors was [m, world]: if less than half of it is on the drivable area, a warning
        says that the place may be another one.
    origin : ndarray, shape (2,)
        World position of the map's corner [m].
    canvas : (float, float)
        Width and height of the map [m].
    """
    on_road = float(np.mean(shapely.contains_xy(drivable(lanes), driven[:, 0], driven[:, 1])))
    if on_road < LEAST_ON_ROAD:
        text = (
            f"{path.stem}: the vehicle is on the lanes of the map in {on_road:.0%} of its frames: is it of this place?"
        )
        warnings.warn(text, ScarlWarning, stacklevel=2)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(LaneMap(lanes, origin, canvas).tables) + "\n", encoding="utf-8")


class LaneMap:
    """Tables of a map expansion.

    Parameters
    ----------
    lanes : LaneNetwork
    origin : ndarray, shape (2,)
        World position of the map's corner [m].
    canvas : (float, float)
        Width and height of the map [m].
    """

    def __init__(self, lanes: LaneNetwork, origin: Array, canvas: tuple[float, float]) -> None:
        self._origin = np.asarray(origin, np.float64)[:2]
        layers = (
            "polygon",
            "line",
            "node",
            "drivable_area",
            "lane",
            "lane_connector",
            "walkway",
            "stop_line",
            "carpark_area",
        )
        self.tables: dict[str, Any] = {"version": VERSION, "canvas_edge": [float(side) for side in canvas]}
        self.tables["scarl_world_from_map"] = self._origin.tolist()
        self.tables |= {layer: [] for layer in (*layers, *EMPTY_LAYERS)}
        self.tables |= {"arcline_path_3": {}, "connectivity": {}}
        driven = lanes.of_kind("drive")
        self._drivable(lanes)
        for lane in driven:
            self._lane(lanes, lane, {one.name for one in driven})
            self._stop(lane)
        for lane in lanes.of_kind("walk"):
            area = self._polygon(strip(lane), "walkway", lane.name)
            self.tables["walkway"].append({"token": token("walkway", lane.name), "polygon_token": area})
        for number, place in enumerate(lanes.parking):
            area = self._polygon(_rectangle(place), "carpark_area", number)
            record = {"token": token("carpark_area", number), "polygon_token": area}
            self.tables["carpark_area"].append(
                {**record, "orientation": np.radians(place.yaw_deg), "road_block_token": ""}
            )

    def _nodes(self, points: Iterable[Iterable[float]], *names: object) -> list[str]:
        """Add points [m, world] and return their tokens."""
        tokens = []
        for number, (x, y) in enumerate(np.asarray(list(points), np.float64)[:, :2] - self._origin):
            tokens.append(token("node", *names, number))
            self.tables["node"].append({"token": tokens[-1], "x": float(x), "y": float(y)})
        return tokens

    def _polygon(self, area: Polygon, *names: object) -> str:
        identity = token("polygon", *names)
        holes = [
            {"node_tokens": self._nodes(ring.coords[:-1], *names, "hole", number)}
            for number, ring in enumerate(area.interiors)
        ]
        outside = self._nodes(area.exterior.coords[:-1], *names)
        self.tables["polygon"].append({"token": identity, "exterior_node_tokens": outside, "holes": holes})
        return identity

    def _line(self, points: Array, *names: object) -> str:
        identity = token("line", *names)
        self.tables["line"].append({"token": identity, "node_tokens": self._nodes(points, *names)})
        return identity

    def _drivable(self, lanes: LaneNetwork) -> None:
        areas = [part for part in shapely.get_parts(drivable(lanes)) if isinstance(part, Polygon) and not part.is_empty]
        tokens = [self._polygon(part, "drivable_area", number) for number, part in enumerate(areas)]
        if tokens:
            self.tables["drivable_area"].append({"token": token("drivable_area"), "polygon_tokens": tokens})

    def _lane(self, lanes: LaneNetwork, lane: Lane, driven: set[str]) -> None:
        identity = token("lane", lane.name)
        ends = [_across(lane, at_end) for at_end in (False, True)]
        self.tables["lane"].append(
            {
                "token": identity,
                "polygon_token": self._polygon(strip(lane), "lane", lane.name),
                "lane_type": "CAR",
                "from_edge_line_token": self._line(ends[0], "from", lane.name),
                "to_edge_line_token": self._line(ends[1], "to", lane.name),
                "left_lane_divider_segments": [],
                "right_lane_divider_segments": [],
                "scarl_name": lane.name,
                "scarl_speed": float(lane.speed),
                "scarl_width": float(lane.width),
            }
        )
        before = [token("lane", one.name) for one in lanes.before(lane.name) if one.name in driven]
        after = [token("lane", name) for name in lane.next if name in driven]
        self.tables["connectivity"][identity] = {"incoming": before, "outgoing": after}
        self.tables["arcline_path_3"][identity] = _straight_paths(lane.points[:, :2] - self._origin)

    def _stop(self, lane: Lane) -> None:
        """Add the stop line at the end of a lane with a signal, or that gives way."""
        kind = "TRAFFIC_LIGHT" if lane.signal is not None else "YIELD" if lane.yield_to else None
        if kind is None:
            return
        ahead = lane.points[-1, :2] - lane.points[-2, :2]
        line = _across(lane, at_end=True)
        back = line - STOP_LINE_DEPTH * ahead / np.linalg.norm(ahead)
        area = self._polygon(Polygon([line[0], line[1], back[1], back[0]]), "stop_line", lane.name)
        record = {"token": token("stop_line", lane.name), "polygon_token": area, "stop_line_type": kind}
        empty: dict[str, Any] = {"ped_crossing_tokens": [], "traffic_light_tokens": [], "road_block_token": ""}
        self.tables["stop_line"].append({**record, **empty})


def drivable(lanes: LaneNetwork) -> Geometry:
    """Return the area of all lanes for vehicles and of the parking places together [m, world]."""
    return shapely.union_all([*map(strip, lanes.of_kind("drive", "cycle", "parking")), *map(_rectangle, lanes.parking)])


def strip(lane: Lane) -> Polygon:
    """Return the area of a lane: its centre line, half of its width to both sides [m, world]."""
    area = LineString(lane.points[:, :2]).buffer(lane.width / 2.0, cap_style="flat", join_style="mitre")
    parts = shapely.get_parts(area)
    return parts[int(np.argmax(shapely.area(parts)))]


def _across(lane: Lane, at_end: bool) -> Array:
    """Return the left and right end of a line across the begin or the end of a lane, shape (2, 2) [m, world]."""
    first, second = (lane.points[-2, :2], lane.points[-1, :2]) if at_end else (lane.points[0, :2], lane.points[1, :2])
    ahead = (second - first) / np.linalg.norm(second - first)
    left = np.array([-ahead[1], ahead[0]]) * lane.width / 2.0
    place = second if at_end else first
    return np.stack([place + left, place - left])


def _rectangle(place: ParkingPlace) -> Polygon:
    yaw = np.radians(place.yaw_deg)
    ahead = np.array([np.cos(yaw), np.sin(yaw)])
    left = np.array([-ahead[1], ahead[0]])
    half = (place.length / 2.0 * ahead, place.width / 2.0 * left)
    middle = np.asarray(place.position)[:2]
    return Polygon(
        [middle + along * half[0] + across * half[1] for along, across in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    )


def _straight_paths(points: Array) -> list[dict[str, Any]]:
    """Return a centre line (N, 2) as the reader's paths of arc, straight line, arc, whose arcs have no length."""
    paths = []
    for start, end in pairwise(points):
        step = end - start
        length = float(np.linalg.norm(step))
        if length < 1e-6:
            continue
        yaw = float(np.arctan2(step[1], step[0]))
        paths.append(
            {
                "start_pose": [*start.tolist(), yaw],
                "end_pose": [*end.tolist(), yaw],
                "shape": "LSR",
                "radius": _ARC_RADIUS,
                "segment_length": [0.0, length, 0.0],
            }
        )
    return paths
