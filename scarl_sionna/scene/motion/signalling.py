"""What the lamps of a vehicle tell: that it brakes, where it will go, that it is parked; all follows from its way."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from .trajectory import StaticTrajectory, Trajectory, forward_speeds, known_until, lane_offsets

Side = Literal["left", "right"]
BRAKING = 1.0
"""Deceleration above which brake lamps shine [m/s2]: between the engine's drag and what UN Regulation 13-H makes lamps
of electric braking show, which may begin at 0.7 and must at 1.3."""
STANDING = 0.05
"""A slower vehicle [m/s] is held by its brakes."""
AHEAD, BEHIND = 5.5, 5.0
"""How far ahead and back in time a change of lane is looked for [s]: it is indicated from 5.5 s before it ends."""
SHIFT = (1.5, 6.0)
"""How far aside of its way a vehicle goes that changes lane [m]."""
STRAIGHT = np.radians(3.0)
"""Difference of the headings before and after a change of lane; in narrower bends none is seen."""
LEFT_TO_GO = 0.2
"""Share of the change at whose end indicators go out."""
TURN, SOON = np.radians(35.0), (1.0, 2.5)
"""Change of heading that is a turn off the road, and from how long before to how long after a time it counts [s]."""
BLINK = 1.5
"""Flashes a second: 60 to 120 a minute by UN Regulation 148."""
_STEP, _PACE, _LOOK = 0.1, 0.1, 0.5
_LEAST_TURN = np.radians(0.5)
"""Who never turns by so much does not change lane: 1.5 m aside in 5 s at 30 m/s are 0.6 deg in the mean."""
Array = npt.NDArray[np.float64]


def is_parked(trajectory: Trajectory | None) -> bool:
    """Return whether a vehicle never moves: its lamps are off."""
    return trajectory is None or isinstance(trajectory, StaticTrajectory)


def is_braking(trajectory: Trajectory, time: float) -> bool:
    """Return whether a vehicle's brake lamps shine at a time [s]: it gets slower by more than `BRAKING`, or stands.

    The deceleration is the mean over 0.2 s, forward or backward.
    """
    return not is_parked(trajectory) and bool(_braking(trajectory, np.array([time]))[0])


def _braking(trajectory: Trajectory, times: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    low, high = trajectory.start, min(trajectory.stop, known_until(trajectory))
    now = np.clip(times, low, high)
    first, last = np.clip(now - _STEP, low, high), np.clip(now + _STEP, low, high)
    speeds = np.abs(forward_speeds(trajectory, np.concatenate([now, first, last]))).reshape(3, -1)
    passed = np.maximum(last - first, 1e-9)
    return np.asarray(((speeds[1] - speeds[2]) / passed > BRAKING) | (speeds[0] < STANDING))


def indicated(trajectory: Trajectory, time: float) -> Side | None:
    """Return the side to which a vehicle indicates at a time [s].

    It turns off where its heading changes by `TURN`. It changes lane where it goes aside by `SHIFT`, and `LEFT_TO_GO`
    of that lies ahead: aside of the lanes that it follows, in bends as well; where it follows none, aside between two
    times around this one at which it has the same heading. A way by points that swings aside as much looks the same.
    """
    if is_parked(trajectory):
        return None
    yaw, _ = _ways(trajectory, time + np.array([-SOON[0], SOON[1]]))
    turn = _wrapped(yaw[1] - yaw[0])
    if abs(turn) > TURN:
        return "left" if turn > 0.0 else "right"
    grid = np.concatenate([np.arange(-BEHIND, 0.0, _LOOK), [0.0], np.arange(_LOOK, AHEAD + 1e-9, _LOOK)])
    now = int(np.flatnonzero(grid == 0.0)[0])
    first, last = np.meshgrid(np.arange(now + 1), np.arange(now + 1, len(grid)), indexing="ij")
    offsets = lane_offsets(trajectory, time + grid)
    if offsets is not None:
        turned, aside, to_go = np.zeros(first.shape), offsets[last] - offsets[first], offsets[last] - offsets[now]
    else:
        yaw, place = _ways(trajectory, time + grid)
        turned = _wrapped(yaw[last] - yaw[first])
        along = yaw[first] + 0.5 * turned
        across = np.stack([-np.sin(along), np.cos(along)], axis=-1)
        aside = np.sum((place[last] - place[first]) * across, axis=-1)
        to_go = np.sum((place[last] - place[now]) * across, axis=-1)
    low, high = SHIFT
    found = (np.abs(turned) < STRAIGHT) & (np.abs(aside) > low) & (np.abs(aside) < high)
    found &= to_go * np.sign(aside) > LEFT_TO_GO * np.abs(aside)
    if not found.any():
        return None
    return "left" if float(aside[found][np.argmax(np.abs(aside[found]))]) > 0.0 else "right"


def _ways(trajectory: Trajectory, times: Array) -> tuple[Array, Array]:
    """Return headings [rad], shape (n,), and places [m], shape (n, 2), at times, those beyond the way at its ends."""
    low, high = trajectory.start, min(trajectory.stop, known_until(trajectory))
    poses = [trajectory.pose(min(max(time, low), high)) for time in times.tolist()]
    return np.array([pose.yaw for pose in poses]), np.array([pose.position[:2] for pose in poses])


def _wrapped(angle: Array) -> Array:
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)


def is_flash(time: float) -> bool:
    """Return whether indicators are bright at a time [s]: the first half of each period, for all vehicles alike."""
    return (time * BLINK) % 1.0 < 0.5


def ever_signals(trajectory: Trajectory) -> bool:
    """Return whether a vehicle may brake or indicate at any time; True where its way may still change."""
    if is_parked(trajectory):
        return False
    if np.isfinite(known_until(trajectory)):
        return True
    if not (np.isfinite(trajectory.start) and np.isfinite(trajectory.stop)):
        return is_braking(trajectory, 0.0) or indicated(trajectory, 0.0) is not None
    times = np.linspace(trajectory.start, trajectory.stop, int((trajectory.stop - trajectory.start) / _PACE) + 2)
    if _braking(trajectory, times).any():
        return True
    yaw, _ = _ways(trajectory, times[::5])
    return bool(np.abs(_wrapped(yaw - yaw[0])).max() > _LEAST_TURN)
