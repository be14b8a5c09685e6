"""What a radar sees of each object, straight and over mirrors, and which reflections can change its echo.

A few rays to points of each object tell how much of it each way shows, image theory how strong the way is. What the
paths then say counts more than what was planned: :func:`as_found`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.settings.auto import DEFAULT_AUTO, AutoSettings
from scarl_sionna.core.settings.plan import ChannelPlan
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel.band_mean import NUM_FREQUENCIES, mean_power
from scarl_sionna.radar.optics.viewpoint import Viewpoint
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.signal.antenna import largest_field_gain

from .budget import Surface, box_points
from .expected_error import owners
from .mirror_legs import MirrorView
from .mirrors import Mirror, Way, mirrored, reaches_over

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Sight:
    """An object by one way.

    Attributes
    ----------
    share : float
        Of the points on its faces, those that the radar sees; that of a convex body is about a half.
    field : float
        Gain of the antenna's field, times the reflection coefficient, over the length of the way, mean over the points
        that are seen [1/m].
    nearest : float
        Shortest way to a point that is seen [m]; infinite if none is.
    turning : float
        By which the tubes of further bounces grow, see :class:`.TubeEstimate`; 0 where nothing is seen straight.
    onward : float
        Of the points that are seen straight, those that reflect the wave on to another object.
    """

    share: float
    field: float
    nearest: float
    turning: float = 0.0
    onward: float = 0.0


HIDDEN = Sight(0.0, 0.0, np.inf)
_NEARER = 0.25
"""Surfaces may be this much nearer than the points that stand for them [m]: what is left out by mistake jumps, what is
looked at in vain costs some tubes."""
WHOLE_SHARE = 1.0 / 64.0
"""A mirror that shows less than this share of an object's faces counts by less than its field, one that shows less than
a quarter of it not at all: so it comes and goes smoothly, though few probes see it. docs/accuracy.md, jumps."""
_SOON = 0.1
"""Planned weight from which on a reflection counts by what it is found to change; below it comes smoothly."""
_LIFT = 1e-4
"""Rays start this far above a face [m]: a guard against the rounding of float32 hits."""
CLOSER = 16
"""Where few probes meet an object over a mirror, so many times as many look again: one of them more or less then
changes a field by at most a thirtieth."""


@dataclass(frozen=True)
class Change:
    """What one mirror can do to an object.

    Attributes
    ----------
    change_db : float
        Largest rise of the object's power [dB]; a fade can be deeper. Infinite where only the mirror shows the object.
    field : float
        Of :class:`Sight` [1/m].
    mirror : Mirror
    weight : float
        By which fields over the mirror count, 0 to 1: below 1 where it shows hardly anything of the object, or is
        hardly strong enough to matter.
    """

    change_db: float
    field: float
    mirror: Mirror
    weight: float = 1.0


def sights(
    view: MirrorView, surfaces: Mapping[int, Surface], rules: AutoSettings = DEFAULT_AUTO
) -> Mapping[int, list[Sight]]:
    """Return what the radar sees of objects: straight, then over each of the view's mirrors.

    Parameters
    ----------
    view : MirrorView
        With nothing owned: all objects hide each other.
    surfaces : mapping
        The faces of each object, by its instance id.
    rules : AutoSettings
        Its `num_probes` points stand for each object; `CLOSER` times as many where few of them are seen over a mirror.

    Raises
    ------
    MaterialRangeError
        If a mirror's material has no data in the middle of the band.
    """
    position = view.mount.pose.position
    numbers = list(surfaces)
    boxes = [box_points(view.state, number) for number in numbers]
    all_ways: list[Way] = [(), *((mirror,) for mirror in view.mirrors)]
    found = {number: [HIDDEN] * len(all_ways) for number in numbers}
    faces = np.zeros(max(view.state.world.instances, default=0) + 1)
    open_to = _open_to(all_ways[1:], position, boxes, view.tail)
    faces[numbers] = [len(surface.corners) ** rules.tubes.spread for surface in surfaces.values()]
    images = [mirrored(way, position) for way in all_ways]
    for depth, first, last in ((0, 0, 1), (1, 1, len(all_ways))):
        looks: list[Look] = []
        for number, is_open in zip(numbers, open_to[first:last].T, strict=True):
            places = (first + np.flatnonzero(is_open)).tolist()
            all_points = surfaces[number].lit_from([images[place] for place in places], rules.num_probes)
            looks += [Look(number, place, lit) for place, lit in zip(places, all_points, strict=True)]
        for look, sight in zip(looks, _seen(view, looks, depth, faces), strict=True):
            found[look.number][look.place] = sight
    closer = []
    for number, surface in surfaces.items():
        for place, way in enumerate(all_ways):
            if way and 0.0 < found[number][place].share < 2.0 * WHOLE_SHARE:
                points = surface.lit_points(images[place], CLOSER * rules.num_probes)
                closer.append(Look(number, place, points))
    for look, sight in zip(closer, _seen(view, closer, 1, faces), strict=True):
        found[look.number][look.place] = sight
    return found


class Look(NamedTuple):
    """An object that may be seen by a way."""

    number: int
    """Instance id."""
    place: int
    """0 straight, k over the mirror with the number k - 1."""
    points: Array
    """On the faces that the way lights, shape (num_points, 3) [m, world]."""


def _open_to(over: Sequence[Way], position: Array, boxes: Sequence[Array], tail: float) -> npt.NDArray[np.bool_]:
    """Return which boxes, each of as many points, the straight way and ways over one mirror each may reach.

    Shape (1 + num_ways, num_boxes).
    """
    found = np.ones((1 + len(over), len(boxes)), dtype=np.bool_)
    if over and boxes:
        points = reaches_over(over, position, np.concatenate(boxes), tail)
        found[1:] = points.reshape(len(over), len(boxes), -1).any(axis=2)
    return found


def _seen(view: MirrorView, looks: Sequence[Look], depth: int, faces: Array) -> list[Sight]:
    """Return what ways over as many mirrors show of objects, by points on their surfaces; `faces` as of `_turns`."""
    if not looks:
        return []
    pose = view.mount.pose
    size = np.array([len(look.points) for look in looks])
    points = np.concatenate([look.points for look in looks])
    owner, place = (np.repeat(np.array([look[k] for look in looks], dtype=np.int64), size) for k in (0, 1))
    ways = np.repeat(place[:, None] - 1, depth, axis=1)
    rows = np.flatnonzero(Viewpoint.of(view.radar, pose, np.zeros(3)).sees(view.chain(ways).images(points)[:, 0]))
    rows = rows[view.shows(ways[rows], points[rows], owner[rows])]
    leg = view.leg(ways[rows], np.eye(3), points[rows], np.zeros((len(rows), 3)))
    ahead = leg.image - pose.position
    length = np.sqrt(np.einsum("ij,ij->i", ahead, ahead))
    strength = largest_field_gain(view.radar.array, ahead @ pose.rotation) / np.maximum(length, 1e-3)
    strength = strength * _largest_gain(leg.jones) * np.abs(leg.weight)
    turns, onward = np.zeros((2, len(rows))) if depth else _turns(view, points[rows], faces)
    borders = np.searchsorted(rows, np.concatenate([[0], np.cumsum(size)]))
    return [
        _sight(strength[first:last], length[first:last], count, turns[first:last], onward[first:last])
        for first, last, count in zip(borders[:-1], borders[1:], size, strict=True)
    ]


def _turns(view: MirrorView, points: Array, faces: Array) -> tuple[Array, Array]:
    """Return the entries in `faces` of what stands at points and of what the wave goes on to, multiplied, shape (n,).

    And 1 where that is another object, else 0. `faces` has the number of faces of each object, to the power of
    `spread`, by its instance id; 0 for all else.
    """
    state, start = view.state, view.mount.pose.position
    ray = points - start
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    first = state.cast(np.broadcast_to(start, ray.shape), ray)
    slope = np.einsum("ij,ij->i", ray[first.ray], first.normal)[:, None]
    ray = ray[first.ray] - 2.0 * slope * first.normal
    second = state.cast(first.point - _LIFT * np.sign(slope) * first.normal, ray)
    found, onward = np.zeros((2, len(points)))
    instance, row = state.world.parts.instance, first.ray[second.ray]
    here, there = instance[first.part[second.ray]], instance[second.part]
    found[row] = faces[here] * faces[there]
    onward[row] = (found[row] > 0.0) & (here != there)
    return found, onward


def _largest_gain(jones: npt.NDArray[np.complex128]) -> Array:
    """Return the larger singular value of 2 x 2 matrices, shape (n,): their gain for the best polarisation."""
    total = np.sum(jones.real**2 + jones.imag**2, axis=(1, 2))
    product = np.abs(jones[:, 0, 0] * jones[:, 1, 1] - jones[:, 0, 1] * jones[:, 1, 0])
    return np.asarray(np.sqrt(0.5 * (total + np.sqrt(np.maximum(total**2 - 4.0 * product**2, 0.0)))))


def _sight(strength: Array, length: Array, count: int, turns: Array, onward: Array) -> Sight:
    """Return an object by the points that are seen, of `count`, and what they turn the wave to."""
    if not len(length):
        return HIDDEN
    share, nearest = len(length) / count, float(length.min())
    return Sight(share, float(strength.mean()), nearest, float(turns.mean()), float(onward.mean()))


def changes(
    seen: Sequence[Sight],
    mirrors: Sequence[Mirror],
    reach: float,
    least_db: float = DEFAULT_AUTO.smallest_change_db,
    tolerance_db: float = DEFAULT_AUTO.smallest_change_db,
) -> list[Change]:
    r"""Return what mirrors can do to an object, the largest change first.

    Parameters
    ----------
    seen : sequence of Sight
        Straight, then over each mirror.
    mirrors : sequence of Mirror
    reach : float
        Half of the longest length, of a way there and a way back together [m].
    least_db : float
        Reflections that change an object by more than this count [dB], above 0.
    tolerance_db : float
        So do those that would if the part they show were all of it that shines, by more than this [dB], above 0.

    Notes
    -----
    By image theory each of the two legs has a second way, whose field is

    .. math:: \rho = |\Gamma| \sqrt{1 - S^2} \; \frac{g_m}{g} \; \frac{d}{d_m}

    of the straight one (larger of the two polarisations; gains and lengths g and d, those over the mirror with the
    index m), times the part of the object that it shows relative to the straight one, so the echo changes by at most
    :math:`40 \log_{10}(1 + \rho)`. The two-ray law is that of M. I. Skolnik, *Introduction to Radar Systems*, 3rd ed.,
    2001, section 8.2.

    The part that a mirror shows may be what shines: the foot of a post, where it makes a corner with the ground. So the
    change without regard to the part counts, too. The weight rises from 0 to 1 where the part goes from a quarter of
    `WHOLE_SHARE` to all of it, and where a change goes from half of its limit to that.
    """
    found, straight = [], seen[0]
    for sight, mirror in zip(seen[1:], mirrors, strict=True):
        if sight.share == 0.0 or (min(straight.nearest, sight.nearest) + sight.nearest) / 2.0 >= reach + _NEARER:
            continue
        rise = most = np.inf
        if straight.share > 0.0 and straight.field > 0.0:
            ratio = sight.field / straight.field
            rise, most = (
                float(40.0 * np.log10(1.0 + ratio * part)) for part in (min(sight.share / straight.share, 1.0), 1.0)
            )
        weight = max(_rising(2.0 * rise / least_db - 1.0), _rising(2.0 * most / tolerance_db - 1.0))
        weight *= _rising((4.0 * sight.share / WHOLE_SHARE - 1.0) / 3.0)
        if weight > 0.0 and sight.field > 0.0:
            found.append(Change(rise, sight.field, mirror, weight))
    return sorted(found, key=lambda change: (-change.change_db, -change.field, change.mirror.number))


def as_found(plan: ChannelPlan, paths: RadarPaths, radar: RadarSpec, least_db: float) -> tuple[ChannelPlan, RadarPaths]:
    r"""Return a plan and its paths with reflections that change an object by more than was expected as a whole.

    Parameters
    ----------
    plan : ChannelPlan
        Whose reflections have weights from 0 to 1.
    paths : RadarPaths
        That it has made.
    radar : RadarSpec
    least_db : float
        Reflections that are found to change an object by more than this count as a whole [dB], above 0.

    Notes
    -----
    Image theory, which the weights are planned by, takes an object to be as bright towards a mirror as towards the
    radar. With the sum A of the paths of an object without a mirror, and B of those over it, both without the weight,
    and the mean over the band, the mirror changes the echo by up to

    .. math:: 20 \log_{10}\left(1 + \sqrt{\langle|B|^2\rangle / \langle|A|^2\rangle}\right)
    """
    legs = _Legs(paths, [int(item) for share in plan.shares if share.solver == "sbr" for item in share.instances])
    scale, shares = np.ones(paths.num_paths), []
    for share in plan.shares:
        over = []
        for reflection in share.reflections if share.solver == "sbr" else ():
            weights = np.array(reflection.weights).reshape(-1, len(reflection.mirrors))
            for row, place in np.argwhere((weights > 0.0) & (weights < 1.0)).tolist():
                planned, item = float(weights[row, place]), int(reflection.instances[row])
                times = legs.over(item, int(reflection.mirrors[place]))
                change = _change_db(paths, radar, np.flatnonzero(legs.first == item), times, planned)
                found = _rising(planned / _SOON) * _rising(2.0 * change / least_db - 1.0)
                weights[row, place] = max(planned, found)
                scale *= (weights[row, place] / planned) ** times
            over.append(replace(reflection, weights=tuple(tuple(row) for row in weights.tolist())))
        shares.append(replace(share, reflections=tuple(over)) if over else share)
    if np.all(scale == 1.0):
        return plan, paths
    return replace(plan, shares=tuple(shares)), paths.scaled(scale)


class _Legs:
    """Over which mirrors the ways of paths go to the first of some objects, and from the last."""

    def __init__(self, paths: RadarPaths, numbers: Sequence[int]) -> None:
        self.instance = paths.instance
        self.first, self.last = owners(paths, numbers), owners(paths, numbers, last=True)
        own = np.isin(paths.instance, numbers)
        self.before = np.cumsum(own, axis=1) == 0
        self.behind = np.cumsum(own[:, ::-1], axis=1)[:, ::-1] == 0

    def over(self, item: int, mirror: int) -> npt.NDArray[np.int64]:
        """Return how many of the two ways of each path lead from or to an object over a mirror, shape (num_paths,)."""
        here = self.instance == mirror
        there = (self.first == item) & (here & self.before).any(axis=1)
        back = (self.last == item) & (here & self.behind).any(axis=1)
        return there.astype(np.int64) + back


def _change_db(
    paths: RadarPaths, radar: RadarSpec, rows: npt.NDArray[np.int64], legs: npt.NDArray[np.int64], weight: float
) -> float:
    """Return by how much paths over a mirror change an object [dB]: `rows` are its paths, `legs` their ways over it."""
    own, legs = paths.select(rows), legs[rows]
    own = replace(own, a=own.a / weight ** legs[:, None, None])
    group = (legs > 0).astype(np.int64)
    without, over = mean_power(own, radar, np.arange(len(rows)), group, 2, NUM_FREQUENCIES)
    return float(20.0 * np.log10(1.0 + np.sqrt(over / max(without, 1e-300))))


def _rising(place: float) -> float:
    """Return a number that rises smoothly from 0 to 1 between the places 0 and 1."""
    t = float(np.clip(place, 0.0, 1.0))
    return t * t * (3.0 - 2.0 * t)
