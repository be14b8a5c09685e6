"""Built-in traffic of a stated number of actors: as many as asked for, there for the whole drive, the nearest ones."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.scenario.motion.bodies import BodyLike
from scarl_sionna.scenario.spec.actors import TrafficSpec
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import Trajectory

from .planned import PlannedActor
from .simulated import simulate_traffic

PEOPLE = 0.35
"""Part of the actors that is on foot, where a scene has walkways."""
DENSEST, MOST_PEOPLE = 150.0, 500
"""Vehicles on a kilometre of lane, and people, that traffic may have."""
CLOSE = 20.0
"""Distance from the ego vehicle [m] beyond which all through the drive a vehicle has the light level of geometry."""
CLOSE_ON_FOOT = 13.0
"""The same of people: their light bodies lie within 5.9 mm of the detailed ones (95 % of the surface), which is half a
pixel here for a camera of 1,280 columns and 60 deg."""
_MORE, _TRIES = 1.35, 6
_PARKED = 0.6


def crowd(
    network: LaneNetwork,
    traffic: TrafficSpec,
    span: tuple[float, float],
    others: Sequence[tuple[Trajectory, BodyLike]],
    ego: Trajectory | None,
) -> list[PlannedActor]:
    """Return `traffic.actors` actors that are on the lanes for a whole span of times [s].

    Parameters
    ----------
    network : LaneNetwork
    traffic : TrafficSpec
        `actors` says how many; pedestrians that it states stay as many, else a third of all is on foot where there are
        walkways. Density and, where they do not suffice, people and parked cars follow.
    span : (float, float)
    others
        As of :func:`scarl_sionna.scenario.traffic.simulated.simulate_traffic`.
    ego : Trajectory or None
        Those nearest to it in the middle of the span are kept; None: those nearest to the middle of the lanes.

    Warns
    -----
    ScarlWarning
        If the lanes have no room for so many.
    """
    wanted = int(traffic.actors or 0)
    length = sum(lane.length for lane in network.of_kind("drive")) / 1000.0
    people = traffic.pedestrians or (round(PEOPLE * wanted) if network.of_kind("walk") else 0)
    density = min(max(wanted - people, 0) / max(length, 1e-3), DENSEST)
    parked = traffic.parked
    whole: list[PlannedActor] = []
    for _ in range(_TRIES):
        asked = traffic.with_(actors=None, density=density, pedestrians=min(people, MOST_PEOPLE), parked=parked)
        with warnings.catch_warnings():  # who finds no place or would touch another: more are asked for
            warnings.simplefilter("ignore", ScarlWarning)
            planned = simulate_traffic(network, asked, span, others=others)
        whole = [one for one in planned if one.active[0] <= span[0] and one.active[1] >= span[1]]
        if len(whole) >= wanted or (density >= DENSEST and (people >= MOST_PEOPLE or not people)):
            break
        density = min(max(density, 1.0) * _MORE, DENSEST)
        people, parked = round(people * _MORE), max(parked, _PARKED)
    if len(whole) < wanted:
        text = f"traffic.actors: the lanes have room for {len(whole)} of {wanted} actors for the whole drive"
        warnings.warn(text, ScarlWarning, stacklevel=2)
        return whole
    time = 0.5 * (span[0] + span[1])
    middle = np.mean([lane.points.mean(0) for lane in network.lanes], axis=0)
    place = middle if ego is None else ego.pose(min(max(time, ego.start), ego.stop)).position
    away = [float(np.linalg.norm(one.trajectory.pose(time).position - place)) for one in whole]
    kept = sorted(np.argsort(away, kind="stable")[:wanted])
    return [whole[index] for index in kept]


def is_close(trajectory: Trajectory, ego: Trajectory | None, span: tuple[float, float], motion: str) -> bool:
    """Return whether an actor, by its model's `motion`, comes near the ego vehicle within a span [s].

    Without an ego vehicle all are near.
    """
    if ego is None:
        return True
    limit = CLOSE_ON_FOOT if motion in ("walk", "stand") else CLOSE
    for time in np.linspace(*span, max(int((span[1] - span[0]) / 0.25), 1) + 1):
        own, other = (one.pose(min(max(float(time), one.start), one.stop)).position for one in (trajectory, ego))
        if np.linalg.norm(own - other) < limit:
            return True
    return False
