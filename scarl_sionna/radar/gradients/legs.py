"""Distances between antennas and end points of paths, over a frame, with derivatives and their adjoint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class Distance(NamedTuple):
    """Distances [m] with their first two derivatives in time, (num_antennas, num_paths) each; also gradients to them.

    Attributes
    ----------
    value, rate, acceleration : ndarray of float64
        [m], [m/s], [m/s2].
    """

    value: Array
    rate: Array
    acceleration: Array


class Motion(NamedTuple):
    """What the distances of one end depend on; also changes of it, and gradients.

    Attributes
    ----------
    point, velocity : ndarray of float64, shape (num_paths, 3)
        [m], [m/s], world; relative to the radar the second.
    origin : ndarray of float64, shape (3,)
        Of the radar [m, world].
    array : ndarray of float64, shape (num_antennas, 3)
        [m, radar frame].
    """

    point: Array
    velocity: Array
    origin: Array
    array: Array


@dataclass(frozen=True, eq=False)
class Kept:
    """How much of its motion each path has, shape (num_paths,).

    Attributes
    ----------
    moves : ndarray of bool
        Whether its end points' velocities are known.
    bends : ndarray of bool
        Whether it moves exactly; else to first order about the frame's start, and its strength stays.
    """

    moves: Mask
    bends: Mask


class Leg:
    """Distances at one time, in the radar's middle of a frame, of paths that are kept to first order at its start.

    Parameters
    ----------
    motion : Motion
    turn : ndarray of float64, shape (3, 3)
        world_from_radar at the frame's start.
    spin : ndarray of float64, shape (3,)
        Of the radar [rad/s].
    kept : Kept
    time : float
        After the frame's start [s].
    """

    def __init__(self, motion: Motion, turn: Array, spin: Array, kept: Kept, time: float) -> None:
        cross = np.cross(spin, np.eye(3)).T  # cross @ a = spin x a
        later = Rotation.from_rotvec(time * spin).as_matrix() @ turn
        self._kept, self.time = kept, np.where(kept.bends, time, 0.0)
        self._turns = [np.where(kept.bends[:, None, None], power @ later, power @ turn) for power in (np.eye(3), cross)]
        self._turns.append(kept.bends[:, None, None] * (cross @ cross @ later))
        place, speed, pull = self._arms(motion.array)
        offset = motion.point - motion.origin + self.time[:, None] * motion.velocity
        self._ahead = offset - place
        self._velocity = kept.moves[:, None] * (motion.velocity - speed)
        self._pull = pull
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.linalg.norm(self._ahead, axis=2)
            rate = _dot(self._ahead, self._velocity) / value
            bend = (_dot(self._velocity, self._velocity) - _dot(self._ahead, pull) - rate**2) / value
        self.distance = Distance(value, rate, kept.bends * bend)

    def _arms(self, array: Array) -> tuple[Array, Array, Array]:
        """Return places, velocities and accelerations of antennas about the origin, (num_antennas, num_paths, 3)."""
        place, speed, pull = (np.einsum("pij,aj->api", turn, array) for turn in self._turns)
        return place, speed, pull

    def forward(self, change: Motion) -> Distance:
        """Return how the distances change, to first order."""
        place, speed, pull = self._arms(change.array)
        ahead = change.point - change.origin + self.time[:, None] * change.velocity - place
        velocity = self._kept.moves[:, None] * (change.velocity - speed)
        value, rate, bend = self.distance
        own = _dot(self._ahead, ahead) / value
        turned = (_dot(ahead, self._velocity) + _dot(self._ahead, velocity) - rate * own) / value
        curved = 2.0 * _dot(self._velocity, velocity) - _dot(ahead, self._pull) - _dot(self._ahead, pull)
        curved = (curved - 2.0 * rate * turned - bend * own) / value
        return Distance(own, turned, self._kept.bends * curved)

    def reverse(self, gradient: Distance) -> Motion:
        """Return the adjoint of :meth:`forward`."""
        value, rate, bend = self.distance
        second = self._kept.bends * gradient.acceleration / value
        first = (gradient.rate - 2.0 * rate * second) / value
        own = ((gradient.value - rate * first - bend * second) / value)[..., None]
        first, second = first[..., None], second[..., None]
        ahead = own * self._ahead + first * self._velocity - second * self._pull
        velocity = self._kept.moves[:, None] * (first * self._ahead + 2.0 * second * self._velocity)
        arms = (ahead, velocity, second * self._ahead)
        array = -sum(np.einsum("pij,api->aj", turn, part) for turn, part in zip(self._turns, arms, strict=True))
        point = ahead.sum(axis=0)
        return Motion(point, self.time[:, None] * point + velocity.sum(axis=0), -point.sum(axis=0), np.asarray(array))

    def at_start(self, distance: Distance) -> Distance:
        """Return the parabola in time of distances, or of changes of them, by its terms at the frame's start."""
        time, (value, rate, bend) = self.time, distance
        return Distance(value - time * (rate - 0.5 * time * bend), rate - time * bend, bend)

    def from_start(self, gradient: Distance) -> Distance:
        """Return the adjoint of :meth:`at_start`."""
        time, (value, rate, bend) = self.time, gradient
        return Distance(value, rate - time * value, bend - time * (rate - 0.5 * time * value))


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", one, other))
