"""How a person walks: the kinematic model of Boulic, Magnenat-Thalmann and Thalmann.

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
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.errors import ParameterRangeError, UnknownNameError
from scarl_sionna.core.pose import Pose, Twist

from .steps import MIDSTANCE, FootPrint, Prints, foot_curves, foot_motion, hip_height, leg_motions
from .trajectory import Motion

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

FASTEST = 3.0
"""Largest speed over leg length [1/s] that the model was made for (2.6 m/s for 1.75 m)."""


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
    """Segments of a walking body as functions of the phase of its gait and its speed.

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
    stand still (`steps`).
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

    @property
    def fastest(self) -> float:
        """Largest speed that the model was made for [m/s]."""
        return float(FASTEST * self.lengths.leg)

    def relative_speed(self, speed: float) -> float:
        """Return the speed over the leg's length, the model's parameter RV [1/s].

        Raises
        ------
        ParameterRangeError
            If it is faster than people walk.
        """
        relative = speed / self.lengths.leg
        if not 0.0 <= relative <= FASTEST:
            raise ParameterRangeError(
                "walking speed", f"{speed:.2f} m/s", f"0 to {FASTEST * self.lengths.leg:.2f} m/s at this height"
            )
        return float(relative)

    def cadence(self, speed: float) -> float:
        """Return the cycles in a second: RV over the relative cycle length 1.346 sqrt(RV) [1/s]."""
        return float(np.sqrt(self.relative_speed(speed)) / 1.346)

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
        curves = {side: foot_curves(own, _support(relative), relative) for side, own in feet.items()}
        swings = {side: (curve, slope * cadence) for side, (curve, slope) in curves.items()}
        if change != 0.0:
            step = 1e-4
            low, high = max(relative - step, 0.0), min(relative + step, FASTEST)
            first, second = self._curves(phase % 1.0, low)[0], self._curves(phase % 1.0, high)[0]
            share = change / (high - low)
            rate = {name: slope + (second[name] - first[name]) * share for name, slope in rate.items()}
            for side, own in feet.items():
                before, after = (foot_curves(own, _support(value), value)[0] for value in (low, high))
                swings[side] = swings[side][0], swings[side][1] + (after - before) * share
        prints = self.steady_prints(phase, speed, acceleration) if prints is None else prints
        lengths = self.lengths
        soles = {side: foot_motion(prints[side], *swings[side], lengths.foot, lengths.leg) for side in SIDES}
        return self._chain(values, rate, soles, (relative, change))

    def steady_prints(self, phase: float, speed: float, acceleration: float = 0.0) -> Prints:
        """Return the prints of the feet, relative to the walker's frame, of a way straight ahead.

        Parameters are those of `motions`. While the speed changes, prints of a steady way cannot stay where they are:
        `articulation.Walk` has prints of the true way.
        """
        leg, cadence = self.lengths.leg, self.cadence(speed)
        length = 1.346 * math.sqrt(self.relative_speed(speed)) * leg
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
        """Return the angles [rad] and translations [m] at a phase, and their derivatives by the phase."""
        value: dict[str, float] = {}
        slope: dict[str, float] = {}
        leg = self.lengths.leg
        slow = min(relative, 0.5)  # appendix A and B: what grows up to RV = 0.5 and then stays

        def sine(name: str, scale: float, offset: float, amplitude: float, cycles: float, lag: float) -> None:
            angle = 2.0 * math.pi * (cycles * phase - lag)
            value[name] = scale * (offset + amplitude * math.sin(angle))
            slope[name] = scale * amplitude * 2.0 * math.pi * cycles * math.cos(angle)

        sway, surge = -0.128 * (slow - slow**2), -0.084 * (slow - slow**2)
        sine("lateral", leg, 0.0, sway, 1.0, 0.1)
        support = _support(relative)
        sine("forward", leg, 0.0, surge, 2.0, -2.0 * (0.625 - support))
        lean = 8.0 * (slow - slow**2)
        sine("lean", -RAD, -lean, lean, 2.0, 0.1)
        sine("pelvis_torsion", RAD, 0.0, 4.0 * relative, 1.0, -0.25)
        for name, shift in SIDES.items():
            swing = 9.88 * relative
            sine(f"{name}_shoulder", -RAD, 3.0 - swing / 2.0, -swing, 1.0, -0.25 - shift)
        value["pelvis_fall"], slope["pelvis_fall"] = _pelvis_fall(phase, 1.66 * relative * RAD)
        for name, points in _control_points(relative).items():
            curve = _Periodic(points)
            sides = {name: 0.0} if name == "thorax_torsion" else {f"{side}_{name}": SIDES[side] for side in SIDES}
            for angle_name, shift in sides.items():
                angle, change = curve.at((phase + shift) % 1.0)
                value[angle_name] = -RAD * angle
                slope[angle_name] = -RAD * change
        return value, slope


SIDES = {"left": 0.5, "right": 0.0}
"""Sides of the body, and by how much the phase of each is ahead of the gait's [cycles]."""
RAD = np.pi / 180.0
X, Y, Z = np.eye(3)
SOLE = np.array([[-0.25, 0.0, -0.25], [0.25, 0.0, -0.25], [0.8, 0.0, -0.25]])
"""Heel, ball and toe of a sole in the frame of a foot, in lengths of the foot."""


@lru_cache(maxsize=64)
def walking_gait(height: float, own: tuple[tuple[str, float], ...] = ()) -> WalkingGait:
    """Return the gait of a body's height and own lengths [m], one for all who are built alike."""
    return WalkingGait(height, own)


def _support(relative: float) -> float:
    """Return the relative duration of support at a relative speed [1/s]."""
    cycle = 1.346 / math.sqrt(max(relative, 1e-3))
    return (0.752 * cycle - 0.143) / cycle


def _softness(relative: float, change: float) -> tuple[float, float]:
    """Return below which difference hips go from one leg to the other, over the leg's length, and its derivative.

    People who stand, stand on straight legs.
    """
    return 0.001 + 0.008 * math.tanh(relative), 0.008 * change / math.cosh(relative) ** 2


def _pelvis_fall(phase: float, amplitude: float) -> tuple[float, float]:
    """Return the angle by which the pelvis falls to the side of the swinging leg, appendix B of [1], and its slope."""
    for start, stop, offset, sign in ((0.0, 0.15, -1, 1), (0.15, 0.5, -1, -1), (0.5, 0.65, 1, -1), (0.65, 1.0, 1, 1)):
        if phase < stop or stop == 1.0:
            width = 2.0 * (stop - start)
            angle = 2.0 * np.pi * (phase - start) / width
            return (
                amplitude * float(offset + sign * np.cos(angle)),
                -amplitude * sign * float(np.sin(angle)) * 2.0 * np.pi / width,
            )
    raise AssertionError("a phase lies within 0 to 1")


def _control_points(rv: float) -> dict[str, list[tuple[float, float]]]:
    """Return the control points (phase, angle [deg]) of appendices C and D of [1]; those of legs, see `steps`.

    A limb flexes forward by a negative turn about y.
    """
    slow, middle, fast = min(rv, 0.5), float(np.clip((rv - 0.5) / 0.8, 0.0, 1.0)), max(rv - 1.3, 0.0) / 1.7
    elbow = [
        (0.05, 3.0 + 6.0 * slow + 8.0 * middle - 6.0 * fast),
        (0.5 + 0.01 * middle + 0.04 * fast, 3.0 + 34.0 * slow + 24.0 * middle + 26.0 * fast),
        (0.9 - 0.1 * fast, 3.0 + 10.0 * slow + 9.0 * middle - 6.0 * fast),
    ]
    thorax = [(0.1, 4.0 / 3.0 * rv), (0.4, -1.5 * rv), (0.6, -4.0 / 3.0 * rv), (0.9, 1.5 * rv)]
    return {"elbow": elbow, "thorax_torsion": thorax}


class _Periodic:
    """Monotone cubic through control points that repeat every cycle, with its derivative, for one phase."""

    def __init__(self, points: list[tuple[float, float]]) -> None:
        self._points = sorted(points)
        first, last = self._points[0], self._points[-1]
        self._knots = [(last[0] - 1.0, last[1]), *self._points, (first[0] + 1.0, first[1])]

    def at(self, phase: float) -> tuple[float, float]:
        """Return value and slope at a phase [cycles]."""
        count, start = len(self._points), self._points[0][0]
        phase = start + (phase - start) % 1.0
        number = sum(knot[0] <= phase for knot in self._points) - 1  # of the last knot before
        (x0, y0), (x1, y1) = self._knots[number + 1], self._knots[number + 2]
        width = x1 - x0
        slope = (y1 - y0) / width
        d0, d1 = self._derivative(number % count), self._derivative((number + 1) % count)
        c, b = (3.0 * slope - 2.0 * d0 - d1) / width, (d0 + d1 - 2.0 * slope) / width**2
        step = phase - x0
        return y0 + step * (d0 + step * (c + step * b)), d0 + step * (2.0 * c + 3.0 * step * b)

    def _derivative(self, number: int) -> float:
        """Return the derivative at a knot by Fritsch and Butland.

        The weighted harmonic mean of the slopes on both sides.
        """
        (x0, y0), (x1, y1) = self._knots[number], self._knots[number + 1]
        x2, y2 = self._knots[number + 2]
        before, after = x1 - x0, x2 - x1
        first, second = (y1 - y0) / before, (y2 - y1) / after
        if first * second <= 0.0:
            return 0.0
        w1, w2 = 2.0 * after + before, after + 2.0 * before
        return (w1 + w2) / (w1 / first + w2 / second)
