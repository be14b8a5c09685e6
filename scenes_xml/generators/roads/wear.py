"""What years leave in a carriageway: patches, covers of manholes, and the rails of a tram, all flush with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry import polygon
from ..geometry.mesh import Array, Mesh, grid, merge
from ..kit import SceneKit
from ..roadside.garden import manhole_cover
from .road import RoadCurve

RAISED = {"patch": 0.002, "cover": 0.006, "rail": 0.008}
"""Heights above the lane [m]: below and above its marks, which are painted over patches."""
GAUGE, HEAD = 1.435, 0.06
"""Distance between the inner edges of rails, and width of the head of a rail [m]."""
COVERS = 38.0
"""Mean way from one cover to the next along a lane [m]."""
PATCHES = {"town": 45.0, "country": 110.0, "motorway": 260.0}
"""Mean way from one patch to the next along a lane [m]."""
TILE = 4.0
"""Size of a tile of the patches' texture [m]."""


@dataclass(frozen=True, eq=False)
class LaneSurface:
    """The surface of a lane as it is meshed: its borders at stations, and straight lines between.

    Attributes
    ----------
    s : ndarray of float64, shape (n,)
        Stations [m].
    inner, outer : ndarray of float64, shape (n, 3)
        Its borders there [m, world].
    """

    s: Array
    inner: Array
    outer: Array

    @classmethod
    def along(cls, curve: RoadCurve, s: Array, middle: float, width: float) -> LaneSurface:
        """Return the surface of a lane along a curve at the stations of its mesh, by the offset of its middle [m]."""
        inner, outer = (curve.point(s, middle + side * 0.5 * width) for side in (-1.0, 1.0))
        return cls(s, inner, outer)

    @classmethod
    def level(cls, line: Array, width: float) -> LaneSurface:
        """Return the surface of a level lane along its middle line, shape (n, 2 or 3) [m]."""
        line = np.asarray(line, float)
        height = line[:, 2] if line.shape[1] > 2 else np.zeros(len(line))
        edges = [np.column_stack([polygon.shifted(line[:, :2], side * 0.5 * width), height]) for side in (-1.0, 1.0)]
        return cls(polygon.length_along(line[:, :2]), *edges)

    @property
    def width(self) -> Array:
        """Return its width at the stations [m]."""
        return np.asarray(np.linalg.norm((self.outer - self.inner)[:, :2], axis=1))

    @property
    def length(self) -> float:
        """Return its length [m]."""
        return float(self.s[-1] - self.s[0])

    def at(self, s: Array, share: Array) -> Array:
        """Return points at stations and shares of the width from the inner border, shape (n, 3)."""
        inner, outer = (_along(s, self.s, line) for line in (self.inner, self.outer))
        return inner + share[:, None] * (outer - inner)

    def strip(self, shares: Sequence[Array], span: tuple[float, float], raised: float) -> Mesh:
        """Return a strip between two lines, each by its share of the width at all stations."""
        low, high = span
        own = np.r_[low, self.s[(self.s > low + 1e-6) & (self.s < high - 1e-6)], high]
        lines = [self.inner + share[:, None] * (self.outer - self.inner) for share in shares]
        points = np.stack([_along(own, self.s, line) for line in lines], 1) + [0.0, 0.0, raised]
        return _upwards(grid(points, points[..., :2] / TILE))

    def rails(self) -> list[Mesh]:
        """Return both rails along the middle of the lane."""
        width = np.maximum(self.width, 1e-3)
        span = float(self.s[0]), float(self.s[-1])
        found = []
        for side in (-1.0, 1.0):
            edges = [0.5 + side * (0.5 * GAUGE + away) / width for away in (0.0, HEAD)]
            found.append(self.strip([np.minimum(*edges), np.maximum(*edges)], span, RAISED["rail"]))
        return found

    def covers(
        self, generator: np.random.Generator, is_ground: Callable[[float], bool] = lambda s: True
    ) -> Iterator[Mesh]:
        """Return covers of manholes, where a station is on the ground."""
        cover = manhole_cover(height=RAISED["cover"])
        for s in np.arange(self.s[0] + generator.uniform(0.0, COVERS), self.s[-1] - 1.0, COVERS):
            place = float(s + generator.uniform(-6.0, 6.0))
            middle = float(generator.choice((0.35, 0.5, 0.65)))
            width = float(np.interp(place, self.s, self.width))
            if is_ground(place) and width > 2.0 and self.s[0] + 1.0 < place < self.s[-1] - 1.0:
                points = self.at(place + cover.vertices[:, 0], middle + cover.vertices[:, 1] / width)
                yield _upwards(Mesh(points + [0.0, 0.0, 1.0] * cover.vertices, cover.faces, cover.uv))

    def patches(self, away: float, generator: np.random.Generator) -> Iterator[Mesh]:
        """Return patches where the surface was mended, and trenches across for pipes, `away` [m] from each other."""
        for _ in range(generator.poisson(self.length / away)):
            is_trench = generator.uniform() < 0.35
            long = generator.uniform(0.5, 0.9) if is_trench else generator.uniform(1.0, 5.0)
            wide = 0.94 if is_trench else generator.uniform(0.25, 0.6)
            start, share = generator.uniform(size=2)
            if self.length > long + 2.0 and self.width.min() > 2.0:
                low = self.s[0] + 1.0 + start * (self.length - long - 2.0)
                first = 0.03 + share * (0.94 - wide)
                shares = [np.full(len(self.s), value) for value in (first, first + wide)]
                yield self.strip(shares, (float(low), float(low + long)), RAISED["patch"])


def _along(s: Array, own: Array, line: Array) -> Array:
    """Return points of a line, known at stations of its own, at stations `s`, shape (n, 3)."""
    return np.column_stack([np.interp(s, own, line[:, k]) for k in range(3)])


def _upwards(mesh: Mesh) -> Mesh:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return mesh if np.cross(b - a, c - a)[:, 2].sum() >= 0.0 else mesh.flipped()


def add_wear(
    kit: SceneKit, lanes: Sequence[LaneSurface], generator: np.random.Generator, kind: str, with_covers: bool = False
) -> None:
    """Add patches, and covers of manholes unless the level is light, to lanes of a place.

    `kind` is a key of `PATCHES`.
    """
    patches = [mesh for lane in lanes for mesh in lane.patches(PATCHES[kind], generator)]
    covers = [mesh for lane in lanes for mesh in lane.covers(generator)] if with_covers else []
    if patches:
        kit.add("patches_road", merge(patches), "asphalt_dark")
        kit.instance("road_patches", "Roads", ["patches_road"])
    if covers and not kit.is_light:
        kit.add("covers_road", merge(covers), "manhole")
        kit.instance("road_covers", "Roads", ["covers_road"])


def add_rails(kit: SceneKit, lanes: Sequence[LaneSurface]) -> None:
    """Add the rails of a tram in the middle of lanes."""
    kit.add("rails_tram", merge([rail for lane in lanes for rail in lane.rails()]), "grey_steel")
    kit.instance("tram_rails", "RailTrack", ["rails_tram"])
