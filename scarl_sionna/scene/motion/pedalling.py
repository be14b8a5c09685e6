"""How a cyclist's legs move.

Crank, pedal, foot, lower and upper leg as a planar five-bar linkage with the hip fixed on the saddle.

References
----------
.. [1] R. Redfield, M. L. Hull, "On the relation between joint moments and pedalling rates at constant power in
   bicycling", Journal of Biomechanics 19(4), 1986, pp. 317-329: the five-bar linkage (seat tube, crank, foot, lower and
   upper leg), whose motion follows from the crank's angle and the pedal's.
.. [2] F. Bolourchi, M. L. Hull, "Measurement of rider induced loads during simulated bicycling", International Journal
   of Sport Biomechanics 1, 1985, pp. 308-329: the pedal's angle over a turn, close to a sine of the crank's angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.core.pose import Pose

from .trajectory import Motion

Array = npt.NDArray[np.float64]

PEDALLING_SEGMENTS = (
    "cranks",
    "left_pedal",
    "left_foot",
    "left_lower_leg",
    "left_upper_leg",
    "right_pedal",
    "right_foot",
    "right_lower_leg",
    "right_upper_leg",
)
"""Rigid parts that pedalling moves. Frames: x forward, y left, z up; legs and feet as in `gait.SEGMENTS` (origin at the
hip, the knee, the ankle; a straight limb hangs along -z); cranks with their origin at the axle and the left crank along
x; pedals at their own axle."""

STRAIGHTEST = np.radians(5.0)
"""Smallest flexion of the knee over a turn [rad]: nearer to a straight leg, the knee's speed grows without bound."""
_Y = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class PedallingLegs:
    """Measures of a rider on a bicycle, both legs in planes y = constant.

    Attributes
    ----------
    axle : tuple of float
        x and z of the crank's axle in the actor's frame [m].
    crank : float
        Length of a crank [m].
    hip : tuple of float
        x and z of the hip joints [m].
    foot_y : float
        Distance of each leg's plane from the middle [m].
    upper_leg, lower_leg : float
        Hip to knee, knee to ankle [m].
    pedal_from_ankle : tuple of float
        x and z of the pedal's axle in the frame of the foot, which the pedal keeps level with [m].
    foot_pitch : float
        Mean angle by which the toes point down [rad].
    foot_swing, foot_lag : float
        Amplitude [rad] of the sine that is added to it, and its lag behind the crank's angle from the top [rad].

    Raises
    ------
    ParameterRangeError
        If the leg does not reach the pedal all around, or is straighter than 5 deg of knee flexion somewhere.
    """

    axle: tuple[float, float]
    crank: float
    hip: tuple[float, float]
    foot_y: float
    upper_leg: float
    lower_leg: float
    pedal_from_ankle: tuple[float, float]
    foot_pitch: float = 0.0
    foot_swing: float = 0.0
    foot_lag: float = 0.0

    def __post_init__(self) -> None:
        for name in ("crank", "upper_leg", "lower_leg"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ParameterRangeError(name, f"{value} m", "> 0 m")
        reach = [self._ankle(angle, 0.0)[0] - self.hip for angle in np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)]
        distance = np.linalg.norm(reach, axis=1)
        longest = np.sqrt(
            self.upper_leg**2 + self.lower_leg**2 + 2.0 * self.upper_leg * self.lower_leg * np.cos(STRAIGHTEST)
        )
        shortest = abs(self.upper_leg - self.lower_leg) + 0.01
        for value in (distance.max(), distance.min()):
            if not shortest <= value <= longest:
                raise ParameterRangeError(
                    "distance of hip and ankle over a turn of the crank",
                    f"{value:.3f} m",
                    f"{shortest:.3f} to {longest:.3f} m for these legs: move the hip, "
                    "or change the crank or the foot's angle",
                )

    def motions(self, angle: float, rate: float) -> dict[str, Motion]:
        """Return the motion of every part relative to the actor.

        Parameters
        ----------
        angle : float
            Of the cranks about their axle: 0 has the left one forward, a quarter turn down [rad].
        rate : float
            Its derivative [rad/s].

        Returns
        -------
        dict
            Pose of each part in the actor's frame and its velocity relative to that, by the names of
            `PEDALLING_SEGMENTS`.
        """
        axle = Motion(Pose(np.array([self.axle[0], 0.0, self.axle[1]])))
        cranks = axle.then(Motion.about(_Y, angle, rate))
        moved = {"cranks": cranks}
        for side, sign in (("left", 1.0), ("right", -1.0)):
            own = angle if sign > 0.0 else angle + np.pi
            pitch, turning = self._foot(own)
            along = Motion(Pose(np.array([sign * self.crank, sign * self.foot_y, 0.0])))
            level = Motion.about(_Y, pitch - angle, (turning - 1.0) * rate)
            pedal = cranks.then(along).then(level)
            offset = np.array([-self.pedal_from_ankle[0], 0.0, -self.pedal_from_ankle[1]])
            moved[f"{side}_pedal"] = pedal
            moved[f"{side}_foot"] = pedal.then(Motion(Pose(offset)))
            moved |= self._leg(side, sign, own, rate)
        return moved

    def _leg(self, side: str, sign: float, angle: float, rate: float) -> dict[str, Motion]:
        """Return upper and lower leg, from the hip: they end at the ankle."""
        ankle, speed = self._ankle(angle, rate)
        way = ankle - np.array(self.hip)
        first, second = self.upper_leg, self.lower_leg
        squared = float(way @ way)
        bend = np.arccos((squared - first**2 - second**2) / (2.0 * first * second))  # flexion of the knee
        # A limb turned by a about y points along (-sin a, -cos a): hip and knee solve w = L1 u(a) + L2 u(a + bend).
        inner = np.arctan2(second * np.sin(bend), first + second * np.cos(bend))
        thigh = np.arctan2(-way[0], -way[1]) - inner
        ends = np.stack([_slope(thigh) * first, _slope(thigh + bend) * second], axis=1)
        thigh_rate, shank_rate = np.linalg.solve(ends, speed)
        hip = Motion(Pose(np.array([self.hip[0], sign * self.foot_y, self.hip[1]])))
        upper = hip.then(Motion.about(_Y, thigh, thigh_rate))
        knee = Motion(Pose(np.array([0.0, 0.0, -first])))
        lower = upper.then(knee).then(Motion.about(_Y, bend, shank_rate - thigh_rate))
        return {f"{side}_upper_leg": upper, f"{side}_lower_leg": lower}

    def _foot(self, angle: float) -> tuple[float, float]:
        """Return the foot's pitch [rad], toes down positive, and its derivative by the angle of its own crank."""
        phase = angle + np.pi / 2.0 - self.foot_lag  # the angle from the top
        return self.foot_pitch + self.foot_swing * float(np.sin(phase)), self.foot_swing * float(np.cos(phase))

    def _ankle(self, angle: float, rate: float) -> tuple[Array, Array]:
        """Return x and z of the ankle [m] and their derivatives [m/s]; the angle is that of its own crank."""
        pitch, turning = self._foot(angle)
        c, s = np.cos(pitch), np.sin(pitch)
        x, z = self.pedal_from_ankle
        offset = np.array([c * x + s * z, c * z - s * x])
        swing = np.array([c * z - s * x, -c * x - s * z]) * turning
        pedal = np.array(self.axle) + self.crank * np.array([np.cos(angle), -np.sin(angle)])
        speed = self.crank * np.array([-np.sin(angle), -np.cos(angle)])
        return pedal - offset, (speed - swing) * rate


def _slope(angle: float) -> Array:
    """Return the derivative by the angle of where a limb of length 1 ends, x and z."""
    return np.array([-np.cos(angle), np.sin(angle)])


@dataclass(frozen=True)
class Cadence:
    """Turns of the crank for a way of the bicycle.

    Attributes
    ----------
    wheel_radius : float
        [m]
    gear : float
        Turns of the wheel for one of the crank.
    limit : float
        Fastest cadence [turns/s]: above, the rider changes up; inf for none.
    coast_above : float
        Speed above which the legs rest while the bicycle rolls [m/s]; they slow down over the last tenth. inf for
        never.
    """

    wheel_radius: float
    gear: float
    limit: float = np.inf
    coast_above: float = np.inf

    def __post_init__(self) -> None:
        for name in ("wheel_radius", "gear", "limit", "coast_above"):
            if not getattr(self, name) > 0.0:
                raise ParameterRangeError(name, getattr(self, name), "> 0")

    def rate(self, speed: float) -> float:
        """Return the angular rate of the cranks [rad/s] at a speed [m/s]; 0 backwards, where the hub runs free."""
        forward = min(max(speed, 0.0) / (self.gear * self.wheel_radius), 2.0 * np.pi * self.limit)
        if not np.isfinite(self.coast_above):
            return float(forward)
        share = float(np.clip((speed / self.coast_above - 0.9) / 0.1, 0.0, 1.0))
        return float(forward * (1.0 - share * share * (3.0 - 2.0 * share)))
