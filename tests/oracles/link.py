"""Link budget of a point target in free space. numpy only, SI units."""

from __future__ import annotations

import numpy as np

C = 299_792_458.0
BOLTZMANN = 1.380649e-23


def received_power(power, gain, frequency, rcs, distance):
    """Radar equation, monostatic, the same gain both ways [W]."""
    return power * gain**2 * (C / frequency) ** 2 * rcs / ((4.0 * np.pi) ** 3 * distance**4)


def noise_power(bandwidth, noise_figure):
    """k T0 B F at 290 K [W]."""
    return BOLTZMANN * 290.0 * bandwidth * noise_figure


# 77 GHz, 12 dBm, 10 dBi, noise figure 12 dB, 10 dBsm, 512 samples at 20 MHz, 256 chirps:
# distance [m], received power [dBm], SNR after a 2D FFT without a window [dB]
LINK_TABLE = (
    (10.0, -79.16969636555, 60.97029013491),
    (50.0, -107.128496539, 33.01148996147),
    (100.0, -119.1696963656, 20.97029013491),
    (200.0, -131.2108961921, 8.929090308352),
)


def friis(frequency, distance):
    """Amplitude and phase of a link between isotropic antennas in free space, e^{+jwt}."""
    wavelength = C / frequency
    return wavelength / (4.0 * np.pi * distance) * np.exp(-2j * np.pi * distance / wavelength)


def two_ray(frequency, distance, heights, permittivity, coherence):
    """Direct and ground ray between isotropic antennas over a flat half space, by image theory: V, then H.

    `coherence` is what a rough ground leaves of the mirrored field.
    """
    low, high = heights
    direct, mirrored = np.hypot(distance, high - low), np.hypot(distance, high + low)
    sine = (high + low) / mirrored
    root = np.sqrt(permittivity - (1.0 - sine**2))
    out = []
    for upper in (permittivity * sine, sine):
        coefficient = coherence * (upper - root) / (upper + root)
        out.append(friis(frequency, direct) + coefficient * friis(frequency, mirrored))
    return np.array(out)
