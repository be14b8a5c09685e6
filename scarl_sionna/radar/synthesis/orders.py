"""How much of its motion a path needs over a frame: the cheapest description whose error stays below a tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from scarl_sionna.core.arrays.rows import row_cross, row_norm
from scarl_sionna.core.specs.radar.spec import RadarSpec
from scarl_sionna.core.units import SPEED_OF_LIGHT
from scarl_sionna.radar.paths import RadarPaths

from .motion import is_known

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

NEAREST_SHARE = 0.1
"""A path's end is taken as coming no nearer than this share of its distance, in bounds only."""


def frame_span(radar: RadarSpec) -> float:
    """Return the time from a frame's first sample to its last [s]."""
    last = (radar.num_chirps - 1) * radar.doppler_interval + radar.tx_delay(radar.num_tx - 1)
    late = radar.waveform.chirp_delays
    return last + (radar.num_samples - 1) / radar.sample_rate + (0.0 if late is None else max(0.0, *late))


def largest_wavenumber(radar: RadarSpec) -> float:
    """Return the wavenumber of the highest frequency [rad/m]."""
    return 2.0 * np.pi * radar.waveform.top_frequency / SPEED_OF_LIGHT


@dataclass(frozen=True, eq=False)
class Change:
    """Bounds on how the ends of paths change, summed over both; arrays of shape (num_paths,).

    Attributes
    ----------
    growth : ndarray of float64
        Of the strength: speed over distance [1/s].
    apart : ndarray of float64
        Between the rates of an antenna pair and of the array centres [m/s].
    bend, third : ndarray of float64
        Second and third derivative of the length [m/s2], [m/s3].
    uneven : ndarray of float64
        Between the second derivatives for an antenna pair and for the array centres [m/s2].
    """

    growth: Array
    apart: Array
    bend: Array
    third: Array
    uneven: Array

    @classmethod
    def of(cls, paths: RadarPaths, radar: RadarSpec) -> Change:
        """Return the bounds over a frame of paths whose velocities are known."""
        span = frame_span(radar)
        zero = np.zeros(paths.num_paths)
        growth, apart, bend, third, uneven = zero, zero, np.abs(paths.length_acceleration), zero, zero
        mirror = paths.is_mirror_chain
        arms = [float(np.linalg.norm(array, axis=1).max()) for array in (radar.tx_array, radar.rx_array)]
        spins = [float(np.linalg.norm(twist.angular)) for twist in (paths.tx_twist, paths.rx_twist)]
        names = ("tx_velocity", "rx_velocity")
        for number, (vector, name) in enumerate(zip(paths.end_vectors(), names, strict=True)):
            velocity = paths.filled(name)
            if number == 0:  # the only end of a path of mirrors is the receiver's image
                velocity = np.where(mirror[:, None], paths.filled("rx_velocity"), velocity)
            distance = row_norm(vector)
            speed = row_norm(velocity)
            nearest = np.maximum(distance - span * speed, NEAREST_SHARE * distance)
            spin = spins[number]
            with np.errstate(divide="ignore", invalid="ignore"):
                moment = row_norm(row_cross(vector, velocity))  # does not change in straight motion
                across = moment / nearest
                turning = across / nearest + spin
                counts = np.ones(paths.num_paths) if number == 0 else 1.0 - mirror
                growth = growth + counts * speed / nearest
                bend = bend + counts * across**2 / nearest
                third = third + counts * 3.0 * speed * (across / nearest) ** 2
                apart = apart + arms[number] * turning
                uneven = uneven + arms[number] * (3.0 * (speed / nearest) ** 2 + 2.0 * spin * speed / nearest + spin**2)
        return cls(growth, apart, bend, third, uneven)


def orders(paths: RadarPaths, radar: RadarSpec, tolerance: float | None) -> tuple[Mask, Mask, Mask, Mask]:
    """Return which paths keep the rates of the array centres, which bend in doing so, which are linear, and the rest.

    Parameters
    ----------
    paths : RadarPaths
    radar : RadarSpec
    tolerance : float or None
        Largest error over a path's amplitude: phase [rad] and relative change of strength together. None keeps all to
        the rates and accelerations of the array centres.

    Returns
    -------
    held, bent, linear, moving : ndarray of bool, shape (num_paths,)
        `held`: rates of the array centres for every pair, no acceleration. `bent`: rates and accelerations of the array
        centres. `linear`: a rate of each pair. `moving`: exact motion.
    """
    known = is_known(paths)
    none = np.zeros(paths.num_paths, dtype=np.bool_)
    if tolerance is None or not known.any():
        return none, ~none, none, none
    change, span, wavenumber = Change.of(paths, radar), frame_span(radar), largest_wavenumber(radar)
    linear = known & paths.filled("linear_motion")
    error = wavenumber * span * change.apart
    more = span * change.growth + wavenumber * span**2 * (0.5 * change.bend + span / 6.0 * change.third)
    error = error + np.where(linear, 0.0, more)
    held = known & (error <= tolerance)
    return held, ~known, linear & ~held, known & ~linear & ~held
