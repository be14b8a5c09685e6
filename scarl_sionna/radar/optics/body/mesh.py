"""The mesh that scatters: float64 triangles without degenerate ones, their common planes, and the ray caster."""

from __future__ import annotations

import warnings
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from scarl_sionna.core.errors import MeshError, ScarlWarning
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.engine import variant
from scarl_sionna.engine.rays.face_planes import SAME_PLANE, plane_numbers
from scarl_sionna.engine.rays.face_rays import MeshRays, center_and_radius
from scarl_sionna.engine.rays.geometry import Triangles
from scarl_sionna.engine.smooth.surface import Surface, mesh_surface
from scarl_sionna.radar.optics.faces.curved import CurvedFaces

Array = npt.NDArray[np.float64]

_THIN = 1e-9
"""A face whose height is below this part of the mesh's size is degenerate: it has no area and no sure normal."""
MOSTLY_COARSE = 0.5
"""Part of the area that is flat but may have been meant as a curve, from which a warning is given."""
_LARGEST_SEARCH = 200_000_000
"""Pairs of a face and a corner of the convex hull up to which `free` is searched: 0.5 s; beyond, rays find out, with
the same result."""


@dataclass(frozen=True, eq=False)
class Body:
    """A triangle mesh ready for shooting and bouncing rays.

    Attributes
    ----------
    triangles : Triangles
        Float64 faces, none degenerate.
    plane : ndarray of int64, shape (num_faces,)
        Number of the plane in which each face lies; faces of one plane belong to one part.
    one_sided : bool
        Whether every part of the mesh is closed and its normals point outwards, so that only front faces can be lit.
    free : ndarray of bool, shape (num_faces, 2)
        Whether nothing of the mesh stands in front of a face's plane, on the side of its normal and on the other one:
        then nothing can shadow it, and what it reflects meets nothing.
    num_degenerate : int
        Faces without area that were left out.
    rays : MeshRays
        On the engine.
    part : ndarray of int64, shape (num_faces,)
        Part of the body to which each face belongs, which has one material.
    materials : tuple
        What each part is made of; empty where the caller says it for the only part.
    curved : CurvedFaces or None
        Faces that stand for a curved surface; see :meth:`with_curves`.
    """

    triangles: Triangles
    plane: npt.NDArray[np.int64]
    one_sided: bool
    free: npt.NDArray[np.bool_]
    num_degenerate: int
    rays: MeshRays
    part: npt.NDArray[np.int64]
    materials: tuple[Any, ...] = ()
    curved: CurvedFaces | None = None

    def with_curves(self, settings: SbrSettings, wavenumber: float, rounded: Collection[int] = ()) -> Body:
        """Return this body with the surface for which its faces stand, as the settings have it.

        Parameters
        ----------
        settings : SbrSettings
            Its `crease_angle_deg` and `surface_phase`.
        wavenumber : float
            The largest [rad/m].
        rounded : collection of int
            Numbers of the parts that are curved everywhere, :attr:`.PartSurfaces.rounded`.

        Warns
        -----
        ScarlWarning
            Once for a body, if most of its faces may have been meant as a curve but bend by more than the crease angle,
            or if the curvature of many changes too much from one to the next.
        """
        crease = float(np.radians(settings.crease_angle_deg))
        if crease == 0.0 or self.curved is not None:
            return self
        known = _surfaces.setdefault(self, {})
        key = crease, frozenset(rounded)
        if key not in known:
            surface = known[key] = mesh_surface(self.triangles.corners, self.part, crease, rounded)
            if surface is not None and surface.coarse_share(self.triangles.corners) > MOSTLY_COARSE:
                warnings.warn(
                    f"{int(surface.coarse.sum())} of {len(self.part)} faces of the mesh bend by more than "
                    f"{settings.crease_angle_deg:g} deg from one to the next and scatter as flat ones; if the body is "
                    "round, draw it with 11 sides or more, or raise crease_angle_deg",
                    ScarlWarning,
                    stacklevel=4,
                )
            whole = np.zeros(len(self.part), dtype=np.int64)
            for count, error in (surface.uneven(self.triangles.corners, whole) if surface else {}).values():
                warnings.warn(
                    f"{count} of {len(self.part)} faces of the mesh stand for a curve whose curvature changes more "
                    f"than 2.7 times from one to the next: their echo is right to some {error:.1f} dB; draw it with "
                    "more sides",
                    ScarlWarning,
                    stacklevel=4,
                )
        curved = CurvedFaces.of(known[key], self.triangles, wavenumber, settings.surface_phase)
        return self if curved is None else replace(self, plane=curved.apart(self.plane), curved=curved)

    @staticmethod
    def checked(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> tuple[Array, npt.NDArray[np.int64]]:
        """Return vertices (n, 3) [m] and faces (m, 3) of a mesh as arrays.

        Raises
        ------
        MeshError
            If there is no face with an area, a vertex is not finite, or a face names a vertex that is not there.
        """
        points = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
        index = np.asarray(faces, dtype=np.int64).reshape(-1, 3)
        if not len(index):
            raise MeshError("the mesh has no faces", remedy="give a triangle mesh, not a point cloud or a curve")
        if index.min() < 0 or index.max() >= len(points):
            raise MeshError(f"a face names vertex {index.max()} of a mesh with {len(points)} vertices")
        if not np.all(np.isfinite(points[index])):
            count = int(np.count_nonzero(~np.isfinite(points).all(axis=1)))
            raise MeshError(f"{count} vertices are not finite (NaN or infinite)", remedy="repair the mesh")
        if _degenerate(points[index]).all():
            raise MeshError(f"all {len(index)} faces of the mesh have no area", remedy="repair the mesh")
        return points, index

    @classmethod
    def from_mesh(
        cls,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        part: npt.NDArray[np.int64] | None = None,
        materials: tuple[Any, ...] = (),
    ) -> Body:
        """Make a body from vertices (n, 3) [m], faces (m, 3) and the part (m,) to which each face belongs.

        Raises
        ------
        MeshError
            As :meth:`checked`.
        """
        points, index = cls.checked(vertices, faces)
        corners = points[index]
        kept = ~_degenerate(corners)
        outward = _is_outward(corners)
        triangles = Triangles.from_meshes([corners[kept].reshape(-1, 3)], [np.arange(3 * kept.sum()).reshape(-1, 3)])
        of_part = np.zeros(len(index), dtype=np.int64) if part is None else np.asarray(part, dtype=np.int64)
        of_part = of_part[kept]
        center, radius = center_and_radius(triangles.corners)
        height = (triangles.offset - triangles.normal @ center) / radius
        plane = plane_numbers(triangles.normal, height, of_part)
        free = _free(triangles, height, (triangles.corners - center) / radius)
        with variant.radio() as mi:
            rays = MeshRays(mi, triangles.corners)
        return cls(triangles, plane, outward, free, int((~kept).sum()), rays, of_part, materials)

    @property
    def size(self) -> float:
        """Largest extent along an axis [m]."""
        points = self.triangles.corners.reshape(-1, 3)
        return float((points.max(axis=0) - points.min(axis=0)).max())


_surfaces: WeakKeyDictionary[Body, dict[tuple[float, frozenset[int]], Surface | None]] = WeakKeyDictionary()
"""By body, crease angle and parts that are curved everywhere."""


def _degenerate(corners: Array) -> npt.NDArray[np.bool_]:
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    twice_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    return twice_area <= _THIN * size * longest


def _is_outward(corners: Array) -> bool:
    """Return whether every part of a mesh is closed and has its normals outside.

    Closed: each edge is used once in each direction, after vertices at the same place have been joined.
    """
    points, joined = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = joined.reshape(-1, 3).astype(np.int64)
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = np.sort(edges[:, 0] * len(points) + edges[:, 1])
    backward = np.sort(edges[:, 1] * len(points) + edges[:, 0])
    if not np.array_equal(forward, backward) or np.any(np.diff(forward) == 0):
        return False
    graph = coo_array((np.ones(len(edges), dtype=bool), (edges[:, 0], edges[:, 1])), shape=(len(points),) * 2)
    part = connected_components(graph, directed=False)[1][faces[:, 0]]
    first = np.unique(part, return_index=True)[1]
    a, b, c = (corners[:, i] - corners[first[part], 0] for i in range(3))
    volume = np.bincount(part, np.einsum("ij,ij->i", a, np.cross(b, c)))
    return bool(np.all(volume > 0.0))


def _free(triangles: Triangles, offset: Array, scaled: Array) -> npt.NDArray[np.bool_]:
    """Return whether the mesh has nothing above each face's plane, and nothing below it.

    Offsets and corners are in radii of the mesh.
    """
    normal = triangles.normal
    corners = np.unique(scaled.reshape(-1, 3), axis=0)
    with suppress(QhullError, ValueError):  # a flat mesh has no hull; all its corners do as well
        corners = corners[ConvexHull(corners).vertices]
    result = np.zeros((len(normal), 2), dtype=bool)
    if len(normal) * len(corners) > _LARGEST_SEARCH:
        return result
    plain = normal.astype(np.float32)  # in radii: rounded to 6e-8, far below the tolerance
    across = np.ascontiguousarray(corners.T, dtype=np.float32)
    rows = max(200_000 // len(corners), 1)  # a block that stays in the cache
    for first in range(0, len(normal), rows):
        part = slice(first, first + rows)
        height = plain[part] @ across
        result[part, 0] = height.max(axis=1) <= offset[part] + SAME_PLANE
        result[part, 1] = height.min(axis=1) >= offset[part] - SAME_PLANE
    return result
