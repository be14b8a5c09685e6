"""What a planner or a reader of recorded traffic returns: actors with their motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scenario.motion.bodies import ActorBody, BodyLike
from scarl_sionna.scenario.motion.tilt import Springs, on_springs
from scarl_sionna.scene.lanes import LaneNetwork
from scarl_sionna.scene.motion.trajectory import (
    Motion,
    Trajectory,
    WheelWay,
    body_from_road,
    forward_speeds,
    is_steady,
    lane_offsets,
    road_height,
    wheel_way,
)

Array = npt.NDArray[np.float64]
Ground = Callable[[Array], Array]
"""Returns the heights (N,) [m] of the ground at points (N, 2) [m], or (N, 3) where a source knows about what height
they are."""


@dataclass(frozen=True, eq=False)
class PlannedActor:
    """One actor of planned traffic.

    Attributes
    ----------
    name : str
    model : str
        Name of the actor model.
    variant : str or None
        Name of the model's variant; None: its first.
    trajectory : Trajectory
        Known for the whole duration.
    body : ActorBody
        Measures that it was planned with.
    phase : float
        Phase of the gait at the start, 0 to 1.
    active : (float, float)
        Times at which its middle is on the lanes [s]; before and after, it is on the straight continuation of a lane
        beyond the scene. Empty (start = stop) where it never is.
    deviation : float
        Of recorded motion: largest distance from the record [m], but for lane changes that the record makes in one
        step.
    num_lane_changes : int
        Of recorded motion: lane changes of the record that jumped and were drawn out.
    """

    name: str
    model: str
    variant: str | None
    trajectory: Trajectory
    body: ActorBody
    phase: float = 0.0
    active: tuple[float, float] = field(default=(-np.inf, np.inf))
    deviation: float = 0.0
    num_lane_changes: int = 0


DEPTH, BETWEEN = 500.0, 10.0
"""How far below the lanes traffic waits that is not on them, and how far below each other [m]."""


@dataclass(frozen=True, eq=False)
class PresentTrajectory:
    """A motion that takes place deep below the scene while the actor is not on the lanes.

    There is no road for it beyond their ends.

    Only the height jumps, and only where the actor comes and goes; velocities are those of the motion at all times, so
    that Doppler and wheels know nothing of it.

    Attributes
    ----------
    motion : Trajectory
    active : (float, float)
        Times at which it is where the motion says [s].
    depth : float
        How far below it is at other times [m].
    """

    motion: Trajectory
    active: tuple[float, float]
    depth: float = DEPTH

    @property
    def start(self) -> float:
        """First time at which the motion is known [s]."""
        return self.motion.start

    @property
    def stop(self) -> float:
        """Last time at which the motion is known [s]."""
        return self.motion.stop

    @property
    def is_steady(self) -> bool:
        """Whether the motion keeps its speed along the heading and its yaw rate."""
        return is_steady(self.motion)

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]."""
        pose = self.motion.pose(time)
        if self.is_present(time):
            return pose
        return Pose(pose.position - [0.0, 0.0, self.depth], pose.quaternion)

    def is_present(self, time: float) -> bool:
        """Return whether the actor is on the lanes at a time [s]; elsewhere it has no box among the labels."""
        return self.active[0] <= time <= self.active[1]

    def twist(self, time: float) -> Twist:
        """Return the velocity of the motion at a time [s]."""
        return self.motion.twist(time)

    def wheel_way(self, time: float, place: tuple[float, float]) -> WheelWay | None:
        """Return where a wheel of the motion points and how far it has rolled; None where the motion does not say."""
        return wheel_way(self.motion, time, place)

    def on_springs(self, springs: Springs) -> PresentTrajectory:
        """Return the same motion of a body that pitches and rolls."""
        return replace(self, motion=on_springs(self.motion, springs))

    def body_from_road(self, time: float) -> Motion | None:
        """Return how the frame on which the motion's wheels stand moves in the body's; None for one without springs."""
        return body_from_road(self.motion, time)

    def lane_offsets(self, times: Array) -> Array | None:
        """Return how far the motion is to the left of the lanes that it follows [m]; None where it follows none."""
        return lane_offsets(self.motion, times)

    def road_height(self, time: float, x: float) -> tuple[float, float] | None:
        """Return the height of the motion's road at x of the body over its origin [m], and its rate [m/s]."""
        return road_height(self.motion, time, x)

    def forward_speeds(self, times: Array) -> Array:
        """Return the speeds of the motion along its heading [m/s] at times (N,) [s]."""
        return forward_speeds(self.motion, times)


def lane_ground(network: LaneNetwork) -> Ground:
    """Return the ground of a network of lanes: the height of the nearest point of a centre line, these 0.25 m apart.

    Points with two coordinates get that of the lane nearest in plan; with three, a road under a bridge and the one on
    it are told apart.
    """
    if not network.lanes:
        raise ParameterRangeError("network", "no lanes", "one lane or more")
    points = np.concatenate(
        [lane.at(np.linspace(0.0, lane.length, max(int(4.0 * lane.length), 1) + 1)) for lane in network.lanes]
    )
    trees = {2: cKDTree(points[:, :2]), 3: cKDTree(points)}

    def ground(spots: Array) -> Array:
        wanted = np.atleast_2d(spots)
        return np.asarray(points[trees[wanted.shape[1]].query(wanted)[1], 2])

    return ground


@dataclass(frozen=True, eq=False)
class Conversion:
    """How traffic of another program becomes actors of a scene.

    Attributes
    ----------
    ground : LaneNetwork, callable or None
        Gives the heights: that of the nearest lane, or a function of points, (N, 3) where the record has heights, else
        (N, 2). None: the record's, 0 where it has none.
    types : mapping or None
        Actor models by the other program's type names; None, or a type that it lacks: the reader's own choice.
    models : mapping or None
        Bodies by model name; None, or a name that it lacks: the actor model of that name.
    offset : (float, float)
        Is added to the positions [m]: scene minus network.
    """

    ground: LaneNetwork | Ground | None = None
    types: Mapping[str, str] | None = None
    models: Mapping[str, BodyLike] | None = None
    offset: tuple[float, float] = (0.0, 0.0)

    def heights(self) -> Ground | None:
        """Return the function that gives the heights [m] at points; None where the record's own hold."""
        return lane_ground(self.ground) if isinstance(self.ground, LaneNetwork) else self.ground


def draw_variant(model: str, models: Mapping[str, BodyLike] | None, number: float) -> str | None:
    """Return one of a model's variants for a random number from 0 to 1; None where it has none."""
    source: object = models[model] if models and model in models else None
    if source is None:
        from scarl_sionna.scene.actors.model import read_actor_model

        source = read_actor_model(model)
    variants = sorted(getattr(source, "variants", ()))
    return variants[min(int(number * len(variants)), len(variants) - 1)] if variants else None
