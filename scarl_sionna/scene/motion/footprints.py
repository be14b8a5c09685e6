"""Where a walker's feet stand in the world: one print a step, found from the trajectory and kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt
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
"""Largest height of a print over the ground below the walker [m] where nobody knows the ground: beyond, a foot rises
with the walker."""
STEP = 0.3
"""Largest height of a print over the ground below the walker [m] where the ground is known: a kerb, a stair."""
_FLAT = 0.004
"""How far the ground under a sole that stands may be from a plane [m]."""
_SAME = 1e-3
"""A ground as near as this to the walker's own height is that height [m]."""
_SHORTER = np.array([0.02 * sign * number for number in range(1, 13) for sign in (1, -1)])
"""How much longer or shorter a step may be so that the whole sole stands on one plane [m], in the order of trying."""
_STEEPEST = 0.4
"""Largest slope that a sole follows."""
_SOLE = np.array([-0.5, -0.25, 0.0, 0.25, 0.5, 0.8, 1.1])
"""Places along a sole at which the ground is looked at, from the ankle, over the length of the foot."""
_ASIDE = 0.05
"""Speed backward [m/s] above which somebody does not walk."""


class Ground(Protocol):
    """What somebody walks on."""

    def heights(self, points: npt.NDArray[np.float64], reach: float) -> npt.NDArray[np.float64]:
        """Return the height (N,) [m] at most `reach` [m] above or below points (N, 3) [m, world]; NaN: none."""


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

    A foot stands below the place where the walker's middle passes it, a runner's a little before, and points as the
    walker does then. What lies
    before the start and after the stop of the trajectory is continued at the speed that it has there.

    Parameters
    ----------
    trajectory : Trajectory
    gait : WalkingGait
    phase : callable
        Phase of the gait [cycles] at a time [s]; it never falls.
    ground : Ground or None
        On which the prints stand, each with the whole sole on one level: at a kerb a step is a little longer or
        shorter. None: the height of the walker's own frame.
    """

    def __init__(
        self,
        trajectory: Trajectory,
        gait: WalkingGait,
        phase: Callable[[float], float],
        ground: Ground | None = None,
    ) -> None:
        self._trajectory, self._gait, self._phase, self._ground = trajectory, gait, phase, ground
        self._uneven = _UNEVEN if ground is None else STEP
        self._known: dict[tuple[str, int], tuple[Pose, float]] = {}

    def at(self, time: float) -> Prints:
        """Return the last and the next print of each foot at a time [s], relative to the walker's frame."""
        pose, twist, phase = self._trajectory.pose(time), self._trajectory.twist(time), self._phase(time)
        world_from, prints = pose.inverse(), {}
        for side, shift in SIDES.items():
            number, pair = math.floor(phase + shift), []
            for step in (number, number + 1):
                there, pitch = self._print(side, step, time)
                speed = -world_from.rotate(twist.velocity_at(there.position - pose.position))
                turn = math.remainder(there.yaw - pose.yaw, 2.0 * math.pi)
                place = world_from.apply(there.position)
                if abs(place[2]) > self._uneven:
                    place[2], speed[2] = math.copysign(self._uneven, place[2]), 0.0
                pair.append(FootPrint(place, speed, turn, -float(twist.angular[2]), pitch))
            prints[side] = (pair[0], pair[1])
        return prints

    def _print(self, side: str, step: int, near: float) -> tuple[Pose, float]:
        """Return a print, and how far its toes point down [rad]."""
        if (side, step) not in self._known:
            middle, ahead = self._pose(step + MIDSTANCE - SIDES[side], near)
            beside = middle.apply([ahead, self._gait.step_aside(side), 0.0])
            self._known[side, step] = self._standing(Pose(beside, middle.quaternion))
        return self._known[side, step]

    def _standing(self, place: Pose) -> tuple[Pose, float]:
        """Return a print on the ground, moved along its heading to where the whole sole stands on one plane."""
        if self._ground is None:
            return place, 0.0
        ahead, along = np.array([math.cos(place.yaw), math.sin(place.yaw), 0.0]), self._gait.lengths.foot * _SOLE
        for shifts in (np.zeros(1), _SHORTER):
            middles = place.position + shifts[:, None] * ahead
            soles = middles[:, None, :] + along[:, None] * ahead
            heights = self._ground.heights(soles.reshape(-1, 3), STEP).reshape(len(shifts), -1)
            if np.abs(heights[0] - place.position[2]).max() < _SAME:
                break
            slope, level = np.polynomial.polynomial.polyfit(along, heights.T, 1)[::-1]
            off = np.abs(heights - level[:, None] - slope[:, None] * along).max(axis=1)
            stands = np.flatnonzero((off < _FLAT) & (np.abs(slope) < _STEEPEST))  # none of those with a NaN
            if len(stands):
                best = stands[0]
                moved = middles[best] * [1.0, 1.0, 0.0] + [0.0, 0.0, level[best]]
                return Pose(moved, place.quaternion), -math.atan(slope[best])
        return place, 0.0

    def _pose(self, phase: float, near: float) -> tuple[Pose, float]:
        """Return where the walker is at a phase, sought from a time near it [s], and how far ahead the foot is [m]."""
        missing = phase - self._phase(near)
        step = math.copysign(_STRIDE, missing)
        for _ in range(_FARTHEST):
            following = _inside(self._trajectory, near + step)
            if (phase - self._phase(following)) * missing <= 0.0:
                found = brentq(lambda time: self._phase(time) - phase, near, following, xtol=1e-9)
                return self._trajectory.pose(found), self._gait.print_ahead(self._speed(found))
            if following == near or not (math.isfinite(self._trajectory.stop) or self._cadence(near)):
                break
            near = following
        pose, twist, cadence = self._trajectory.pose(near), self._trajectory.twist(near), self._cadence(near)
        ahead = (phase - self._phase(near)) / cadence if cadence > 1e-3 else 0.0
        there = Pose(pose.position + ahead * twist.linear, pose.quaternion)
        return there, self._gait.print_ahead(self._speed(near))

    def _speed(self, time: float) -> float:
        return max(float(forward_speeds(self._trajectory, np.array([time]))[0]), 0.0)

    def _cadence(self, time: float) -> float:
        return self._gait.cadence(self._speed(time))
