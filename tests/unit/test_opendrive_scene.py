"""Scenes of OpenDRIVE maps, looked at with rays: the ground is where the closed form has it, and nowhere a gap."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import MapError, MapWarning, ParameterRangeError
from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.opendrive.street import read_map
from tests import street_maps as maps

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory

CENTIMETRE = 0.01
ABOVE = 2.5
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def worlds(tmp_path_factory):
    """Scene of each map, its file beside it."""
    folder = tmp_path_factory.mktemp("maps")
    known = {}

    def world(name: str):
        if name not in known:
            file = folder / f"{name}.xodr"
            file.write_text(maps.MAPS[name])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MapWarning)
                known[name] = ss.load_scene(file), file
        return known[name]

    return world


def _on_lanes(file, count: int, seed: int, margin: float = 0.1):
    """Return random points on lanes: of each road, between its borders, away from both."""
    generator = np.random.default_rng(seed)
    points, kinds = [], []
    for road in read_map(file).roads.values():
        shape = RoadShape(road)
        for section in road.sections:
            for number, lane in section.lanes.items():
                s = generator.uniform(section.s + 0.05, section.stop - 0.05, count)
                inner, outer = shape.edges(section, number, s)
                width = np.linalg.norm((outer - inner)[:, :2], axis=1)
                share = margin + (1.0 - 2.0 * margin) * generator.random(count)
                found = inner + share[:, None] * (outer - inner)
                points.append(found[width > 0.3])
                kinds += [lane.kind] * int((width > 0.3).sum())
    return np.concatenate(points), np.array(kinds)


def _heights_below(world, points, reach: float = ABOVE):
    start = points + [0.0, 0.0, reach]
    hits = world.at(0.0).cast(start, np.broadcast_to(DOWN, start.shape))
    found = np.full(len(points), np.nan)
    found[hits.ray] = hits.point[:, 2]
    return found, hits


@pytest.mark.some(5)
@pytest.mark.parametrize("name", maps.MAPS)
def test_every_lane_has_a_surface_at_its_height(worlds, name):
    world, file = worlds(name)
    points, _ = _on_lanes(file, 400, 3)
    if name == "furnished":
        points = points[np.abs(points[:, 0] - 80.0) > 1.0]  # below the gantry
    z, _ = _heights_below(world, points)
    above = z - points[:, 2]
    assert np.isfinite(z).all(), "a ray fell through"
    raised = (above > 0.1) & (above < 0.13) & (name == "crossing")  # a footway that ends inside the crossing
    assert np.abs(above[~raised]).max() < CENTIMETRE
    assert raised.sum() < 0.01 * len(z)


@pytest.mark.some(5)
@pytest.mark.parametrize("name", maps.MAPS)
def test_rays_find_no_gap_along_borders_and_none_between_road_and_ground(worlds, name):
    world, file = worlds(name)
    generator = np.random.default_rng(4)
    for road in read_map(file).roads.values():
        if name == "bridge" and road.id == "2":
            continue  # its parapets stand there
        shape = RoadShape(road)
        for section in road.sections:
            s = generator.uniform(section.s, section.stop, 1500)
            for number in section.lanes:
                for edge in shape.edges(section, number, s):
                    beside = edge + np.column_stack([generator.uniform(-0.02, 0.02, (len(s), 2)), np.zeros(len(s))])
                    if name == "furnished":
                        beside = beside[np.abs(beside[:, 0] - 80.0) > 1.0]
                    z, _ = _heights_below(world, beside)
                    inside = _inside(road, shape, beside, name)
                    assert np.isfinite(z[inside]).all()
                    assert np.abs(z - beside[:, 2])[inside].max() < 0.12 + CENTIMETRE


def _inside(road, shape, points, name):
    """Return which points lie before both ends of a road, where the ground of a map ends far beyond."""
    start, stop = shape.point([0.0, road.length])
    first, last = shape.heading([0.0, road.length])
    after = (points - start)[:, :2] @ [math.cos(first), math.sin(first)]
    before = (stop - points)[:, :2] @ [math.cos(last), math.sin(last)]
    return (after > 0.0) & (before > 0.0)


def test_the_ground_meets_the_road_and_goes_on(worlds):
    world, _ = worlds("hill")
    shape = RoadShape(read_map(worlds("hill")[1]).roads["1"])
    s = np.linspace(1.0, 119.0, 300)
    z, _ = _heights_below(world, shape.point(s, np.full(300, 3.55)))
    assert np.abs(z - shape.point(s, np.full(300, 3.5))[:, 2]).max() < 0.02
    far, _ = _heights_below(world, shape.point(s, np.full(300, 30.0)), 30.0)
    assert np.isfinite(far).all()


def test_surfaces_that_overlap_in_a_crossing_are_one(worlds):
    world, _ = worlds("crossing")
    generator = np.random.default_rng(1)
    start = np.column_stack([generator.uniform(-12.0, 12.0, (4000, 2)), np.full(4000, 3.0)])
    state = world.at(0.0)
    hits = state.cast(start, np.broadcast_to(DOWN, start.shape))
    again = state.cast(hits.point - [0.0, 0.0, 1e-3], np.broadcast_to(DOWN, hits.point.shape), 1.0)
    assert len(again.ray) < 0.002 * len(hits.ray)  # nothing below the first surface


def test_a_kerb_closes_the_step_to_the_footway(worlds):
    world, _ = worlds("crossing")
    start = np.column_stack([np.linspace(20.0, 70.0, 200), np.full(200, -2.0), np.full(200, 0.06)])
    hits = world.at(0.0).cast(start, np.broadcast_to([0.0, -1.0, 0.0], start.shape), 5.0)
    assert len(hits.ray) == 200
    assert hits.point[:, 1] == pytest.approx(np.full(200, -3.5), abs=1e-4)
    assert np.abs(hits.normal[:, 1]).min() > 0.999


def test_marks_by_type_and_colour(worlds):
    world, _ = worlds("furnished")
    s = np.linspace(1.0, 99.0, 981)
    lines = {}
    for t, name in ((3.5 + 0.12, "left"), (3.5, "between"), (3.5 - 0.12, "right"), (0.0, "middle")):
        points = np.column_stack([s, np.full_like(s, t), np.zeros_like(s)])
        _, hits = _heights_below(world, points)
        lines[name] = np.array([world.parts.material[part] == "road_paint" for part in hits.part])
    assert lines["left"][:300].all() and lines["right"][:300].all() and not lines["between"][:300].any()
    free = (s < 37.0) | (s > 43.0)  # beside the crossing
    assert lines["middle"][free].mean() == pytest.approx(3.0 / 9.0, abs=0.05)


def test_bars_of_a_crossing_lie_along_the_traffic(worlds):
    world, _ = worlds("furnished")
    y = np.linspace(-3.3, 3.3, 661)
    points = np.column_stack([np.full_like(y, 40.0), y, np.zeros_like(y)])
    _, hits = _heights_below(world, points)
    is_bar = np.array([world.parts.material[part] == "road_paint" for part in hits.part])
    assert is_bar.mean() == pytest.approx(0.5, abs=0.1)
    assert 6 <= np.count_nonzero(np.diff(is_bar.astype(int)) == 1) + is_bar[0] <= 8


def test_objects_stand_where_the_file_has_them(worlds):
    world, _ = worlds("furnished")
    boxes = {box.name: box for box in world.at(0.0).boxes()}
    house = next(box for name, box in boxes.items() if "building" in name)
    corner = world.instances
    assert house.semantic == "Building" or corner
    state = world.at(0.0)
    roof = state.cast(np.array([[26.0, 16.0, 50.0]]), DOWN[None])
    assert roof.point[0, 2] == pytest.approx(9.0, abs=1e-3)
    wall = state.cast(np.array([[26.0, 0.0, 6.0]]), np.array([[0.0, 1.0, 0.0]]))
    assert wall.point[0, 1] == pytest.approx(12.0, abs=1e-3)
    assert world.parts.material[wall.part[0]] == "brick"
    poles = state.cast(np.array([[x, 0.0, 1.5] for x in (5.0, 25.0, 85.0)]), np.tile([0.0, -1.0, 0.0], (3, 1)), 7.0)
    assert poles.point[:, 1] == pytest.approx([-5.9] * 3, abs=0.01)
    fence = state.cast(np.array([[50.3, 0.0, 0.6]]), np.array([[0.0, -1.0, 0.0]]))
    assert fence.point[0, 1] == pytest.approx(-9.0, abs=0.2)
    place = world.document.lanes.parking[0]
    assert place.position[:2] == pytest.approx([70.0, 6.0]) and (place.length, place.width) == (5.5, 2.3)


def test_what_is_not_drawn_is_a_finding_with_its_line_and_one_warning(tmp_path):
    file = tmp_path / "street.xodr"
    file.write_text(maps.MAPS["furnished"])
    with pytest.warns(MapWarning, match="1 more") as caught:
        world = ss.load_scene(file)
    assert len([one for one in caught if issubclass(one.category, MapWarning)]) == 1
    findings = world.document.info["findings"]
    line = maps.MAPS["furnished"][: maps.MAPS["furnished"].index('type="gantry"')].count("\n") + 1
    assert f"line {line}: <object> of type 'gantry' has no size and no outline" in findings
    assert f"line {line}: sign of type '9999' has a blank face" in findings


def test_a_picture_on_the_road_is_no_obstacle(tmp_path):
    """As RoadRunner writes stains and arrows: no known type, an outline without heights, or no height at all."""
    corners = "".join(f'<cornerLocal u="{u}" v="{v}" z="0"/>' for u, v in ((-5, -1), (5, -1), (5, 1), (-5, 1)))
    size = 'type="-1" width="2" length="10"'
    things = (
        f'<object id="1" name="OilPath01" s="20" t="-1.5" hdg="0" {size}><outline>{corners}</outline></object>'
        f'<object id="2" name="Stencil_Arrow" s="50" t="-1.5" hdg="0" {size}/>'
        f'<object id="3" name="Block" s="70" t="-1.5" hdg="0" {size} height="0.8"><outline>{corners}</outline></object>'
    )
    street = maps.road(maps.piece("<line/>", 90.0), 90.0, more=f"<objects>{things}</objects>")
    (tmp_path / "stains.xodr").write_text(maps.street_map(street))
    with pytest.warns(MapWarning):
        world = ss.load_scene(tmp_path / "stains.xodr")
    findings = [one.split(": ", 1)[1] for one in world.document.info["findings"]]
    assert "<object> of no known kind, flat on the ground, is not drawn" in findings
    assert "<object> of type 'obstacle' has no size and no outline" in findings
    hits = world.at(0.0).cast([[20.0, -1.5, 5.0], [50.0, -1.5, 5.0], [70.0, -1.5, 5.0]], [[0.0, 0.0, -1.0]] * 3)
    np.testing.assert_allclose(hits.point[:, 2], [0.0, 0.0, 0.8], atol=0.01)


def test_a_map_far_from_the_origin_is_moved_there(tmp_path):
    file = tmp_path / "far.xodr"
    plan = maps.piece("<line/>", 50.0, 0.0, 412_345.5, 5_654_321.25)
    file.write_text(maps.street_map(maps.road(plan, 50.0)))
    with pytest.warns(MapWarning, match="is moved by x = -412000 m"):
        world = ss.load_scene(file)
    lane = world.document.lanes["1/0/-1"]
    assert lane.points[0] == pytest.approx([345.5, 321.25 - 1.75, 0.0])


def test_errors_of_a_map_reach_the_user(tmp_path):
    with pytest.raises(MapError, match="not found"):
        ss.load_scene(tmp_path / "none.xodr")
    file = tmp_path / "broken.xodr"
    file.write_text(maps.MAPS["line"].replace('width sOffset="0" a="3.5"', 'width sOffset="0" a="wide"', 1))
    with pytest.raises(MapError, match=r"line \d+: <width> a = 'wide' is no number"):
        ss.load_scene(file)
    file.write_text(maps.MAPS["line"])
    with pytest.raises(ParameterRangeError, match="variant"):
        ss.load_scene(file, variant=-2)


def test_a_road_over_another_gets_a_deck_and_the_road_below_is_open(tmp_path):
    file = tmp_path / "over.xodr"
    text = maps.MAPS["bridge"]
    file.write_text(text[: text.index("<objects>")] + text[text.index("</objects>") + len("</objects>") :])
    with pytest.warns(MapWarning, match="passes over another"):
        world = ss.load_scene(file)
    assert any(one.name.startswith("bridge_") for one in world.instances.values())
    state = world.at(0.0)
    below = state.cast(np.array([30.0, -1.75, 1.5]), np.array([[1.0, 0.0, 0.0]]), max_distance=40.0)
    assert len(below.ray) == 0
    above = state.cast(np.array([50.0, 0.0, 9.0]), np.array([[0.0, 0.0, -1.0]]))
    assert above.point[0, 2] == pytest.approx(7.0, abs=CENTIMETRE)
    up = state.cast(np.array([50.0, -1.75, 1.0]), np.array([[0.0, 0.0, 1.0]]))
    assert up.point[0, 2] == pytest.approx(7.0 - 0.9, abs=0.05)  # the deck's lower side
