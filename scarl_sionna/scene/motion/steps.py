"""How a walker's legs follow the feet: the foot on the ground stands still, hips ride on the legs.

A foot rolls over three supports: heel at the strike, the whole sole, toe until it leaves the ground. Each is a point of
the sole that rests in the world, so that nothing slides. Between two footprints the foot swings; thigh and shank are
solved for where the ankle is (two-link inverse kinematics), and hips sink as far as the legs need.

Amplitudes and times of the foot's roll are our own choice within what people do; they are not of a publication.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.pose import Pose, Twist

from .trajectory import Motion

Array = npt.NDArray[np.float64]

MIDSTANCE = 0.2
"""Phase after its strike at which a foot's ankle is below the middle of the body [cycles]."""
REACH = 0.9985
"""Largest distance of hip and ankle over the leg's length that the hips' height is made for."""
_EDGE = 12
"""A foot that goes up does so early, and one that goes down late, so that it clears the edge between: by this power of
the way that is left, or done."""
_KICK = 0.30 / 0.035
"""Largest lift of a runner's foot over that of a walker's."""
_JERK = 0.06
"""Part of the swing in which a runner's foot gets its speed, and in which it loses it."""
_HEEL, _TOE = (-0.25, -0.25), (0.8, -0.25)
"""x and z of the ends of the sole in the frame of a foot, in its length."""
_X, _Y, _ = np.eye(3)


@dataclass(frozen=True)
class FootPrint:
    """Where an ankle is above a flat foot, relative to the walker's frame: two prints hold a foot's way.

    Attributes
    ----------
    position : ndarray of float64, shape (3,)
        On the ground below the ankle [m].
    velocity : ndarray of float64, shape (3,)
        Its derivative, in the walker's axes [m/s]: a print rests in the world while the walker moves.
    yaw, yaw_rate : float
        Where the toes point [rad], and its derivative [rad/s].
    pitch : float
        By how much the toes point down, on a slope [rad].
    """

    position: Array
    velocity: Array
    yaw: float = 0.0
    yaw_rate: float = 0.0
    pitch: float = 0.0


Prints = Mapping[str, tuple[FootPrint, FootPrint]]
"""By side, the print of the last strike and the next one."""


def foot_curves(phase: float, support: float, relative: float, run: float = 0.0) -> tuple[Array, Array]:
    """Return how a foot rolls and swings, and the derivative by the phase.

    Parameters
    ----------
    phase : float
        Since the foot's strike, 0 to 1 [cycles].
    support : float
        Part of the cycle for which the foot is on the ground.
    relative : float
        Speed over the length of the leg [1/s].
    run : float
        0 for somebody who walks, 1 for who runs: the foot rolls more over the toe and less over the heel, and swings
        with the heel high.

    Returns
    -------
    tuple of ndarray of float64, shape (4,)
        Roll over the toe and roll over the heel [rad], way to the next print (0 to 1) and lift over the leg's length.
    """
    swing, size = 1.0 - support, math.tanh(relative)
    rise = (0.52 - 0.17 * run) * support
    peak, level = support + (0.08 + 0.04 * run) * swing, support + (0.6 + 0.25 * run) * swing
    toe = _hill(phase, rise, peak, level)
    heel = _hill(phase, 1.0 - 0.4 * swing, 1.0, 1.0 + 0.17 * support)
    if phase < 0.5 * support:
        heel = _hill(phase + 1.0, 1.0 - 0.4 * swing, 1.0, 1.0 + 0.17 * support)
    u = min(max((phase - support) / swing, 0.0), 1.0)
    way = _smooth(u)
    lift = 16.0 * (u * (1.0 - u)) ** 2, 32.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / swing
    scale = np.array([math.radians(60.0 + 20.0 * run) * size, math.radians(20.0 - 8.0 * run) * size, 1.0, 0.035 * size])
    if run > 0.0:  # highest before the middle of the swing, and the more so the faster
        skew, more, hard = 1.5 - u, _KICK * math.tanh(relative / 5.0), _jerked(u)
        kick = more * lift[0] * skew, more * (lift[1] * skew - lift[0] / swing)
        lift = (1.0 - run) * lift[0] + run * kick[0], (1.0 - run) * lift[1] + run * kick[1]
        way = (1.0 - 0.5 * run) * way[0] + 0.5 * run * hard[0], (1.0 - 0.5 * run) * way[1] + 0.5 * run * hard[1]
    values = np.array([toe[0], heel[0], way[0], lift[0]])
    slopes = np.array([toe[1], heel[1], way[1] / swing, lift[1]])
    return values * scale, slopes * scale


def _smooth(x: float) -> tuple[float, float]:
    """Return the cubic step from 0 to 1, and its slope."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x)


def _jerked(x: float) -> tuple[float, float]:
    """Return a step from 0 to 1 at an even speed but for a start and an end of `_JERK` each, and its slope."""
    if x > 0.5:
        value, slope = _jerked(1.0 - x)
        return 1.0 - value, slope
    top = 1.0 / (1.0 - _JERK)
    return (0.5 * top * x * x / _JERK, top * x / _JERK) if x < _JERK else (top * (x - 0.5 * _JERK), top)


def _hill(x: float, start: float, top: float, stop: float) -> tuple[float, float]:
    """Return a rise from 0 to 1 and a fall back to 0 by cubic steps, and the slope."""
    if x < top:
        value, slope = _smooth((x - start) / (top - start))
        return value, slope / (top - start)
    value, slope = _smooth((stop - x) / (stop - top))
    return value, -slope / (stop - top)


def foot_motion(prints: tuple[FootPrint, FootPrint], curve: Array, rate: Array, foot: float, leg: float) -> Motion:
    """Return the motion of a foot, whose origin is the ankle, in the walker's frame.

    Parameters
    ----------
    prints : tuple of FootPrint
        Of the last strike and the next.
    curve, rate : ndarray of float64, shape (4,)
        Of `foot_curves`, and the derivative by the time.
    foot, leg : float
        Lengths [m].
    """
    last, following = prints
    way, ahead = curve[2], following.position - last.position
    turn = math.remainder(following.yaw - last.yaw, 2.0 * math.pi)
    position = last.position + way * ahead
    velocity = last.velocity + way * (following.velocity - last.velocity) + rate[2] * ahead
    yaw_rate = last.yaw_rate + way * (following.yaw_rate - last.yaw_rate) + rate[2] * turn
    level = Motion(
        Pose.from_euler(position, yaw=last.yaw + way * turn), Twist(velocity, np.array([0.0, 0.0, yaw_rate]))
    )
    over, over_rate = 0.0, 0.0
    if ahead[2] != 0.0:
        left, sign = (1.0 - way, 1.0) if ahead[2] > 0.0 else (way, -1.0)
        hill, slope = sign * (left - left**_EDGE), _EDGE * left ** (_EDGE - 1) - 1.0
        over = ahead[2] * hill
        over_rate = (following.velocity[2] - last.velocity[2]) * hill + ahead[2] * slope * rate[2]
    if last.pitch != 0.0 or following.pitch != 0.0:
        tilt = following.pitch - last.pitch
        level = level.then(Motion.about(_Y, last.pitch + way * tilt, rate[2] * tilt))
    x, z, dx = 0.0, -_HEEL[1] * foot + curve[3] * leg + over, 0.0
    dz = rate[3] * leg + over_rate
    for (px, pz), angle, speed in ((_TOE, curve[0], rate[0]), (_HEEL, -curve[1], -rate[1])):
        s, c = math.sin(angle), math.cos(angle)  # the ankle about a pivot: pivot - R(angle) pivot
        x += foot * (px - c * px - s * pz)
        z += foot * (pz + s * px - c * pz)
        dx += foot * (s * px - c * pz) * speed
        dz += foot * (c * px + s * pz) * speed
    ankle = Motion(Pose(np.array([x, 0.0, z])), Twist(np.array([dx, 0.0, dz])))
    return level.then(ankle).then(Motion.about(_Y, curve[0] - curve[1], rate[0] - rate[1]))


def hip_height(hips: list[tuple[Motion, Motion]], leg: float, softness: float) -> tuple[float, float]:
    """Return how high the pelvis is so that both legs reach their ankles, and its derivative.

    Parameters
    ----------
    hips : list of tuple of Motion
        Hip, with the pelvis at height 0, and ankle of each side.
    leg : float
        [m]
    softness : float
        Below this difference of two bounds [m] the lower one takes over gradually.
    """
    bounds = []
    for hip, ankle in hips:
        way, speed = ankle.pose.position - hip.pose.position, ankle.twist.linear - hip.twist.linear
        left = (REACH * leg) ** 2 - float(way[:2] @ way[:2])
        least = (0.4 * leg) ** 2
        rise = math.sqrt(max(left, least))
        slope = -float(way[:2] @ speed[:2]) / rise if left > least else 0.0
        bounds.append((float(way[2]) + rise, float(speed[2]) + slope))
    lowest = min(bound for bound, _ in bounds)
    shares = np.exp([(lowest - bound) / softness for bound, _ in bounds])
    total = float(shares.sum())
    return lowest - softness * math.log(total), float(shares @ [rate for _, rate in bounds]) / total


def leg_motions(hip: Motion, ankle: Motion, upper: float, lower: float) -> tuple[Motion, Motion]:
    """Return the motions of thigh and shank between hip and ankle, the knee bent backward.

    Parameters
    ----------
    hip, ankle : Motion
        In the walker's frame; only their places and linear velocities count.
    upper, lower : float
        Lengths of thigh and shank [m].
    """
    way, speed = ankle.pose.position - hip.pose.position, ankle.twist.linear - hip.twist.linear
    drop_squared = float(way[1:] @ way[1:])
    drop = math.sqrt(drop_squared)
    aside = math.atan2(way[1], -way[2])
    aside_rate = float(way[1] * speed[2] - way[2] * speed[1]) / drop_squared
    flat, flat_rate = np.array([way[0], -drop]), np.array([speed[0], -float(way[1:] @ speed[1:]) / drop])
    squared, squared_rate = float(flat @ flat), 2.0 * float(flat @ flat_rate)
    cosine = (squared - upper**2 - lower**2) / (2.0 * upper * lower)
    limit = math.cos(math.radians(2.0))
    if abs(cosine) > limit:  # farther than the leg reaches: it points there
        cosine, squared_rate = math.copysign(limit, cosine), 0.0
    bend = math.acos(cosine)
    bend_rate = -squared_rate / (2.0 * upper * lower * math.sin(bend))
    # A limb turned by a about y points along (-sin a, -cos a): w is parallel to upper u(a) + lower u(a + bend).
    x, z = upper + lower * math.cos(bend), lower * math.sin(bend)
    dx, dz = -lower * math.sin(bend) * bend_rate, lower * math.cos(bend) * bend_rate
    inner_rate = (x * dz - z * dx) / (x * x + z * z)
    thigh = math.atan2(-flat[0], -flat[1]) - math.atan2(z, x)
    thigh_rate = float(flat[1] * flat_rate[0] - flat[0] * flat_rate[1]) / squared - inner_rate
    start = Motion(Pose(hip.pose.position), Twist(hip.twist.linear))
    first = start.then(Motion.about(_X, aside, aside_rate)).then(Motion.about(_Y, thigh, thigh_rate))
    knee = Motion(Pose(np.array([0.0, 0.0, -upper])))
    return first, first.then(knee).then(Motion.about(_Y, bend, bend_rate))
