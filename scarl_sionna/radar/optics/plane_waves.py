"""Plane waves on a body: which parts of the mesh each wave lights, and what the reflected tubes meet, with fields."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.rays.face_rays import MISS

from .body.mesh import Body
from .surfaces import PartSurfaces
from .tubes.probes import ParallelRays, PlaneProbe, ShadowProbe
from .tubes.refine import Pieces, refine
from .tubes.spacings import Spacings
from .tubes.trace import GRAZING, Tubes, depth_first, face_of_plane, gathered, landing

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

_SAME = 1e-6
"""Directions within this are one [rad]: an observer so close to the source sees what the source lights."""


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
class Looks:
    """What to solve for: one row a pair of directions at one frequency, all arrays of shape (num_looks,).

    Attributes
    ----------
    frequency : ndarray of float64
        [Hz].
    theta, phi : ndarray of float64
        Where the wave comes from, from +z and from +x [rad].
    theta_s, phi_s : ndarray of float64
        Where the observer stands [rad].
    """

    frequency: Array
    theta: Array
    phi: Array
    theta_s: Array
    phi_s: Array

    def __len__(self) -> int:
        return len(self.frequency)

    def take(self, rows: Index) -> Looks:
        """Return some rows."""
        return Looks(*(column[rows] for column in vars(self).values()))

    def reversed(self) -> Looks:
        """Return the looks with source and observer in each other's place."""
        return Looks(self.frequency, self.theta_s, self.phi_s, self.theta, self.phi)

    @property
    def is_backward(self) -> npt.NDArray[np.bool_]:
        """Whether the observer stands where the wave comes from, shape (num_looks,), however the angles are written.

        At a pole, where directions do not tell phi, only with the same axes of V and H, up to a sign of both.
        """
        here, there = unit_vectors(self.theta, self.phi), unit_vectors(self.theta_s, self.phi_s)
        alike = are_same(here[2], there[2]) | are_same(here[2], -there[2])
        return alike & are_same(here[0], there[0])


def are_same(first: Array, second: Array) -> npt.NDArray[np.bool_]:
    """Return whether unit vectors of shape (n, 3) are one direction, shape (n,)."""
    return np.asarray(np.linalg.norm(first - second, axis=1) < _SAME)


def unit_vectors(theta: Array, phi: Array) -> tuple[Array, Array, Array]:
    """Return r_hat, theta_hat and phi_hat, each of shape (n, 3)."""
    st, ct, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
    r_hat = np.stack([st * cp, st * sp, ct], axis=1)
    theta_hat = np.stack([ct * cp, ct * sp, -st], axis=1)
    phi_hat = np.stack([-sp, cp, np.zeros_like(phi)], axis=1)
    return r_hat, theta_hat, phi_hat


@dataclass(frozen=True, eq=False)
class Plan:
    """Looks sorted by wave and observer: `view` is a pair (wave, observer), with one look a frequency."""

    looks: Looks
    waves: Waves
    first_view: Index  # (num_waves + 1,): views of each wave
    observer: Array  # (num_views, 3)
    receive: Array  # (num_views, 2, 3): theta_hat and phi_hat there
    backward: npt.NDArray[np.bool_]  # (num_views,)
    first_look: Index  # (num_views + 1,): entries of `look` of each view
    look: Index  # (num_looks,)
    wavenumber: Array  # (num_looks,), in the order of `look`


def plan_of(looks: Looks) -> Plan:
    """Return the looks sorted by wave and observer."""
    angles = np.column_stack([looks.theta, looks.phi, looks.theta_s, looks.phi_s])
    views, view_of = np.unique(angles, axis=0, return_inverse=True)
    view_of = view_of.reshape(-1)
    order = np.lexsort((looks.frequency, view_of))
    sources, wave_of = np.unique(views[:, :2], axis=0, return_inverse=True)
    wave_of = wave_of.reshape(-1)  # views are sorted by their source first
    r_hat, theta_hat, phi_hat = unit_vectors(sources[:, 0], sources[:, 1])
    highest = np.zeros(len(sources))
    np.maximum.at(highest, wave_of[view_of], looks.frequency)
    waves = Waves(-r_hat, np.stack([theta_hat, phi_hat], axis=2), SPEED_OF_LIGHT / highest)
    observer, theta_s, phi_s = unit_vectors(views[:, 2], views[:, 3])
    return Plan(
        looks=looks,
        waves=waves,
        first_view=np.searchsorted(wave_of, np.arange(len(sources) + 1)),
        observer=observer,
        receive=np.stack([theta_s, phi_s], axis=1),
        backward=are_same(observer, -waves.direction[wave_of]),
        first_look=np.searchsorted(view_of[order], np.arange(len(views) + 1)),
        look=order,
        wavenumber=2.0 * np.pi * looks.frequency[order] / SPEED_OF_LIGHT,
    )


@dataclass(frozen=True, eq=False)
class PlaneTubes(Tubes):
    """Footprints of ray tubes on their faces, with the wave that arrives there.

    Attributes
    ----------
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
    face : ndarray of int64, shape (num_tubes,)
        A face of the footprint's plane; the one on which it lies, where that is curved.
    """

    wave: Index
    direction: Array
    normal: Array
    path: Array
    incident: npt.NDArray[np.complex128]
    free: npt.NDArray[np.bool_]
    part: Index
    face: Index


@dataclass(frozen=True, eq=False)
class Bounce:
    """Tubes at one bounce with their reflection."""

    depth: int
    tubes: PlaneTubes
    reflected: npt.NDArray[np.complex128]
    onward: Array


def bounces(body: Body, surfaces: PartSurfaces, waves: Waves, settings: SbrSettings) -> Iterator[Bounce]:
    """Yield every footprint that the waves light, bounce after bounce, in batches of bounded size.

    `settings` are those of :meth:`.SbrSettings.for_size`.
    """

    def arrive(depth: int, tubes: PlaneTubes) -> Iterator[Bounce]:
        lit = gathered(_lit(body, waves, tubes, settings), settings.max_tubes) if depth == 1 else iter((tubes,))
        for part in lit:
            reflected, onward = surfaces.reflect(part.part, part.incident, part.direction, part.normal)
            yield Bounce(depth, part, reflected, onward)

    def go_on(bounce: Bounce) -> Iterator[PlaneTubes]:
        return gathered(_next(body, waves, bounce, of_plane, settings), settings.max_tubes)

    of_plane = face_of_plane(body.plane)
    yield from depth_first(_facing(body, waves, settings), arrive, go_on, settings.max_depth)


def _facing(body: Body, waves: Waves, settings: SbrSettings) -> Iterator[PlaneTubes]:
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
        yield PlaneTubes(
            body.triangles.corners[face],
            wave,
            waves.direction[wave],
            normal[face] * side[:, None],
            np.zeros(len(wave)),
            waves.field[wave].astype(np.complex128),
            body.free[face, (side < 0).astype(np.int64)],
            body.part[face],
            face,
        )


def unhidden(
    body: Body, tubes: PlaneTubes, rows: Index, towards: Array, wavelength: Array, settings: SbrSettings
) -> Iterator[tuple[Array, Index]]:
    """Yield the parts of footprints from which nothing of the body stands in a direction.

    Parameters
    ----------
    body : Body
    tubes : PlaneTubes
    rows : ndarray of int64, shape (n,)
        Tubes that are looked at.
    towards : ndarray of float64, shape (n, 3)
        Unit direction from each.
    wavelength : ndarray of float64, shape (n,)
        [m].
    settings : SbrSettings

    Yields
    ------
    corners, number
        Pieces, and the entry of `rows` of which each is a part.
    """
    if not len(rows):
        return
    with body.rays.active():
        probe = ShadowProbe(body.rays, ParallelRays(body.rays, towards), tubes.normal[rows])
    spacings = Spacings(*settings.spacings(wavelength))
    for corners, number, dark in refine(tubes.corners[rows], np.arange(len(rows)), probe, spacings, settings):
        lit = dark == 0
        yield corners[lit], number[lit]


def _lit(body: Body, waves: Waves, tubes: PlaneTubes, settings: SbrSettings) -> Iterator[PlaneTubes]:
    """Yield the parts of the tubes that see the source."""
    if tubes.free.any():
        yield tubes.take(np.flatnonzero(tubes.free))
    rows = np.flatnonzero(~tubes.free)
    wavelength = waves.wavelength[tubes.wave[rows]]
    for corners, number in unhidden(body, tubes, rows, -tubes.direction[rows], wavelength, settings):
        yield tubes.take(rows[number], corners)


def _next(body: Body, waves: Waves, bounce: Bounce, of_plane: Index, settings: SbrSettings) -> Iterator[PlaneTubes]:
    """Yield the footprints that the reflected tubes have on what they meet next."""
    tubes = bounce.tubes
    chosen = np.flatnonzero(~tubes.free)
    if not len(chosen):
        return
    with body.rays.active():
        probe = PlaneProbe(body.rays, ParallelRays(body.rays, bounce.onward), tubes.normal, body.plane)
    spacings = Spacings(*settings.spacings(waves.wavelength[tubes.wave[chosen]]))
    for pieces in refine(tubes.corners[chosen], chosen, probe, spacings, settings):
        yield _landed(body, bounce, pieces, of_plane)


def _landed(body: Body, bounce: Bounce, pieces: Pieces, of_plane: Index) -> PlaneTubes:
    """Return tubes projected along their direction onto the planes that they meet."""
    corners, rows, plane = pieces
    tubes, met = bounce.tubes, plane != MISS
    corners, rows, face = corners[met], rows[met], of_plane[plane[met]]
    direction, normal = bounce.onward[rows], body.triangles.normal[face]
    share, cosine = landing(corners, direction[:, None], normal, body.triangles.offset[face])
    hit = np.abs(cosine[:, 0]) > GRAZING
    corners, rows, face, share, cosine = corners[hit], rows[hit], face[hit], share[hit], cosine[hit, 0]
    direction, normal = direction[hit], normal[hit]
    # the reflected wave has the incident one's phase where it leaves: path + direction . r is the same there
    turn = np.einsum("ij,ij->i", tubes.direction[rows] - direction, corners[:, 0])
    return PlaneTubes(
        corners + share[:, :, None] * direction[:, None],
        tubes.wave[rows],
        direction,
        -normal * np.sign(cosine)[:, None],
        tubes.path[rows] + turn,
        bounce.reflected[rows],
        body.free[face, (cosine > 0).astype(np.int64)],
        body.part[face],
        face,
    )
