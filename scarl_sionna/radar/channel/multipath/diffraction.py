"""Legs over one edge: mirrors and panes, an edge, mirrors and panes again.

The geometry is float64, the amplitude is that of the uniform theory.

Which edge a path meets is the engine's; where on it, how long, how strong and how fast is computed here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.engine.paths.tracing import DIFFRACTION, REFRACTION, SPECULAR, TracedPaths
from scarl_sionna.engine.rays.edges import Wedge, wedge_at
from scarl_sionna.scene.materials.fresnel import reflection
from scarl_sionna.scene.materials.rough import coherent_share

from .images import Chain, material_coefficients, propagated, spherical_basis
from .station import EndPoints, Station
from .utd import EdgeRay, edge_transfer

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState


Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

GRAZING = 1e-6
"""A ray closer than this to an edge's direction or to its end [m or rad] has no point on it."""


@dataclass(frozen=True, eq=False)
class EdgeLeg:
    """One leg over an edge; the fields of :class:`Legs`, for one leg, and `edge_length` [m]."""

    point: Array
    image: Array
    isometry: Array
    inner: float
    front: Array
    rear: Array
    spread: float
    length: float
    rate: float
    acceleration: float
    velocity: Array
    front_velocity: Array
    rear_velocity: Array
    transfer: Complex
    edge_length: float


def edge_leg(
    state: WorldState, traced: TracedPaths, row: int, station: Station, ends: EndPoints, frequency: float
) -> EdgeLeg | None:
    """Return one traced path with a diffraction as a leg, or None where it has no edge or misses it in float64.

    Parameters
    ----------
    state : WorldState
    traced : TracedPaths
    row : int
        Of the path.
    station : Station
    ends : EndPoints
        All that were traced to.
    frequency : float
        [Hz].
    """
    end, end_velocity = ends.position[traced.target[row]], ends.velocity[traced.target[row]]
    kind, part = traced.kind[row], traced.part[row]
    where = int(np.flatnonzero(kind == DIFFRACTION)[0])
    first, second = _chain(traced, row, slice(0, where)), _chain(traced, row, slice(where + 1, None))
    backward = Chain(*(value[:, ::-1] for value in vars(first).values()))
    source, target = backward.images(station.position[None])[0, 0], second.images(end[None])[0, 0]
    wedge = wedge_at(state, int(part[where]), int(traced.face[row, where]), traced.vertex[row, where])
    wedge = None if wedge is None else wedge.seen_from(source)
    if wedge is None:
        return None
    (rho, _, z), (rho_end, angle_end, z_end) = wedge.cylindrical(source), wedge.cylindrical(target)
    if angle_end > wedge.exterior or min(rho, rho_end) < GRAZING:
        return None
    place = (z * rho_end + z_end * rho) / (rho + rho_end)
    if not 0.0 <= place <= wedge.length:
        return None
    edge = wedge.origin + place * wedge.direction
    points = np.broadcast_to(end, (len(kind), 3)).copy()
    points[where] = edge
    right = True
    for chain, start, stop, columns in (
        (first, station.position, edge, slice(0, where)),
        (second, edge, end, slice(where + 1, None)),
    ):
        points[columns], met = (value[0] for value in chain.vertices(start, chain.images(stop[None])))
        right = right and bool(met)
    if not right:
        return None
    images = first.images(edge[None]), second.images(end[None])
    travel = first.travel(station.position, images[0]), second.travel(edge, images[1])
    before, behind = float(np.linalg.norm(edge - source)), float(np.linalg.norm(target - edge))
    ray = EdgeRay(travel[0][0, -1], travel[1][0, 0], before, behind)
    known = [state.world.materials[state.world.parts.material[index]] if index >= 0 else None for index in part]
    own = known[where]
    assert own is not None  # the row of a diffraction is a part

    def faces(cosine: float) -> tuple[complex, complex]:
        te, tm = reflection(own, frequency, cosine)
        coherent = complex(coherent_share(own, frequency, cosine))
        return complex(te) * coherent, complex(tm) * coherent

    materials = [material for material in known if material is not None]
    index = np.where(part >= 0, np.cumsum(part >= 0) - 1, -1)[None]
    field = spherical_basis(station.rotation, travel[0][:, 0]).astype(np.complex128)
    field = propagated(first, travel[0], field, material_coefficients(materials, index[:, :where], frequency))
    wavenumber = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
    turned = edge_transfer(wedge, ray, wavenumber, faces)
    field = np.einsum("ij,pqj->pqi", turned, field)
    field = propagated(second, travel[1], field, material_coefficients(materials, index[:, where + 1 :], frequency))
    basis = spherical_basis(ends.rotation, -travel[1][:, -1])
    velocity = state.point_velocity(part, points)
    rate, acceleration, sliding = _motion(
        wedge,
        source,
        target,
        _seen_velocity(backward, station.velocity, velocity[:where][::-1]) - velocity[where],
        _seen_velocity(second, end_velocity, velocity[where + 1 :]) - velocity[where],
    )
    at_edge = velocity[where] + sliding * wedge.direction
    behind_it = Chain(*(value[:, ::-1] for value in vars(second).values()))
    front_velocity = _seen_velocity(first, at_edge, velocity[:where]) - station.velocity
    rear_velocity = _seen_velocity(behind_it, at_edge, velocity[where + 1 :][::-1]) - end_velocity
    isometry = _joined_isometry(first, _unfolding(wedge, source, target), second)
    image = isometry[:, :3] @ end + isometry[:, 3]
    along = np.asarray(first.images((edge + wedge.direction)[None])[0, 0] - images[0][0, 0])
    near, far = _wavefront_errors(station.arms, along, travel[0][0, 0], ray, ends.is_station)
    front = station.position + before * travel[0][0, 0]
    ahead = travel[0][0, 0]
    turning = (front_velocity - (front_velocity @ ahead) * ahead) / before  # of the direction in which both are seen
    image_velocity = rate * ahead + (before + behind) * turning
    if near <= far:
        image, isometry, image_velocity = front, np.full((3, 4), np.nan), front_velocity
    return EdgeLeg(
        points,
        image,
        isometry,
        behind if near <= far else 0.0,
        front,
        end - behind * travel[1][0, -1],
        min(near, far),
        before + behind,
        rate,
        acceleration,
        image_velocity,
        front_velocity,
        rear_velocity,
        np.einsum("pri,pti->prt", basis, field)[0],
        wedge.length,
    )


def _chain(traced: TracedPaths, row: int, columns: slice) -> Chain:
    kind = traced.kind[row, columns][None]
    return Chain(
        kind == SPECULAR, kind == REFRACTION, traced.normal[row, columns][None], traced.offset[row, columns][None]
    )


def _seen_velocity(chain: Chain, velocity: Array, surfaces: Array) -> Array:
    """Return the velocity of a point's image as seen from the edge."""
    return np.asarray(chain.image_velocity(velocity[None], surfaces[None])[0])


def _motion(
    wedge: Wedge, source: Array, target: Array, source_velocity: Array, target_velocity: Array
) -> tuple[float, float, float]:
    r"""Return the first and second derivative of the length over an edge at rest, and the speed of its point along it.

    .. math:: L^2 = (\rho_1 + \rho_2)^2 + (z_1 - z_2)^2, \quad
              z = (z_1 \rho_2 + z_2 \rho_1) / (\rho_1 + \rho_2)
    """
    total, rate, curve, along, away = 0.0, 0.0, 0.0, [], []
    for point, velocity in ((source, source_velocity), (target, target_velocity)):
        rho, _, z = wedge.cylindrical(point)
        out = point - wedge.origin - z * wedge.direction
        across = velocity - (velocity @ wedge.direction) * wedge.direction
        opening = float(out @ across) / rho
        total, rate = total + rho, rate + opening
        curve += max(float(across @ across) - opening**2, 0.0) / rho
        along.append((z, float(velocity @ wedge.direction)))
        away.append((float(rho), opening))
    apart, sliding = along[0][0] - along[1][0], along[0][1] - along[1][1]
    length = float(np.hypot(total, apart))
    first = (total * rate + apart * sliding) / length
    (z, speed), (z_end, speed_end) = along
    (rho, opening), (rho_end, opening_end) = away
    place = (z * rho_end + z_end * rho) / total
    numerator = speed * rho_end + z * opening_end + speed_end * rho + z_end * opening
    return first, (rate**2 + sliding**2 + total * curve - first**2) / length, (numerator - place * rate) / total


def _unfolding(wedge: Wedge, source: Array, target: Array) -> Array:
    """Return the rotation about the edge that brings the target in line with source and edge, shape (3, 4)."""
    turn = wedge.cylindrical(source)[1] + np.pi - wedge.cylindrical(target)[1]
    e, t, n = wedge.direction, wedge.tangent, wedge.normal
    cosine, sine = np.cos(turn), np.sin(turn)
    matrix = np.outer(e, e) + np.outer(cosine * t + sine * n, t) + np.outer(cosine * n - sine * t, n)
    return np.concatenate([matrix, (wedge.origin - matrix @ wedge.origin)[:, None]], axis=1)


def _joined_isometry(first: Chain, middle: Array, second: Chain) -> Array:
    """Return the isometry of mirrors, then a rotation, then mirrors, shape (3, 4): the last ones act first."""
    outer, inner = first.isometry()[0], second.isometry()[0]
    matrix = outer[:, :3] @ middle[:, :3]
    shift = outer[:, :3] @ (middle[:, :3] @ inner[:, 3] + middle[:, 3]) + outer[:, 3]
    return np.concatenate([matrix @ inner[:, :3], shift[:, None]], axis=1)


def _wavefront_errors(
    arms: Array, edge: Array, ahead: Array, ray: EdgeRay, end_is_station: bool
) -> tuple[float, float]:
    """Return the largest errors of lengths to antennas [m], with the edge's point and the unfolded end as the centre.

    `edge` and `ahead` are the directions of the edge and of travel as the station sees them, `arms` its antennas [m].
    An edge's wavefront has two radii: to the edge across it, to the source behind along it. One sphere has one.
    """
    across = np.cross(ahead, edge)
    across /= np.linalg.norm(across)
    along = np.cross(across, ahead)
    bend = 0.5 * (1.0 / ray.before + (1.0 / ray.behind if end_is_station else -1.0 / (ray.before + ray.behind)))
    near, far = (bend * float(np.max((arms @ axis) ** 2, initial=0.0)) for axis in (along, across))
    return near, far
