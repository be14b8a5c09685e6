"""Monte Carlo of an FMCW lidar in fog: droplets at random places, their beats sample by sample, peaks and pairs.

Independent of the lidar's code: phases straight from the delays of each droplet, a heavily padded transform, and loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

SPEED_OF_LIGHT = 299_792_458.0
_PADDING = 16
_BATCH = 25
"""Shots that share the places of the droplets, not their amplitudes."""
_DROPLETS_A_CELL = 5


@dataclass(frozen=True)
class Chirps:
    """What the Monte Carlo needs to know of a lidar."""

    wavelength: float
    bandwidth: float
    chirp_time: float
    num_samples: int
    max_distance: float
    max_velocity: float
    level: float

    @property
    def slope(self) -> float:
        return self.bandwidth / self.chirp_time

    @property
    def cell(self) -> float:
        return SPEED_OF_LIGHT / (2.0 * self.bandwidth)


def foggy_shots(
    chirps: Chirps,
    cnr: Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]],
    end: float,
    velocity: float,
    number: int,
    rng: np.random.Generator,
) -> npt.NDArray[np.float64]:
    """Return distance [m] and radial velocity [m/s] of the strongest pair of each shot, NaN where there is none.

    `cnr` is the mean carrier-to-noise ratio of a cell at a distance [m]; the fog ends at `end` [m]. Shape (number, 2).
    """
    samples = chirps.num_samples
    time = (np.arange(samples) - (samples - 1) / 2.0) * chirps.chirp_time / samples  # from the middle of the chirp
    carrier = SPEED_OF_LIGHT / chirps.wavelength
    found = np.full((number, 2), np.nan)
    for start in range(0, number, _BATCH):
        count = min(_BATCH, number - start)
        droplets = int(end / chirps.cell * _DROPLETS_A_CELL)
        distance = (np.arange(droplets) + rng.random(droplets)) * (end / droplets)  # no clumps: fog has far more
        share = cnr(distance) / _DROPLETS_A_CELL / samples
        phase = 2j * np.pi * rng.random((count, droplets))
        amplitude = np.sqrt(share * rng.standard_exponential((count, droplets))) * np.exp(phase)
        spectra = []
        for sign in (1.0, -1.0):
            delay = 2.0 * (distance[:, None] + velocity * time) / SPEED_OF_LIGHT
            moved = delay - 2.0 * distance[:, None] / SPEED_OF_LIGHT
            # sent times the conjugate of received: phi(t) - phi(t - tau); 2 pi f_0 tau at rest is in the random phase
            turns = carrier * moved + sign * chirps.slope * (delay * time - 0.5 * delay**2)
            signal = amplitude @ np.exp(2j * np.pi * turns)
            noise = rng.standard_normal((2, count, samples)) * np.sqrt(0.5)
            spectra.append(np.abs(np.fft.fft(signal + noise[0] + 1j * noise[1], _PADDING * samples)) ** 2 / samples)
        found[start : start + count] = [_strongest(chirps, up, down) for up, down in zip(*spectra, strict=True)]
    return found


def _strongest(
    chirps: Chirps, up: npt.NDArray[np.float64], down: npt.NDArray[np.float64]
) -> tuple[float, float] | tuple[None, None]:
    rate = chirps.num_samples / chirps.chirp_time
    shift = 2.0 * chirps.max_velocity / chirps.wavelength
    low, high = -shift, 2.0 * chirps.slope * chirps.max_distance / SPEED_OF_LIGHT + shift
    line = np.arange(len(up)) / len(up) * rate
    beats = []
    for sign, power in ((1.0, up), (-1.0, down)):
        beat = low + np.mod(sign * line - low, rate)
        inside = np.where(beat <= high, power, 0.0)
        place = int(np.argmax(inside))
        if inside[place] <= chirps.level:
            return np.nan, np.nan
        below, top, above = power[place - 1], power[place], power[(place + 1) % len(power)]
        beside = 0.5 * (below - above) / (below - 2.0 * top + above)  # of the parabola through the peak
        beats.append(sign * beat[place] + beside * line[1])
    distance = SPEED_OF_LIGHT / (4.0 * chirps.slope) * (beats[0] - beats[1])
    velocity = chirps.wavelength / 4.0 * (beats[0] + beats[1])
    if not (0.0 < distance <= chirps.max_distance and abs(velocity) <= chirps.max_velocity):
        return np.nan, np.nan
    return distance, velocity
