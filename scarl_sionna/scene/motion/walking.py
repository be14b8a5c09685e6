"""Trunk and arms of somebody who walks: the curves of Boulic, Magnenat-Thalmann and Thalmann.

References
----------
.. [1] R. Boulic, N. Magnenat-Thalmann, D. Thalmann, "A global human walking model with real-time kinematic
   personification", The Visual Computer 6, 1990, pp. 344-358: trajectories and their control points.
"""

from __future__ import annotations

import math

import numpy as np

SIDES = {"left": 0.5, "right": 0.0}
"""Sides of the body, and by how much the phase of each is ahead of the gait's [cycles]."""
RAD = np.pi / 180.0


def walking_support(relative: float) -> float:
    """Return the part of a cycle for which a foot is on the ground while somebody walks, at a relative speed [1/s]."""
    cycle = 1.346 / math.sqrt(max(relative, 1e-3))
    return (0.752 * cycle - 0.143) / cycle


def walking_curves(phase: float, relative: float, leg: float) -> tuple[dict[str, float], dict[str, float]]:
    """Return the angles [rad] and translations [m] of [1]_, and their derivatives by the phase."""
    value: dict[str, float] = {}
    slope: dict[str, float] = {}
    slow = min(relative, 0.5)  # appendix A and B: what grows up to RV = 0.5 and then stays

    def sine(name: str, scale: float, offset: float, amplitude: float, cycles: float, lag: float) -> None:
        angle = 2.0 * math.pi * (cycles * phase - lag)
        value[name] = scale * (offset + amplitude * math.sin(angle))
        slope[name] = scale * amplitude * 2.0 * math.pi * cycles * math.cos(angle)

    sway, surge = -0.128 * (slow - slow**2), -0.084 * (slow - slow**2)
    sine("lateral", leg, 0.0, sway, 1.0, 0.1)
    support = walking_support(relative)
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
