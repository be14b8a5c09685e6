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
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.scenario.traffic.crowd import CLOSE, CLOSE_ON_FOOT
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.actors.model import read_actor_model

EGO = {"trajectory": {"kind": "route", "lanes": ["west_in_0"], "start": 35.0, "speed": 6.0}}


def dense(count: int, **changes: object) -> ScenarioSpec:
    return ScenarioSpec(scene="signalised_crossing", duration=3.0, ego=EGO, traffic={"actors": count, **changes})


@pytest.fixture(scope="module")
def hundred() -> Composition:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing to tell of
        return compose(dense(100))


def test_a_hundred_are_there_all_the_time(hundred: Composition) -> None:
    others = [one for one in hundred.members if one.actor.name != "ego"]
    assert len(others) == 100
    for one in others:
        motion = one.actor.trajectory
        for time in np.arange(0.0, 3.0, 0.1):
            assert not isinstance(motion, PresentTrajectory) or motion.is_present(time)
            assert motion.pose(time).position[2] > -1.0, one.actor.name
    kinds = Counter(one.body.motion for one in others)
    assert 25 <= kinds["walk"] <= 45 and kinds["vehicle"] >= 50
    bodies = [(one.actor.name, one.actor.trajectory, one.body) for one in hundred.members]
    assert find_collisions(bodies, np.arange(0.0, 2.9, 0.05), 0.05) == []


def test_near_ones_are_detailed_and_far_ones_light(hundred: Composition) -> None:
    ego = next(one.actor.trajectory for one in hundred.members if one.actor.name == "ego")
    times = np.linspace(0.0, 2.9, 13)
    for one in hundred.members:
        away = min(np.linalg.norm(one.actor.trajectory.pose(t).position - ego.pose(t).position) for t in times)
        limit = CLOSE_ON_FOOT if one.body.motion == "walk" else CLOSE
        if abs(away - limit) > (0.5 if one.body.motion == "walk" else 2.0):
            assert one.actor.detail == ("detailed" if away < limit else "light"), (one.actor.name, away)
    assert {one.actor.detail for one in hundred.members} == {"detailed", "light"}


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


def test_fewer_are_the_nearest_of_more() -> None:
    composition = compose(dense(8))
    others = [one.actor for one in composition.members if one.actor.name != "ego"]
    assert len(others) == 8
    ego = next(one.actor.trajectory for one in composition.members if one.actor.name == "ego")
    assert max(np.linalg.norm(one.trajectory.pose(1.5).position - ego.pose(1.5).position) for one in others) < 150.0


def test_the_number_of_people_may_be_stated() -> None:
    others = [one for one in compose(dense(30, pedestrians=5)).members if one.actor.name != "ego"]
    assert len(others) == 30 and sum(one.body.motion == "walk" for one in others) <= 12


def test_the_same_seed_gives_the_same_crowd() -> None:
    names = [[one.actor.name for one in compose(dense(20).with_(seed=seed)).members] for seed in (1, 1, 2)]
    assert names[0] == names[1] != names[2]


def test_lanes_without_room_say_how_many_there_are() -> None:
    spec = ScenarioSpec(scene="highway_guardrail", duration=3.0, traffic={"actors": 400})
    with pytest.warns(ScarlWarning, match=r"have room for \d+ of 400 actors"):
        compose(spec)


@pytest.mark.parametrize("traffic", [{"actors": 0}, {"actors": 10, "density": 3.0}, {"actors": 5, "source": "sumo"}])
def test_what_does_not_go_with_a_number_is_refused(traffic: dict) -> None:
    with pytest.raises(ScenarioError):
        ScenarioSpec(traffic=traffic)
