"""Following ray tubes from bounce to bounce: which parts of the mesh each wave lights, and what the reflected tubes meet."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.rays.mesh_caster import MISS, Rays

from .body import Body
from .settings import SbrSettings
from .surface import PartSurfaces
from .tubes import refine

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

GRAZING = 1e-6
"""Cosine of incidence [-] below which a face is not lit: its flux is 60 dB below that of a face turned by 0.06 deg."""
_RAYS_PER_TUBE = 8
"""A batch holds this many times fewer tubes than rays: a tube is some 300 bytes in each of several tables."""


@dataclass(frozen=True, eq=False)
class Waves:
    """Plane waves that light the mesh.

    Attributes
    ----------
    direction : ndarray of float64, shape (num_waves, 3)
        Unit direction of travel.
    field : ndarray of float64, shape (num_waves, 3, 2)
        Electric field of the V and the H wave at the origin.
    wavelength : ndarray of float64, shape (num_waves,)
        The shortest at which the wave is used [m].
    """

    direction: Array
    field: Array
    wavelength: Array


@dataclass(frozen=True, eq=False)
class Tubes:
    """Footprints of ray tubes on their faces, with the wave that arrives there.

    Attributes
    ----------
    corners : ndarray of float64, shape (num_tubes, 3, 3)
        [m].
    wave : ndarray of int64, shape (num_tubes,)
    direction, normal : ndarray of float64, shape (num_tubes, 3)
        Direction of travel, and unit normal on the lit side.
    path : ndarray of float64, shape (num_tubes,)
        The wave's phase at r is -k (path + direction . r) [m].
    incident : ndarray of complex128, shape (num_tubes, 3, 2)
        Electric field without that phase, of the V and the H wave.
    free : ndarray of bool, shape (num_tubes,)
        Whether nothing of the mesh stands in front of the lit side.
    part : ndarray of int64, shape (num_tubes,)
        Part of the body on which the footprint lies.
    """

    corners: Array
    wave: Index
    direction: Array
    normal: Array
    path: Array
    incident: npt.NDArray[np.complex128]
    free: npt.NDArray[np.bool_]
    part: Index

    def __len__(self) -> int:
        return len(self.wave)

    def take(self, rows: Index, corners: Array | None = None) -> Tubes:
        """Return some rows, with other footprints if given."""
        values = [getattr(self, field.name)[rows] for field in fields(self)[1:]]
        return Tubes(self.corners[rows] if corners is None else corners, *values)


@dataclass(frozen=True, eq=False)
class Bounce:
    """Tubes at one bounce with their reflection."""

    depth: int
    tubes: Tubes
    reflected: npt.NDArray[np.complex128]
    onward: Array


def bounces(body: Body, surfaces: PartSurfaces, waves: Waves, settings: SbrSettings) -> Iterator[Bounce]:
    """Yield every footprint that the waves light, bounce after bounce, in batches of bounded size."""
    stack = [(1, faces) for faces in _facing(body, waves, settings)]
    stack.reverse()
    limit = max(settings.max_rays // _RAYS_PER_TUBE, 1)
    while stack:
        depth, tubes = stack.pop()
        pieces = _gather(_lit(body, waves, tubes, settings), limit) if depth == 1 else iter((tubes,))
        for part in pieces:
            reflected, onward = surfaces.reflect(part.part, part.incident, part.direction, part.normal)
            bounce = Bounce(depth, part, reflected, onward)
            yield bounce
            if depth < settings.max_depth:
                stack += [(depth + 1, following) for following in _gather(_next(body, waves, bounce, settings), limit)]


def _gather(pieces: Iterator[Tubes], limit: int) -> Iterator[Tubes]:
    """Join pieces into batches of at least `limit` tubes: many small ones cost more time than they have work."""
    held: list[Tubes] = []
    count = 0
    for piece in pieces:
        if not len(piece):
            continue
        held.append(piece)
        count += len(piece)
        if count >= limit:
            yield _join(held)
            held, count = [], 0
    if held:
        yield _join(held)


def _join(pieces: list[Tubes]) -> Tubes:
    if len(pieces) == 1:
        return pieces[0]
    return Tubes(*(np.concatenate([getattr(piece, field.name) for piece in pieces]) for field in fields(Tubes)))


def _facing(body: Body, waves: Waves, settings: SbrSettings) -> Iterator[Tubes]:
    """Yield the faces turned to each wave, as tubes that may still be shadowed."""
    normal = body.triangles.normal
    per_batch = max(settings.max_rays // len(normal), 1)
    for first in range(0, len(waves.direction), per_batch):
        direction = waves.direction[first : first + per_batch]
        cosine = direction @ normal.T
        towards = cosine < -GRAZING if body.one_sided else np.abs(cosine) > GRAZING
        wave, face = np.nonzero(towards)
        side = -np.sign(cosine[wave, face])
        wave += first
        yield Tubes(
            body.triangles.corners[face], wave, waves.direction[wave], normal[face] * side[:, None],
            np.zeros(len(wave)), waves.field[wave].astype(np.complex128), body.free[face, (side < 0).astype(np.int64)],
            body.part[face],
        )  # fmt: skip


def _sizes(waves: Waves, wave: Index, settings: SbrSettings) -> tuple[Array, Array]:
    wavelength = waves.wavelength[wave]
    return settings.ray_spacing * wavelength, settings.edge_spacing * wavelength


def _lit(body: Body, waves: Waves, tubes: Tubes, settings: SbrSettings) -> Iterator[Tubes]:
    """Yield the parts of the tubes that see the source."""
    if tubes.free.any():
        yield tubes.take(np.flatnonzero(tubes.free))
        tubes = tubes.take(np.flatnonzero(~tubes.free))
    if not len(tubes):
        return
    sizes = _sizes(waves, tubes.wave, settings)
    shadow = Rays(body.caster, -tubes.direction, tubes.normal)
    for corners, rows, dark in refine(tubes.corners, np.arange(len(tubes)), shadow, *sizes, *settings.limits):
        lit = dark == 0
        yield tubes.take(rows[lit], corners[lit])


def _next(body: Body, waves: Waves, bounce: Bounce, settings: SbrSettings) -> Iterator[Tubes]:
    """Yield the footprints that the reflected tubes have on what they meet next."""
    tubes, triangles = bounce.tubes, body.triangles
    plane_face = np.unique(body.plane, return_index=True)[1]
    chosen = np.flatnonzero(~tubes.free)
    if not len(chosen):
        return
    plane_met = Rays(body.caster, bounce.onward, tubes.normal, body.plane)
    sizes = _sizes(waves, tubes.wave[chosen], settings)
    for corners, rows, plane in refine(tubes.corners[chosen], chosen, plane_met, *sizes, *settings.limits):
        face = plane_face[plane]
        direction = bounce.onward[rows]
        cosine = np.einsum("ij,ij->i", direction, triangles.normal[face])
        hit = (plane != MISS) & (np.abs(cosine) > GRAZING)
        rows, face, corners, direction, cosine = rows[hit], face[hit], corners[hit], direction[hit], cosine[hit]
        if not len(rows):
            continue
        normal, offset = triangles.normal[face], triangles.offset[face]
        ahead = (offset[:, None] - np.einsum("nij,nj->ni", corners, normal)) / cosine[:, None]
        landed = corners + ahead[:, :, None] * direction[:, None, :]
        # the reflected wave has the incident one's phase where it leaves: path + direction . r is the same there
        turn = np.einsum("ij,ij->i", tubes.direction[rows] - direction, corners[:, 0])
        yield Tubes(
            landed, tubes.wave[rows], direction, -normal * np.sign(cosine)[:, None],
            tubes.path[rows] + turn, bounce.reflected[rows], body.free[face, (cosine > 0).astype(np.int64)],
            body.part[face],
        )  # fmt: skip
