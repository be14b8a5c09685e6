"""How a person walks, by the kinematic model of Boulic, Magnenat-Thalmann and Thalmann, and runs.

References
----------
.. [1] R. Boulic, N. Magnenat-Thalmann, D. Thalmann, "A global human walking model with real-time kinematic
   personification", The Visual Computer 6, 1990, pp. 344-358: trajectories and their control points.
.. [2] V. C. Chen, *The Micro-Doppler Effect in Radar*, 2nd ed., Artech House, 2019, section 4.1: the same model for
   radar, and the segments' lengths as fractions of the body's height.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist

from .running import Run, changeover, fastest_run
from .steps import MIDSTANCE, FootPrint, Prints, foot_curves, foot_motion, hip_height, leg_motions
from .trajectory import Motion
from .walking import RAD, SIDES, walking_curves, walking_support

Array = npt.NDArray[np.float64]

SEGMENTS = (
    "head",
    "torso",
    "pelvis",
    "left_upper_arm",
    "left_lower_arm",
    "right_upper_arm",
    "right_lower_arm",
    "left_upper_leg",
    "left_lower_leg",
    "left_foot",
    "right_upper_leg",
    "right_lower_leg",
    "right_foot",
)
"""Rigid parts of a body. The frame of each has its origin at the joint nearer to the pelvis (head: neck; torso, pelvis:
lower end of the spine), x forward, y left, z up, in which a straight limb hangs along -z and a foot points along x."""

FASTEST_WALK = 3.0
"""Largest speed over leg length [1/s] that the model of walking was made for (2.6 m/s for 1.75 m)."""


@dataclass(frozen=True)
class BodyLengths:
    """Lengths of the segments of a body of some height [m].

    Those in `own`, (name, length) each, else Chen's fractions of the height. The sole lies a quarter of the `foot`
    below the ankle; `torso` goes from the hips to neck and shoulders.
    """

    height: float
    own: tuple[tuple[str, float], ...] = ()

    def __getattr__(self, name: str) -> float:
        """Return a length: head, half_shoulder, torso, half_hip, upper_leg, lower_leg, foot, upper_arm, lower_arm."""
        if name not in FRACTIONS:
            raise AttributeError(name)
        return dict(self.own).get(name, FRACTIONS[name] * self.height)

    @property
    def leg(self) -> float:
        """Hip to ankle, with the leg straight."""
        return float(self.upper_leg + self.lower_leg)


FRACTIONS = {
    "head": 0.130, "half_shoulder": 0.1295, "torso": 0.288, "half_hip": 0.0955, "upper_leg": 0.245, "lower_leg": 0.246,
    "foot": 0.143, "upper_arm": 0.188, "lower_arm": 0.152,
}  # fmt: skip # a table
"""Lengths over the height of the body, by [2]_."""


class WalkingGait:
    """Segments of a body that walks or runs as functions of the phase of its gait and its speed.

    Parameters
    ----------
    height : float
        Of the body, 0.5 to 2.5 m.
    own : tuple of (str, float)
        Lengths of segments that the body has of its own [m], 0.2 to 3 times those of `FRACTIONS`.

    Notes
    -----
    Phase 0 is the right heel's strike; one cycle is two steps. At rest all amplitudes are zero and the body stands. The
    curves are piecewise cubic (C1) in the phase, so velocities are continuous. Trunk and arms, step length, cadence and
    support are those of [1]_; its angles of hip, knee and ankle let a foot slide and hover, so legs follow feet that
    stand still (`steps`). Above the speeds at which people change over (`running`) somebody runs: cadence, support and
    the hips' height are then those of `running`, and of one step to the next there is a time without a foot on the
    ground. Between the two one passes into the other with the speed.
    """

    def __init__(self, height: float, own: tuple[tuple[str, float], ...] = ()) -> None:
        if not 0.5 <= height <= 2.5:
            raise ParameterRangeError("height", f"{height} m", "0.5 to 2.5 m")
        for name, length in own:
            if name not in FRACTIONS:
                raise UnknownNameError("length of a segment", name, FRACTIONS)
            usual = FRACTIONS[name] * height
            if not 0.2 * usual <= length <= 3.0 * usual:
                raise ParameterRangeError(
                    name, f"{length} m", f"{0.2 * usual:.3f} to {3.0 * usual:.3f} m at this height"
                )
        self.lengths = BodyLengths(height, own)
        self._changeover = changeover(self.lengths.leg, FASTEST_WALK)

    @property
    def fastest(self) -> float:
        """Largest speed that the model was made for [m/s]."""
        return fastest_run(self.lengths.leg)

    def relative_speed(self, speed: float) -> float:
        """Return the speed over the leg's length, the model's parameter RV [1/s].

        Raises
        ------
        ParameterRangeError
            If it is faster than people walk.
        """
        if not 0.0 <= speed <= self.fastest:
            raise ParameterRangeError(
                "speed on foot", f"{speed:.2f} m/s", f"0 to {self.fastest:.2f} m/s at this height"
            )
        return float(speed / self.lengths.leg)

    def run_share(self, relative: float) -> float:
        """Return how much of a gait is running, at a relative speed [1/s]: 0 for a walk, 1 for a run."""
        first, last = self._changeover
        x = min(max((relative - first) / (last - first), 0.0), 1.0)
        return x * x * (3.0 - 2.0 * x)

    def cadence(self, speed: float) -> float:
        """Return the cycles in a second: RV over the relative cycle length 1.346 sqrt(RV), or that of a run [1/s]."""
        relative = self.relative_speed(speed)
        walk, share = float(np.sqrt(relative) / 1.346), self.run_share(relative)
        if share == 0.0:
            return walk
        return (1.0 - share) * walk + share * Run.at(speed, self.lengths.leg).cadence

    def support(self, speed: float) -> float:
        """Return the part of a cycle for which a foot is on the ground at a speed [m/s]; below a half somebody runs."""
        return self._support_at(self.relative_speed(speed))

    def _support_at(self, relative: float) -> float:
        share = self.run_share(relative)
        if share == 0.0:
            return walking_support(relative)
        return (1.0 - share) * walking_support(relative) + share * self._run(relative).support

    def _run(self, relative: float) -> Run:
        return Run.at(relative * self.lengths.leg, self.lengths.leg)

    def midstance(self, relative: float) -> float:
        """Return the phase after its strike at which a foot's ankle is below the middle of the body [cycles]."""
        share = self.run_share(relative)
        if share == 0.0:
            return MIDSTANCE
        return (1.0 - share) * MIDSTANCE + share * _RUN_MIDSTANCE * self._run(relative).support

    def print_ahead(self, speed: float) -> float:
        """Return how far ahead of the middle a foot stands that struck `MIDSTANCE` of a cycle before [m]."""
        relative = self.relative_speed(speed)
        if self.run_share(relative) == 0.0:
            return 0.0
        return (self.midstance(relative) - MIDSTANCE) * speed / self.cadence(speed)

    def motions(
        self, phase: float, speed: float, acceleration: float = 0.0, prints: Prints | None = None
    ) -> dict[str, Motion]:
        """Return the motion of every segment relative to the walker's frame.

        Parameters
        ----------
        phase : float
            [cycles]
        speed : float
            Of the walker's frame along its x axis [m/s].
        acceleration : float
            [m/s2]
        prints : mapping of str to (FootPrint, FootPrint), optional
            Of the last and the next strike of the ``left`` and ``right`` foot; left out: those of a steady way straight
            ahead.

        Returns
        -------
        dict
            Pose of each segment in the walker's frame (on the ground below the pelvis, x forward, z up), and its
            velocity relative to that frame, in that frame's axes.
        """
        relative = self.relative_speed(speed)
        cadence, change = self.cadence(speed), acceleration / self.lengths.leg
        values, rates = self._curves(phase % 1.0, relative)
        rate = {name: slope * cadence for name, slope in rates.items()}
        feet = {side: (phase + shift) % 1.0 for side, shift in SIDES.items()}
        curves = {side: self._foot_curves(own, relative) for side, own in feet.items()}
        swings = {side: (curve, slope * cadence) for side, (curve, slope) in curves.items()}
        if change != 0.0:
            step = 1e-4
            low, high = max(relative - step, 0.0), min(relative + step, self.fastest / self.lengths.leg)
            first, second = self._curves(phase % 1.0, low)[0], self._curves(phase % 1.0, high)[0]
            share = change / (high - low)
            rate = {name: slope + (second[name] - first[name]) * share for name, slope in rate.items()}
            for side, own in feet.items():
                before, after = (self._foot_curves(own, value)[0] for value in (low, high))
                swings[side] = swings[side][0], swings[side][1] + (after - before) * share
        prints = self.steady_prints(phase, speed, acceleration) if prints is None else prints
        lengths = self.lengths
        soles = {side: foot_motion(prints[side], *swings[side], lengths.foot, lengths.leg) for side in SIDES}
        return self._chain(values, rate, soles, (relative, change))

    def _foot_curves(self, phase: float, relative: float) -> tuple[Array, Array]:
        return foot_curves(phase, self._support_at(relative), relative, self.run_share(relative))

    def steady_prints(self, phase: float, speed: float, acceleration: float = 0.0) -> Prints:
        """Return the prints of the feet, relative to the walker's frame, of a way straight ahead.

        Parameters are those of `motions`. While the speed changes, prints of a steady way cannot stay where they are:
        `articulation.Walk` has prints of the true way.
        """
        leg, cadence, relative = self.lengths.leg, self.cadence(speed), self.relative_speed(speed)
        if self.run_share(relative) > 0.0:
            return self._running_prints(phase, speed, acceleration)
        length = 1.346 * math.sqrt(relative) * leg
        stretch = 0.0 if acceleration == 0.0 else 0.5 * 1.346 / math.sqrt(max(speed / leg, 1e-9)) * acceleration
        prints = {}
        for side, shift in SIDES.items():
            ahead = [MIDSTANCE - (phase + shift) % 1.0 + step for step in (0.0, 1.0)]
            y = self.step_aside(side)
            prints[side] = tuple(
                FootPrint(np.array([x * length, y, 0.0]), np.array([x * stretch - cadence * length, 0.0, 0.0]))
                for x in ahead
            )
        return prints  # type: ignore[return-value]  # tuples of two

    def _running_prints(self, phase: float, speed: float, acceleration: float) -> Prints:
        """Return `steady_prints` of somebody who runs."""

        def place(pace: float, ahead: float) -> float:
            return (self.midstance(pace / self.lengths.leg) - ahead) * pace / self.cadence(pace)

        step = 1e-4
        slower, faster = speed - step, min(speed + step, self.fastest)
        prints = {}
        for side, shift in SIDES.items():
            y, pair = self.step_aside(side), []
            for number in (0.0, 1.0):
                ahead = (phase + shift) % 1.0 - number
                rate = -speed + (place(faster, ahead) - place(slower, ahead)) / (faster - slower) * acceleration
                pair.append(FootPrint(np.array([place(speed, ahead), y, 0.0]), np.array([rate, 0.0, 0.0])))
            prints[side] = (pair[0], pair[1])
        return prints

    @cached_property
    def _run_heights(self) -> CubicSpline:
        """Hips' height over the ground at the strike [m], by the relative speed: as high as legs reach their feet.

        Over all of a cycle, the body going up and down as it does (`Run.hop`).
        """
        lengths, found = self.lengths, []
        paces = np.linspace(self._changeover[0], self.fastest / lengths.leg, 10)
        for relative in paces.tolist():
            run, speed = self._run(relative), relative * lengths.leg
            least = math.inf
            for phase in np.linspace(0.0, 1.0, 40, endpoint=False).tolist():
                curve, slope = self._foot_curves(phase, relative)
                pair = self._running_prints(phase, speed, 0.0)["right"]
                x, _, z = foot_motion(pair, curve, slope, lengths.foot, lengths.leg).pose.position.tolist()
                rise = math.sqrt(max((_RUN_REACH * lengths.leg) ** 2 - x * x, (0.4 * lengths.leg) ** 2))
                least = min(least, z + rise - run.hop(phase)[0])
            found.append(least)
        return CubicSpline(paces, found)

    def step_aside(self, side: str) -> float:
        """Return how far to the left of the way a foot steps [m]: below its hip."""
        return float(self.lengths.half_hip) if side == "left" else -float(self.lengths.half_hip)

    def _chain(
        self, value: dict[str, float], rate: dict[str, float], feet: dict[str, Motion], pace: tuple[float, float]
    ) -> dict[str, Motion]:
        """Return the segments; `pace` is the relative speed [1/s] and its derivative [1/s2]."""
        lengths = self.lengths

        def turn(*names: tuple[str, Array]) -> Motion:
            motion = Motion()
            for name, axis in names:
                motion = motion.then(Motion.about(axis, value[name], rate[name]))
            return motion

        def at(offset: Sequence[float]) -> Motion:
            return Motion(Pose(np.array(offset)))

        below = Motion(
            Pose(np.array([value["forward"], value["lateral"], 0.0])),
            Twist(np.array([rate["forward"], rate["lateral"], 0.0])),
        )
        turned = turn(("pelvis_torsion", Z), ("pelvis_fall", X))
        offsets = {side: at([0.0, self.step_aside(side), 0.0]) for side in SIDES}
        hips = [(below.then(turned).then(offsets[side]), feet[side]) for side in SIDES]
        softness, stiffening = _softness(*pace)
        height, climb = hip_height(hips, lengths.leg, softness * lengths.leg)
        if stiffening:
            step = 1e-3
            higher, _ = hip_height(hips, lengths.leg, softness * (1.0 + step) * lengths.leg)
            climb += (higher - height) / (softness * step) * stiffening
        if value["run"] > 0.0:
            height, climb = _lowered((height, climb), value, rate, _SOFT * lengths.leg)
        root = Motion(
            Pose(np.array([value["forward"], value["lateral"], height])),
            Twist(np.array([rate["forward"], rate["lateral"], climb])),
        )
        pelvis = root.then(turned)
        torso = root.then(turn(("thorax_torsion", Z), ("lean", Y)))
        moved = {"pelvis": pelvis, "torso": torso, "head": torso.then(at([0.0, 0.0, lengths.torso]))}
        for side in SIDES:
            upper, lower = leg_motions(pelvis.then(offsets[side]), feet[side], lengths.upper_leg, lengths.lower_leg)
            sign = 1.0 if side == "left" else -1.0
            arm = torso.then(at([0.0, sign * lengths.half_shoulder, lengths.torso])).then(turn((f"{side}_shoulder", Y)))
            hand = arm.then(at([0.0, 0.0, -lengths.upper_arm])).then(turn((f"{side}_elbow", Y)))
            moved |= {
                f"{side}_upper_leg": upper,
                f"{side}_lower_leg": lower,
                f"{side}_foot": feet[side],
                f"{side}_upper_arm": arm,
                f"{side}_lower_arm": hand,
            }
        return moved

    def _curves(self, phase: float, relative: float) -> tuple[dict[str, float], dict[str, float]]:
        """Return the angles [rad] and translations [m] at a phase, and their derivatives by the phase.

        Also `run`, the share of running, and where there is some, `above`: the hips' height as runners have it [m].
        """
        share = self.run_share(relative)
        value, slope = walking_curves(phase, min(relative, self._changeover[1]), self.lengths.leg)
        value["run"], slope["run"] = share, 0.0
        if share > 0.0:
            for name, (offset, amplitude, cycles, lag) in _running_sines(self._run(relative)).items():
                angle = 2.0 * math.pi * (cycles * phase - lag)
                own = RAD * (offset + amplitude * math.sin(angle))
                own_slope = RAD * amplitude * 2.0 * math.pi * cycles * math.cos(angle)
                value[name] = (1.0 - share) * value[name] + share * own
                slope[name] = (1.0 - share) * slope[name] + share * own_slope
            hop, hop_slope = self._run(relative).hop(phase)
            value["above"], slope["above"] = float(self._run_heights(relative)) + hop, hop_slope
        return value, slope


_RUN_MIDSTANCE, _RUN_REACH, _SOFT = 0.31, 0.985, 0.004
"""Of a runner: when the ankle is below the middle, over the time on the ground; how far a leg reaches, over its length;
below which difference the hips' height passes from one bound to the other, over the leg's length."""
X, Y, Z = np.eye(3)
SOLE = np.array([[-0.25, 0.0, -0.25], [0.25, 0.0, -0.25], [0.8, 0.0, -0.25]])
"""Heel, ball and toe of a sole in the frame of a foot, in lengths of the foot."""


@lru_cache(maxsize=64)
def walking_gait(height: float, own: tuple[tuple[str, float], ...] = ()) -> WalkingGait:
    """Return the gait of a body's height and own lengths [m], one for all who are built alike."""
    return WalkingGait(height, own)


def _softness(relative: float, change: float) -> tuple[float, float]:
    """Return below which difference hips go from one leg to the other, over the leg's length, and its derivative.

    People who stand, stand on straight legs.
    """
    return 0.001 + 0.008 * math.tanh(relative), 0.008 * change / math.cosh(relative) ** 2


def _running_sines(run: Run) -> dict[str, tuple[float, float, float, float]]:
    """Return trunk and arms of somebody who runs: mean and amplitude [deg], cycles and lag of a sine of the phase.

    Elbows are bent by a right angle. Our own choice within what people do.
    """
    swing = 60.0 * (1.0 - 1.2 * run.support)
    found = {"lean": (7.0, 1.5, 2.0, 0.1), "pelvis_torsion": (0.0, 9.0, 1.0, -0.25)}
    found |= {"thorax_torsion": (0.0, -9.0, 1.0, -0.25)}
    for side, shift in SIDES.items():
        found[f"{side}_shoulder"] = (16.0, swing, 1.0, -0.25 - shift)
        found[f"{side}_elbow"] = (-92.0, 12.0, 1.0, -0.25 - shift)
    return found


def _lowered(
    ridden: tuple[float, float], value: dict[str, float], rate: dict[str, float], soft: float
) -> tuple[float, float]:
    """Return height and climb of the hips [m, m/s] of somebody who runs.

    As high as runners are, no higher than the legs reach (`ridden`, of somebody who walks), which takes over gradually.
    """
    over = (ridden[0] - value["above"]) / soft
    share = 1.0 / (1.0 + math.exp(min(over, 700.0)))  # of the bound by the legs
    lowest = min(ridden[0], value["above"])
    height = lowest - soft * math.log1p(math.exp(-abs(over)))
    climb = share * ridden[1] + (1.0 - share) * rate["above"]
    run = value["run"]
    return (
        (1.0 - run) * ridden[0] + run * height,
        (1.0 - run) * ridden[1] + run * climb + rate["run"] * (height - ridden[0]),
    )
