"""From a scenario to its world: who is there and how they move, and what cannot be is reported with its line."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

from scarl_sionna.core.errors import (
    CollisionError,
    OutsideSceneError,
    PlacementError,
    ScarlWarning,
    ScenarioError,
    ScenarioFileError,
    ScenarioNameError,
    ScenarioTimeError,
    ScenarioValueError,
    TimeRangeError,
    UnknownNameError,
)
from scarl_sionna.core.specs.lighting import Lighting
from scarl_sionna.engine.light.sky import SKY_SIZE, sky_image
from scarl_sionna.scenario.compose import compose
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.simulation import load_world
from tests.lane_scene import lane_scene

pytestmark = pytest.mark.own_process(shared=True)  # beside what a worker has already, it would pass the bound of memory


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("lanes")
    lane_scene(folder)
    return folder


def load(folder: Path, text: str) -> ScenarioSpec:
    path = folder / "drive.yaml"
    path.write_text("scene: synthetic.xml\nduration: 3.0\n" + text, encoding="utf-8")
    return ScenarioSpec.load(path)


EGO = "ego: {trajectory: {kind: route, lanes: [east], start: 100, speed: 8}}\n"
DRIVE = (
    EGO
    + """\
actors:
  - name: cut
    model: suv
    variant: red
    trajectory:
      kind: route
      lanes: [east_2]
      start: 110
      speed: 10
      events: [{kind: shift, time: 0.5, duration: 2, by: -3.5}]
  - name: man
    model: adult_man
    trajectory: {kind: waypoints, positions: [[40, -7], [40, -5]], speed: 1.4, depart: 1.0}
  - {name: parked, model: small_car, trajectory: {kind: static, parking: 0}}
lighting: dusk
weather: rain
"""
)


def test_the_world_has_who_the_scenario_names(folder) -> None:
    world = load_world(load(folder, DRIVE))
    assert [actor.name for actor in world.actors] == ["ego", "cut", "man", "parked"]  # `ahead` of the scene is gone
    assert world.ego == "ego" and world.instances[world.actor("cut").instance].name == "cut"
    start, end = world.at(0.0), world.at(2.9)
    np.testing.assert_allclose(start.actor_pose("ego").position, [-50.0, 0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(end.actor_pose("ego").position, [-50.0 + 8.0 * 2.9, 0.0, 0.0], atol=1e-2)
    np.testing.assert_allclose(start.actor_pose("cut").position, [-40.0, 3.5, 0.0], atol=1e-2)
    assert abs(end.actor_pose("cut").position[1]) < 0.05  # in ego's lane
    np.testing.assert_allclose(start.actor_pose("man").position, [40.0, -7.0, 0.0], atol=1e-3)
    assert np.linalg.norm(start.actor_twist("man").linear) < 1e-9  # waits
    np.testing.assert_allclose(start.actor_pose("parked").position, [30.0, -4.0, 0.0], atol=1e-9)
    assert world.weather.rain_rate == 10.0
    assert world.lighting.sun_elevation_deg == Lighting.preset("dusk").sun_elevation_deg


def test_default_actors(folder) -> None:
    assert [actor.name for actor in load_world(load(folder, "")).actors] == ["ego", "ahead"]
    parked = "actors: [{name: parked, model: van, trajectory: {kind: static, parking: 1}}]\n"
    assert {m.name for m in compose(load(folder, parked)).document.instances if m.trajectory} == {"ego", "parked"}
    kept = compose(load(folder, parked + "keep_default_actors: true\n")).document
    assert {m.name for m in kept.instances if m.trajectory} == {"ego", "ahead", "parked"} and kept.ego == "ego"
    alone = compose(load(folder, "keep_default_actors: false\n")).document
    assert {m.name for m in alone.instances if m.trajectory} == {"ego"}
    other = compose(load(folder, "ego: {model: van}\n"))
    own = load_world(load(folder, "")).at(1.0).actor_pose("ego")
    trajectory = next(m.trajectory for m in other.document.instances if m.name == "ego")
    assert trajectory is not None
    np.testing.assert_array_equal(trajectory.pose(1.0).position, own.position)  # another body on the scene's own way


def test_the_same_everywhere(folder) -> None:
    def states(spec: ScenarioSpec) -> list[bytes]:
        document = compose(spec).document
        return [
            e.trajectory.pose(t).position.tobytes()
            for e in document.instances
            if e.trajectory is not None
            for t in spec.times
        ]

    spec = load(folder, DRIVE + "traffic: {density: 8}\nrandomization: {placements: true}\n")
    assert states(spec) == states(pickle.loads(pickle.dumps(spec))) == states(spec.resolved())
    assert states(spec) != states(spec.with_(seed=1))


def test_who_touches_another_moves_nobody_else(folder) -> None:
    """One more actor, which in some draws touches the ego vehicle, is placed anew alone."""

    def places(text: str, seed: int) -> dict[str, bytes]:
        spec = load(folder, text + "randomization: {placements: {along: 2}}\n").with_(seed=seed)
        return {one.actor.name: one.actor.trajectory.pose(0.0).position.tobytes() for one in compose(spec).members}

    head = EGO + "actors:\n  - {name: far, model: suv, trajectory: {kind: static, lane: west, start: 20}}\n"
    near = "  - {name: near, model: saloon, trajectory: {kind: route, lanes: [east], start: 106.5, speed: 8}}\n"
    for seed in range(6):
        found = places(head + near, seed)
        del found["near"]
        assert found == places(head, seed)


def actor(**lines: str) -> str:
    """Return a scenario whose only actor `a` stands in lines 4 to 4 + len(lines)."""
    return "actors:\n  - name: a\n" + "".join(f"    {key}: {value}\n" for key, value in lines.items())


def shifting(event: str, speed: float) -> str:
    """Return a scenario whose only actor has an event in line 12."""
    keys = ("kind: route", "lanes: [east]", "start: 50", f"speed: {speed}", "events:", f"  - {event}")
    return actor(model="suv", trajectory="".join(f"\n      {key}" for key in keys))


ROUTE = "{kind: route, lanes: [east], start: 50, speed: 8}"
BAD = [
    ("scene: highway_guardrial\n", ScenarioNameError, 3, "scene", "did you mean 'highway_guardrail'"),
    (actor(model="suvv", trajectory=ROUTE), ScenarioNameError, 5, "actors[0].model", "did you mean 'suv'"),
    (
        actor(model="suv", variant="pink", trajectory=ROUTE),
        ScenarioNameError,
        6,
        "actors[0].variant",
        "variant of 'suv'",
    ),
    (
        actor(model="suv", colors="{pain: [1, 0, 0]}", trajectory=ROUTE),
        ScenarioNameError,
        6,
        "actors[0].colors.pain",
        "did you mean 'paint'",
    ),
    (
        actor(model="suv", trajectory="\n      kind: route\n      lanes: [east, weast]\n"),
        ScenarioNameError,
        8,
        "actors[0].trajectory.lanes[1]",
        "did you mean 'west'",
    ),
    (
        actor(model="suv", trajectory="\n      kind: route\n      lanes: [east, west]\n"),
        ScenarioNameError,
        8,
        "actors[0].trajectory.lanes[1]",
        "continued by: east_on",
    ),
    (
        actor(model="suv", trajectory="\n      kind: route\n      lanes: [east]\n      start: 500\n"),
        ScenarioValueError,
        9,
        "actors[0].trajectory.start",
        "beyond the lanes' end",
    ),
    (
        actor(model="suv", trajectory="{kind: static, parking: 7}"),
        ScenarioNameError,
        6,
        "actors[0].trajectory.parking",
        "has 2, from 0 to 1",
    ),
    (
        actor(model="suv", trajectory="\n      kind: table\n      file: lost.csv\n"),
        ScenarioFileError,
        8,
        "actors[0].trajectory.file",
        "lost.csv",
    ),
    (actor(mesh="\n      file: lost.ply\n", trajectory=ROUTE), ScenarioFileError, 6, "actors[0].mesh.file", "lost.ply"),
    (
        actor(model="suv", trajectory="{kind: route, lanes: [east_on], start: 60, speed: 14}"),
        ScenarioTimeError,
        6,
        "actors[0].trajectory",
        "last frame, at 2.9 s",
    ),
    (
        actor(model="suv", trajectory="{kind: waypoints, times: [0, 2], positions: [[0, 0], [20, 0]]}"),
        ScenarioTimeError,
        6,
        "actors[0].trajectory",
        "0 to 2 s",
    ),
    (
        actor(model="suv", trajectory="{kind: route, lanes: [east], start: 151, speed: 9}"),
        CollisionError,
        4,
        "actors[0]",
        "'a' overlaps with 'ego' at 0 s",
    ),
    (
        actor(model="suv", trajectory="{kind: route, lanes: [east, east_on], start: 135, speed: 25}"),
        CollisionError,
        4,
        "actors[0]",
        "'a' collides with 'ego' at",
    ),
    (
        actor(model="suv", trajectory="{kind: static, position: [400, 0]}"),
        OutsideSceneError,
        6,
        "actors[0].trajectory",
        "no ground",
    ),
    (
        actor(model="suv", trajectory="{kind: waypoints, positions: [[0, 12], [0, 60]], speed: 10}"),
        OutsideSceneError,
        6,
        "actors[0].trajectory",
        "no ground",
    ),
    (
        actor(model="child", trajectory="{kind: waypoints, positions: [[0, -8], [60, -8]], speed: 9}"),
        ScenarioValueError,
        6,
        "actors[0].trajectory",
        "speed on foot",
    ),
    (
        shifting("{kind: shift, time: 0.5, duration: 2, by: 3}", speed=0),
        ScenarioValueError,
        12,
        "actors[0].trajectory.events[0]",
        "shifts 3 m to the left from 0.5 to 2.5 s, while it drives 0 m, which is too short",
    ),
    (
        shifting("{kind: shift, time: 0.5, duration: 2, by: -3}", speed=3),
        ScenarioValueError,
        12,
        "actors[0].trajectory.events[0]",
        "to the right from 0.5 to 2.5 s, while it drives 6 m",
    ),
    (
        shifting("{kind: shift, time: 0.5, duration: 0.8, by: 3}", speed=15),
        ScenarioValueError,
        12,
        "actors[0].trajectory.events[0]",
        "a lateral acceleration of",
    ),
    (
        shifting("{kind: shift, time: -3, duration: 2, by: 3}", speed=8),
        ScenarioValueError,
        12,
        "actors[0].trajectory.events[0].time",
        "-3 s is before the motion begins, at 0 s",
    ),
    (
        shifting("{kind: stop, at: 500}", speed=8),
        ScenarioValueError,
        12,
        "actors[0].trajectory.events[0].at",
        "beyond the lanes' end",
    ),
    ("variant: 3\n", ScenarioValueError, 3, "variant", "no variants"),
    ("traffic: {density: 10, mix: {suvv: 1}}\n", ScenarioNameError, 3, "traffic.mix.suvv", "did you mean 'suv'"),
    (
        "ego: {trajectory: {kind: route, lanes: [east], start: 20,\n  speed: 8, events: [{kind: stop, at: 21}]}}\n",
        ScenarioValueError,
        4,
        "ego.trajectory.events[0].at",
        "too near",
    ),
]


@pytest.mark.parametrize(
    ("text", "kind", "line", "key", "message"), BAD, ids=[f"{r[3]}-{r[1].__name__}-{i}" for i, r in enumerate(BAD)]
)
def test_what_cannot_be_is_told_at_its_line(folder, text, kind, line, key, message) -> None:
    spec = load(folder, text) if not text.startswith("scene") else ScenarioSpec.load(renamed(folder, text))
    with pytest.raises(kind, match=message) as caught:
        load_world(spec)
    error = caught.value
    assert isinstance(error, ScenarioError)
    assert (error.line, error.key) == (line, key), str(error)
    assert Path(error.file).name == "drive.yaml"


def renamed(folder: Path, text: str) -> Path:
    path = folder / "drive.yaml"
    path.write_text("seed: 1\nduration: 1.0\n" + text, encoding="utf-8")
    return path


def test_kinds_of_errors_are_those_of_the_project() -> None:
    assert issubclass(ScenarioNameError, UnknownNameError) and issubclass(ScenarioTimeError, TimeRangeError)
    assert issubclass(CollisionError, PlacementError) and issubclass(OutsideSceneError, PlacementError)


def test_problems_of_several_actors_are_told_at_once(folder) -> None:
    text = (
        "ego: {model: salon}\nactors:\n"
        "  - {name: a, model: suvv, trajectory: {kind: static, parking: 0}}\n"
        "  - {name: b, model: suv, trajectory: {kind: route, lanes: [lost]}}\n"
        "  - {name: c, model: suv, trajectory: {kind: static, parking: 9}}\n"
    )
    with pytest.raises(ScenarioError) as caught:
        compose(load(folder, text))
    assert [one.line for one in caught.value.problems] == [3, 5, 6, 7]


def test_collisions_may_be_allowed(folder) -> None:
    text = EGO + actor(model="suv", trajectory="{kind: route, lanes: [east], start: 101, speed: 8}")
    with pytest.raises(CollisionError, match="line 3") as caught:
        compose(load(folder, text))
    assert caught.value.line == 5 and caught.value.other == "ego" and caught.value.time == 0.0
    with pytest.warns(ScarlWarning, match="'a' overlaps with 'ego'"):
        compose(load(folder, text + "collisions: warn\n"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compose(load(folder, text + "collisions: allow\n"))


def test_a_scenario_made_in_python_has_no_line(folder) -> None:
    with pytest.raises(ScenarioNameError, match="scenario: actors\\[0\\].model: unknown actor model") as caught:
        load_world(
            ScenarioSpec(
                scene=str(folder / "synthetic.xml"),
                actors=[{"name": "a", "model": "suvv", "trajectory": {"kind": "static", "parking": 0}}],
            )
        )
    assert caught.value.line is None


def test_a_clouded_night_has_a_sky() -> None:
    """Rain by night covers the sky: its glow alone is left, not a division of nothing by nothing."""
    night = Lighting.preset("night").with_(cloud_cover=1.0)
    dark = np.zeros((*SKY_SIZE, 3))
    image = sky_image(night, dark, np.zeros(3))
    assert np.isfinite(image).all() and image.min() > 0.0
    np.testing.assert_array_equal(image, sky_image(night.with_(cloud_cover=0.0), dark, np.zeros(3)))


def test_a_body_is_read_anew_when_what_moves_it_is_edited(tmp_path, monkeypatch) -> None:
    """The reading itself stands aside: it tells how often it is asked for."""
    from scarl_sionna.scenario import cast
    from scarl_sionna.scenario.fingerprint import _contents
    from scarl_sionna.scene.actors import body as reading

    read, stated = [], set()
    monkeypatch.setattr(reading, "actor_from_body", lambda *_, **own: read.append(own) or read_actor_model("child"))
    (tmp_path / "body.glb").write_bytes(b"glTF")
    motion = tmp_path / "walk.bvh"
    body = {"file": str(tmp_path / "body.glb"), "moved_by": str(motion), "semantic": "Pedestrian"}
    spec = ScenarioSpec(
        scene="urban_crossing",
        detail="light",
        actors=[{"name": "she", "body": body, "trajectory": {"kind": "static", "position": [40.0, 30.0, 0.0]}}],
    )
    for text, count in (("one", 1), ("one", 1), ("another", 2)):
        if not motion.exists() or motion.read_text() != text:
            motion.write_text(text)
        cast._model(spec, ("actors", 0), spec.actors[0])
        stated.add(_contents(spec, body)["moved_by"])
        assert len(read) == len(stated) == count
