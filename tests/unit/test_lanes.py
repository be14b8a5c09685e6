"""Lanes of a scene: what fits together, and what is refused with a reason."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.scene.lanes import Lane, LaneNetwork, ParkingPlace, Signals, lanes_from_tables


def straight(name: str, x: float = 0.0, y: float = 0.0, length: float = 50.0, **rest: object) -> dict[str, object]:
    return {"name": name, "points": [[x, y, 0.0], [x + length, y, 0.0]], **rest}


def test_network_of_tables() -> None:
    network = lanes_from_tables(
        [
            straight("a", next=["b", "c"], left="d", signal="A", yield_to=["d"]),
            straight("b", x=50.0, speed=8.0, width=3.0),
            straight("c", x=50.05),
            straight("d", y=3.25),
        ],
        [{"position": [1.0, 2.0, 0.1], "yaw_deg": 90.0, "length": 5.5}],
        {"cycle": 40.0, "green": {"A": [0.0, 16.0]}},
    )
    assert [lane.name for lane in network.lanes] == ["a", "b", "c", "d"]
    assert network["b"].speed == 8.0 and network["b"].width == 3.0 and network["b"].length == 50.0
    assert [lane.name for lane in network.before("b")] == ["a"]
    assert network.right_of("d") is network["a"]
    assert list(network) == ["a", "b", "c", "d"]  # by the old protocol it was asked for lane 0
    with pytest.raises(UnknownNameError, match="unknown lane '0'"):
        network[0]  # type: ignore[index]
    assert [lane.name for lane in network.check_route(["a", "c"])] == ["a", "c"]
    assert network.parking[0].yaw_deg == 90.0
    again = pickle.loads(pickle.dumps(network))
    assert np.array_equal(again["c"].points, network["c"].points)
    with pytest.raises(ValueError, match="read-only"):
        network["a"].points[0, 0] = 1.0


def test_end_headings_are_those_of_the_circle() -> None:
    # on points of a circle the circle through three of them is the circle: exact but for rounding, whatever their
    # distances
    angle = np.array([0.1, 0.2, 0.35, 0.45, 0.6])
    lane = Lane("arc", np.column_stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), 0.0 * angle]))
    # chord headings are those of the tangent in the middle of a chord; the turn between two chords is linear in angle
    assert lane.end_headings == pytest.approx((0.1 + np.pi / 2, 0.6 + np.pi / 2), abs=1e-4)


def test_nearest_and_at() -> None:
    lane = Lane("a", [[0.0, 0.0, 0.0], [10.0, 0.0, 1.0], [10.0 + 5.0, 5.0, 1.0]])
    way, away = lane.nearest([4.0, 3.0, 9.0])
    assert away == pytest.approx(3.0)
    assert lane.at(way)[:2] == pytest.approx([4.0, 0.0])
    assert lane.at([-1.0, 1e9])[1] == pytest.approx([15.0, 5.0, 1.0])


def test_signals() -> None:
    signals = Signals(40.0, {"A": (0.0, 16.0), "B": (20.0, 40.0), "always": (0.0, 40.0)})
    assert signals.is_green("A", 41.0) and not signals.is_green("A", 16.0) and signals.is_green("A", -39.0)
    assert signals.green_left("A", 42.5) == pytest.approx(13.5)
    assert signals.green_left("A", 17.0) == 0.0 and signals.green_left("always", 3.0) == float("inf")
    with pytest.raises(UnknownNameError, match="signal group 'C'"):
        signals.is_green("C", 0.0)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"width": 325.0}, ParameterRangeError, "lanes.a.width = 325.*the unit is m"),
        ({"width": 0.0}, ParameterRangeError, "lanes.a.width"),
        ({"speed": 100.0}, ParameterRangeError, "lanes.a.speed = 100.*the unit is m/s"),
        ({"speed": float("nan")}, ParameterRangeError, "lanes.a.speed"),
        ({"kind": "drove"}, UnknownNameError, "did you mean 'drive'"),
        ({"next": "b"}, ParameterRangeError, "lanes.a.next = 'b'.*list of names"),
        ({"next": ["x"]}, UnknownNameError, "name in lanes.a.next 'x'"),
        ({"left": "x"}, UnknownNameError, "lanes.a.left"),
        ({"left": "b"}, ParameterRangeError, "lanes.a.left"),
        ({"yield_to": ["x"]}, UnknownNameError, "lanes.a.yield_to"),
        ({"signal": "Z"}, UnknownNameError, "lanes.a.signal"),
        ({"colour": "red"}, UnknownNameError, "key of lanes.a 'colour'"),
        ({"points": [[0.0, 0.0, 0.0]]}, ParameterRangeError, r"lanes.a.points = shape \(1, 3\)"),
        ({"points": [[0.0, 0.0], [50.0, 0.0]]}, ParameterRangeError, r"shape \(2, 2\)"),
        ({"points": [[0.0, 0.0, 0.0], [50.0, float("inf"), 0.0]]}, ParameterRangeError, r"lanes.a.points\[1\]"),
        ({"points": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]}, ParameterRangeError, "0 and 1 coincide"),
        (
            {"points": [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 9.0, 0.0]]},
            ParameterRangeError,
            "a turn of 90 deg at point 1",
        ),
        ({"points": "here"}, ParameterRangeError, "lanes.a.points"),
    ],
)
def test_a_wrong_lane_is_named(change: dict[str, object], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        lanes_from_tables([{**straight("a"), **change}, straight("b", x=50.0)])


def test_missing_points() -> None:
    with pytest.raises(ParameterRangeError, match=r"lanes.a.points = missing"):
        lanes_from_tables([{"name": "a"}])


def test_lanes_that_do_not_fit() -> None:
    with pytest.raises(ParameterRangeError, match="'a'.*stands 2 times"):
        lanes_from_tables([straight("a"), straight("a")])
    with pytest.raises(ParameterRangeError, match="a gap of 0.12 m to 'b'"):
        lanes_from_tables([straight("a", next=["b"]), straight("b", x=50.12)])
    bent = {"name": "b", "points": [[50.0, 0.0, 0.0], [60.0, 10.0 * np.tan(np.radians(6.0)), 0.0]]}
    with pytest.raises(ParameterRangeError, match=r"a kink of 6.0 deg to 'b'"):
        lanes_from_tables([straight("a", next=["b"]), bent])
    lanes_from_tables([straight("a", next=["b"], kind="walk"), {**bent, "kind": "walk"}])  # people may turn
    with pytest.raises(ParameterRangeError, match="of kind 'walk'"):
        lanes_from_tables([straight("a", next=["b"]), straight("b", x=50.0, kind="walk")])
    with pytest.raises(UnknownNameError, match="lane after 'a' 'b'"):
        lanes_from_tables([straight("a"), straight("b", x=50.0)]).check_route(["a", "b"])


def test_places_and_signals_are_checked() -> None:
    with pytest.raises(ParameterRangeError, match="parking.position"):
        ParkingPlace([0.0, np.nan, 0.0])
    with pytest.raises(ParameterRangeError, match="parking.length = -1"):
        ParkingPlace([0.0, 0.0, 0.0], 0.0, -1.0)
    with pytest.raises(ParameterRangeError, match="signals.green.A"):
        Signals(40.0, {"A": (0.0, 50.0)})
    with pytest.raises(ParameterRangeError, match="signals.cycle"):
        Signals(0.0, {})
    with pytest.raises(UnknownNameError, match="unknown lane 'c'"):
        LaneNetwork((Lane("a", [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),))["c"]
