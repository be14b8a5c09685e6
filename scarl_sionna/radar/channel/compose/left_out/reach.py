"""The most that objects can send back, straight and over mirrors, by their boxes alone: no ray is cast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.boxes import CORNERS
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.auto import AutoSettings
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.compose.budget import WIDE_BOX, Estimate, cell_unit, view_width, world_from_box
from scarl_sionna.radar.channel.compose.mirrors import PRESELECTION_MARGIN, Mirror
from scarl_sionna.radar.channel.raycast.class_rcs import class_reflectivity
from scarl_sionna.signal.antenna import boresights, largest_field_gain

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

THICKNESS = DEFAULT_MIRRORS.thickness
"""What lies this near to a mirror's plane is not seen over it [m]."""
_PARALLEL = 1.0 - 1e-6
"""Cosine between normals from which on faces are the two sides of a wall: decides no accuracy."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes of instances in the world: `center` (n, 3), `rotation` (n, 3, 3) and `half` of the size (n, 3) [m]."""

    center: Array
    rotation: Array
    half: Array

    @classmethod
    def of(cls, state: WorldState, items: Sequence[Estimate]) -> Boxes:
        """Return the boxes of instances."""
        poses = [world_from_box(state, item.info) for item in items]
        return cls(
            np.array([pose.position for pose in poses]).reshape(-1, 3),
            np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
            np.array([item.info.size for item in items]).reshape(-1, 3) / 2.0,
        )

    @classmethod
    def about(cls, mirrors: Sequence[Mirror]) -> Boxes:
        """Return the boxes of mirrors along the axes of the world."""
        lower, upper, _ = _limits(mirrors)
        return cls((lower + upper) / 2.0, np.tile(np.eye(3), (len(lower), 1, 1)), (upper - lower) / 2.0)

    def take(self, rows: Sequence[int]) -> Boxes:
        """Return some of them."""
        return Boxes(*(column[list(rows)] for column in (self.center, self.rotation, self.half)))

    @cached_property
    def corners(self) -> Array:
        """Shape (n, 8, 3) [m]."""
        return np.asarray(
            self.center[:, None] + np.einsum("nij,nkj->nki", self.rotation, 2.0 * CORNERS * self.half[:, None])
        )

    @cached_property
    def radius(self) -> Array:
        """Of the spheres about them, shape (n,) [m]."""
        return np.sqrt(np.einsum("ij,ij->i", self.half, self.half))

    def seen_from(self, points: Array) -> tuple[Array, Array]:
        """Return distance [m] and projected area [m2] of each box from each point (k, 3), shapes (n, k)."""
        away = points[None] - self.center[:, None]
        local = np.einsum("nki,nij->nkj", away, self.rotation)
        over = np.maximum(np.abs(local) - self.half[:, None], 0.0)
        distance = np.sqrt(np.einsum("nki,nki->nk", over, over))
        sides = 4.0 * np.stack([self.half[:, i] * self.half[:, j] for i, j in ((1, 2), (0, 2), (0, 1))], axis=1)
        length = np.sqrt(np.einsum("nki,nki->nk", local, local))
        area = np.einsum("nki,ni->nk", np.abs(local), sides) / np.maximum(length, 1e-9)
        return np.maximum(distance, 1e-3), area

    def gaps(self) -> Array:
        """Return the least distances of the boxes' spheres from the other boxes, shape (n, n) [m]."""
        distance = self.seen_from(self.center)[0] - self.radius[None]
        return np.asarray(np.maximum(np.maximum(distance, distance.T), 0.0))


@dataclass(frozen=True, eq=False)
class MirrorWays:
    """Ways from a radar over mirrors.

    `last` has the number of the last mirror of each, shape (k,), `start` from where it is met (k, 3) [m], `image` the
    radar as it is seen behind it (k, 3) [m], `least` the length that no way is below (k,) [m], and `turn`, `shift` what
    brings a point to its ghost (k, 3, 3), (k, 3).
    """

    mirrors: Sequence[Mirror]
    last: npt.NDArray[np.int64]
    start: Array
    image: Array
    least: Array
    turn: Array
    shift: Array

    @classmethod
    def over_one(cls, mirrors: Sequence[Mirror], position: Array) -> MirrorWays:
        """Return the ways over each mirror."""
        normal, offset = _planes(mirrors)
        turn = np.eye(3) - 2.0 * normal[:, :, None] * normal[:, None, :]
        shift = 2.0 * offset[:, None] * normal
        start = np.broadcast_to(position, normal.shape)
        least = np.abs(normal @ position - offset)
        return cls(mirrors, np.arange(len(mirrors)), start, turn @ position + shift, least, turn, shift)

    def and_another(self, tail: float) -> MirrorWays:
        """Return the ways over each two mirrors of which the second can be met over the first, by their boxes."""
        there = self.reaches(Boxes.about(self.mirrors), tail)  # second mirror, first mirror
        np.fill_diagonal(there, False)
        second, first = np.nonzero(there)
        turn = self.turn[first] @ self.turn[second]
        shift = np.einsum("kij,kj->ki", self.turn[first], self.shift[second]) + self.shift[first]
        start = self.image[first]
        image = np.einsum("kij,kj->ki", self.turn[second], start) + self.shift[second]
        normal, offset = (column[second] for column in _planes(self.mirrors))
        least = np.maximum(self.least[first], np.abs(np.einsum("ki,ki->k", start, normal) - offset))
        return MirrorWays(self.mirrors, second, start, image, least, turn, shift)

    def reaches(self, boxes: Boxes, tail: float) -> Flags:
        """Return over which last mirror a box may be reached, shape (n, k).

        Reflections on their way to all points of a box lie in the convex hull of those to its corners. It may be
        reached if the box about that and the box about the mirror meet. What rises less than `THICKNESS` over the plane
        belongs to it. `tail` as of :func:`.beyond_ends`.
        """
        normal, offset = (column[self.last] for column in _planes(self.mirrors))
        lower, upper, extent = _limits(self.mirrors)
        height = np.einsum("ki,ki->k", self.start, normal) - offset
        side = np.sign(height)
        corners = boxes.corners.reshape(-1, 3)
        above = (corners @ normal.T - offset) * side  # (8 n, k)
        own = np.abs(height)[None]
        before = np.maximum(above, 0.0)
        share = own / np.maximum(own + before, 1e-12)
        foot = corners[:, None] + (before - above)[..., None] * (side[:, None] * normal)  # what is behind, on the plane
        image = self.start - 2.0 * height[:, None] * normal
        point = image + share[..., None] * (foot - image)
        margin = PRESELECTION_MARGIN * extent[self.last][None]
        if tail:
            gone = np.linalg.norm(point - self.start, axis=2)
            left = gone * before / np.maximum(own, 1e-12)
            unit = np.sqrt(gone * left / np.maximum(2.0 * (gone + left), 1e-12)) * gone / np.maximum(own, 1e-9)
            margin = np.maximum(margin, tail * unit.reshape(len(boxes.center), 8, -1).max(axis=1))
        points = point.reshape(len(boxes.center), 8, -1, 3)
        meets = (points.max(axis=1) >= lower[self.last] - margin[..., None]).all(axis=2)
        meets &= (points.min(axis=1) <= upper[self.last] + margin[..., None]).all(axis=2)
        some = (above.reshape(len(boxes.center), 8, -1) > THICKNESS).any(axis=1)
        return np.asarray(meets & some & (height != 0.0) & ~_backs(self.mirrors, self.start, self.last))


def _planes(mirrors: Sequence[Mirror]) -> tuple[Array, Array]:
    normal = np.array([mirror.normal for mirror in mirrors]).reshape(-1, 3)
    return normal, np.array([mirror.offset for mirror in mirrors])


def _backs(mirrors: Sequence[Mirror], start: Array, last: npt.NDArray[np.int64]) -> Flags:
    """Return which of some mirrors lies behind a parallel face of the same part that covers it: the back of a wall."""
    normal, offset = _planes(mirrors)
    lower, upper, _ = _limits(mirrors)
    part = np.array([mirror.part for mirror in mirrors])
    along = normal @ normal.T
    same = (np.abs(along) > _PARALLEL) & (part[:, None] == part)
    height = start @ normal.T - offset  # of each start over all mirrors
    own = np.take_along_axis(height, last[:, None], axis=1) * np.sign(along[last])
    apart = np.abs(own) - np.abs(height)
    before = (own * height > 0.0) & (apart > THICKNESS)
    margin = np.abs(normal)[None] * np.maximum(apart, 0.0)[..., None] + THICKNESS
    inside = (lower[last, None] >= lower[None] - margin) & (upper[last, None] <= upper[None] + margin)
    return np.asarray((same[last] & before & inside.all(axis=2)).any(axis=1))


def _limits(mirrors: Sequence[Mirror]) -> tuple[Array, Array, Array]:
    lower = np.array([mirror.corners.min(axis=0) for mirror in mirrors]).reshape(-1, 3)
    upper = np.array([mirror.corners.max(axis=0) for mirror in mirrors]).reshape(-1, 3)
    return lower, upper, np.array([mirror.extent for mirror in mirrors])


@dataclass(frozen=True, eq=False)
class Reach:
    r"""What a radar can have of objects by ways, each counted there and back.

    Attributes
    ----------
    most : ndarray of float64, shape (num_objects, num_ways)
        Of their bound.
    mean : ndarray of float64, shape (num_objects, num_ways)
        By the mean reflectivity of their class.

    Notes
    -----
    With the noise N of a cell, the antenna's field gain g over the length d of a way and the radar cross-section there
    at most,

    .. math:: b = \frac{g}{d} \left( \frac{P_t \lambda^2 \sigma}{(4 \pi)^3 N} \right)^{1/4}, \qquad
              \frac{P}{N} \le \left( \sum_i b_i \right)^4

    over all pairs of a way there and a way back: of different aspects a plate's cross-section is at most the geometric
    mean of :math:`\sigma_i = \min(4 \pi A_i^2 / \lambda^2, \pi d_i^2)`, and a mirror reflects no more than all.

    References
    ----------
    .. [1] M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed., 2001, Eq. (1.6) and section 8.2.
    """

    most: Array
    mean: Array

    def select(self, rows: Flags) -> Reach:
        """Return it with zeros where `rows`, (num_objects, num_ways), is false."""
        return Reach(np.where(rows, self.most, 0.0), np.where(rows, self.mean, 0.0))


@dataclass(frozen=True, eq=False)
class Looker:
    """A radar that looks at boxes; `limit` is half of the longest length [m]."""

    state: WorldState
    radar: RadarSpec
    pose: Pose
    limit: float
    rules: AutoSettings

    def straight(self, items: Sequence[Estimate], nearest: Array) -> Reach:
        """Return what objects in view send back straight, shape (num_objects, 1).

        `nearest` has their distances, where they are not those of their boxes (n,) [m].
        """
        seen = np.array([item.in_view for item in items], dtype=np.bool_)
        powers = np.array([(item.bound_db, item.expected_db) for item in items]).reshape(-1, 2)
        nearer = np.array([item.distance for item in items]) / nearest
        own = np.where(seen[:, None], 10.0 ** (powers / 40.0), 0.0) * np.stack([nearer**0.5, nearer], axis=1)
        return Reach(own[:, :1], np.minimum(own[:, :1], own[:, 1:]))

    def over(self, ways: MirrorWays, items: Sequence[Estimate], boxes: Boxes, tail: float) -> Reach:
        """Return what objects can send back by ways over mirrors."""
        shape = len(items), len(ways.last)
        most, mean = np.zeros(shape), np.zeros(shape)
        if not len(items) or not len(ways.last):
            return Reach(most, mean)
        apart, area = boxes.seen_from(ways.image)
        distance = np.maximum(apart, ways.least)  # also where the image is in a box
        inside = np.where(apart < ways.least, np.sort(boxes.half, axis=1)[:, 1, None], 0.0)
        straight = np.array([item.distance if item.in_view else np.inf for item in items])
        ghost = np.einsum("kij,nj->nki", ways.turn, boxes.center) + ways.shift - self.pose.position
        shown = ways.reaches(boxes, tail) & (np.minimum(distance, (straight[:, None] + distance) / 2.0) < self.limit)
        shown &= self._in_view(ghost, boxes.radius[:, None])
        row, way = np.nonzero(shown)
        gain = self._gain(ways, boxes, row, way, ghost[row, way])
        wide = np.array([view_width(self.radar, item.info) for item in items])[row]
        d = distance[row, way]
        a = np.minimum(area[row, way], np.minimum(wide * d, self._solid_angle * d**2))
        semantic = np.array([item.info.semantic for item in items])[row]
        class_mean = np.asarray(class_reflectivity())[semantic] * a
        flat = np.minimum(4.0 * np.pi * a**2 / self.radar.wavelength**2, np.pi * d**2)
        coherent = np.array([item.is_coherent for item in items])[row]
        largest = np.where(coherent, flat, class_mean * 10.0 ** (self.rules.speckle_db / 10.0))
        field = gain * cell_unit(self.radar) ** 0.25
        most[row, way] = field / d * largest**0.25
        mean[row, way] = field / np.maximum(d, inside[row, way]) * np.minimum(class_mean, largest) ** 0.25
        return Reach(most, mean)

    @property
    def _solid_angle(self) -> float:
        """Of the field of view [sr]: what is rough sends back no more than what fills it at the least distance."""
        azimuth, elevation = np.radians([self.radar.azimuth_fov_deg, self.radar.elevation_fov_deg])
        return float(2.0 * azimuth * np.sin(min(elevation, np.pi) / 2.0))

    def _in_view(self, ghost: Array, radius: Array) -> Flags:
        """Return which spheres may be in the field of view, by their middles relative to the radar."""
        local = ghost @ self.pose.rotation
        far = np.maximum(np.sqrt(np.einsum("...i,...i->...", local, local)), 1e-9)
        spread = np.where(far > radius, np.arcsin(np.minimum(radius / far, 1.0)), np.pi)
        azimuth = np.abs(np.arctan2(local[..., 1], local[..., 0])) - spread
        elevation = np.abs(np.arcsin(np.clip(local[..., 2] / far, -1.0, 1.0))) - spread
        fov = np.radians([self.radar.azimuth_fov_deg, self.radar.elevation_fov_deg]) / 2.0
        return np.asarray((azimuth <= fov[0]) & (elevation <= fov[1]))

    def _gain(
        self,
        ways: MirrorWays,
        boxes: Boxes,
        row: npt.NDArray[np.int64],
        way: npt.NDArray[np.int64],
        ghost: Array,
    ) -> Array:
        """Return the antenna's largest field gain over ghosts of boxes; as `estimate` does for what is wide."""
        array = self.radar.array
        corners = np.concatenate([boxes.corners, boxes.center[:, None]], axis=1)[row]
        local = np.einsum("pij,pkj->pki", ways.turn[way], corners) + (ways.shift[way] - self.pose.position)[:, None]
        gain = largest_field_gain(array, local @ self.pose.rotation).max(axis=1, initial=0.0)
        far, radius = np.linalg.norm(ghost, axis=1), boxes.radius[row]
        wide = (far <= radius) | (radius > np.sin(WIDE_BOX) * far)
        return np.asarray(np.where(wide, float(largest_field_gain(array, boresights(array)).max()), gain))
