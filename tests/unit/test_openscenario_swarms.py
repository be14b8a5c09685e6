"""Swarms of a storyboard: as many vehicles within the ellipse as it says, that follow and do not touch."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScenarioError, UnsupportedElementError
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.compose import compose
from tests import openscenario_files as files

NUMBER, INNER, ALONG, ACROSS, AHEAD = 12, 25.0, 160.0, 60.0, 30.0


def swarm(number: int = NUMBER, central: str = "Ego", mix: str = "") -> str:
    return (
        f'<GlobalAction><TrafficAction trafficName="s"><TrafficSwarmAction innerRadius="{INNER}" '
        f'semiMajorAxis="{ALONG}" semiMinorAxis="{ACROSS}" numberOfVehicles="{number}" offset="{AHEAD}">'
        f'<CentralObject entityRef="{central}"/>{mix}</TrafficSwarmAction></TrafficAction></GlobalAction>'
    )


def composed(folder, action: str, seed: int = 0, stop: float = 4.0):
    actions = action + files.init("Ego", files.on_lane(300.0), 10.0) + files.init("other", files.on_lane(340.0), 10.0)
    text = files.scenario(files.vehicle("Ego") + files.vehicle("other"), actions, stop=stop)
    path = files.written(folder, text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the built-in traffic drives it
        return compose(ss.ScenarioSpec.load(path).with_(seed=seed))


def test_as_many_as_it_says_are_within_the_ellipse(tmp_path) -> None:
    found = composed(tmp_path, swarm(), stop=6.0)
    own = {member.actor.name: member.actor.trajectory for member in found.members}
    others = [name for name in own if name.startswith("swarm_")]
    assert {"ego", "other"} == set(own) - set(others)
    times = np.arange(0.0, 6.0, 0.5)
    count = np.zeros(len(times))
    for name in others:
        for index, time in enumerate(times):  # the ellipse by its definition, round a car that drives along +x
            x, y, z = own[name].pose(time).position
            middle = 300.0 + 10.0 * time + 1.4
            is_inside = ((x - middle - AHEAD) / ALONG) ** 2 + ((y + 1.75) / ACROSS) ** 2 <= 1.0
            count[index] += is_inside and abs(z) < 1.0
            assert time > 0.0 or np.hypot(x - middle, y + 1.75) > INNER - 3.0
    assert count.mean() == pytest.approx(NUMBER, abs=0.1 * NUMBER + 0.5)
    assert count.min() >= 0.5 * NUMBER
    bodies = [(member.actor.name, member.actor.trajectory, member.body) for member in found.members]
    assert find_collisions(bodies, times) == []


def test_a_seed_gives_the_same_swarm_and_another_one_another(tmp_path) -> None:
    def places(seed: int) -> list[tuple[str, tuple[float, ...]]]:
        members = composed(tmp_path, swarm(3), seed, 1.5).members
        return [(one.actor.name, tuple(one.actor.trajectory.pose(1.0).position)) for one in members]

    assert places(1) == places(1)
    assert places(1) != places(2)


def test_categories_are_those_of_its_distribution(tmp_path) -> None:
    entries = '<VehicleCategoryDistributionEntry category="bus" weight="2"/>'
    mix = f"<VehicleCategoryDistribution>{entries}</VehicleCategoryDistribution>"
    found = composed(tmp_path, swarm(4, mix=mix), stop=1.5)
    models = {one.actor.model.name for one in found.members if one.actor.name.startswith("swarm")}
    assert models and models <= {"bus", "coach"}


def test_what_cannot_be_is_named(tmp_path) -> None:
    with pytest.raises(ScenarioError, match="'Nobody' is no entity"):
        composed(tmp_path, swarm(central="Nobody"))
    with pytest.raises(ScenarioError, match="numberOfVehicles = 5000 is outside 1 to 500"):
        composed(tmp_path, swarm(5000))
    source = swarm().replace("TrafficSwarmAction", "TrafficSourceAction")
    with pytest.raises(UnsupportedElementError, match="a TrafficSwarmAction is read"):
        composed(tmp_path, source)
