"""Closed-form answers for a point in front of an FMCW radar: beat phase, Doppler, wavefronts. numpy only, SI units.

Beat signal = transmit times conj(receive); t is the time of reception since the first ramp's start.
"""

from __future__ import annotations

import numpy as np

C = 299_792_458.0


def moving_point_delay(distance, velocity, t):
    """Exact two-way delay of a point at ``distance + velocity * t``.

    The wave meets it half a delay before reception.
    """
    return 2.0 * (distance + velocity * t) / (C + velocity)


def beat_phase(frequency, slope, tau, ts):
    """Unwrapped phase [rad] of tx * conj(rx) for the transmit phase 2 pi (f t + slope t^2 / 2)."""
    return 2.0 * np.pi * (frequency * tau + slope * tau * ts - 0.5 * slope * tau**2)


def stop_and_hop_phase(frequency, slope, distance, velocity, chirp_time, ts):
    """The same if the point stood still from a ramp's start until its echo is back: what the paper's eq. (2) has."""
    return beat_phase(frequency, slope, 2.0 * (distance + velocity * chirp_time) / C, ts)


def crossing_distance(offset, speed, t):
    """Distance of a point that passes at `offset` with `speed`, nearest at t = 0."""
    return np.hypot(offset, speed * t)


def crossing_doppler(frequency, offset, speed, t):
    """Its Doppler shift [Hz]."""
    return -2.0 * frequency / C * speed**2 * t / crossing_distance(offset, speed, t)


# Phases of the moving point: f 76.5 GHz, 500 MHz in 25.6 us, 20 MHz, 512 samples, 256 chirps every 40 us,
# 50 m, -30 m/s, samples 0, 256, 511 (columns) of chirps 0, 128, 255 (rows) [rad, modulo 2 pi]; computed from the two
# formulas above in extended precision.
MOVING_POINT_PHASES = np.array(
    [
        [3.576789020061, 4.798446295509, 3.970204034569],
        [1.166728271443, 0.7787760868401, 4.630397209932],
        [2.604184817255, 0.6191982464679, 2.88002339898],
    ]
)
STOP_AND_HOP_ERRORS = np.array(
    [
        [-0.01604294925346, 1.219174767321, 2.457568366022],
        [-0.01599366942537, 1.21922453033, 2.45761861041],
        [-0.01594477467006, 1.219273904542, 2.457668462157],
    ]
)

# One-way phases -k (r_i - R) [rad] of a point at (R [m], azimuth [deg]) on the first and the last of 192 elements
# spaced half a wavelength at 77 GHz: r_i = |p - p_i|, y_i = (i - 95.5) lambda / 2.
ULA192_PHASES = (
    (1.0, 0.0, -27.6516936715, -27.6516936715),
    (1.0, 30.0, -169.0458532854, 127.1298931527),
    (1.0, 60.0, -265.8224457729, 251.5420063081),
    (2.0, 0.0, -13.91430390506, -13.91430390506),
    (2.0, 30.0, -159.9900457069, 139.0625361704),
    (2.0, 60.0, -263.0516161254, 256.0378998229),
    (5.0, 0.0, -5.575792099169, -5.575792099169),
    (5.0, 30.0, -154.1169603922, 145.7496619767),
    (5.0, 60.0, -261.1775783045, 258.3860667439),
    (10.0, 0.0, -2.788618352707, -2.788618352707),
    (10.0, 30.0, -152.0832980119, 147.8999187899),
    (10.0, 60.0, -260.5129118924, 259.1181508592),
    (50.0, 0.0, -0.5577699295642, -0.5577699295642),
    (50.0, 30.0, -150.4286007504, 149.5919422415),
    (50.0, 60.0, -259.965754198, 259.6868656186),
)

# Lengths |p - tx_i| + |p - rx_j| [m] and their phases -k L modulo 2 pi [rad] at 77 GHz for a point at 1.5 m, 25 deg,
# transmitters at y = -45, 0, 45 mm, receivers at (j - 1.5) lambda / 2.
MIMO_TX_Y = (-0.045, 0.0, 0.045)
MIMO_RX_Y = (-0.002920056409091, -0.0009733521363636, 0.0009733521363636, 0.002920056409091)
MIMO_LENGTHS = np.array(
    [
        [3.020801624312, 3.019976838185, 3.019154125552, 3.018333489826],
        [3.001236401844, 3.000411615717, 2.999588903083, 2.998768267358],
        [2.98278003423, 2.981955248103, 2.98113253547, 2.980311899744],
    ]
)
MIMO_PHASES = np.array(
    [
        [0.7801224755751, 2.111162877175, 3.438857073929, 4.763199555385],
        [0.938565007047, 2.269605408647, 3.597299605402, 4.921642086857],
        [5.590722141587, 0.6385772360076, 1.966271432762, 3.290613914217],
    ]
)
