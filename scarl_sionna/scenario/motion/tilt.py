"""How bodies tilt over the road: two-wheelers lean into bends, others pitch and roll on their springs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline
from scipy.linalg import expm

from scarl_sionna.core.errors import ParameterRangeError
from scarl_sionna.scene.motion.trajectory import Motion, Trajectory

Array = npt.NDArray[np.float64]

GRAVITY = 9.80665
"""[m/s^2]"""
LEAN = np.radians(45.0)
"""Most that a two-wheeler leans: where tyres on dry asphalt let go."""
STEP = 0.05
"""Distance of the instants at which springs are solved [s]: some fifteenth of their period."""
_X, _Y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Tilt:
    """Of a body over the frame that stands on the road, about its origin.

    First it pitches by `pitch`, nose up, then rolls by `roll` about its own x axis, left side up, each (N,) [rad];
    `pitching` and `rolling` are the derivatives [rad/s].
    """

    pitch: Array
    roll: Array
    pitching: Array
    rolling: Array

    def spin(self, heading: float, slope: float) -> Array:
        """Return the angular velocity (3,) [rad/s, world] at the first time, on a road of a heading and slope [rad]."""
        cos, sin, pitch = np.cos(heading), np.sin(heading), slope + self.pitch[0]
        ahead = np.array([cos * np.cos(pitch), sin * np.cos(pitch), np.sin(pitch)])
        return np.asarray(self.pitching[0] * np.array([sin, -cos, 0.0]) + self.rolling[0] * ahead)

    @property
    def body_from_road(self) -> Motion:
        """The road's frame in that of the body, at the first time."""
        roll = Motion.about(_X, -float(self.roll[0]), -float(self.rolling[0]))
        return roll.then(Motion.about(-_Y, -float(self.pitch[0]), -float(self.pitching[0])))


def lean(bend: Array, change: Array, speed: Array, pull: Array) -> Tilt:
    """Return the lean into bends [1/m] that `change` along the way [1/m^2], at speeds and accelerations, each (N,)."""
    aside = bend * speed**2 / GRAVITY
    angle = np.arctan(aside)
    rate = (change * speed**3 + 2.0 * bend * speed * pull) / GRAVITY / (1.0 + aside**2)
    level = np.zeros_like(aside)
    return Tilt(level, -np.clip(angle, -LEAN, LEAN), level, -np.where(np.abs(angle) < LEAN, rate, 0.0))


class Sprung(Protocol):
    """What is asked of an actor model to know its springs."""

    @property
    def semantic(self) -> str:
        """Class."""

    @property
    def motion(self) -> str:
        """How it moves."""

    @property
    def joints(self) -> tuple[Mapping[str, Any], ...]:
        """Rows of its joints."""


@dataclass(frozen=True)
class Springs:
    r"""Of a vehicle: gradients of pitch and roll [deg/g], natural frequency [Hz] and damping ratio.

    Notes
    -----
    The angle :math:`\theta` follows :math:`\ddot\theta + 2\zeta\omega\dot\theta + \omega^2(\theta - G a) = 0` with the
    gradient G and the acceleration a of the middle between the axles, along for pitch and across for roll, at most 1 g.
    Cars have 1 to 1.5 Hz, damping ratios of 0.2 to 0.4, and 3 to 7 deg/g of roll [1]_.

    References
    ----------
    .. [1] T. D. Gillespie, Fundamentals of Vehicle Dynamics, 1992, chapters 5 and 6.
    """

    pitch: float = 2.0
    roll: float = 5.0
    frequency: float = 1.3
    damping: float = 0.4

    def __post_init__(self) -> None:
        for name, low, high in (("pitch", 0.0, 10.0), ("roll", 0.0, 15.0), ("frequency", 0.3, 3.0)):
            if not low <= getattr(self, name) <= high:
                unit = "Hz" if name == "frequency" else "deg/g"
                raise ParameterRangeError(f"Springs.{name}", getattr(self, name), f"{low:g} to {high:g} {unit}")
        if not 0.1 <= self.damping < 1.0:
            raise ParameterRangeError("Springs.damping", self.damping, "0.1 to below 1")

    @classmethod
    def of(cls, model: Sprung) -> Springs | None:
        """Return the usual springs of an actor model; None for one without wheels that turn, on rails, with a trailer.

        Two-wheelers have none either: they lean.
        """
        kinds = {row["kind"] for row in model.joints}
        if model.motion != "vehicle" or "wheel" not in kinds or "trailer" in kinds:
            return None
        return _USUAL.get(model.semantic)

    def response(self, times: Array, pulls: Array, before: Array | None = None) -> CubicHermiteSpline:
        """Return pitch and roll [rad] over time, from what pulls the body.

        Parameters
        ----------
        times : ndarray of float64, shape (N,)
            Evenly spaced [s].
        pulls : ndarray of float64, shape (N, 2)
            Acceleration forward and to the left [m/s^2], straight between the times.
        before : ndarray of float64, shape (2, 2), or None
            Pitch and roll [rad], and their rates [rad/s], at the first time; None: as if the first pull had always
            been.
        """
        wanted = np.clip(pulls / GRAVITY, -1.0, 1.0) * np.radians([self.pitch, self.roll])
        omega, step = 2.0 * np.pi * self.frequency, times[1] - times[0]
        system = np.zeros((4, 4))  # angle, rate, what is wanted, and how that changes over a step
        system[:2, :3] = [[0.0, 1.0, 0.0], [-(omega**2), -2.0 * self.damping * omega, omega**2]]
        system[2, 3] = 1.0 / step
        exact = expm(system * step)
        driven = wanted[:-1, None] * (exact[:2, 2] - exact[:2, 3])[:, None] + wanted[1:, None] * exact[:2, 3, None]
        first = np.stack([wanted[0], np.zeros(2)]) if before is None else before
        poles, modes = np.linalg.eig(exact[:2, :2])  # a conjugate pair: twice the real part of one
        drive = np.concatenate([first[None], driven]).transpose(0, 2, 1) @ np.linalg.inv(modes)[0]
        pole = complex(poles[0])
        rung = [list(accumulate(one, lambda state, now: now + pole * state)) for one in drive.T.tolist()]
        states = 2.0 * np.real(modes[:, 0, None] * np.transpose(rung)[:, None])
        return CubicHermiteSpline(times, states[:, 0], states[:, 1])


class Swaying:
    """A body on its springs along a motion; solved when it is first asked for.

    Parameters
    ----------
    springs : Springs
    span : (float, float)
        First and last time [s].
    pulls : callable
        Accelerations (N, 2) [m/s^2] at times (N,) [s].
    before : Tilt or None
        With what it begins; None: as if the first pull had always been.
    """

    def __init__(
        self, springs: Springs, span: tuple[float, float], pulls: Callable[[Array], Array], before: Tilt | None = None
    ) -> None:
        self.springs, self._span, self._pulls, self._before = springs, span, pulls, before

    @cached_property
    def _curve(self) -> CubicHermiteSpline:
        times = np.linspace(*self._span, max(int((self._span[1] - self._span[0]) / STEP), 1) + 1)
        tilt = self._before
        first = None if tilt is None else np.reshape([tilt.pitch, tilt.roll, tilt.pitching, tilt.rolling], (2, 2))
        return self.springs.response(times, self._pulls(times), first)

    def at(self, times: Array) -> Tilt:
        """Return the tilt at times (N,) [s]."""
        angles, rates = self._curve(times), self._curve(times, 1)
        return Tilt(angles[:, 0], angles[:, 1], rates[:, 0], rates[:, 1])


_USUAL = {"Car": Springs(), "Truck": Springs(1.0, 5.0, 1.2), "Bus": Springs(1.0, 5.0, 1.0)}
"""By class: a saloon between the limits of [1]; of lorries and buses, which are longer, estimates."""


def on_springs(trajectory: Trajectory, springs: Springs | None) -> Trajectory:
    """Return the motion of a body that pitches and rolls; as it is of a rigid one, or where bends are not known."""
    says = getattr(trajectory, "on_springs", None)
    return trajectory if springs is None or says is None else says(springs)  # type: ignore[no-any-return]
