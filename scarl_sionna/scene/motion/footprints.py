"""Where a walker's feet stand in the world: one print a step, found from the trajectory and kept."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from scarl_sionna.core.pose import Pose

from .gait import SIDES, WalkingGait
from .steps import MIDSTANCE, FootPrint, Prints
from .trajectory import Trajectory, forward_speeds

_STRIDE = 0.25
"""Step of the search for the time of a phase [s]."""
_FARTHEST = 2400
"""Steps of a search where a trajectory has no end: 10 minutes."""
_UNEVEN = 0.024
"""Largest height of a print over the ground below the walker [m]: beyond, as at kerbs, a foot rises with the walker."""
_ASIDE = 0.05
"""Speed backward [m/s] above which somebody does not walk."""


def steps_forward(trajectory: Trajectory) -> bool:
    """Return whether somebody who moves so walks ahead: who is carried backward has no prints."""
    if not (math.isfinite(trajectory.start) and math.isfinite(trajectory.stop)):
        return bool(forward_speeds(trajectory, np.array([_inside(trajectory, 0.0)]))[0] > -_ASIDE)
    count = max(int((trajectory.stop - trajectory.start) / _STRIDE), 1) + 1
    return bool(forward_speeds(trajectory, np.linspace(trajectory.start, trajectory.stop, count)).min() > -_ASIDE)


def _inside(trajectory: Trajectory, time: float) -> float:
    return min(max(time, trajectory.start), trajectory.stop)


class FootPrints:
    """Prints of a walker's feet.

    A foot stands below the place where the walker's middle passes it, and points as the walker does then. What lies
    before the start and after the stop of the trajectory is continued at the speed that it has there.

    Parameters
    ----------
    trajectory : Trajectory
    gait : WalkingGait
    phase : callable
        Phase of the gait [cycles] at a time [s]; it never falls.
    """

    def __init__(self, trajectory: Trajectory, gait: WalkingGait, phase: Callable[[float], float]) -> None:
        self._trajectory, self._gait, self._phase = trajectory, gait, phase
        self._known: dict[tuple[str, int], Pose] = {}

    def at(self, time: float) -> Prints:
        """Return the last and the next print of each foot at a time [s], relative to the walker's frame."""
        pose, twist, phase = self._trajectory.pose(time), self._trajectory.twist(time), self._phase(time)
        world_from, prints = pose.inverse(), {}
        for side, shift in SIDES.items():
            number, pair = math.floor(phase + shift), []
            for step in (number, number + 1):
                there = self._print(side, step, time)
                speed = -world_from.rotate(twist.velocity_at(there.position - pose.position))
                turn = math.remainder(there.yaw - pose.yaw, 2.0 * math.pi)
                place = world_from.apply(there.position)
                if abs(place[2]) > _UNEVEN:
                    place[2], speed[2] = math.copysign(_UNEVEN, place[2]), 0.0
                pair.append(FootPrint(place, speed, turn, -float(twist.angular[2])))
            prints[side] = (pair[0], pair[1])
        return prints

    def _print(self, side: str, step: int, near: float) -> Pose:
        if (side, step) not in self._known:
            middle = self._pose(step + MIDSTANCE - SIDES[side], near)
            beside = middle.apply([0.0, self._gait.step_aside(side), 0.0])
            self._known[side, step] = Pose(beside, middle.quaternion)
        return self._known[side, step]

    def _pose(self, phase: float, near: float) -> Pose:
        """Return where the walker is at a phase, sought from a time near it [s]."""
        missing = phase - self._phase(near)
        step = math.copysign(_STRIDE, missing)
        for _ in range(_FARTHEST):
            following = _inside(self._trajectory, near + step)
            if (phase - self._phase(following)) * missing <= 0.0:
                found = brentq(lambda time: self._phase(time) - phase, near, following, xtol=1e-9)
                return self._trajectory.pose(found)
            if following == near or not (math.isfinite(self._trajectory.stop) or self._cadence(near)):
                break
            near = following
        pose, twist, cadence = self._trajectory.pose(near), self._trajectory.twist(near), self._cadence(near)
        ahead = (phase - self._phase(near)) / cadence if cadence > 1e-3 else 0.0
        return Pose(pose.position + ahead * twist.linear, pose.quaternion)

    def _cadence(self, time: float) -> float:
        speed = float(forward_speeds(self._trajectory, np.array([time]))[0])
        return self._gait.cadence(max(speed, 0.0))
