"""Where flat mirrors end: the outline of each, and which of it are free edges."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.order import side_by_side
from scarl_sionna.core.arrays.rows import row_max
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.engine.rays.cast import Target, cast_rays
from scarl_sionna.engine.rays.nearby import scene_near
from scarl_sionna.radar.optics.edges.fresnel_ends import across, edge_distances, edge_terms, fresnel_axes
from scarl_sionna.radar.optics.tubes.screens import Strips

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World, WorldState

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]
Index = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

SAME_CORNER = 1e-4
"""Corners of a mesh this near to each other are one [m]: the rounding of float32 meshes."""
ONE_LINE = 1e-5
"""Pieces whose directions agree within this are on one line [rad]."""
PIECE = 2.0
"""Edges are looked at in pieces no longer than this [m]."""
BESIDE = 0.03
"""What goes on this far beside an edge goes on at the edge [m]."""
ABOVE = 0.3
"""An edge over which something lies within this is no edge that a wave meets [m]."""
ONE_PLANE = 0.005
"""Mirrors whose normals differ by less may lie in one plane [rad]."""
GENTLE = 0.02
"""Surfaces that bend by less than this at an edge go on: facets of 3 m of a wall in a bend of 150 m [rad]."""
_NOT_BEYOND = -1
"""Of a point that is beyond no free edge."""
_TOGETHER = 128
"""Points that are compared with pieces of outlines together, more where these are few."""
_COMPARED = 1 << 14
"""Points times pieces that are compared together."""
_FRAME = 1024.0
"""Rays that find free edges are cast in frames this far apart [m], by where the mirror is alone: their rounding (0.06
mm) does not depend on where the radar is, nor on the time."""
IN_ONE_PLANE = 2e-3
"""Mirrors that are this near to the plane of another are in that plane [m]."""
STEEP = 0.7
"""What rises from an edge more steeply than this, as a cosine of the normals, goes on in the mirror's image: into a
corner and back there is no end."""


@dataclass(frozen=True, eq=False)
class Outline:
    """Straight pieces of the outlines of mirrors.

    Attributes
    ----------
    start, end : ndarray of float64, shape (num_pieces, 3)
        The mirror is to the left about its normal [m, world].
    out : ndarray of float64, shape (num_pieces, 3)
        Unit vectors in the plane, away from the mirror.
    owner : ndarray of int64, shape (num_pieces,)
        Number of the mirror.
    free : ndarray of bool, shape (num_pieces,)
        Whether nothing goes on there.
    """

    start: Array
    end: Array
    out: Array
    owner: Index
    free: Flags

    def take(self, rows: Index | Flags) -> Outline:
        """Return some pieces."""
        return Outline(*(column[rows] for column in vars(self).values()))

    @classmethod
    def joined(cls, blocks: Sequence[Outline]) -> Outline:
        """Return the pieces of all blocks."""
        points = np.zeros((0, 3))
        none = cls(points, points, points, np.zeros(0, np.int64), np.zeros(0, np.bool_))
        columns = zip(*(vars(one).values() for one in (none, *blocks)), strict=True)
        return cls(*(np.concatenate(column) for column in columns))


class FlatMirror(Protocol):
    """A flat region of a mesh: see :class:`~scarl_sionna.radar.channel.compose.mirrors.Mirror`."""

    @property
    def part(self) -> int:
        """Row of the part table."""

    @property
    def faces(self) -> Index:
        """Its triangles."""

    @property
    def corners(self) -> Array:
        """Of its triangles, (3 n, 3) [m]."""

    @property
    def normal(self) -> Array:
        """Unit normal."""

    @property
    def offset(self) -> float:
        """Normal . point [m]."""


def outline_of(corners: Array, normal: Array, number: int) -> Outline:
    """Return the outline of a flat mirror of triangles (n, 3, 3), all of it free.

    Edges of one triangle only are the outline; a triangle that is there twice, as in a sheet of two sides, counts once.
    """
    _, vertex = np.unique(np.round(corners.reshape(-1, 3) / SAME_CORNER), axis=0, return_inverse=True)
    faces, first = np.unique(np.sort(vertex.reshape(-1, 3), axis=1), axis=0, return_index=True)
    triangles, faces = corners[first], vertex.reshape(-1, 3)[first]
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    _, kind, count = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True, return_counts=True)
    single = np.flatnonzero(count[kind.ravel()] == 1)
    face, k = single // 3, single % 3
    start, end = triangles[face, k], triangles[face, (k + 1) % 3]
    side = np.cross(end - start, normal)
    turned = np.einsum("ij,ij->i", side, triangles[face, (k + 2) % 3] - start) > 0.0
    start, end = (np.where(turned[:, None], *pair) for pair in ((end, start), (start, end)))
    side[turned] *= -1.0
    length = np.linalg.norm(side, axis=1)
    kept = length > SAME_CORNER
    out = side[kept] / length[kept, None]
    return Outline(start[kept], end[kept], out, np.full(len(out), number), np.ones(len(out), np.bool_))


def in_pieces(outline: Outline, longest: float = PIECE) -> Outline:
    """Return the same outline in pieces of which none is longer than `longest` [m]."""
    side = outline.end - outline.start
    count = np.maximum(np.ceil(np.linalg.norm(side, axis=1) / longest), 1.0).astype(np.int64)
    row = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    found = outline.take(row)
    part = side[row] / count[row, None]
    start = found.start + step[:, None] * part
    return Outline(start, start + part, found.out, found.owner, found.free)


def with_free_edges(
    state: WorldState, outline: Outline, normal: Array, offset: Array, position: Array, thickness: float
) -> Outline:
    """Return an outline that says where nothing goes on.

    Three rays at the middle of each piece tell: beside the edge the plane may go on in another mesh, something steep
    may rise from it, or the edge may be buried. Things that move count as nothing and hide nothing, so what stands
    still has the same ends at all times.

    Parameters
    ----------
    state : WorldState
    outline : Outline
    normal, offset : ndarray of float64, shape (num_mirrors, 3) and (num_mirrors,)
        Planes of the mirrors by their numbers.
    position : ndarray of float64, shape (3,)
        On the side of the mirrors that counts [m, world].
    thickness : float
        What is this near to the plane lies in it [m].
    """
    count = len(outline.owner)
    if not count:
        return outline
    above = normal[outline.owner] * np.sign(normal @ position - offset)[outline.owner, None]
    middle = (outline.start + outline.end) / 2.0
    lift = 2.0 * thickness
    starts = [
        middle + BESIDE * outline.out + lift * above,
        middle - BESIDE * outline.out + lift * above,
        middle - BESIDE * outline.out + ABOVE * above,
    ]
    limits = np.repeat([lift + thickness, 2.0 * BESIDE, ABOVE - thickness], count)
    ray, face = _met_standing(state, np.concatenate(starts), np.concatenate([-above, outline.out, -above]), limits)
    kind, row = ray // count, ray % count
    facing = np.abs(np.einsum("ij,ij->i", state._triangles.normal[face], above[row]))
    goes_on = (kind == 0) & (facing > np.cos(GENTLE))
    rises = (kind == 1) & (facing < STEEP)
    free = np.ones(count, dtype=np.bool_)
    free[row[goes_on | rises | (kind == 2)]] = False
    return Outline(outline.start, outline.end, outline.out, outline.owner, free)


def _met_standing(state: WorldState, start: Array, direction: Array, limit: Array) -> tuple[Index, Index]:
    """Return which rays meet something that stands still nearer than their limit, and the face that each meets first.

    What moves is passed through. Behind it is looked from the limit backwards, so that what stands right behind it is
    not passed with it.
    """
    actor = state.world.parts.actor[state._triangles.part]
    scene = scene_near(state, _FRAME * np.round(start.mean(axis=0) / _FRAME), "optical")
    target = Target(scene, state._triangles, state.point_velocity)
    found = np.full(len(start), -1, dtype=np.int64)
    hits = cast_rays(target, start, direction, float(limit.max()))
    near = hits.distance < limit[hits.ray]
    moves = actor[hits.face] >= 0
    found[hits.ray[near & ~moves]] = hits.face[near & ~moves]
    rows = hits.ray[near & moves]
    left = limit.copy()
    while len(rows):  # the last one on the way back is the first on the way there
        hits = cast_rays(target, start[rows] + left[rows, None] * direction[rows], -direction[rows], float(limit.max()))
        met, before = rows[hits.ray], hits.distance < left[rows[hits.ray]]
        stands = before & (actor[hits.face] < 0)
        found[met[stands]] = hits.face[stands]
        rows = met[before]
        left[rows] -= hits.distance[before] + SAME_CORNER
    ray = np.flatnonzero(found >= 0)
    return ray, found[ray]


def merged(outline: Outline) -> Outline:
    """Return an outline in which pieces that go on straight, of one kind, are one."""
    side = outline.end - outline.start
    length = np.linalg.norm(side, axis=1)
    if not len(length):
        return outline
    along = side / length[:, None]
    place = np.einsum("ij,ij->i", outline.start, along)
    line = np.round(np.column_stack([along / ONE_LINE, (outline.start - place[:, None] * along) / SAME_CORNER]))
    kind = np.column_stack([outline.owner, outline.free])
    order = np.lexsort((place, *line.T, *kind.T))
    found, line, kind = outline.take(order), line[order], kind[order]
    same = (line[1:] == line[:-1]).all(axis=1) & (kind[1:] == kind[:-1]).all(axis=1)
    same &= np.abs(found.start[1:] - found.end[:-1]).max(axis=1) < SAME_CORNER
    first = np.flatnonzero(np.concatenate([[True], ~same]))
    last = np.concatenate([first[1:] - 1, [len(length) - 1]])
    return replace(found.take(first), end=found.end[last])


@dataclass(frozen=True, eq=False)
class Reflections:
    """Reflections at mirrors.

    Attributes
    ----------
    mirror : ndarray of int64, shape (num_points,)
        Number of each.
    point : ndarray of float64, shape (num_points, 3)
        Where it is, on the plane of the mirror [m, world].
    ray : ndarray of float64, shape (num_points, 3)
        Unit direction of the wave before or behind it.
    inverse : ndarray of float64, shape (num_points,)
        Sum of the inverse distances along the way to both of its ends [1/m].
    """

    mirror: Index
    point: Array
    ray: Array
    inverse: Array

    def take(self, rows: Index) -> Reflections:
        """Return some of them."""
        return Reflections(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True, eq=False)
class MirrorEnds:
    """The ends of all mirrors of a solve, and what they do to reflections.

    Attributes
    ----------
    state : WorldState
    mirrors : sequence of FlatMirror
        Their places are their numbers.
    position : ndarray of float64, shape (3,)
        On the side of the mirrors that counts [m, world].
    wavelength : float
        [m].
    knobs : MirrorSettings
        Its `end_reach`, in Fresnel units, is above 0.
    """

    state: WorldState
    mirrors: Sequence[FlatMirror]
    position: Array
    wavelength: float
    knobs: MirrorSettings

    def weight(self, at: Reflections) -> Complex:
        """Return the field of reflections over that of mirrors without end, shape (num_points,).

        Each point is taken to be on its mirror, or what lies in its plane beside it, unless a free edge is the nearest
        and the point beyond it: there its field belongs to the mirror whose edge that is, and farther than the reach
        there is none.
        """
        found = np.ones(len(at.mirror), dtype=np.complex128)
        for number, rows, some, near in self._pieces_near(at):
            if near.free.any():
                found[rows] = self._weight(number, near, some)
            elif not len(near.owner):  # no outline runs between them: all are on the side of the first
                owner, _ = self._beyond(number, self._outline(number), some.take(np.arange(1)))
                found[rows] = 1.0 if owner[0] == _NOT_BEYOND else 0.0
        return found

    def goes_on(self, at: Reflections) -> Flags:
        """Return which of some points beside their mirrors are near to a free edge of them, shape (num_points,)."""
        found = np.zeros(len(at.mirror), dtype=np.bool_)
        for number, rows, some, near in self._pieces_near(at, own=True):
            if not len(near.owner):
                continue
            height, distance = edge_distances(*self._seen(number, near, some))
            found[rows] = ((height < 0.0) & (distance < self.knobs.end_reach)).any(axis=1)
        return found

    def strips(self, number: int, at: Reflections, together: int = 1) -> Strips:
        """Return the strips beside a mirror over which reflections near to some may go on.

        So many points one after the other, `together`, bound those of one object.
        """
        pieces = self._outline(number)
        pieces = pieces.take((pieces.owner == number) & pieces.free)
        side = pieces.end - pieces.start
        length = np.linalg.norm(side, axis=1)
        along = side / length[:, None]

        def bounds(values: Array) -> tuple[Array, Array]:
            groups = values.reshape(len(values) // together, together, len(length))
            return groups.min(axis=1), groups.max(axis=1)

        offset = at.point[:, None] - pieces.start
        away = bounds(np.einsum("nmi,mi->nm", offset, pieces.out))
        place = bounds(np.einsum("nmi,mi->nm", offset, along))
        (_, width), (_, beyond) = (bounds(self._metres(number, at, axis)) for axis in (pieces.out, along))
        near = (away[0] < width) & (away[1] > -width) & (place[1] > -beyond) & (place[0] < length + beyond)
        used = near.any(axis=0)
        widest, longest = (np.where(near, column, 0.0).max(axis=0, initial=0.0) for column in (width, beyond))
        return Strips(*(column[used] for column in (pieces.start, along, pieces.out, length, longest, widest)))

    def across(self, number: int, at: Reflections) -> Array:
        """Return how far the sides of triangles reach across ends of a mirror, (num_triangles, 3) [Fresnel units].

        `at` are the reflections on the way to their corners, three of each. Only what is within the reach of an end
        counts.
        """
        outline, reach, count = self._outline(number), self.knobs.end_reach, len(at.mirror) // 3
        outline = outline.take(outline.free)
        found = np.zeros((count, 3))
        together = max(_TOGETHER, _COMPARED // max(len(outline.owner), 1))
        order = side_by_side(at.point[::3])
        for rows in np.array_split(order, -(-count // together)) if len(outline.owner) else []:
            some = at.take((3 * rows[:, None] + np.arange(3)).ravel())
            near = outline.take(self._may_be_near(number, outline, some))
            height, away = (one.reshape(len(rows), 3, -1) for one in edge_distances(*self._seen(number, near, some)))
            beside = np.sqrt(np.maximum(away**2 - height**2, 0.0)).min(axis=1, keepdims=True) < reach
            height = np.where(beside, np.clip(height, -reach, reach), 0.0)
            found[rows] = np.abs(np.roll(height, -1, axis=1) - height).max(axis=2, initial=0.0)
        return found

    @cached_property
    def _normal(self) -> Array:
        return np.array([mirror.normal for mirror in self.mirrors]).reshape(-1, 3)

    @cached_property
    def _groups(self) -> Index:
        """A number for each mirror, the same for those in one plane: together they have all free edges of them."""
        offset = np.array([mirror.offset for mirror in self.mirrors])
        found = np.arange(len(self.mirrors))
        for k, mirror in enumerate(self.mirrors):
            same = np.abs(self._normal[:k] @ mirror.normal) > 1.0 - ONE_PLANE**2 / 2.0
            same &= np.abs(self._normal[:k] @ mirror.corners[0] - offset[:k]) < IN_ONE_PLANE
            if same.any():
                found[k] = found[np.flatnonzero(same)[0]]
        return found

    @cached_property
    def _known(self) -> dict[int, Outline]:
        return {}

    def _outline(self, number: int) -> Outline:
        """Return the outline of a mirror, and the free edges of those in its plane."""
        if number not in self._known:
            group = np.flatnonzero(self._groups == self._groups[number]).tolist()
            pieces = Outline.joined([self._own_outline(one) for one in group])
            for one in group:
                self._known[one] = pieces.take((pieces.owner == one) | pieces.free)
        return self._known[number]

    def _own_outline(self, number: int) -> Outline:
        """Return the outline of a mirror alone; that of what stands still is found once for a world."""
        mirror, world, thickness = self.mirrors[number], self.state.world, self.knobs.thickness
        stands = world.parts.actor[mirror.part] < 0
        known = _standing.setdefault(world, {}) if stands else _moving.setdefault(self.state, {})
        normal, offset = self._normal[number : number + 1], np.array([mirror.offset])
        key = int(mirror.faces[0]), len(mirror.faces), float(np.sign(normal[0] @ self.position - offset[0])), thickness
        if key not in known:
            pieces = in_pieces(outline_of(mirror.corners.reshape(-1, 3, 3), normal[0], 0))
            known[key] = merged(with_free_edges(self.state, pieces, normal, offset, self.position, thickness))
        return replace(known[key], owner=np.full(len(known[key].owner), number))

    def _metres(self, number: int, at: Reflections, axis: Array) -> Array:
        """Return how far the reach is across straight edges, for each of n points, (n, m) [m].

        `axis`, (m, 3), are unit vectors in the plane across the edges.
        """
        normal = self._normal[number]
        axes = fresnel_axes(normal, at.ray, at.inverse, self.wavelength)
        edge, onward = (axes @ line.T for line in (np.cross(normal, axis), axis))
        area = np.abs(edge[:, 0] * onward[:, 1] - edge[:, 1] * onward[:, 0])
        return np.asarray(self.knobs.end_reach * np.hypot(edge[:, 0], edge[:, 1]) / np.maximum(area, 1e-12))

    def _pieces_near(self, at: Reflections, own: bool = False) -> Iterator[tuple[int, Index, Reflections, Outline]]:
        """Yield reflections at one mirror, some at a time, with the pieces that may be near to them, if any are.

        Of mirrors with free edges only; with `own` all of the pieces are free, and of that mirror.
        """
        for number in np.unique(at.mirror).tolist():
            outline = self._outline(number)
            if own:
                outline = outline.take(outline.free & (outline.owner == number))
            if not outline.free.any():
                continue
            there = np.flatnonzero(at.mirror == number)
            if own:
                there = there[self._may_reach(number, outline, at.take(there))]
            there = there[side_by_side(at.point[there])]
            together = max(_TOGETHER, _COMPARED // len(outline.owner))
            for rows in np.array_split(there, -(-len(there) // together)) if len(there) else []:
                some = at.take(rows)
                yield number, rows, some, outline.take(self._may_be_near(number, outline, some))

    def _may_reach(self, number: int, outline: Outline, at: Reflections) -> Flags:
        """Return which reflections may be within the reach of a piece, by the box about all of them."""
        ends = np.concatenate([outline.start, outline.end])
        away = row_max(np.maximum(ends.min(axis=0) - at.point, at.point - ends.max(axis=0))) - IN_ONE_PLANE
        return np.asarray(away < self._unit(at) / np.maximum(np.abs(at.ray @ self._normal[number]), 1e-6))

    def _unit(self, at: Reflections) -> Array:
        """Return the reach across the plane of incidence [m]; ahead it is more by the inverse cosine of incidence."""
        return np.asarray(self.knobs.end_reach / np.sqrt(2.0 * at.inverse / self.wavelength))

    def _may_be_near(self, number: int, outline: Outline, at: Reflections) -> Flags:
        """Return which pieces may be within the reach of some reflections, by a box along their rays."""
        normal = self._normal[number]
        cosine = at.ray @ normal
        along = at.ray - cosine[:, None] * normal
        along /= np.maximum(np.sqrt(np.einsum("ij,ij->i", along, along)), 1e-9)[:, None]
        total = along.sum(axis=0)
        ahead = total / max(float(np.linalg.norm(total)), 1e-9)
        side = across(normal, ahead)
        straight = along @ ahead
        turned = float(np.abs(along @ side).max()) if straight.min() > 0.0 else 1.0
        unit = self._unit(at)
        long = float((unit / np.maximum(np.abs(cosine), 1e-6)).max())
        found = np.ones(len(outline.owner), dtype=np.bool_)
        for axis, margin in ((ahead, long), (side, float(unit.max()) + turned * long)):
            place, start, end = at.point @ axis, outline.start @ axis, outline.end @ axis
            found &= (np.minimum(start, end) < place.max() + margin) & (np.maximum(start, end) > place.min() - margin)
        return found

    def _seen(self, number: int, pieces: Outline, at: Reflections) -> tuple[Array, Array]:
        """Return the ends of m pieces as n reflection points see them in the plane, (n, m, 2) [Fresnel units]."""
        axes = fresnel_axes(self._normal[number], at.ray, at.inverse, self.wavelength)
        here = np.einsum("nki,ni->nk", axes, at.point)[..., None]
        start, end = (np.moveaxis(axes @ points.T - here, 1, 2) for points in (pieces.start, pieces.end))
        return start, end

    def _weight(self, number: int, near: Outline, at: Reflections) -> Complex:
        term, height, _ = edge_terms(*self._seen(number, near.take(near.free), at), self.knobs.end_reach)
        total = np.asarray(1.0 - term.sum(axis=1))
        behind = np.flatnonzero((height < 0.0).any(axis=1))
        if len(behind):
            some = at.take(behind)
            owner, away = self._beyond(number, near, some)
            lost = np.flatnonzero(away >= self.knobs.end_reach)  # what is nearest may not be among those near
            if len(lost):
                owner[lost], _ = self._beyond(number, self._outline(number), some.take(lost))
            total[behind] = np.where(
                owner == _NOT_BEYOND, total[behind], np.where(owner == number, total[behind] - 1.0, 0.0)
            )
        return total

    def _beyond(self, number: int, pieces: Outline, at: Reflections) -> tuple[Index, Array]:
        """Return the mirror beyond whose free edge each point is, if the nearest piece is such; and how far that is."""
        side, away = edge_distances(*self._seen(number, pieces, at))
        nearest = (away - 1e-6 * np.abs(side)).argmin(axis=1)  # of two that meet there the one that turns its side
        line = np.arange(len(nearest))
        beyond = (side[line, nearest] < 0.0) & pieces.free[nearest]
        return np.where(beyond, pieces.owner[nearest], _NOT_BEYOND), away[line, nearest]


_Known: TypeAlias = "dict[tuple[int, int, float, float], Outline]"
"""Outlines of mirrors by their first face and number of faces, the side that counts, and the thickness."""
_standing: WeakKeyDictionary[World, _Known] = WeakKeyDictionary()
"""Of mirrors on parts that stand still."""
_moving: WeakKeyDictionary[WorldState, _Known] = WeakKeyDictionary()
"""Of mirrors on parts of actors."""
