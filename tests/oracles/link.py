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
