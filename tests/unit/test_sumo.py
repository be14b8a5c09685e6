"""SUMO and CommonRoad: files, and live traffic on scenes of the package in which no car floats, sinks or jumps."""

from __future__ import annotations

import gzip
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ScarlWarning, SimulatorError, TrajectoryFileError
from scarl_sionna.engine.load import load_scene
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.checks.motion import check_ground, check_motion
from scarl_sionna.scenario.motion.bodies import ActorBody
from scarl_sionna.scenario.motion.paths import PathTrajectory, sample_motion
from scarl_sionna.scenario.motion.tables import read_table
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.people import person_for
from scarl_sionna.scenario.traffic.planned import Conversion, PlannedActor, lane_ground
from scarl_sionna.scenario.traffic.recorded.fcd import heading_of_angle, model_of_record, model_of_type, read_fcd
from scarl_sionna.scenario.traffic.simulated import DEFAULT_MIX
from scarl_sionna.scenario.traffic.sumo import _write_routes
from scarl_sionna.scenario.traffic.sumo_network import SumoNetwork
from scarl_sionna.scene.document.find import find_scene
from scarl_sionna.scene.document.scene_file import read_document
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables
from scenes_xml.actors.bodies.table import PEOPLE, Person

BODIES = {name: ActorBody() for name in ("saloon", "small_car", "suv", "van")} | {
    "bus": ActorBody(12.0, 2.5, 3.0, 6.0, -3.0),
    person_for("p"): ActorBody(0.55, 0.6, 1.75, 0.0, 0.0, "walk"),
}


def fcd(rows: str) -> str:
    return f"<fcd-export>{rows}</fcd-export>"


def north(step: float = 0.5, stop: float = 6.0) -> str:
    """Return a car going north at 10 m/s and a person going east at 1.5 m/s, as SUMO writes them (two decimals)."""
    text = ""
    for time in np.arange(0.0, stop + 1e-9, step):
        text += f'<timestep time="{time:.2f}">'
        text += (
            f'<vehicle id="c" x="100.00" y="{10.0 * time:.2f}" angle="0.00" type="city_bus" speed="10.00" '
            'pos="1" lane="e_0"/>'
        )
        text += f'<person id="p" x="{1.5 * time:.2f}" y="3.00" angle="90.00" type="ped" speed="1.50"/></timestep>'
    return fcd(text)


def test_angles_and_types() -> None:
    assert [np.degrees(heading_of_angle(angle)) for angle in (0.0, 90.0, 180.0)] == pytest.approx([90.0, 0.0, -90.0])
    names = ("suv", "DEFAULT_VEHTYPE", "truck_trailer", "city_bus", "veh_bicycle", "pedestrian", "delivery_2")
    known = ["suv", "saloon", "articulated_lorry", "bus", "bicycle", "adult_man", "van"]
    assert [model_of_type(name) for name in names] == known
    assert model_of_type("truck") == "lorry"
    assert [model_of_type(name) for name in ("woman_34", "dog", "wheelchair")] == ["woman_34", "dog", "wheelchair"]


def test_people_of_a_record_are_of_all_ages() -> None:
    """The same one for the same name; of the age, sex and about the height that the source says."""
    rows = {one.name: one for one in PEOPLE}
    names = [f"p{number}" for number in range(400)]

    def drawn(kind: str, **more: float) -> list[Person]:
        return [rows[person_for(name, kind, **more)] for name in names]

    anybody = [rows[model_of_record(name, "DEFAULT_PEDTYPE", True)] for name in names]
    assert anybody == [rows[model_of_record(name, "DEFAULT_PEDTYPE", True)] for name in names]
    assert len(set(anybody)) == sum(one.years >= 6 for one in PEOPLE)
    share = np.mean([one.years < 16 for one in anybody])
    assert abs(share - 0.16) < 5.0 * np.sqrt(0.16 * 0.84 / len(names))
    assert {one.years < 16 for one in drawn("school_child")} == {True}
    assert {one.female for one in drawn("womanWithBag")} == {True} and {one.female for one in drawn("man")} == {False}
    assert {one.years >= 16 for one in drawn("adult_ped")} == {True} and len({*drawn("human")}) > 20
    assert all(abs(one.height - 1.8) <= 0.15 for one in drawn("", height=1.8))
    assert (
        min(one.height for one in drawn("", height=0.9)) == 0.95
        and max(one.years for one in drawn("", height=0.9)) < 12
    )
    assert model_of_record("p", "dog") == "dog" and model_of_record("p", "girl_5") == "girl_5"
    assert model_of_record("v", "truck_trailer") == "articulated_lorry"


@pytest.mark.parametrize("suffix", ["fcd.xml", "fcd.xml.gz"])
def test_fcd_file(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / suffix
    path.write_bytes(gzip.compress(north().encode()) if suffix.endswith("gz") else north().encode())
    actors = {actor.name: actor for actor in read_fcd(path, models=BODIES)}
    car, person = actors["c"], actors["p"]
    assert car.model == "bus" and person.model == person_for("p")
    # the front bumper is at y = 10 t: the middle of 12 m is 6 m behind; positions are rounded to 5 mm
    assert car.trajectory.pose(3.0).position == pytest.approx([100.0, 30.0 - 6.0, 0.0], abs=0.01)
    assert car.trajectory.pose(3.0).yaw == pytest.approx(np.pi / 2, abs=1e-3)
    assert car.trajectory.twist(3.0).linear == pytest.approx([0.0, 10.0, 0.0], abs=0.02)
    assert person.trajectory.pose(2.0).position == pytest.approx([3.0, 3.0, 0.0], abs=0.01)
    assert car.deviation < 0.01 and car.active == (0.0, 6.0)
    assert set(read_table(path, models=BODIES)) == {"c", "p"}


def test_fcd_span_and_ground(tmp_path: Path) -> None:
    path = tmp_path / "fcd.xml"
    path.write_text(north())
    slope = lanes_from_tables([{"name": "a", "points": [[100.0, -50.0, 0.0], [100.0, 150.0, 10.0]]}])
    (car,) = [one for one in read_fcd(path, span=(-2.0, 9.0), ground=slope, models=BODIES) if one.name == "c"]
    assert (car.trajectory.start, car.trajectory.stop) == (-2.0, 9.0)
    pose = car.trajectory.pose(3.0)
    assert pose.position[2] == pytest.approx(
        0.05 * (24.0 + 50.0), abs=0.02
    )  # heights stand at points 0.25 m apart: 6 mm, and rounding
    assert np.degrees(np.arcsin(pose.rotation[2, 0])) == pytest.approx(np.degrees(np.arctan(0.05)), abs=0.3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            fcd('<timestep time="0.0"><vehicle id="a" x="oops" y="0" angle="0"/></timestep>'),
            "vehicle 'a' at 0 s: x is 'oops'",
        ),
        (fcd('<timestep time="0.0"><vehicle id="a" x="1" y="0"/></timestep>'), "angle is missing"),
        (fcd('<timestep><vehicle id="a" x="1" y="0" angle="0"/></timestep>'), "timestep.*time is missing"),
        ("<net></net>", "root element is <net>"),
        ("<fcd-export><timestep", "not valid XML"),
    ],
)
def test_a_wrong_file_is_told(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "f.xml"
    path.write_text(text)
    with pytest.raises(TrajectoryFileError, match=message):
        read_fcd(path)
    with pytest.raises(TrajectoryFileError, match="cannot be read"):
        read_fcd(tmp_path / "none.xml")


def test_teleports_and_single_instants_are_left_out(tmp_path: Path) -> None:
    text = "".join(
        f'<timestep time="{time}"><vehicle id="t" x="{10.0 * time + (900.0 if time > 2 else 0.0)}" y="0" angle="90" '
        'type="car"/></timestep>'
        for time in range(5)
    )
    path = tmp_path / "f.xml"
    path.write_text(fcd(text + '<timestep time="9"><vehicle id="once" x="0" y="0" angle="0" type="car"/></timestep>'))
    with pytest.warns(ScarlWarning) as caught:
        assert read_fcd(path, models=BODIES) == []
    assert any("'t' is left out" in str(one.message) for one in caught) and any(
        "one instant" in str(one.message) for one in caught
    )


def _inside(actors: list[PlannedActor], times: np.ndarray) -> list[tuple[str, PathTrajectory, ActorBody, np.ndarray]]:
    rows = []
    for actor in actors:
        present = times[(times >= actor.active[0] + 0.01) & (times <= actor.active[1] - 0.01)]
        if present.size and isinstance(actor.trajectory, PathTrajectory):
            rows.append((actor.name, actor.trajectory, actor.body, present))
    return rows


def _check_drive(network: LaneNetwork, actors: list[PlannedActor], duration: float, beside: float) -> None:
    """No car floats or sinks by more than 2 cm from its lanes, none jumps, and none does what cars cannot."""
    times = np.arange(0.0, duration + 1e-9, 0.05)
    assert check_motion([(one.name, one.trajectory) for one in actors], times[1:-1]) == []
    ground = lane_ground(network)
    for name, trajectory, body, present in _inside(actors, times):
        motion = sample_motion(trajectory, present)
        along = np.stack([np.cos(motion.heading), np.sin(motion.heading)], 1)
        height = motion.position[:, 2] - ground(motion.position[:, :2])
        assert np.abs(height).max() < 0.02, name
        near = np.concatenate([lane.at(np.arange(0.0, lane.length, 0.2))[:, :2] for lane in network.lanes])
        rear = motion.position[:, :2] + body.rear_axle * along
        assert cKDTree(near).query(rear)[0][np.abs(rear).max(1) < 130.0].max(initial=0.0) < beside, name
        assert trajectory.speed(present).max() < 20.0 and trajectory.speed(present).min() > -0.1
        turn = trajectory.sample(present)[4][:, 2]
        assert np.abs(turn * trajectory.speed(present)).max() < 6.0, (
            name
        )  # lateral acceleration of a brisk driver [m/s2]
    deviations = sorted(one.deviation for one in actors)
    assert deviations[-1] < (0.5 if beside > 1.0 else 0.25)  # SUMO moves one that stands to the side, as no car can
    assert deviations[-2] < 0.25


@pytest.mark.parametrize(
    ("scene", "beside"),
    [
        ("roundabout", 0.3),
        pytest.param("signalised_crossing", 1.9, marks=pytest.mark.slow),
    ],  # lanes to change to: half a lane
)
def test_60_s_of_sumo_on_a_scene(scene: str, beside: float) -> None:
    pytest.importorskip("libsumo")
    from scarl_sionna.scenario.traffic.sumo import run_sumo

    network = read_document(find_scene(scene)).lanes
    assert network is not None
    actors = run_sumo(network, (0.0, 60.0), TrafficSpec(density=8.0, seed=1))
    assert len(actors) >= 15
    _check_drive(network, actors, 60.0, beside)
    moved = [
        np.ptp(
            sample_motion(one.trajectory, np.array([one.active[0] + 0.01, one.active[1] - 0.01])).position, axis=0
        ).max()
        for one in actors
    ]
    assert np.median(moved) > 50.0  # nobody stands for good
    hits = find_collisions([(one.name, one.trajectory, one.body) for one in actors], np.arange(0.0, 60.0, 0.1), 0.1)
    when = {one.name: one.active for one in actors}
    assert [
        hit for hit in hits if all(when[name][0] <= hit.time <= when[name][1] for name in (hit.first, hit.second))
    ] == []


@pytest.mark.slow
def test_sumo_vehicles_stand_on_the_ground_of_the_scene() -> None:
    pytest.importorskip("libsumo")
    from scarl_sionna.scenario.traffic.sumo import run_sumo

    world = load_scene("roundabout", detail="light")
    network = world.document.lanes
    assert network is not None
    actors = run_sumo(network, (0.0, 20.0), TrafficSpec(density=8.0, seed=4))
    faults = []
    for name, trajectory, body, present in _inside(actors, np.arange(0.0, 20.0, 1.0)):
        faults += check_ground(world, [(name, trajectory, body)], present, tolerance=0.02)
    low, high = -125.0, 125.0  # lanes go to 145 m; the scene's edge is left out
    shown = [
        fault
        for fault in faults
        if all(
            low < x < high
            for x in next(a for a in actors if a.name == fault.name).trajectory.pose(fault.time).position[:2]
        )
    ]
    assert shown == []


def test_heavy_vehicles_and_bicycles_are_those_of_sumo(tmp_path: Path) -> None:
    """Every long vehicle is a truck that keeps its own limit, and who pedals is a bicycle."""
    roads = SumoNetwork(tmp_path / "lanes.net.xml", {"a": 500.0}, {"a": 30.0}, {"a": ()}, ("a",))
    mix = dict(DEFAULT_MIX) | {"articulated_lorry": 0.1, "bicycle": 0.1, "cargo_bike": 0.1}
    types = ElementTree.parse(_write_routes(tmp_path, roads, 10.0, TrafficSpec(mix=mix), None)).findall("vType")
    assert len(types) == len(mix)
    for one in types:
        length, kind, top = float(one.get("length")), one.get("vClass"), float(one.get("maxSpeed"))
        assert (kind == "truck") == (length > 7.0) == (25.0 <= top <= 27.8), one.get("id")
        assert (kind == "bicycle") == (top == 6.0) == ("bi" in one.get("id") and length < 3.0), one.get("id")


def test_same_seed_same_traffic() -> None:
    pytest.importorskip("libsumo")
    from scarl_sionna.scenario.traffic.sumo import run_sumo

    network = lanes_from_tables([{"name": "a", "points": [[0.0, 0.0, 0.0], [400.0, 0.0, 0.0]]}])
    own = Conversion(models=BODIES)
    runs = [run_sumo(network, (0.0, 5.0), TrafficSpec(density=20.0, seed=seed), conversion=own) for seed in (7, 7, 8)]
    first, again, other = ([one.trajectory.pose(2.5).position.tobytes() for one in run] for run in runs)
    assert first == again and first != other and len(first) >= 4


def test_configuration_of_sumo(tmp_path: Path) -> None:
    pytest.importorskip("libsumo")
    from scarl_sionna.scenario.traffic.sumo import run_sumo
    from scarl_sionna.scenario.traffic.sumo_network import write_sumo_network

    roads = write_sumo_network(
        lanes_from_tables([{"name": "a", "points": [[0.0, 0.0, 0.0], [200.0, 0.0, 0.0]]}]), tmp_path
    )
    assert roads.entries == ("a",)
    (tmp_path / "r.rou.xml").write_text(
        '<routes><vType id="my_bus" length="12" maxSpeed="10"/><vehicle id="b" type="my_bus" depart="0" '
        'departSpeed="max">'
        '<route edges="a"/></vehicle></routes>'
    )
    (tmp_path / "s.sumocfg").write_text(
        '<configuration><input><net-file value="lanes.net.xml"/><route-files '
        'value="r.rou.xml"/></input></configuration>'
    )
    (bus,) = run_sumo(tmp_path / "s.sumocfg", (0.0, 5.0), conversion=Conversion(models=BODIES))
    assert bus.model == "bus" and bus.trajectory.twist(2.0).linear == pytest.approx([10.0, 0.0, 0.0], abs=0.5)
    (tmp_path / "bad.sumocfg").write_text(
        '<configuration><input><net-file value="none.net.xml"/></input></configuration>'
    )
    with pytest.raises(SimulatorError, match="SUMO stopped"):
        run_sumo(tmp_path / "bad.sumocfg", (0.0, 5.0))
    with pytest.raises(SimulatorError, match="is not there"):
        run_sumo(tmp_path / "none.sumocfg", (0.0, 5.0))


COMMONROAD = """<?xml version='1.0' encoding='UTF-8'?>
<commonRoad timeStepSize="0.1" commonRoadVersion="2020a" author="" affiliation="" source=""
benchmarkID="ZAM_Tiny-1_1_T-1" date="2026-01-01">
<location><geoNameId>-999</geoNameId><gpsLatitude>999</gpsLatitude><gpsLongitude>999</gpsLongitude></location>
<scenarioTags><urban/></scenarioTags>
<lanelet id="1"><leftBound><point><x>0</x><y>2</y></point><point><x>200</x><y>2</y></point></leftBound>
<rightBound><point><x>0</x><y>-2</y></point><point><x>200</x><y>-2</y></point></rightBound><laneletType>urban</laneletType></lanelet>
<dynamicObstacle id="10"><type>bus</type><shape><rectangle><length>12</length><width>2.5</width></rectangle></shape>
<initialState>{first}<velocity><exact>10</exact></velocity></initialState><trajectory>{states}</trajectory></dynamicObstacle>
<planningProblem id="100"><initialState>{first}<velocity><exact>1</exact></velocity>
<yawRate><exact>0</exact></yawRate><slipAngle><exact>0</exact></slipAngle>
</initialState><goalState><time><intervalStart>10</intervalStart><intervalEnd>20</intervalEnd></time></goalState></planningProblem></commonRoad>"""


def commonroad_state(step: int) -> str:
    place = f"<position><point><x>{5 + step}.0</x><y>0</y></point></position>"
    return f"{place}<orientation><exact>0</exact></orientation><time><exact>{step}</exact></time>"


def test_commonroad(tmp_path: Path) -> None:
    pytest.importorskip("commonroad")
    from scarl_sionna.scenario.traffic.recorded.commonroad import read_commonroad

    path = tmp_path / "c.xml"
    states = "".join(
        f"<state>{commonroad_state(step)}<velocity><exact>10</exact></velocity></state>" for step in range(1, 31)
    )
    path.write_text(COMMONROAD.format(first=commonroad_state(0), states=states))
    (bus,) = read_commonroad(path, models=BODIES)
    assert (bus.name, bus.model, bus.active) == ("obstacle_10", "bus", (0.0, pytest.approx(3.0)))
    assert bus.trajectory.pose(1.55).position == pytest.approx([20.5, 0.0, 0.0], abs=1e-6)  # the middle, not the front
    assert bus.trajectory.twist(1.55).linear == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)
    assert list(read_table(path, models=BODIES)) == ["obstacle_10"]
    path.write_text("<commonRoad></commonRoad>")
    with pytest.raises(TrajectoryFileError, match="commonroad-io"):
        read_commonroad(path)
