"""Swarms of an OpenSCENARIO file: as many vehicles round an entity as it says, by the built-in traffic."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.scenario.motion.bodies import BodyLike
from scarl_sionna.scenario.motion.paths import sample_motion
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scenario.traffic.crowd import DENSEST
from scarl_sionna.scenario.traffic.planned import PlannedActor
from scarl_sionna.scenario.traffic.simulated import simulate_traffic
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import Trajectory

from .reading.swarms import Swarm

Array = npt.NDArray[np.float64]
_TRIES = 4
_NEAR = 0.1
"""Part of the number by which the mean may differ."""
_PACE = 0.5


def swarm_actors(
    swarm: Swarm,
    network: LaneNetwork,
    span: tuple[float, float],
    others: Mapping[str, tuple[Trajectory, BodyLike]],
    seed: int,
    names: str = "swarm",
) -> list[PlannedActor]:
    """Return the vehicles of a swarm.

    Parameters
    ----------
    swarm : Swarm
    network : LaneNetwork
        Of the map.
    span : (float, float)
        Times at which motion is to be known [s].
    others : mapping
        All others, by name, the central entity among them: the swarm follows them and gives way.
    seed : int
    names : str
        Beginning of the actors' names.

    Returns
    -------
    list of PlannedActor
        All who are within the ellipse at some time from its start on, for their whole way: nobody comes or goes at
        its edge. The mean number within it over time is that of the swarm, as near as 10 %, or a few tries, come.

    Warns
    -----
    ScarlWarning
        If the lanes have no room for so many.
    """
    central = others[swarm.central][0]
    times = np.arange(max(swarm.start, span[0]), span[1], _PACE)
    own = sample_motion(central, np.clip(times, central.start, central.stop))
    middle, heading = own.position[:, :2], own.heading
    inside = sum(_share(lane.points, lane.length, swarm, middle, heading) for lane in network.of_kind("drive"))
    density = min(swarm.number / max(inside / 1000.0, 1e-3), DENSEST)
    best: tuple[float, list[PlannedActor]] = (np.inf, [])
    for _ in range(_TRIES):
        asked = TrafficSpec(density=density, mix=None if swarm.mix is None else dict(swarm.mix), seed=seed)
        with warnings.catch_warnings():  # who finds no place or would touch another: more are asked for
            warnings.simplefilter("ignore", ScarlWarning)
            planned = simulate_traffic(network, asked, span, others=list(others.values()), names=names)
        kept, mean = _kept(swarm, planned, times, (middle, heading))
        if abs(mean - swarm.number) < best[0]:
            best = abs(mean - swarm.number), kept
        if best[0] <= _NEAR * swarm.number or (density >= DENSEST and mean < swarm.number):
            break
        density = min(density * swarm.number / max(mean, 0.5), DENSEST)
    if best[0] > _NEAR * swarm.number:
        text = f"a swarm of {swarm.number} vehicles: the mean within its ellipse is off by {best[0]:.1f}"
        warnings.warn(f"{swarm.node.file.name}, line {swarm.node.line}: {text}", ScarlWarning, stacklevel=2)
    return best[1]


def _share(points: Array, length: float, swarm: Swarm, middle: Array, heading: Array) -> float:
    """Return the mean length of a lane within the ellipse over time [m]."""
    places = points[None, :, :2]
    held = swarm.holds(places, middle[:, None], heading[:, None])
    return float(held.mean()) * length


def _kept(
    swarm: Swarm, planned: Sequence[PlannedActor], times: Array, central: tuple[Array, Array]
) -> tuple[list[PlannedActor], float]:
    """Return who is within the ellipse at some time and not too near at first, and the mean number within it."""
    middle, heading = central
    kept, total = [], 0.0
    for actor in planned:
        places = sample_motion(actor.trajectory, times).position[:, :2]
        there = (times >= actor.active[0]) & (times <= actor.active[1])
        if there[0] and np.linalg.norm(places[0] - middle[0]) < swarm.inner:
            continue
        held = there & swarm.holds(places, middle, heading)
        if held.any():
            kept.append(actor)
            total += float(held.mean())
    return kept, total
