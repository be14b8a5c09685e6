"""Tables of a map expansion of nuScenes as checked plain data: polygons and lines by token, in metres of the scene.

References
----------
.. [1] nuScenes map expansion 1.3: layers and keys as `NuScenesMap` of nuscenes-devkit 1.2 reads them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from scarl_sionna.core.errors import MapError
from scarl_sionna.core.untrusted.files import read_bytes
from scarl_sionna.core.untrusted.json_text import parse_json

from ..model import Array
from ..source import LARGEST, MOST_BYTES, map_errors

Row = Mapping[str, Any]

LAYERS = (
    "node", "polygon", "line", "drivable_area", "lane", "lane_connector", "ped_crossing", "walkway", "carpark_area",
    "stop_line", "road_divider", "lane_divider",
)  # fmt: skip # a table
"""Layers that are read."""
SIGNS: Mapping[str, tuple[int, int, int]] = {
    "LSL": (1, 0, 1), "LSR": (1, 0, -1), "RSL": (-1, 0, 1), "RSR": (-1, 0, -1), "LRL": (1, -1, 1), "RLR": (-1, 1, -1),
}  # fmt: skip # a table
"""Curvature of the three parts of a path over that of its radius, by the path's shape: left, right, straight."""
SHIFT = "scarl_world_from_map"
"""Key of what is added to positions in a map that this package wrote [m]: its scenes have coordinates of their own."""
_REMEDY = "give the map expansion 1.3 of nuScenes, as maps/expansion/boston-seaport.json"


class Expansion:
    """A map expansion.

    Parameters
    ----------
    path : Path

    Raises
    ------
    MapError
        If the file cannot be read or is no map expansion 1.3, or a record lacks something; names layer and token.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with map_errors(path, _REMEDY):
            data = read_bytes(path, MOST_BYTES)
        try:
            tables = parse_json(data)
        except ValueError as error:
            raise MapError(f"is no JSON ({error})", path, _REMEDY) from error
        if not isinstance(tables, dict) or not isinstance(tables.get("node"), list):
            raise MapError("is no map expansion: it has no layer 'node'", path, _REMEDY)
        for layer, kind in (*((one, list) for one in LAYERS), ("arcline_path_3", dict), ("connectivity", dict)):
            if not isinstance(tables.get(layer), kind):
                version = str(tables.get("version", "without a version"))[:20]
                raise MapError(f"has no layer '{layer}' (version {version})", path, _REMEDY)
        self._tables = tables
        shift = tables.get(SHIFT, [0.0, 0.0])
        self._shift = np.array(self._numbers({"token": SHIFT, SHIFT: shift}, "map", SHIFT, 2))
        self._nodes = {
            row["token"]: (self._number(row, "node", "x"), self._number(row, "node", "y")) for row in self.rows("node")
        }
        self._polygons = {
            row["token"]: row for row in self._tables["polygon"] if isinstance(row, dict) and row.get("token")
        }
        self._lines = {row["token"]: row for row in self.rows("line")}

    def has(self, layer: str) -> bool:
        """Return whether a layer is there and holds something."""
        return bool(self._tables.get(layer))

    def rows(self, layer: str) -> Iterator[Row]:
        """Yield the records of a layer."""
        for row in self._tables[layer]:
            if not isinstance(row, dict) or not isinstance(row.get("token"), str):
                raise MapError(f"{layer}: {row!r:.60} is no record with a token", self.path, _REMEDY)
            yield row

    def outline(self, row: Row, layer: str) -> shapely.Geometry:
        """Return the area of a record, of one or more polygons; empty where it names none."""
        tokens = row["polygon_tokens"] if "polygon_tokens" in row else [row.get("polygon_token")]
        if not isinstance(tokens, list):
            raise self.fault(row, layer, "polygon_tokens is no list")
        parts = [self._polygon(row, layer, token) for token in tokens if token]  # maps of Singapore hold nulls
        return parts[0] if len(parts) == 1 else shapely.union_all(parts)

    def _polygon(self, row: Row, layer: str, token: object) -> shapely.Geometry:
        found = self._polygons.get(str(token))
        if found is None:
            raise self.fault(row, layer, f"polygon '{str(token)[:40]}' is not there")
        holes = found.get("holes") or []
        if not isinstance(holes, list) or not all(isinstance(one, dict) for one in holes):
            raise self.fault(found, "polygon", "holes is no list of holes")
        rings = [self._points(found, "polygon", found.get("exterior_node_tokens"))]
        rings += [self._points(found, "polygon", one.get("node_tokens")) for one in holes]
        rings = [ring for ring in rings if len(ring) > 2]
        return shapely.make_valid(shapely.Polygon(rings[0], rings[1:])) if rings else shapely.Polygon()

    def line(self, row: Row, layer: str) -> tuple[list[str], Array]:
        """Return the tokens of the nodes of a record's line, and the points, shape (n, 2) [m]."""
        token = str(row.get("line_token"))
        if token not in self._lines:
            raise self.fault(row, layer, f"line '{token[:40]}' is not there")
        names = self._lines[token].get("node_tokens")
        points = self._points(self._lines[token], "line", names)
        return [str(name) for name in names], points  # type: ignore[union-attr]  # checked with the points

    def links(self, token: str) -> list[str]:
        """Return the lanes and connectors that continue one."""
        row = self._tables["connectivity"].get(token, {})
        found = row.get("outgoing", []) if isinstance(row, dict) else None
        if not isinstance(found, list) or not all(isinstance(one, str) for one in found):
            raise MapError(f"connectivity of '{token[:40]}' has no list 'outgoing'", self.path, _REMEDY)
        return found

    def parts(self, token: str) -> list[tuple[float, float, float, float, float]]:
        """Return the centre line of a lane as straight lines and arcs: x, y, heading, length, curvature of each."""
        paths = self._tables["arcline_path_3"].get(token, [])
        if not isinstance(paths, list):
            raise MapError(f"arcline_path_3 of '{token[:40]}' is no list", self.path, _REMEDY)
        found = []
        for path in paths:
            row = {**path, "token": token} if isinstance(path, dict) else {"token": token}
            x, y, heading = self._numbers(row, "arcline_path_3", "start_pose", 3)
            lengths = self._numbers(row, "arcline_path_3", "segment_length", 3)
            radius = self._number(row, "arcline_path_3", "radius")
            if row.get("shape") not in SIGNS or radius <= 0.0 or min(lengths) < 0.0:
                raise self.fault(row, "arcline_path_3", f"shape = {row.get('shape')!r:.20}, radius {radius:g}: no path")
            x, y = x + float(self._shift[0]), y + float(self._shift[1])
            for length, sign in zip(lengths, SIGNS[row["shape"]], strict=True):
                found.append((x, y, heading, length, sign / radius))
                x, y, heading = _on(x, y, heading, length, sign / radius)
        return [one for one in found if one[3] > 0.0]

    def fault(self, row: Row, layer: str, message: str) -> MapError:
        """Return the error for a record, to be raised."""
        return MapError(f"{layer} '{str(row.get('token'))[:40]}': {message}", self.path)

    def _points(self, row: Row, layer: str, tokens: object) -> Array:
        if not isinstance(tokens, list):
            raise self.fault(row, layer, "names no nodes")
        missing = next((one for one in tokens if not isinstance(one, str) or one not in self._nodes), None)
        if missing is not None:
            raise self.fault(row, layer, f"node '{str(missing)[:40]}' is not there")
        return np.array([self._nodes[one] for one in tokens]).reshape(-1, 2) + self._shift

    def _number(self, row: Row, layer: str, key: str) -> float:
        return self._numbers({"token": row.get("token"), key: [row.get(key)]}, layer, key, 1)[0]

    def _numbers(self, row: Row, layer: str, key: str, count: int) -> list[float]:
        value = row.get(key)
        fine = isinstance(value, list) and len(value) == count
        if not fine or not all(_is_number(one) for one in value):  # type: ignore[union-attr]
            raise self.fault(row, layer, f"{key} = {value!r:.60} is not {count} finite numbers up to {LARGEST:g}")
        return [float(one) for one in value]  # type: ignore[union-attr]


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def _on(x: float, y: float, heading: float, length: float, curvature: float) -> tuple[float, float, float]:
    """Return the pose at the end of an arc or a straight line."""
    turn = curvature * length
    if abs(turn) < 1e-12:
        return x + length * math.cos(heading), y + length * math.sin(heading), heading
    return (
        x + (math.sin(heading + turn) - math.sin(heading)) / curvature,
        y - (math.cos(heading + turn) - math.cos(heading)) / curvature,
        heading + turn,
    )
