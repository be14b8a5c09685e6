"""Points of a rigid body that moves over ground, as a function of its pose and velocity, with derivatives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class BodyMotion(NamedTuple):
    """Pose and velocity of a body; also a change of it, and a gradient to it.

    Attributes
    ----------
    place : ndarray of float64, shape (3,)
        [m, world].
    yaw : ndarray of float64, shape ()
        About z [rad].
    velocity : ndarray of float64, shape (3,)
        [m/s, world].
    yaw_rate : ndarray of float64, shape ()
        [rad/s].
    """

    place: Array
    yaw: Array
    velocity: Array
    yaw_rate: Array


class Body:
    """A rigid body's points in the world, for :class:`PointModel`: each moves straight on during a frame.

    Parameters
    ----------
    points : array_like of float, shape (num_points, 3)
        In the body's frame [m].
    """

    def __init__(self, points: npt.ArrayLike) -> None:
        self.points = np.asarray(points, dtype=np.float64)

    def value(self, motion: BodyMotion) -> tuple[Array, Array]:
        """Return positions [m] and velocities [m/s] of the points, (num_points, 3) each, world.

        By definition of rigid motion.
        """
        arms = self._arms(motion)
        return motion.place + arms, motion.velocity + motion.yaw_rate * _across(arms)

    def forward(self, motion: BodyMotion, change: BodyMotion) -> tuple[Array, Array]:
        """Return how positions and velocities change, to first order."""
        arms = self._arms(motion)
        across = _across(arms)
        turned = change.yaw_rate * across - motion.yaw_rate * change.yaw * (arms * [1.0, 1.0, 0.0])
        return change.place + change.yaw * across, change.velocity + turned

    def reverse(self, motion: BodyMotion, position: Array, velocity: Array) -> BodyMotion:
        """Return the adjoint of :meth:`forward` for gradients to positions and velocities."""
        arms = self._arms(motion)
        across = _across(arms)
        yaw = np.sum(across * position) - motion.yaw_rate * np.sum((arms * [1.0, 1.0, 0.0]) * velocity)
        return BodyMotion(
            position.sum(axis=0), np.asarray(yaw), velocity.sum(axis=0), np.asarray(np.sum(across * velocity))
        )

    def _arms(self, motion: BodyMotion) -> Array:
        cosine, sine = np.cos(motion.yaw), np.sin(motion.yaw)
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(self.points @ turn.T)


def _across(arms: Array) -> Array:
    """Return z x arms."""
    return np.stack([-arms[:, 1], arms[:, 0], np.zeros(len(arms))], axis=1)
