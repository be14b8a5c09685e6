"""Frames of the ready scenes in which several mirror faces belong to one instance: `auto` gives each echo once."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

import scarl_sionna as ss
from scarl_sionna.core.pose import Pose
from scarl_sionna.core.settings.accuracy import Accuracy
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.radar.channel import plan_channel, solve_paths
from scarl_sionna.radar.channel.compose import hybrid
from scarl_sionna.radar.channel.compose.ghosts import STRAIGHT, Faces
from scarl_sionna.radar.channel.compose.hybrid import chains_of
from scarl_sionna.radar.paths import RadarPaths
from scarl_sionna.scenario.spec.scenario import ScenarioSpec
from scarl_sionna.simulation import load_world

LARGE = Accuracy(tube_budget=100_000)
"""The default budget of `auto`, stated, with a twentieth of the rays."""


def check(monkeypatch, state, mount, radar, **options) -> int:
    """Assert that no echo is there over two mirrors.

    Return how many chains come over several faces of their instances.
    """
    blocks: list[tuple[RadarPaths, Faces]] = []
    checked = hybrid._check_chains

    def kept(paths, faces) -> None:
        if not blocks:  # a second look is a solve of its own
            blocks.extend(zip(paths, faces, strict=True))
        checked(paths, faces)

    monkeypatch.setattr(hybrid, "_check_chains", kept)
    solve_paths(state, radar, state.mount("ego", Pose(mount)), **options)
    ways = defaultdict(list)
    for paths, faces in blocks:
        for chain in chains_of(paths) if faces != STRAIGHT else ():
            ways[chain].append(_ends(paths, chain))
    assert ways
    for blocks_of_chain in ways.values():
        ends = np.concatenate(blocks_of_chain)
        assert len(np.unique(ends, axis=0)) == len(ends)
    return sum(len(blocks_of_chain) > 1 for blocks_of_chain in ways.values())


def _ends(paths: RadarPaths, chain: tuple[int, ...]) -> np.ndarray:
    """Return the different end points and inner lengths of the paths of a chain, in micrometres, and their amplitude.

    Different: `sbr` may cut a patch in two with one point. Where two mirrors of one plane meet, what is seen over one
    ends where that over the other begins: corners there are in both, with opposite signs. An echo that is there twice
    has the same amplitude twice.
    """
    depth = len(chain) // 2
    steps = np.stack([paths.instance, paths.interaction], axis=2)[:, :depth].reshape(paths.num_paths, -1)
    rows = (paths.depth == depth) & (steps == chain).all(axis=1) if steps.shape[1] == len(chain) else []
    ends = np.column_stack([paths.tx_point, paths.rx_point, paths.inner_length])[rows]
    a = paths.a[:, 0, 0][rows]
    level = np.column_stack([1e-3 * np.log(np.maximum(np.abs(a), 1e-30)), 1e-3 * np.angle(a)])
    return np.unique(np.round(np.column_stack([ends, level]) * 1e6).astype(np.int64), axis=0)


@pytest.mark.slow
def test_roundabout(monkeypatch) -> None:
    """The pavement's kerb and its flags are two parts in one plane: each reflection is on one of them."""
    state = ss.load_scene("roundabout", variant=5, detail="light").at(1.0)
    check(monkeypatch, state, [4.0, 0.0, 0.7], RadarSpec(), num_rays=50_000, max_distance=25.0, accuracy=LARGE)


@pytest.mark.slow
def test_a_lorry_in_a_tunnel(monkeypatch) -> None:
    """Both walls of the tunnel are one instance.

    The front rig's radar, at full quality but for the rays of its clutter.
    """
    state = load_world(ScenarioSpec.preset("lorry_in_a_tunnel")).at(5.0)
    radar = RadarSpec.preset("awr1843boost")
    assert check(monkeypatch, state, [2.36, 0.0, 0.8], radar, num_rays=50_000, accuracy=LARGE) > 0


@pytest.mark.slow
def test_a_garage(monkeypatch) -> None:
    """A parked car over several flat pieces of the ceiling, with the knobs that `auto` takes."""
    state = ss.load_scene("parking_garage", variant=2, detail="light").at(1.0)
    options = {"num_rays": 20_000, "max_distance": 15.0}
    budget = Accuracy(tube_budget=1_200_000, channel_tolerance_db=3.0)
    mount = [4.0, 0.0, 0.7]
    plan = plan_channel(state, RadarSpec(), state.mount("ego", Pose(mount)), accuracy=budget, **options)
    car = next(number for number, info in state.world.instances.items() if info.name == "parked_06")
    (share,) = (share for share in plan.shares if car in share.instances)
    assert share.through_mirrors and any(car in reflection.instances for reflection in share.reflections)
    alone = replace(share, instances=(car,), reflections=(), through_mirrors=True)
    plan = replace(plan, shares=(alone,), mirrors=("ceiling",), echoes=False)
    assert check(monkeypatch, state, mount, RadarSpec(), method="hybrid", plan=plan, **options) > 0
