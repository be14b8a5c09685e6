"""Signals of one point from what a radar sends and the exact retarded delay; numpy only.

The wave that arrives at the time t was scattered at the time t_h with ``|x(t_h)| = c (t - t_h)`` and left as much
earlier again: a radar at rest in the origin, one antenna (or two places), a point of strength 1 at the start.
"""

from __future__ import annotations

import numpy as np

C = 299792458.0
ORIGIN = (np.zeros(3), np.zeros(3))


def retarded(position, velocity, time, antennas=ORIGIN):
    """Return the round-trip delay [s] and the strength over that at time 0, for times of reception [s] of any shape.

    `antennas` are the places of the transmitter and the receiver; strengths are over that at the origin.
    """
    position, velocity, time = np.asarray(position, float), np.asarray(velocity, float), np.asarray(time, float)
    sender, receiver = (np.asarray(place, float) for place in antennas)
    # |p + v (t - s)|**2 = c**2 s**2 for the way back s
    at = position - receiver + time[..., None] * velocity
    a, b, c = velocity @ velocity - C**2, -2.0 * at @ velocity, np.sum(at * at, axis=-1)
    back = (-b - np.sqrt(b * b - 4.0 * a * c)) / (2.0 * a)
    place = position + (time - back)[..., None] * velocity
    if antennas is ORIGIN:
        return 2.0 * back, (position @ position) / np.sum(place * place, axis=-1)
    out = np.linalg.norm(place - sender, axis=-1)
    return back + out / C, (position @ position) / (out * back * C)


def turns(cycles):
    """Return exp(2j pi cycles) of extended-precision cycles."""
    return np.exp(2j * np.pi * np.asarray(cycles - np.rint(cycles), dtype=float))


def dechirped(position, velocity, starts, ts, carriers, slope, antennas=ORIGIN):
    """Return the transmitted ramp times the conjugate of what arrives, shape (chirps, samples).

    The ramp's phase at theta after its start is ``f theta + slope theta**2 / 2`` cycles.
    """
    delay, strength = retarded(position, velocity, starts[:, None] + ts, antennas)
    carriers, ts = np.asarray(carriers, np.longdouble)[:, None], np.asarray(ts, np.longdouble)

    def cycles(theta):
        return carriers * theta + np.longdouble(slope) * theta * theta / 2

    return strength * turns(cycles(ts) - cycles(ts - delay.astype(np.longdouble)))


def symbol_train(symbols, tones, interval, prefix, period, time):
    """Return what is sent at times [s] of any shape: sums of tones, each symbol after its prefix; nothing between.

    `symbols` are strengths, shape (num_symbols, num_tones), `tones` frequencies [Hz].
    """
    out = np.zeros(np.shape(time), complex)
    for number, strengths in enumerate(symbols):
        after = time - number * interval - prefix
        on = (after >= -prefix) & (after < period)
        for strength, tone in zip(strengths, tones, strict=True):
            out[on] += strength * turns(tone * after[on].astype(np.longdouble))
    return out


def chip_train(chips, chip_rate, time):
    """Return a periodic phase code in its band at times [s]: chips are pulses of all its lines, in closed form.

    The lines are those from -length // 2 on.
    """
    length = len(chips)
    out = np.zeros(np.shape(time), complex)
    for number, chip in enumerate(chips):
        place = np.mod(time * chip_rate - number, length)
        place = np.where(np.abs(place - np.rint(place)) < 1e-9, np.rint(place) + 1e-9, place)
        pulse = (np.exp(2j * np.pi * place) - 1.0) / (np.exp(2j * np.pi * place / length) - 1.0) / length
        out += chip * pulse * np.exp(-2j * np.pi * (length // 2) * place / length)
    return out


def received(position, velocity, times, carrier, sent, antennas=ORIGIN):
    """Return what arrives of `sent` (a function of time), mixed with the carrier, for times of any shape."""
    delay, strength = retarded(position, velocity, times, antennas)
    return strength * sent(times - delay) * turns(-np.longdouble(carrier) * delay.astype(np.longdouble))


def factors_in_turn(factors, interval, change, time):
    """Return the factor of a code that is sent all the time: each chirp's, reached as a raised cosine in `change` [s].

    Before the first chirp it is the first one's.
    """
    number = np.clip(np.floor(time / interval).astype(int), 0, len(factors) - 1)
    share = np.clip((time - number * interval) / change, 0.0, 1.0)
    weight = 0.5 - 0.5 * np.cos(np.pi * share)
    return factors[number] * weight + factors[np.maximum(number - 1, 0)] * (1.0 - weight)
