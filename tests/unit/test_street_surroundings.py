"""Kerbs, furniture, trees and houses by seed beside the roads of a map that states none."""

from __future__ import annotations

import hashlib
import math
import warnings

import numpy as np
import pytest
import shapely

import scarl_sionna as ss
from scarl_sionna.core.errors import MapWarning
from scarl_sionna.scene.streets.building.scene import build_scene
from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.network.lanes import street_lanes
from scarl_sionna.scene.streets.opendrive.street import read_map
from scarl_sionna.scene.streets.surroundings.roadway import tram_lanes
from scenes_xml.generators.plants import species
from tests import street_maps as maps

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory

MADE_UP = "beside_"
WALK = maps.lane(2, 2.5, "sidewalk", "none"), maps.lane(-2, 2.5, "sidewalk", "none")
LORRY = 4.3
"""Nothing but the arms of lamps is above a lane below this height [m]."""


def bend(kind: str, walk: bool = False, speed: float = 0.0, more: str = "") -> str:
    """Return a map of one road: 120 m straight on, and 200 m in a bend of 90 m radius, uphill."""
    plan = maps.piece("<line/>", 120.0) + maps.piece('<arc curvature="0.011"/>', 200.0, 120.0, 120.0)
    limit = f'<speed sOffset="0" max="{speed}" unit="km/h"/>' if speed else ""
    left, right = [maps.lane(1, more=limit)], [maps.lane(-1, more=limit)]
    lanes = maps.section([WALK[0], *left] if walk else left, [*right, WALK[1]] if walk else right)
    hill = maps.cubic("elevation", (0.0, 0.02, 0.0, 0.0))
    return maps.street_map(maps.road(plan, 320.0, lanes, elevation=hill, kind=kind, more=more))


MAPS = {
    "crossing": maps.MAPS["crossing"],
    "town": bend("town", True, 50.0),
    "rural": bend("rural", speed=100.0),
    "motorway": bend("motorway"),
    "furnished": maps.MAPS["furnished"],
}
TOWN = 7
"""Variant of the town that has all that a street can get."""


@pytest.fixture(scope="module")
def worlds(tmp_path_factory):
    """World of a map and a variant, and the map's file."""
    folder = tmp_path_factory.mktemp("maps")
    known = {}

    def world(name: str, variant: int | None = None):
        variant = (TOWN if name == "town" else 1) if variant is None else variant
        if (name, variant) not in known:
            file = folder / f"{name}.xodr"
            file.write_text(MAPS[name])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MapWarning)
                known[name, variant] = ss.load_scene(file, variant=variant, detail="light"), file
        return known[name, variant]

    return world


def made_up(world) -> dict[str, int]:
    """Return how many things of each kind the map does not state: name without the number."""
    found: dict[str, int] = {}
    for entry in world.document.instances:
        if entry.name.startswith(MADE_UP):
            kind = entry.name.removeprefix(MADE_UP).rsplit("_", 1)[0]
            found[kind] = found.get(kind, 0) + 1
    return found


def has(world, *kinds: str) -> bool:
    """Return whether something of a kind, by the beginning of its name, was made up."""
    return any(name.startswith(kinds) for name in made_up(world))


def cast_down(world, points, above: float):
    """Return for each point the height that a ray from above it meets, and the name of what it meets."""
    start = points + [0.0, 0.0, above]
    hits = world.at(0.0).cast(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape), max_distance=above + 1.0)
    of_part = {part: one.name for one in world.instances.values() for part in one.parts}
    names = np.array([of_part[part] for part in hits.part.tolist()])
    height = np.full(len(points), np.nan)
    height[hits.ray] = hits.point[:, 2] - points[hits.ray, 2]
    return height, names


def over_lanes(file, kinds, count: int, seed: int = 5):
    """Return random points on all lanes of some kinds, 0.1 m and more from their borders."""
    generator, points = np.random.default_rng(seed), []
    for road in read_map(file).roads.values():
        shape = RoadShape(road)
        for section in road.sections:
            for number, lane in section.lanes.items():
                if lane.kind not in kinds:
                    continue
                s = generator.uniform(section.s, section.stop, count)
                inner, outer = shape.edges(section, number, s)
                share = generator.uniform(0.03, 0.97, count)[:, None]
                points.append(inner + share * (outer - inner))
    return np.concatenate(points)


@pytest.mark.parametrize("name", MAPS)
def test_nothing_made_up_stands_on_a_lane_or_hangs_over_it(worlds, name):
    world, file = worlds(name)
    points = over_lanes(file, ("driving", "biking", "shoulder", "stop", "parking"), 4000)
    height, names = cast_down(world, points, LORRY)
    assert not [one for one in np.unique(names) if one.startswith(MADE_UP)]
    assert np.isfinite(height).all()
    assert made_up(world), "the map got no surroundings"


def test_crossings_and_what_the_file_has_stay_free(worlds):
    world, _ = worlds("furnished")
    assert not has(world, "house", "block", "tree", "delineator", "guardrail", "limit")
    assert has(world, "lamp", "street_lamp", "bush", "shelter")
    for entry in world.document.instances:
        if entry.name.startswith(MADE_UP):
            continue
        assert entry.name.startswith(("object", "signal", "road", "terrain", "sidewalks", "ground")), entry.name
    generator = np.random.default_rng(2)
    place = np.column_stack([generator.uniform(36.5, 43.5, 3000), generator.uniform(-5.0, 5.0, 3000), np.zeros(3000)])
    names = cast_down(world, place, LORRY)[1]
    assert not [one for one in np.unique(names) if one.startswith(MADE_UP)]


def test_a_place_gets_what_its_kind_of_road_has(worlds):
    town, rural, motorway = (worlds(name)[0] for name in ("town", "rural", "motorway"))
    assert has(town, "block") and has(town, "house") and has(town, "street_lamp", "lamp") and has(town, "limit_50")
    assert has(rural, "delineator") and has(rural, "tree") and has(rural, "limit_100")
    assert has(motorway, "guardrail") and has(motorway, "delineator") and not has(motorway, "house", "block", "lamp")


def test_building_sites_and_scaffolding_keep_off_lanes_and_pavements(worlds):
    world, file = worlds("town")
    assert (
        has(world, "site_hut") and has(world, "site_fence") and has(world, "barrier_board") and has(world, "scaffold")
    )
    points = over_lanes(file, ("driving", "sidewalk"), 4000)
    names = np.unique(cast_down(world, points, 2.2)[1])
    assert not [one for one in names if one.startswith((f"{MADE_UP}site", f"{MADE_UP}barrier", f"{MADE_UP}scaffold"))]


def test_patches_covers_and_rails_lie_flush_in_the_carriageway(worlds):
    world, file = worlds("town")
    road = read_map(file).roads["1"]
    generator, met = np.random.default_rng(4), {}
    for lane in (1, -1):
        inner, outer = RoadShape(road).edges(road.sections[0], lane, s := np.sort(generator.uniform(1.0, 319.0, 12000)))
        share = generator.uniform(0.02, 0.98, len(s))
        height, names = cast_down(world, inner + share[:, None] * (outer - inner), 1.0)
        away = np.abs(share - 0.5) * np.linalg.norm((outer - inner)[:, :2], axis=1)
        for name in np.unique(names):
            kind, own = name.rsplit("_", 2)[0], names == name
            met.setdefault(kind, []).append((height[own], away[own]))
    assert {"roadway_roads", "roadway_railtrack"} <= set(met)
    for kind in ("roadway_roads", "roadway_railtrack"):
        heights = np.concatenate([one for one, _ in met[kind]])
        assert len(heights) > 100 and np.abs(heights).max() < 0.02  # 8 mm, on chords of 9 mm
    rails = np.concatenate([one for _, one in met["roadway_railtrack"]])
    assert rails.min() > 0.7175 - 0.01 and rails.max() < 0.7775 + 0.01  # 1435 mm between heads of 60 mm
    steel = [k for k, name in enumerate(world.parts.name) if "railtrack" in name or "manhole" in name]
    assert steel and all(world.parts.material[k] == "metal" for k in steel)
    assert has(world, "bicycle") and not any("roadway" in name for name in worlds("town", 0)[0].parts.name)


def test_a_tram_goes_on_over_a_crossing(tmp_path):
    file = tmp_path / "crossing.xodr"
    file.write_text(MAPS["crossing"])
    street = read_map(file)
    network = street_lanes(street, {name: RoadShape(road) for name, road in street.roads.items()})[0]
    found = [tram_lanes(street, network, np.random.default_rng(seed)) for seed in range(60)]
    assert 10 <= sum(map(bool, found)) <= 38  # 0.4 of 60 within 3.7 sigma
    for keys in filter(None, found):
        inside = [key for key in keys if street.roads[key[0]].junction in street.junctions]
        assert 2 <= len({key[0] for key in keys} - {key[0] for key in inside}) <= 3 and 1 <= len(inside) <= 2


def test_pavements_are_raised_and_go_down_where_they_end(worlds):
    world, file = worlds("town")
    road = read_map(file).roads["1"]
    shape = RoadShape(road)
    for lane in (2, -2):
        s = np.array([0.02, 0.5, 1.0, 40.0, 160.0, 300.0, 319.5])
        inner, outer = shape.edges(road.sections[0], lane, s)
        height, _ = cast_down(world, inner + 0.5 * (outer - inner), 1.0)
        assert height == pytest.approx([0.0024, 0.06, 0.12, 0.12, 0.12, 0.12, 0.06], abs=0.003)
    bare, _ = worlds("town", 0)
    inner, outer = shape.edges(road.sections[0], 2, np.array([40.0, 160.0]))
    assert cast_down(bare, inner + 0.5 * (outer - inner), 1.0)[0] == pytest.approx([0.0, 0.0], abs=1e-3)


def test_a_carriageway_without_an_edge_gets_a_kerb_in_town_and_a_verge_elsewhere(worlds, tmp_path):
    file = tmp_path / "town.xodr"
    file.write_text(bend("town"))
    town = ss.load_scene(file, variant=3, detail="light")
    for world, height, semantic in ((town, 0.12, "sidewalks"), (worlds("rural")[0], 0.0, "ground")):
        place = np.array([[60.0, side * (3.5 + 0.08), 0.02 * 60.0] for side in (1.0, -1.0)])
        found, names = cast_down(world, place, 1.0)
        assert found == pytest.approx([height, height], abs=2e-3)
        assert all(name.startswith(semantic) for name in names)


def test_without_a_seed_a_map_stays_as_its_file_states(worlds):
    world, _ = worlds("town", 0)
    assert not made_up(world)
    assert world.document.info["variant"] == 0 and worlds("town")[0].document.info["variant"] == TOWN


def _sums(folder) -> dict[str, str]:
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def test_same_seed_same_bytes_and_another_seed_another_place(tmp_path, worlds):
    world, file = worlds("town")
    street = read_map(file)
    for name, variant in (("a", TOWN), ("b", TOWN + 1)):
        build_scene(street, tmp_path / name, "light", variant)
    first = _sums(world.document.path.parent)
    assert _sums(tmp_path / "a") == first
    assert _sums(tmp_path / "b")["town.xml"] != first["town.xml"]


def test_what_is_made_up_does_not_overlap(worlds):
    world, _ = worlds("town")
    state = world.at(0.0)
    boxes = [one for one in state.boxes() if one.name.startswith((f"{MADE_UP}house", f"{MADE_UP}block"))]
    plans = []
    for one in boxes:
        half = 0.5 * one.size[:2]
        corners = np.array([(x * half[0], y * half[1], 0.0) for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))])
        plans.append(shapely.Polygon(one.world_from_box.apply(corners)[:, :2]))
    assert len(plans) > 8
    for k, plan in enumerate(plans):
        for other in plans[:k]:
            common = shapely.intersection(plan, other)
            assert common.area < 3.0, "balconies and eaves may meet, houses may not"


@pytest.mark.parametrize("kind", species.KINDS)
def test_a_tree_stays_within_its_reach_and_its_light_level_has_few_triangles(kind):
    sizes = {}
    for is_light in (False, True):
        for seed in range(3):
            parts, materials = species.tree(kind, seed, is_light)
            points = np.concatenate([mesh.vertices for mesh in parts.values()])
            assert np.linalg.norm(points[:, :2], axis=1).max() < species.KINDS[kind].reach
            assert -0.5 < points[:, 2].min() <= -0.25, "its stem goes into the ground"
            assert math.isclose(points[:, 2].max(), species.KINDS[kind].shape.height, rel_tol=0.25)
            assert set(parts) == set(materials)
            sizes[is_light] = sum(len(mesh.faces) for mesh in parts.values())
    assert sizes[True] <= 1000 and sizes[True] < 0.5 * sizes[False]
