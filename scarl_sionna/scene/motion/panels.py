"""Panels of time, by which rates are integrated from where a motion begins."""

from __future__ import annotations

import math
from collections.abc import Container

from scarl_sionna.core.errors import ParameterRangeError

from .trajectory import Trajectory

PANEL = 0.25
"""Length of a panel [s]."""
MOST_PANELS = 1_000_000
"""Panels, nearly three days, that are integrated at once; more would seem to hang."""


def origin_of(trajectory: Trajectory) -> float:
    """Return the time from which panels are counted [s]: the trajectory's start, or 0 where it has none."""
    return trajectory.start if math.isfinite(trajectory.start) else 0.0


def panels_to(time: float, origin: float, known: Container[int]) -> tuple[int, int, int]:
    """Return the panel of a time [s], the nearest known one on the way from it to the origin, and the step, 1 or -1.

    Raises
    ------
    ParameterRangeError
        If more than `MOST_PANELS` lie between them.
    """
    panel = math.floor((time - origin) / PANEL)
    step = 1 if panel >= 0 else -1
    nearest = panel
    while nearest not in known:
        nearest -= step
        if abs(panel - nearest) > MOST_PANELS:
            raise ParameterRangeError(
                "time",
                f"{time:.10g} s",
                f"within {MOST_PANELS * PANEL:g} s of {origin:.10g} s, where wheels and limbs of the motion begin",
                "give the trajectory a finite `start`",
            )
    return panel, nearest, step
