"""Lane networks of OpenDRIVE maps: every lane to drive on goes on, lights and right of way, both rules of the road."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.network.lanes import street_lanes
from scarl_sionna.scene.streets.opendrive.street import read_map
from tests import street_maps as maps


def _network(folder, text):
    file = folder / "map.xodr"
    file.write_text(text)
    street = read_map(file)
    return street_lanes(street, {name: RoadShape(road) for name, road in street.roads.items()})


@pytest.mark.parametrize("name", maps.MAPS)
def test_every_lane_to_drive_on_is_there_and_ends_only_where_its_road_does(tmp_path, name):
    network, _, findings = _network(tmp_path, maps.MAPS[name])
    street = read_map(tmp_path / "map.xodr")
    drivable = [
        (road.id, number, lane.id)
        for road in street.roads.values()
        for number, section in enumerate(road.sections)
        for lane in section.lanes.values()
        if lane.kind == "driving"
    ]
    lanes = network.of_kind("drive")
    assert {lane.name for lane in lanes} == {"/".join(map(str, key)) for key in drivable}
    ends = {lane.name for lane in lanes if not lane.next}
    starts = {lane.name for lane in lanes if not network.before(lane.name)}
    if name in ("crossing", "left_hand"):
        away, toward = (-1, 1) if name == "crossing" else (1, -1)
        assert ends == {f"{arm}/0/{away}" for arm in range(4)} and starts == {f"{arm}/0/{toward}" for arm in range(4)}
    elif name == "widening":
        assert ends == {"1/1/-1", "1/1/-2", "1/0/1"} and starts == {"1/0/-1", "1/1/-2", "1/1/1"}
    else:
        assert ends == starts == {lane.name for lane in lanes}
    assert not findings


def test_centre_lines_run_in_the_middle_and_with_the_traffic(tmp_path):
    network, _, _ = _network(tmp_path, maps.MAPS["arc"])
    right, left = network["1/0/-1"], network["1/0/1"]
    middle = np.array([12.0, -7.0]) + 20.0 * np.array([np.sin(0.7), -np.cos(0.7)])  # 20 m to the right
    for lane, radius in ((right, 20.0 - 1.75), (left, 20.0 + 1.75)):
        assert np.linalg.norm(lane.points[:, :2] - middle, axis=1) == pytest.approx(np.full(len(lane.points), radius))
    assert np.linalg.norm(right.points[0] - left.points[-1]) == pytest.approx(3.5)
    assert right.speed == 13.9 and right.width == pytest.approx(3.5)


def test_a_crossing_goes_three_ways_and_left_turns_let_oncoming_traffic_pass(tmp_path):
    network, lights, _ = _network(tmp_path, maps.MAPS["crossing"])
    for arm in range(4):
        lane = network[f"{arm}/0/1"]
        assert set(lane.next) == {f"{100 + 10 * arm + other}/0/-1" for other in range(4) if other != arm}
        for other in range(4):
            if other != arm:
                way = network[f"{100 + 10 * arm + other}/0/-1"]
                assert way.next == (f"{other}/0/-1",)
                opposite = (arm + 2) % 4
                oncoming = f"{100 + 10 * opposite + arm}/0/-1"
                is_left = other == (arm + 3) % 4  # seen inwards: the arm to the left
                assert (oncoming in way.yield_to) == is_left
    groups = {lane.signal for lane in network.of_kind("drive") if lane.signal}
    assert groups == {"junction_9_a", "junction_9_b"}
    assert network["0/0/1"].signal == network["2/0/1"].signal != network["1/0/1"].signal
    assert network["0/0/-1"].signal is None
    assert lights.of_signal["0", "s0"] == "junction_9_a"
    shared = maps.MAPS["crossing"].replace(
        '<signal id="s2" s="2" t="6" zOffset="2.3" orientation="-" dynamic="yes" type="1000001"/>',
        '<signalReference id="s1" s="2" t="6" orientation="-"/>',
    )
    network, lights, _ = _network(tmp_path, shared)  # the third arm has the light of the second
    assert network["2/0/1"].signal == network["1/0/1"].signal == lights.of_signal["1", "s1"]
    assert network["0/0/1"].signal != network["1/0/1"].signal and ("2", "s1") not in lights.of_signal
    network, lights, _ = _network(tmp_path, maps.MAPS["crossing"])
    greens = network.signals.green
    for time in np.arange(0.0, network.signals.cycle, 0.5):
        assert sum(network.signals.is_green(group, time) for group in greens) <= 1


def test_left_hand_traffic_runs_the_other_way(tmp_path):
    network, _, _ = _network(tmp_path, maps.MAPS["left_hand"])
    assert network["0/0/1"].points[0, 0] < network["0/0/1"].points[-1, 0]
    turn = network["103/0/1"]
    assert turn.next == ("3/0/1",)


def test_a_lane_may_be_changed_where_the_line_is_broken(tmp_path):
    network, _, _ = _network(tmp_path, maps.MAPS["widening"])
    assert network["1/1/-2"].left == "1/1/-1" and network["1/1/-1"].left is None
    mark = 'type="{}" weight="standard" color="standard" width="0.12"/></lane><lane id="-2"'
    solid = maps.MAPS["widening"].replace(mark.format("broken"), mark.format("solid"))
    assert solid != maps.MAPS["widening"]
    network, _, _ = _network(tmp_path, solid)
    assert network["1/1/-2"].left is None


def test_a_link_over_a_gap_is_left_out_and_found(tmp_path):
    link = '<successor id="-1"/>'
    text = maps.street_map(
        maps.road(
            maps.piece("<line/>", 50.0),
            50.0,
            maps.section([maps.lane(1)], [maps.lane(-1, link=link)]),
            link=maps.links("", "road 2 start"),
        ),
        maps.road(maps.piece("<line/>", 50.0, 0.0, 50.6), 50.0, number="2"),
    )
    network, _, findings = _network(tmp_path, text)
    assert network["1/0/-1"].next == ()
    assert len(findings) == 1 and "a gap of 0.6 m" in str(findings[0]) and findings[0].line > 4


def test_a_lane_without_link_goes_on_where_another_begins(tmp_path):
    text = maps.street_map(
        maps.road(maps.piece("<line/>", 50.0), 50.0, link=maps.links("", "road 2 start")),
        maps.road(maps.piece("<line/>", 50.0, 0.0, 50.0), 50.0, number="2", link=maps.links("road 1 end")),
    )
    network, _, findings = _network(tmp_path, text)
    assert network["1/0/-1"].next == ("2/0/-1",) and network["2/0/1"].next == ("1/0/1",)
    assert len(findings) == 2


def test_the_file_s_priorities_decide_who_waits(tmp_path):
    text = maps.MAPS["crossing"].replace(
        '<junction id="9" name="">', '<junction id="9" name=""><priority high="113" low="102"/>'
    )
    network, _, _ = _network(tmp_path, text)
    assert "113/0/-1" in network["102/0/-1"].yield_to
    assert "102/0/-1" not in network["113/0/-1"].yield_to
