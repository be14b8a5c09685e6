"""A scanning radar sample by sample: antenna, targets and waves where they are at each instant. numpy only, SI."""

from __future__ import annotations

import numpy as np

C = 299_792_458.0


def gaussian_gain(angle, width, sidelobe):
    """Power gain over its peak of a Gaussian lobe with a half-power width, beside it an envelope of 12 dB an octave."""
    edge = 0.5 * width * np.sqrt(np.log(sidelobe) / np.log(0.5))
    angle = np.abs(angle)
    return np.where(angle < edge, 0.5 ** ((2.0 * angle / width) ** 2), sidelobe * (edge / np.maximum(angle, edge)) ** 4)


def delay(sensor, target, t):
    """Two-way delay of what is received at times t: both ends move while the wave is on its way.

    `sensor` and `target` give positions (..., 3) at times (...).
    """
    there, back = np.zeros_like(t), np.zeros_like(t)
    for _ in range(6):
        hit = t - back
        back = np.linalg.norm(target(hit) - sensor(t), axis=-1) / C
        there = np.linalg.norm(target(t - back) - sensor(t - back - there), axis=-1) / C
    return there + back


def straight(position, velocity):
    """Positions of a point in straight motion."""
    return lambda t: np.asarray(position, float) + np.asarray(t)[..., None] * np.asarray(velocity, float)


def turn(times, ramp, beam, sensor, targets):
    """Beat signals of ramps [sqrt(W)], shape (num_ramps, num_samples).

    Parameters
    ----------
    times : ndarray (num_ramps,)
        Starts of the ramps.
    ramp : tuple
        Frequency of the radar equation, start frequency and slope of the ramps (num_ramps,), times of the samples.
    beam : tuple
        Peak gain, width over azimuth and over elevation [rad], sidelobe level, direction of the antenna over time in
        the world's axes [rad].
    sensor : callable
        Positions at times.
    targets : list of (callable, rcs)
    power of the transmitter is 1 W.
    """
    carrier, start, slope, inside = ramp
    peak, wide, high, sidelobe, direction = beam
    t = times[:, None] + inside
    out = np.zeros(t.shape, complex)
    for target, rcs in targets:
        tau = delay(sensor, target, t)
        offset = target(t - 0.5 * tau) - sensor(t)
        distance = np.linalg.norm(offset, axis=-1)
        aside = np.angle(np.exp(1j * (np.arctan2(offset[..., 1], offset[..., 0]) - direction(t))))
        up = np.arcsin(offset[..., 2] / distance)
        gain = peak * gaussian_gain(aside, wide, sidelobe) * gaussian_gain(up, high, sidelobe)
        size = gain * (C / carrier) * np.sqrt(rcs / (4.0 * np.pi) ** 3) / distance**2
        cycles = start[:, None] * tau + slope[:, None] * tau * (inside - 0.5 * tau)
        out += size * np.exp(2j * np.pi * (cycles - np.rint(cycles)))
    return out


def hann_response(bins):
    """Amplitude of a tone beside its frequency by so many bins, under a long Hann window; 1 at 0."""
    x = np.asarray(bins, float)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.sinc(x) / (1.0 - x**2)
    return np.where(np.abs(np.abs(x) - 1.0) < 1e-9, 0.5, out)
