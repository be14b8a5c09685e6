"""Closed forms of micro-Doppler: rolling wheel, vibrating point, pendulum. Imports numpy and scipy only."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.special import ellipk, jv

SPEED_OF_LIGHT = 299_792_458.0
FREQUENCY = 76.5e9
WAVELENGTH = SPEED_OF_LIGHT / FREQUENCY

WHEEL_RADIUS, WHEEL_SPEED = 0.32, 15.0
"""Radius [m] and speed of the vehicle [m/s]."""
WHEEL_DOPPLER = {0.0: 15310.5919696, 30.0: 14284.97678112, 60.0: 11482.9439772, 90.0: 7655.295984798,
120.0: 3827.647992399,
                 180.0: 0.0, 270.0: 7655.295984798}  # fmt: skip # a table
"""Doppler shift [Hz] of a point of the rim at the angle [deg] from the top, seen from straight ahead: 2 v (1 + cos) /
lambda."""
WHEEL_DOPPLER_5_DEG = {0.0: 15252.33054476, 30.0: 13897.01662796, 60.0: 10861.43315458, 90.0: 6958.96226487,
                       120.0: 3235.267882206, 270.0: 8293.368279887}  # fmt: skip # a table
"""The same from 5 deg above: 2 v ((1 + cos) cos(el) - sin sin(el)) / lambda."""

VIBRATION_LINES_DB = (
    -6.868286648429,
    -4.879102012813,
    -11.77455445176,
    -22.74236627447,
    -36.41365116702,
    -52.12215780477,
)
"""20 log10 |J_n(4 pi A / lambda)| for n = 0 to 5 of a point that vibrates by A = 0.5 mm."""
PENDULUM_PERIOD, PENDULUM_DOPPLER = 2.010235892602, 278.5845772124
"""Of a pendulum of 1 m let go at 10 deg, g = 9.80665 m/s2: period [s], largest Doppler shift [Hz]."""


def rim(psi: npt.ArrayLike) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Position about the hub, velocity and acceleration of points of a rolling rim [m, m/s, m/s2].

    Psi from the top [rad].
    """
    angle = np.atleast_1d(np.asarray(psi, dtype=np.float64))
    zero = np.zeros_like(angle)
    spin = WHEEL_SPEED / WHEEL_RADIUS
    away = np.stack([np.sin(angle), zero, np.cos(angle)], axis=1)
    along = np.stack([np.cos(angle), zero, -np.sin(angle)], axis=1)
    return WHEEL_RADIUS * away, WHEEL_SPEED * ([[1.0, 0.0, 0.0]] + along), -WHEEL_RADIUS * spin**2 * away


def vibration_line(order: int, amplitude: float) -> float:
    """Amplitude of the n-th line of the slow-time spectrum."""
    return float(abs(jv(order, 4.0 * np.pi * amplitude / WAVELENGTH)))


def pendulum_period(length: float, amplitude: float, gravity: float = 9.80665) -> float:
    """Exact period [s] of a pendulum let go at an angle [rad]."""
    return float(4.0 * np.sqrt(length / gravity) * ellipk(np.sin(amplitude / 2.0) ** 2))
