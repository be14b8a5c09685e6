"""Shapes that swing about an axis: an arm that waves by the time, the legs of a dog by the way that it has gone."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose

from .trajectory import Motion, Trajectory, forward_speeds


class Way(Protocol):
    """How far an actor has gone along its heading [m]."""

    def at(self, time: float) -> float:
        """Return the way up to a time [s]."""

    def on(self, trajectory: Trajectory) -> Way:
        """Return the way along another trajectory."""


class Cycles(Protocol):
    """Cycles that were swung up to a time, and how many a second."""

    def at(self, time: float) -> tuple[float, float]:
        """Return cycles and their rate [1/s] at a time [s]."""

    def on(self, trajectory: Trajectory) -> Cycles:
        """Return the same swing of an actor that moves along another trajectory."""


@dataclass(frozen=True)
class ByTime:
    """A swing of a steady frequency [1/s]."""

    frequency: float

    def at(self, time: float) -> tuple[float, float]:
        """Return cycles since time 0, and their rate [1/s]."""
        return self.frequency * time, self.frequency

    def on(self, _: Trajectory) -> ByTime:
        """Return itself."""
        return self


@dataclass(frozen=True, eq=False)
class ByWay:
    """A swing whose cycle is a stride [m] of the way along the heading."""

    stride: float
    trajectory: Trajectory
    way: Way

    def at(self, time: float) -> tuple[float, float]:
        """Return cycles since the start, and their rate [1/s]."""
        speed = float(forward_speeds(self.trajectory, np.array([time]))[0])
        return self.way.at(time) / self.stride, speed / self.stride

    def on(self, trajectory: Trajectory) -> ByWay:
        """Return the same swing along another trajectory."""
        return ByWay(self.stride, trajectory, self.way.on(trajectory))


@dataclass(frozen=True, eq=False)
class Swing:
    """Shapes that swing about an axis, angle = mean + amplitude sin(2 pi cycles).

    Attributes
    ----------
    shapes : tuple of str
        What swings; modelled in the actor's frame, where it hangs at the angle 0.
    center : ndarray of float64, shape (3,)
        A point of the axis, in the actor's frame [m].
    axis : ndarray of float64, shape (3,)
        Unit vector.
    amplitude, mean : float
        [rad]
    cycles : Cycles
    start : float
        Cycles at time 0.
    """

    shapes: tuple[str, ...]
    center: npt.NDArray[np.float64]
    axis: npt.NDArray[np.float64]
    amplitude: float
    mean: float
    cycles: Cycles
    start: float = 0.0
    changes_shape: bool = False
    reach: None = None

    def motions(self, time: float) -> dict[str, Motion]:
        """Return the turn about the axis and its rate."""
        cycles, rate = self.cycles.at(time)
        turn = 2.0 * math.pi * (cycles + self.start)
        angle = self.mean + self.amplitude * math.sin(turn)
        speed = self.amplitude * 2.0 * math.pi * rate * math.cos(turn)
        moved = Motion(Pose(self.center)).then(Motion.about(self.axis, angle, speed)).then(Motion(Pose(-self.center)))
        return dict.fromkeys(self.shapes, moved)


def swing_from_table(
    table: Mapping[str, Any], what: str, shapes: Collection[str], trajectory: Trajectory, way: Way
) -> Swing:
    """Return the swing of a row of ``[[joints]]``.

    Keys: shapes, center [m], axis, amplitude_deg, frequency [1/s] or stride [m]; optional mean_deg and phase [cycles].

    Raises
    ------
    ParameterRangeError, UnknownNameError
        If a key is missing, unknown or not allowed, or a shape is not there.
    """
    by = sorted({"frequency", "stride"} & set(table))
    if len(by) != 1:
        raise ParameterRangeError(f"{what}.frequency", ", ".join(by) or "missing", "one of frequency and stride")
    needed, optional = {"shapes", "center", "axis", "amplitude_deg", by[0]}, {"mean_deg", "phase"}
    if missing := needed - set(table):
        raise ParameterRangeError(f"{what}.{sorted(missing)[0]}", "missing", "needed for this kind of joint")
    if unknown := set(table) - needed - optional - {"kind"}:
        raise UnknownNameError(f"key of {what}", sorted(unknown)[0], needed | optional | {"kind"})
    if absent := [shape for shape in table["shapes"] if shape not in shapes]:
        raise UnknownNameError(f"shape of {what}", str(absent[0]), shapes)
    center, axis = (np.asarray(table[name], dtype=np.float64) for name in ("center", "axis"))
    if center.shape != (3,) or not np.isfinite(center).all():
        raise ParameterRangeError(f"{what}.center", table["center"], "three finite coordinates [m]")
    if axis.shape != (3,) or not 0.0 < float(np.linalg.norm(axis)) < np.inf:
        raise ParameterRangeError(f"{what}.axis", table["axis"], "a direction of three coordinates, not zero")
    pace, amplitude = float(table[by[0]]), float(table["amplitude_deg"])
    if not 0.0 < pace < np.inf:
        raise ParameterRangeError(f"{what}.{by[0]}", pace, "above 0")
    if not 0.0 <= amplitude <= 180.0:
        raise ParameterRangeError(f"{what}.amplitude_deg", f"{amplitude} deg", "0 to 180 deg")
    cycles: Cycles = ByTime(pace) if by[0] == "frequency" else ByWay(pace, trajectory, way)
    turn, mean = math.radians(amplitude), math.radians(float(table.get("mean_deg", 0.0)))
    unit = axis / np.linalg.norm(axis)
    return Swing(tuple(table["shapes"]), center, unit, turn, mean, cycles, float(table.get("phase", 0.0)))
