"""Beat signal of free point scatterers as a plain sum over paths, antennas and samples. numpy only, SI units.

Written apart from the product: exact geometry of every antenna at every sample's time, so it also has what the product
leaves out (length rates that differ between antennas, derivatives above the second).
"""

from __future__ import annotations

import numpy as np

from .fmcw import C, beat_phase


def point_scatterer_signal(
    positions, velocities, amplitudes, tx, rx, frequency, slope, sample_rate, num_samples, chirp_times
):
    """Return (num_chirps, num_samples) of one pair; `chirp_times` are the starts of its ramps.

    The wave is received at t and meets the scatterer its return delay earlier; three fixed-point steps are exact to
    (v / c)^4.
    """
    ts = np.arange(num_samples) / sample_rate
    time = np.asarray(chirp_times)[:, None] + ts[None, :]
    out = np.zeros(time.shape, dtype=np.complex128)
    for position, velocity, amplitude in zip(positions, velocities, amplitudes, strict=True):
        back = np.zeros_like(time)
        for _ in range(3):
            point = position + velocity * (time - back)[..., None]
            back = np.linalg.norm(point - rx, axis=-1) / C
        tau = back + np.linalg.norm(point - tx, axis=-1) / C
        out += amplitude * np.exp(1j * np.mod(beat_phase(frequency, slope, tau, ts), 2.0 * np.pi))
    return out
