"""Way over time: jerk-limited speed profiles, and smooth curves through sampled ways."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PPoly

from scarl_sionna.core.errors import ParameterRangeError

Array = npt.NDArray[np.float64]

_STANDING = 2e-3
"""Mean speed between two samples below which a body stands [m/s]."""


@dataclass(frozen=True)
class SpeedProfile:
    """Speed over time with bounded acceleration and jerk; the way is C2, and constant speed goes on at the end.

    Parameters
    ----------
    initial : float
        Speed at the beginning, >= 0 [m/s].
    pieces : tuple of (float, float)
        Duration [s] and constant jerk [m/s^3] of each piece; made by :meth:`hold`, :meth:`reach` and :meth:`stop_at`.

    Examples
    --------
    Drive 2 s at 8 m/s, accelerate to 13 m/s, and brake to a stop 120 m from the start:

    >>> profile = SpeedProfile(8.0).hold(2.0).reach(13.0).stop_at(120.0, deceleration=6.0, jerk=15.0)
    """

    initial: float
    pieces: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        _check_range("SpeedProfile.initial", self.initial, 0.0, 120.0, "m/s")

    def hold(self, duration: float) -> SpeedProfile:
        """Return the profile followed by a time at constant speed [s]."""
        _check_range("duration", duration, 0.0, 1e6, "s")
        return SpeedProfile(self.initial, (*self.pieces, (float(duration), 0.0))) if duration > 0.0 else self

    def reach(self, speed: float, acceleration: float = 1.5, jerk: float = 2.0) -> SpeedProfile:
        """Return the profile followed by a change to a speed [m/s].

        `acceleration` [m/s^2] and `jerk` [m/s^3] bound it, in both directions.
        """
        _check_range("speed", speed, 0.0, 120.0, "m/s")
        _check_range("acceleration", acceleration, 0.01, 15.0, "m/s^2")
        _check_range("jerk", jerk, 0.01, 100.0, "m/s^3")
        change = speed - self.final_speed
        if change == 0.0:
            return self
        ramp = min(acceleration / jerk, float(np.sqrt(abs(change) / jerk)))
        plateau = max(abs(change) / (jerk * ramp) - ramp, 0.0)
        sign = float(np.sign(change))
        pieces = ((ramp, sign * jerk), (plateau, 0.0), (ramp, -sign * jerk))
        return SpeedProfile(self.initial, (*self.pieces, *(piece for piece in pieces if piece[0] > 0.0)))

    def stop_at(self, way: float, deceleration: float = 3.0, jerk: float = 5.0) -> SpeedProfile:
        """Return the profile that keeps its speed and brakes in time to stand after a way from its beginning [m].

        Raises
        ------
        ParameterRangeError
            If the way is too short for the deceleration and jerk.
        """
        braking = self.reach(0.0, deceleration, jerk)
        left = way - braking.final_way
        speed = self.final_speed
        if left < 0.0 or (speed == 0.0 and left > 1e-9):
            raise ParameterRangeError(
                "way", way, f"{braking.final_way:.4g} m or more, and not at rest", "brake harder or begin slower"
            )
        return self.hold(left / speed if speed > 0.0 else 0.0).reach(0.0, deceleration, jerk)

    @property
    def duration(self) -> float:
        """Time until the speed is constant for good [s]."""
        return float(sum(duration for duration, _ in self.pieces))

    @property
    def final_speed(self) -> float:
        """Speed at the end [m/s]."""
        speed = self._end()[1]
        return speed if speed > 1e-9 else 0.0

    @property
    def final_way(self) -> float:
        """Way until the speed is constant for good [m]."""
        return self._end()[0]

    def _end(self) -> tuple[float, float, float]:
        way, speed, pull = 0.0, float(self.initial), 0.0
        for time, jerk in self.pieces:
            way += time * (speed + time * (pull / 2.0 + time * jerk / 6.0))
            speed += time * (pull + time * jerk / 2.0)
            pull += time * jerk
        return way, speed, pull

    def way(self, duration: float, start_time: float = 0.0, offset: float = 0.0) -> PPoly:
        """Return the way [m] as a piecewise cubic of time [s] from `start_time` on.

        For `duration` [s], with `offset` [m] at the beginning.
        """
        times, rows, state = [start_time], [], (float(offset), float(self.initial), 0.0)
        rest = max(duration - self.duration, 0.0) + 1e-9
        for time, jerk in (*self.pieces, (rest, 0.0)):
            way, speed, pull = state
            rows.append([jerk / 6.0, pull / 2.0, speed, way])
            state = (
                way + time * (speed + time * (pull / 2.0 + time * jerk / 6.0)),
                speed + time * (pull + time * jerk / 2.0),
                pull + time * jerk,
            )
            times.append(times[-1] + time)
            if abs(state[2]) < 1e-12:  # the end of a change: no rounding goes on
                state = (state[0], max(state[1], 0.0) if state[1] > 1e-12 else 0.0, 0.0)
        return PPoly(np.array(rows).T, np.array(times))


def constant_way(speed: float, start_time: float, stop_time: float, offset: float = 0.0) -> PPoly:
    """Return the way at a constant speed [m/s] between two times [s], `offset` [m] at the first."""
    return PPoly(np.array([[float(speed)], [float(offset)]]), np.array([start_time, stop_time], dtype=np.float64))


def way_from_states(times: Array, ways: Array, speeds: Array, accelerations: Array) -> PPoly:
    """Return the C2 piecewise quintic with given ways [m], speeds [m/s] and accelerations [m/s^2] at times (N,) [s]."""
    step = np.diff(times)
    way = np.diff(ways) - speeds[:-1] * step - accelerations[:-1] * step**2 / 2.0
    speed = (np.diff(speeds) - accelerations[:-1] * step) * step
    pull = np.diff(accelerations) * step**2 / 2.0
    rows = [
        (6.0 * way - 3.0 * speed + pull) / step**5,
        (-15.0 * way + 7.0 * speed - 2.0 * pull) / step**4,
        (10.0 * way - 4.0 * speed + pull) / step**3,
        accelerations[:-1] / 2.0,
        speeds[:-1],
        ways[:-1],
    ]
    return PPoly(np.array(rows), times)


def smooth_way(times: npt.ArrayLike, ways: npt.ArrayLike, turns: bool = False) -> PPoly:
    """Return a C2 way [m] over time [s] through samples of shape (N,) that never runs backwards between rising samples.

    With `turns` it keeps the slope of the spline where it goes over from rising to falling samples, or back; else it
    stands there.

    Notes
    -----
    The cubic spline, whose slopes are limited as Fritsch and Carlson ask for a monotone curve [1]_ and are zero where
    the body stands; with the slopes and the spline's accelerations (zero where a slope was limited) as a piecewise
    quintic. Where nothing is limited the result is the cubic spline itself.

    References
    ----------
    .. [1] F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17, 1980.
    """
    time, way = np.asarray(times, dtype=np.float64), np.asarray(ways, dtype=np.float64)
    if time.ndim != 1 or time.size < 2 or way.shape != time.shape or not np.all(np.diff(time) > 0.0):
        raise ParameterRangeError(
            "times", f"shape {time.shape}", "two or more strictly rising times [s], a way for each"
        )
    mean = np.diff(way) / np.diff(time)
    if time.size == 2:
        return constant_way(float(mean[0]), time[0], time[1], float(way[0]))
    spline = CubicSpline(time, way)
    slope, bend = spline(time, 1), spline(time, 2)
    before, after = np.concatenate([mean[:1], mean]), np.concatenate([mean, mean[-1:]])
    top = 3.0 * np.minimum(np.abs(before), np.abs(after))
    limited = np.clip(slope, -top, top)
    if turns:
        limited[before * after < 0.0] = slope[before * after < 0.0]
    else:
        limited[before * after <= 0.0] = 0.0
    limited[np.minimum(np.abs(before), np.abs(after)) < _STANDING] = 0.0
    bend = np.where(limited == slope, bend, 0.0)
    return way_from_states(time, way, limited, bend)


def _check_range(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not low <= value <= high:
        raise ParameterRangeError(name, value, f"{low:g} to {high:g} {unit}")
