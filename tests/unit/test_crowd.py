"""Traffic of a stated number: exactly so many, for the whole drive, nearest to the ego vehicle, bodies apart."""

from __future__ import annotations

import warnings
from collections import Counter

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ScarlWarning, ScenarioError
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.compose import Composition, compose
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scenario.traffic.crowd import CLOSE, CLOSE_ON_FOOT, crowd
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.actors.model import read_actor_model
from scarl_sionna.scene.lanes import LaneNetwork, lanes_from_tables

EGO = {"trajectory": {"kind": "route", "lanes": ["west_in_0"], "start": 35.0, "speed": 6.0}}


def dense(count: int, **changes: object) -> ScenarioSpec:
    return ScenarioSpec(scene="signalised_crossing", duration=3.0, ego=EGO, traffic={"actors": count, **changes})


@pytest.fixture(scope="module", params=[40, pytest.param(100, marks=pytest.mark.slow)])
def many(request: pytest.FixtureRequest) -> tuple[int, Composition]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing to tell of
        return request.param, compose(dense(request.param))


@pytest.fixture(scope="module")
def few() -> Composition:
    """Of so few some leave, and more are asked for."""
    return compose(dense(8))


def street(*kinds: str) -> LaneNetwork:
    """Lanes of 200 m beside each other."""
    rows = [(kind, [[0.0, 4.0 * row, 0.0], [200.0, 4.0 * row, 0.0]]) for row, kind in enumerate(kinds)]
    return lanes_from_tables([{"name": kind, "kind": kind, "width": 3.5, "points": points} for kind, points in rows])


def test_many_are_there_all_the_time(many: tuple[int, Composition]) -> None:
    count, composition = many
    others = [one for one in composition.members if one.actor.name != "ego"]
    assert len(others) == count
    for one in others:
        motion = one.actor.trajectory
        for time in np.arange(0.0, 3.0, 0.1):
            assert not isinstance(motion, PresentTrajectory) or motion.is_present(time)
            assert motion.pose(time).position[2] > -1.0, one.actor.name
    kinds = Counter(one.body.motion for one in others)
    assert 0.25 * count <= kinds["walk"] <= 0.45 * count and kinds["vehicle"] >= 0.5 * count
    bodies = [(one.actor.name, one.actor.trajectory, one.body) for one in composition.members]
    assert find_collisions(bodies, np.arange(0.0, 2.9, 0.05), 0.05) == []


def test_near_ones_are_detailed_and_far_ones_light(many: tuple[int, Composition]) -> None:
    _, composition = many
    ego = next(one.actor.trajectory for one in composition.members if one.actor.name == "ego")
    times = np.linspace(0.0, 2.9, 13)
    for one in composition.members:
        away = min(np.linalg.norm(one.actor.trajectory.pose(t).position - ego.pose(t).position) for t in times)
        limit = CLOSE_ON_FOOT if one.body.motion == "walk" else CLOSE
        if abs(away - limit) > (0.5 if one.body.motion == "walk" else 2.0):
            assert one.actor.detail == ("detailed" if away < limit else "light"), (one.actor.name, away)
    assert {one.actor.detail for one in composition.members} == {"detailed", "light"}


@pytest.mark.parametrize("name", ["woman_52", "man_38", "girl_9"])
def test_light_bodies_are_within_half_a_pixel_of_the_detailed_ones(name: str) -> None:
    model = read_actor_model(name)
    fine, light = (
        trimesh.util.concatenate(
            [
                trimesh.load(shape.find("string[@name='filename']").get("value"), process=False)
                for shape in model.level(level).shapes.values()
            ]
        )
        for level in ("detailed", "light")
    )
    points, _ = trimesh.sample.sample_surface(
        fine, 400_000, seed=1
    )  # 2 mm apart: what is nearest is farther than it is
    places, _ = trimesh.sample.sample_surface(light, 2_000, seed=2)
    away, _ = cKDTree(points).query(places)
    half_a_pixel = 0.5 / (640.0 / np.tan(np.radians(30.0)))  # [rad]
    assert CLOSE_ON_FOOT * half_a_pixel > np.percentile(away, 95.0) > 0.002


def test_fewer_are_the_nearest_of_more(few: Composition) -> None:
    others = [one.actor for one in few.members if one.actor.name != "ego"]
    assert len(others) == 8
    ego = next(one.actor.trajectory for one in few.members if one.actor.name == "ego")
    assert max(np.linalg.norm(one.trajectory.pose(1.5).position - ego.pose(1.5).position) for one in others) < 150.0


def test_the_number_of_people_may_be_stated() -> None:
    """Eight of ten; else a third. Who is left out leaves within the 3 s or would touch another."""
    people = [
        sum(one.body.motion == "walk" for one in crowd(street("drive", "walk"), spec, (0.0, 3.0), [], None))
        for spec in (TrafficSpec(actors=10, pedestrians=8), TrafficSpec(actors=10))
    ]
    assert 6 <= people[0] <= 9 and 2 <= people[1] <= 5, people


def test_the_same_seed_gives_the_same_crowd(few: Composition) -> None:
    again, other = compose(dense(8)), compose(dense(8).with_(seed=2))
    names = [[one.actor.name for one in one.members] for one in (few, again, other)]
    assert names[0] == names[1] != names[2]


def test_lanes_without_room_say_how_many_there_are() -> None:
    with pytest.warns(ScarlWarning, match=r"have room for \d+ of 400 actors"):
        there = crowd(street("drive"), TrafficSpec(actors=400), (0.0, 3.0), [], None)
    assert 5 < len(there) < 400


@pytest.mark.parametrize("traffic", [{"actors": 0}, {"actors": 10, "density": 3.0}, {"actors": 5, "source": "sumo"}])
def test_what_does_not_go_with_a_number_is_refused(traffic: dict) -> None:
    with pytest.raises(ScenarioError):
        ScenarioSpec(traffic=traffic)
