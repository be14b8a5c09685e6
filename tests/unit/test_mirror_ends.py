"""Which edges of mirrors are ends, and Fresnel's integral over outlines."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.special import fresnel

from scarl_sionna.core.errors import ScarlError
from scarl_sionna.core.settings.mirrors import MirrorSettings
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel.compose.mirrors import find_mirrors
from scarl_sionna.radar.channel.multipath.mirror_ends import MirrorEnds, Reflections
from scarl_sionna.radar.optics.edges.fresnel_ends import beyond_straight_end, edge_terms
from tests.scenes import Thing, box, plane, write_scene

WAVELENGTH, RADAR = 0.004, np.array([5.0, 0.5, 2.0])


def test_over_a_rectangle_it_is_the_product_of_two_fresnel_integrals() -> None:
    """At random points on it and beside it; what is left is corners 4 units away taken as infinitely far, 2e-3 each."""
    lower, upper = np.array([-2.0, -1.5]), np.array([3.0, 2.5])
    outline = np.array([lower, [upper[0], lower[1]], upper, [lower[0], upper[1]]])
    for point in np.random.default_rng(0).uniform(-4.0, 5.0, (50, 2)):
        term, _, _ = edge_terms(outline - point, np.roll(outline, -1, axis=0) - point, 100.0)
        found = float(((lower < point) & (point < upper)).all()) - term.sum()
        sides = [np.diff(fresnel([low - x, high - x]))[:, 0] for low, high, x in zip(lower, upper, point, strict=True)]
        expected = np.prod([cosine - 1j * sine for sine, cosine in sides]) / (1.0 - 1j) ** 2
        assert abs(found - expected) < 4e-3


def test_a_straight_end_halves_the_field_and_both_sides_are_one() -> None:
    assert beyond_straight_end(0.0) == 0.5
    assert beyond_straight_end(1.3) + beyond_straight_end(-1.3) == pytest.approx(1.0, abs=1e-15)
    assert abs(beyond_straight_end(5.0)) == pytest.approx(1.0 / (np.sqrt(2.0) * np.pi * 5.0), rel=1e-3)


def ends_of(tmp_path, things) -> MirrorEnds:
    """Return the ends of those mirrors of some things that are at the height 0."""
    state = load_scene(write_scene(tmp_path, things)).at(0.0)
    found = find_mirrors(state, list(range(1, 1 + len(things))), RADAR, WAVELENGTH)
    top = [mirror for mirror in found if np.abs(mirror.corners[:, 2]).max() < 1e-3]
    return MirrorEnds(state, top, RADAR, WAVELENGTH, MirrorSettings())


def free_at(ends: MirrorEnds, point) -> bool:
    """Return whether a free edge goes through a point of a mirror's outline."""
    pieces = [ends._outline(number) for number in range(len(ends.mirrors))]
    for outline in pieces:
        side = outline.end - outline.start
        share = np.einsum("ij,ij->i", point - outline.start, side) / np.einsum("ij,ij->i", side, side)
        near = np.linalg.norm(outline.start + np.clip(share, 0, 1)[:, None] * side - point, axis=1) < 1e-3
        if (near & outline.free).any():
            return True
    return False


def test_an_end_is_where_nothing_goes_on(tmp_path) -> None:
    """A road with a second one beside it, a wall on its side, a kerb of 12 cm down at its end, a block on its start."""
    things = [
        Thing("road", box((10.0, 4.0, 0.2), (5.0, 0.0, -0.1)), "Roads", "steel", is_object=False),
        Thing("beside", box((10.0, 4.0, 0.2), (5.0, -4.0, -0.1)), "Roads", "steel", is_object=False),
        Thing("wall", box((10.0, 0.2, 3.0), (5.0, 2.1, 1.5)), "Wall", "steel"),
        Thing("lower", plane(20.0, 20.0, (20.0, 0.0, -0.12)), "Ground", "steel", is_object=False),
        Thing("block", box((0.5, 4.0, 0.1), (0.2, 0.0, 0.05)), "Static", "steel"),
    ]
    ends = ends_of(tmp_path, things)
    assert free_at(ends, np.array([10.0, 0.3, 0.0]))  # down to the lower ground
    assert free_at(ends, np.array([4.3, -6.0, 0.0]))  # the outer side of the two roads
    assert not free_at(ends, np.array([4.3, -2.0, 0.0]))  # the seam of the two roads
    assert not free_at(ends, np.array([4.3, 2.0, 0.0]))  # the foot of the wall
    assert not free_at(ends, np.array([0.0, 0.3, 0.0]))  # below the block


def test_two_tiles_have_the_ends_of_one(tmp_path) -> None:
    """Points along the outer side of two roads that touch: the weight does not know the seam, and no tail is twice."""
    whole = [Thing("road", box((10.0, 4.0, 0.2), (5.0, 0.0, -0.1)), "Roads", "steel", is_object=False)]
    halves = [
        Thing(name, box((5.0, 4.0, 0.2), (x, 0.0, -0.1)), "Roads", "steel", is_object=False)
        for name, x in (("first", 2.5), ("second", 7.5))
    ]
    one, two = ends_of(tmp_path / "one", whole), ends_of(tmp_path / "two", halves)
    point = np.array([(x, y, 0.0) for x in np.linspace(4.03, 6.03, 21) for y in (1.9, 1.97, 2.0, 2.05, 2.12)])
    ray, inverse = np.tile([0.6, 0.0, -0.8], (len(point), 1)), np.full(len(point), 0.2)

    def weight(ends: MirrorEnds, number: int) -> np.ndarray:
        return ends.weight(Reflections(np.full(len(point), number), point, ray, inverse))

    expected = weight(one, 0)
    first = next(k for k, mirror in enumerate(two.mirrors) if mirror.corners[:, 0].min() < 1.0)
    both = np.array([weight(two, first), weight(two, 1 - first)])
    on = point[:, 1] <= 2.0
    owner = np.where(point[:, 0] < 5.0, 0, 1)
    assert both[owner, np.arange(len(point))][on] == pytest.approx(expected[on], abs=2e-3)
    assert both[:, ~on].sum(axis=0) == pytest.approx(expected[~on], abs=2e-3)
    assert (both[:, ~on] == 0.0).any(axis=0).all()


def test_a_weight_does_not_depend_on_what_else_is_asked_for(tmp_path) -> None:
    """A pavement with a notch, and kerb stones along its side, too narrow for mirrors: over them the plane goes on.

    Asked for alone, a point over a stone has no end near it; together with one beside the notch, beyond whose line it
    is, too, it has to have the same weight.
    """
    sizes = [((10.0, 3.0, 0.2), (5.0, -0.5, -0.1)), *(((4.0, 1.0, 0.2), (x, 1.5, -0.1)) for x in (2.0, 8.0))]
    pavement = trimesh.util.concatenate([box(*one) for one in sizes])
    stones = trimesh.util.concatenate([box((4.0, 0.06, 0.2), (x, 2.03, -0.1)) for x in (2.0, 8.0)])
    things = [
        Thing(name, mesh, "SideWalks", "steel", is_object=False) for name, mesh in (("a", pavement), ("b", stones))
    ]
    ends = ends_of(tmp_path, things)
    assert len(ends.mirrors) == 1
    assert not free_at(ends, np.array([2.3, 2.0, 0.0])) and free_at(ends, np.array([5.3, 1.0, 0.0]))
    point = np.array([(2.0, 2.02), (5.0, 1.03), (5.0, 0.95), (9.0, 2.05), (5.0, 1.3), (12.0, 0.0)])
    point = np.column_stack([point, np.zeros(6)])
    at = Reflections(np.zeros(6, np.int64), point, np.tile([0.6, 0.0, -0.8], (6, 1)), np.full(6, 0.2))
    together = ends.weight(at)
    assert together == pytest.approx(np.concatenate([ends.weight(at.take(np.array([k]))) for k in range(6)]), abs=1e-12)
    assert abs(together[[0, 3]] - 1.0).max() < 0.1 and abs(together[4]) < 0.1 and together[5] == 0.0


@pytest.mark.parametrize(("bend", "free"), [(0.01, False), (0.04, True)])
def test_a_gentle_bend_is_no_end(tmp_path, bend: float, free: bool) -> None:
    """A road that goes on downhill: up to 20 mrad as one surface, beyond that it ends at the crest."""
    downhill = plane(
        10.0, 4.0, (10.0 + 5.0 * np.cos(bend), 0.0, -5.0 * np.sin(bend)), (np.sin(bend), 0.0, np.cos(bend))
    )
    things = [
        Thing("road", plane(10.0, 4.0, (5.0, 0.0, 0.0)), "Roads", "steel", is_object=False),
        Thing("downhill", downhill, "Roads", "steel", is_object=False),
    ]
    ends = ends_of(tmp_path, things)
    assert free_at(ends, np.array([10.0, 0.3, 0.0])) == free
    assert free_at(ends, np.array([5.0, 2.0, 0.0]))


def test_a_reach_below_nothing_is_refused() -> None:
    with pytest.raises(ScarlError, match="end_reach"):
        MirrorSettings.of(end_reach=-1.0)


def test_points_far_from_free_edges_are_left_out_before_they_are_compared(tmp_path, monkeypatch) -> None:
    """Of points on and around two roads, up to a grazing ray, as many go on with and without."""
    road = plane(10.0, 4.0, (5, 0, 0)), plane(10.0, 4.0, (17, 0, 0))
    ends = ends_of(tmp_path, [Thing(f"road {k}", mesh, "Roads", is_object=False) for k, mesh in enumerate(road)])
    rng, count = np.random.default_rng(0), 20_000
    point = np.column_stack([rng.uniform(-3.0, 25.0, count), rng.uniform(-6.0, 6.0, count), np.zeros(count)])
    ray = rng.normal(size=(count, 3)) * [1.0, 1.0, 0.1]
    ray /= np.linalg.norm(ray, axis=1)[:, None]
    at = Reflections(rng.integers(2, size=count), point, ray, rng.uniform(0.02, 5.0, count))
    found = ends.goes_on(at)
    assert 0.01 < found.mean() < 0.5
    assert 0.1 < np.mean([ends._may_reach(k, ends._outline(k), at).mean() for k in (0, 1)]) < 0.9
    monkeypatch.setattr(MirrorEnds, "_may_reach", lambda self, number, outline, at: np.ones(len(at.mirror), np.bool_))
    np.testing.assert_array_equal(ends.goes_on(at), found)
