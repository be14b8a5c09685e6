"""A map expansion in the schema that nuScenes publishes (1.3), made of a few roads whose geometry is known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

RADIUS = 10.0
Point = tuple[float, float]


class MapFile:
    """Tables that grow record by record; tokens are those given."""

    def __init__(self) -> None:
        layers = (
            "polygon", "line", "node", "drivable_area", "road_segment", "road_block", "lane", "ped_crossing", "walkway",
            "stop_line", "carpark_area", "road_divider", "lane_divider", "traffic_light", "lane_connector",
        )  # fmt: skip # a table
        self.tables: dict[str, Any] = {"version": "1.3", "canvas_edge": [400.0, 300.0]} | {one: [] for one in layers}
        self.tables |= {"arcline_path_3": {}, "connectivity": {}}

    def nodes(self, token: str, points: list[Point]) -> list[str]:
        names = [f"{token}.{number}" for number in range(len(points))]
        self.tables["node"] += [{"token": n, "x": x, "y": y} for n, (x, y) in zip(names, points, strict=True)]
        return names

    def polygon(self, token: str, points: list[Point], holes: tuple[list[Point], ...] = ()) -> str:
        self.tables["polygon"].append({
            "token": f"p-{token}",
            "exterior_node_tokens": self.nodes(f"p-{token}", points),
            "holes": [{"node_tokens": self.nodes(f"h-{token}-{k}", hole)} for k, hole in enumerate(holes)],
        })  # fmt: skip # a record
        return f"p-{token}"

    def area(self, layer: str, token: str, points: list[Point], **more: Any) -> None:
        self.tables[layer].append({"token": token, "polygon_token": self.polygon(token, points), **more})

    def way(self, token: str, start: tuple[float, float, float], shape: str, lengths: list[float], **more: Any) -> None:
        """Add a lane, or a connector where it has a dash in its token, of one path and a strip of 3.5 m as polygon."""
        end = along(start, shape, lengths, sum(lengths))
        path = {"start_pose": list(start), "end_pose": end.tolist(), "shape": shape, "radius": RADIUS}
        self.tables["arcline_path_3"][token] = [{**path, "segment_length": lengths}]
        self.tables["connectivity"][token] = {"incoming": [], "outgoing": more.pop("to", [])}
        places = [along(start, shape, lengths, s) for s in np.linspace(0.0, sum(lengths), 41)]
        sides = [[(float(x - t * np.sin(h)), float(y + t * np.cos(h))) for x, y, h in places] for t in (1.75, -1.75)]
        row = {"token": token, "polygon_token": self.polygon(token, sides[0] + sides[1][::-1])}
        edges = {"from_edge_line_token": "", "to_edge_line_token": ""}
        dividers = {"left_lane_divider_segments": [], "right_lane_divider_segments": []}
        if "-" in token:
            self.tables["lane_connector"].append(row)
        else:
            self.tables["lane"].append({**row, "lane_type": "CAR", **edges, **dividers, **more})

    def divider(self, layer: str, token: str, points: list[Point], kinds: list[str] | None = None) -> None:
        names = self.nodes(f"l-{token}", points)
        self.tables["line"].append({"token": f"l-{token}", "node_tokens": names})
        row: dict[str, Any] = {"token": token, "line_token": f"l-{token}"}
        if kinds is not None:
            row["lane_divider_segments"] = [
                {"node_token": name, "segment_type": kind} for name, kind in zip(names, kinds, strict=True)
            ]
        else:
            row["road_segment_token"] = None
        self.tables[layer].append(row)


def along(start: tuple[float, float, float], shape: str, lengths: list[float], way: float) -> np.ndarray:
    """Return the pose at a way along arc, line and arc of `RADIUS`, by complex numbers."""
    place, heading = complex(start[0], start[1]), start[2]
    for letter, length in zip(shape, lengths, strict=True):
        own = min(way, length)
        way -= own
        bend = {"L": 1.0, "S": 0.0, "R": -1.0}[letter] / RADIUS
        turn = bend * own
        step = own if bend == 0.0 else (np.exp(1j * turn) - 1.0) / (1j * bend)
        place, heading = place + step * np.exp(1j * heading), heading + turn
    return np.array([place.real, place.imag, heading])


def crossing(folder: Path, name: str = "boston-seaport") -> Path:
    """Write a crossing of a street from west to east and one from south to north, and return the file.

    From `a` ahead to `b` or to the right into `c`; from `n` ahead to `m`, giving way; `s` is a swerve by itself.
    """
    made, quarter = MapFile(), 0.5 * np.pi * RADIUS
    made.way("a", (100.0, 98.0, 0.0), "LSR", [0.0, 80.0, 0.0], to=["a-b", "a-c"])
    made.way("a-b", (180.0, 98.0, 0.0), "LSR", [0.0, 40.0, 0.0], to=["b"])
    made.way("a-c", (180.0, 98.0, 0.0), "RSR", [quarter, 0.0, 0.0], to=["c"])
    made.way("b", (220.0, 98.0, 0.0), "LSR", [0.0, 80.0, 0.0], to=["nowhere"])
    made.way("c", (190.0, 88.0, -0.5 * np.pi), "LSR", [0.0, 60.0, 0.0])
    made.way("n", (205.0, 30.0, 0.5 * np.pi), "LSR", [0.0, 58.0, 0.0], to=["n-m"])
    made.way("n-m", (205.0, 88.0, 0.5 * np.pi), "LSR", [0.0, 24.0, 0.0], to=["m"])
    made.way("m", (205.0, 112.0, 0.5 * np.pi), "LSR", [0.0, 60.0, 0.0])
    made.way("s", (100.0, 130.0, 0.1), "LSR", [6.0, 20.0, 8.0], lane_type="CAR")
    street = [(100.0, 94.0), (300.0, 94.0), (300.0, 106.0), (100.0, 106.0)]
    across = [(186.0, 28.0), (210.0, 28.0), (210.0, 172.0), (186.0, 172.0)]
    island = [(240.0, 101.0), (250.0, 101.0), (250.0, 104.0), (240.0, 104.0)]
    tokens = [made.polygon("street", street, (island,)), made.polygon("across", across), None]
    made.tables["drivable_area"].append({"token": "drivable", "polygon_tokens": tokens})
    made.tables["polygon"].append({"token": None, "exterior_node_tokens": [], "holes": []})
    made.area("walkway", "walk", [(100.0, 90.0), (178.0, 90.0), (178.0, 94.0), (100.0, 94.0)])
    made.area("carpark_area", "park", [(110.0, 106.0), (120.0, 106.0), (120.0, 111.0), (110.0, 111.0)], orientation=0.0)
    made.area("ped_crossing", "zebra", [(170.0, 94.0), (174.0, 94.0), (174.0, 106.0), (170.0, 106.0)])
    cues = {"ped_crossing_tokens": [], "traffic_light_tokens": [], "road_block_token": None}
    lines = {"TRAFFIC_LIGHT": (179.0, 96.0, 180.0, 100.0), "STOP_SIGN": (203.0, 87.0, 207.0, 88.0)}
    for number, (kind, (x0, y0, x1, y1)) in enumerate([*lines.items(), ("PED_CROSSING", (168.0, 96.0, 169.0, 100.0))]):
        corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        made.area("stop_line", f"stop{number}", corners, stop_line_type=kind, **cues)
    made.divider("lane_divider", "dashes", [(100.0, 102.0), (140.0, 102.0), (180.0, 102.0)],
                 ["DOUBLE_DASHED_WHITE", "SINGLE_SOLID_WHITE", "NIL"])  # fmt: skip # one call
    made.divider("road_divider", "middle", [(220.0, 100.0), (235.0, 100.0)])
    made.tables["traffic_light"].append({"token": "light", "line_token": "l-middle", "items": []})
    made.tables["road_segment"].append({"token": "segment", "polygon_token": "p-across", "is_intersection": True})
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.json"
    path.write_text(json.dumps(made.tables))
    return path
