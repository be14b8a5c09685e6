"""OpenSCENARIO files: parameters, catalogs, surroundings, who is there, errors with their lines, and as a scenario."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scenariogeneration import xosc

import scarl_sionna as ss
from scarl_sionna.core.errors import ScenarioError, ScenarioFileError, UnsupportedElementError
from scarl_sionna.scenario.checks.motion import check_motion
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.motion.tables import read_table
from scarl_sionna.scenario.openscenario.actors import read_openscenario
from scarl_sionna.scenario.openscenario.drive import read_drive
from scarl_sionna.scenario.openscenario.reading.expressions import resolved
from tests import openscenario_files as files


@pytest.mark.parametrize(
    "text, wanted",
    [
        ("7.5", "7.5"),
        ("$speed", "36"),
        ("${$speed / 3.6}", "10"),
        ("${-2 * ($speed - 30) + 1}", "-11"),
        ("${round(2 * pi * 1000)}", "6283"),
        ("${round(2.5) + floor(2.7) + ceil(2.1) + sqrt(9) + pow(2, 3) + abs(-1) + sign(-4)}", "19"),
        ("${$speed > 30 and not $wet}", "true"),
        ("${max(1, $speed, 2) % 7}", "1"),
        ("", ""),
    ],
)
def test_values_are_resolved(text, wanted):
    assert resolved(text, {"speed": "36", "wet": "false"}) == wanted


@pytest.mark.parametrize(
    "text",
    ["$none", "${1 / 0}", "${__import__('os')}", "${(1).real}", "${[1][0]}", "${" + "(" * 300 + ")" * 300 + "}",
     "${" + "1+" * 3000 + "1}", "${2 ** 9}", "${'a' * 9}", "${sqrt(-1)}", "a$speed", "${9e999}", "${pow(9, 9999)}"],
)  # fmt: skip # a table
def test_what_is_no_value_is_refused(text):
    with pytest.raises(ValueError):
        resolved(text, {"speed": "36"})


def test_catalogs_give_entities_and_maneuvers_with_parameters(tmp_path):
    (tmp_path / "catalogs").mkdir()
    (tmp_path / "catalogs" / "all.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><Catalog name="all">'
        '<Vehicle name="long" vehicleCategory="bus"><BoundingBox><Center x="3" y="0" z="1"/>'
        '<Dimensions width="2.5" length="12" height="3"/></BoundingBox></Vehicle>'
        '<Maneuver name="brake"><ParameterDeclarations><ParameterDeclaration name="after" parameterType="double" '
        'value="9"/><ParameterDeclaration name="to" parameterType="double" value="1"/></ParameterDeclarations>'
        + files.event(files.speed(0.0, "linear", "time", 2.0), files.after(0.0))
        .replace('AbsoluteTargetSpeed value="0.0"', 'AbsoluteTargetSpeed value="${$to * 2}"')
        .replace('SimulationTimeCondition value="0.0"', 'SimulationTimeCondition value="$after"')
        + "</Maneuver></Catalog></OpenSCENARIO>"
    )
    reference = '<CatalogReference catalogName="all" entryName="{}"/>'
    assigned = (
        '<CatalogReference catalogName="all" entryName="brake"><ParameterAssignments>'
        '<ParameterAssignment parameterRef="$after" value="$when"/></ParameterAssignments></CatalogReference>'
    )
    group = files.group("Ego", files.event("", "")).replace(files.event("", ""), "")
    act = group.replace('<Maneuver name="group_maneuver"></Maneuver>', assigned)
    text = files.scenario(
        f'<ScenarioObject name="Ego">{reference.format("long")}</ScenarioObject>',
        files.init("Ego", files.on_lane(50.0), 10.0),
        act,
        parameters='<ParameterDeclaration name="when" parameterType="double" value="4"/>',
        catalogs='<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>',
    )
    ego = files.run(tmp_path, text)["Ego"]
    assert ego.model == "bus"
    assert files.rear_axle(ego, 8.0)[0] == pytest.approx(50.0 + 40.0 + 12.0 + 2.0 * 2.0, abs=0.05)


@pytest.mark.parametrize(
    "old, new, kind, words",
    [
        ("<AbsoluteTargetSpeed value=\"9.0\"/>", "<AbsoluteTargetSpeed value=\"fast\"/>", ScenarioError, "no number"),
        ("<AbsoluteTargetSpeed value=\"9.0\"/>", "<AbsoluteTargetSpeed value=\"$v\"/>", ScenarioError, "not declared"),
        ("<AbsoluteTargetSpeed value=\"9.0\"/>", "<AbsoluteTargetSpeed/>", ScenarioError, "has no 'value'"),
        ('dynamicsShape="linear"', 'dynamicsShape="square"', ScenarioError, "sinusoidal"),
        ("<SpeedAction>", "<FlyAction/><SpeedAction>", UnsupportedElementError, "FlyAction"),
        ('entityRef="Ego"/></Actors>', 'entityRef="Nobody"/></Actors>', ScenarioError, "is no entity"),
        ('selectTriggeringEntities="false"', 'selectTriggeringEntities="true"', UnsupportedElementError,
         "name the actors"),
        ('laneId="-1"', 'laneId="-7"', ScenarioError, "has no lane -7"),
        ('roadId="1"', 'roadId="12"', ScenarioError, "no road '12'"),
        ('s="20.0"', 's="9000"', ScenarioError, "is not on road"),
        ("<SimulationTimeCondition value=\"2.0\"", "<UserDefinedValueCondition value=\"2.0\"", UnsupportedElementError,
         "ParameterCondition"),
        ("LanePosition", "GeoPosition", UnsupportedElementError, "LanePosition"),
        ('priority="parallel"', 'priority="first"', ScenarioError, "priority"),
        ("road.xodr", "gone.xodr", ScenarioFileError, "not found"),
        ('revMajor="1"', 'revMajor="2"', UnsupportedElementError, "1.0 to 1.3"),
        ("<Storyboard>", "<Storybord>", ScenarioFileError, "not valid XML"),
        ("<OpenSCENARIO>", "<!DOCTYPE a><OpenSCENARIO>", ScenarioFileError, "document type"),
    ],
)  # fmt: skip # a table
def test_errors_name_line_and_what_would_do(tmp_path, old, new, kind, words):
    act = files.group("Ego", files.event(files.speed(9.0, "linear", "time", 2.0), files.after(2.0)))
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0), 20.0), act)
    assert old in text
    lines = text.replace(old, new).replace("><", ">\n<").splitlines()
    path = files.written(tmp_path, "\n".join(lines))
    with pytest.raises(kind, match=words.replace(".", r"\.")) as caught:
        read_openscenario(path)
    if kind is not ScenarioFileError:
        assert caught.value.line is not None and caught.value.file == str(path)
        assert any(word in lines[caught.value.line - 1] for word in (new.split(">")[0].split()[0].strip("<>/"), new))


def test_all_that_is_not_read_is_named_at_once(tmp_path):
    wrong = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
    act = files.group("Ego", files.event(wrong, files.after(2.0)), files.event(wrong, files.after(3.0)))
    text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0)), act.replace("><", ">\n<"))
    with pytest.raises(UnsupportedElementError, match="AssignRouteAction") as caught:
        read_openscenario(files.written(tmp_path, text))
    assert len(caught.value.problems) == 2


def test_a_run_without_an_end_is_cut(tmp_path, monkeypatch):
    from scarl_sionna.scenario.openscenario.running import simulation

    monkeypatch.setattr(simulation.Simulation.simulate, "__defaults__", (3.0,))
    path = files.written(
        tmp_path, files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0)), stop=9.0)
    )
    with pytest.warns(match="no StopTrigger within 3 s"):
        assert read_drive(path).run.stop == pytest.approx(3.0, abs=1e-6)


def test_light_and_weather_are_those_of_the_environment(tmp_path):
    environment = (
        '<GlobalAction><EnvironmentAction><Environment name="e"><TimeOfDay animation="false" '
        'dateTime="2024-06-21T12:00:00"/><Weather fractionalCloudCover="fourOktas" temperature="283.15">'
        '<Sun azimuth="1.5707963" elevation="0.5" illuminance="9"/><Fog visualRange="400"/>'
        '<Precipitation precipitationType="rain" precipitationIntensity="4"/><Wind direction="0" speed="3"/></Weather>'
        '<RoadCondition frictionScaleFactor="1" wetness="moist"/></Environment></EnvironmentAction></GlobalAction>'
    )
    actions = environment + files.init("Ego", files.on_lane(20.0), 5.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # friction has no effect
        spec = ss.ScenarioSpec.load(files.written(tmp_path, files.scenario(files.vehicle("Ego"), actions)))
    assert spec.lighting is not None and spec.weather is not None
    assert spec.lighting.sun_azimuth_deg == pytest.approx(0.0, abs=1e-3)  # east is +x
    assert spec.lighting.sun_elevation_deg == pytest.approx(np.degrees(0.5), abs=1e-3)
    assert spec.lighting.cloud_cover == 0.5
    assert (spec.weather.rain_rate, spec.weather.visibility, spec.weather.wetness) == (4.0, 400.0, 0.3)
    assert spec.weather.wind == (3.0, 0.0) and spec.weather.temperature_celsius == pytest.approx(10.0)


def test_who_is_hidden_is_not_there(tmp_path):
    hide = '<PrivateAction><VisibilityAction graphics="false" sensors="false" traffic="true"/></PrivateAction>'
    actions = files.init("Ego", files.on_lane(20.0), 10.0) + files.init("other", files.on_lane(80.0), 10.0)
    act = files.group("other", files.event(hide, files.after(3.0)))
    late = f"<AddEntityAction>{files.on_lane(200.0)}</AddEntityAction>"
    late = f'<GlobalAction><EntityAction entityRef="late">{late}</EntityAction></GlobalAction>'
    act += files.group("", files.event(late, files.after(5.0)), name="adds")
    everyone = files.vehicle("Ego") + files.vehicle("other") + files.vehicle("late")
    found = files.run(tmp_path, files.scenario(everyone, actions, act))
    assert found["Ego"].active == (-np.inf, np.inf)
    assert found["other"].active == pytest.approx((-np.inf, 3.0), abs=0.011)
    assert found["late"].active == pytest.approx((5.0, np.inf), abs=0.011)


def test_what_cannot_be_smooth_is_refused(tmp_path):
    for action, words in (
        (files.teleport(files.on_lane(300.0)), "carries 'Ego'"),
        (files.lane_change('<AbsoluteTargetLane value="-2"/>', "step"), "3.5 m to the side"),
    ):
        act = files.group("Ego", files.event(action, files.after(2.0)))
        text = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(20.0), 20.0), act)
        with pytest.raises(UnsupportedElementError, match=words):
            read_openscenario(files.written(tmp_path, text))


def test_models_are_the_nearest_in_size(tmp_path):
    everyone = (
        "".join(files.vehicle(name, name) for name in ("car", "van", "truck", "bus", "motorbike", "bicycle"))
        + '<ScenarioObject name="cone"><MiscObject name="c" miscObjectCategory="obstacle" mass="1"/></ScenarioObject>'
    )
    actions = "".join(
        files.init(name, files.on_lane(40.0 * k + 40.0))
        for k, name in enumerate(("car", "van", "truck", "bus", "motorbike", "bicycle", "cone"))
    )
    path = files.written(tmp_path, files.scenario(everyone, actions, stop=1.0))
    with pytest.warns(match=r"no actor model stands for 'cone'"):
        found = {actor.name: actor.model for actor in read_openscenario(path, types={"van": "lorry"})}
    assert found == {
        "car": "saloon",
        "van": "lorry",
        "truck": "box_van",
        "bus": "bus",
        "motorbike": "motorcycle",
        "bicycle": "bicycle",
    }


def cut_in(tmp_path):
    """A cut-in as scenariogeneration writes it."""
    box = xosc.BoundingBox(1.8, 4.5, 1.5, 1.4, 0, 0.75)
    axles = (xosc.Axle(0.5, 0.8, 1.6, 2.7, 0.4), xosc.Axle(0.0, 0.8, 1.6, 0.0, 0.4))
    entities, init = xosc.Entities(), xosc.Init()
    for name, lane, s, speed in (("Ego", -1, 50.0, 20.0), ("other", -2, 30.0, 25.0)):
        entities.add_scenario_object(name, xosc.Vehicle(name, xosc.VehicleCategory.car, box, *axles, 60, 8, 10))
        init.add_init_action(name, xosc.TeleportAction(xosc.LanePosition(s, 0, lane, "1")))
        step = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 0)
        init.add_init_action(name, xosc.AbsoluteSpeedAction(speed, step))
    trigger = xosc.EntityTrigger(
        "near", 0, xosc.ConditionEdge.rising, xosc.TimeHeadwayCondition("other", 0.5, xosc.Rule.greaterThan), "Ego"
    )
    event = xosc.Event("cut in", xosc.Priority.override)
    event.add_trigger(trigger)
    smooth = xosc.TransitionDynamics(xosc.DynamicsShapes.sinusoidal, xosc.DynamicsDimension.time, 3)
    event.add_action("change", xosc.AbsoluteLaneChangeAction(-1, smooth))
    maneuver = xosc.Maneuver("maneuver")
    maneuver.add_event(event)
    group = xosc.ManeuverGroup("group")
    group.add_actor("other")
    group.add_maneuver(maneuver)
    start = xosc.ValueTrigger("s", 0, xosc.ConditionEdge.none, xosc.SimulationTimeCondition(0, xosc.Rule.greaterThan))
    stop = xosc.ValueTrigger(
        "e", 0, xosc.ConditionEdge.none, xosc.SimulationTimeCondition(12, xosc.Rule.greaterThan), "stop"
    )
    act = xosc.Act("act", start)
    act.add_maneuver_group(group)
    board = xosc.StoryBoard(init, stop)
    board.add_act(act)
    whole = xosc.Scenario(
        "cut in", "tests", xosc.ParameterDeclarations(), entities, board, xosc.RoadNetwork("road.xodr"), xosc.Catalog()
    )
    (tmp_path / "road.xodr").write_text(files.STRAIGHT)
    path = tmp_path / "cut_in.xosc"
    whole.write_xml(str(path))
    return path


def test_the_file_is_a_scenario(tmp_path):
    path = cut_in(tmp_path)
    spec = ss.ScenarioSpec.load(path)
    assert (spec.num_frames, spec.scene_name) == (120, "cut_in")
    found = compose(spec)
    assert [member.actor.name for member in found.members] == ["ego", "other"]
    motions = {member.actor.name: member.actor.trajectory for member in found.members}
    fires = (0.5 * 20.0 + 4.5 + 20.0) / 5.0  # 20 m behind, 5 m/s faster, then half a second of free space ahead
    for time in np.arange(0.0, 11.5, 0.25):
        share = min(max((time - fires) / 3.0, 0.0), 1.0)
        y = -5.25 + 3.5 * 0.5 * (1.0 - np.cos(np.pi * share))
        pose = motions["other"].pose(time)
        place = pose.position + pose.rotation @ np.array([found.members[1].body.rear_axle, 0.0, 0.0])
        assert place == pytest.approx([30.0 + 25.0 * time, y, 0.0], abs=0.05)
        step = (motions["other"].pose(time + 1e-4).position - pose.position) / 1e-4
        assert motions["other"].twist(time).linear == pytest.approx(step, abs=0.02)  # the derivative, for Doppler
    actors = [(one.actor.name, one.actor.trajectory, one.body) for one in found.members]
    assert not check_motion(actors, np.arange(0.0, 11.9, 0.01), 70.0, 10.0, 40.0)
    assert set(read_table(path)) == {"Ego", "other"}


def test_a_scenario_file_takes_another_map_and_model(tmp_path):
    path = cut_in(tmp_path)
    (tmp_path / "road.xodr").rename(tmp_path / "other.xodr")
    (tmp_path / "drive.yaml").write_text(
        "scene: other.xodr\nduration: 4.0\nkeep_default_actors: false\n"
        "ego: {model: suv, trajectory: {kind: table, file: cut_in.xosc}}\n"
        "traffic: {source: openscenario, file: cut_in.xosc}\n"
    )
    found = compose(ss.ScenarioSpec.load(tmp_path / "drive.yaml"))
    assert [(one.actor.name, one.actor.model.name) for one in found.members] == [("ego", "suv"), ("other", "saloon")]
    with pytest.raises(ScenarioFileError, match="name another map"):
        ss.ScenarioSpec.load(path)
    text = (tmp_path / "drive.yaml").read_text().replace("4.0", "40.0")
    (tmp_path / "drive.yaml").write_text(text)
    with pytest.raises(ScenarioError, match="outside the motion"):
        compose(ss.ScenarioSpec.load(tmp_path / "drive.yaml"))


def test_a_catalog_decides_the_frames(tmp_path):
    from scarl_sionna.scenario.fingerprint import fingerprint

    (tmp_path / "catalogs").mkdir()
    catalog = tmp_path / "catalogs" / "cars.xosc"
    text = '<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><Catalog name="cars">{}</Catalog></OpenSCENARIO>'
    catalog.write_text(text.format(""))
    place = '<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>'
    whole = files.scenario(files.vehicle("Ego"), files.init("Ego", files.on_lane(50.0), 10.0), catalogs=place, stop=1.0)
    spec = ss.ScenarioSpec.load(files.written(tmp_path, whole))
    before = fingerprint(compose(spec))
    assert fingerprint(compose(spec)) == before
    catalog.write_text(text.format('<Route name="r"/>'))
    assert fingerprint(compose(spec)) != before


def test_edited_catalogs_and_maps_are_read_anew_in_the_same_process(tmp_path):
    (tmp_path / "catalogs").mkdir()

    def write_catalog(name: str, length: float) -> None:
        (tmp_path / "catalogs" / f"{name}.xosc").write_text(
            f'<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><Catalog name="{name}">'
            '<Vehicle name="v" vehicleCategory="car"><BoundingBox><Center x="1.4" y="0" z="0.75"/>'
            f'<Dimensions width="1.8" length="{length}" height="1.5"/></BoundingBox></Vehicle></Catalog></OpenSCENARIO>'
        )

    write_catalog("other", 9.0)
    text = files.scenario(
        '<ScenarioObject name="Ego"><CatalogReference catalogName="cars" entryName="v"/></ScenarioObject>',
        files.init("Ego", files.on_lane(50.0), 10.0),
        catalogs='<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>',
    )
    path = files.written(tmp_path, text)
    with pytest.raises(ScenarioFileError, match="no catalog 'cars'"):
        read_drive(path)
    for length in (4.5, 14.0):
        write_catalog("cars", length)
        assert read_drive(path).entities["Ego"].box.length == length
    assert read_drive(path) is read_drive(path)
    (tmp_path / "road.xodr").write_text(files.ARC)
    assert read_drive(path).roads.street.roads["1"].length == pytest.approx(150.0)
