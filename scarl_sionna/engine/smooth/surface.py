"""The curved surfaces behind the faces of meshes: of one mesh, and of a state of the world."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from .creases import curved_surface, sheet_sizes
from .lifts import edge_lifts, middle_lifts
from .uneven import uneven_error

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

COARSE = np.radians(46.0)
"""Bends up to this [rad] may be those of a curve: one of eight sides has 45 deg."""
FEWEST_FACES = 4
"""That make a curve."""
UNEVEN_DB = 0.5
"""Expected error from which a face counts as uneven."""
MOSTLY_UNEVEN = 0.3
"""Part of a body's area that is uneven, from which it is told of; of cars it is 0.14 to 0.25, where panels end."""
SLANTED = 3.0**-1.5 / 2.0
"""Largest value of s (1 - s) (2 s - 1)."""


@dataclass(frozen=True, eq=False)
class Surface:
    r"""The curved surface for which the triangles of a mesh stand.

    With barycentric coordinates s, the lifts d and slants e of its edges, and its middle m, a point of a triangle
    stands for the one that is away from it by

    .. math:: q \frac{h}{|q|} (1 + g (1 - |q| / \max|d|)) + \sum_i s_i s_j (s_i - s_j) e_i + 27 s_0 s_1 s_2 m,
        \quad q = 4 (s_0 s_1 d_0 + s_1 s_2 d_1 + s_2 s_0 d_2), \quad j = i + 1

    with h as q but of the lifts' lengths, where they point to one side; else h = |q|. The factor in brackets is the
    fourth order of a circle: g = (1 - cos(theta)) / 2 where the normals at the ends of an edge are 2 theta apart. Right
    to 1e-3 of the height on a sphere drawn with 18 sides. The rest is zero there: it is for bends that are not even.

    Attributes
    ----------
    lift : ndarray of float64, shape (num_faces, 3, 3)
        From the middle of each edge, from corner i to i + 1, onto the surface [m]; zeros where the triangle is flat.
    slant : ndarray of float64, shape (num_faces, 3, 3)
        How uneven the arc over each edge is, see :func:`.edge_lifts` [m].
    middle : ndarray of float64, shape (num_faces, 3)
        See :func:`.middle_lifts` [m].
    height : ndarray of float64, shape (num_faces,)
        Length of the longest lift, or of what the longest slant moves its edge by if that is more [m].
    rounding : ndarray of float64, shape (num_faces,)
        g for the largest angle between normals at corners.
    error : ndarray of float64, shape (num_faces,)
        Expected error of the echo, :func:`.uneven_error` [dB]; zero where the material says that all is curved.
    coarse : ndarray of bool, shape (num_faces,)
        Flat faces that would be curved, did edges that bend by up to `COARSE` count: a curve drawn with few sides, or a
        body that has so many.
    """

    lift: Array
    slant: Array
    middle: Array
    height: Array
    rounding: Array
    error: Array
    coarse: Mask

    @classmethod
    def flat(cls, num_faces: int) -> Surface:
        """Return the surface of flat faces."""
        return cls(
            np.zeros((num_faces, 3, 3)),
            np.zeros((num_faces, 3, 3)),
            np.zeros((num_faces, 3)),
            np.zeros(num_faces),
            np.zeros(num_faces),
            np.zeros(num_faces),
            np.zeros(num_faces, dtype=np.bool_),
        )

    def take(self, rows: Index) -> Surface:
        """Return some rows."""
        return Surface(*(column[rows] for column in vars(self).values()))

    def coarse_share(self, corners: Array) -> float:
        """Return the part of the area of faces, shape (num_faces, 3, 3), that is coarse."""
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.sqrt(np.einsum("ij,ij->i", across, across))
        return float(area[self.coarse].sum()) / max(float(area.sum()), 1e-300)

    def uneven(self, corners: Array, body: Index) -> dict[int, tuple[int, float]]:
        """Return how many faces of bodies are uneven, and their mean expected error [dB].

        Those are left out of whose area they are at most `MOSTLY_UNEVEN`. `corners` (num_faces, 3, 3) are those of the
        faces, `body` (num_faces,) numbers their bodies.
        """
        bad = self.error > UNEVEN_DB
        if not bad.any():
            return {}
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.sqrt(np.einsum("ij,ij->i", across, across))
        size = int(body.max()) + 1
        whole, some = np.bincount(body, area, size), np.bincount(body[bad], area[bad], size)
        total, count = np.bincount(body[bad], (area * self.error)[bad], size), np.bincount(body[bad], minlength=size)
        told = np.flatnonzero(some > MOSTLY_UNEVEN * whole).tolist()
        return {number: (int(count[number]), float(total[number] / some[number])) for number in told}

    def put(self, rows: Index | slice, other: Surface) -> None:
        """Take the rows of another surface, in place."""
        for name, column in vars(other).items():
            own: npt.NDArray[Any] = getattr(self, name)
            own[rows] = column


def mesh_surface(corners: Array, part: Index, crease_angle: float, rounded: Collection[int] = ()) -> Surface | None:
    """Return the curved surface behind a mesh, None where all of it is flat and nothing is coarse.

    Parameters
    ----------
    corners : ndarray of float64, shape (num_faces, 3, 3)
        Triangles [m].
    part : ndarray of int64, shape (num_faces,)
        A surface does not go on from one part to another.
    crease_angle : float
        Edges that bend by more than this are edges of the body [rad].
    rounded : collection of int
        Parts that are curved everywhere: all their other edges are of the drawing.
    """
    surface = Surface.flat(len(corners))
    side = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sound: Mask = np.asarray(side.any(axis=1), dtype=np.bool_)
    order = np.argsort(part, kind="stable")
    for own in np.split(order, np.flatnonzero(np.diff(part[order])) + 1):
        rows = own[sound[own]]
        if len(rows) >= FEWEST_FACES:
            surface.put(rows, _part_surface(corners[rows], crease_angle, int(part[rows[0]]) in rounded))
    return surface if surface.height.any() or surface.coarse.any() else None


def _part_surface(corners: Array, crease_angle: float, rounded: bool) -> Surface:
    surface = Surface.flat(len(corners))
    found, wider = curved_surface(corners, crease_angle, max(COARSE, crease_angle), rounded)
    surface.coarse[:] = wider & ~found.faces
    if found.faces.any():
        surface.lift[:], surface.slant[:] = edge_lifts(corners, found.normal, found.faces)
        surface.middle[:] = middle_lifts(corners, surface.slant)
        if not rounded:
            surface.error[:] = uneven_error(corners, surface.lift, found.joined)
        square = np.einsum("nij,nij->ni", surface.lift, surface.lift)
        square = np.maximum(square, SLANTED**2 * np.einsum("nij,nij->ni", surface.slant, surface.slant))
        surface.height[:] = np.sqrt(square.max(axis=1))
        cosine = np.einsum("nij,nij->ni", found.normal, np.roll(found.normal, -1, axis=1)).min(axis=1)
        surface.rounding[:] = 0.5 - 0.5 * np.sqrt(np.clip(0.5 + 0.5 * cosine, 0.0, 1.0))
    return surface


_known: WeakKeyDictionary[World, dict[tuple[int, float], Surface | None]] = WeakKeyDictionary()
"""By part and crease angle, in the frames of `World.mesh`."""


_sheets: WeakKeyDictionary[World, dict[int, Array]] = WeakKeyDictionary()
"""By part."""


def state_sheets(state: WorldState, parts: Index) -> Array:
    """Return the size of the sheet to which each face of a state belongs [m], infinite for all but some parts.

    Parameters as of :func:`state_surface`; see :func:`.creases.sheet_sizes`.
    """
    triangles = state.world._triangles
    known = _sheets.setdefault(state.world, {})
    result = np.full(len(triangles.corners), np.inf)
    for part in parts.tolist():
        rows = slice(int(triangles.first[part]), int(triangles.first[part + 1]))
        if part in state._bent:
            result[rows] = _sheets_of(state._triangles.corners[rows], state._triangles.normal[rows])
            continue
        if part not in known:
            known[part] = _sheets_of(triangles.corners[rows], triangles.normal[rows])
        result[rows] = known[part]
    return result


def _sheets_of(corners: Array, normal: Array) -> Array:
    sizes = np.full(len(corners), np.inf)
    sound = np.flatnonzero(normal.any(axis=1))
    if len(sound):
        sizes[sound] = sheet_sizes(corners[sound])
    return sizes


def state_surface(state: WorldState, crease_angle: float, parts: Index) -> Surface:
    """Return the curved surface behind the faces of a state, in the world's frame.

    Parameters
    ----------
    state : WorldState
    crease_angle : float
        [rad].
    parts : ndarray of int64
        Rows of the part table that are looked at, each once for a world, those that bend for each state; the rest
        counts as flat.
    """
    triangles, table = state.world._triangles, state.world.parts
    known = _known.setdefault(state.world, {})
    result = Surface.flat(len(triangles.corners))
    for part in parts.tolist():
        rows = slice(int(triangles.first[part]), int(triangles.first[part + 1]))
        rounded = (0,) if state.world.materials[table.material[part]].rounded else ()
        if part in state._bent:
            corners = state._triangles.corners[rows]
            bent = mesh_surface(corners, np.zeros(len(corners), dtype=np.int64), crease_angle, rounded)
            if bent is not None:
                result.put(rows, bent)
            continue
        if (part, crease_angle) not in known:
            corners = triangles.corners[rows]
            whole = np.zeros(len(corners), dtype=np.int64)
            known[part, crease_angle] = mesh_surface(corners, whole, crease_angle, rounded)
        surface = known[part, crease_angle]
        if surface is not None:
            result.put(rows, surface)
            pose = state.part_pose(part)
            for name in ("lift", "slant", "middle"):
                vectors = getattr(surface, name)
                getattr(result, name)[rows] = pose.rotate(vectors.reshape(-1, 3)).reshape(vectors.shape)
    return result
