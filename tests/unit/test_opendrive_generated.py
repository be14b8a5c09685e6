"""Maps that `scenariogeneration` writes: its roads end where it says, and all its lanes are routed."""

from __future__ import annotations

import numpy as np
import pytest

from scarl_sionna.scene.streets.geometry.road import RoadShape
from scarl_sionna.scene.streets.network.lanes import street_lanes
from scarl_sionna.scene.streets.opendrive.street import read_map

xodr = pytest.importorskip("scenariogeneration.xodr", reason="scenariogeneration is not installed")


def test_two_roads_of_all_geometries_join_where_their_writer_joins_them(tmp_path):
    pieces = [
        xodr.Line(40.0),
        xodr.Spiral(0.0, 0.03, 30.0),
        xodr.Arc(0.03, length=25.0),
        xodr.ParamPoly3(0.0, 20.0, 1.0, -1.0, 0.0, 0.0, 4.0, -2.0, "normalized"),
    ]
    first = xodr.create_road(pieces, 1, left_lanes=2, right_lanes=2)
    second = xodr.create_road([xodr.Line(30.0)], 2, left_lanes=2, right_lanes=2)
    first.add_successor(xodr.ElementType.road, 2, xodr.ContactPoint.start)
    second.add_predecessor(xodr.ElementType.road, 1, xodr.ContactPoint.end)
    writer = xodr.OpenDrive("two")
    for road in (first, second):
        writer.add_road(road)
    writer.adjust_roads_and_lanes()
    file = tmp_path / "two.xodr"
    writer.write_xml(str(file))
    street = read_map(file)
    shapes = {name: RoadShape(road) for name, road in street.roads.items()}
    x, y, heading = first.planview.get_end_point()
    assert shapes["1"].point(street.roads["1"].length)[:2] == pytest.approx([x, y], abs=1e-3)
    assert np.cos(shapes["1"].heading(street.roads["1"].length) - heading) == pytest.approx(1.0, abs=1e-6)
    network, _, findings = street_lanes(street, shapes)
    assert not findings
    assert all(network[f"1/0/{lane}"].next == (f"2/0/{lane}",) for lane in (-1, -2))
    assert all(network[f"2/0/{lane}"].next == (f"1/0/{lane}",) for lane in (1, 2))
