"""Legs: coherent paths of mirrors, panes and at most one edge from a radar to points, exact in float64."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from scarl_sionna.engine.paths.tracing import DIFFRACTION, DIFFUSE, REFRACTION, SPECULAR, TracedPaths

from .diffraction import EdgeLeg, edge_leg
from .images import Chain, material_coefficients, spherical_basis, transfer
from .station import EndPoints, Station

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

SAME_POINT = 1e-3
"""Paths whose interaction points agree within this [m] are one path, found on two triangles or two coincident parts:
the engine's float32 candidates, not an accuracy."""


@dataclass(frozen=True, eq=False)
class Legs:
    """Paths from a station to end points.

    Attributes
    ----------
    target : ndarray of int64, shape (num_legs,)
        Which end point; rising.
    kind, part, face : ndarray, shape (num_legs, max_depth)
        As in :class:`TracedPaths`.
    point : ndarray of float64, shape (num_legs, max_depth, 3)
        Interaction points [m, world].
    image : ndarray of float64, shape (num_legs, 3)
        Image of the end point seen from the station [m, world]; over an edge, the virtual point that serves the
        antennas.
    isometry : ndarray of float64, shape (num_legs, 3, 4)
        Maps the end point to its image; NaN where that is the edge.
    length, rate, acceleration : ndarray of float64, shape (num_legs,)
        [m], [m/s], [m/s2].
    velocity : ndarray of float64, shape (num_legs, 3)
        Of `image` relative to the station [m/s, world]. Turning of a mirror is in its part along the leg only.
    transfer : ndarray of complex128, shape (num_legs, 2, 2)
        Without spreading; rows: at the end point, columns: at the station.
    inner : ndarray of float64, shape (num_legs,)
        Length behind `image` [m]: zero but over an edge.
    front, rear : ndarray of float64, shape (num_legs, 3)
        The edge as the station, and as the end point, sees it [m, world]; NaN without one.
    front_velocity, rear_velocity : ndarray of float64, shape (num_legs, 3)
        Of these relative to the station and to the end point [m/s, world]; NaN without an edge.
    spread : ndarray of float64, shape (num_legs,)
        Largest error of the length to any antenna by taking the edge's wavefront, which has two radii, for a sphere
        [m].
    edge_length : ndarray of float64, shape (num_legs,)
        [m]; infinite without an edge.
    slope, end_slope : ndarray of complex128, shape (num_legs, 3, 2, 2)
        Change of `transfer` per metre along the axes of the station, and of the frame at the end points, by which an
        antenna there is off the middle [1/m]; zero if not asked for.
    """

    target: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int32]
    part: npt.NDArray[np.int64]
    face: npt.NDArray[np.int64]
    point: Array
    image: Array
    isometry: Array
    length: Array
    rate: Array
    acceleration: Array
    velocity: Array
    transfer: npt.NDArray[np.complex128]
    inner: Array
    front: Array
    rear: Array
    front_velocity: Array
    rear_velocity: Array
    spread: Array
    edge_length: Array
    slope: npt.NDArray[np.complex128]
    end_slope: npt.NDArray[np.complex128]

    @property
    def depth(self) -> npt.NDArray[np.int32]:
        """Number of interactions, shape (num_legs,)."""
        return np.count_nonzero(self.kind, axis=1).astype(np.int32)

    def select(self, index: npt.NDArray[np.bool_] | npt.NDArray[np.int64]) -> Legs:
        """Return the legs of a mask or an index."""
        return Legs(**{name: value[index] for name, value in vars(self).items()})


def chain_of(traced: TracedPaths, rows: npt.NDArray[np.bool_] | slice = slice(None)) -> Chain:
    """Return the mirrors and panes of traced paths."""
    kind = traced.kind[rows]
    return Chain(kind == SPECULAR, kind == REFRACTION, traced.normal[rows], traced.offset[rows])


def legs_of(
    state: WorldState,
    traced: TracedPaths,
    station: Station,
    ends: EndPoints,
    frequency: float,
    arm: float = 0.0,
) -> Legs:
    """Return the coherent ones of traced paths with their geometry in float64.

    Parameters
    ----------
    state : WorldState
    traced : TracedPaths
        From `station` to `ends`.
    station : Station
    ends : EndPoints
    frequency : float
        [Hz].
    arm : float
        Half of the distance over which slopes are taken [m]; 0: none.

    Returns
    -------
    Legs
        Sorted by target, depth, kinds, parts and points, without paths that nothing passes through, those that miss a
        plane or an edge in float64, and those that are there already.

    Raises
    ------
    MaterialRangeError
        If a material that is met has no data at this frequency.
    """
    scattered, bent = ((traced.kind == kind).any(axis=1) for kind in (DIFFUSE, DIFFRACTION))
    legs = _straight(state, traced, ~scattered & ~bent, (station, ends), frequency, arm)
    rows = np.flatnonzero(bent & ~scattered)
    if len(rows):
        over = [edge_leg(state, traced, int(row), station, ends, frequency) for row in rows]
        kept = [(row, leg) for row, leg in zip(rows, over, strict=True) if leg is not None]
        legs = joined_legs(
            [legs, _over_edges(traced, np.array([row for row, _ in kept], int), [leg for _, leg in kept])]
        )
    legs = legs.select(np.any(np.abs(legs.transfer) > 0.0, axis=(1, 2)))
    legs = legs.select(_first_of_equals(legs))
    return legs.select(_order(legs))


def _straight(
    state: WorldState,
    traced: TracedPaths,
    rows: npt.NDArray[np.bool_],
    link: tuple[Station, EndPoints],
    frequency: float,
    arm: float,
) -> Legs:
    """Return the legs of mirrors and panes only."""
    station, ends = link
    chain, target, part = chain_of(traced, rows), traced.target[rows], traced.part[rows]
    images = chain.images(ends.position[target])
    point, right = chain.vertices(station.position, images)
    known = sorted(set(state.world.parts.material))
    material = np.array([known.index(name) for name in state.world.parts.material], dtype=np.int64)
    coefficients = material_coefficients(
        [state.world.materials[name] for name in known], np.where(part >= 0, material[part], -1), frequency
    )

    def through(shift: Array, end_shift: Array) -> npt.NDArray[np.complex128]:
        way = chain.travel(station.position + shift, chain.images(ends.position[target] + end_shift))
        bases = spherical_basis(station.rotation, way[:, 0]), spherical_basis(ends.rotation, -way[:, -1])
        return transfer(chain, way, *bases, coefficients)

    slope, end_slope = np.zeros((2, len(target), 3, 2, 2), dtype=np.complex128)
    still = np.zeros(3)
    if arm and len(target):
        for k in range(3):
            step = arm * station.rotation[:, k]
            slope[:, k] = (through(step, still) - through(-step, still)) / (2.0 * arm)
            if ends.is_station:
                step = arm * ends.rotation[:, k]
                end_slope[:, k] = (through(still, step) - through(still, -step)) / (2.0 * arm)
    surfaces = state.point_velocity(part.ravel(), point.reshape(-1, 3)).reshape(point.shape)
    relative = chain.image_velocity(ends.velocity[target], surfaces) - station.velocity
    ahead = images[:, 0] - station.position
    length = np.linalg.norm(ahead, axis=1)
    rate = np.einsum("pi,pi->p", ahead, relative) / length
    across = np.maximum(np.einsum("pi,pi->p", relative, relative) - rate**2, 0.0)
    none = np.full((len(length), 3), np.nan)
    legs = Legs(
        target,
        traced.kind[rows],
        part,
        traced.face[rows],
        point,
        images[:, 0],
        chain.isometry(),
        length,
        rate,
        across / length,
        relative,
        through(still, still),
        inner=np.zeros_like(length),
        front=none,
        rear=none,
        front_velocity=none,
        rear_velocity=none,
        spread=np.zeros_like(length),
        edge_length=np.full_like(length, np.inf),
        slope=slope,
        end_slope=end_slope,
    )
    return legs.select(right)


def _over_edges(traced: TracedPaths, rows: npt.NDArray[np.int64], legs: Sequence[EdgeLeg]) -> Legs:
    """Return the legs over edges as one table."""
    count, width = len(rows), traced.kind.shape[1]
    shapes = {"point": (width, 3), "isometry": (3, 4), "transfer": (2, 2)} | dict.fromkeys(
        ("image", "front", "rear", "velocity", "front_velocity", "rear_velocity"), (3,)
    )
    columns = {
        item.name: np.array([getattr(leg, item.name) for leg in legs]).reshape(count, *shapes.get(item.name, ()))
        for item in fields(EdgeLeg)
    }
    none = np.zeros((count, 3, 2, 2), dtype=np.complex128)
    labels = {name: getattr(traced, name)[rows] for name in ("target", "kind", "part", "face")}
    return Legs(**labels, **columns, slope=none, end_slope=none)


def joined_legs(blocks: Sequence[Legs]) -> Legs:
    """Return the legs of all blocks in one."""
    return Legs(**{name: np.concatenate([getattr(block, name) for block in blocks]) for name in vars(blocks[0])})


def _order(legs: Legs) -> npt.NDArray[np.int64]:
    """Return the canonical order: target, depth, kinds, parts, points."""
    keys: list[npt.NDArray[Any]] = [legs.target, legs.depth]
    for column in (legs.kind, legs.part, legs.point):
        if column.size:
            keys.extend(np.reshape(column, (len(legs.length), -1)).T)
    return np.lexsort(keys[::-1])


def _first_of_equals(legs: Legs) -> npt.NDArray[np.bool_]:
    """Return which legs stay when each geometric path is to be there once.

    The engine tells candidates apart by rounded planes and takes whatever surface within a centimetre it then meets. So
    a reflection on the edge between two triangles, or where parts coincide, can come twice.
    """
    keep = np.ones(len(legs.length), dtype=bool)
    seen: dict[tuple[int, bytes], list[Array]] = {}
    for index, (target, kind, point) in enumerate(zip(legs.target, legs.kind, legs.point, strict=True)):
        others = seen.setdefault((int(target), kind.tobytes()), [])
        if any(np.abs(point - other).max(initial=0.0) < SAME_POINT for other in others):
            keep[index] = False
        else:
            others.append(point)
    return keep
