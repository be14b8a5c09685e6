"""Exact far fields of short antennas in space, as Cartesian vectors; numpy and scipy only.

Time dependence e^{+j w t}, fields normalised so that abs(E)**2 is the gain. With the unit vector u:

    dipole of moment m:   E = sqrt(1.5) (m - (m u) u)          (against the charge's own sign: m points where E does)
    loop of moment m:     E = sqrt(1.5) m x u
    Huygens source (dipole along y, loop along z, both half as strong as the peak needs), boresight x:
                          E = sqrt(3)/2 (y - (y u) u + z x u)

A scatterer whose matrix is the same for every polarisation brings E_rx . E_tx; a general one E_rx . S E_tx.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation


def turned(azimuth_deg, elevation_deg, roll_deg):
    """The rotation of an antenna: roll about its x, then elevation (up positive), then azimuth (left positive)."""
    return Rotation.from_euler("ZYX", [azimuth_deg, -elevation_deg, roll_deg], degrees=True).as_matrix()


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def dipole(moment, directions):
    u = unit(directions)
    return np.sqrt(1.5) * (moment - (u @ moment)[..., None] * u)


def loop(moment, directions):
    return np.sqrt(1.5) * np.cross(moment, unit(directions))


def huygens(turn, directions):
    y, z = turn[:, 1], turn[:, 2]
    return (dipole(y, directions) + loop(z, directions)) * np.sqrt(0.5)


def sphere_basis(directions):
    """Theta-hat and phi-hat by derivatives of the position to colatitude and azimuth."""
    x, y, z = np.moveaxis(unit(directions), -1, 0)
    theta, phi = np.arccos(z), np.arctan2(y, x)
    along = np.stack([np.cos(theta) * np.cos(phi), np.cos(theta) * np.sin(phi), -np.sin(theta)], axis=-1)
    return along, np.stack([-np.sin(phi), np.cos(phi), 0.0 * phi], axis=-1)


def transfer(a, tx_directions, rx_directions):
    """Polarimetric transfers (P, 2, 2) as Cartesian matrices (P, 3, 3)."""
    there, back = sphere_basis(tx_directions), sphere_basis(rx_directions)
    return sum(a[:, i, k, None, None] * back[i][:, :, None] * there[k][:, None, :] for i in range(2) for k in range(2))
