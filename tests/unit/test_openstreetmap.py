"""Extracts of OpenStreetMap as scenes: places in metres, buildings as tagged, roads by netconvert, findings, errors."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import shapely
from scipy.integrate import quad

import scarl_sionna as ss
from scarl_sionna.core.errors import MapError, MapWarning
from scarl_sionna.scene.streets.openstreetmap.buildings import buildings
from scarl_sionna.scene.streets.openstreetmap.data import read_osm
from scarl_sionna.scene.streets.openstreetmap.extract import netconvert_options, read_extract
from scarl_sionna.scene.streets.openstreetmap.projection import AXIS, FLATTENING, Projection
from scarl_sionna.scene.streets.openstreetmap.side import is_driven_on_the_left
from scarl_sionna.scene.streets.source import Source
from tests import street_extracts as extracts

CENTIMETRE = 0.01
DOWN = np.array([0.0, 0.0, -1.0])


def _file(folder, text: str):
    file = folder / "town.osm"
    file.write_text(text)
    return file


def _world(folder, name: str):
    pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MapWarning)
        file = folder / f"{name}.osm"
        file.write_text(extracts.EXTRACTS[name]())
        return ss.load_scene(file)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """The scene of the crossing with buildings."""
    return _world(tmp_path_factory.mktemp("osm"), "town")


def _heights(world, places):
    start = np.column_stack([np.asarray(places, float), np.full(len(places), 60.0)])
    hits = world.at(0.0).cast(start, np.broadcast_to(DOWN, start.shape))
    assert len(hits.ray) == len(start)
    return hits.point[:, 2]


def test_the_projection_keeps_lengths_on_its_meridian_and_across_it():
    projection = Projection(10.0, 52.0)
    square = FLATTENING * (2.0 - FLATTENING)

    def along(latitude):
        return AXIS * (1.0 - square) / (1.0 - square * np.sin(latitude) ** 2) ** 1.5

    for latitude in (51.95, 52.0, 52.07):
        length = quad(along, np.radians(52.0), np.radians(latitude), epsabs=1e-9)[0]
        assert projection(10.0, latitude) == pytest.approx([0.0, length], abs=1e-6)
    for away in (0.01, 0.1):  # x by the series of the angle of the meridians, to the fifth power
        phi, lam = np.radians(52.0), np.radians(away)
        cross = AXIS / np.sqrt(1.0 - square * np.sin(phi) ** 2)
        eta2, tan2, a = square / (1.0 - square) * np.cos(phi) ** 2, np.tan(phi) ** 2, lam * np.cos(phi)
        x = cross * (a + a**3 / 6.0 * (1.0 - tan2 + eta2) + a**5 / 120.0 * (5.0 - 18.0 * tan2 + tan2**2))
        y = cross * np.tan(phi) * (a**2 / 2.0 + a**4 / 24.0 * (5.0 - tan2 + 9.0 * eta2))
        assert projection(10.0 + away, 52.0) == pytest.approx([x, y], abs=1e-4)


def test_outlines_are_within_a_centimetre_and_have_their_courts(tmp_path):
    source = Source(tmp_path)
    found = {one.id: one for one in buildings(read_osm(_file(tmp_path, extracts.town()), source), source)}
    court = next(one for one in found.values() if len(one.rings) == 2)
    for name, ring in zip(("outer", "inner"), court.rings, strict=True):
        expected = shapely.Polygon(extracts.COURT[name])
        assert shapely.hausdorff_distance(shapely.Polygon(ring), expected) < CENTIMETRE
    assert (court.eaves, court.top, court.storeys) == (15.0, 15.0, 5)
    expected = {name: shapely.Polygon(extracts.rectangle(*place)) for name, (place, _) in extracts.HOUSES.items()}
    for name, plan in expected.items():
        near = [one.roof for one in found.values() if _away(one, plan) < CENTIMETRE]
        assert near == [name]
    heights = {one.roof: (one.eaves, one.top) for one in found.values() if len(one.rings) == 1 and one.foot == 0.0}
    assert heights["gabled"] == (6.0, 9.0) and heights["hipped"] == (6.0, 8.5)
    assert heights["pyramidal"] == (14.0, 20.0) and heights["skillion"] == (4.0, 6.0)
    parts = sorted((one.foot, one.top) for one in found.values() if one.line and "way" in one.id and one.foot >= 0.0)
    assert (6.0, 18.0) in parts  # the tower on its base; the office that has parts is drawn by them
    assert len(found) == 1 + len(extracts.HOUSES) + 2


def _away(building, plan) -> float:
    return float(shapely.hausdorff_distance(shapely.Polygon(building.rings[0]), plan))


def test_roofs_are_as_high_as_their_tags_say(town):
    eps = 0.05
    expected = [
        ((-37.5, 25.0), 12.5), ((-64.0, 24.0), 9.0), ((-64.0, 20.0 + eps), 6.0), ((-64.0, 22.0), 7.5),
        ((-88.0, 24.0), 8.5), ((-94.95, 24.0), 6.0), ((-93.0, 24.0), 7.25), ((-88.0, 22.0), 7.25),
        ((-41.0, 54.0), 20.0), ((-44.95, 54.0), 14.0), ((-43.0, 54.0), 17.0), ((-64.0, 53.0), 5.0),
        ((40.0, 25.0), 15.0), ((38.0, 34.5), 0.0), ((-119.0, 21.0), 6.0), ((-114.0, 26.0), 18.0),
    ]  # fmt: skip # a table
    found = _heights(town, [place for place, _ in expected]) - 0.12  # the ground meets the pavements
    assert found == pytest.approx([height for _, height in expected], abs=0.08)  # a slope of 0.75 over the 5 cm


def test_walls_stand_where_the_outline_is(town):
    state = town.at(0.0)
    for y in (24.0, 33.0, 45.0):
        hits = state.cast(np.array([0.0, y, 0.3]), np.array([[1.0, 0.0, 0.0]]))
        assert hits.point[0, 0] == pytest.approx(20.0, abs=CENTIMETRE)
        assert town.parts.material[hits.part[0]] in ("brick", "concrete")
    inside = state.cast(np.array([38.0, 34.5, 0.3]), np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    assert inside.distance == pytest.approx([6.0, 6.0, 4.5], abs=CENTIMETRE)


def test_lanes_lights_and_licence_of_the_crossing(town):
    network = town.document.lanes
    drive = network.of_kind("drive")
    straight = [lane for lane in drive if abs(lane.points[0, 1] + 1.6) < 0.02 and lane.points[0, 0] < -150.0]
    assert len(straight) == 1
    assert straight[0].points[:, 1] == pytest.approx(-1.6, abs=0.02) and straight[0].speed == pytest.approx(50.0 / 3.6)
    assert straight[0].signal in network.signals.green and network.signals.cycle == pytest.approx(90.0)
    assert len(network.of_kind("walk")) == 8
    assert town.document.info["licence"] == "(c) OpenStreetMap contributors, ODbL 1.0"
    kinds = {one.name.rpartition("_")[2] for one in town.instances.values() if one.name.startswith("object_")}
    assert {"tree", "streetlamp", "vegetation", "wall", "fence"} <= kinds


def test_a_zebra_lies_across_the_carriageway(tmp_path):
    pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
    street = read_extract(_file(tmp_path, extracts.town()))
    zebra = next(one for one in street.objects if one.kind == "crosswalk")
    corners = np.array([(corner.a, corner.b) for corner in zebra.outlines[0].corners])
    assert np.sort(corners[:, 0]) == pytest.approx([38.0, 38.0, 42.0, 42.0], abs=0.02)
    assert np.sort(corners[:, 1]) == pytest.approx([-6.1, -6.1, 6.1, 6.1], abs=0.02)  # 4 lanes of 3.2 m, 0.3 m clear


def test_what_is_far_is_left_out(tmp_path):
    source = Source(tmp_path)
    text = extracts.town().replace(
        "</osm>", '<node id="9999" lat="53" lon="10"><tag k="natural" v="tree"/></node></osm>'
    )
    extract = read_osm(_file(tmp_path, text), source)
    assert all(node.id != "9999" for node in extract.nodes)
    assert any("more than 20 km from the middle" in str(one) for one in source.findings())


def test_what_is_not_drawn_is_a_finding_with_its_line(tmp_path):
    pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
    text = extracts.town()
    street = read_extract(_file(tmp_path, text))
    found = {str(one) for one in street.findings}
    line = 1 + text[: text.index('v="pitch"')].count("\n")
    assert f"line {line}: leisure=pitch is not drawn" in found
    assert any("barrier=wall is open where a road passes" in one for one in found)


def test_a_road_passes_over_another_on_its_bridge(tmp_path):
    world = _world(tmp_path, "bridge")
    lanes = world.document.lanes.of_kind("drive")
    over = [lane for lane in lanes if np.ptp(lane.points[:, 0]) > 100.0]
    assert len(over) == 2 and all(np.interp(0.0, *_by_x(lane)) == pytest.approx(6.0, abs=0.3) for lane in over)
    assert any(one.name.startswith("bridge_") for one in world.instances.values())
    below = world.at(0.0).cast(np.array([1.6, -30.0, 1.5]), np.array([[0.0, 1.0, 0.0]]), max_distance=60.0)
    assert len(below.ray) == 0  # the road below is open


def _by_x(lane):
    order = np.argsort(lane.points[:, 0])
    return lane.points[order, 0], lane.points[order, 2]


def test_a_roundabout_is_driven_around_and_has_the_right_of_way(tmp_path):
    network = _world(tmp_path, "roundabout").document.lanes
    inside = [lane for lane in network.of_kind("drive") if np.hypot(*lane.points[:, :2].T).max() < 23.0]
    start = next(lane for lane in inside if np.hypot(*lane.points[:, :2].T).max() < 21.0)
    way, turned = start, 0.0
    for _ in range(40):
        further = [network[name] for name in way.next if np.hypot(*network[name].points[:, :2].T).max() < 21.0]
        angles = np.unwrap(np.arctan2(way.points[:, 1], way.points[:, 0]))
        turned += angles[-1] - angles[0]
        if not further or further[0].name == start.name:
            break
        way = further[0]
    assert turned == pytest.approx(2.0 * np.pi, abs=0.05)
    entering = [lane for lane in network.lanes if lane.yield_to]
    assert len(entering) >= 4
    for lane in entering:
        assert np.hypot(*lane.points[0, :2]) > np.hypot(*lane.points[-1, :2])  # who comes in waits


@pytest.mark.parametrize(
    ("change", "message", "line"),
    [
        (('lat="52.0000000"', 'lat="152"'), "is outside", 4),
        (('lon="10.0000000"', ""), "has no 'lon'", 4),
        (('<node id="2"', '<node id="1"'), "stands twice", 5),
    ],
)
def test_errors_name_the_line(tmp_path, change, message, line):
    file = _file(tmp_path, extracts.town().replace(*change, 1))
    with pytest.raises(MapError, match=message) as error:
        read_osm(file, Source(file))
    assert error.value.line == line


def test_what_is_no_extract_is_refused(tmp_path):
    road = extracts.Writer()
    road.way([(0.0, 0.0), (50.0, 0.0)], {"highway": "footway"})
    for text, message in (
        ("<osm>", "not valid XML"), ("<net/>", "not <osm>"), ("<osm/>", "no node"), (road.text, "no road for cars"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm/>', "document type"),
    ):  # fmt: skip # a table
        with pytest.raises(MapError, match=message):
            read_extract(_file(tmp_path, text))


def test_tags_that_are_no_numbers_are_findings_and_seeds_repeat(tmp_path):
    w = extracts.Writer()
    w.way(extracts.rectangle(0.0, 0.0, 10.0, 8.0), {"building": "yes", "height": "tall"})
    w.way(extracts.rectangle(20.0, 0.0, 10.0, 8.0), {"building": "yes", "height": "40'6\""})
    w.way(extracts.rectangle(40.0, 0.0, 10.0, 8.0), {"building": "garage", "roof:shape": "onion"})
    w.way([(60.0, 0.0), (70.0, 0.0), (70.0, 9.0)], {"building": "yes"})
    w.way([(80.0, 0.0), (90.0, 9.0), (90.0, 0.0), (80.0, 9.0), (80.0, 0.0)], {"building": "yes", "height": "5"})
    file = _file(tmp_path, w.text.replace("40'6\"", "40'6&quot;"))
    both = []
    for _ in range(2):
        source = Source(file)
        both.append(list(buildings(read_osm(file, source), source)))
    first, again = both
    assert [one.top for one in first] == [one.top for one in again]
    assert first[0].storeys in (2, 3, 4) and first[0].top == 3.0 * first[0].storeys
    assert first[1].top == pytest.approx(40.5 * 0.3048) and first[2].roof == "flat" and first[2].top == 3.0
    assert len(first) == 5  # the fourth is not closed; the fifth crosses itself: two triangles
    text = " ".join(str(one) for one in source.findings())
    for words in ("is no length", "roof:shape=onion is drawn flat", "is not closed", "crosses itself", "by seed"):
        assert words in text


def _side(folder, roads: list[str], boundary: str = "", root: str = "") -> tuple[bool, str, bool]:
    """Whether an extract is driven on the left, its findings, and what netconvert is told."""
    w = extracts.Writer()
    for k, side in enumerate(roads):
        tags = {"highway": "residential", **({"driving_side": side} if side else {})}
        w.way([(0.0, 10.0 * k), (50.0, 10.0 * k)], tags)
    if boundary:
        w.multipolygon([1], [], {"boundary": "administrative", "driving_side": boundary})
    file = _file(folder, w.text.replace("<osm ", f"<osm driving_side='{root}' " if root else "<osm "))
    source = Source(file)
    extract = read_osm(file, source)
    is_left = is_driven_on_the_left(extract, source)
    options = netconvert_options(file, extract, is_left, folder / "net.xml")
    told = {"true": True, "false": False}[options[options.index("--lefthand") + 1]]
    return is_left, " ".join(str(one) for one in source.findings()), told


@pytest.mark.parametrize(
    ("roads", "boundary", "root", "is_left", "finding"),
    [
        ([""], "", "", False, "driven on the right, which is assumed"),
        ([""], "", "left", True, ""),
        (["left"], "", "right", False, ""),
        (["left", ""], "right", "", True, ""),
        ([""], "left", "", True, ""),
        (["left", "right", "left"], "", "", True, "2 say left and 1 right"),
        (["middle"], "", "", False, "which is assumed"),
    ],
)
def test_the_driving_side_is_told_by_root_roads_or_boundaries(tmp_path, roads, boundary, root, is_left, finding):
    found, text, told = _side(tmp_path, roads, boundary, root)
    assert found is told is is_left
    assert finding in text and ("driven" in text) == bool(finding)


def test_a_driving_side_that_is_none_is_refused(tmp_path):
    with pytest.raises(MapError, match="driving_side = 'both' is no side"):
        _side(tmp_path, [""], root="both")


def test_lanes_of_an_extract_driven_on_the_left_are_on_the_left(tmp_path):
    pytest.importorskip("sumo", reason="eclipse-sumo is not installed")
    for side, sign in (("left", 1.0), ("right", -1.0)):
        w = extracts.Writer()
        w.way([(-80.0, 0.0), (80.0, 0.0)], {"highway": "secondary", "lanes": "2", "driving_side": side})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MapWarning)
            world = ss.load_scene(_file(tmp_path, w.text))
        lanes = [lane for lane in world.document.lanes.lanes if lane.points[-1, 0] - lane.points[0, 0] > 50.0]
        assert lanes and all(np.sign(lane.points[:, 1].mean()) == sign for lane in lanes)
