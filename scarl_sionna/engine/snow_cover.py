"""Where snow lies: on static shapes that are flat or roofs, and open to the sky."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.semantics import semantic_id
from scarl_sionna.core.specs.weather import Weather
from scarl_sionna.scene.tables import PartTable
from scenes_xml.generators.geometry.mesh import Mesh
from scenes_xml.generators.roads.ground import Ground

from .twins import MeshData

Array = npt.NDArray[np.float64]

STEEPEST = 0.35
"""Faces whose unit normal has less along z keep no snow: steeper than 70 deg."""
_FLAT, _OPEN = 0.85, 0.3
"""Least share of a shape's area that is not steeper, and of that what has nothing above it (half of a roof is its
underside)."""
_SAMPLES = 96
_LIFT = 0.05
SKY = 300.0
"""What is higher above a place does not shelter it [m]."""
_CLEARED = ("Roads", "RoadLine", "RailTrack")
_NEVER = ("Water", "Vegetation")
_THINGS = ("Static", "Other")
_FLUSH, _CORNERS = 0.03, 48
"""What is nowhere higher above or below a cleared road than this [m], at so many of its corners, is cleared with it."""


def snow_covered(
    parts: PartTable, meshes: Mapping[str, MeshData], blocked: Callable[[Array], int], weather: Weather
) -> tuple[str, ...]:
    """Return the ids of the shapes that snow covers in a weather.

    A shape is covered as a whole or not at all: where at least 85 % of its area is not steeper than 70 deg, and 30 % of
    that has nothing above it within 300 m. So are ground, pavements, roofs and decks; walls, trees, vehicles, and what
    lies in tunnels and garages are not. Where roads are cleared, so is what lies flush in them, as covers of manholes.

    Parameters
    ----------
    parts : PartTable
    meshes : mapping
        Of static parts in the world frame, by name.
    blocked : callable
        How many of points (n, 3) [m] have something above them within `SKY` metres.
    weather : Weather
        Its `lying_snow` says whether roads are cleared.
    """
    left = {*_NEVER, *(_CLEARED if weather.lying_snow == "beside_roads" else ())}
    static = (parts.actor < 0) & ~np.isin(parts.semantic, [semantic_id(name) for name in left])
    found = [int(part) for part in np.flatnonzero(static) if _is_covered(meshes[parts.name[part]], blocked)]
    cleared = _flush(parts, meshes, found) if weather.lying_snow == "beside_roads" else set()
    return tuple(parts.name[part] for part in found if part not in cleared)


def _flush(parts: PartTable, meshes: Mapping[str, MeshData], among: Sequence[int]) -> set[int]:
    """Return the parts that lie flush in a cleared road, as covers of manholes and grates of gullies do."""
    things, cleared = ([semantic_id(name) for name in names] for names in (_THINGS, _CLEARED))
    asked = [part for part in among if parts.semantic[part] in things]
    if not asked:
        return set()
    roads = Ground()
    for road in np.flatnonzero((parts.actor < 0) & np.isin(parts.semantic, cleared)).tolist():
        mesh = meshes[parts.name[road]]
        roads.add(Mesh(mesh.vertices, mesh.faces))
    found = set()
    for part in asked if roads.corners else []:
        corners = meshes[parts.name[part]].vertices
        chosen = corners[:: max(1, len(corners) // _CORNERS)]
        if np.abs(chosen[:, 2] - roads.height(chosen, -np.inf)).max() < _FLUSH:
            found.add(part)
    return found


def _is_covered(mesh: MeshData, blocked: Callable[[Array], int]) -> bool:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    flat = np.abs(normal[:, 2]) >= STEEPEST * area
    total = float(area.sum())
    if total <= 0.0 or float(area[flat].sum()) < _FLAT * total:
        return False
    faces = np.flatnonzero(flat)
    cumulative = np.cumsum(area[faces])
    wanted = (np.arange(_SAMPLES) + 0.5) / _SAMPLES * cumulative[-1]
    chosen = faces[np.searchsorted(cumulative, wanted)]
    return blocked((a[chosen] + b[chosen] + c[chosen]) / 3.0 + [0.0, 0.0, _LIFT]) <= (1.0 - _OPEN) * _SAMPLES
