"""Radar cross sections known exactly: closed forms of physical and geometrical optics, and the Mie series.

Lengths [m], angles [rad], k = 2 pi / wavelength, sinc(x) = sin(x) / x. Sources:

- plate, disk, cylinder, dihedral, trihedral: G. T. Ruck et al., *Radar Cross Section Handbook*, 1970, chapters 4, 7 and
  8; E. F. Knott et al., *Radar Cross Section*, 2nd ed., sections 5.3 and 6.4. The dBsm numbers below are these formulas
  at 77 GHz in double precision, from the project's reference vectors (`rcs` of analytic_vectors).
- sphere: J. J. Bowman et al., *Electromagnetic and Acoustic Scattering by Simple Shapes*, 1969, section 10.2 (Mie), and
  the physical-optics integral of a sphere's lit half.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from scipy.special import j1, spherical_jn, spherical_yn, struve

SPEED_OF_LIGHT = 299_792_458.0
WAVELENGTH_77 = SPEED_OF_LIGHT / 77e9
DATA = Path(__file__).parents[1] / "data" / "rcs"

PLATE_DEG = (0, 0.25, 0.5, 0.75, 1.0, 1.5957, 2, 5, 10, 20, 30)
PLATE_DBSM = (  # 0.1 m x 0.1 m at 77 GHz
    19.18549908511,
    18.45537941236,
    16.09613355282,
    11.34766481753,
    0.2774371470511,
    5.920670227421,
    -0.1828124792223,
    -3.833047237348,
    -21.99649351522,
    -16.39964047317,
    -21.74806043745,
)
PLATE_FIRST_NULL_DEG = 1.115449848322
DISK_DEG = (0, 0.5, 1, 2, 5, 10)
DISK_DBSM = (17.08729671244, 14.8365087336, 6.244811479809, -1.503878816211, -16.74537688421, -23.78394428949)
DISK_FIRST_NULL_DEG = 1.360522508993
CYLINDER_DEG = (0, 0.05, 0.1, 0.2, 0.5, 1.0)  # radius 0.05 m, height 0.5 m, off broadside
CYLINDER_DBSM = (13.04759903611, 12.31755586874, 9.958476227778, -5.863127800773, -7.158344708213, -9.939622149335)
CYLINDER_FIRST_NULL_DEG = 0.223076441166
TRIHEDRAL_DBSM = 14.41428653792  # triangular, leg 0.1 m, boresight
TRIHEDRAL_AZIMUTH_DEG = (45, 50, 55, 60, 65, 70, 75)
TRIHEDRAL_AZIMUTH_DBSM = (
    14.41428653792,
    14.30329352591,
    13.96100113252,
    13.35671771647,
    12.42825964468,
    11.05641259046,
    8.995935500528,
)
DIHEDRAL_DBSM = 22.19579904175  # 0.1 m x 0.1 m plates, boresight
MIE = {0.1: 0.0008983365972, 1.0: 3.637566543, 5.0: 1.168837049, 50.0: 0.9959176788, 500.0: 0.9999999021}
"""sigma / (pi a^2) of a perfectly conducting sphere by ka; more in `mie_sphere`, which must give this."""


def sinc(x):
    return np.sinc(np.asarray(x) / np.pi)


def plate(a, b, wavelength, theta):
    """Return PO's RCS of a rectangle a x b, turned by theta in the plane of side a."""
    k = 2 * np.pi / wavelength
    return 4 * np.pi * (a * b / wavelength) ** 2 * np.cos(theta) ** 2 * sinc(k * a * np.sin(theta)) ** 2


def disk(radius, wavelength, theta):
    x = 4 * np.pi / wavelength * radius * np.sin(theta)
    pattern = np.where(np.abs(x) < 1e-9, 1.0, 2 * j1(x) / np.where(x == 0, 1.0, x))
    return 4 * np.pi * (np.pi * radius**2 / wavelength) ** 2 * np.cos(theta) ** 2 * pattern**2


def cylinder(radius, height, wavelength, psi):
    """Return the RCS of a cylinder's side, psi off broadside (stationary phase around the axis)."""
    k = 2 * np.pi / wavelength
    return k * radius * height**2 * np.cos(psi) * sinc(k * height * np.sin(psi)) ** 2


def cylinder_physical_optics(radius, height, wavelength, psi):
    """Return PO's RCS of a capped cylinder, psi off broadside towards a cap, exact.

    S = (k / 2 pi) int (n . r) exp(2jk r . x) dA over the lit side and cap. Around the side the integral of cos(f)
    exp(jz cos f) over -pi/2..pi/2 is 2 - pi H1(z) + j pi J1(z), with Struve's H1 (M. Abramowitz, I. Stegun, 9.1.20 and
    12.1.7).
    """
    k = 2 * np.pi / wavelength
    z = 2 * k * radius * np.cos(psi)
    side = (
        radius * height * np.cos(psi) * sinc(k * height * np.sin(psi)) * (2 - np.pi * struve(1, z) + 1j * np.pi * j1(z))
    )
    cap = np.sin(psi) * np.exp(1j * k * height * np.sin(psi)) * np.pi * radius**2 * 2 * j1(z) / z
    return 4 * np.pi * np.abs(k / (2 * np.pi) * (side + cap)) ** 2


def trihedral(leg, wavelength):
    return 4 * np.pi * leg**4 / (3 * wavelength**2)


def dihedral(a, b, wavelength):
    return 8 * np.pi * (a * b) ** 2 / wavelength**2


def sphere_physical_optics(ka):
    """Return sigma / (pi a^2) of PO's lit half sphere: S = -(a/2) (1 - (1 - exp(-2j ka)) / (2j ka)) up to a phase."""
    return abs(1 - (1 - np.exp(-2j * ka)) / (2j * ka)) ** 2


def mie_sphere(ka):
    """Return sigma / (pi a^2) of a perfectly conducting sphere, from the Mie series."""
    n = np.arange(1, int(ka + 4.05 * ka ** (1 / 3) + 12))
    jn, yn = spherical_jn(n, ka), spherical_yn(n, ka)
    h, dh = jn - 1j * yn, spherical_jn(n, ka, derivative=True) - 1j * spherical_yn(n, ka, derivative=True)
    a_n = (jn + ka * spherical_jn(n, ka, derivative=True)) / (h + ka * dh)
    b_n = jn / h
    return abs(np.sum((-1.0) ** n * (2 * n + 1) * (a_n - b_n))) ** 2 / ka**2


def table(name):
    """Return a reference cut as arrays by column: theta_deg, phi_deg, vv_dBlam2, hh_dBlam2, hv_dBlam2."""
    with open(DATA / f"{name}.csv") as stream:
        rows = [row for row in csv.reader(stream) if not row[0].startswith("#")]
    values = np.array(rows[1:], dtype=np.float64)
    return {column: values[:, i] for i, column in enumerate(rows[0])}


PLATE_MESH = ([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]], [[0, 1, 2], [0, 2, 3]])
"""Unit square in the xy plane."""
DIHEDRAL_MESH = (
    [[0, 0, -0.5], [1, 0, -0.5], [1, 0, 0.5], [0, 0, 0.5], [0, 1, -0.5], [0, 1, 0.5]],
    [[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 3]],
)
"""Two unit squares, xz (x > 0) and yz (y > 0), with the seam on z; boresight is theta = 90, phi = 45 deg."""
TRIHEDRAL_MESH = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2], [0, 2, 3], [0, 3, 1]])
"""Triangular trihedral of unit legs along +x, +y, +z; boresight is (1, 1, 1)."""
