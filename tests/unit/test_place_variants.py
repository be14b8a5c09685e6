"""What a variant of a place draws by its seed: road wear, trams, works, bicycles, trees."""

from __future__ import annotations

import numpy as np
import pytest

import scarl_sionna as ss
from scenes_xml.generators.plants import species, vegetation
from scenes_xml.generators.roads.road import RoadCurve
from scenes_xml.generators.roads.sweep import STRAIGHT
from scenes_xml.generators.roads.way import Way
from scenes_xml.generators.roads.wear import COVERS, GAUGE, HEAD, PATCHES, RAISED, LaneSurface
from scenes_xml.urban_crossing import layout as street

S = np.arange(-80.0, 120.1, 2.0)
BENT = RoadCurve(20.0, 1900.0, 160.0, 40.0)


def _normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("curve", [STRAIGHT, BENT])
def test_rails_are_a_gauge_apart_and_look_up(curve):
    for middle in (0.0, 3.25):
        low, high = LaneSurface.along(curve, S, middle, 3.25).rails()
        for rail in (low, high):
            assert np.all(_normals(rail)[:, 2] > 0.0)
            assert rail.vertices[:, 2] == pytest.approx(RAISED["rail"])
        inner = [rail.vertices.reshape(-1, 2, 3)[:, :, :2] for rail in (low, high)]
        gaps = np.linalg.norm(inner[0][:, :, None] - inner[1][:, None], axis=3).reshape(len(inner[0]), 4)
        assert gaps.min(axis=1) == pytest.approx(GAUGE, abs=2e-3)
        assert gaps.max(axis=1) == pytest.approx(GAUGE + 2.0 * HEAD, abs=2e-3)


def test_patches_and_covers_lie_within_their_lane_as_often_as_stated():
    lane = LaneSurface.along(STRAIGHT, S, 1.75, 3.5)
    patches = [mesh for seed in range(200) for mesh in lane.patches(PATCHES["town"], np.random.default_rng(seed))]
    expected = 200 * lane.length / PATCHES["town"]
    assert abs(len(patches) - expected) < 5.0 * np.sqrt(expected)  # Poisson
    covers = list(lane.covers(np.random.default_rng(1)))
    assert len(covers) == pytest.approx(lane.length / COVERS, abs=1.5)
    for mesh, height in [*((one, RAISED["patch"]) for one in patches), *((one, RAISED["cover"]) for one in covers)]:
        x, y, z = mesh.vertices.T
        assert y.min() >= 0.0 and y.max() <= 3.5 and x.min() >= S[0] and x.max() <= S[-1]
        assert z.max() == pytest.approx(height)
        assert _normals(mesh)[:, 2].sum() > 0.0


def test_wear_follows_a_road_that_rises_and_falls_to_its_sides():
    """Crown 2 %, a hill of 4 m: 2 mm above the chords of the road, which lie within 1 mm of the road."""
    way = Way(heights=((-200.0, 0.0), (0.0, 0.0), (200.0, 4.0), (400.0, 0.0)), crown=0.02, half=3.0, stop=400.0)
    s = np.arange(0.0, 300.1, 2.0)
    lane = LaneSurface.along(way, s, 1.5, 3.0)
    for mesh in lane.patches(20.0, np.random.default_rng(3)):
        along, offset = mesh.vertices[:, 0], mesh.vertices[:, 1]
        road = way.point(along, offset)[:, 2]
        assert np.abs(mesh.vertices[:, 2] - road - RAISED["patch"]).max() < 1e-3


def test_a_place_closed_by_works_is_free_and_no_parking_place():
    found = [street.layout(variant) for variant in range(1, 40)]
    closed = [plan for plan in found if plan.works is not None]
    assert 8 < len(closed) < 32
    for plan in closed:
        assert plan.works in plan.bays and plan.works not in [float(car.x[0]) for car in plan.parked]
        assert len(street.parking(plan)) == len(plan.bays) - 1


@pytest.mark.parametrize("kind", ["oak", "lime", "maple", "plane", "birch", "poplar", "willow", "cherry", "pine"])
def test_light_trees_are_leaf_cards_on_a_small_core(kind):
    """The silhouette is that of cards: they reach beyond the blobs on all sides, with few triangles."""
    parts, _ = species.tree(kind, 3, True)
    core, leaves = parts["core"], parts["leaves"]
    assert sum(len(part.faces) for part in parts.values()) < 1_300
    assert len(leaves.faces) > 300
    for axis in (0, 1):
        assert np.ptp(leaves.vertices[:, axis]) > 1.08 * np.ptp(core.vertices[:, axis])
    old = vegetation.tree(vegetation.TreeShape(9.0, 3.2, 2.2), 3, True)
    assert set(old) == {"trunk", "core", "leaves"} and sum(len(part.faces) for part in old.values()) < 1_300


def test_street_trees_are_cut_above_heads():
    for kind in species.TOWN:
        shape = species.pruned(kind, 8.0, 2.0, 2.8)
        assert shape.crown_base >= 2.8 and shape.crown_radius <= 2.0 and shape.height >= shape.crown_base + 2.0
        parts, _ = species.tree(kind, 1, False, shape)
        assert parts["leaves"].vertices[:, 2].min() > 2.3 and np.abs(parts["leaves"].vertices[:, :2]).max() < 3.0


def test_a_variant_of_the_town_street_has_all_of_it():
    """Rails by rays straight down: 8 mm above the street, metal, of the class RailTrack; wires hang above a bus."""
    world = ss.load_scene("urban_crossing", variant=3)
    parts = {name: part for part, name in enumerate(world.parts.name)}
    names = {info.name for info in world.instances.values()}
    assert {"road_patches", "road_covers", "tram_rails", "tram_wires", "works_heap", "parked_bicycle_0"} <= names
    assert world.parts.material[parts["rails_tram"]] == world.parts.material[parts["covers_road"]] == "metal"
    assert world.parts.material[parts["patches_road"]] == "asphalt"
    assert world.mesh(parts["wires_tram"]).vertices[:, 2].min() > 5.0
    y = np.array([0.5 * GAUGE + 0.03, -0.5 * GAUGE - 0.03])
    places = np.column_stack([np.full(2, -60.0), y, np.full(2, 1.0)])
    hits = world.at(0.0).cast(places, np.tile([0.0, 0.0, -1.0], (2, 1)))
    assert [world.parts.name[part] for part in hits.part] == ["rails_tram"] * 2
    assert hits.distance == pytest.approx(1.0 - RAISED["rail"], abs=1e-6)
    first = ss.load_scene("urban_crossing")
    assert not {"road_patches", "tram_rails"} & {info.name for info in first.instances.values()}
