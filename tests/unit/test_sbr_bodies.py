"""What the pairs of stations of one solve share is made once, and changes no path."""

from __future__ import annotations

import warnings
from dataclasses import fields

import numpy as np
import pytest

from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.sbr import SbrSettings
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.engine.load import load_scene
from scarl_sionna.radar.channel import ChannelPlan, Share, solve_paths
from scarl_sionna.radar.channel.sbr import bodies as prepared
from tests.scenes import Thing, ball, plane, write_scene

RADAR = RadarSpec(elevation_fov_deg=120.0)
POSE = Pose([0.0, 0.0, 0.5])
PLAN = ChannelPlan(
    (Share("sbr", ("ball",), SbrSettings(floor_db=None), through_mirrors=True),), ("ground", "wall"), echoes=False
)


@pytest.fixture(scope="module")
def state(tmp_path_factory):
    things = [
        Thing("ground", plane(128.0, 64.0), "Roads", "steel", is_object=False),
        Thing("wall", plane(64.0, 32.0, (16, 4, 0), (0, -1, 0)), "Wall", "steel", is_object=False),
        Thing("ball", ball(0.1, (12.0, 0.0, 0.7), subdivisions=3), "Static", "steel"),
    ]
    return load_scene(write_scene(tmp_path_factory.mktemp("bodies"), things)).at(0.0)


def test_one_solve_prepares_its_bodies_once(state, monkeypatch) -> None:
    made = []

    class Counted(prepared.FaceSurfaces):
        def __init__(self, *arguments) -> None:
            made.append(1)
            super().__init__(*arguments)

    monkeypatch.setattr(prepared, "FaceSurfaces", Counted)
    paths = solve_paths(state, RADAR, POSE, "hybrid", plan=PLAN)
    assert len({tuple(row) for row in paths.instance.tolist()}) > 3  # straight, ground, wall, both
    assert len(made) == 1


def test_a_solve_in_another_solve_s_state_changes_nothing(state, tmp_path) -> None:
    """The engine's scene is one for all states of a world: another state may be set between two pairs."""
    actor = {"kind": "constant_twist", "position": [9.0, 0.0, 0.5], "velocity": [5.0, 1.0, 0.0]}
    world = load_scene(write_scene(tmp_path, [], [Thing("ball", ball(0.1), "Static", "steel", actor)]))
    number = next(iter(world.instances))
    settings = prepared.RadarSettings(method="sbr")
    early = prepared.Bodies(world.at(0.0), RADAR, settings, [number])
    from scarl_sionna.radar.channel.sbr.solve import solve_bodies

    mount = world.at(0.0).as_mount(POSE)
    first = solve_bodies(early, mount)
    solve_bodies(prepared.Bodies(world.at(1.0), RADAR, settings, [number]), mount)
    again = solve_bodies(early, mount)
    for item in fields(first):
        one, other = getattr(first, item.name), getattr(again, item.name)
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)


def test_a_solve_warns_once_of_grazing(tmp_path) -> None:
    plate = Thing("plate", plane(1.0, 1.0, (10.0, 0.02, 0.5), (0, -1, 0)), "Static", "steel")
    ground = Thing("ground", plane(128.0, 64.0), "Roads", "steel", is_object=False)
    state = load_scene(write_scene(tmp_path, [ground, plate])).at(0.0)
    share = Share("sbr", ("plate",), SbrSettings(floor_db=None), through_mirrors=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solve_paths(state, RADAR, POSE, "hybrid", plan=ChannelPlan((share,), ("ground",), echoes=False))
    assert sum("grazing" in str(one.message) for one in caught) == 1
