"""A Gymnasium environment: the ego's action in, what its sensors see out. Needs the extra ``gymnasium``."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field

from scarl_sionna.core.errors import MissingPackageError, ParameterRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.core.results import Frame, ImageFrame, RadarFrame
from scarl_sionna.core.spec import Spec
from scarl_sionna.core.units import Degrees, Metres, MetresPerSecond2, Seconds
from scarl_sionna.fusion.rig import Rig
from scarl_sionna.signal.processing import range_doppler, virtual_cube

from .motion import ActorPose
from .session import Session
from .settings import SessionSettings

try:
    import gymnasium
    from gymnasium import spaces
except ModuleNotFoundError as error:
    raise MissingPackageError("gymnasium", "gymnasium") from error

if TYPE_CHECKING:
    from scarl_sionna.engine.world import World

Array = npt.NDArray[np.float64]
Observation = dict[str, npt.NDArray[Any]]
Others = Callable[[float], Mapping[str, Pose | ActorPose]]
"""Returns who else is there at a time [s]; see `Session.step`."""
Judge = Callable[[Frame, "EgoState"], tuple[float, bool]]
"""Returns the reward of a step and whether the episode has ended."""
DARKEST = 1e-30
"""Power of a cell of a map that shows as -270 dBm [W]: below any noise."""


@dataclass(frozen=True)
class EgoState:
    """Ego vehicle on level ground: position [m, world], heading and its rate [rad, rad/s], speed [m/s].

    `slip` is the angle of the velocity to the heading [rad], `way` what was driven in the last step [m].
    """

    position: tuple[float, float, float]
    heading: float
    speed: float
    rate: float = 0.0
    slip: float = 0.0
    way: float = 0.0

    def driven(self, acceleration: float, steering: float, wheelbase: float, seconds: float) -> EgoState:
        """Return the state after a time [s] of constant acceleration [m/s^2] and steering angle [rad].

        Notes
        -----
        Kinematic bicycle about the middle between the axles, a `wheelbase` [m] apart [1]_; the way of the step is an
        arc of a circle. Braking ends at rest. Not modelled: slip of the tyres, roll and pitch.

        References
        ----------
        .. [1] R. Rajamani, *Vehicle Dynamics and Control*, 2nd ed., 2012, section 2.2.
        """
        speed = max(self.speed + acceleration * seconds, 0.0)
        moving = seconds if speed > 0.0 or acceleration >= 0.0 else self.speed / -acceleration
        way = 0.5 * (self.speed + speed) * moving
        slip = math.atan(0.5 * math.tan(steering))
        bend = math.cos(slip) * math.tan(steering) / wheelbase
        turn = bend * way
        chord = way * float(np.sinc(turn / (2.0 * np.pi)))  # sin(turn / 2) / (turn / 2)
        course = self.heading + slip + 0.5 * turn
        x, y, z = self.position
        place = (x + chord * math.cos(course), y + chord * math.sin(course), z)
        return EgoState(place, self.heading + turn, speed, bend * speed, slip, way)

    @property
    def actor_pose(self) -> ActorPose:
        """Pose and velocity for a session."""
        course = self.heading + self.slip
        linear = np.array([self.speed * math.cos(course), self.speed * math.sin(course), 0.0])
        return ActorPose(
            Pose.from_heading(np.array(self.position), self.heading), Twist(linear, np.array([0.0, 0.0, self.rate]))
        )


class DrivingSettings(Spec):
    """What an action does, its numbers of -1 to 1 scaled by the largest ones, and how long an episode is."""

    wheelbase: Metres = Field(2.7, gt=0.0, description="distance of the axles [m]")
    acceleration: MetresPerSecond2 = Field(4.0, gt=0.0, description="of gas and brake [m/s2]")
    steering_deg: Degrees = Field(30.0, gt=0.0, lt=90.0, description="angle of the front wheels [deg]")
    step: Seconds = Field(0.05, gt=0.0, description="time of a step [s]")
    num_steps: int = Field(200, ge=1, description="steps after which an episode is truncated")


def way_made(frame: Frame, ego: EgoState) -> tuple[float, bool]:
    """Return the way of the step [m] as reward; no episode ends early."""
    return ego.way, False


class DrivingEnv(gymnasium.Env[Observation, Array]):
    """Drives the ego vehicle of a scene; observations are the maps of its radars and the images of its cameras.

    Parameters
    ----------
    world : World, str or Path
        With an ego vehicle, which starts where the scene has it at `SessionSettings.start`, with its speed.
    rig : Rig
        Of radars and cameras with RGB images.
    settings : SessionSettings, optional
        Between its looks a sensor shows what it saw last.
    driving : DrivingSettings, optional
    others : callable, optional
        Who else is there, by time; default: nobody.
    judge : callable, optional
        Reward and end; default: the way driven [m], and no end.

    Attributes
    ----------
    action_space
        Acceleration and steering angle (left is positive) over their largest values, each -1 to 1.
    observation_space
        For each radar the power of its range-Doppler map, mean over the channels, float32 of shape (num_doppler_bins,
        num_range_bins) [dBm]; for each camera uint8 of shape (height, width, 3); and ``"ego"``: speed [m/s] and yaw
        rate [rad/s].
    frame : Frame
        Of the last step: raw data of the sensors that looked, and the truth about all objects.

    Raises
    ------
    ParameterRangeError
        If a sensor gives neither.
    PlacementError
        If the world has no ego vehicle.
    """

    metadata = {"render_modes": []}  # noqa: RUF012  # as Gymnasium has it

    def __init__(
        self,
        world: World | str | Path,
        rig: Rig,
        settings: SessionSettings | None = None,
        *,
        driving: DrivingSettings | None = None,
        others: Others | None = None,
        judge: Judge = way_made,
    ) -> None:
        from scarl_sionna.engine.load import load_scene

        self.driving = driving or DrivingSettings()
        loaded = load_scene(world) if isinstance(world, str | Path) else world
        self.session = Session(loaded, rig, settings)
        self._others, self._judge = others, judge
        self._ego, self._start = str(self.session.vehicle), _started(loaded, self.session)
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float64)
        self._state, self._count = self._start, 0
        self._seen: Observation = {}
        looked = _observed(self._step_session())
        shapes: dict[str, spaces.Space[Any]] = {}
        for name in rig.names:
            if name not in looked:
                kind = rig[name].kind
                raise ParameterRangeError("rig", f"'{name}', a {kind}", "radars and cameras with images=('rgb',)")
            first = looked[name]
            low, high = (0, 255) if first.dtype == np.uint8 else (-270.0, 100.0)
            shapes[name] = spaces.Box(low, high, first.shape, first.dtype.type)
        shapes["ego"] = spaces.Box(np.array([0.0, -10.0], np.float32), np.array([200.0, 10.0], np.float32))
        self.observation_space = spaces.Dict(shapes)  # type: ignore[assignment]  # values of several kinds

    @property
    def ego(self) -> EgoState:
        """The ego vehicle now."""
        return self._state

    def _step_session(self) -> Frame:
        time = self.session.settings.start + self._count * self.driving.step
        poses = dict(self._others(time)) if self._others else {}
        self.frame = self.session.step(time, {**poses, self._ego: self._state.actor_pose})
        return self.frame

    def _observation(self, frame: Frame) -> Observation:
        self._seen = {**self._seen, **_observed(frame)}
        own = np.array([self._state.speed, np.clip(self._state.rate, -10.0, 10.0)], np.float32)
        return {**{name: held.copy() for name, held in self._seen.items()}, "ego": own}

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; returns the first observation, and its time [s] under ``"time"``."""
        super().reset(seed=seed)
        self.session.restart(int(self.np_random.integers(2**31)))
        self._state, self._count, self._seen = self._start, 0, {}
        frame = self._step_session()
        return self._observation(frame), {"time": self.session.time}

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for one step; returns observation, reward, terminated, truncated, and the time [s] under ``"time"``.

        Raises
        ------
        ParameterRangeError
            If the action is not two numbers from -1 to 1.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != (2,) or not (np.abs(given) <= 1.0).all():
            raise ParameterRangeError("action", given.tolist(), "acceleration and steering, each -1 to 1")
        own, steering = self.driving, math.radians(self.driving.steering_deg)
        self._state = self._state.driven(
            own.acceleration * float(given[0]), steering * float(given[1]), own.wheelbase, own.step
        )
        self._count += 1
        frame = self._step_session()
        reward, ended = self._judge(frame, self._state)
        return (
            self._observation(frame),
            float(reward),
            bool(ended),
            self._count >= self.driving.num_steps,
            {"time": self.session.time},
        )

    def close(self) -> None:
        """Let go of the scene."""
        self.session.close()


def _started(world: World, session: Session) -> EgoState:
    """Return where the scene has its ego vehicle when the session begins."""
    motion = world.actor(str(session.vehicle)).trajectory
    pose, twist = motion.pose(session.settings.start), motion.twist(session.settings.start)
    x, y, z = pose.position.tolist()
    return EgoState((x, y, z), pose.yaw, float(np.linalg.norm(twist.linear)), float(twist.angular[2]))


def _observed(frame: Frame) -> Observation:
    """Return what an observation shows of the sensors that looked."""
    found: Observation = {}
    for name, result in frame.results.items():
        if isinstance(result, RadarFrame):
            power = range_doppler(virtual_cube(result.adc, result.spec), result.spec).power
            found[name] = (10.0 * np.log10(np.maximum(power, DARKEST)) + 30.0).astype(np.float32)
        elif isinstance(result, ImageFrame) and result.rgb is not None:
            found[name] = result.rgb
    return found
