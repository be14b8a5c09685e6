"""Directions from one snapshot: the least variance that any unbiased estimate can have. numpy only."""

from __future__ import annotations

import numpy as np


def direction_bound(places: np.ndarray, sines: np.ndarray, amplitudes: np.ndarray, noise_power: float) -> np.ndarray:
    """Return the Cramer-Rao bounds of the sines (k,): variances of unbiased estimates of all of them together.

    `places` (n,) are those of the elements [wavelengths], `amplitudes` (k,) complex and unknown [sqrt(W)],
    `noise_power` that of a channel [W]. P. Stoica, A. Nehorai, IEEE Trans. Acoust. Speech Signal Process. 37(5), 1989.
    """
    beams = np.exp(-2j * np.pi * np.outer(places, sines))
    slopes = -2j * np.pi * places[:, None] * beams
    projector = np.eye(len(places)) - beams @ np.linalg.pinv(beams)
    fisher = np.real((slopes.conj().T @ projector @ slopes) * np.outer(np.conj(amplitudes), amplitudes))
    return np.diag(np.linalg.inv(fisher)) * noise_power / 2.0
