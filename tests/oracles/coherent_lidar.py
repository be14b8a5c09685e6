"""Exact answers about a coherent lidar, written down apart from the package (numpy and scipy only)."""

from __future__ import annotations

import numpy as np
from scipy.integrate import quad
from scipy.special import gammaln, ive

C = 299_792_458.0
H = 6.62607015e-34
Q = 1.602176634e-19


def photoelectrons(power: float, duration: float, wavelength: float, efficiency: float) -> float:
    """Mean number of photoelectrons of a power [W] in a time [s]."""
    return power * duration * efficiency * wavelength / (H * C)


def gaussian_overlap(wavelength: float, radius: float) -> float:
    """lambda^2 times the plane integral of a unit-power Gaussian beam's squared irradiance, by quadrature."""

    def integrand(r: float) -> float:
        irradiance = 2.0 / (np.pi * radius**2) * np.exp(-2.0 * r * r / radius**2)
        return irradiance**2 * 2.0 * np.pi * r

    return wavelength**2 * quad(integrand, 0.0, 6.0 * radius, epsabs=0.0, epsrel=1e-10)[0]


def fisher_frequency_deviation(snr: float, interval: float, number: int) -> float:
    """Cramer-Rao bound of a tone's frequency [Hz] from the Fisher matrix of frequency, phase and amplitude."""
    time = np.arange(number) * interval
    tone = np.exp(2j * np.pi * 0.1 / interval * time)
    amplitude = np.sqrt(snr)  # noise of unit power
    gradient = np.stack([2j * np.pi * time * amplitude * tone, 1j * amplitude * tone, tone])
    fisher = 2.0 * np.real(np.conj(gradient) @ gradient.T)
    return float(np.sqrt(np.linalg.inv(fisher)[0, 0]))


def marcum_tail(order: int, noncentrality: float, level: float) -> float:
    """P(sum of `order` abs(a_m + n_m)^2 > level) by quadrature.

    n is circular of unit power; sum abs(a_m)^2 = noncentrality.
    """

    def density(t: float) -> float:
        z = 2.0 * np.sqrt(noncentrality * t)
        bessel = ive(order - 1, z)
        log = (order - 1) / 2.0 * np.log(t / noncentrality) - t - noncentrality + z
        return bessel * np.exp(log) if bessel > 0.0 else 0.0

    below = quad(density, 1e-12, level, limit=400, points=[min(level, noncentrality)])[0]
    return 1.0 - below


def joint_detection(cnr: float, level: float, looks: int) -> float:
    """Both of two chirps above a level, with the same Gamma(looks) speckle, by quadrature."""

    def integrand(s: float) -> float:
        weight = np.exp((looks - 1) * np.log(s) - s - gammaln(looks))
        return weight * marcum_tail(looks, cnr * s, level) ** 2

    return quad(integrand, 1e-9, 12.0 * looks + 20.0, limit=200)[0]


def clipped_fundamental(ratio: float) -> float:
    """Amplitude of the fundamental of a cosine of amplitude 1 clipped at `ratio` < 1, by a sum over one period."""
    angle = (np.arange(200_000) + 0.5) / 200_000 * 2.0 * np.pi
    return float(2.0 * np.mean(np.clip(np.cos(angle), -ratio, ratio) * np.cos(angle)))
