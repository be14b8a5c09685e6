"""A scene of nuScenes' tables becomes a scenario: our own export as the round trip, and tables as the original has."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import ScarlWarning, ScenarioError, ScenarioFileError, TrajectoryFileError
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.specs.lidar.spec import LidarSpec
from scarl_sionna.dataset.formats.nuscenes import export_nuscenes
from scarl_sionna.dataset.formats.source import FrameSource, SceneFrames
from scarl_sionna.fusion import Rig, SensorMount
from scarl_sionna.scenario.checks.motion import check_motion
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.motion.bodies import body_of
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scenario.traffic.planned import Conversion
from scarl_sionna.scenario.traffic.recorded.nuscenes import model_for, nuscenes_motion, read_nuscenes
from scarl_sionna.scenario.traffic.recorded.nuscenes_tables import Placed, Track
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.simulation import load_world, observe
from tests.nuscenes_tables import Thing, change, write_tables

RADIUS, SPEED = 40.0, 8.0


def around(ahead: float, lever: float = 0.0):
    """Return a way along a circle, `ahead` of a point that begins at (0, 0) [m]: x, y, heading.

    The point is `lever` in front of a rear axle, which drives the circle [m].
    """

    def at(time: float) -> tuple[float, float, float]:
        turn = (SPEED * time + ahead) / RADIUS
        x, y = RADIUS * np.sin(turn), RADIUS * (1.0 - np.cos(turn))
        return x + lever * np.cos(turn), y + lever * np.sin(turn), turn

    return at


# -- round trip --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def round_trip(tmp_path_factory: pytest.TempPathFactory) -> tuple[ScenarioSpec, Path]:
    """The ready scenario `backing_out_of_a_drive` at 5 Hz, as a lidar of few rays sees it, exported to nuScenes."""
    spec = ScenarioSpec.preset("backing_out_of_a_drive")
    world = load_world(spec)
    lidar = LidarSpec(num_azimuth=480, num_elevation=16, azimuth_fov_deg=(-180.0, 180.0))
    rig = Rig("round", (SensorMount("roof/lidar", "lidar", lidar, Pose([0.0, 0.0, 2.2])),))
    frames = [replace(observe(world, rig, 0.2 * k, seed=k), index=k) for k in range(31)]
    source = FrameSource(rig.to_dict(), [SceneFrames("backing", frames, {"scene": spec.scene})], {"train": ["backing"]})
    return spec, export_nuscenes(source, tmp_path_factory.mktemp("export") / "out", lane_maps=True)


def replayed(spec: ScenarioSpec, tables: Path) -> ScenarioSpec:
    return ScenarioSpec(
        scene=spec.scene,
        num_frames=121,
        frame_rate=20.0,
        keep_default_actors=False,
        ego={"model": "saloon", "trajectory": {"kind": "table", "file": str(tables)}},
        traffic={"source": "nuscenes", "file": str(tables)},
    )


def test_an_export_of_ours_drives_again(round_trip) -> None:
    """Between the frames of the record as well; the car reverses over a kerb. Models, and so sizes, are the same."""
    spec, out = round_trip
    before, after = compose(spec), compose(replayed(spec, out / "v1.0-mini"))
    models = [{one.actor.name: one.actor.model.name for one in each.members} for each in (before, after)]
    assert models[0] == models[1]
    motions = [{one.actor.name: one.actor.trajectory for one in each.members} for each in (before, after)]
    for name, motion in motions[1].items():
        first, last = getattr(motion, "active", (0.0, 6.0))
        times = np.arange(max(first, 0.0), min(last, 6.0), 0.05)
        assert len(times) > 20, name
        for time in times:
            then, now = motions[0][name].pose(time), motion.pose(time)
            away = then.position - now.position
            assert np.hypot(away[0], away[1]) < 0.03 and abs(away[2]) < 0.05, (name, time)
            assert then.rotation[:, 0] @ now.rotation[:, 0] > np.cos(np.radians(2.5)), (name, time)
            velocities = [one[name].twist(time).linear for one in motions]
            assert np.linalg.norm(velocities[0] - velocities[1]) < 0.3, (name, time)
    backing = motions[1]["backing"]
    speeds = [backing.twist(time).linear @ backing.pose(time).rotation[:, 0] for time in np.arange(0.5, 5.5, 0.5)]
    assert min(speeds) < -1.0


def test_it_stands_on_the_ground_and_runs(round_trip) -> None:
    spec, out = round_trip
    world = load_world(replayed(spec, out / "v1.0-mini"))  # raises where the ego vehicle is off the road
    boxes = {box.name: box for box in world.at(3.0).boxes()}
    truth = {box.name: box for box in load_world(spec).at(3.0).boxes()}
    for name in ("backing", "ego"):
        np.testing.assert_allclose(boxes[name].size, truth[name].size, atol=1e-6)
        np.testing.assert_allclose(boxes[name].world_from_box.position, truth[name].world_from_box.position, atol=0.05)


def test_it_drives_in_the_map_of_its_own_export(round_trip) -> None:
    """`scene: nuscenes`: the lanes of the map expansion, where they were; the drive beside the street has no ground."""
    spec, out = round_trip
    own = replayed(spec, out / "v1.0-mini").with_(scene="nuscenes", num_frames=61)
    before, after = compose(spec).scene.lanes, compose(own)
    assert before is not None and after.scene.lanes is not None
    for lane in before.of_kind("drive"):
        points = lane.at(np.linspace(0.0, lane.length, 100))
        assert max(after.scene.lanes[f"{lane.name}/0/-1"].nearest(point)[1] for point in points) < 0.1
    assert {one.actor.name for one in after.members} == {one.actor.name for one in compose(spec).members}
    assert "map expansion" in str(after.scene.info["source"])


def test_a_map_that_is_not_there_says_where_it_should_be(tables: Path, tmp_path) -> None:
    nobody = ScenarioSpec(scene="nuscenes", duration=2.0)
    with pytest.raises(ScenarioError, match="takes the map of a drive of nuScenes, and none is named"):
        compose(nobody)
    spec = replayed(ScenarioSpec(), tables).with_(scene="nuscenes")
    spec = spec.with_(traffic={"source": "nuscenes", "file": str(tables), "sequence": "scene-0061"})
    with pytest.raises(ScenarioFileError, match="the map of 'singapore-onenorth' is not there: .*maps/expansion"):
        compose(spec)
    with pytest.raises(ScenarioError, match="sequence"):
        compose(spec.with_(traffic={"source": "nuscenes", "file": str(tables), "sequence": "scene-1"}))


# -- tables as the original has them -----------------------------------------------------------------------------------

THINGS = {
    "ahead": Thing("vehicle.car", (1.9, 4.6, 1.7), around(20.0, 1.36)),
    "bus": Thing("vehicle.bus.rigid", (2.9, 11.0, 3.4), around(45.0, 2.62)),
    "parked": Thing("vehicle.car", (1.7, 3.9, 1.5), lambda time: (10.0, -8.0, 0.3)),
    "walker": Thing("human.pedestrian.adult", (0.7, 0.7, 1.62), lambda time: (5.0 + 1.3 * time, 12.0, 0.0)),
    "child": Thing("human.pedestrian.child", (0.5, 0.5, 1.2), lambda time: (8.0, 14.0 - 1.0 * time, -np.pi / 2.0)),
    "late": Thing(
        "vehicle.truck", (2.5, 9.0, 3.6), lambda time: around(-30.0, 2.275)(time) if 2.0 <= time <= 6.0 else None
    ),
    "back": Thing("vehicle.car", (1.8, 4.5, 1.45), lambda time: (-30.0 - 1.0 * time, 10.0, 0.0)),
    "cone": Thing("movable_object.trafficcone", (0.4, 0.4, 0.8), lambda time: (3.0, 3.0, 0.0)),
}


def test_wheelchairs_prams_and_dogs_are_those() -> None:
    riders = ("human.pedestrian.personal_mobility", "scooter")
    for category, model in (("human.pedestrian.wheelchair", "wheelchair"), ("animal", "dog"), riders):
        assert model_for(Track("t", category, (1.0, 0.6, 1.4), (), None)) == model
    low = Track("t", "human.pedestrian.adult", (0.6, 0.6, 1.4), (Placed(0.0, (0.0, 0.0, 0.7), 0.0),), None)
    assert model_for(low) not in ("wheelchair", "pram", "dog", "sitting_man")


def rear(time: float) -> tuple[float, float, float]:
    return around(0.0)(time)


@pytest.fixture
def tables(tmp_path: Path) -> Path:
    return write_tables(tmp_path / "v1.0-mini", THINGS, rear)


def test_boxes_at_2_hz_become_smooth_traffic(tables: Path) -> None:
    with pytest.warns(ScarlWarning, match="1 objects have no actor model.*trafficcone"):
        chosen = {one.name: one.model for one in read_nuscenes(tables, "scene-0061", span=(0.0, 8.0))}
    assert set(chosen) == {"car_0", "rigid_1", "car_2", "adult_3", "child_4", "truck_5", "car_6"}
    classes = {name: read_actor_model(model).semantic for name, model in chosen.items()}
    assert (classes["car_0"], classes["rigid_1"], classes["truck_5"]) == ("Car", "Bus", "Truck")
    for label, name in zip(THINGS, chosen, strict=False):
        assert body_of(chosen[name]).height == pytest.approx(THINGS[label].size[2], rel=0.2), name
    types = {"vehicle.car": "saloon", "vehicle.bus.rigid": "bus", "vehicle.truck": "lorry"}  # those of the levers above
    with pytest.warns(ScarlWarning, match="trafficcone"):
        found = read_nuscenes(tables, "scene-0061", span=(0.0, 8.0), conversion=Conversion(types=types))
    actors = {one.name: one for one in found}
    for label, name in zip(THINGS, actors, strict=False):
        actor = actors[name]
        for time in np.arange(*np.clip(actor.active, 0.0, 8.0), 0.05):
            x, y, heading = THINGS[label].at(time)  # type: ignore[misc]
            pose = actor.trajectory.pose(time)
            assert np.linalg.norm(pose.position[:2] - [x, y]) < 0.06, (name, time)
            assert pose.rotation[:, 0] @ [np.cos(heading), np.sin(heading), 0.0] > np.cos(np.radians(1.7)), (name, time)
        assert actor.deviation < 0.08
    assert actors["truck_5"].active == (2.0, 6.0)
    assert actors["car_6"].trajectory.twist(4.0).linear == pytest.approx([-1.0, 0.0, 0.0], abs=0.02)
    assert actors["car_6"].trajectory.pose(4.0).rotation[0, 0] > 0.99  # it reverses
    named = [(name, one.trajectory, one.body) for name, one in actors.items()]
    assert check_motion(named, np.arange(0.1, 7.9, 0.05), max_acceleration=4.0) == []


def test_the_ego_vehicle_of_the_original_is_known_by_its_rear_axle(tables: Path) -> None:
    """An actor with another wheelbase drives the way of the rear axle: its middle is ahead of it, round the bend."""
    for model in ("saloon", "bus"):
        body = body_of(model)
        motion = nuscenes_motion(tables, "scene-0061", "ego", body, Conversion())
        for time in (0.0, 2.03, 5.5, 8.0):
            pose = motion.pose(time)
            axle = pose.apply(np.array([[body.rear_axle, 0.0, 0.0]]))[0]
            np.testing.assert_allclose(axle[:2], rear(time)[:2], atol=0.03)


def test_boxes_that_vary_stand_still_and_what_is_smoothed_is_told(tmp_path: Path) -> None:
    folder = write_tables(tmp_path / "t", {name: THINGS[name] for name in ("ahead", "parked")}, rear, noise=0.07)
    actors = {one.name: one for one in read_nuscenes(folder, "scene-0061", span=(0.0, 8.0))}
    assert np.linalg.norm(actors["car_1"].trajectory.twist(3.0).linear) == 0.0
    np.testing.assert_allclose(actors["car_1"].trajectory.pose(3.0).position[:2], [10.0, -8.0], atol=0.1)
    assert check_motion([("ahead", actors["car_0"].trajectory, None)], np.arange(0.1, 7.9, 0.05), 12.0, 4.0) == []
    rough = write_tables(tmp_path / "rough", {"ahead": THINGS["ahead"]}, rear, noise=0.4)
    with pytest.warns(ScarlWarning, match=r"1 of 1 motions are smoothed by more than 0.3 m, 'car_0' by"):
        read_nuscenes(rough, "scene-0061")


def test_another_scene_of_the_tables_is_another_drive(tables: Path) -> None:
    motions = [
        nuscenes_motion(tables, name, "ego", body_of("saloon"), Conversion()) for name in ("scene-0061", "scene-9999")
    ]
    np.testing.assert_allclose(
        motions[1].pose(1.0).position - motions[0].pose(1.0).position, [500.0, 0.0, 0.0], atol=1e-6
    )
    with pytest.raises(ScenarioError, match="unknown sequence 'scene-0062'"):
        compose(scenario(tables, "scene-0062"))
    with pytest.raises(ScenarioError, match="unknown sequence"):  # two scenes, none is named
        compose(scenario(tables, None))


def scenario(tables: Path, sequence: str | None) -> ScenarioSpec:
    named = {} if sequence is None else {"sequence": sequence}
    return ScenarioSpec(
        scene="highway_guardrail",
        num_frames=3,
        ego={"trajectory": {"kind": "table", "file": str(tables), **named}},
        traffic={"source": "nuscenes", "file": str(tables), **named},
        collisions="allow",
    )


@pytest.mark.parametrize(
    ("table", "values", "said"),
    [
        ("sample", {"timestamp": "noon"}, "record 'k-scene-0061-0': timestamp = 'noon' is no time"),
        ("ego_pose", {"translation": [0.0, float("nan"), 0.0]}, "record 'd-scene-0061-LIDAR_TOP-0': translation"),
        ("ego_pose", {"rotation": [0, 0, 0, 0]}, "quaternion of length 0"),
        ("ego_pose", {"rotation": None}, "rotation = None is not 4 finite numbers"),
        ("sample_annotation", {"size": [1.0, -2.0, 1.0]}, "record 'a-scene-0061-ahead-0': size"),
        ("sample_annotation", {"instance_token": "none"}, "record 'a-scene-0061-ahead-0': instance 'none'"),
        ("instance", {"category_token": "none"}, "record 'i-scene-0061-ahead': category 'none'"),
        ("sample_data", {"token": 7}, "no record with a token"),
        ("scene", {"log_token": None}, "log_token = None is no text"),
    ],
)
def test_broken_records_are_named(tables: Path, table: str, values: dict, said: str) -> None:
    change(tables, table, 0, **values)
    with pytest.raises(TrajectoryFileError, match=said) as caught, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        read_nuscenes(tables, "scene-0061")
        nuscenes_motion(tables, "scene-0061", "ego", body_of("saloon"), Conversion())
    assert Path(str(caught.value.path)).name == f"{table}.json"


@pytest.mark.parametrize(
    "text",
    ["", "{}", "[", '[{"token": "a"', '[{"token": "a"} {"token": "b"}]', "[1, 2]", "[[[[", "\xff", "[" * 100_000],
)
def test_what_is_no_table_is_refused_with_its_file(tables: Path, text: str) -> None:
    (tables / "sample.json").write_text(text, encoding="latin-1")
    with pytest.raises(TrajectoryFileError, match="sample.json"):
        read_nuscenes(tables, "scene-0061")
    (tables / "sample.json").unlink()
    with pytest.raises(TrajectoryFileError, match="table not found"):
        read_nuscenes(tables, "scene-0061")


def test_errors_of_a_scenario_stand_at_its_line(tables: Path, tmp_path: Path) -> None:
    file = tmp_path / "drive.yaml"
    text = "scene: highway_guardrail\nego:\n  trajectory: {kind: table, file: v1.0-mini, sequence: scene-0061}\n"
    file.write_text(text + "traffic: {source: nuscenes, file: v1.0-mini, sequence: scene-0062}\n")
    with pytest.raises(ScenarioError, match="unknown sequence") as caught:
        compose(ScenarioSpec.load(file))
    assert caught.value.problems[0].line == 4
    change(tables, "ego_pose", 3, translation=None)
    with pytest.raises(ScenarioFileError, match="translation") as caught:
        compose(ScenarioSpec.load(file))
    assert caught.value.problems[0].line == 3
    file.write_text("traffic: {source: osi, file: run.osi, sequence: a}\n")
    with pytest.raises(ScenarioError, match="source nuscenes with a `sequence`"):
        ScenarioSpec.load(file)


def test_large_tables_are_read_row_by_row(tmp_path: Path) -> None:
    """Chunks of the reader end within records, within texts of several bytes and within numbers."""
    from scarl_sionna.core.untrusted.json_text import iterate_json_array

    rows = [{"token": f"é{k}", "value": k * 1_000_003, "text": "x" * (k % 977)} for k in range(6000)]
    path = tmp_path / "rows.json"
    for indent in (None, 1):
        path.write_text(json.dumps(rows, indent=indent, ensure_ascii=False), encoding="utf-8")
        assert path.stat().st_size > 2 * 2**20
        with path.open("rb") as file:
            assert list(iterate_json_array(file)) == rows
    path.write_text("[1, 23, " + "4" * 45 + "]")
    with path.open("rb") as file, pytest.raises(ValueError, match="45 digits"):
        list(iterate_json_array(file))
