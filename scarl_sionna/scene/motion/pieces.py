"""Motions of one body one after the other."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import TimeRangeError
from scarl_sionna.core.pose import Pose, Twist

from .trajectory import Trajectory

Array = npt.NDArray[np.float64]


class Piece(Trajectory, Protocol):
    """A trajectory that can answer for many times at once."""

    def forward_speeds(self, times: Array) -> Array:
        """Return the speeds along the heading [m/s] at times (N,) [s]."""


PieceT = TypeVar("PieceT", bound=Piece)


class InPieces(Generic[PieceT]):
    """Motions of one body, each from the time on at which the one before ends, where that leaves it."""

    pieces: tuple[PieceT, ...]

    @property
    def start(self) -> float:
        """First time at which it is known [s]."""
        return self.pieces[0].start

    @property
    def stop(self) -> float:
        """Last time at which it is known [s]."""
        return self.pieces[-1].stop

    @property
    def _body(self) -> str:
        """Name of the body, for errors."""
        raise NotImplementedError

    def _index(self, time: float) -> int:
        if not self.start <= time <= self.stop:
            raise TimeRangeError(time, self.start, self.stop, f"'{self._body}'")
        return sum(time >= piece.start for piece in self.pieces[1:])

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]."""
        return self.pieces[self._index(time)].pose(time)

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]."""
        return self.pieces[self._index(time)].twist(time)

    def forward_speeds(self, times: Array) -> Array:
        """Return the speeds along the heading [m/s] at times (N,) [s], negative in reverse."""
        return np.array([self.pieces[self._index(time)].forward_speeds(np.array([time]))[0] for time in times.tolist()])
