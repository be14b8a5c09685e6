"""What every footprint of a body sends back to the radar, as triangles with one complex amplitude each.

A chain of bounces is unfolded: a point r of the last footprint and its image r' through the mirrors before have, for a
monostatic radar in direction u, the phase of a single reflection at (r + r') / 2. So a chain is a triangle at that
place, and stays one for directions near the one that was traced.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.rays.face_rays import MISS
from scarl_sionna.radar.optics.body.mesh import Body
from scarl_sionna.radar.optics.faces.curved import CurvedFaces, parts_of
from scarl_sionna.radar.optics.fields import HOST, Wave, radiating_vector
from scarl_sionna.radar.optics.plane_waves import Bounce, PlaneTubes, Waves, bounces, unhidden, unit_vectors
from scarl_sionna.radar.optics.surfaces import PartSurfaces

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

_SAME_DIRECTION = 1e-5
"""A chain that is followed back leaves the body within this of the radar's direction; grazing ones may miss their
mirror."""


@dataclass(frozen=True, eq=False)
class Footprints:
    """Footprints seen from one direction.

    Attributes
    ----------
    corners : ndarray of float64, shape (n, 3, 3)
        [m].
    turn, offset : ndarray of float64, shape (n, 3, 3) and (n, 3)
        The point r of a footprint acts from ``turn @ r + offset``.
    amplitude : ndarray of complex128, shape (n, 2, 2)
        Radiated over incident field, receive polarisation first.
    """

    corners: Array
    turn: Array
    offset: Array
    amplitude: Complex

    def __len__(self) -> int:
        return len(self.corners)

    def take(self, rows: npt.NDArray[np.int64], corners: Array | None = None) -> Footprints:
        """Return some rows, with other corners if given."""
        own = self.corners[rows] if corners is None else corners
        return Footprints(own, self.turn[rows], self.offset[rows], self.amplitude[rows])

    @classmethod
    def joined(cls, parts: list[Footprints]) -> Footprints:
        """Return all rows of several."""
        if not parts:
            return cls(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), np.zeros((0, 2, 2), np.complex128))
        return cls(*(np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(cls)))

    def place(self) -> Array:
        """Return where each footprint acts from, shape (n, 3) [m]."""
        return np.asarray(np.einsum("nij,nj->ni", self.turn, self.corners.mean(axis=1)) + self.offset)

    def acting(self) -> Array:
        """Return from where the corners of each footprint act, shape (n, 3, 3) [m]."""
        return np.asarray(np.einsum("nij,ncj->nci", self.turn, self.corners) + self.offset[:, None])

    def apertures(self, toward: Array) -> Array:
        """Return how far off a ray through where a footprint acts waves meet the body, squared, shape (n, 3) [m2].

        At the middles of its sides, seen from the unit vector `toward`. A wave comes by the point r of a chain and goes
        by its image r', both half of ``r - r'`` off the place between them that acts: 0 of a single reflection, up to
        half of the mirrors of a corner, which acts at its apex. At a distance R the two legs are longer by this over R.
        """
        middles = (self.corners + np.roll(self.corners, -1, axis=1)) / 2.0
        off = middles - np.einsum("nij,ncj->nci", self.turn, middles) - self.offset[:, None]
        return np.asarray(np.sum(off**2, axis=2) - (off @ toward) ** 2)

    def twice_area(self) -> Array:
        """Return twice the area of each footprint, shape (n,) [m2]."""
        sides = self.corners[:, 1:] - self.corners[:, :1]
        return np.asarray(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1))


def footprints(
    body: Body, surfaces: PartSurfaces, toward: Array, frequency: float, settings: SbrSettings
) -> Footprints:
    """Return all footprints that a radar far away in direction `toward` lights and sees.

    Parameters
    ----------
    body : Body
    surfaces : PartSurfaces
    toward : ndarray of float64, shape (3,)
        Unit vector from the body to the radar.
    frequency : float
        [Hz].
    settings : SbrSettings
    """
    theta, phi = np.arccos(np.clip(toward[2:], -1.0, 1.0)), np.arctan2(toward[1:2], toward[:1])
    r_hat, theta_hat, phi_hat = unit_vectors(theta, phi)
    waves = Waves(-r_hat, np.stack([theta_hat, phi_hat], axis=2), np.array([SPEED_OF_LIGHT / frequency]))
    receive = np.stack([theta_hat[0], phi_hat[0]])
    wavenumber = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    body = body.with_curves(settings, wavenumber, surfaces.rounded)
    settings = settings.for_size(body.size * frequency / SPEED_OF_LIGHT)
    parts = [
        _seen(body, bounce, r_hat[0], receive, waves, settings) for bounce in bounces(body, surfaces, waves, settings)
    ]
    return Footprints.joined(parts)


def _seen(body: Body, bounce: Bounce, toward: Array, receive: Array, waves: Waves, settings: SbrSettings) -> Footprints:
    """Return what of one bounce's footprints the radar sees."""
    tubes = bounce.tubes
    row, corners = np.arange(len(tubes)), tubes.corners
    if bounce.depth > 1:  # what the radar lights itself it sees as well
        front = tubes.normal @ toward > 0.0
        free, tested = np.flatnonzero(front & tubes.free), np.flatnonzero(front & ~tubes.free)
        rows, pieces = [free], [corners[free]]
        size = np.full(len(tested), waves.wavelength[0])
        for tri, number in unhidden(body, tubes, tested, np.tile(toward, (len(tested), 1)), size, settings):
            rows.append(tested[number])
            pieces.append(tri)
        row, corners = np.concatenate(rows), np.concatenate(pieces)
    vector = radiating_vector(
        HOST,
        Wave(tubes.incident[row], tubes.direction[row]),
        Wave(bounce.reflected[row], bounce.onward[row]),
        tubes.normal[row],
        np.broadcast_to(toward, (len(row), 3)),
    )
    turn, offset = _unfold(body, tubes, row, corners, bounce.depth, toward)
    found = Footprints(corners, turn, offset, np.einsum("ri,nit->nrt", receive, vector))
    if body.curved is None:
        return found
    difference = 2.0 * np.pi / waves.wavelength[0] * (toward - tubes.direction[row])
    return _on_curves(body.curved, found, tubes.face[row], difference, tubes.normal[row])


def _on_curves(
    curved: CurvedFaces,
    found: Footprints,
    face: npt.NDArray[np.int64],
    difference: Array,
    normal: Array,
) -> Footprints:
    """Return footprints of which those on curved faces are cut into parts on the surface; see :func:`.parts_of`."""
    bent = np.flatnonzero(curved.is_curved[face])
    if not len(bent):
        return found
    parts = parts_of(curved, face[bent], found.corners[bent], difference[bent], normal[bent])
    pieces = found.take(bent[parts.footprint], parts.corners)
    twice = pieces.twice_area()
    weight = np.divide(2.0 * parts.area, twice, out=np.zeros_like(twice), where=twice > 0.0)
    pieces = replace(pieces, amplitude=pieces.amplitude * weight[:, None, None])
    return Footprints.joined([found.take(np.flatnonzero(~curved.is_curved[face])), pieces])


def _unfold(
    body: Body, tubes: PlaneTubes, row: npt.NDArray[np.int64], corners: Array, depth: int, toward: Array
) -> tuple[Array, Array]:
    """Return `turn` and `offset` of :class:`Footprints`; follows the chains back to the radar through their mirrors."""
    count = len(row)
    image = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    shift = np.zeros((count, 3))
    point, direction, lift = corners.mean(axis=1), tubes.direction[row], tubes.normal[row]
    sound = np.ones(count, dtype=bool)
    for _ in range(depth - 1):
        face = body.rays.first_faces(point, -direction, lift)
        sound &= face != MISS
        normal, height = body.triangles.normal[face], body.triangles.offset[face]
        cosine = np.einsum("ni,ni->n", normal, direction)
        step = (np.einsum("ni,ni->n", normal, point) - height) / np.where(np.abs(cosine) > 1e-12, cosine, 1.0)
        point = point - step[:, None] * direction
        mirror = np.eye(3) - 2.0 * normal[:, :, None] * normal[:, None, :]
        image = mirror @ image
        shift = np.einsum("nij,nj->ni", mirror, shift) + 2.0 * height[:, None] * normal
        direction = np.einsum("nij,nj->ni", mirror, direction)
        lift = -normal * np.sign(np.einsum("ni,ni->n", normal, direction))[:, None]
    sound &= np.linalg.norm(direction + toward, axis=1) < _SAME_DIRECTION
    image[~sound] = np.eye(3) - np.einsum("i,nj->nij", toward, tubes.direction[row[~sound]] + toward)
    shift[~sound] = -tubes.path[row[~sound], None] * toward
    turn, offset = (image + np.eye(3)) / 2.0, shift / 2.0
    return turn, offset
