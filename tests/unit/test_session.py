"""Sessions: the bytes of a simulation of the same motion, actors that come and go, rates, and bad input."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import (
    InputTypeError,
    ParameterRangeError,
    PlacementError,
    ScarlWarning,
    SessionError,
    UnknownNameError,
)
from scarl_sionna.fusion.rig import SensorMount
from tests.scenes import Thing, box, plane, write_scene

BODY = {2: "small_car", 3: None}
"""Said once, when an actor comes."""
TIMES = [0.0, 0.05, 0.1, 0.2]
EGO = {"kind": "waypoints", "times": [0, 1, 2], "positions": [[0, 0, 0], [8, 1, 0], [16, 4, 0]]}
CAR = {"kind": "waypoints", "times": [0, 1, 2], "positions": [[18, 2, 0], [22, 2, 0], [28, 0, 0]]}
RADAR = ss.RadarSpec().with_(num_chirps=16, num_samples=64)
FAST = ss.RadarSettings.of("raycast", num_rays=20_000)
MOUNT = ss.Pose([2.1, 0.0, 0.8])
RIG = ss.Rig(
    "light",
    (
        SensorMount("radar", "radar", RADAR, MOUNT, FAST),
        SensorMount("camera", "camera", ss.CameraSpec(width=48, height=32, samples_per_pixel=2), MOUNT),
        SensorMount("lidar", "lidar", ss.LidarSpec(scan=ss.RasterScan(num_azimuth=41, num_elevation=8)), MOUNT),
    ),
)
LIDAR, ONLY_RADAR = (ss.Rig(name, (RIG.sensors[number],)) for number, name in ((2, "lidar"), (0, "radar")))
"""The first where only motion is looked at."""


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> ss.World:
    path = write_scene(
        tmp_path_factory.mktemp("session"),
        instances=[
            Thing("ground", plane(400, 400), "Roads", is_object=False),
            Thing("house", box((10, 6, 8), (50, 20, 4)), "Building"),
        ],
        actors=[
            Thing("ego", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", EGO),
            Thing("car", box((4, 2, 1.5), (0, 0, 0.95)), "Car", "steel", CAR),
        ],
        ego="ego",
    )
    return ss.load_scene(path)


@pytest.fixture
def session(world: ss.World) -> Iterator[ss.Session]:
    settings = ss.SessionSettings(rates={"camera": 10.0, "lidar": 1.0}, radar=FAST)
    with ss.Session(world, RIG, settings) as made:
        yield made


def told(world: ss.World, time: float) -> dict[str, ss.ActorPose]:
    """Return what a simulator that knows the scene's motion says."""
    state = world.at(time)
    return {
        actor.name: ss.ActorPose(state.actor_pose(actor.name), state.actor_twist(actor.name)) for actor in world.actors
    }


def same(one: object, other: object) -> bool:
    """Return whether two results hold the same bytes."""
    arrays = {name: value for name, value in vars(one).items() if isinstance(value, np.ndarray)}
    assert arrays
    return all(value.tobytes() == getattr(other, name).tobytes() for name, value in arrays.items())


def test_the_bytes_are_those_of_a_simulation_of_the_same_motion(world: ss.World) -> None:
    with ss.Session(world, RIG, ss.SessionSettings(seed=3)) as session:
        stepped = [session.step(time, told(world, time)) for time in TIMES]
    for mine, frame in zip(stepped, ss.simulate(world, RIG, TIMES, seed=3), strict=True):
        assert list(mine.results) == list(frame.results) == list(RIG.names)
        assert all(same(result, frame.results[name]) for name, result in mine.results.items())
        assert repr(mine.objects) == repr(frame.objects)
        assert (mine.index, mine.timestamp_ns, mine.seed) == (frame.index, frame.timestamp_ns, frame.seed)
        assert mine.world_from_vehicle.quaternion.tobytes() == frame.world_from_vehicle.quaternion.tobytes()
    assert not same(stepped[0].results["radar"], stepped[1].results["radar"])  # the comparison can fail


def test_sensors_look_at_their_own_rates(session: ss.Session, world: ss.World) -> None:
    seen = [tuple(session.step(0.05 * n, told(world, 0.05 * n)).results) for n in range(5)]
    assert seen == [RIG.names, ("radar",), ("radar", "camera"), ("radar",), ("radar", "camera")]
    assert session.time == 0.2 and session.seconds["radar"] > 0.0
    later = session.step(1.13, told(world, 1.13))  # after a pause each looks once
    assert tuple(later.results) == RIG.names and later.index == 5


@pytest.mark.parametrize("start", [0.0, 0.123, 1.76e9, 1.76e9 + 1.0 / 3.0])
def test_rates_count_from_the_start_by_any_clock(world: ss.World, start: float) -> None:
    """Seconds since 1970 are rounded to 0.24 us: a camera of 30 Hz looked at the steps 0, 2, 5, 7, 8 of 60 a second."""
    settings = ss.SessionSettings(start=start, rates={"camera": 30.0, "lidar": 7.5})
    with ss.Session(world, RIG, settings) as session:
        due = [session._due(round((start + step / 60.0) * 1e9)) for step in range(600)]
    assert [step for step, names in enumerate(due) if "camera" in names] == list(range(0, 600, 2))
    assert [step for step, names in enumerate(due) if "lidar" in names] == list(range(0, 600, 8))
    assert all("radar" in names for names in due)


def test_velocities_are_derived_where_they_are_not_told(world: ss.World) -> None:
    turned = {0.0: ss.Pose([0, 0, 0]), 0.1: ss.Pose.from_euler([0.5, 0.1, 0], yaw=0.02)}
    with ss.Session(world, LIDAR, vehicle=ss.Pose([-30, 0, 1.0])) as session:
        session._rates = dict.fromkeys(session._rates, 1e-3)  # only motion is looked at
        with pytest.warns(ScarlWarning, match="'car' comes without its velocity"):
            first = session.step(0.0, {"car": turned[0.0]})
        second = session.step(0.1, {"car": turned[0.1]})
    np.testing.assert_array_equal(first.objects[-1].twist.linear, 0.0)
    state = session_twist(second)
    np.testing.assert_allclose(state.angular, [0, 0, 0.2], atol=1e-12)  # 0.02 rad in 0.1 s
    np.testing.assert_allclose(state.linear, [5.0, 1.0, 0.0], atol=0.01)  # of the box's centre, 0.95 m above


def session_twist(frame: ss.Frame) -> ss.Twist:
    return next(item.twist for item in frame.objects if item.name == "car")


def test_actors_come_and_go_and_a_record_gives_the_same_bytes(world: ss.World) -> None:
    rest = ss.Twist([6.0, 0.0, 0.0], [0.0, 0.0, 0.3])
    settings = ss.SessionSettings(bodies={"small_car": 1, "adult_man": 1}, detail="light", record=True, start=-0.3)
    with ss.Session(world, RIG, settings) as session:
        frames = []
        for number, time in enumerate(TIMES):
            poses = {"ego": told(world, time)["ego"]}
            if number == 1:
                poses["7"] = ss.ActorPose(ss.Pose([15, 0, 0]), rest, "small_car")
            if number >= 2:  # 7 has left, 8 has its body
                poses["8"] = ss.ActorPose(
                    ss.Pose([20.0 + 6.0 * time, 1, 0]), rest, "small_car" if number == 2 else None
                )
                poses["pete"] = ss.ActorPose(ss.Pose([12.0, -2, 0]), ss.Twist([1.2, 0, 0]), "adult_man")
            frames.append(session.step(time, poses))
            assert {item.name for item in frames[-1].objects if item.is_actor} == set(poses)
        assert session.actors == {"ego": "ego", "8": "body-1", "pete": "body-2"}
        seen = {item.name: item.num_lidar_points for item in frames[1].objects}
        assert seen["7"] > 0 and seen["house"] >= 0
        for mine, frame in zip(frames, ss.simulate(session.recorded(), RIG, TIMES), strict=True):
            assert all(same(result, frame.results[name]) for name, result in mine.results.items())
    with ss.Session(world, RIG) as other, pytest.raises(SessionError, match="record=True"):
        other.recorded()


def test_radars_and_stations_ride_on_actors_by_the_names_of_the_session(world: ss.World) -> None:
    other = ss.Interferer(radar=RADAR, actor="7", position=(-2.5, 0.0, 0.8), quaternion=(0.0, 0.0, 0.0, 1.0))
    stations = tuple({"name": name, "actor": name, "position": (0.0, 0.0, 2.0)} for name in ("7", "car"))
    radio = ss.RadioSpec(stations=stations, num_subcarriers=2)
    few = ss.RadioSettings(solver={"max_depth": 0, "num_samples": 5_000})
    rig = ss.Rig(
        "hears",
        (
            SensorMount("radar", "radar", RADAR, MOUNT, FAST.with_(interferers=(other,), noise=False)),
            SensorMount("radio", "radio", radio, ss.Pose([0.0, 0.0, 2.0]), few),
        ),
    )
    ego = ss.ActorPose(ss.Pose([0, 0, 0]), ss.Twist([10.0, 0, 0]))
    ahead = {name: ss.ActorPose(ss.Pose([x, 0, 0]), ss.Twist(), "small_car") for name, x in (("7", 20.0), ("8", 30.0))}
    steps = ({}, {"8": ahead["8"]}, dict(ahead), {"7": ahead["7"]}, {})
    settings = ss.SessionSettings(bodies={"small_car": 2}, detail="light", record=True)
    with ss.Session(world, rig, settings) as session:
        frames = [session.step(0.1 * number, {"ego": ego, **others}) for number, others in enumerate(steps)]
        recorded = session.recorded()
    for frame, others in zip(frames, steps, strict=True):
        source = frame.radars["radar"].diagnostics["interferers"][0]
        channels = frame.radios["radio"]
        assert bool(source["num_paths"]) == ("7" in others) == ("7" not in channels.diagnostics["absent_stations"])
        assert "car" in channels.diagnostics["absent_stations"] and channels.spec == radio
        if "7" in others:
            gain = 10.0 ** (source["path_gain_db"] / 20.0)
            assert RADAR.wavelength / (4.0 * np.pi * gain) == pytest.approx(20.0 - 2.5 - 2.1, rel=1e-6)
            assert channels.world_from_station[0, :3] == pytest.approx([20.0, 0.0, 2.0])
    again = ss.observe(recorded, rig, 0.2, vehicle=recorded.at(0.2).mount("ego"))
    assert same(again.radars["radar"], frames[2].radars["radar"])


def test_a_radar_and_a_station_may_ride_on_who_has_no_body_while_all_bodies_are_taken(world: ss.World) -> None:
    other = ss.Interferer(radar=RADAR, actor="7", position=(-2.5, 0.0, 0.8), quaternion=(0.0, 0.0, 0.0, 1.0))
    radio = ss.RadioSpec(stations=({"name": "7", "actor": "7", "position": (0.0, 0.0, 2.0)},), num_subcarriers=2)
    few = ss.RadioSettings(solver={"max_depth": 0, "num_samples": 5_000})
    rig = ss.Rig(
        "hears",
        (
            SensorMount("radar", "radar", RADAR, MOUNT, FAST.with_(interferers=(other,), noise=False)),
            SensorMount("radio", "radio", radio, ss.Pose([0.0, 0.0, 2.0]), few),
        ),
    )
    rest = ss.Twist()
    there = {"ego": ss.ActorPose(ss.Pose(), rest), "car": ss.ActorPose(ss.Pose([40, 0, 0]), rest)}
    with ss.Session(world, rig, ss.SessionSettings(bodies={"small_car": 1}, detail="light")) as session:
        for number, who in enumerate(("8", "7", "8")):  # 8 takes the body of 7, who leaves
            coming = {who: ss.ActorPose(ss.Pose([20, 0, 0]), rest, "small_car")}
            frame = session.step(0.1 * number, there | coming)
            source, channels = frame.radars["radar"].diagnostics["interferers"][0], frame.radios["radio"]
            assert bool(source["num_paths"]) == (who == "7") == (not channels.diagnostics["absent_stations"])
            assert np.isfinite(channels.world_from_station).all() == (who == "7")
            assert np.isfinite(channels.station_velocity).all() == (who == "7")
            assert session.world.at(0.1 * number).is_present("7") == (who == "7")
        with pytest.raises(UnknownNameError, match="actor '7'"):
            session.world.actor("7")
    with ss.Session(world, rig) as fixed, pytest.raises(UnknownNameError, match="actor '7'"):
        fixed.step(0.0, there)  # nobody can come by that name


def test_wheels_and_legs_do_not_keep_what_was_only_expected(world: ss.World) -> None:
    """A frame looks beyond its step (blocks of chirps, a turning lidar); joints must not sum what came otherwise."""
    settings = ss.SessionSettings(bodies={"small_car": 1}, record=True)
    with ss.Session(world, LIDAR, settings, vehicle=ss.Pose([-30, 0, 1.0])) as session:
        session._rates = dict.fromkeys(session._rates, 1e-3)
        actor = session.world.actor("body-1")
        for number, speed in enumerate((10.0, 2.0, 7.0, 1.0)):
            time = 0.25 * number  # the panels over which a joint sums: the rule's nodes see one speed each
            session.step(time, {"a": ss.ActorPose(ss.Pose([number, 0, 0]), ss.Twist([speed, 0, 0]), "small_car")})
            actor.motions(time + 0.6)  # over the ends of panels that later steps change
        live, replayed = actor.motions(0.75), session.recorded().actor("body-1").motions(0.75)
    way = 0.25 * (10.0 + 2.0 + 7.0)
    assert {name: motion.pose.quaternion.tobytes() for name, motion in live.items()} == {
        name: motion.pose.quaternion.tobytes() for name, motion in replayed.items()
    }
    wheel = next(joint for joint in actor.joints if hasattr(joint, "rolling"))
    assert wheel.rolling.at(0.75)[0] == pytest.approx(way, rel=1e-12)


@pytest.mark.some(4)
@pytest.mark.parametrize(
    ("time", "poses", "error", "words"),
    [
        (0.1, {"ego": ss.Pose()}, ParameterRangeError, "later than the last step"),
        (np.nan, {"ego": ss.Pose()}, ParameterRangeError, "finite"),
        (-0.1, {"ego": ss.Pose()}, ParameterRangeError, "SessionSettings\\(start"),
        ("1", {"ego": ss.Pose()}, InputTypeError, "number"),
        (0.2, {"ego": ss.Pose(), "egg": ss.Pose()}, UnknownNameError, "did you mean 'ego'"),
        (0.2, {"ego": ss.Pose(), "x": ss.ActorPose(ss.Pose(), body="tank")}, UnknownNameError, "unknown body 'tank'"),
        (0.2, {"car": ss.Pose()}, PlacementError, "'ego' carries the rig"),
        (0.2, {"ego": [0, 0, 0]}, InputTypeError, "poses\\['ego'\\]"),
        (0.2, [ss.Pose()], InputTypeError, "a mapping of names"),
        (0.2, {7: ss.Pose()}, InputTypeError, "name of an actor"),
        (0.2, {"ego": ss.ActorPose(ss.Pose(), body="suv")}, SessionError, "cannot change it"),
    ],
)
def test_bad_input_raises_and_leaves_the_session_as_it_was(
    world: ss.World, time: float, poses: dict, error: type[Exception], words: str
) -> None:
    session = ss.Session(world, LIDAR)
    session._rates = dict.fromkeys(session._rates, 1e-3)
    session.step(0.1, told(world, 0.1))
    with warnings.catch_warnings(), pytest.raises(error, match=words):
        warnings.simplefilter("error")
        session.step(time, poses)
    assert session.time == 0.1 and set(session.actors) == {"ego", "car"}
    session.step(0.2, told(world, 0.2))


def test_bad_poses_and_settings_are_refused() -> None:
    with pytest.raises(ParameterRangeError, match="three finite coordinates"):
        ss.ActorPose(ss.Pose([np.nan, 0, 0]))
    with pytest.raises(InputTypeError, match="ActorPose.pose"):
        ss.ActorPose([0, 0, 0])  # type: ignore[arg-type]
    with pytest.raises(ParameterRangeError, match="rates"):
        ss.SessionSettings(rates={"radar": 0.0})
    with pytest.raises(ParameterRangeError, match="bodies"):
        ss.SessionSettings(bodies={"saloon": 0})


def test_what_a_session_needs(world: ss.World, tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="sensor pattern"):
        ss.Session(world, RIG, ss.SessionSettings(rates={"sonar": 1.0}))
    with pytest.raises(UnknownNameError, match="tank"):
        ss.Session(world, RIG, ss.SessionSettings(bodies={"tank": 1}))
    with pytest.raises(UnknownNameError, match="unknown actor"):
        ss.Session(world, RIG, ss.SessionSettings(keep=("van",)))
    bare = ss.load_scene(write_scene(tmp_path, instances=[Thing("ground", plane(40, 40), "Roads", is_object=False)]))
    with pytest.raises(PlacementError, match="vehicle="):
        ss.Session(bare, RIG)
    full = ss.Session(bare, RIG, ss.SessionSettings(bodies={"small_car": 1}, detail="light"), vehicle="a")
    with pytest.raises(SessionError, match="all 1 bodies 'small_car' are taken"):
        full.step(0.0, {name: ss.ActorPose(ss.Pose(), ss.Twist(), "small_car") for name in "ab"})
    full.close()
    with pytest.raises(SessionError, match="closed"):
        full.step(0.0, {})
    assert "closed" in repr(full)


def test_what_the_scene_moves_goes_on_by_itself(world: ss.World) -> None:
    with ss.Session(world, LIDAR, ss.SessionSettings(keep=("car",))) as session:
        session._rates = dict.fromkeys(session._rates, 1e-3)
        frame = session.step(0.5, {"ego": ss.ActorPose(ss.Pose(), ss.Twist())})
    place = next(item.world_from_box.position for item in frame.objects if item.name == "car")
    np.testing.assert_array_equal(place[:2], world.at(0.5).actor_pose("car").position[:2])


def test_a_session_begins_anew_with_the_same_bytes(world: ss.World) -> None:
    session = ss.Session(world, ONLY_RADAR, ss.SessionSettings(radar=FAST))
    first = session.step(0.0, told(world, 0.0))
    session.step(0.5, {"ego": told(world, 0.5)["ego"]})
    session.restart()
    assert session.time is None and session.actors == {}
    again = session.step(0.0, told(world, 0.0))
    session.restart(seed=7)
    other = session.step(0.0, told(world, 0.0))
    assert same(first.results["radar"], again.results["radar"]) and again.index == 0
    assert not same(first.results["radar"], other.results["radar"])  # the noise of another seed


def test_a_sensor_inside_of_the_car_is_named_before_any_sensor_works(world: ss.World) -> None:
    inside = SensorMount("rear/radar", "radar", RADAR, ss.Pose([0.0, 0.0, 0.9]), FAST)
    rig = ss.Rig("last", (*RIG.sensors, inside))
    worked: list[str] = []
    with pytest.raises(PlacementError, match="'rear/radar' at .* is inside 'ego'"):
        ss.observe(world, rig, 0.1, on_stage=lambda name, _: worked.append(name))
    assert worked == []
    ss.observe(world, rig, 0.1, only=["lidar"])  # those that do not look may be anywhere
