"""Panoptic labels and the map expansion of a nuScenes folder, by nuscenes-devkit itself."""

from __future__ import annotations

import json

import numpy as np
import pytest

from scarl_sionna.core.errors import ParameterRangeError, ScarlWarning
from scarl_sionna.dataset.formats.nuscenes import export_nuscenes
from scarl_sionna.dataset.formats.nuscenes_parts.lane_map import LaneMap, drivable
from scarl_sionna.dataset.formats.nuscenes_parts.panoptic import MOST_OBJECTS, PanopticNumbers
from scarl_sionna.dataset.formats.nuscenes_parts.tables import CATEGORIES
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.scene.lanes import Lane, LaneNetwork, Signals
from tests.client_env import client_python, run_client
from tests.drive import drive
from tests.lane_scene import lane_scene

CAR, MAN = CATEGORIES.index("vehicle.car"), CATEGORIES.index("human.pedestrian.adult")


def test_the_devkit_opens_panoptic_labels_and_lanes(tmp_path, pytestconfig) -> None:
    """The drive of tests/drive.py, on the lanes of tests/lane_scene.py: begins at (-20, 5), in the left lane."""
    python = client_python("nuscenes", pytestconfig)
    source = drive(num_frames=2)
    place = lane_scene(tmp_path / "place")
    export_nuscenes(source, tmp_path / "out", raw_radar=False, lane_maps=str(place))
    (tmp_path / "work").mkdir()
    run_client(
        python, "nuscenes_map_client.py", tmp_path / "out", "v1.0-mini", "street", tmp_path / "work" / "result.json"
    )
    found = json.loads((tmp_path / "work" / "result.json").read_text())

    for labels, frame in zip(found["labels"], source.scenes[0], strict=True):
        assert labels["same"] and labels["dtype"] == "uint16"
        returns = {item.instance: item.num_lidar_points for item in frame.objects}
        assert labels["things"] == {str(1000 * CAR + 1): returns[2], str(1000 * MAN + 1): returns[3]}

    origin = np.array(found["origin"][:2])
    assert set(found["middle"]) == {"east", "east_on", "east_2", "west"}
    for name, (start, end, y) in {
        "east": (-150, 50, 0.0),
        "east_on": (50, 146, 0.0),
        "east_2": (-150, 146, 3.5),
    }.items():
        poses = np.array(found["middle"][name])
        np.testing.assert_allclose(poses[:, 1] + origin[1], y, atol=1e-6)
        np.testing.assert_allclose(poses[[0, -1], 0] + origin[0], [start, end], atol=1e-6)
        np.testing.assert_allclose(poses[:, 2], 0.0, atol=1e-9)
    assert found["after"] == {"east": ["east_on"], "east_on": [], "east_2": [], "west": []}
    assert found["before"]["east_on"] == ["east"]
    assert found["at_ego"]["lane"] == found["closest"] == "east_2"
    assert found["at_ego"]["drivable_area"] and not found["at_ego"]["walkway"]
    # a pixel of 0.1 m: the mask's area is that of the strips within the canvas, to a pixel along their outlines
    _, lane, walkway, carpark = found["areas"]
    assert lane > 3 * 3.5 * 200 and walkway > 0, found["areas"]
    assert carpark == pytest.approx(2 * 5.0 * 2.2, rel=0.1)


def test_numbers_count_within_a_class_and_stay_within_a_scene() -> None:
    numbers = PanopticNumbers()
    road = CATEGORIES.index("flat.driveable_surface")
    first = numbers.labels(np.array([CAR, CAR, MAN, road, 0, CAR], np.uint8), np.array([9, 7, 5, 3, 4, 0], np.uint16))
    assert first.tolist() == [1000 * CAR + 2, 1000 * CAR + 1, 1000 * MAN + 1, 1000 * road, 0, 1000 * CAR]
    second = numbers.labels(np.array([CAR, CAR], np.uint8), np.array([12, 9], np.uint16))
    assert second.tolist() == [1000 * CAR + 3, 1000 * CAR + 2] and second.dtype == np.uint16
    assert not len(numbers.labels(np.zeros(0, np.uint8), np.zeros(0, np.uint16)))
    many = np.arange(1, MOST_OBJECTS + 2, dtype=np.uint16)
    with pytest.raises(ParameterRangeError, match=r"999 of 'human\.pedestrian\.adult'"):
        numbers.labels(np.full(len(many), MAN, np.uint8), many)


def test_bends_signals_and_right_of_way_are_on_the_map() -> None:
    angle = np.linspace(0.0, np.pi / 2, 46)
    bend = np.stack([50.0 * np.sin(angle), 50.0 * (1.0 - np.cos(angle)), np.zeros(46)], axis=1)
    straight = np.stack([np.linspace(-30.0, 0.0, 16), np.zeros(16), np.zeros(16)], axis=1)
    lanes = LaneNetwork(
        (
            Lane("in", straight, width=4.0, next=("turn",), signal="a"),
            Lane("turn", bend, width=4.0, yield_to=("in",)),
        ),
        signals=Signals(60.0, {"a": (0.0, 30.0)}),
    )
    assert drivable(lanes).area == pytest.approx(4.0 * (30.0 + 25.0 * np.pi), rel=1e-3)
    tables = LaneMap(lanes, np.array([-100.0, -100.0]), (200.0, 200.0)).tables
    assert [stop["stop_line_type"] for stop in tables["stop_line"]] == ["TRAFFIC_LIGHT", "YIELD"]
    nodes = {node["token"]: (node["x"], node["y"]) for node in tables["node"]}
    polygons = {polygon["token"]: polygon for polygon in tables["polygon"]}
    corners = [nodes[token] for token in polygons[tables["stop_line"][1]["polygon_token"]]["exterior_node_tokens"]]
    # across the end of the bend, which leads north: at (50, 50), 2 m to both sides, half a metre back
    np.testing.assert_allclose(sorted(corners), [(148, 149.5), (148, 150), (152, 149.5), (152, 150)], atol=0.05)
    assert len(nodes) == len(tables["node"])  # tokens of their own


def test_what_has_no_lanes_is_refused_and_another_place_told(tmp_path) -> None:
    source = drive(num_frames=1, ends=("front",))
    with pytest.raises(ParameterRangeError, match="does not say its place"):
        export_nuscenes(source, tmp_path / "a", lane_maps=True)
    with pytest.raises(ParameterRangeError, match="'nowhere'"):
        export_nuscenes(source, tmp_path / "b", lane_maps="nowhere")
    assert not list(tmp_path.iterdir())
    frames = SceneFrames("street", source.scenes[0].frames, {"scene": "tunnel"})
    with pytest.warns(ScarlWarning, match="in 0% of its frames"):
        export_nuscenes(FrameSource(source.rig, [frames]), tmp_path / "c", lane_maps=True, panoptic_labels=False)
    assert (tmp_path / "c" / "maps" / "expansion" / "street.json").exists()
    assert not (tmp_path / "c" / "panoptic").exists()
