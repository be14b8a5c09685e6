"""How running differs from walking: when somebody runs, cadence, support, and the flight of the body over the ground.

A short leg does what a long one does at a speed that is smaller by the root of their lengths (dynamic similarity [2]_),
so numbers here are those of a leg of `LEG`. In flight the body falls freely, on the ground it dips by half a sine, both
with one vertical speed where they meet: the mean force of the ground is the body's weight.

References
----------
.. [1] B. T. van Oeveren, C. J. de Ruiter, P. J. Beek, J. H. van Dieen, "Optimal stride frequencies in running at
   different speeds", PLOS ONE 12(10), e0184273, 2017: 77, 79 and 80 strides a minute at 2.4, 2.6 and 2.9 m/s, chosen by
   12 runners; their line is taken to all speeds.
.. [2] R. McN. Alexander, "Optimization and gaits in the locomotion of vertebrates", Physiological Reviews 69(4), 1989:
   people change from walking to running at a Froude number of about 0.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

GRAVITY, LEG = 9.81, 0.85
"""[m/s2]; length of an adult's leg [m]."""
FASTEST_RUN = 6.5
"""Largest speed of a leg of `LEG` [m/s]."""
_FROUDE = (0.48, 0.62)
"""v^2 / (g leg) up to which somebody walks, and from which on the gait is running alone."""
_STEPS = (77.0 / 60.0, 2.4, 3.0 / 60.0 / 0.5)
"""Strides in a second at a speed [m/s], and how many more there are for each m/s, by [1]_."""
_SUPPORT = (0.40, 0.035, 0.26)
"""Part of the cycle for which a foot is on the ground at 2.4 m/s, by how much less for each m/s more, and the least:
our own choice within what people do."""


def fastest_run(leg: float) -> float:
    """Return the largest speed of a leg's length [m] that the model takes [m/s]."""
    return FASTEST_RUN * math.sqrt(leg / LEG)


def changeover(leg: float, fastest_walk: float) -> tuple[float, float]:
    """Return the speed over the leg's length [1/s] from which on walking gives way to running, and where it ends.

    At a Froude number, or earlier where the model of walking ends (`fastest_walk` [1/s]).
    """
    first, last = (math.sqrt(number * GRAVITY / leg) for number in _FROUDE)
    share = min(fastest_walk / last, 1.0)
    return share * first, share * last


@dataclass(frozen=True)
class Run:
    """One speed of running.

    Attributes
    ----------
    cadence : float
        Cycles of two steps in a second [1/s].
    support : float
        Part of the cycle for which a foot is on the ground.
    """

    cadence: float
    support: float

    @classmethod
    def at(cls, speed: float, leg: float) -> Run:
        """Return the run at a speed [m/s] on legs of a length [m]."""
        scale = math.sqrt(LEG / leg)
        more = speed * scale - _STEPS[1]
        support = _SUPPORT[0] - _SUPPORT[1] * more
        soft = 0.01  # the least support is approached evenly
        support = _SUPPORT[2] + soft * math.log1p(math.exp((support - _SUPPORT[2]) / soft))
        return cls(scale * (_STEPS[0] + _STEPS[2] * more), min(support, 0.45))

    def hop(self, phase: float) -> tuple[float, float]:
        """Return how far the body is above where it is at the strike [m], and the derivative by the phase.

        Phase counts in cycles from any foot's strike.
        """
        phase, flight = phase % 0.5, 0.5 - self.support
        air, ground = flight / self.cadence, self.support / self.cadence
        if phase < self.support:
            dip = GRAVITY * air * ground / (2.0 * math.pi)
            angle = math.pi * phase / self.support
            return -dip * math.sin(angle), -dip * math.cos(angle) * math.pi / self.support
        share = (phase - self.support) / flight
        rise = 0.5 * GRAVITY * air**2
        return rise * share * (1.0 - share), rise * (1.0 - 2.0 * share) / flight
