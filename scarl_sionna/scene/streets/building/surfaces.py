"""Surfaces of a map's lanes: strips between borders; where roads overlap, in junctions, each place belongs to one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError

from scenes_xml.generators.geometry.mesh import Mesh, grid

from ..geometry.road import RoadShape
from ..model import Array, LaneSection, Road, StreetMap

TILE, TILES = 4.0, {"paving": 1.2, "kerb_stone": 1.0, "setts": 1.5}
"""Size of a texture's tile, and of some materials' [m]; textures lie on the world's x and y, so that surfaces meet
without a seam."""
_OVERLAP = 0.02
"""Thickness of an overlap that counts: neighbours share their border but for chords [m]."""
_LAYER = 1.0
"""Surfaces farther apart in height are above each other and keep their ground plans [m]."""
_WIDE = 5.0
LAP = 1e-3
"""How far a surface that was cut reaches over its neighbours [m], so that no ray slips by."""

Heights = Callable[[Array], Array]
"""Heights (n,) of points of the plane (n, 2) [m]."""
LOOKS: dict[str, tuple[str, str, int]] = {
    "sidewalk": ("paving", "SideWalks", 3),
    "walking": ("paving", "SideWalks", 3),
    "curb": ("kerb_stone", "SideWalks", 3),
    "biking": ("asphalt_plain", "Roads", 2),
    "shoulder": ("asphalt_plain", "Roads", 2),
    "stop": ("asphalt_plain", "Roads", 2),
    "parking": ("asphalt_plain", "Roads", 2),
    "restricted": ("asphalt_plain", "Roads", 2),
    "border": ("gravel_fine", "Ground", 4),
    "median": ("lawn", "Terrain", 4),
    "none": ("lawn", "Terrain", 5),
    "rail": ("gravel_fine", "RailTrack", 2),
    "tram": ("setts", "RailTrack", 1),
}
"""Type of a lane -> material, class and rank: of two surfaces at one place that of the lower rank stays."""
_ROAD = ("asphalt_street", "Roads", 1)


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a lane's surface.

    Attributes
    ----------
    road, lane : str, int
    s : ndarray of float64, shape (n,)
        Stations along the road [m].
    inner, outer : ndarray of float64, shape (n, 3)
        Borders at the stations [m, world].
    material, semantic : str
    rank : int
    height : float
        Largest height above the road [m].
    structure : str
        ``bridge``, ``tunnel`` or empty.
    mesh : Mesh
    footprint : shapely geometry
        The ground plan.
    is_cut : bool
        Whether another surface took a part of it.
    """

    road: str
    lane: int
    s: Array
    inner: Array
    outer: Array
    material: str
    semantic: str
    rank: int
    height: float
    structure: str
    mesh: Mesh
    footprint: shapely.Geometry
    is_cut: bool = False


def lane_pieces(street: StreetMap, shapes: Mapping[str, RoadShape], tolerance: float) -> list[Piece]:
    """Return the surfaces of all lanes, none above another at the same place.

    Parameters
    ----------
    street : StreetMap
    shapes : mapping
        Geometry of each road by its id.
    tolerance : float
        Largest distance of a border's chord from the border [m].
    """
    found = [
        piece
        for road in street.roads.values()
        for section in road.sections
        for span, structure in _spans(road, section, shapes[road.id].stations(section, tolerance))
        for piece in _strips(shapes[road.id], section, span, structure)
    ]
    inside = {road.id for road in street.roads.values() if road.junction in street.junctions}
    found.sort(key=lambda piece: (piece.rank, piece.road in inside))
    return _without_overlaps(found)


def _spans(road: Road, section: LaneSection, stations: Array) -> Iterator[tuple[Array, str]]:
    """Return the stations of a section in spans that are on a bridge, in a tunnel, or neither."""
    cuts = [c for one in road.structures for c in (one.s, one.s + one.length) if section.s < c < section.stop]
    s = np.unique(np.r_[stations, cuts])
    s = s[np.r_[True, np.diff(s) > 1e-6]]
    edges = [section.s, *sorted(cuts), section.stop]
    for low, high in pairwise(edges):
        own = s[(s >= low - 1e-9) & (s <= high + 1e-9)]
        if len(own) < 2:
            continue
        middle = 0.5 * (low + high)
        kinds = [one.kind for one in road.structures if one.s <= middle <= one.s + one.length]
        yield own, next(iter(sorted(kinds)), "")


def _strips(shape: RoadShape, section: LaneSection, s: Array, structure: str) -> Iterator[Piece]:
    for lane in section.lanes.values():
        inner, outer = shape.edges(section, lane.id, s)
        width = np.linalg.norm((outer - inner)[:, :2], axis=1)
        if width.max() < 1e-3:
            continue
        material, semantic, rank = LOOKS.get(lane.kind, _ROAD)
        if lane.kind == "border" and np.median(width) > _WIDE:
            material, semantic = "lawn", "Terrain"
        height = float(lane.heights[:, 1:].max()) if len(lane.heights) else 0.0
        columns = _columns(shape, section, lane.id, s, inner, outer)
        mesh = upwards(grid(columns, columns[..., :2] / TILES.get(material, TILE)))
        ring = np.concatenate([inner, outer[::-1]])[:, :2]
        footprint = shapely.make_valid(shapely.Polygon(ring))
        yield Piece(
            shape.road.id, lane.id, s, inner, outer, material, semantic, rank, height, structure, mesh, footprint
        )


def _columns(shape: RoadShape, section: LaneSection, lane: int, s: Array, inner: Array, outer: Array) -> Array:
    """Return the points of a lane's grid, shape (n, m, 3): its borders, and between them where the road is shaped."""
    if not len(shape.road.shapes):
        return np.stack([inner, outer], 1)
    low, high = shape.borders(section, lane, s)
    count = max(2, int(np.ceil(np.abs(high - low).max() / 0.5)) + 1)
    shares = np.linspace(0.0, 1.0, count)
    points = [shape.point(s, low + share * (high - low)) for share in shares[1:-1]]
    return np.stack([inner, *points, outer], 1)


def upwards(mesh: Mesh) -> Mesh:
    """Return a surface that looks up."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return mesh if np.cross(b - a, c - a)[:, 2].sum() >= 0.0 else mesh.flipped()


def _without_overlaps(pieces: Sequence[Piece]) -> list[Piece]:
    """Return pieces of which each has lost what those before it cover at about its height."""
    tree = shapely.STRtree([piece.footprint for piece in pieces])
    done: list[Piece | None] = []
    for number, piece in enumerate(pieces):
        over = []
        for other in sorted(tree.query(piece.footprint)):
            if other >= number or (first := done[other]) is None:
                continue
            if first.road == piece.road and first.lane * piece.lane > 0 and abs(first.s[0] - piece.s[0]) < 1e-6:
                continue
            common = shapely.intersection(piece.footprint, first.footprint)
            if common.area > _OVERLAP**2 and not shapely.is_empty(shapely.buffer(common, -0.5 * _OVERLAP)):
                place = shapely.get_coordinates(shapely.point_on_surface(common))
                if abs(float((height_of(piece)(place) - height_of(first)(place))[0])) < _LAYER:
                    over.append(first.footprint)
        done.append(_cut(piece, over) if over else piece)
    return [piece for piece in done if piece is not None]


def _cut(piece: Piece, over: Sequence[shapely.Geometry]) -> Piece | None:
    """Return a piece without what others cover; None where nothing is left."""
    rest = shapely.difference(piece.footprint, shapely.union_all(over))
    rest = shapely.union_all([part for part in polygons(rest) if not shapely.buffer(part, -_OVERLAP / 2).is_empty])
    if rest.is_empty:
        return None
    rest = shapely.buffer(rest, LAP, join_style="mitre")
    return replace(
        piece, mesh=sheet(rest, height_of(piece), TILES.get(piece.material, TILE)), footprint=rest, is_cut=True
    )


def polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    """Return the polygons of a geometry; lines and points are left out."""
    return [part for part in shapely.get_parts(geometry) if part.geom_type == "Polygon" and part.area > 1e-8]


def sheet(area: shapely.Geometry, height: Heights, tile: float = TILE) -> Mesh:
    """Return triangles over a ground plan, with heights from a function of points (n, 2)."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    corners = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    plane, index = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    points = np.column_stack([plane, height(plane)])
    mesh = Mesh(points, index.reshape(-1, 3).astype(np.int64), plane / tile)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    down = np.cross(b - a, c - a)[:, 2] < 0.0
    mesh.faces[down] = mesh.faces[down][:, ::-1]
    return mesh


def wall(low: Array, high: Array) -> Mesh:
    """Return the upright surface between two lines (n, 3) above each other."""
    way = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(low[:, :2], axis=0), axis=1))]
    points = np.stack([low, high], 1)
    return grid(points, np.stack([np.stack([way, low[:, 2]], -1), np.stack([way, high[:, 2]], -1)], 1))


class Height:
    """Heights of a surface at points of the plane (n, 2): in its triangles, outside that of the nearest corner."""

    def __init__(self, points: Array) -> None:
        unique, first = np.unique(np.round(points[:, :2], 6), axis=0, return_index=True)
        self._nearest = NearestNDInterpolator(unique, points[first, 2])
        try:
            self._linear = LinearNDInterpolator(unique, points[first, 2])
        except (QhullError, ValueError):  # all on one line
            self._linear = self._nearest

    def __call__(self, places: Array) -> Array:
        """Return heights (n,) [m]."""
        found = np.asarray(self._linear(places), dtype=np.float64)
        out = ~np.isfinite(found)
        if out.any():
            found[out] = self._nearest(places[out])
        return found


def height_of(piece: Piece) -> Height:
    """Return the heights of a piece's strip."""
    return Height(np.concatenate([piece.inner, piece.outer]))
