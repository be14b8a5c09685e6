"""What the signal of paths depends on, and what of it becomes the delay, with derivatives and their adjoint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.synthesis.phase import delay_terms

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


class Columns(NamedTuple):
    """What the signal depends on: of one pair (num_paths,), or of all (num_tx, num_rx, num_paths).

    Attributes
    ----------
    amplitude : ndarray of complex128
        Of the beat signal at the frame's start [sqrt(W)].
    length, rate, acceleration : ndarray of float64
        Of a path at the frame's start [m], [m/s], [m/s2].
    growth : ndarray of float64
        Change of the strength over that at the frame's start [1/s].
    """

    amplitude: Complex
    length: Array
    rate: Array
    acceleration: Array
    growth: Array


class Delays(NamedTuple):
    """Delay [s], its rate and its acceleration [1/s] at the frame's start; also changes of them, and gradients."""

    delay: Array
    rate: Array
    acceleration: Array


def delays(columns: Columns) -> Delays:
    """Return the delays of paths, by :func:`~scarl_sionna.radar.synthesis.phase.delay_terms`."""
    return Delays(*delay_terms(columns.length, columns.rate, columns.acceleration))


def delays_forward(columns: Columns, change: Columns) -> Delays:
    """Return how the delays change with the columns, to first order."""
    speed, half = SPEED_OF_LIGHT + 0.5 * columns.rate, 0.5 * change.rate
    return Delays._make((own - kept * half) / speed for own, kept in zip(change[1:4], delays(columns), strict=True))


def delays_reverse(columns: Columns, gradient: Delays) -> tuple[Array, Array, Array]:
    """Return the adjoint of :func:`delays_forward`: gradients to length, rate and acceleration."""
    speed = SPEED_OF_LIGHT + 0.5 * columns.rate
    length, rate, acceleration = (part / speed for part in gradient)
    kept = delays(columns)
    own = rate - 0.5 * (kept.delay * length + kept.rate * rate + kept.acceleration * acceleration)
    return length, own, acceleration
