"""Beat signal of a point that moves straight past a radar that moves straight on and turns. numpy only, SI units.

Written apart from the product: every sample's wave is followed back in time. The receiver's antenna at the time t of
reception, the point when the wave met it, the transmitter's antenna when the wave left, each where it was then;
the strength is that of both distances, isotropic antennas.
"""

from __future__ import annotations

import numpy as np

from .fmcw import C, beat_phase


def turned(vector, spin, time):
    """Rodrigues' rotation of a vector by `spin` [rad/s] over times (...), shape (..., 3)."""
    rate = np.linalg.norm(spin)
    if rate == 0.0:
        return np.broadcast_to(vector, (*np.shape(time), 3))
    axis, angle = np.asarray(spin) / rate, rate * np.asarray(time)[..., None]
    parallel = axis * (axis @ vector)
    return parallel + (vector - parallel) * np.cos(angle) + np.cross(axis, vector) * np.sin(angle)


def crossing_signal(point, velocity, radar_velocity, spin, tx, rx, strength, frequency, slope, times, ts):
    """Return the signal at reception times (num_chirps, num_samples) of one pair.

    `tx` and `rx` are the antennas at time 0 from the radar's origin, which is at the origin at time 0 [m]; `strength`
    is the amplitude times both distances.
    """
    receiver = turned(rx, spin, times) + times[..., None] * radar_velocity
    back = np.zeros_like(times)
    for _ in range(4):  # each step gains a factor of v / c
        met = point + (times - back)[..., None] * velocity
        home = np.linalg.norm(met - receiver, axis=-1)
        back = home / C
    delay = 2.0 * back
    for _ in range(4):
        left = times - delay
        out = np.linalg.norm(met - turned(tx, spin, left) - left[..., None] * radar_velocity, axis=-1)
        delay = back + out / C
    return strength / (out * home) * np.exp(1j * np.mod(beat_phase(frequency, slope, delay, ts), 2.0 * np.pi))
