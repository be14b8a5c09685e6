"""Networks of SUMO as scenes: lanes where the file has them, right of way and lights as it says, errors with lines."""

from __future__ import annotations

import sys
import warnings

import numpy as np
import pytest
import shapely

import scarl_sionna as ss
from scarl_sionna.core.errors import MapError, MapWarning
from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.network.lanes import street_lanes
from scarl_sionna.scene.streets.sumo.lines import rounded
from scarl_sionna.scene.streets.sumo.street import read_network
from tests import street_networks as nets

CENTIMETRE = 0.01
LANE = {"wj": "wj/0/-1", "jw": "wj/0/1", "je": "je/0/-1", "ej": "je/0/1", "sj": "sj/0/-1", "js": "sj/0/1"}
"""Edge of the file -> lane: one road for both directions."""


def _read(folder, **options):
    file = folder / "town.net.xml"
    file.write_text(nets.network(**options))
    street = read_network(file)
    shapes = {name: RoadShape(road) for name, road in street.roads.items()}
    return street, *street_lanes(street, shapes)


def _way(link: tuple[str, str], lane: int = 0) -> str:
    return f"J:{link[0]}_{lane}:{link[1]}_{lane}/0/-1"


def test_lanes_are_where_the_file_has_them(tmp_path):
    street, network, _, problems = _read(tmp_path)
    assert not problems and not street.findings
    assert len(network.lanes) == len(nets.EDGES) + len(nets.LINKS)
    for edge, (_, _, shape) in nets.EDGES.items():
        lane = network[LANE[edge]]
        assert np.abs(lane.points[[0, -1], :2] - np.array(shape)).max() < 1e-9
        assert lane.speed == pytest.approx(13.9) and lane.width == pytest.approx(3.2)
    for link in nets.LINKS:
        lane = network[_way(link)]
        line = shapely.LineString(nets.way(link, 400))
        away = shapely.distance(shapely.points(lane.points[:, :2]), line)
        assert away.max() < 3.0 * CENTIMETRE  # a cubic against a quarter of an ellipse
        assert network[LANE[link[0]]].next.count(lane.name) == 1 and lane.next == (LANE[link[1]],)


def test_who_gives_way_follows_the_file(tmp_path):
    _, network, _, _ = _read(tmp_path)
    for k, row in enumerate(nets.RESPONSES):
        expected = {_way(nets.LINKS[j]) for j, bit in enumerate(reversed(row)) if bit == "1"}
        assert set(network[_way(nets.LINKS[k])].yield_to) == expected


def test_lights_are_green_when_the_program_says(tmp_path):
    _, network, lights, _ = _read(tmp_path, lights=True)
    assert network.signals.cycle == 60.0
    span = {edge: network.signals.green[network[LANE[edge]].signal] for edge in ("wj", "ej", "sj")}
    assert span == {"wj": (0.0, 30.0), "ej": (0.0, 30.0), "sj": (35.0, 55.0)}
    assert len(lights.of_signal) == 3
    assert all(network[LANE[edge]].signal is None for edge in ("jw", "je", "js"))


def test_left_hand_networks_are_mirrored(tmp_path):
    _, network, _, problems = _read(tmp_path, left_hand=True)
    assert not problems
    for edge, (_, _, shape) in nets.EDGES.items():
        name = LANE[edge].replace("/-1", "/x").replace("/1", "/-1").replace("/x", "/1")
        assert np.abs(network[name].points[[0, -1], :2] - np.array(shape) * [-1.0, 1.0]).max() < 1e-9


def test_pavements_stand_a_kerb_above_the_road_and_no_place_is_open(tmp_path):
    file = tmp_path / "town.net.xml"
    file.write_text(nets.network(lights=True, pavement=True))
    with warnings.catch_warnings():
        warnings.simplefilter("error", MapWarning)
        world = ss.load_scene(file)
    places = np.array([[-50.0, -1.6], [-50.0, -4.2], [50.0, 1.6], [50.0, 4.2], [0.0, 0.0], [6.0, -6.0], [-50.0, -20.0]])
    start = np.column_stack([places, np.full(len(places), 1.8)])
    hits = world.at(0.0).cast(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape))
    assert len(hits.ray) == len(places)
    assert hits.point[:, 2] == pytest.approx([0.0, 0.12, 0.0, 0.12, 0.0, hits.point[5, 2], hits.point[6, 2]], abs=0.006)
    random = np.random.default_rng(1).uniform([-40.0, -40.0], [40.0, 40.0], (4000, 2))
    start = np.column_stack([random, np.full(len(random), 1.8)])
    hits = world.at(0.0).cast(start, np.broadcast_to([0.0, 0.0, -1.0], start.shape))
    assert len(hits.ray) == len(random) and hits.point[:, 2].min() > -0.05
    assert sum(part.startswith("object_0_crosswalk") for part in world.parts.name) == 1
    heads = [one for one in world.instances.values() if one.name.endswith("_head")]
    assert len(heads) == 3


def test_corners_are_arcs_that_touch_both_sides():
    turn = np.radians(60.0)
    points = np.array([[0.0, 0.0, 1.0], [40.0, 0.0, 2.0], [40.0 + 40.0 * np.cos(turn), 40.0 * np.sin(turn), 5.0]])
    line = rounded(points, 13.9, (3.2, 6.4))
    arc = next(piece for piece in line.plan if piece.kind == "arc")
    radius = 1.0 / arc.numbers["curvStart"]
    assert radius == pytest.approx(3.2 + 2.0)  # what the lanes inside need; the corner itself asks for less
    assert arc.length == pytest.approx(radius * turn)
    assert line.length == pytest.approx(80.0 - radius * (2.0 * np.tan(0.5 * turn) - turn))
    assert line.elevation(np.array([0.0, line.length])) == pytest.approx([1.0, 5.0])
    for before, after in zip(line.plan, line.plan[1:], strict=False):
        turned = before.heading + before.length * before.numbers.get("curvStart", 0.0)
        assert after.heading == pytest.approx(turned) and after.s == pytest.approx(before.s + before.length)


def test_edges_without_length_are_passed_over(tmp_path):
    text = nets.network()
    east = f"{nets.CUT:.4f},{-nets.HALF:.4f} {nets.FAR:.4f},{-nets.HALF:.4f}"
    stub, rest = "10.0000,-1.6000 10.2000,-1.6000", "14.0000,-1.6000 100.0000,-1.6000"
    text = text.replace(east, stub).replace('to="E"', 'to="K"', 1)
    more = (
        f'<edge id="ke" from="K" to="E"><lane id="ke_0" index="0" speed="13.9" length="86" shape="{rest}"/></edge>'
        '<junction id="K" type="priority" x="12" y="0" incLanes="je_0" intLanes="" shape=""/>'
        '<connection from="je" to="ke" fromLane="0" toLane="0" dir="s" state="M"/>'
    )
    file = tmp_path / "stub.net.xml"
    file.write_text(text.replace("</net>", f"{more}</net>"))
    street = read_network(file)
    network, _, problems = street_lanes(street, {name: RoadShape(road) for name, road in street.roads.items()})
    assert not problems and "je" not in street.roads
    assert any("less than 2 m is passed over" in str(one) for one in street.findings)
    way = network["J:wj_0:ke_0/0/-1"]
    assert way.name in network[LANE["wj"]].next and way.next == ("ke/0/-1",)
    assert way.points[-1, :2] == pytest.approx([14.0, -1.6])
    assert np.abs(way.points[:, 1] + 1.6).max() < 1e-9


@pytest.mark.parametrize(
    ("change", "line", "message"),
    [
        (('speed="13.9"', 'speed="fast"'), 8, "is no number"),
        (('index="0" speed="13.9"', 'index="3" speed="13.9"'), 8, "number them"),
        (("-100.0000,-1.6000", "-100.0000"), 8, "x,y"),
        (('id="jw"', 'id="wj"'), 9, "stands twice"),
        (('response="000000"', 'response="0x0000"'), 14, "is no row"),
        ((' fromLane="0"', ""), 18, "has no 'fromLane'"),
    ],
)
def test_errors_name_the_line(tmp_path, change, line, message):
    file = tmp_path / "broken.net.xml"
    file.write_text(nets.network().replace(*change, 1))
    with pytest.raises(MapError, match=message) as error:
        read_network(file)
    assert error.value.line == line


def test_what_is_no_network_is_refused(tmp_path):
    file = tmp_path / "a.net.xml"
    for text, message in (("<net>", "not valid XML"), ("<scene/>", "not <net>"), ("<net/>", "no edge")):
        file.write_text(text)
        with pytest.raises(MapError, match=message):
            ss.load_scene(file)
    with pytest.raises(MapError, match="not found"):
        ss.load_scene(tmp_path / "none.net.xml")


def test_what_is_not_used_is_a_finding_with_its_line(tmp_path):
    street, _, _, _ = _read(tmp_path, extra='<prohibition prohibitor="a" prohibited="b"/>')
    assert [str(one) for one in street.findings] == ["line 24: <prohibition> in <net> is not used"]


def test_without_netconvert_an_extract_names_the_package(tmp_path, monkeypatch):
    from tests.street_extracts import EXTRACTS

    monkeypatch.setitem(sys.modules, "sumo", None)
    monkeypatch.setenv("PATH", str(tmp_path))
    file = tmp_path / "town.osm"
    file.write_text(EXTRACTS["town"]() + f"<!-- {tmp_path} -->")  # no other test has built it
    with pytest.raises(ss.core.errors.MissingPackageError, match=r"scarl-sionna\[sumo\]"):
        ss.load_scene(file)
