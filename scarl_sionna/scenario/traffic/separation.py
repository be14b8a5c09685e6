"""The detector's last word on planned traffic: motions that meet are not shown."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScarlWarning
from scarl_sionna.scenario.checks.collisions import find_collisions
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike
from scarl_sionna.scene.motion.trajectory import Trajectory

from .planned import PlannedActor


def without_collisions(
    actors: Sequence[PlannedActor],
    times: npt.ArrayLike,
    others: Sequence[tuple[Trajectory, BodyLike]] = (),
    tolerance: float = 0.0,
) -> list[PlannedActor]:
    """Return planned actors without those that would touch an earlier one of them, or one of some given motions.

    Parameters
    ----------
    actors : sequence of PlannedActor
    times : array_like of float, shape (N,)
        Instants at which they are compared [s]; beyond the scene (`PlannedActor.active`) two of them may meet.
    others : sequence of (Trajectory, body)
        Motions that stay.
    tolerance : float
        Depth that still counts as apart [m].

    Warns
    -----
    ScarlWarning
        If an actor is left out.
    """
    bodies = [(f"given {number}", trajectory, ActorBody.of(body)) for number, (trajectory, body) in enumerate(others)]
    bodies += [(actor.name, actor.trajectory, actor.body) for actor in actors]
    rank = {name: number for number, (name, _, _) in enumerate(bodies)}
    present = {actor.name: actor.active for actor in actors}
    dropped: set[str] = set()
    for hit in find_collisions(bodies, times, tolerance):
        windows = [present.get(name, (-np.inf, np.inf)) for name in (hit.first, hit.second)]
        is_outside = max(start for start, _ in windows) > hit.last or min(stop for _, stop in windows) < hit.time
        if is_outside or hit.first in dropped or hit.second in dropped:
            continue
        later = max((hit.first, hit.second), key=rank.__getitem__)
        if rank[later] >= len(others):
            dropped.add(later)
    if dropped:
        warnings.warn(
            f"{len(dropped)} of {len(actors)} planned actors would have touched another one and are left out: "
            f"{', '.join(sorted(dropped)[:5])}",
            ScarlWarning,
            stacklevel=3,
        )
    return [actor for actor in actors if actor.name not in dropped]
