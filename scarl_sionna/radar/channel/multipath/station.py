"""The ends of a radar link in a scene: a radar, and the points that its waves reach."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.mount import Mount
from scarl_sionna.core.specs.radar.spec import RadarSpec

if TYPE_CHECKING:
    from scarl_sionna.engine.world import WorldState

Array = npt.NDArray[np.float64]

_ASIDE = 0.05 / 3.0 * np.array([(2.0, -1.0, 2.0), (2.0, 2.0, -1.0), (-1.0, 2.0, 2.0)])
"""Points beside a monostatic radar [m], 5 cm away: five times the shortest segment that the engine keeps. They are
askew to the world's axes, along which most corners stand. They only help to find paths, whose lengths are those of the
radar itself."""
ASIDE_DISTANCE = float(np.linalg.norm(_ASIDE[0]))
"""Of these points from the radar [m]."""


@dataclass(frozen=True, eq=False)
class Station:
    """One end of a radar link: position [m], velocity [m/s], and axes as columns of `rotation`, all in the world.

    `arms`, shape (num_antennas, 3), are the antennas seen from `position` [m].
    """

    position: Array
    velocity: Array
    rotation: Array
    arms: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class EndPoints:
    """Points that legs from a station end at.

    Attributes
    ----------
    position, velocity : ndarray of float64, shape (num_targets, 3)
        [m], [m/s], world.
    rotation : ndarray of float64, shape (3, 3)
        Axes of the frame in which the polarisation at the points is given, as columns.
    is_station : bool
        Whether the points carry a radar's antennas, not point targets.
    """

    position: Array
    velocity: Array
    rotation: Array
    is_station: bool = False


def station_of(mount: Mount, radar: RadarSpec) -> Station:
    """Return a radar on its mount as the end of a link."""
    pose, arms = mount.pose, np.concatenate([radar.tx_array, radar.rx_array])
    return Station(pose.position, mount.twist.linear, pose.rotation, pose.rotate(arms))


def points_beside(state: WorldState, position: Array, twin: Literal["optical", "radio"]) -> Array:
    """Return points beside a radar that nothing hides from it, shape (num_points, 3), three at most [m, world].

    The way from a radar into a right-angled corner and back meets both faces in one point of the edge, where no ray
    tells whether they are there; to a point beside the radar it does.
    """
    hits = state.cast(position, _ASIDE / ASIDE_DISTANCE, max_distance=ASIDE_DISTANCE, twin=twin)
    return np.asarray(position + np.delete(_ASIDE, hits.ray, axis=0))
