"""Transitions of OpenSCENARIO in closed form: shapes, how long they take, and the way that they cover."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scarl_sionna.scenario.openscenario.reading.source import Node

SHAPES = ("linear", "cubic", "sinusoidal", "step")
DIMENSIONS = ("time", "rate", "distance")
_PEAK = {"linear": 1.0, "cubic": 1.5, "sinusoidal": 0.5 * math.pi, "step": 0.0}
"""Largest slope of a shape of height and length 1."""


def share(shape: str, x: float) -> float:
    """Return the part of a transition that is done after a part x of its length: 0 to 1.

    ``linear`` x, ``cubic`` 3 x^2 - 2 x^3, ``sinusoidal`` (1 - cos(pi x)) / 2.
    """
    x = min(max(x, 0.0), 1.0)
    if shape == "linear":
        return x
    return x * x * (3.0 - 2.0 * x) if shape == "cubic" else 0.5 * (1.0 - math.cos(math.pi * x))


def covered(shape: str, x: float) -> float:
    """Return the integral of `share` from 0 to x, also beyond the end."""
    inside = min(max(x, 0.0), 1.0)
    if shape == "linear":
        area = 0.5 * inside * inside
    elif shape == "cubic":
        area = inside**3 * (1.0 - 0.5 * inside)
    else:
        area = 0.5 * (inside - math.sin(math.pi * inside) / math.pi)
    return area + max(x - 1.0, 0.0)


@dataclass(frozen=True)
class Transition:
    """Shape, dimension and value of TransitionDynamics; the value of a rate is the largest one."""

    shape: str
    dimension: str
    value: float

    @classmethod
    def read(cls, node: Node) -> Transition:
        """Return the dynamics that an element states."""
        shape = node.choice("dynamicsShape", SHAPES)
        if shape == "step":
            return cls(shape, "time", 0.0)
        return cls(shape, node.choice("dynamicsDimension", DIMENSIONS), abs(node.number("value")))

    def time(self, change: float, node: Node) -> float:
        """Return how long a change takes in dimensions time and rate [s]."""
        if self.shape == "step" or change == 0.0:
            return 0.0
        if self.dimension == "time":
            return self.value
        if self.value <= 0.0:
            raise node.error("value = 0: a rate must not be 0")
        return abs(change) * _PEAK[self.shape] / self.value


@dataclass(frozen=True)
class Ramp:
    """A speed that goes from one value to another in a closed form.

    Attributes
    ----------
    start : float
        When it begins [s].
    before, after : float
        Speeds [m/s].
    shape : str
    duration : float
        [s]
    """

    start: float
    before: float
    after: float
    shape: str
    duration: float

    def speed(self, time: float) -> float:
        """Return the speed at a time [m/s]."""
        if time >= self.start + self.duration:
            return self.after
        return self.before + (self.after - self.before) * share(self.shape, (time - self.start) / self.duration)

    def way(self, time: float) -> float:
        """Return the way since the start [m]."""
        since = time - self.start
        if self.duration <= 0.0:
            return self.after * since
        change = (self.after - self.before) * self.duration * covered(self.shape, since / self.duration)
        return self.before * since + change
