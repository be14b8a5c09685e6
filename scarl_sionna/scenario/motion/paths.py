"""Smooth paths by arc length, and the trajectory of a body whose rear axle follows one."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import Akima1DInterpolator, BSpline, CubicSpline, PPoly, make_interp_spline, make_lsq_spline
from scipy.spatial.transform import Rotation

from scarl_sionna.core.errors import ParameterRangeError, TimeRangeError
from scarl_sionna.core.pose import Pose, Twist
from scarl_sionna.scene.motion.trajectory import Motion, Trajectory, WheelWay

from .bodies import ActorBody
from .tilt import Springs, Swaying, Tilt, lean

Array = npt.NDArray[np.float64]

SMOOTHING = 3.0
"""Distance of the knots of a vehicle's path [m]: the steering goes from straight to a bend within about this way."""
ROUNDING = 0.2
"""Distance of the knots of heights that follow a ground with kerbs and ramps [m]: less than a wheel's radius."""
ROLLING = 0.25
"""Distance of the places at which the way of a steered wheel is known exactly [m]: a twelfth of the path's knots."""
_DEGREE = 5


@dataclass(frozen=True)
class LateralShift:
    """A change of the lateral position along a path: a lane change, a cut-in, a swerve.

    Attributes
    ----------
    start, length : float
        Way at which it begins, and how long it takes [m].
    offset : float
        How far to the left [m].

    Notes
    -----
    The quintic 10 x^3 - 15 x^4 + 6 x^5 of the way: lateral speed and acceleration are zero at both ends.
    """

    start: float
    length: float
    offset: float

    def __post_init__(self) -> None:
        if not self.length > 0.0 or not np.isfinite([self.start, self.length, self.offset]).all():
            raise ParameterRangeError(
                "LateralShift", (self.start, self.length, self.offset), "finite, length above 0 m"
            )

    def at(self, way: Array) -> Array:
        """Return the lateral position [m] at ways [m]."""
        return self.offset * quintic_step((way - self.start) / self.length)


def quintic_step(x: npt.ArrayLike) -> Array:
    """Return the quintic that goes from 0 to 1 between 0 and 1 with zero first and second derivatives at both ends."""
    x = np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


MOST_KNOTS = 30_000
"""Knots of a path: 90 km of a vehicle's way, and no more than some seconds to fit them."""


class SmoothPath:
    """Curve through points in space, by arc length; its derivatives are continuous up to the fourth.

    Parameters
    ----------
    points : array_like of float, shape (N, 3)
        In order, N >= 2, distinct neighbours [m].
    smoothing : float
        Distance of the knots of the least-squares spline [m]: what is shorter is smoothed away.
    extend : (float, float)
        Length of straight, level pieces before the first and after the last point [m]. Ways count from the first point,
        so that those before it are negative.
    offset : float
        Distance of the curve to the left of the points [m].
    shifts : sequence of LateralShift
        Lateral shifts, their ways counted along the points.
    sparse : bool
        Whether the points are few and the curve between them is the cubic spline through them; otherwise they lie as
        close as those of a lane, and straight stays straight between them (Akima).

    Attributes
    ----------
    length : float
        Way from the first to the last point [m].
    deviation : float
        Largest distance of the curve from the (shifted) points [m].

    Notes
    -----
    Quintic B-spline, fitted by least squares to points 0.1 `smoothing` apart, sampled again by arc length and
    interpolated: the length of its tangent differs from 1 by some 1e-5. *Error*: where a straight meets an arc of
    radius R, of the order of `smoothing`^2 / (100 R).
    """

    def __init__(
        self,
        points: npt.ArrayLike,
        smoothing: float = SMOOTHING,
        extend: tuple[float, float] = (0.0, 0.0),
        offset: float = 0.0,
        shifts: Sequence[LateralShift] = (),
        sparse: bool = False,
    ) -> None:
        given = np.asarray(points, dtype=np.float64)
        if given.ndim != 2 or given.shape[0] < 2 or given.shape[1] != 3 or not np.isfinite(given).all():
            raise ParameterRangeError("points", f"shape {given.shape}", "two or more finite points [x, y, z] [m]")
        if not 1e-3 <= smoothing <= 1e3:
            raise ParameterRangeError("smoothing", smoothing, "0.001 to 1000 m")
        steps = np.linalg.norm(np.diff(given, axis=0), axis=1)
        if steps.min() <= 0.0:
            raise ParameterRangeError("points", f"point {int(steps.argmin())} twice in a row", "distinct neighbours")
        chord = np.concatenate([[0.0], np.cumsum(steps)])
        if not chord[-1] + sum(extend) <= MOST_KNOTS * smoothing:
            raise ParameterRangeError(
                "length of the path",
                f"{chord[-1]:.4g} m",
                f"at most {MOST_KNOTS * smoothing:.4g} m ({MOST_KNOTS} knots, {smoothing:.3g} m apart)",
                "does a point jump? cut the way into several",
            )
        dense, way = _densify(given, chord, smoothing, extend, sparse)
        if offset != 0.0 or shifts:  # beside a curve, not beside a corner
            dense = _least_squares(way, dense, smoothing)(way)
        lateral = offset + sum((shift.at(way) for shift in shifts), np.zeros_like(way))
        if np.any(lateral):
            tangent = np.gradient(dense[:, :2], way, axis=0)
            tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
            dense = dense + lateral[:, None] * np.column_stack([-tangent[:, 1], tangent[:, 0], np.zeros_like(way)])
        fitted = _least_squares(way, dense, smoothing)
        self._spline, self._ways, self._chords = _by_arc_length(fitted, way, smoothing)
        self._slopes = tuple(self._spline.derivative(order) for order in (1, 2, 3))
        self._shifts, self._follows_lanes = tuple(shifts), False
        self.length = float(self.way_of(chord[-1]))
        anchors = np.stack([np.interp(chord, way, dense[:, axis]) for axis in range(3)], axis=1)
        self.deviation = float(np.linalg.norm(self.at(self.way_of(chord)) - anchors, axis=1).max())

    def of_lanes(self) -> SmoothPath:
        """Return the curve as one whose points are those of lanes: what is beside them is `shifts` alone."""
        other = copy.copy(self)
        other._follows_lanes = True
        return other

    def aside(self, way: Array) -> Array | None:
        """Return how far the shifts have moved it to the left [m] at ways (N,) [m]; None where it follows no lanes."""
        if not self._follows_lanes:
            return None
        chord = np.interp(way, self._ways, self._chords)
        return sum((shift.at(chord) for shift in self._shifts), np.zeros_like(chord))

    def on_ground(self, heights: Callable[[Array], Array]) -> SmoothPath:
        """Return the curve with the same plan on a ground with ramps and kerbs.

        Parameters
        ----------
        heights : callable
            Heights (M,) [m] of the ground at places (M, 2) [m]; followed with knots `ROUNDING` apart.
        """
        low, high = self.bounds
        count = max(int(np.ceil((high - low) / ROUNDING)), 2)
        close = np.linspace(low, high, 10 * count + 1)
        rise = _least_squares(close, heights(self.at(close)[:, :2])[:, None], ROUNDING)
        knots = close[::2]
        fitted = make_interp_spline(knots, np.column_stack([self.at(knots)[:, :2], rise(knots)]), k=_DEGREE)
        other = copy.copy(self)
        other._spline, other._ways, before = _by_arc_length(fitted, close, ROUNDING)
        other._chords = np.interp(before, self._ways, self._chords)
        other._slopes = tuple(other._spline.derivative(order) for order in (1, 2, 3))
        other.length = float(np.interp(self.length, before, other._ways))
        return other

    @property
    def bounds(self) -> tuple[float, float]:
        """First and last way of the curve, extensions included [m]."""
        return float(self._ways[0]), float(self._ways[-1])

    def way_of(self, chord: npt.ArrayLike) -> Array:
        """Return the ways on the curve [m] of distances along the polyline of the points [m]."""
        return np.interp(np.asarray(chord, dtype=np.float64), self._chords, self._ways)

    def at(self, way: npt.ArrayLike, derivative: int = 0) -> Array:
        """Return points [m] (..., 3), or their first to third derivatives by the way, at ways (...,) [m]."""
        return np.asarray((self._spline, *self._slopes)[derivative](way))

    def bend(self, way: npt.ArrayLike) -> tuple[Array, Array]:
        """Return the turn of the heading by the way [rad/m], to the left, and its derivative, at ways (...,) [m]."""
        (x1, y1), (x2, y2), (x3, y3) = (self.at(way, order)[..., :2].T for order in (1, 2, 3))
        plan = x1 * x1 + y1 * y1
        turn = x1 * y2 - y1 * x2
        return (turn / plan).T, ((x1 * y3 - y1 * x3) / plan - 2.0 * turn * (x1 * x2 + y1 * y2) / plan**2).T


def _densify(
    points: Array, chord: Array, smoothing: float, extend: tuple[float, float], sparse: bool
) -> tuple[Array, Array]:
    """Return points at close distances, straight pieces at both ends included, and their way along the polyline."""
    step = min(0.1 * smoothing, float(chord[-1]) / 8.0)
    inner = np.linspace(0.0, chord[-1], int(np.ceil(chord[-1] / step)) + 1)
    if len(points) == 2:
        dense = points[0] + inner[:, None] / chord[-1] * (points[1] - points[0])
    elif sparse:
        dense = CubicSpline(chord, points)(inner)
    else:
        dense = Akima1DInterpolator(chord, points, method="makima")(inner)
    parts, ways = [dense], [inner]
    for index, length in enumerate(extend):
        count = int(np.ceil(length / step))
        if count == 0:
            continue
        away = np.arange(1, count + 1) * step
        edge, near = (dense[0], dense[1]) if index == 0 else (dense[-1], dense[-2])
        direction = (edge - near) * [1.0, 1.0, 0.0]
        direction /= max(float(np.linalg.norm(direction)), 1e-12)
        if index == 0:
            parts.insert(0, (edge + away[:, None] * direction)[::-1])
            ways.insert(0, -away[::-1])
        else:
            parts.append(edge + away[:, None] * direction)
            ways.append(chord[-1] + away)
    return np.concatenate(parts), np.concatenate(ways)


def _least_squares(way: Array, dense: Array, smoothing: float) -> BSpline:
    """Return the quintic spline with uniform knots that is nearest to the points."""
    pieces = max(round((way[-1] - way[0]) / smoothing), 1)
    pieces = min(pieces, max((len(way) - _DEGREE - 1) // 2, 1))
    inner = np.linspace(way[0], way[-1], pieces + 1)[1:-1]
    knots = np.concatenate([np.repeat(way[0], _DEGREE + 1), inner, np.repeat(way[-1], _DEGREE + 1)])
    return make_lsq_spline(way, dense, knots, k=_DEGREE)


def _by_arc_length(fitted: BSpline, way: Array, smoothing: float) -> tuple[BSpline, Array, Array]:
    """Return the curve by its arc length (0 where `way` is 0), and a table of arc lengths over `way`."""
    count = max(int(np.ceil((way[-1] - way[0]) / (0.25 * smoothing))), 8)
    edges = np.linspace(way[0], way[-1], count + 1)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    half = (edges[1] - edges[0]) / 2.0
    samples = (edges[:-1, None] + half * (1.0 + nodes)).ravel()
    speed = np.linalg.norm(fitted.derivative()(samples), axis=1).reshape(-1, 4)
    lengths = np.concatenate([[0.0], np.cumsum(speed @ weights * half)])
    lengths -= float(CubicSpline(edges, lengths)(0.0))
    inverse = CubicSpline(lengths, edges)
    uniform = np.linspace(lengths[0], lengths[-1], count + 1)
    curve = make_interp_spline(uniform, fitted(np.clip(inverse(uniform), way[0], way[-1])), k=_DEGREE)
    return curve, lengths, edges


class PathTrajectory:
    """A body whose rear axle follows a path: the kinematic bicycle without slip [1]_.

    A pedestrian follows it with its origin.

    Parameters
    ----------
    path : SmoothPath
    way : scipy.interpolate.PPoly
        Way of the rear axle along the path [m] over time [s], C2 for a continuous acceleration.
    body : ActorBody
        Wheelbase and rear axle place the origin and pitch the body on slopes.
    start, stop : float or None
        Times at which the motion is known [s]; None: those of `way`.
    name : str
        Whose motion it is, for error messages.

    Notes
    -----
    With the way s(t), the path r(s) and the wheelbase L: heading psi = direction of dr/ds in plan, slope
    gamma = atan((z(s + L) - z(s)) / L), orientation R = R_z(psi) R_y(-gamma), origin p = r(s) + R (-rear_axle, 0, 0),
    so that both axles stand on the path's ground. The twist is the exact derivative: omega = psi' z - gamma' R_z(psi)
    y, v = dr/ds s' + omega x R (-rear_axle, 0, 0). A body whose `motion` is ``cycle`` leans about the line through the
    feet of its wheels by atan(k s'^2 / g) into a bend k, at most `tilt.LEAN`: steady turning without the width of the
    tyres and the gyroscopes of the wheels, which make it lean a little more [2]_. One `on_springs` pitches and rolls
    about its origin, which stays on the road as the wheels do. *Not modelled*: slip, heave, what weight does to springs
    on slopes, banked roads.

    References
    ----------
    .. [1] R. Rajamani, Vehicle Dynamics and Control, 2nd ed., 2012, section 2.2.
    .. [2] V. Cossalter, Motorcycle Dynamics, 2nd ed., 2006, section 4.1.
    """

    def __init__(
        self,
        path: SmoothPath,
        way: PPoly,
        body: ActorBody | None = None,
        start: float | None = None,
        stop: float | None = None,
        name: str = "actor",
    ) -> None:
        self.path, self.way, self.body, self.name = path, way, body or ActorBody(), name
        self.start = float(way.x[0] if start is None else start)
        self.stop = float(way.x[-1] if stop is None else stop)
        if not self.start < self.stop:
            raise ParameterRangeError(f"{name}.trajectory", (self.start, self.stop), "a start before the stop [s]")
        self._rate, self._pull = way.derivative(1), way.derivative(2)
        self._rolled: dict[tuple[float, float], tuple[PPoly, PPoly, float]] = {}
        self._swaying: Swaying | None = None
        self._last: tuple[float, tuple[Array, Array, Array, Array, Array, Tilt | None]] | None = None
        low, high = path.bounds
        ways = way(np.linspace(self.start, self.stop, 65))
        margin = 1e-6
        if ways.min() < low - margin or ways.max() > high - self._base + margin:
            raise ParameterRangeError(
                f"{name}.trajectory",
                f"ways from {ways.min():.4g} to {ways.max():.4g} m of the rear axle",
                f"{low:.4g} to {high - self._base:.4g} m, the path",
                "let the motion end earlier or the path begin earlier and end later",
            )

    @property
    def _base(self) -> float:
        return self.body.wheelbase

    def sample(self, times: npt.ArrayLike) -> tuple[Array, Array, Array, Array, Array]:
        """Return position, heading, slope, linear and angular velocity of the frame on the road at times (N,) [s].

        Shapes and units: (N, 3) [m], (N,) [rad], (N,) [rad], (N, 3) [m/s], (N, 3) [rad/s].
        """
        time = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if time.min() < self.start or time.max() > self.stop:
            wrong = time.min() if time.min() < self.start else time.max()
            raise TimeRangeError(float(wrong), self.start, self.stop, f"'{self.name}'")
        way, rate = self.way(time), self._rate(time)
        rear, first, second = self.path.at(way), self.path.at(way, 1), self.path.at(way, 2)
        heading = np.arctan2(first[:, 1], first[:, 0])
        plan = first[:, 0] ** 2 + first[:, 1] ** 2
        turn = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / plan * rate
        slope, tilt = np.zeros_like(way), np.zeros_like(way)
        if self._base > 0.0:
            rise = self.path.at(way + self._base)[:, 2] - rear[:, 2]
            climb = (self.path.at(way + self._base, 1)[:, 2] - first[:, 2]) * rate
            slope = np.arctan2(rise, self._base)
            tilt = climb * self._base / (self._base**2 + rise**2)
        cos, sin, flat = np.cos(heading), np.sin(heading), np.zeros_like(way)
        angular = np.stack([sin * tilt, -cos * tilt, turn], axis=1)
        lever = -self.body.rear_axle * np.stack(
            [cos * np.cos(slope), sin * np.cos(slope), np.sin(slope) + flat], axis=1
        )
        velocity = first * rate[:, None] + np.cross(angular, lever)
        return rear + lever, heading, slope, velocity, angular

    def on_springs(self, springs: Springs, after: PathTrajectory | None = None) -> PathTrajectory:
        """Return the same motion of a body that pitches and rolls; `after`: from the tilt that another one ends with.

        Raises
        ------
        ParameterRangeError
            If the body has two wheels, which lean, none, or a trailer.
        """
        if self.body.motion != "vehicle" or not self._base > 0.0 or self.body.trailer is not None:
            raise ParameterRangeError(f"springs of '{self.name}'", springs, "none for this body")
        other = copy.copy(self)
        before = None if after is None else after.tilt(after.stop)
        other._last, other._swaying = None, Swaying(springs, (self.start, self.stop), self.pulls, before)
        return other

    def pulls(self, times: npt.ArrayLike) -> Array:
        """Return the acceleration of the middle between the axles, forward and to the left (N, 2) [m/s^2]."""
        time = np.atleast_1d(np.asarray(times, dtype=np.float64))
        way, speed, pull, arm = self.way(time), self._rate(time), self._pull(time), self._base / 2.0
        bend, change = self.path.bend(way)
        forward = pull - arm * (bend * speed) ** 2
        return np.stack([forward, bend * speed**2 + arm * (change * speed**2 + bend * pull)], axis=1)

    def tilt(self, times: npt.ArrayLike) -> Tilt | None:
        """Return how the body tilts over the road at times (N,) [s]; None for one that does not."""
        time = np.atleast_1d(np.asarray(times, dtype=np.float64))
        if self.body.motion == "cycle" and self._base > 0.0:
            way = self.way(time)
            return lean(*self.path.bend(way), self._rate(time), self._pull(time))
        return None if self._swaying is None else self._swaying.at(time)

    def body_from_road(self, time: float) -> Motion | None:
        """Return how the frame on which the wheels stand moves in the body's; None for one without springs."""
        tilt = self._state(time)[5]
        return None if tilt is None or self._swaying is None else tilt.body_from_road

    def _state(self, time: float) -> tuple[Array, Array, Array, Array, Array, Tilt | None]:
        """Return sample and tilt at one time; the last one is kept, as pose and twist are asked for together."""
        if self._last is None or self._last[0] != time:
            self._last = (time, (*self.sample(time), self.tilt(time)))
        return self._last[1]

    def pose(self, time: float) -> Pose:
        """Return world_from_actor at a time [s]; x along the heading of the rear axle."""
        position, heading, slope, _, _, tilt = self._state(time)
        pitch, roll = (0.0, 0.0) if tilt is None else (tilt.pitch[0], tilt.roll[0])
        quaternion = Rotation.from_euler("ZYX", [heading[0], -slope[0] - pitch, roll]).as_quat()
        return Pose(position[0], np.roll(quaternion, 1))

    def twist(self, time: float) -> Twist:
        """Return the velocity at a time [s]: exact derivatives of the path, of the way and of the tilt."""
        _, heading, slope, linear, angular, tilt = self._state(time)
        spin = 0.0 if tilt is None else tilt.spin(float(heading[0]), float(slope[0]))
        return Twist(linear[0], angular[0] + spin)

    def forward_speeds(self, times: Array) -> Array:
        """Return the speed of the origin along the body's x axis [m/s] at times (N,) [s]."""
        _, heading, slope, linear, _ = self.sample(times)
        flat = linear[:, 0] * np.cos(heading) + linear[:, 1] * np.sin(heading)
        return np.asarray(flat * np.cos(slope) + linear[:, 2] * np.sin(slope))

    def lane_offsets(self, times: Array) -> Array | None:
        """Return how far it is to the left of its lanes [m] at times (N,) [s]; None where it follows none."""
        return self.path.aside(np.asarray(self.way(np.clip(times, self.start, self.stop))))

    def wheel_way(self, time: float, place: tuple[float, float]) -> WheelWay:
        r"""Return where a wheel at x, y of the body [m] points that goes without slip, and how far it has rolled.

        Notes
        -----
        With the turn k of the path by its way s, the wheel at (l, y) from the rear axle's middle goes along
        :math:`(1 - k y, k l)` in the body: it points there, and rolls by the integral of the length over s.
        """
        lever, side = place[0] - self.body.rear_axle, place[1]
        way, rate = float(self.way(time)), float(self._rate(time))
        bend, change = (float(value) for value in self.path.bend(way))
        along, across = 1.0 - bend * side, bend * lever
        steering = change * lever / (along**2 + across**2) * rate
        length, pace, start = self._roll(lever, side)
        return WheelWay(float(np.arctan2(across, along)), steering, float(length(way)) - start, float(pace(way)) * rate)

    def road_height(self, time: float, x: float) -> tuple[float, float]:
        """Return the path's height at x of the body [m] over its origin [m], and its rate [m/s].

        Before its beginning and after its end the path is level.
        """
        position, _, _, linear, _, _ = self._state(time)
        way, rate = float(self.way(time)) + x - self.body.rear_axle, float(self._rate(time))
        low, high = self.path.bounds
        inside = min(max(way, low), high)
        climb = float(self.path.at(inside, 1)[..., 2]) * rate if inside == way else 0.0
        return float(self.path.at(inside)[..., 2] - position[0, 2]), climb - float(linear[0, 2])

    def _roll(self, lever: float, side: float) -> tuple[PPoly, PPoly, float]:
        """Return the way of a wheel over the way of the rear axle, its derivative, and its value at the start."""
        if (lever, side) not in self._rolled:
            low, high = self.path.bounds
            ways = self.way(np.linspace(self.start, self.stop, 65))
            ends = max(float(ways.min()) - 1.0, low), min(float(ways.max()) + 1.0, high)
            knots = np.linspace(*ends, max(int((ends[1] - ends[0]) / ROLLING), 3) + 1)
            bend = self.path.bend(knots)[0]
            pace = CubicSpline(knots, np.hypot(1.0 - bend * side, bend * lever))
            length = pace.antiderivative()
            self._rolled[lever, side] = length, pace, float(length(self.way(self.start)))
        return self._rolled[lever, side]

    def speed(self, times: npt.ArrayLike) -> Array:
        """Return the speed of the rear axle [m/s] at times (N,) [s]."""
        return np.asarray(self._rate(times))

    def acceleration(self, times: npt.ArrayLike) -> Array:
        """Return the acceleration of the rear axle along its way [m/s^2] at times (N,) [s]."""
        return np.asarray(self._pull(times))


@dataclass(frozen=True, eq=False)
class PlanMotion:
    """Motion in plan, sampled.

    `position` (N, 3) [m], `heading` (N,) [rad] and `velocity` (N, 3) [m/s] at `times` (N,) [s].
    """

    times: Array
    position: Array
    heading: Array
    velocity: Array


def sample_motion(trajectory: Trajectory, times: npt.ArrayLike) -> PlanMotion:
    """Return the motion of any trajectory at times (N,) [s], which must lie within those it is known at.

    Raises
    ------
    TimeRangeError
        If a time lies outside.
    """
    time = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if isinstance(trajectory, PathTrajectory):
        position, heading, _, velocity, _ = trajectory.sample(time)
        return PlanMotion(time, position, heading, velocity)
    poses = [trajectory.pose(float(one)) for one in time]
    velocity = np.array([trajectory.twist(float(one)).linear for one in time]).reshape(-1, 3)
    return PlanMotion(
        time,
        np.array([pose.position for pose in poses]).reshape(-1, 3),
        np.array([pose.yaw for pose in poses]),
        velocity,
    )
