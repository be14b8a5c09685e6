"""Shifts to the side over a time as ways along a route, where steering and grip allow them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ScenarioPlace, ScenarioValueError
from scarl_sionna.scenario.spec.motion import RouteSpec, ShiftSpec

from .bodies import ActorBody
from .paths import LateralShift
from .profiles import SpeedProfile

Array = npt.NDArray[np.float64]
PlaceOf = Callable[..., ScenarioPlace]
"""Returns the place of a key of the trajectory: ``place("lanes", 0)``."""

GRIP = 8.0
"""Largest lateral acceleration of a shift [m/s^2]: what tyres give on a dry road."""
_SAMPLES = 129
_PEAK = 10.0 / np.sqrt(3.0)
"""Largest second derivative of the quintic step."""


def shifts_of(
    spec: RouteSpec,
    profile: SpeedProfile,
    start: float,
    begin: float,
    body: ActorBody,
    place: Callable[..., ScenarioPlace],
) -> list[LateralShift]:
    """Return the shifts of a route along its way.

    Parameters
    ----------
    spec : RouteSpec
    profile : SpeedProfile
        Speed over time from `begin` on.
    start : float
        Way of the actor's origin at `begin` [m].
    begin : float
        When the motion begins [s].
    body : ActorBody
    place : callable
        Returns the place of a key of the route.

    Raises
    ------
    ScenarioValueError
        If a shift begins before the motion, or if what is driven meanwhile is too short for it: a bend sharper than
        `ActorBody.sharpest`, or a lateral acceleration above `GRIP`. Bends of the lanes are not counted.
    """
    found: list[tuple[int, ShiftSpec, LateralShift]] = []
    for index, event in enumerate(spec.events):
        if isinstance(event, ShiftSpec) and event.by != 0.0:
            since = event.time - begin
            if since < -1e-9:
                raise ScenarioValueError(
                    f"= {event.time:g} s is before the motion begins, at {begin:.4g} s",
                    place("events", index, "time"),
                    "state `offset` for where it is at the beginning",
                    value=event.time,
                )
            first, last = profile.way(since + event.duration)([max(since, 0.0), since + event.duration])
            found.append(
                (index, event, LateralShift(start + body.rear_axle + first, max(last - first, 1e-3), event.by))
            )
    shifts = [shift for _, _, shift in found]
    for index, event, shift in found:
        _check(event, shift, (shifts, profile, start + body.rear_axle, begin), body, place("events", index))
    return shifts


def _check(
    event: ShiftSpec,
    shift: LateralShift,
    motion: tuple[Sequence[LateralShift], SpeedProfile, float, float],
    body: ActorBody,
    place: ScenarioPlace,
) -> None:
    """Raise if a shift bends more than the body steers, or faster than its tyres hold."""
    shifts, profile, rear, begin = motion
    way = profile.way(event.time - begin + event.duration)
    times = np.linspace(0.0, event.duration, _SAMPLES) + max(event.time - begin, 0.0)
    places = shift.start + shift.length * np.linspace(0.0, 1.0, _SAMPLES)
    bend = float(np.abs(_bend(shifts, places)).max())
    pull = float(np.abs(_bend(shifts, rear + way(times)) * way(times, 1) ** 2).max())
    side = "left" if event.by > 0.0 else "right"
    what = (
        f"shifts {abs(event.by):g} m to the {side} from {event.time:g} to {event.time + event.duration:g} s, while it "
        f"drives {way(times[-1]) - way(times[0]):.3g} m"
    )
    least = np.sqrt(_PEAK * abs(event.by) / body.sharpest)
    remedy = "shift while it drives, by less or for a longer time"
    if bend > body.sharpest:
        raise ScenarioValueError(
            f"{what}, which is too short (allowed: bends of radius {1.0 / body.sharpest:.3g} m or more, so "
            f"{least:.3g} m or more for one such shift)",
            place,
            remedy,
            value=event.by,
        )
    if pull > GRIP:
        raise ScenarioValueError(
            f"{what}: a lateral acceleration of {pull:.3g} m/s^2 (allowed: up to {GRIP:g} m/s^2)",
            place,
            remedy,
            value=event.by,
        )


def _bend(shifts: Sequence[LateralShift], ways: Array) -> Array:
    """Return the curvature [1/m] that shifts make of a straight line, at ways (N,) [m] along it."""
    slope, change = np.zeros_like(ways), np.zeros_like(ways)
    for one in shifts:
        x = np.clip((ways - one.start) / one.length, 0.0, 1.0)
        slope += one.offset / one.length * 30.0 * (x * (1.0 - x)) ** 2
        change += one.offset / one.length**2 * 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x)
    return np.asarray(change / (1.0 + slope**2) ** 1.5)
