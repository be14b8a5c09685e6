"""Scenarios of other projects: they are run, keep our checks, or are refused with what is missing.

They stay outside of the repository: `SCARL_SCENARIOS` names a folder of them, with the maps that they name beside it.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.errors import ScenarioError
from scarl_sionna.scenario.compose import build_world, compose
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scenario.traffic.planned import PresentTrajectory
from scarl_sionna.scene.motion.trajectory import Trajectory
from tests import openscenario_files as files

FOLDER = os.environ.get("SCARL_SCENARIOS")
OTHERS = sorted(Path(FOLDER).glob("*.xosc")) if FOLDER else []


def _own(trajectory: Trajectory) -> Trajectory:
    """Return the motion without its absence."""
    return trajectory.motion if isinstance(trajectory, PresentTrajectory) else trajectory


@pytest.mark.own_process
def test_a_drive_is_seen_by_its_ego(tmp_path):
    actions = files.init("Ego", files.on_lane(40.0), 10.0) + files.init("lead", files.on_lane(70.0), 8.0)
    change = files.lane_change('<AbsoluteTargetLane value="-2"/>')
    act = files.group("lead", files.event(change, files.after(1.0)))
    text = files.scenario(files.vehicle("Ego") + files.vehicle("lead", "van"), actions, act, 6.0)
    world = build_world(ss.ScenarioSpec.load(files.written(tmp_path, text)))  # its ground is looked for, too
    assert world.ego == "ego"
    for time in (0.0, 2.5, 5.0):
        state = world.at(time)
        ahead = state.actor_pose("lead").position - state.actor_pose("ego").position
        assert abs(ahead[2]) < 1e-3
        assert 15.0 < ahead[0] < 35.0
    assert world.at(5.0).actor_pose("lead").position[1] == pytest.approx(-5.25, abs=0.01)


@pytest.mark.skipif(not OTHERS, reason="SCARL_SCENARIOS names no folder with .xosc files")
@pytest.mark.parametrize("path", OTHERS, ids=lambda path: path.stem)
def test_scenarios_of_others_run(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what has no effect, and who collides
        try:
            spec = ss.ScenarioSpec.load(path)
        except ScenarioError as error:
            assert "map file not found" in str(error)
            assert error.line is not None
            pytest.skip(str(error))
        found = compose(spec)
    for member in found.members:
        motion = _own(member.actor.trajectory)
        times = np.arange(max(motion.start, 0.0), min(motion.stop, spec.times[-1]), 0.01)
        sampled = sample_motion(motion, times)
        steps = np.gradient(sampled.position, times, axis=0)
        fast = np.linalg.norm(sampled.velocity - steps, axis=1)[1:-1]
        assert np.median(fast) < 0.01  # the velocity is the derivative of the motion
        assert np.linalg.norm(np.diff(sampled.position, axis=0), axis=1).max() < 0.7  # nothing jumps
