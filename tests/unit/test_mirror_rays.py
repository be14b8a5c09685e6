"""Rays over mirrors in kernels meet what the same rays one leg after the other meet in NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.mirrors import DEFAULT_MIRRORS
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.rays.geometry import closest_in_triangles
from scarl_sionna.radar.channel.compose.mirror_legs import MirrorView
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.channel.multipath.mirror_faces import MirrorFaces
from scarl_sionna.radar.channel.multipath.mirror_rays import LIFT, MirrorRays
from tests.scenes import Thing, box, plane, write_scene

RADAR = RadarSpec()
PANES = [f"pane {number}" for number in range(6)]
CLOSE = 1e-3
"""Rays within this of an edge or of a limit [m] may be rounded to its other side."""


@pytest.fixture(
    scope="module", params=[(0.0, False), (3000.0, False), (0.0, True)], ids=["near", "far from the origin", "actor"]
)
def view(request, tmp_path_factory) -> MirrorView:
    """Two roads in one plane, two planes 4 mm apart, a marking on the seam, walls on both sides, six panes, a sign.

    Maybe a car, which has come from far away and drives askew beside a wall and over the road.
    """
    at, has_actor = request.param
    things = [
        Thing("road", plane(20.0, 8.0, (at + 10, 0, 0)), "Ground", "steel", is_object=False),
        Thing("on", plane(20.0, 8.0, (at + 30, 0, 0)), "Ground", "steel", is_object=False),
        Thing("crown", plane(20.0, 4.0, (at + 20, 2, 0.004)), "Ground", "steel", is_object=False),
        Thing("marking", plane(6.0, 0.3, (at + 20, -1, 0.006)), "RoadLine", "white", is_object=False),
        Thing("wall", box((40, 0.2, 5), (at + 20, 5, 2.5)), "Wall", "steel"),
        Thing("other", box((40, 0.2, 5), (at + 20, -5, 2.5)), "Wall", "steel"),
        *(Thing(name, plane(2.0, 2.0, (at + 15 + k, 2, 1), (-1, 0, 0))) for k, name in enumerate(PANES)),
        Thing("sign", box((0.1, 1.5, 1.5), (at + 25, 0, 1)), "TrafficSign", "steel"),
    ]
    way = {"kind": "waypoints", "times": [0, 1], "positions": [[at - 60, -42, 0.5], [at + 10, -2.5, 0.5]]}
    actors = [Thing("car", box((3.0, 1.5, 1.0)), "Car", "steel", trajectory=way)] * has_actor
    state = load_scene(write_scene(tmp_path_factory.mktemp("street"), things, actors)).at(1.0)
    pose, names = Pose([at, 0.3, 0.7]), state.world.parts.name
    mirrors = find_mirrors(state, [1, 2, 3, 5, 6], pose.position, RADAR.wavelength)
    thin = np.array([names.index(f"shape-{name}") for name in PANES])
    sign = state.world.parts.instance[names.index("shape-sign")]
    assert len(mirrors) >= 5
    return MirrorView(state, RADAR, state.as_mount(pose), (int(sign),), mirrors, DEFAULT_MIRRORS, thin)


def rays_of(view: MirrorView, count: int):
    """Return random mirrors, and points in their planes, on them and beside them."""
    rng = np.random.default_rng(1)
    number = rng.integers(len(view.mirrors), size=count)
    normal, offset = (
        np.array([getattr(mirror, name) for mirror in view.mirrors])[number] for name in ("normal", "offset")
    )
    end = view.station.position + rng.uniform((1.0, -6.0, -1.0), (42.0, 6.0, 5.0), (count, 3))
    end -= (np.einsum("ij,ij->i", end, normal) - offset)[:, None] * normal
    end[::50] = view.station.position  # no way to go
    return number, normal, offset, end


def cast(view: MirrorView, start, end):
    """Return directions, lengths and hits of rays to points, row by row: face -1 and infinitely far for none."""
    ahead = end - start
    length = np.linalg.norm(ahead, axis=1)
    ray = np.where(length[:, None] > LIFT, ahead / np.maximum(length, LIFT)[:, None], [1.0, 0.0, 0.0])
    hits = view.state.cast(start, ray)
    face, distance, point = np.full(len(end), -1), np.full(len(end), np.inf), np.zeros((len(end), 3))
    face[hits.ray], distance[hits.ray], point[hits.ray] = hits.face, hits.distance, hits.point
    return ray, length, face, distance, point


def may_be_rounded(view: MirrorView, start, end) -> bool:
    """Return whether the way between two points passes an edge, or meets a face where those count no more."""
    corners, length = view.state._triangles.corners, np.linalg.norm(end - start)
    ray = (end - start) / length
    first, along = corners - start, np.roll(corners, -1, axis=1) - corners
    first, along = (vector - (vector @ ray)[..., None] * ray for vector in (first, along))  # as seen along the way
    share = -np.einsum("nki,nki->nk", first, along) / np.maximum(np.einsum("nki,nki->nk", along, along), 1e-30)
    beside = np.linalg.norm(first + np.clip(share, 0.0, 1.0)[..., None] * along, axis=2)
    before_limit = start + (length - view.knobs.thickness) * ray
    return bool(beside.min() < CLOSE or closest_in_triangles(before_limit, corners)[0].min() < CLOSE)


def test_rays_to_mirrors_meet_what_belongs_to_them(view) -> None:
    """The rule of owners for each hit: no hit is left to a mirror too early, though others may own it."""
    number, normal, offset, end = rays_of(view, 40_000)
    met = view.rays.meet(view.station.position, end, number)
    _, length, face, distance, point = cast(view, np.broadcast_to(view.station.position, end.shape), end)
    faces: MirrorFaces = view.rays._faces
    hit, far = face >= 0, length > LIFT
    owner = np.where(hit, faces.owner(face, point, end), -1)
    np.testing.assert_array_equal(met.on, (owner == number) & far)
    np.testing.assert_array_equal(met.free, far & ~(distance < length - LIFT))
    height = np.abs(np.einsum("ij,ij->i", point, normal) - offset)
    np.testing.assert_array_equal(met.above, hit & (height > LIFT))
    assert 0.1 < met.on.mean() < 0.9 and met.free.mean() > 0.05 and met.above.any()
    several = hit & ((np.abs(point @ faces.normal.T - faces.offset) < faces.thickness).sum(axis=1) > 1)
    assert (several & met.on).sum() > 500 and (several & ~met.on & (height < faces.thickness)).sum() > 500


def test_pieces_change_nothing(view, monkeypatch) -> None:
    number, _, _, end = rays_of(view, 3000)
    start = np.broadcast_to(view.station.position, end.shape) + [0.0, 0.1, 0.1]
    whole = view.rays.meet(start, end, number), view.rays.reach(start, end)
    monkeypatch.setattr("scarl_sionna.radar.channel.multipath.mirror_rays.RAYS_PER_BATCH", 700)
    for one, other in zip(
        (*whole[0], whole[1]), (*view.rays.meet(start, end, number), view.rays.reach(start, end)), strict=True
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("has_owner", [False, True])
def test_rays_to_points_pass_some_panes_of_others(view, has_owner) -> None:
    """Up to four; not those of the points' own instance; the sign, which is owned, hides nothing."""
    rng = np.random.default_rng(2)
    end = view.station.position + rng.uniform((10.0, -4.0, -0.5), (35.0, 4.0, 3.0), (4000, 3))
    instances = [view.state.world.parts.instance[part] for part in view.thin]
    owner = rng.choice(instances, len(end)) if has_owner else None
    start = view.station.position
    found = view.rays.reach(start, end, owner)
    here, left, expected = np.broadcast_to(start, end.shape).copy(), np.full(len(end), 4), np.ones(len(end), bool)
    rows, gone, hidden_by = np.arange(len(end)), np.zeros(len(end)), np.full(len(end), -1)
    parts = view.state.world.parts
    while len(rows):
        ray, _, face, distance, _ = cast(view, here[rows], end[rows])
        length = np.linalg.norm(end[rows] - start, axis=1)
        part = view.state._triangles.part[face]
        before = (face >= 0) & (gone[rows] + distance < length - view.knobs.thickness)
        before &= ~np.isin(parts.instance[part], view.owned)
        pane = before & np.isin(part, view.thin) & (left[rows] > 0)
        if owner is not None:
            pane &= parts.instance[part] != owner[rows]
        expected[rows[before & ~pane]] = False
        hidden_by[rows[before & ~pane]] = part[before & ~pane]
        step = (distance + LIFT)[pane]
        rows, ray = rows[pane], ray[pane]
        gone[rows] += step
        here[rows] += step[:, None] * ray
        left[rows] -= 1
    for moving in view.state._part_motion:
        assert (hidden_by == moving).sum() > 100
    assert (left == 0).any() and 0.2 < expected.mean() < 0.9
    assert all(may_be_rounded(view, start, end[row]) for row in np.flatnonzero(found != expected))
    assert 0 < sum(may_be_rounded(view, start, point) for point in end[:500]) < 50  # few are excused


def test_actors_are_where_each_state_has_them(tmp_path) -> None:
    """A car has moved by less than what planes are trusted by: one a state, not one for all."""
    way = {"kind": "waypoints", "times": [0, 1], "positions": [[0, 0, 0], [0.005, 0, 0]]}
    road = Thing("road", plane(40.0, 8.0, (10, 0, 0)), "Ground", "steel", is_object=False)
    car = Thing("car", box((4.0, 1.5, 1.4), (12, 0, 0.75)), "Car", "steel", trajectory=way)
    world, pose = load_scene(write_scene(tmp_path, [road], [car])), Pose([0, 0, 0.7])
    views = []  # of all states at once
    for time in (0.0, 1.0):
        state = world.at(time)
        mirrors = find_mirrors(state, [1], pose.position, RADAR.wavelength)
        views.append(MirrorView(state, RADAR, state.as_mount(pose), (), mirrors, DEFAULT_MIRRORS))
        behind = 10.0 + 0.005 * time + np.array([0.9, 1.1]) * DEFAULT_MIRRORS.thickness
        end = np.array([(x, y, 0.7) for y in (0.0, 0.3) for x in behind])
        assert views[-1].rays.reach(pose.position, end).tolist() == [True, False] * 2
        assert len(mirrors) == 1


def test_without_mirrors_there_are_straight_ways(view) -> None:
    alone = MirrorView(view.state, RADAR, view.mount, (), (), DEFAULT_MIRRORS)
    assert isinstance(alone.rays, MirrorRays)
    points = view.station.position + np.array([[5.0, 0.0, 0.0], [24.0, 0.0, 0.0], [40.0, 0.0, -5.0], [0.0, 0.0, 0.0]])
    shown = alone.shows(np.zeros((4, 0), dtype=np.int64), points)
    np.testing.assert_array_equal(shown, [True, True, False, False])
