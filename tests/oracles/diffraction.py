"""Exact fields around perfectly conducting half planes and wedges in a plane wave, and the knife edge of ITU-R P.526.

Time dependence e^{+jwt}; the incident wave is exp(j k rho cos(phi - phi0)), 1 at the edge. "soft" is an electric field
along the edge (zero on the faces), "hard" a magnetic field along it. Imports numpy and scipy only.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfc, fresnel, jv


def half_plane(wavenumber: float, rho: float, phi: float, phi0: float, kind: str) -> complex:
    """Total field by Sommerfeld, 1896: M. Born, E. Wolf, Principles of Optics, section 11.5."""

    def part(angle: float) -> complex:
        depth = np.sqrt(2.0 * wavenumber * rho) * np.cos(angle / 2.0)
        return complex(0.5 * np.exp(1j * wavenumber * rho * np.cos(angle)) * erfc(-np.exp(0.25j * np.pi) * depth))

    sign = -1.0 if kind == "soft" else 1.0
    return part(phi - phi0) + sign * part(phi + phi0)


def wedge(wavenumber: float, rho: float, phi: float, phi0: float, exterior: float, kind: str) -> complex:
    """Total field by the series of eigenfunctions: C. Balanis, Advanced Engineering Electromagnetics, section 13.3."""
    n = exterior / np.pi
    order = np.arange(int(n * (wavenumber * rho + 30.0 * np.cbrt(wavenumber * rho) + 30.0)))
    sign = -1.0 if kind == "soft" else 1.0
    angles = np.cos(order / n * (phi - phi0)) + sign * np.cos(order / n * (phi + phi0))
    terms = np.where(order == 0, 1.0, 2.0) * jv(order / n, wavenumber * rho) * np.exp(0.5j * np.pi * order / n) * angles
    return complex(terms.sum() / n)


def knife_edge(clearance: float, before: float, behind: float, wavelength: float) -> complex:
    """Field behind a screen over that without it; `clearance` of the line of sight above the edge [m].

    ITU-R P.526-15, 4.1.
    """
    nu = -clearance * np.sqrt(2.0 * (before + behind) / (wavelength * before * behind))
    sine, cosine = fresnel(nu)
    return complex((1.0 + 1j) / 2.0 * ((0.5 - cosine) - 1j * (0.5 - sine)))


def keller_backscatter(wavenumber: float, phi: float, kind: str) -> complex:
    """Diffraction coefficient of a half plane back to the source at the angle phi from it [m^0.5]: J. Keller, 1962."""
    sign = -1.0 if kind == "soft" else 1.0
    return complex(-np.exp(-0.25j * np.pi) / (2.0 * np.sqrt(2.0 * np.pi * wavenumber)) * (1.0 + sign / np.cos(phi)))
