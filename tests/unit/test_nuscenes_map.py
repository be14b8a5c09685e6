"""A map expansion of nuScenes as a scene: lanes by closed forms, links, right of way, lights, surfaces, errors."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scarl_sionna.core.errors import MapError, MapWarning, ParameterRangeError
from scarl_sionna.core.semantics import SEMANTIC_CLASSES
from scarl_sionna.dataset.formats.nuscenes_parts.lane_map import LaneMap, lanes_of
from scarl_sionna.engine.load import load_scene
from scarl_sionna.engine.world import World
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.model import StreetMap
from scarl_sionna.scene.streets.nearby import REACH, nearby
from scarl_sionna.scene.streets.network.lanes import street_lanes
from scarl_sionna.scene.streets.nuscenes.street import read_expansion
from tests import street_maps as maps
from tests.nuscenes_map import along, crossing


def network(street: StreetMap) -> LaneNetwork:
    return street_lanes(street, {name: RoadShape(road) for name, road in street.roads.items()})[0]


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return crossing(tmp_path_factory.mktemp("map"))


@pytest.fixture(scope="module")
def lanes(file: Path) -> LaneNetwork:
    return network(read_expansion(file))


@pytest.fixture(scope="module")
def world(file: Path) -> World:
    with pytest.warns(MapWarning, match="poses of traffic lights are not used|1 lanes that others lead to"):
        return load_scene(file)


@pytest.mark.parametrize(
    ("lane", "start", "shape", "lengths"),
    [
        ("a", (100.0, 98.0, 0.0), "LSR", [0.0, 80.0, 0.0]),
        ("a-c", (180.0, 98.0, 0.0), "RSR", [5.0 * np.pi, 0.0, 0.0]),
        ("s", (100.0, 130.0, 0.1), "LSR", [6.0, 20.0, 8.0]),
    ],
)
def test_lanes_follow_arcs_and_lines(lanes: LaneNetwork, lane: str, start, shape: str, lengths) -> None:
    """Chords of 2 m on a radius of 10 m are up to 5 cm off; points of the line lie on it."""
    own = lanes[f"{lane}/0/-1"]
    exact = np.array([along(start, shape, lengths, way)[:2] for way in np.linspace(0.0, sum(lengths), 2001)])
    away = np.linalg.norm(own.points[:, None, :2] - exact[None], axis=2).min(1)
    assert away.max() < 0.02 and own.length == pytest.approx(sum(lengths), rel=2e-3)
    np.testing.assert_allclose(own.points[[0, -1], :2], exact[[0, -1]], atol=1e-6)
    assert own.width == pytest.approx(3.5, rel=5e-3)


def test_lanes_continue_yield_and_stop(lanes: LaneNetwork) -> None:
    after = {lane.name.split("/")[0]: {one.split("/")[0] for one in lane.next} for lane in lanes.lanes}
    assert after["a"] == {"a-b", "a-c"} and after["a-b"] == {"b"} and after["n"] == {"n-m"} and after["b"] == set()
    assert lanes["n-m/0/-1"].yield_to == ("a-b/0/-1",)  # it comes from a stop sign, and crosses that one alone
    assert all(not lane.yield_to for lane in lanes.lanes if lane.name != "n-m/0/-1")
    signalled = [lane.name for lane in lanes.lanes if lane.signal]
    assert signalled == ["a/0/-1"] and lanes.signals is not None


def test_traffic_keeps_left_in_singapore(tmp_path) -> None:
    street = read_expansion(crossing(tmp_path, "singapore-onenorth"))
    assert {road.is_left_hand for road in street.roads.values()} == {True}
    own = network(street)["a-c/0/1"]
    np.testing.assert_allclose(own.points[-1, :2], [190.0, 88.0], atol=1e-6)


def test_surfaces_have_their_heights_and_materials(world: World) -> None:
    """Rays straight down: road, pavement 0.12 m up, island of lawn, car park, bars of the crossing and lines on top."""
    places = {
        (150.0, 98.0): ("Roads", "asphalt", 0.0), (150.0, 92.0): ("SideWalks", "concrete", 0.12),
        (245.0, 102.5): ("Terrain", "grass", 0.0), (115.0, 109.0): ("Roads", "asphalt", 0.0),
        (270.0, 104.0): ("Roads", "asphalt", 0.0), (205.0, 150.0): ("Roads", "asphalt", 0.0),
    }  # fmt: skip # a table
    origins = np.array([(x, y, 5.0) for x, y in places])
    hits = world.at(0.0).cast(origins, np.tile([0.0, 0.0, -1.0], (len(origins), 1)), twin="radio")
    assert hits.ray.tolist() == list(range(len(places)))
    for (place, (semantic, material, height)), part, point in zip(places.items(), hits.part, hits.point, strict=True):
        assert kind(world, part) == semantic, place
        assert material in world.parts.material[part], (place, world.parts.material[part])
        assert abs(point[2] - height) < 0.01, place


def kind(world: World, part: int) -> str:
    """Return the class of a part."""
    return SEMANTIC_CLASSES[world.parts.semantic[part]]


def share_of_lines(world: World, x: tuple[float, float], y: tuple[float, float]) -> float:
    """Return which share of a rectangle is paint."""
    grid = np.stack(np.meshgrid(np.linspace(*x, 60), np.linspace(*y, 60)), -1).reshape(-1, 2)
    origins = np.column_stack([grid, np.full(len(grid), 5.0)])
    hits = world.at(0.0).cast(origins, np.tile([0.0, 0.0, -1.0], (len(grid), 1)))
    painted = [kind(world, part) == "RoadLine" for part in hits.part]
    return float(np.mean(painted))


def test_lines_are_where_and_as_the_map_says(world: World) -> None:
    assert share_of_lines(world, (170.2, 173.8), (94.5, 105.5)) == pytest.approx(0.5, abs=0.1)  # bars of a zebra
    assert share_of_lines(world, (145.0, 165.0), (101.95, 102.05)) == 1.0  # one solid line of 12 cm
    dashed = share_of_lines(world, (102.0, 138.0), (102.07, 102.17))
    assert dashed == pytest.approx(1.0 / 3.0, abs=0.06)  # two broken lines, 3 m of 9
    assert share_of_lines(world, (102.0, 138.0), (101.97, 102.03)) < 0.05  # nothing between them
    assert share_of_lines(world, (222.0, 234.0), (99.96, 100.04)) == 1.0


def test_what_is_not_used_is_named(world: World) -> None:
    told = " | ".join(world.document.info["findings"])
    for words in ("traffic lights", "road segments", "1 lanes that others lead to", "1 stop lines before crossings"):
        assert words in told
    assert "CC BY-NC-SA" in world.document.info["licence"]


def test_of_a_large_map_the_part_beside_the_drive_is_built(file: Path) -> None:
    street = read_expansion(file)
    part = nearby(street, np.array([[440.0, 98.0], [500.0, 98.0]]))
    assert "b" in part.roads and not {"a", "c", "m"} & set(part.roads)
    x = np.concatenate([area.rings[0][:, 0] for area in part.areas])
    assert x.min() > 220.0 - 11.0 and x.max() > 299.0
    assert len(nearby(street, np.array([[200.0, 98.0], [201.0, 98.0]])).roads) == len(street.roads)
    with pytest.raises(MapError, match="has no lane within 150 m of the drive, which begins at \\(900, 0\\) m"):
        nearby(street, np.array([[900.0, 0.0], [901.0, 0.0]]))
    assert REACH == 150.0


def test_the_lanes_of_a_map_file_are_found_by_its_name(tmp_path, monkeypatch) -> None:
    """A manifest has the name of a map file without its end."""
    (tmp_path / "straight.xodr").write_text(maps.street_map(maps.road(maps.piece("<line/>", 80.0), 80.0)))
    monkeypatch.chdir(tmp_path)
    assert {lane.name for lane in lanes_of("straight", "a").lanes} == {"1/0/-1", "1/0/1"}
    monkeypatch.chdir("/")
    with pytest.raises(ParameterRangeError, match="convert in its folder"):
        lanes_of("straight", "a")


@pytest.mark.parametrize("place", ["urban_crossing", "roundabout", "signalised_crossing", "motorway"])
def test_the_lanes_of_an_export_come_back(place: str, tmp_path) -> None:
    """Centre lines within 10 cm, widths, speeds, links, lights; right of way at the way that meets the others."""
    before = lanes_of(place, "a")
    origin = np.array([-412.5, 37.25])
    path = tmp_path / f"{place}.json"
    path.write_text(json.dumps(LaneMap(before, origin, (900.0, 900.0)).tables))
    after = network(read_expansion(path))
    drive = {lane.name: lane for lane in before.of_kind("drive")}
    assert {lane.name for lane in after.lanes} == {f"{name}/0/-1" for name in drive}
    for name, lane in drive.items():
        own = after[f"{name}/0/-1"]
        points = lane.at(np.linspace(0.0, lane.length, 200))
        assert max(own.nearest(point)[1] for point in points) < 0.1, name
        assert own.width == pytest.approx(lane.width) and own.speed == pytest.approx(lane.speed)
        assert set(own.next) == {f"{one}/0/-1" for one in lane.next if one in drive}
        assert (own.signal is None) == (lane.signal is None)
    if place == "roundabout":
        assert {lane.yield_to for lane in after.lanes if lane.yield_to} == {
            (f"ring_{side}/0/-1",) for side in ("east", "north", "south", "west")
        }


def changed(file: Path, folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    tables = json.loads(file.read_text())
    change(tables)
    path = folder / "broken.json"
    path.write_text(json.dumps(tables))
    return path


FAULTS: list[tuple[Callable[[dict[str, Any]], None], str]] = [
    (lambda t: t.pop("arcline_path_3"), "no layer 'arcline_path_3' \\(version 1.3\\)"),
    (lambda t: t["node"][0].update(x=float("nan")), "node 'p-a.0': x"),
    (lambda t: t["node"].pop(0), "polygon 'p-a': node 'p-a.0' is not there"),
    (lambda t: t["walkway"][0].update(polygon_token="gone"), "walkway 'walk': polygon 'gone' is not there"),
    (lambda t: t["lane_divider"][0].update(line_token="gone"), "lane_divider 'dashes': line 'gone' is not there"),
    (lambda t: t["arcline_path_3"]["s"][0].update(shape="SSS"), "arcline_path_3 's': shape = 'SSS'"),
    (lambda t: t["arcline_path_3"]["s"][0].update(radius=0.0), "arcline_path_3 's': .*radius 0"),
    (lambda t: t["connectivity"].update(a=[1]), "connectivity of 'a'"),
    (lambda t: t["lane"].append(3), "lane: 3 is no record with a token"),
    (lambda t: t["arcline_path_3"].clear(), "has no lane with a path"),
]


@pytest.mark.parametrize(("change", "words"), FAULTS)
def test_faults_name_layer_and_token(file: Path, tmp_path, change, words: str) -> None:
    with pytest.raises(MapError, match=words):
        read_expansion(changed(file, tmp_path, change))


def test_no_map_and_no_variants(file: Path, tmp_path) -> None:
    (tmp_path / "list.json").write_text("[]")
    (tmp_path / "text.json").write_text("{no")
    for name, words in (("list", "is no map expansion"), ("text", "is no JSON"), ("gone", "not found")):
        with pytest.raises(MapError, match=words):
            read_expansion(tmp_path / f"{name}.json")
    with pytest.raises(ParameterRangeError, match="has no variants"):
        find_scene(file, variant=2)
